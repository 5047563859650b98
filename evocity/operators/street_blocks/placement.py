"""Placement: the best place of a map whose buildings fit into a street block of another."""

import math
from dataclasses import dataclass

import numpy as np
import scipy

from evocity import isometries
from evocity.operators.street_blocks.blocks import StreetBlocks
from evocity.views.ground.space import nearest_built

#: Draws of places under each isometry.
_DRAWN = 4


@dataclass(frozen=True, eq=False)
class Room:
    """A street block to be filled.

    top, left : its north-west corner, in cells.
    block, ring : cells for buildings, and cells that a wider street takes, bool ``(r, c)``.
    weights : float32 ``(r, c)``, the score of each cell if built; 0 outside.
    density : the share of its cells under its own buildings.
    """

    top: int
    left: int
    block: np.ndarray
    ring: np.ndarray
    weights: np.ndarray
    density: float

    @classmethod
    def of(cls, host: StreetBlocks, number: int, facades: float, widened: int = 0) -> "Room":
        """Make the room of street block ``number`` of ``host``, with the weights of `best_place`;
        its streets grow by ``widened`` cells. A cache keeps it as long as ``host`` lives."""
        key = int(number), facades, widened
        if key in host.rooms:
            return host.rooms[key]
        if not widened:
            host.rooms[key] = cls._as_it_is(host, int(number), facades)
            return host.rooms[key]
        whole = host.labels == number
        top, left, bottom, right = host.bounds[number].tolist()
        within = np.s_[top:bottom, left:right]
        # beyond the map's border nothing is cut
        around = np.pad(whole, 1, constant_values=True)[top : bottom + 2, left : right + 2]
        own = host.built[within] & whole[within]
        density = own.sum() / np.count_nonzero(whole[within])
        if not around.all():
            squares, _ = nearest_built(~around)
            around = squares > widened**2
        block = around[1:-1, 1:-1] & whole[within]
        ring = whole[within] & ~block
        weights = _weights(block, around, own, facades)
        host.rooms[key] = cls(top, left, block, ring, weights, density)
        return host.rooms[key]

    @classmethod
    def _as_it_is(cls, host: StreetBlocks, number: int, facades: float) -> "Room":
        from evocity.operators.street_blocks._kernels import weigh_block

        top, left, bottom, right = host.bounds[number].tolist()
        block = np.empty((bottom - top, right - left), bool)
        weights = np.empty(block.shape, np.float32)
        density = weigh_block(
            host.labels, host.built, number, top, left, float(facades), block, weights
        )
        return cls(top, left, block, np.zeros(block.shape, bool), weights, density)

    @property
    def within(self) -> tuple[slice, slice]:
        """The slices of the grid that the room covers."""
        tall, wide = self.block.shape
        return np.s_[self.top : self.top + tall, self.left : self.left + wide]

    @property
    def area(self) -> int:
        """Number of cells for buildings."""
        return np.count_nonzero(self.block)


@dataclass(frozen=True, eq=False)
class Fit:
    """The content for a street block: a place of another map, turned, without the buildings that
    lie partly outside.

    iso : its isometry.
    top, left : its corner on the other map, in cells.
    kept : bool ``(r, c)``, the cells of whole buildings, as laid.
    """

    iso: int
    top: int
    left: int
    kept: np.ndarray

    def view(self, raster: np.ndarray) -> np.ndarray:
        """Cut and turn the other map's ``raster`` (R, C) as it is laid: ``(r, c)``."""
        inverse = isometries.INVERSE[self.iso]
        tall, wide = isometries.apply(inverse, self.kept).shape
        window = raster[self.top : self.top + tall, self.left : self.left + wide]
        return isometries.apply(self.iso, window)


def best_place(
    room: Room,
    donor: StreetBlocks,
    stale: np.ndarray,
    enough: float,
    spread: float,
    rng: np.random.Generator,
    itself: bool = False,
    sums: np.ndarray | None = None,
) -> Fit | None:
    """Find the best place of the ``donor`` for a street block; None if nowhere whole buildings
    cover ``enough`` of the block, a share of its own density.

    The score of a place, under an isometry, is the built share of the block, less twice the built
    share of its outline, less half the difference to the block's own density, plus façades at their
    old places (`Room`). ``stale``, float32 ``(R, C)``, 0…1, is a discount of built cells. Under
    each isometry a few places are drawn among those within ``spread`` of the best score. The best
    of these without partial buildings wins. If the donor is the map ``itself``, places that overlap
    the block are illegal. ``sums``: `sums_of` the donor and ``stale``, if they are known.
    """
    from evocity.operators.street_blocks._kernels import best_fit, whole_cells

    tall, wide = room.block.shape
    excluded = [room.top, room.left, room.top + tall, room.left + wide] if itself else [0, 0, 0, 0]
    sums = sums_of(donor, stale) if sums is None else sums
    least = math.ceil(enough * room.density * room.area)
    iso, top, left, _ = best_fit(
        sums, donor.components, donor.covered, stale,
        np.ascontiguousarray(room.block), room.weights, room.density, least, spread,
        rng.random((isometries.COUNT, _DRAWN)), isometries.AFFINE, np.array(excluded, np.int64),
    )  # fmt: skip
    if iso < 0:
        return None
    kept = np.empty(room.block.shape, bool)
    turn = isometries.AFFINE[iso]
    whole_cells(donor.components, donor.covered, room.block, turn, top, left, kept)
    return Fit(iso, top, left, kept)


def sums_of(donor: StreetBlocks, stale: np.ndarray) -> np.ndarray:
    """Sum the built cells of each row of a donor, less their discount ``stale``, as `best_fit`
    needs them."""
    from evocity.operators.street_blocks._kernels import SPARE, row_sums

    rows, columns = donor.built.shape
    sums = np.zeros((2, rows, columns // 2 + 1 + SPARE), np.float32)
    row_sums(donor.built, stale, sums)
    return sums


def _weights(block: np.ndarray, around: np.ndarray, own: np.ndarray, facades: float) -> np.ndarray:
    """Compute the score of each cell of a ``block`` if built, float32 ``(r, c)``. Sums are 1 over
    the block, −2 over the outline, ``facades`` where its ``own`` buildings face the street and
    −``facades`` over the street before them.

    around : bool ``(r + 2, c + 2)``, true on the block and beyond the map's border, which is no
        outline.
    """
    inner = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    outline = block & ~inner
    weights = np.zeros(block.shape, np.float32)
    parts = [(block, 1.0), (outline, -2.0)]
    if facades:
        street = scipy.ndimage.binary_propagation(outline & ~own, mask=block & ~own)
        wide = np.pad(street, 1)
        facing = wide[:-2, 1:-1] | wide[2:, 1:-1] | wide[1:-1, :-2] | wide[1:-1, 2:]
        parts += [(own & facing, facades), (street, -facades)]
    for where, worth in parts:
        weights[where] += np.float32(worth / max(np.count_nonzero(where), 1))
    return weights
