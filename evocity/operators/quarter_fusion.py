"""Quarter fusion: one parent keeps its streets, its street blocks get the buildings of others."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from evocity import isometries
from evocity.coding.decoded import decoded
from evocity.genome import Genome, Pieces, laid
from evocity.operators.crossing import Draft, Drafting, raw_heights
from evocity.operators.grid import MOST, common_grid
from evocity.operators.parameters import Check
from evocity.operators.pavement_fusion import ground
from evocity.operators.shares import TOLD, are_shares, shares_of
from evocity.operators.street_blocks import Fit, StreetBlocks, fits, outline, street_blocks


@dataclass(frozen=True)
class QuarterFusion(Drafting):
    """The first parent's streets, with buildings of the others in its street blocks.

    Street blocks are drawn one after another. Into each go the buildings of another parent from
    where they fit best, of all places and under all 8 isometries: much is built inside, little on
    the outline (`evocity.operators.street_blocks.fits`). The donor's built components that lie
    partly outside are left out whole, and what remains decides between the isometries. So no
    building is cut, neither the first parent's nor another's, and streets stay where they are.
    Lifs and their domain blocks are carried along. Where a component was left out, bare ground
    remains: the void's.

    A block keeps its buildings if too little would be built, if it is larger than the donor's
    map, or if something in it is locked (condensation).

    Parameters
    ----------
    fill : share of the map that gets the second parent's fabric, 0…1, or one share a parent,
        summing to 1; None for equal shares. What is reached is in ``made["fill_reached"]``.
    area_min : street blocks under this keep their buildings, m².
    spread : under each isometry one place is drawn of those whose score is within this of the
        best; 0 takes the best. Scores are shares of the block's area, at most 1.
    density : blocks that would have less than this share of what was built there before keep
        their buildings, 0 or more.
    repair, reach, domains : as in `Drafting`.

    Source: ours, after the wish of Marsault 2002 §6.1 that operators keep the identity of
    buildings.
    """

    fill: float | Sequence[float] | None = None
    area_min: float = 300.0
    spread: float = 0.03
    density: float = 0.5

    name = "quarter_fusion"
    parents = (2, None)
    #: Bare ground without a stone may be laid.
    lays_void: ClassVar[bool] = True

    def _checks(self) -> dict[str, Check]:
        return {
            "fill": (are_shares, TOLD),
            "area_min": (lambda area: 0 <= area <= MOST**2, f"0…{MOST**2:g} m²"),
            "spread": (lambda spread: 0 <= spread <= 1, "0…1"),
            "density": (lambda density: 0 <= density <= 100, "0…100"),
        }

    def check_count(self, count: int) -> None:
        """Raise `OperatorError` unless ``fill`` suits ``count`` parents."""
        shares_of(self.name, self.fill, count)

    def _draft(self, parents: Sequence[Genome], rng: np.random.Generator) -> Draft:
        shares = shares_of(self.name, self.fill, len(parents))
        quarters = _Quarters(parents, common_grid(self.name, parents, 0.0))
        filled = quarters.fill(shares, self.area_min, self.spread, self.density, rng)
        reached = np.bincount(quarters.given.ravel(), minlength=len(parents))
        made = {
            "fill": [round(float(share), 4) for share in shares],
            "fill_reached": [round(float(one), 4) for one in reached / quarters.given.size],
            "street_blocks": filled,
        }
        return Draft(quarters.genome(), quarters.intended, made)


class _Quarters:
    """The first parent's street blocks as they are filled, one after another.

    given : int64 ``(R, C)``: which parent each cell's fabric is of.
    intended : float32 ``(H, W)``, metres: the map that is meant.
    """

    def __init__(self, parents: Sequence[Genome], grid):
        self._parents, self._grid = parents, grid
        self._cities = [decoded(parent).city for parent in parents]
        self._heights = [raw_heights(parent) for parent in parents]
        self._pixels = [np.bincount(city.labels.ravel()) for city in self._cities]
        self.given = np.zeros((grid.rows, grid.columns), np.int64)
        self.intended = self._heights[0].copy()
        self._void = np.zeros(self.given.shape, bool)
        self._row, self._column = np.indices(self.given.shape)
        self._iso = np.zeros(self.given.shape, np.uint8)

    def fill(self, shares, area_min: float, spread: float, density: float, rng) -> int:
        """Fill street blocks as `QuarterFusion` says; how many."""
        host = street_blocks(self._cities[0], self._grid)
        cell = (self._grid.block * self._parents[0].metres_per_pixel) ** 2
        large = np.flatnonzero(host.area * cell >= area_min)
        left, filled = shares[1:] * self.given.size, 0
        for number in rng.permutation(large[large > 0]):
            donor = int(np.argmax(left)) + 1
            # nearer to what is wanted than before
            if host.area[number] >= 2 * left[donor - 1] or self._is_locked(host, number):
                continue
            if self._put(host, number, donor, spread, density, rng):
                left[donor - 1] -= host.area[number]
                filled += 1
        return filled

    def genome(self) -> Genome:
        """The lifs of all, as they are laid."""
        whose = np.where(self._void, len(self._parents), self.given)
        own_row, own_column = np.indices(whose.shape)
        pieces = Pieces(
            self._grid.block,
            whose,
            np.where(self._void, own_row, self._row),
            np.where(self._void, own_column, self._column),
            np.where(self._void, 0, self._iso).astype(np.uint8),
        )
        return laid([*self._parents, ground(self._parents[0])], pieces, carried=True).genome

    def _is_locked(self, host: StreetBlocks, number: int) -> bool:
        layer = self._parents[0].condensation
        if layer is None:
            return False
        locked = self._grid.blocks(layer.mask).any(axis=(1, 2))
        return bool((locked.reshape(host.labels.shape) & (host.labels == number)).any())

    def _put(self, host, number: int, donor: int, spread: float, density: float, rng) -> bool:
        """Fill one street block with the fabric of a ``donor``; False if it keeps its own."""
        block = host.labels == number
        top, left, bottom, right = _bounds(block)
        within = np.s_[top:bottom, left:right]
        whole = np.pad(block, 1, constant_values=True)[top : bottom + 2, left : right + 2]
        block = block[within]
        own = host.covered[number] / host.area[number]
        theirs = street_blocks(self._cities[donor], self._grid)
        side = self._grid.block
        pixels = block.repeat(side, 0).repeat(side, 1)
        chosen, most = None, -np.inf
        for fit in fits(block, outline(block, whole), own, theirs, spread, rng):
            labels = _seen(self._cities[donor].labels, fit, side)
            inside = self._whole(donor, labels, pixels)
            kept = _pooled(inside, side)
            share = np.count_nonzero(kept) / block.sum()
            if kept.any() and share >= density * own and share - abs(share - own) / 2 > most:
                chosen, most = (fit, labels > 0, inside, kept), share - abs(share - own) / 2
        if chosen is None:
            return False
        fit, there, inside, kept = chosen
        fabric = np.where(there & ~inside, 0, _seen(self._heights[donor], fit, side))
        area = np.s_[top * side : bottom * side, left * side : right * side]
        np.copyto(self.intended[area], fabric, where=pixels)
        rows, columns = np.indices(self.given.shape)
        np.copyto(self._row[within], _seen(rows, fit), where=block)
        np.copyto(self._column[within], _seen(columns, fit), where=block)
        self._iso[within][block] = fit.iso
        self.given[within][block] = donor
        self._void[within][block] = (_pooled(there & pixels, side) & ~kept)[block]
        return True

    def _whole(self, donor: int, labels: np.ndarray, pixels: np.ndarray) -> np.ndarray:
        """Where, of the ``pixels`` of a street block, components of the ``donor`` stand that lie
        in it wholly; ``labels`` are those that would be laid."""
        every = self._pixels[donor]
        counts = np.bincount(labels[pixels], minlength=every.size)
        inside = counts == every
        inside[0] = False
        return inside[labels] & pixels


def _bounds(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Top, left, bottom, right of what is true; the last two exclusive."""
    (rows,), (columns,) = (np.nonzero(mask.any(axis=axis)) for axis in (1, 0))
    return int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1


def _seen(raster: np.ndarray, fit: Fit, side: int = 1) -> np.ndarray:
    """What of a donor's ``raster`` is laid by a ``fit``, as it is laid; ``side`` px a cell."""
    rows = np.s_[side * fit.top : side * (fit.top + fit.tall)]
    columns = np.s_[side * fit.left : side * (fit.left + fit.wide)]
    return isometries.apply(fit.iso, raster[rows, columns])


def _pooled(mask: np.ndarray, side: int) -> np.ndarray:
    """Whether anything of a cell of ``side`` px is true."""
    height, width = mask.shape
    return mask.reshape(height // side, side, width // side, side).any(axis=(1, 3))
