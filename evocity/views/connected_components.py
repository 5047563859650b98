"""Connected components of a mask, and its dilation by one pixel."""

import numpy as np

from evocity.views._kernels import label


def pieces(mask: np.ndarray, *, corners: bool = False) -> tuple[np.ndarray, int]:
    """Label the pieces of a bool ``(H, W)`` ``mask``: int32 ``(H, W)``, 1…n, 0 elsewhere; and n.

    Pixels of a piece touch by their sides, or by their ``corners`` too; pieces are numbered in the
    order of their first pixels, row by row. About 0.3 ms at 256².
    """
    labels = np.empty(mask.shape, np.int32)
    return labels, label(np.ascontiguousarray(mask), corners, labels)


def dilate(mask: np.ndarray, *, corners: bool = False) -> np.ndarray:
    """Dilate a ``mask`` by the pixels that touch it by a side, or by their ``corners`` too: bool
    ``(H, W)``."""
    padded = np.pad(mask, 1)
    across = padded[:, :-2] | padded[:, 1:-1] | padded[:, 2:]
    if corners:
        return across[:-2] | across[1:-1] | across[2:]
    return across[1:-1] | padded[:-2, 1:-1] | padded[2:, 1:-1]
