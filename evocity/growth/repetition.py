"""Hash tables of the windows of a fabric, which keep it from repeating itself."""

import copy
from collections.abc import Iterable, Sequence

import numpy as np

from evocity import isometries
from evocity.growth._kernels import (
    ACROSS,
    ANCHORED,
    APART,
    FREE,
    WINDOW,
    common_windows,
    rehashed,
    remember_all,
    window_keys,
)

# The most pixels of windows that a group touches.
_TOUCHED = (ANCHORED + 2 * WINDOW) ** 2


class Windows:
    """The windows of the originals, under the isometries ``isos``: those that stand in the fabric,
    where the first original lies at (``at``, ``at``), multiples of `APART`; and the sorted keys of
    those that the originals repeat, ``common`` (of side `ANCHORED`) and ``allowed`` (of side
    `WINDOW`)."""

    def __init__(self, heights: Sequence[np.ndarray], isos: Iterable[int], at: int):
        images = [
            [np.ascontiguousarray(isometries.apply(int(iso), raster)) for raster in heights]
            for iso in isos
        ]
        self.common, self.allowed = (_repeated_keys(images, side) for side in (ANCHORED, WINDOW))
        table = self._standing = Table(bool(self.common.size))
        own = window_keys(heights[0], ANCHORED)
        holding = common_windows(heights[0], own, self.common, self.allowed)
        table.grow(0, own[::APART, ::APART].size + sum(own.shape))
        table.grow(1, np.count_nonzero(holding))
        table.filled[0] = remember_all(*table.coarse, own, at, at, APART, ACROSS)
        table.filled[1] = remember_all(*table.fine, holding, at, at, 1, ACROSS)

    def table(self) -> "Table":
        """Return a table with the windows of the first original."""
        return copy.deepcopy(self._standing)


class Table:
    """The windows of a piece of fabric, by 64-bit keys of their content.

    ``coarse`` notes windows of `ANCHORED` px at every `APART` pixels. ``fine`` notes, at every
    pixel, windows of `WINDOW` px that contain a window which the originals repeat; most cities have
    few. Both are tables (keys, anchors); ``filled`` counts the entries of either.
    """

    def __init__(self, some_repeat: bool):
        self.some_repeat = some_repeat
        self.filled = [0, 0]
        self.coarse, self.fine = (
            (np.zeros(1 << 10, np.uint64), np.full(1 << 10, FREE, np.int64)) for _ in range(2)
        )

    def make_room(self, groups: int) -> None:
        """Enlarge the tables for as many more ``groups``."""
        self.grow(0, groups * _TOUCHED // APART**2 * 2)
        if self.some_repeat:
            self.grow(1, groups * _TOUCHED)

    def grow(self, which: int, more: int) -> None:
        """Enlarge a table for ``more`` entries, so that it stays at most half full."""
        table, least = (self.coarse, self.fine)[which], 2 * (self.filled[which] + more)
        if least <= table[0].size:
            return
        keys, anchors, filled = rehashed(*table, table[0].size)  # drops forgotten entries
        size = keys.size
        while 2 * (filled + more) > size:
            size *= 2
        if size > keys.size:
            keys, anchors, filled = rehashed(keys, anchors, size)
        self.filled[which] = filled
        setattr(self, ("coarse", "fine")[which], (keys, anchors))


def _repeated_keys(images: list[list[np.ndarray]], side: int) -> np.ndarray:
    """List the sorted keys of windows that maps under one isometry contain more than once."""
    repeated = []
    for rasters in images:
        keys = np.concatenate([window_keys(raster, side).ravel() for raster in rasters])
        each, counts = np.unique(keys, return_counts=True)
        repeated.append(each[counts > 1])
    return np.unique(np.concatenate(repeated))
