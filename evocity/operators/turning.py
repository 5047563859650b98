"""Rectangles of cells laid under the 8 isometries: where cells go, how maps are cut along them."""

import numpy as np

from evocity import isometries
from evocity.pavement import Pavement


def swaps(iso: int) -> bool:
    """Whether an isometry makes columns of rows."""
    return bool(isometries.AFFINE[iso, 2] == 0)


def turned_places(places: np.ndarray, shape: tuple[int, int], iso: int) -> np.ndarray:
    """Where ``places`` ``(2, g)``, rows and columns of a rectangle of this ``shape``, come to lie
    once it is turned by an isometry, from its new north-west corner."""
    a = isometries.AFFINE[isometries.INVERSE[iso]]
    last_row, last_column = (size - 1 for size in (shape if a[3] == 0 else shape[::-1]))
    row, column = places
    return np.stack(
        [
            a[0] * last_row + a[2] * row + a[4] * column,
            a[1] * last_column + a[3] * row + a[5] * column,
        ]
    )


def turned_blocks(grid: Pavement, raster: np.ndarray, iso: int) -> tuple[np.ndarray, int]:
    """A ``raster`` (H, W) under an isometry, cut along the cells of the ``grid``, ``(n, B, B)``;
    and how many of these are a row."""
    side, columns = grid.block, grid.rows if swaps(iso) else grid.columns
    cut = isometries.apply(iso, raster).reshape(-1, side, columns, side)
    return np.ascontiguousarray(cut.swapaxes(1, 2)).reshape(-1, side, side), columns
