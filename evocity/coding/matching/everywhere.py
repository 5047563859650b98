"""What the best domain blocks leave unexplained of range blocks at every place of a map.

Every position of the range blocks and every one of the domain blocks is looked at, in bands of
rows, so that memory does not grow with the map.
"""

import functools
import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evocity.coding.matching.crew import Crew
from evocity.coding.matching.d4 import d4_basis
from evocity.coding.matching.likeness import Blocks, RangeCodes
from evocity.coding.matching.shapes import Shapes
from evocity.coding.matching.tiles import Tiles, cut_tiles, reach

#: µ and ρ² are known to so much: the search sums in float32.
RESOLUTION = 1e-6
#: Domain blocks of less energy a pixel, heights taken as 0…1, are flat but for rounding.
_FLAT = 1e-20
#: Bounds on unit blocks are good to so much.
_SLACK = np.float32(1e-5)
#: Blocks are compared as whole numbers of their own span's so many parts.
_STEPS = 2.0**26
#: Bytes that the blocks of one band of rows may take in float64.
_BAND = 32 << 20
#: Range blocks a thread takes at a time.
_CHUNK = 512

Progress = Callable[[int, int], None]


def pairs(shape: tuple[int, int], block: int, extents: tuple[int, ...]) -> int:
    """Range positions × domain positions."""
    every = sum(_positions(shape, extent) for extent in extents)
    return _positions(shape, block) * every


def _positions(shape: tuple[int, int], extent: int) -> int:
    height, width = shape
    return (height - extent + 1) * (width - extent + 1)


class Work:
    """How much is done, told as it grows."""

    def __init__(self, progress: Progress | None, total: int):
        self.progress, self.total, self.done = progress, total, 0.0

    def add(self, pairs: float) -> None:
        self.done += pairs
        if self.progress:
            self.progress(min(round(self.done), self.total), self.total)


def least_errors(heights, block, extents, normalise, threads, work: Work):
    """min over D of µ(R, D), float64 ``(H − B + 1, W − B + 1)``, NaN if flat and left out; the D
    that reaches it, int64 alike, 0 if flat; and the curve of means."""
    level = heights.astype(np.float64) - heights.min()
    level /= level.max() or 1.0
    errors = np.empty([side - block + 1 for side in level.shape])
    best = np.empty(errors.shape, np.int64)
    sums, counted = dict.fromkeys(extents, 0.0), 0
    with Crew(threads) as crew:
        for rows in _bands(level, block, block):
            share, codes, of = _ranges(level[rows.start : rows.stop + block - 1], block)
            busy = of >= 0
            if normalise == "variance":
                share = np.where(busy, 1.0, np.nan)
            else:
                share[~busy] = 0
            counted += int(np.count_nonzero(~np.isnan(share)))
            most, which = np.zeros(len(codes), np.float32), np.zeros(len(codes), np.int64)
            for extent in reversed(extents):  # the smallest has the last word
                found = _explained(level, block, extent, codes, crew, work, share.size)
                sums[extent] += float(np.nansum(_unexplained(share, of, found)))
                which[found >= most - np.float32(RESOLUTION)] = extent
                np.maximum(most, found, out=most)
            errors[rows] = _unexplained(share, of, most).reshape(-1, errors.shape[1])
            best[rows] = np.where(busy, which[of] if which.size else 0, 0).reshape(
                -1, errors.shape[1]
            )
    curve = {extent: sums[extent] / counted if counted else math.nan for extent in extents}
    return errors, best, curve


def _unexplained(share: np.ndarray, of: np.ndarray, found: np.ndarray) -> np.ndarray:
    """What is left of the ``share`` of each position where its shape is ``found`` to ρ²; the
    share itself where it is flat, 0 or NaN."""
    left, busy = share.copy(), of >= 0
    left[busy] *= 1 - found[of[busy]].astype(np.float64)
    return left


def _bands(level: np.ndarray, extent: int, block: int) -> Iterator[slice]:
    """Rows of the positions of blocks of ``extent`` px, so many that their B² values fit."""
    rows, columns = (side - extent + 1 for side in level.shape)
    step = max(1, _BAND // (8 * block**2 * columns))
    for top in range(0, rows, step):
        yield slice(top, min(top + step, rows))


def _ranges(level: np.ndarray, block: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Range blocks at all positions of a strip, each shape once: blocks that differ by level,
    contrast and isometry alone have the same share explained.

    Returns ‖r̃‖²/B² of each position ``(n,)``; float32 codes of unit norm ``(shapes, B²)``; and
    the shape of each position ``(n,)``, −1 where it is flat.
    """
    blocks = sliding_window_view(level, (block, block)).reshape(-1, block * block)
    share = blocks.var(axis=1)
    lowest, span = blocks.min(axis=1), np.ptp(blocks, axis=1)
    (busy,) = np.nonzero(span)
    shapes = np.rint((blocks[busy] - lowest[busy, None]) * (_STEPS / span[busy, None]))
    of = np.full(len(blocks), -1)
    found = Shapes.of_blocks(shapes.reshape(-1, block, block))
    of[busy] = found.of
    return share, np.ascontiguousarray(_coordinates(shapes[found.first].T, block).T), of


def _coordinates(blocks: np.ndarray, block: int) -> np.ndarray:
    """D4 coordinates, float32, of unit norm, of those blocks ``(B², n)`` that are not flat."""
    centred = blocks - blocks.mean(axis=0)
    energy = np.einsum("kn,kn->n", centred, centred)
    busy = energy > _FLAT * block**2
    unit = centred[:, busy] / np.sqrt(energy[busy])
    return np.einsum("kl,ln->kn", d4_basis(block), unit).astype(np.float32)


def _explained(level, block, extent, codes, crew, work: Work, positions: int) -> np.ndarray:
    """Largest ρ² of each code with any domain block of side ``extent``, float32 in 0…1.

    ``positions`` is how many range positions the codes stand for.
    """
    found = np.zeros(len(codes), np.float32)
    if not len(codes):  # all flat
        work.add(positions * _positions(level.shape, extent))
        return found
    parts = [slice(k, k + _CHUNK) for k in range(0, len(codes), _CHUNK)]
    ranges = RangeCodes.of(codes)
    for rows in _bands(level, extent, block):
        domains = _domains(level[rows.start : rows.stop + extent - 1], block, extent)
        compare = functools.partial(_compare, cut_tiles(domains, np.inf), ranges, found)
        for part in crew.map(compare, parts):
            work.add(domains.at.size * positions * len(found[part]) / len(found))
    return np.minimum(found, 1)


def _domains(level: np.ndarray, block: int, extent: int) -> Blocks:
    """Domain blocks at all positions of a strip. The search compares with them all, wherever they
    lie."""
    # down first, then across: so nothing grows with D
    across = _shrunk(_shrunk(level, block, extent, axis=0), block, extent, axis=2)
    blocks = np.ascontiguousarray(across.transpose(2, 3, 1, 0)).reshape(-1, block * block)
    return Blocks(
        raster=blocks,
        offsets=np.arange(block * block, dtype=np.uint64),
        at=np.arange(0, blocks.size, block * block),
        least=np.float32(_FLAT * block**2),
    )


def _shrunk(values: np.ndarray, block: int, extent: int, axis: int) -> np.ndarray:
    """Every run of ``extent`` values along ``axis``, averaged down to ``block`` values on a new
    first axis; a value at a seam is shared by area."""
    lines = np.moveaxis(values, axis, -1)
    positions = lines.shape[-1] - extent + 1
    total = np.zeros((*lines.shape[:-1], lines.shape[-1] + 2))
    np.cumsum(lines, axis=-1, out=total[..., 1:-1])
    total[..., -1] = total[..., -2]
    seams = np.empty((block + 1, *lines.shape[:-1], positions))
    for k, seam in enumerate(seams):  # the sum up to the k-th seam, itself within a pixel
        whole, part = divmod(k * extent, block)
        before, after = (total[..., at : at + positions] for at in (whole, whole + 1))
        seam[:] = before + part / block * (after - before)
    return np.moveaxis(np.diff(seams, axis=0) * (block / extent), -1, axis + 1)


def _compare(tiles: Tiles, ranges: RangeCodes, found, part: slice) -> slice:
    """Take a strip's domain blocks into account for one chunk of range blocks."""
    best = np.zeros_like(found[part])
    reach(tiles, ranges[part], np.full(best.size, _SLACK), best)
    np.maximum(found[part], best, out=found[part])
    return part
