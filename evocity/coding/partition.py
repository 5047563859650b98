"""Which leaves follow the city: each side searched exactly, then merged from the finest up.

The partition of least collage error + λ · number of lifs (Lagrangian pruning of a quadtree, as in
Shusterman & Feder 1994 for fractal codes), for the λ of a budget; or the coarsest of which no leaf
errs more than is allowed. The papers ask for partitions that follow the city and leave them open
(Marsault 2002 §6.1, 2005 §4.1-4.2).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from evocity.coding.matching import Matches, best_matches, near_best, pairs_compared
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.shapes import uneven_blocks
from evocity.coding.topology import closest_neighbourhood
from evocity.errors import GenomeError, keyword, setting
from evocity.pavement import Pavement

#: A lifs is worth at least this share of the highest roof's square, m²: what it saves below that
#: no eye and no measure sees, a thousandth of the roof in one pixel.
LEAST = 1e-6
_NAMES = ("multiple", "y", "x", "iso", "sigma", "beta")


@dataclass(frozen=True, eq=False)
class Level:
    """A map searched whole at one side, on the uniform ``pavement`` of that side.

    searched : numbers of the range blocks that were searched; the others are level, or kept.
    matches : what was found for them.
    error : float64 ``(rows, columns)``, collage error of each range block, m², summed over it.
    mean : float64 ``(n,)``, mean height of each range block, metres.
    """

    heights: np.ndarray
    pavement: Pavement
    searched: np.ndarray
    matches: Matches
    error: np.ndarray
    mean: np.ndarray
    pairs: int

    @classmethod
    def search(
        cls,
        heights: np.ndarray,
        side: int,
        covered: np.ndarray | None,
        domains: Sequence[int],
        reach: int | None,
        **asked,
    ) -> "Level":
        """Search all range blocks of ``side`` px of ``heights``; those wholly ``covered`` (bool
        ``(H, W)``) need no domain block. ``asked``: more arguments of `best_matches`."""
        pavement = Pavement(*heights.shape, side)
        blocks = pavement.blocks(heights)
        uneven = uneven_blocks(blocks)
        if covered is not None:
            uneven &= ~pavement.blocks(covered).all(axis=(1, 2))
        searched = np.flatnonzero(uneven)
        corners = tuple(corner[searched] for corner in pavement.corners)
        pools = domain_pools(heights, side, domains)
        matches = best_matches(pools, blocks[searched], corners, reach=reach, **asked)
        error = np.zeros(len(pavement))
        error[searched] = np.maximum(matches.energy - matches.gain, 0)
        return cls(
            heights,
            pavement,
            searched,
            matches,
            error.reshape(pavement.rows, pavement.columns),
            blocks.reshape(len(pavement), -1).mean(axis=1, dtype=np.float64),
            pairs_compared(heights.shape, side, domains, corners, reach),
        )

    def in_surroundings(self, which, tolerance: float, domains, **asked) -> "Level":
        """The same with those of the ``which`` range blocks that were searched coded by what, of
        nearly as good domain blocks, lies in surroundings most like theirs."""
        (at,) = np.nonzero(np.isin(self.searched, which))
        side, found = self.pavement.block, self.searched[at]
        corners = tuple(corner[found] for corner in self.pavement.corners)
        some = replace(
            self.matches,
            **{name: getattr(self.matches, name)[at] for name in (*_NAMES, "gain", "energy")},
        )
        pools = domain_pools(self.heights, side, domains)
        blocks = self.pavement.blocks(self.heights)[found]
        columns = {name: getattr(self.matches, name).copy() for name in _NAMES}
        for part, candidates in near_best(pools, blocks, corners, some, tolerance, **asked):
            places = tuple(corner[part] for corner in corners)
            chosen = closest_neighbourhood(self.heights, side, places, candidates)
            taken = chosen >= 0
            for name, column in columns.items():
                column[at[part[taken]]] = getattr(candidates, name)[chosen[taken]]
        return replace(self, matches=replace(self.matches, **columns))

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The nucleotides of all range blocks."""
        extent = self.matches.multiple * self.pavement.block
        found = {
            "sigma": self.matches.sigma,
            "beta": self.matches.beta,
            "x": self.matches.x,
            "y": self.matches.y,
            "dx": extent,
            "dy": extent,
            "iso": self.matches.iso,
        }
        columns = {}
        for name, values in found.items():
            column = np.zeros(len(self.pavement), np.float64 if name in ("sigma", "beta") else int)
            if name == "beta":
                column[:] = self.mean
            column[self.searched] = values
            columns[name] = column
        return columns


def chosen_leaves(errors: Sequence[np.ndarray], price: float) -> list[np.ndarray]:
    """The partition of least Σ error + ``price`` · number of leaves.

    errors : one ``(rows, columns)`` a side, from the finest to the root, each of half as many
        rows and columns as the one before, m².
    price : λ, m², 0 or more. Of partitions that cost the same the coarsest is taken.

    Returns bool arrays of the same shapes: which blocks of each side are leaves.
    """
    whole, cost = [np.ones(errors[0].shape, bool)], errors[0] + price
    for error in errors[1:]:
        parts = cost.reshape(error.shape[0], 2, error.shape[1], 2).sum(axis=(1, 3))
        own = error + price
        whole.append(own <= parts)
        cost = np.minimum(own, parts)
    return _topmost(whole)


def coarsest_leaves(
    errors: Sequence[np.ndarray], sides: Sequence[int], most: float
) -> list[np.ndarray]:
    """The coarsest partition of which no leaf has a collage error (root mean square, metres)
    above ``most``, leaves of the finest side apart, which cannot be split."""
    allowed = [error <= (most * side) ** 2 for error, side in zip(errors, sides, strict=True)]
    return _topmost([np.ones(errors[0].shape, bool), *allowed[1:]])


def leaves_within(errors: Sequence[np.ndarray], budget: int, least: float) -> list[np.ndarray]:
    """`chosen_leaves` of the lowest price, ``least`` or more, that gives at most ``budget``.

    Raises `GenomeError` if even the coarsest partition has more.
    """
    if errors[-1].size > budget:
        raise GenomeError(
            setting("lifs", budget),
            f"{errors[-1].size} or more: so many leaves has the coarsest partition",
            f"give a larger budget, or a larger root, for example {keyword('block', (2, 32))}",
        )

    def count(leaves: list[np.ndarray]) -> int:
        return sum(int(np.count_nonzero(one)) for one in leaves)

    best = chosen_leaves(errors, least)
    if count(best) <= budget:
        return best
    low, high = np.log(least), np.log(max(float(errors[-1].max()), least) + least)
    best = chosen_leaves(errors, np.exp(high))
    for _ in range(60):
        middle = (low + high) / 2
        leaves = chosen_leaves(errors, np.exp(middle))
        if count(leaves) > budget:
            low = middle
        else:
            best, high = leaves, middle
            if count(best) == budget:
                break
        if high - low < 1e-9:
            break
    return best


def _topmost(whole: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Of the blocks that may be leaves, from the finest side to the root, those no larger one
    holds."""
    leaves: list[np.ndarray] = []
    free = np.ones(whole[-1].shape, bool)
    for one in whole[::-1]:
        leaves.append(one & free)
        free = (free & ~one).repeat(2, 0).repeat(2, 1)
    return leaves[::-1]


@dataclass(frozen=True, eq=False)
class Partition:
    """Leaves chosen from several `Level`, the finest first; ``taken`` are their numbers in each."""

    levels: Sequence[Level]
    taken: Sequence[np.ndarray]

    @classmethod
    def of(cls, levels: Sequence[Level], choose: Callable) -> "Partition":
        """What ``choose(errors)`` takes of all ``levels``; the whole of a single one."""
        if len(levels) == 1:
            return cls(levels, [np.arange(len(levels[0].pavement))])
        leaves = choose([level.error for level in levels])
        return cls(levels, [np.flatnonzero(one) for one in leaves])

    def in_surroundings(self, tolerance: float, domains, **asked) -> "Partition":
        """See `Level.in_surroundings`."""
        searched = partial(Level.in_surroundings, tolerance=tolerance, domains=domains, **asked)
        pairs = zip(self.levels, self.taken, strict=True)
        return replace(self, levels=[searched(level, which) for level, which in pairs])

    def __len__(self) -> int:
        return sum(which.size for which in self.taken)

    @cached_property
    def _order(self) -> np.ndarray:
        top, left = (
            np.concatenate([level.pavement.corners[k][which] for level, which in self._pairs])
            for k in (0, 1)
        )
        return np.lexsort((left, top))

    @property
    def _pairs(self):
        return list(zip(self.levels, self.taken, strict=True))

    @property
    def pavement(self) -> Pavement:
        side = np.repeat([one.pavement.block for one in self.levels], [w.size for w in self.taken])
        return Pavement(*self.levels[0].heights.shape, side[self._order])

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The nucleotides of the leaves, in the order of the `pavement`."""
        return {
            name: np.concatenate([level.columns[name][which] for level, which in self._pairs])[
                self._order
            ]
            for name in self.levels[0].columns
        }

    @property
    def error(self) -> float:
        """Collage error of all leaves, m²."""
        return float(sum(level.error.ravel()[which].sum() for level, which in self._pairs))

    @property
    def uniform(self) -> int:
        """How many leaves needed no search."""
        return sum(
            int(np.count_nonzero(~np.isin(which, level.searched))) for level, which in self._pairs
        )

    def above(self, most: float) -> int:
        """How many leaves have a collage error (root mean square) above ``most`` metres."""
        return sum(
            int(np.count_nonzero(level.error.ravel()[which] > (most * level.pavement.block) ** 2))
            for level, which in self._pairs
        )
