"""The eight isometries of the square: one table, with inverse and composition.

Isometry *k* maps a block to a block: ``apply(k, block)[i, j] = block[source(k)[i, j]]``.
0 identity; 1, 2, 3 quarter turns (anticlockwise, as `numpy.rot90`); 4 the transpose
(mirror in the main diagonal); 5, 6, 7 the transpose followed by 1, 2, 3 quarter turns.
"""

from functools import cache

import numpy as np

COUNT = 8
NAMES = (
    "identity",
    "turn 90",
    "turn 180",
    "turn 270",
    "transpose",
    "transpose, turn 90",
    "transpose, turn 180",
    "transpose, turn 270",
)


def apply(iso: int, block: np.ndarray) -> np.ndarray:
    """Apply isometry ``iso`` (0…7) to a square ``block`` (its last two axes)."""
    turned = np.swapaxes(block, -1, -2) if iso >= 4 else block
    return np.rot90(turned, iso % 4, axes=(-2, -1))


@cache
def sources(size: int) -> np.ndarray:
    """Make the gather table, int32 ``(8, size²)``: row k has the flat source pixels of isometry
    k."""
    index = np.arange(size * size, dtype=np.int32).reshape(size, size)
    table = np.stack([apply(k, index).ravel() for k in range(COUNT)])
    table.setflags(write=False)
    return table


def _group() -> tuple[np.ndarray, np.ndarray]:
    table = [row.tolist() for row in sources(2)]
    index = np.arange(4).reshape(2, 2)
    composition = np.array(
        [
            [table.index(apply(a, apply(b, index)).ravel().tolist()) for b in range(8)]
            for a in range(8)
        ],
        dtype=np.uint8,
    )
    inverse = np.argmin(composition, axis=1).astype(np.uint8)  # the identity is 0
    composition.setflags(write=False)
    inverse.setflags(write=False)
    return composition, inverse


#: ``COMPOSITION[a, b]`` is the isometry "b, then a"; ``INVERSE[a]`` undoes a.
COMPOSITION, INVERSE = _group()


def _lowest() -> np.ndarray:
    sets = np.arange(256)[:, None] >> np.arange(8) & 1
    lowest = np.where(sets, COMPOSITION[:, None], COUNT).min(axis=2).astype(np.uint8)
    lowest.setflags(write=False)
    return lowest


#: ``LOWEST[a, s]``: the lowest isometry "b, then a" with b in the set s, bit b of 0…255.
LOWEST = _lowest()


def _affine() -> np.ndarray:
    table = np.empty((COUNT, 6), np.int64)
    for row, flat in zip(table, sources(2), strict=True):
        corner, east, south, _ = (np.array(divmod(int(pixel), 2)) for pixel in flat)
        row[:] = [*corner, *(south - corner), *(east - corner)]
    table.setflags(write=False)
    return table


#: How each isometry lays a square, int64 ``(8, 6)``. The target's north-west pixel comes from the
#: source's first (0) or last (1) row and column; then (rows, columns) to go in the source for a
#: step south in the target, and for one east. So, of a square of side s, pixel (i, j) comes from
#: row a[0]·(s − 1) + a[2]·i + a[4]·j and column a[1]·(s − 1) + a[3]·i + a[5]·j.
AFFINE = _affine()
