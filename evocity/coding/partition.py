"""Partitions that follow the city: an exact search at each side, then merges from the finest up.

The result is the partition of least collage error + λ · number of lifs (Lagrangian pruning of a
quadtree: Shusterman & Feder 1994), or the coarsest partition within a bound on errors. The papers
leave such partitions open (Marsault 2002 §6.1, 2005 §4.1-4.2).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from evocity.coding.matching import Matches, best_matches, near_best, pairs_compared
from evocity.coding.matching.candidates import uneven_blocks
from evocity.coding.matching.domains import domain_pools
from evocity.coding.parameters import Coding
from evocity.coding.topology import closest_neighbourhood
from evocity.errors import GenomeError, keyword, setting
from evocity.pavement import Pavement

#: The least price of a lifs, as a share of the highest roof's square: an error of a thousandth of
#: the roof in one pixel, which no eye and no measure sees.
LEAST = 1e-6
_NAMES = ("multiple", "y", "x", "iso", "sigma", "beta")


@dataclass(frozen=True, eq=False)
class Level:
    """The search of a whole map at one side, on the uniform ``pavement`` of that side: its results,
    ``matches``, are those of the range blocks ``searched``; the others are level, or condensed.

    error, mean : collage error, ``(rows, columns)``, m², and mean height, ``(n,)``, m, of each
        block.
    pairs : number of pairs of the search.
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
        coding: Coding,
        **work,
    ) -> "Level":
        """Search all range blocks of ``side`` px of ``heights``, except those wholly ``covered``
        (bool ``(H, W)``). ``work``: threads and progress, as of `best_matches`."""
        pavement = Pavement(*heights.shape, side)
        blocks = pavement.blocks(heights)
        uneven = uneven_blocks(blocks)
        if covered is not None:
            uneven &= ~pavement.blocks(covered).all(axis=(1, 2))
        searched = np.flatnonzero(uneven)
        corners = tuple(corner[searched] for corner in pavement.corners)
        pools = domain_pools(heights, side, coding.domains)
        matches = best_matches(pools, blocks[searched], corners, coding, **work)
        error = np.zeros(len(pavement))
        error[searched] = np.maximum(matches.energy - matches.gain, 0)
        return cls(
            heights,
            pavement,
            searched,
            matches,
            error.reshape(pavement.rows, pavement.columns),
            blocks.reshape(len(pavement), -1).mean(axis=1, dtype=np.float64),
            pairs_compared(heights.shape, side, corners, coding),
        )

    def follow_surroundings(self, which, tolerance: float, coding: Coding, **work) -> "Level":
        """Code those of the range blocks ``which`` that have a match by the domain block, among
        nearly equal ones, whose surroundings are most like theirs."""
        (at,) = np.nonzero(np.isin(self.searched, which))
        side, numbers = self.pavement.block, self.searched[at]
        corners = tuple(corner[numbers] for corner in self.pavement.corners)
        kept = {name: getattr(self.matches, name)[at] for name in (*_NAMES, "gain", "energy")}
        some = replace(self.matches, **kept)
        pools = domain_pools(self.heights, side, coding.domains)
        blocks = self.pavement.blocks(self.heights)[numbers]
        columns = {name: getattr(self.matches, name).copy() for name in _NAMES}
        for part, candidates in near_best(pools, blocks, corners, some, tolerance, coding, **work):
            places = tuple(corner[part] for corner in corners)
            chosen = closest_neighbourhood(self.heights, side, places, candidates)
            taken = chosen >= 0
            for name, column in columns.items():
                column[at[part[taken]]] = getattr(candidates, name)[chosen[taken]]
        return replace(self, matches=replace(self.matches, **columns))

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The nucleotides of all range blocks."""
        columns = {}
        for name, values in self.matches.nucleotides(self.pavement.block).items():
            column = np.zeros(len(self.pavement), np.float64 if name in ("sigma", "beta") else int)
            if name == "beta":
                column[:] = self.mean
            column[self.searched] = values
            columns[name] = column
        return columns


def chosen_leaves(errors: Sequence[np.ndarray], price: float) -> list[np.ndarray]:
    """Choose the partition of least Σ error + ``price`` · number of leaves; of equal ones the
    coarsest.

    errors : ``(rows, columns)`` for each side, m², from the finest to the root, each half as long.

    Returns bool arrays of the same shapes: the leaves of each side.
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
    """Choose the coarsest partition whose leaves have a collage error (root mean square, metres)
    of at most ``most``. Leaves of the finest side, which cannot be split, may exceed it."""
    allowed = [error <= (most * side) ** 2 for error, side in zip(errors, sides, strict=True)]
    return _topmost([np.ones(errors[0].shape, bool), *allowed[1:]])


def leaves_within(errors: Sequence[np.ndarray], budget: int, least: float) -> list[np.ndarray]:
    """Find `chosen_leaves` of the lowest price, ``least`` or more, that keeps the ``budget``.
    Raises `GenomeError` if the coarsest partition has more leaves."""
    if errors[-1].size > budget:
        raise GenomeError(
            setting("lifs", budget),
            f"{errors[-1].size} or more: the coarsest partition has so many leaves",
            f"give a larger budget, or a larger root, for example {keyword('block', (2, 32))}",
        )

    def count(leaves: list[np.ndarray]) -> int:
        return sum(map(np.count_nonzero, leaves))

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
    """Select the legal leaves, from the finest side to the root, that no larger one contains."""
    leaves: list[np.ndarray] = []
    free = np.ones(whole[-1].shape, bool)
    for blocks in whole[::-1]:
        leaves.append(blocks & free)
        free = (free & ~blocks).repeat(2, 0).repeat(2, 1)
    return leaves[::-1]


@dataclass(frozen=True, eq=False)
class Partition:
    """Leaves from several `Level`, the finest first; ``numbers`` are their numbers in each."""

    levels: Sequence[Level]
    numbers: Sequence[np.ndarray]

    @classmethod
    def of(cls, levels: Sequence[Level], choose: Callable) -> "Partition":
        """Choose leaves of ``levels`` by ``choose(errors)``; a single level is taken whole."""
        if len(levels) == 1:
            return cls(levels, [np.arange(len(levels[0].pavement))])
        return cls(levels, list(map(np.flatnonzero, choose([level.error for level in levels]))))

    def follow_surroundings(self, tolerance: float, coding: Coding, **work) -> "Partition":
        """Recode the leaves by `Level.follow_surroundings`."""
        arguments = tolerance, coding
        levels = [level.follow_surroundings(k, *arguments, **work) for level, k in self._pairs]
        return replace(self, levels=levels)

    @property
    def _pairs(self):
        return list(zip(self.levels, self.numbers, strict=True))

    def _join(self, values: Callable[[Level], np.ndarray]) -> np.ndarray:
        """Join the leaves' ``values`` of all levels."""
        return np.concatenate([values(level)[which] for level, which in self._pairs])

    @cached_property
    def _order(self) -> np.ndarray:
        top, left = (self._join(lambda level, k=k: level.pavement.corners[k]) for k in (0, 1))
        return np.lexsort((left, top))

    @property
    def pavement(self) -> Pavement:
        side = self._join(lambda level: level.pavement.side)
        return Pavement(*self.levels[0].heights.shape, side[self._order])

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The nucleotides of the leaves, in the order of the `pavement`."""
        return {
            name: self._join(lambda level, name=name: level.columns[name])[self._order]
            for name in self.levels[0].columns
        }

    @property
    def error(self) -> float:
        """Collage error of all leaves, m²."""
        return float(sum(level.error.ravel()[which].sum() for level, which in self._pairs))

    @property
    def uniform(self) -> int:
        """Number of leaves without a search."""
        return sum(
            int(np.count_nonzero(~np.isin(which, level.searched))) for level, which in self._pairs
        )

    def count_above(self, most: float) -> int:
        """Count the leaves with a collage error (root mean square) above ``most`` metres."""
        return sum(
            int(np.count_nonzero(level.error.ravel()[which] > (most * level.pavement.block) ** 2))
            for level, which in self._pairs
        )
