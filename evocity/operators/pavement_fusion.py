"""Pavement fusion, by macro-blocks of falling size, and direct fusion, lifs by lifs."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from evocity.citymap import MAX_SIDE
from evocity.genome import MOST_PARENTS, NUCLEOTIDES, VOID, Genome, Pieces, laid, packed
from evocity.operators._kernels import inject
from evocity.operators.crossover import Draft, Drafting, assemble, raw_heights
from evocity.operators.grid import common_grid, span_checks
from evocity.operators.groups import macro_block_sides
from evocity.operators.parameters import (
    FILL,
    MOST_METRES,
    SHARE,
    Check,
    at_fault,
    fill_report,
    shares_of,
)

#: The default side of the smallest macro-blocks, metres.
SMALLEST = 32.0


@dataclass(frozen=True)
class PavementFusion(Drafting):
    """Fuse two or more parents by square macro-blocks (Marsault 2002 §4.4, 2005 §2.3).

    The parent with the largest share, or the parent ``base``, fills the whole map at first. The
    parents then inject macro-blocks in turn, each until it reaches its share. At each change of
    parent, macro-blocks become one cell smaller, down to ``side_min``, and the margin shrinks by a
    fifth. A macro-block is admissible if it fits the child's map after all earlier
    injections. A macro-block may differ along its outline from the child's map by at most
    ``tolerance`` metres on average.

    Parameters
    ----------
    side_min, side_max : smallest and largest side of macro-blocks, metres; by default 32 m and 128
        m.
    size_min, size_max : smallest and largest side of macro-blocks, counted in range blocks of equal
        size, 1 or more. Deprecated.
    fill : share of the second of two parents, 0…1, or a list of shares that add up to 1. A list in
        `fill` has a share for each parent, and a last share for bare ground if ``void`` is true. If
        ``fill`` is None, all parents have equal shares. If few macro-blocks are admissible, a
        parent gets less than its share; see ``made["fill_reached"]``.
    base : number of the parent that fills the map at first, from 1; by default the parent with the
        largest share. With a base, the other parents may fill the whole map.
    margin : largest error of a parent's share, 0…1.
    tolerance : largest mean difference along an outline, metres, called S in the papers.
    void : whether bare ground counts as an additional, last parent.
    places : candidate corners of macro-blocks, each a pair (down, along) in metres from the map's
        north-west corner. The operator tries the corners in this order at every size. If ``places``
        is None, the operator draws the corners of macro-blocks at random.
    positions : candidate corners of macro-blocks, counted in range blocks (row, column).
        Deprecated.
    repair, reach, domains : parameters of collage repair, as in `Drafting`. The intended map joins
        the decoded macro-blocks of all parents.
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
    base: int | None = None

    name = "pavement_fusion"
    parents = (2, None)
    #: The default side of the largest macro-blocks, metres.
    _largest: ClassVar[float] = 128.0

    def _checks(self) -> dict[str, Check]:
        return {
            **span_checks(self, SMALLEST),
            "fill": FILL,
            "base": (
                lambda base: base is None or 1 <= base <= MOST_PARENTS,
                f"the number of a parent, 1…{MOST_PARENTS}, or none",
            ),
            "margin": SHARE,
            "tolerance": (lambda tolerance: tolerance >= 0, "0 m or more"),
            "places": (_are_places, "pairs (down, along) of metres, or none"),
            "positions": (
                lambda corners: _are_corners(corners) and (corners is None or self.places is None),
                f"pairs (row, column) within ±{MAX_SIDE}, or none; none where places are given",
            ),
        }

    def relaxed(self) -> "PavementFusion":
        """Return an operator that admits more macro-blocks: it has twice the ``tolerance``."""
        return replace(self, tolerance=max(1.0, 2 * self.tolerance))

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        self.check_count(len(parents))
        shares = self._shares(len(parents))
        if self.void:
            parents = [*parents, ground(parents[0])]
        grid = common_grid(self.name, parents)
        self._check_positions(grid, parents)
        smallest, largest = macro_block_sides(self, grid, parents, SMALLEST, self._largest)
        pieces, stitched = self._pave(parents, grid, (smallest, largest), shares, rng)
        child = laid(parents, pieces, carried=bool(pieces.iso.any())).genome
        metres = grid.block * parents[0].metres_per_pixel
        made = {
            "side_min": smallest * metres,
            "side_max": largest * metres,
            "tolerance": self.tolerance,
            "margin": self.margin,
            **fill_report(shares, pieces.whose),
        }
        return Draft(child, stitched, made)

    def _check_positions(self, grid, parents) -> None:
        if self.positions is not None and any(parent.pavement != grid for parent in parents):
            metres = np.multiply(self.positions[:1], 4 * parents[0].metres_per_pixel).tolist()
            fault = "range blocks", "have no meaning among leaves of many sides"
            remedy = f"write them in m: places = {[*metres, '…']}, for range blocks of 4 px"
            raise at_fault(self.name, {"positions": fault}, remedy)

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` if ``fill`` does not suit ``count`` parents and the parameter
        `void`, or if they have no parent ``base``."""
        self._shares(count)
        if self.base is not None and self.base > count:
            raise at_fault(self.name, {"base": (str(self.base), f"1…{count}, or none")})

    def _first(self, shares: np.ndarray) -> int:
        """The index of the parent that fills the map at first."""
        return int(np.argmax(shares)) if self.base is None else self.base - 1

    def _shares(self, count: int) -> np.ndarray:
        return shares_of(self.name, self.fill, count, self.void)

    def _pave(self, parents, grid, sizes, shares, rng) -> tuple[Pieces, np.ndarray]:
        """Pave the ``grid``: the pieces in its cells, and the stitched map."""
        maps = [raw_heights(parent) for parent in parents]
        first = self._first(shares)
        owner = np.full((grid.rows, grid.columns), first, np.int64)
        current = maps[first].copy()
        margin, donor = self.margin, first
        for size in self._sizes(grid, *sizes, len(parents)):
            donor = (donor + 1) % len(parents)
            rows, columns = self._candidates(grid, parents[0].metres_per_pixel, size, rng)
            bounds = map(float, share_bounds(shares[donor], margin, owner.size))
            inject(
                current, maps[donor], owner, donor, size, grid.block, rows, columns,
                float(self.tolerance), *bounds,
            )  # fmt: skip
            margin *= 0.8
        return Pieces.in_place(owner, grid.block), current

    def _sizes(self, grid, smallest: int, largest: int, count: int) -> list[int]:
        """List the sides of macro-blocks at each change of parent, in cells, falling; sides repeat
        until each of ``count`` parents has its turn."""
        largest = min(largest, grid.rows, grid.columns)
        sizes = range(largest, min(smallest, largest) - 1, -1)
        turns = -(-(count - 1) // len(sizes))
        return [size for size in sizes for _ in range(turns)]

    def _candidates(
        self, grid, pixel, size, rng, most: int | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """List at most ``most`` corners of macro-blocks that fit: rows and columns, in cells."""
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


@dataclass(frozen=True)
class DirectFusion(Drafting):
    """Draw each lifs from one of two or more parents, independently of its neighbours (Marsault
    2002 §4.2).

    If range blocks have different sides, a single draw chooses the parent of all lifs in a cell of
    16 × 16 m.

    Each draw ignores the heights and the surroundings of the lifs, so the city fabric of the child
    crumbles. If ``repair`` is None, this operator is the baseline of the papers, with "very bad
    results". Collage repair restores the heights that every block has in a parent, but cannot
    connect blocks into whole buildings.

    Parameters
    ----------
    fill : share of the second of two parents, 0…1, or a share for each parent; shares add up to 1.
        If ``fill`` is None, all parents have equal shares. The share of a parent is the probability
        that a lifs comes from this parent; ``made["fill_reached"]`` holds the resulting shares. If
        a parent has the share 1, the child equals this parent.
    repair, reach, domains : parameters of collage repair, as in the operator `PavementFusion`. The
        intended map has the decoded range blocks of the drawn parents, each block at its own place.
    """

    fill: float | Sequence[float] | None = None

    name = "direct_fusion"
    parents = (2, None)

    def _checks(self) -> dict[str, Check]:
        return {"fill": FILL}

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` if ``fill`` does not suit ``count`` parents."""
        shares_of(self.name, self.fill, count)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        grid = common_grid(self.name, parents, 16.0)
        shares = shares_of(self.name, self.fill, len(parents))
        ends = np.cumsum(shares) / shares.sum()
        owner = np.searchsorted(ends, rng.random(len(grid)), side="right")
        blocks = np.stack([grid.blocks(raw_heights(parent)) for parent in parents])
        stitched = grid.raster(blocks[owner, np.arange(owner.size)])
        return Draft(assemble(parents, owner, grid), stitched, fill_report(shares, owner))


def share_bounds(share: float, margin: float, cells: int) -> tuple[float, float]:
    """Compute the least and the largest number of ``cells`` for a share."""
    least = (share - margin) * cells if margin < share else 0
    return least, (share + margin) * cells if share > 0 else 0


def _are_places(places) -> bool:
    return places is None or all(abs(at) <= MOST_METRES for pair in places for at in pair)


def _are_corners(positions) -> bool:
    return positions is None or all(abs(side) <= MAX_SIDE for pair in positions for side in pair)


def ground(like: Genome) -> Genome:
    """Make the void: a genome of bare ground on the pavement of ``like``."""
    nothing = np.zeros(len(like), np.uint8)
    return like.replace(
        **dict.fromkeys((*NUCLEOTIDES, "parent", "turn", "other"), nothing),
        source=packed(*like.pavement.corners),
        part=nothing + 1.0,
        cities=(VOID,),
        attribution="",
    )
