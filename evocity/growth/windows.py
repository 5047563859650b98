"""Which windows stand in a fabric already? What keeps it from repeating itself."""

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

# A group touches windows in at most so many pixels around it.
_TOUCHED = (ANCHORED + 2 * WINDOW) ** 2


class Windows:
    """The windows of the originals: those that stand, and those they repeat themselves.

    Parameters
    ----------
    heights : float32 ``(H, W)``, the originals'; the first stands in the fabric.
    isos : the isometries they may be laid under.
    at : where its north-west pixel is counted, row and column, a multiple of `APART`.

    Attributes: ``common`` and ``allowed``, sorted keys of the windows of either side that the
    originals repeat.
    """

    def __init__(self, heights: Sequence[np.ndarray], isos: Iterable[int], at: int):
        images = [
            [np.ascontiguousarray(isometries.apply(int(iso), one)) for one in heights]
            for iso in isos
        ]
        self.common, self.allowed = (_repeated(images, side) for side in (ANCHORED, WINDOW))
        table = self._standing = Table(bool(self.common.size))
        own = window_keys(heights[0], ANCHORED)
        holding = common_windows(heights[0], own, self.common, self.allowed)
        table.grow(0, own[::APART, ::APART].size + sum(own.shape))
        table.grow(1, np.count_nonzero(holding))
        table.filled[0] = remember_all(*table.coarse, own, at, at, APART, ACROSS)
        table.filled[1] = remember_all(*table.fine, holding, at, at, 1, ACROSS)

    def table(self) -> "Table":
        """A table that knows what stands of the first original."""
        return self._standing.copy()


class Table:
    """The windows of a piece of fabric, by keys of what stands in them; 64 bits each.

    Noted are windows of `ANCHORED` px at every `APART` pixels, ``coarse``; and, at every pixel,
    those of `WINDOW` px that hold a window which the originals themselves repeat, ``fine``: there
    are few of them in most cities.

    Attributes: ``coarse`` and ``fine``, tables (keys, anchors); ``filled``, entries of either.
    """

    def __init__(self, some_repeat: bool):
        self.some_repeat = some_repeat
        self.filled = [0, 0]
        self.coarse, self.fine = (
            (np.zeros(1 << 10, np.uint64), np.full(1 << 10, FREE, np.int64)) for _ in range(2)
        )

    def copy(self) -> "Table":
        other = Table(self.some_repeat)
        other.filled = list(self.filled)
        other.coarse, other.fine = (
            tuple(part.copy() for part in table) for table in (self.coarse, self.fine)
        )
        return other

    def make_room(self, groups: int) -> None:
        """Make the tables large enough for as many ``groups`` more."""
        self.grow(0, groups * _TOUCHED // APART**2 * 2)
        if self.some_repeat:
            self.grow(1, groups * _TOUCHED)

    def grow(self, which: int, more: int) -> None:
        """Room for ``more`` entries in a table, so that it is never more than half full."""
        table, wanted = (self.coarse, self.fine)[which], 2 * (self.filled[which] + more)
        if wanted <= table[0].size:
            return
        keys, anchors, filled = rehashed(*table, table[0].size)  # without what is gone
        size = keys.size
        while 2 * (filled + more) > size:
            size *= 2
        if size > keys.size:
            keys, anchors, filled = rehashed(keys, anchors, size)
        self.filled[which] = filled
        if which:
            self.fine = keys, anchors
        else:
            self.coarse = keys, anchors


def _repeated(images: list[list[np.ndarray]], side: int) -> np.ndarray:
    """Sorted keys of the windows that stand in maps laid under one isometry more than once."""
    found = []
    for laid in images:
        keys = np.concatenate([window_keys(image, side).ravel() for image in laid])
        each, counts = np.unique(keys, return_counts=True)
        found.append(each[counts > 1])
    return np.unique(np.concatenate(found))
