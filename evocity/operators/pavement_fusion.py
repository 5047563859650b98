"""Pavement fusion: cross spatial groups of lifs, as a painter with ever smaller brushes."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.genome import NUCLEOTIDES, VOID, Genome, Pieces, laid, packed
from evocity.operators._kernels import inject
from evocity.operators.crossing import Draft, Drafting, raw_heights
from evocity.operators.grid import MOST, common_grid, span_checks
from evocity.operators.groups import macro_block_sides
from evocity.operators.parameters import Check, at_fault
from evocity.operators.shares import TOLD, are_shares, shares_of

#: Side of the smallest macro-blocks unless told, metres.
SMALLEST = 32.0


@dataclass(frozen=True)
class PavementFusion(Drafting):
    """Fuse two or more parents by square macro-blocks (Marsault 2002 §4.4, 2005 §2.3).

    The map is filled with the parent of the largest share. Then each parent in turn injects
    macro-blocks until its share is reached; at each change of parent the size falls by one
    cell and the margin shrinks by a fifth, down to ``side_min``. A macro-block is admissible
    where, along its outline, what it brings and what stands there now (earlier injections
    included) differ by at most ``tolerance`` metres on average.

    Parameters
    ----------
    side_min, side_max : sides of the macro-blocks, metres; None for 32 and 128.
    size_min, size_max : the same in range blocks, 1 or more, of uniform pavements; deprecated.
    fill : share of the second of two parents, 0…1; or one share a parent (and one for the
        void, if it takes part), summing to 1; None for equal shares. What is reached can
        fall short where few macro-blocks are admissible: see ``made["fill_reached"]``.
    margin : how far a share may be off, 0…1.
    tolerance : S, metres.
    void : whether bare ground takes part as a last parent.
    places : candidate corners ((down, along), metres from the north-west) tried in this order
        at every size; None draws them.
    positions : the same in range blocks (row, column); deprecated.
    repair, reach, domains : see `Drafting`; what is meant to be laid is the stitched map.
    """

    side_min: float | None = None
    side_max: float | None = None
    fill: float | Sequence[float] | None = None
    margin: float = 0.1
    tolerance: float = 6.0
    void: bool = False
    places: Sequence[tuple[float, float]] | None = None
    size_min: int | None = None
    size_max: int | None = None
    positions: Sequence[tuple[int, int]] | None = None

    name = "pavement_fusion"
    parents = (2, None)
    #: Side of the largest macro-blocks unless told, metres.
    _largest: ClassVar[float] = 128.0

    def _checks(self) -> dict[str, Check]:
        return {
            **span_checks(self, SMALLEST),
            "fill": (are_shares, TOLD),
            "margin": (lambda margin: 0 <= margin <= 1, "0…1"),
            "tolerance": (lambda tolerance: tolerance >= 0, "0 m or more"),
            "places": (_are_places, "pairs (down, along) of metres, or none"),
            "positions": (
                lambda corners: _are_corners(corners) and (corners is None or self.places is None),
                f"pairs (row, column) within ±{MAX_SIDE}, or none; none where places are given",
            ),
        }

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        shares = self._shares(len(parents))
        if self.void:
            parents = [*parents, ground(parents[0])]
        grid = common_grid(self.name, parents)
        self._check_positions(grid, parents)
        smallest, largest = macro_block_sides(self, grid, parents, SMALLEST, self._largest)
        pieces, stitched = self._pave(parents, grid, (smallest, largest), shares, rng)
        reached = np.bincount(pieces.whose.ravel(), minlength=len(parents)) / pieces.whose.size
        child = laid(parents, pieces, carried=bool(pieces.iso.any())).genome
        metres = grid.block * parents[0].metres_per_pixel
        made = {
            "side_min": smallest * metres,
            "side_max": largest * metres,
            "tolerance": self.tolerance,
            "margin": self.margin,
            "fill": [round(float(share), 4) for share in shares],
            "fill_reached": [round(float(share), 4) for share in reached],
        }
        return Draft(child, stitched, made)

    def _check_positions(self, grid, parents) -> None:
        if self.positions is not None and any(parent.pavement != grid for parent in parents):
            metres = np.multiply(self.positions[:1], 4 * parents[0].metres_per_pixel).tolist()
            found = "range blocks", "have no meaning among leaves of many sides"
            raise at_fault(
                self.name,
                {"positions": found},
                f"write them in m: places = {[*metres, '…']}, for range blocks of 4 px",
            )

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents (and the void)."""
        self._shares(count)

    def _shares(self, count: int) -> np.ndarray:
        """The share of each of ``count`` parents, then of the void if it takes part."""
        return shares_of(self.name, self.fill, count, self.void)

    def _pave(self, parents, grid, sizes, shares, rng) -> tuple[Pieces, np.ndarray]:
        """What stands in each cell of the ``grid``, and the stitched map."""
        maps = [raw_heights(parent) for parent in parents]
        first = int(np.argmax(shares))
        owner = np.full((grid.rows, grid.columns), first, np.int64)
        current = maps[first].copy()
        margin, donor = self.margin, first
        for size in self._sizes(grid, *sizes, len(parents)):
            donor = (donor + 1) % len(parents)
            rows, columns = self._candidates(grid, parents[0].metres_per_pixel, size, rng)
            inject(
                current,
                maps[donor],
                owner,
                donor,
                size,
                grid.block,
                rows,
                columns,
                self.tolerance,
                (shares[donor] - margin) * owner.size if margin < shares[donor] else 0,
                (shares[donor] + margin) * owner.size if shares[donor] > 0 else 0,
            )
            margin *= 0.8
        return Pieces.in_place(owner, grid.block), current

    def _sizes(self, grid, smallest: int, largest: int, count: int) -> list[int]:
        """Side of the macro-blocks at each change of parent, in cells, falling; each size as often
        as it takes for all of ``count`` parents to have their turn."""
        largest = min(largest, grid.rows, grid.columns)
        sizes = range(largest, min(smallest, largest) - 1, -1)
        turns = -(-(count - 1) // len(sizes))
        return [size for size in sizes for _ in range(turns)]

    def _candidates(
        self, grid, pixel, size, rng, most: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Corners of macro-blocks that fit, ``most`` of them if given, as contiguous rows and
        columns, in cells."""
        high, wide = grid.rows - size + 1, grid.columns - size + 1
        if self.positions is None and self.places is None:
            if most is None:
                return np.divmod(rng.permutation(high * wide), wide)
            few = rng.choice(high * wide, min(most, high * wide), replace=False)
            return np.divmod(few, wide)
        if self.places is None:
            given = np.array(self.positions, np.int64).reshape(-1, 2)
        else:
            metres = np.array(self.places, float).reshape(-1, 2)
            given = np.rint(metres / (grid.block * pixel)).astype(np.int64)
        fits = (given >= 0).all(axis=1) & (given[:, 0] < high) & (given[:, 1] < wide)
        given = given[fits][:most]
        return given[:, 0].copy(), given[:, 1].copy()


def _are_places(places) -> bool:
    return places is None or all(abs(one) <= MOST for pair in places for one in pair)


def _are_corners(positions) -> bool:
    return positions is None or all(abs(side) <= MAX_SIDE for pair in positions for side in pair)


def ground(like: Genome) -> Genome:
    """The void: a genome of bare ground on the pavement of ``like``."""
    nothing = np.zeros(len(like), np.uint8)
    return like.replace(
        **dict.fromkeys((*NUCLEOTIDES, "parent", "turn", "other"), nothing),
        source=packed(*like.pavement.corners),
        part=nothing + 1.0,
        cities=(VOID,),
        attribution="",
    )
