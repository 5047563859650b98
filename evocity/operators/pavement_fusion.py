"""Pavement fusion: cross spatial groups of lifs, as a painter with ever smaller brushes."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.coding.decode import decode
from evocity.genome import Genome
from evocity.operators._kernels import inject
from evocity.operators.crossing import Draft, Drafting, assembled
from evocity.operators.parameters import check_parameters, repair_checks
from evocity.operators.shares import TOLD, are_shares, shares_of

#: The name under which ground laid by the void parent appears among a child's cities.
VOID = "void"


@dataclass(frozen=True)
class PavementFusion(Drafting):
    """Fuse two or more parents by square macro-blocks (Marsault 2002 §4.4, 2005 §2.3).

    The map is filled with the parent of the largest share. Then each parent in turn injects
    macro-blocks until its share is reached; at each change of parent the size falls by one
    block and the margin shrinks by a fifth, down to ``size_min``. A macro-block is admissible
    where, along its outline, what it brings and what stands there now (earlier injections
    included) differ by at most ``tolerance`` metres on average.

    Parameters
    ----------
    size_min, size_max : sides of the macro-blocks, in range blocks, 1 or more.
    fill : share of the second of two parents, 0…1; or one share a parent (and one for the
        void, if it takes part), summing to 1; None for equal shares. What is reached can
        fall short where few macro-blocks are admissible: see ``made["fill_reached"]``.
    margin : how far a share may be off, 0…1.
    tolerance : S, metres.
    void : whether bare ground takes part as a last parent.
    positions : candidate corners ((row, column), in blocks) tried in this order at every
        size; None draws them.
    repair : blocks that decode further than this (root mean square, metres) from the
        stitched map are matched again; None as in the papers, with their crumbling.
    reach, domains : where repair searches, as in `evocity.encode`.
    """

    size_min: int = 4
    size_max: int = 16
    fill: float | Sequence[float] | None = None
    margin: float = 0.1
    tolerance: float = 6.0
    void: bool = False
    positions: Sequence[tuple[int, int]] | None = None
    repair: float | None = 0.5
    reach: int | None = 24
    domains: Sequence[int] = (2,)

    name = "pavement_fusion"
    parents = (2, None)

    def __post_init__(self):
        check_parameters(
            self,
            {
                "size_min": (lambda size: size >= 1, "1 block or more"),
                "size_max": (lambda size: size >= self.size_min, "at least size_min"),
                "fill": (are_shares, TOLD),
                "margin": (lambda margin: 0 <= margin <= 1, "0…1"),
                "tolerance": (lambda tolerance: tolerance >= 0, "0 m or more"),
                "positions": (_are_corners, f"pairs (row, column) within ±{MAX_SIDE}, or none"),
                **repair_checks(),
            },
        )

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        shares = self._shares(len(parents))
        if self.void:
            parents = [*parents, ground(parents[0])]
        owner, stitched = self._pave(parents, shares, rng)
        reached = np.bincount(owner.ravel(), minlength=len(parents)) / owner.size
        made = {
            "size_min": self.size_min,
            "size_max": self.size_max,
            "tolerance": self.tolerance,
            "margin": self.margin,
            "fill": [round(float(share), 4) for share in shares],
            "fill_reached": [round(float(share), 4) for share in reached],
        }
        return Draft(assembled(parents, owner.ravel()), stitched, made)

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents (and the void)."""
        self._shares(count)

    def _shares(self, count: int) -> np.ndarray:
        """The share of each of ``count`` parents, then of the void if it takes part."""
        return shares_of(self.name, self.fill, count, self.void)

    def _pave(self, parents, shares, rng) -> tuple[np.ndarray, np.ndarray]:
        pavement = parents[0].pavement
        maps = [decode(parent).city.heights for parent in parents]
        first = int(np.argmax(shares))
        owner = np.full((pavement.rows, pavement.columns), first, np.int64)
        current = maps[first].copy()
        margin, donor = self.margin, first
        for size in self._sizes(pavement, len(parents)):
            donor = (donor + 1) % len(parents)
            rows, columns = self._candidates(pavement, size, rng)
            inject(
                current,
                maps[donor],
                owner,
                donor,
                size,
                pavement.block,
                rows,
                columns,
                self.tolerance,
                (shares[donor] - margin) * owner.size if margin < shares[donor] else 0,
                (shares[donor] + margin) * owner.size if shares[donor] > 0 else 0,
            )
            margin *= 0.8
        return owner, current

    def _sizes(self, pavement, count: int) -> list[int]:
        """Side of the macro-blocks at each change of parent, falling; each size as often as it
        takes for all of ``count`` parents to have their turn."""
        largest = min(self.size_max, pavement.rows, pavement.columns)
        sizes = range(largest, min(self.size_min, largest) - 1, -1)
        turns = -(-(count - 1) // len(sizes))
        return [size for size in sizes for _ in range(turns)]

    def _candidates(self, pavement, size, rng) -> tuple[np.ndarray, np.ndarray]:
        """Corners of macro-blocks that fit, as contiguous rows and columns, in blocks."""
        high, wide = pavement.rows - size + 1, pavement.columns - size + 1
        if self.positions is None:
            return np.divmod(rng.permutation(high * wide), wide)
        given = np.array(self.positions, np.int64).reshape(-1, 2)
        fits = (given >= 0).all(axis=1) & (given[:, 0] < high) & (given[:, 1] < wide)
        return given[fits, 0].copy(), given[fits, 1].copy()


def _are_corners(positions) -> bool:
    return positions is None or all(abs(side) <= MAX_SIDE for pair in positions for side in pair)


def ground(like: Genome) -> Genome:
    """The void: a genome of bare ground on the pavement of ``like``."""
    nothing = np.zeros(len(like), np.uint8)
    return like.replace(
        **dict.fromkeys(("sigma", "beta", "x", "y", "dx", "dy", "iso", "parent"), nothing),
        source=np.arange(len(like)),
        cities=(VOID,),
        attribution="",
    )
