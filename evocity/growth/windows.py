"""Which windows stand in a fabric already? What keeps it from repeating itself."""

from collections.abc import Iterable

import numpy as np

from evocity import isometries
from evocity.growth._kernels import (
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
    """The windows of a fabric, by keys of what stands in them; 64 bits each.

    Noted are windows of `ANCHORED` px at every `APART` pixels, ``coarse``; and, at every pixel,
    those of `WINDOW` px that hold a window which the original itself repeats, ``fine``: there
    are few of them in most cities. So memory is about a byte for each pixel of the fabric.

    Parameters
    ----------
    heights : float32 ``(H, W)``, the original's.
    isos : the isometries it may be laid under.
    at : its north-west pixel (row, column) in the fabric.
    width : of the fabric, px.

    Attributes: ``coarse`` and ``fine``, tables (keys, anchors); ``common`` and ``allowed``, sorted
    keys of the windows of either side that the original repeats; ``filled``, entries of either
    table.
    """

    def __init__(self, heights: np.ndarray, isos: Iterable[int], at: tuple[int, int], width: int):
        images = [np.ascontiguousarray(isometries.apply(int(iso), heights)) for iso in isos]
        self.common, self.allowed = (_repeated(images, side) for side in (ANCHORED, WINDOW))
        self.filled = [0, 0]
        self.coarse, self.fine = (
            (np.zeros(1 << 10, np.uint64), np.full(1 << 10, FREE, np.int64)) for _ in range(2)
        )
        own = window_keys(heights, ANCHORED)
        holding = common_windows(heights, own, self.common, self.allowed)
        self._grow(0, own[::APART, ::APART].size + sum(own.shape))
        self._grow(1, np.count_nonzero(holding))
        across = -(-width // APART)
        self.filled[0] = remember_all(*self.coarse, own, *at, APART, across)
        self.filled[1] = remember_all(*self.fine, holding, *at, 1, width)

    def make_room(self, groups: int) -> None:
        """Make the tables large enough for as many ``groups`` more."""
        self._grow(0, groups * _TOUCHED // APART**2 * 2)
        if self.common.size:
            self._grow(1, groups * _TOUCHED)

    def _grow(self, which: int, more: int) -> None:
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


def _repeated(images: list[np.ndarray], side: int) -> np.ndarray:
    """Sorted keys of the windows that stand in any of the ``images`` more than once."""
    found = []
    for image in images:
        each, counts = np.unique(window_keys(image, side), return_counts=True)
        found.append(each[counts > 1])
    return np.unique(np.concatenate(found))
