"""Correlations of range blocks that this process has found before, by the pixels within reach.

Children share most of their map with their parents and siblings. The best correlation of a range
block depends only on the pixels that its domain blocks may cover. 128 bits of a hash stand for
these pixels, so two sets of pixels never meet in practice: a night of a million births makes one
such error with a chance of 10⁻²⁰.
"""

from threading import Lock

import numpy as np

#: Number of kept correlations, a power of two: those of some hundred maps of 256 × 256 px, 3 MB.
_KEPT = 1 << 17


class KnownWindows:
    """Values of range blocks, by hashes of their windows. A new value replaces an older one that
    has the same place in the table."""

    def __init__(self, kept: int = _KEPT):
        self._keys, self._values = np.zeros((kept, 2), np.uint64), np.zeros(kept, np.float32)
        self._lock = Lock()

    def look_up(self, keys: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Look up the values of ``keys``, uint64 ``(n, 2)``: float32 ``(n,)``, and bool ``(n,)``,
        whether each is known."""
        from evocity.coding.matching.known_windows._kernels import look_up

        values, known = np.zeros(len(keys), np.float32), np.empty(len(keys), bool)
        with self._lock:
            look_up(keys, self._keys, self._values, values, known)
        return values, known

    def keep(self, keys: np.ndarray, values: np.ndarray) -> None:
        """Keep the ``values`` of ``keys``."""
        from evocity.coding.matching.known_windows._kernels import keep

        with self._lock:
            keep(keys, values, self._keys, self._values)


def window_keys(
    heights: np.ndarray, block: int, multiples: tuple[int, ...], reach: int, *limits: float
) -> np.ndarray:
    """Compute the hash of the pixels that decide on the best domain block of each range block:
    uint64 ``(rows · columns, 2)``. The ``limits`` and all other arguments are part of it."""
    from evocity.coding.matching.known_windows._kernels import hash_blocks, hash_windows

    rows, columns = (side // block for side in heights.shape)
    pixels = np.ascontiguousarray(heights, np.float32)
    before, after = -(-reach // block), (reach + max(multiples) * block - 1) // block
    about = np.array([block, *multiples, -1, reach, *limits], np.float64).view(np.uint64)
    blocks = np.empty((rows, columns, 2), np.uint64)
    hash_blocks(pixels.view(np.uint32), block, about, blocks)
    keys = np.empty((rows, columns, 2), np.uint64)
    hash_windows(blocks, before, after, keys)
    return keys.reshape(-1, 2)


__all__ = ["KnownWindows", "window_keys"]
