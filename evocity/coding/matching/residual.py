"""Residual errors of range blocks at every place of a map under their best domain blocks, in bands
of rows, so memory does not grow with the map."""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evocity.coding.matching import Crew
from evocity.coding.matching.candidates import Blocks, RangeCodes, Shapes
from evocity.coding.matching.d4 import d4_basis
from evocity.coding.matching.tiles import cut_tiles, raise_best

#: Precision of µ and ρ²: the search sums in float32.
RESOLUTION = 1e-6
#: Domain blocks of less energy per pixel, with heights scaled to 0…1, are flat up to rounding.
_FLAT = 1e-20
#: Precision of bounds on unit blocks.
_SLACK = np.float32(1e-5)
#: Comparison of blocks divides their span into so many parts.
_STEPS = 2.0**26
#: The most bytes in float64 for the blocks of one band of rows.
_BAND = 32 << 20
#: Range blocks that a thread takes in one go.
_CHUNK = 512

Progress = Callable[[float, int], None]


def pairs(shape: tuple[int, int], block: int, extents: tuple[int, ...]) -> int:
    """Count range positions × domain positions."""
    every = sum(_positions(shape, extent) for extent in extents)
    return _positions(shape, block) * every


def _positions(shape: tuple[int, int], extent: int) -> int:
    height, width = shape
    return (height - extent + 1) * (width - extent + 1)


class Work:
    """A count of the work done, rounded to ``digits``, which calls ``progress`` as it grows."""

    def __init__(self, progress: Progress | None, total: int, digits: int | None = None):
        self.progress, self.total, self.digits, self.done = progress, total, digits, 0.0

    def add(self, pairs: float) -> None:
        self.done += pairs
        if self.progress:
            self.progress(min(round(self.done, self.digits), self.total), self.total)


def least_errors(heights, block, extents, normalise, threads, work: Work):
    """Compute min over D of µ(R, D), float64 ``(H − B + 1, W − B + 1)``, NaN for flat range blocks
    without a value; the D of that minimum, int64, 0 if flat; and the curve of means."""
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
            for extent in reversed(extents):  # among equals the smallest wins
                rho2 = _explain(level, block, extent, codes, crew, work, share.size)
                sums[extent] += float(np.nansum(_residual(share, of, rho2)))
                which[rho2 >= most - np.float32(RESOLUTION)] = extent
                np.maximum(most, rho2, out=most)
            wide = errors.shape[1]
            errors[rows] = _residual(share, of, most).reshape(-1, wide)
            best[rows] = np.where(busy, which[of] if which.size else 0, 0).reshape(-1, wide)
    curve = {extent: sums[extent] / counted if counted else math.nan for extent in extents}
    return errors, best, curve


def _residual(share: np.ndarray, of: np.ndarray, rho2: np.ndarray) -> np.ndarray:
    """Reduce the ``share`` of each position by its shape's ``rho2``; flat ones keep 0 or NaN."""
    left, busy = share.copy(), of >= 0
    left[busy] *= 1 - rho2[of[busy]].astype(np.float64)
    return left


def _bands(level: np.ndarray, extent: int, block: int) -> Iterator[slice]:
    """Divide the rows of positions of blocks of ``extent`` px, so that B² values of each fit."""
    rows, columns = (side - extent + 1 for side in level.shape)
    step = max(1, _BAND // (8 * block**2 * columns))
    for top in range(0, rows, step):
        yield slice(top, min(top + step, rows))


def _ranges(level: np.ndarray, block: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Reduce the range blocks at all positions of a strip to shapes: range blocks that differ by
    level, contrast and isometry only have the same ρ². Returns ‖r̃‖²/B² of each position ``(n,)``;
    float32 codes of unit norm ``(shapes, B²)``; and the shape of each position ``(n,)``, −1 for
    flat ones."""
    blocks = sliding_window_view(level, (block, block)).reshape(-1, block * block)
    share = blocks.var(axis=1)
    lowest, span = blocks.min(axis=1), np.ptp(blocks, axis=1)
    (busy,) = np.nonzero(span)
    shapes = np.rint((blocks[busy] - lowest[busy, None]) * (_STEPS / span[busy, None]))
    of = np.full(len(blocks), -1)
    kinds = Shapes.of_blocks(shapes.reshape(-1, block, block))
    of[busy] = kinds.of
    return share, np.ascontiguousarray(_coordinates(shapes[kinds.first].T, block).T), of


def _coordinates(blocks: np.ndarray, block: int) -> np.ndarray:
    """Compute unit D4 coordinates, float32, of the blocks ``(B², n)`` that are not flat."""
    centred = blocks - blocks.mean(axis=0)
    energy = np.einsum("kn,kn->n", centred, centred)
    busy = energy > _FLAT * block**2
    unit = centred[:, busy] / np.sqrt(energy[busy])
    return np.einsum("kl,ln->kn", d4_basis(block), unit).astype(np.float32)


def _explain(level, block, extent, codes, crew, work: Work, positions: int) -> np.ndarray:
    """Compute the largest ρ² of each code with any domain block of side ``extent``, float32 in 0…1;
    the codes come from as many range ``positions``."""
    rho2 = np.zeros(len(codes), np.float32)
    if not len(codes):  # all flat
        work.add(positions * _positions(level.shape, extent))
        return rho2
    parts = [slice(k, k + _CHUNK) for k in range(0, len(codes), _CHUNK)]
    ranges = RangeCodes.of(codes)
    for rows in _bands(level, extent, block):
        domains = _domains(level[rows.start : rows.stop + extent - 1], block, extent)
        tiles = cut_tiles(domains, np.inf)

        def compare(part: slice, tiles=tiles) -> slice:
            best = np.zeros_like(rho2[part])
            raise_best(tiles, ranges[part], np.full(best.size, _SLACK), best)
            np.maximum(rho2[part], best, out=rho2[part])
            return part

        for part in crew.map(compare, parts):
            work.add(domains.at.size * positions * len(rho2[part]) / len(rho2))
    return np.minimum(rho2, 1)


def _domains(level: np.ndarray, block: int, extent: int) -> Blocks:
    """Shrink the domain blocks at all positions of a strip."""
    # down first, then across: so nothing grows with D
    across = _shrink(_shrink(level, block, extent, axis=0), block, extent, axis=2)
    blocks = np.ascontiguousarray(across.transpose(2, 3, 1, 0)).reshape(-1, block * block)
    return Blocks(
        raster=blocks,
        offsets=np.arange(block * block, dtype=np.uint64),
        at=np.arange(0, blocks.size, block * block),
        least=np.float32(_FLAT * block**2),
    )


def _shrink(values: np.ndarray, block: int, extent: int, axis: int) -> np.ndarray:
    """Average every run of ``extent`` values along ``axis`` to ``block`` values on a new first
    axis; a value at a seam counts by area."""
    lines = np.moveaxis(values, axis, -1)
    positions = lines.shape[-1] - extent + 1
    total = np.zeros((*lines.shape[:-1], lines.shape[-1] + 2))
    np.cumsum(lines, axis=-1, out=total[..., 1:-1])
    total[..., -1] = total[..., -2]
    seams = np.empty((block + 1, *lines.shape[:-1], positions))
    for k, seam in enumerate(seams):  # the sum up to the k-th seam, which lies within a pixel
        whole, part = divmod(k * extent, block)
        before, after = (total[..., at : at + positions] for at in (whole, whole + 1))
        seam[:] = before + part / block * (after - before)
    return np.moveaxis(np.diff(seams, axis=0) * (block / extent), -1, axis + 1)
