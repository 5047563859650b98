"""Where the buildings of a map fit into a street block of another."""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy

from evocity import isometries
from evocity.operators.street_blocks.blocks import StreetBlocks
from evocity.views.ground.distance import nearest_built

#: So many places are drawn under each isometry.
_DRAWN = 4


@dataclass(frozen=True, eq=False)
class Room:
    """A street block that is to be filled.

    top, left : its north-west corner, in cells.
    block : bool ``(r, c)``, the cells that may be built on.
    ring : bool ``(r, c)``, its other cells, which a wider street takes.
    weights : float32 ``(r, c)``, what it is worth that a cell is built; 0 outside.
    density : the share of its cells that its own buildings cover.
    """

    top: int
    left: int
    block: np.ndarray
    ring: np.ndarray
    weights: np.ndarray
    density: float

    @classmethod
    def of(cls, host: StreetBlocks, number: int, facades: float, widened: int = 0) -> "Room":
        """Street block ``number`` of ``host``, with the weights that `best_place` tells; its
        streets wider by so many cells. Kept as long as ``host`` is."""
        asked = int(number), facades, widened
        if asked not in host.rooms:
            host.rooms[asked] = cls._of(host, *asked)
        return host.rooms[asked]

    @classmethod
    def _of(cls, host: StreetBlocks, number: int, facades: float, widened: int) -> "Room":
        whole = host.labels == number
        top, left, bottom, right = _bounds(whole)
        within = np.s_[top:bottom, left:right]
        # beyond the map's border nothing is cut
        around = np.pad(whole, 1, constant_values=True)[top : bottom + 2, left : right + 2]
        own = host.built[within] & whole[within]
        density = own.sum() / np.count_nonzero(whole[within])
        if widened and not around.all():
            squares, _ = nearest_built(~around)
            around = squares > widened**2
        block = around[1:-1, 1:-1] & whole[within]
        ring = whole[within] & ~block
        return cls(top, left, block, ring, _weights(block, around, own, facades), density)

    @property
    def within(self) -> tuple[slice, slice]:
        """Where on the grid the room lies."""
        tall, wide = self.block.shape
        return np.s_[self.top : self.top + tall, self.left : self.left + wide]

    @property
    def area(self) -> int:
        """How many cells may be built on."""
        return np.count_nonzero(self.block)


@dataclass(frozen=True, eq=False)
class Fit:
    """What is laid into a street block: a place of another map, turned, without the buildings that
    lie partly outside.

    iso : the isometry it is laid under.
    top, left : its corner on the other map, in cells.
    kept : bool ``(r, c)``, where buildings stay, as they are laid; nowhere of the map that it is
        laid from does one of them lie outside.
    """

    iso: int
    top: int
    left: int
    kept: np.ndarray

    def seen(self, raster: np.ndarray) -> np.ndarray:
        """What of the other map's ``raster`` (R, C) is laid, ``(r, c)``, as it is laid."""
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
) -> Fit | None:
    """Where the ``donor`` fits best into a street block; None if nowhere so that whole buildings
    cover ``enough`` of the block, a share of its own density.

    Of every place of the donor, under all 8 isometries: the share of the block that would be
    built, less twice the share of its outline that would be, less half of how far the former is
    from the block's own density, and façades where they stood (`Room`). Built cells count so much
    less as ``stale`` tells of them, float32 ``(R, C)``, 0…1. Under each isometry some
    are drawn whose score is within ``spread`` of its best. Of those, the one is taken whose score
    is best once buildings that lie partly outside are left out. If the donor is the map
    ``itself``, places that overlap the block are none.
    """
    from evocity.operators.street_blocks._kernels import best_fit

    tall, wide = room.block.shape
    own = [room.top, room.left, room.top + tall, room.left + wide] if itself else [0, 0, 0, 0]
    iso, top, left, _ = best_fit(
        _sums(donor.built, stale),
        donor.components,
        donor.covered,
        stale,
        np.ascontiguousarray(room.block),
        room.weights,
        room.density,
        math.ceil(enough * room.density * room.area),
        spread,
        rng.random((isometries.COUNT, _DRAWN)),
        isometries.AFFINE,
        np.array(own, np.int64),
    )
    if iso < 0:
        return None
    fit = Fit(iso, top, left, room.block)
    seen = fit.seen(donor.components)
    counts = np.bincount(seen[room.block], minlength=donor.covered.size)
    whole = counts == donor.covered
    whole[0] = False
    return replace(fit, kept=whole[seen] & room.block)


def _sums(built: np.ndarray, stale: np.ndarray) -> np.ndarray:
    """Of each row of cells ``(R, C)``, how much is ``built``, less what is ``stale``, left of each
    border: float32 ``(2, R, n)``, of the even borders, then of the odd ones; with spare items
    after them."""
    from evocity.operators.street_blocks._kernels import SPARE, row_sums

    rows, columns = built.shape
    sums = np.zeros((2, rows, columns // 2 + 1 + SPARE), np.float32)
    row_sums(built, stale, sums)
    return sums


def _weights(block: np.ndarray, around: np.ndarray, own: np.ndarray, facades: float) -> np.ndarray:
    """What each cell of a ``block`` is worth if built, float32 ``(r, c)``: together 1 over all of
    it, −2 over the outline, ``facades`` where its ``own`` buildings face the street and
    −``facades`` over the street before them.

    around : bool ``(r + 2, c + 2)``, true on the block and beyond the map's border, where nothing
        is cut.
    """
    inner = around[:-2, 1:-1] & around[2:, 1:-1] & around[1:-1, :-2] & around[1:-1, 2:]
    outline = block & ~inner
    weights = np.zeros(block.shape, np.float32)
    parts = [(block, 1.0), (outline, -2.0)]
    if facades:
        street = _reached(outline & ~own, block & ~own)
        parts += [(own & _beside(street), facades), (street, -facades)]
    for where, worth in parts:
        weights[where] += np.float32(worth / max(np.count_nonzero(where), 1))
    return weights


def _reached(seed: np.ndarray, among: np.ndarray) -> np.ndarray:
    """What of ``among`` is connected by sides to the ``seed``."""
    return scipy.ndimage.binary_propagation(seed, mask=among)


def _beside(mask: np.ndarray) -> np.ndarray:
    """Cells that have one of the ``mask`` at a side."""
    wide = np.pad(mask, 1)
    return wide[:-2, 1:-1] | wide[2:, 1:-1] | wide[1:-1, :-2] | wide[1:-1, 2:]


def _bounds(mask: np.ndarray) -> tuple[int, int, int, int]:
    """Top, left, bottom, right of what is true; the last two exclusive."""
    (rows,), (columns,) = (np.nonzero(mask.any(axis=axis)) for axis in (1, 0))
    return int(rows[0]), int(columns[0]), int(rows[-1]) + 1, int(columns[-1]) + 1
