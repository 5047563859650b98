"""How like itself is a city, and where? Maps of the error µ over all range positions.

µ(R, D) = Σ (ω(D) − R)² is what the best domain block of side D leaves unexplained of range
block R, σ unconstrained, divided by B²·(range of heights)², so that it lies in 0…1 (Marsault
2005 §1.3). R takes every pixel position, not the pavement's alone, and D need be no multiple
of B: pixels at the seams are shared by area.
"""

import functools
import operator
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evocity.citymap import CityMap
from evocity.coding.matching.crew import Crew
from evocity.coding.matching.d4 import d4_basis
from evocity.coding.matching.likeness import Blocks, RangeCodes
from evocity.coding.matching.shapes import Shapes
from evocity.coding.matching.tiles import Tiles, cut_tiles, reach
from evocity.errors import GenomeError

#: µ is known to so much: the search sums in float32.
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


@dataclass(frozen=True, eq=False)
class AutosimilarityMaps:
    """Where a city is like itself, for range blocks of one size.

    city : the map that was looked at.
    block : B, px.
    mean : float32 ``(H, W)`` in 0…1: µ̃(p), the mean of min over D of µ(R, D) over all range
        blocks R that hold pixel p.
    least : float32 ``(H, W)`` in 0…1: µ_min(p), the least of the same, never above ``mean``.
    curve : D → mean of µ(R, D) over all range positions R, in ascending order of D.
    seconds : wall time.
    """

    city: CityMap
    block: int
    mean: np.ndarray
    least: np.ndarray
    curve: dict[int, float]
    seconds: float


@dataclass(frozen=True, eq=False)
class FreeBlockMaps:
    """Where a city is like itself, the size of range blocks left free.

    city : the map that was looked at.
    least : float32 ``(H, W)`` in 0…1: µ_min(p), the least over all B.
    largest : float32 ``(H, W)``, px: B_max(p), the largest B that reaches it (within
        `RESOLUTION`).
    likeness : float32 ``(H, W)``, px: (1 − µ_min(p))·B_max(p).
    maps : B → the maps for that B alone.
    """

    city: CityMap
    least: np.ndarray
    largest: np.ndarray
    likeness: np.ndarray
    maps: dict[int, AutosimilarityMaps]


def autosimilarity_maps(
    city: CityMap,
    *,
    block: int = 8,
    domains: int | Iterable[int] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> AutosimilarityMaps:
    """Error maps µ̃ and µ_min, and the curve D → µ, by exact search over the whole map.

    Parameters
    ----------
    city : any map with room for the largest domain block.
    block : B, side of the range blocks, px, 2 or more. All its pixel positions are looked at.
    domains : D, side of the domain blocks, px, above B: 20, (16, 20, 24), or free up to a
        limit, range(B + 1, 33). None is 2B. All their pixel positions and 8 isometries.
    threads : threads to use; None for all cores. The result does not depend on it.
    progress : called with (done, total) as work goes on.

    Raises
    ------
    GenomeError : a parameter is out of bounds, or the map too small for it.

    Time grows with the fourth power of the side and with the number of D; memory does not.
    """
    block, domains = _checked(city, block, domains, threads)
    return _maps(city, block, domains, threads, _Work(progress, _pairs(city, block, domains)))


def free_block_maps(
    city: CityMap,
    *,
    blocks: Iterable[int] = (4, 6, 8),
    domains: int | Iterable[int] | None = None,
    threads: int | None = None,
    progress: Progress | None = None,
) -> FreeBlockMaps:
    """µ_min, B_max and (1 − µ_min)·B_max with B free among ``blocks`` (px).

    ``domains`` (px, above every B) are tried with each B; None is 2B for each. All else is as
    in `autosimilarity_maps`.
    """
    blocks = list(blocks)
    if not blocks:
        raise GenomeError("blocks = []", "one size of range blocks or more", "give some, in px")
    if isinstance(domains, Iterable):
        domains = list(domains)
    sizes = dict(sorted(_checked(city, block, domains, threads) for block in blocks))
    work = _Work(progress, sum(_pairs(city, *size) for size in sizes.items()))
    maps = {block: _maps(city, block, extents, threads, work) for block, extents in sizes.items()}
    every = np.stack([found.least for found in maps.values()])
    least = every.min(axis=0)
    largest = np.zeros_like(least)
    for block, found in zip(maps, every, strict=True):  # ascending: the largest stays
        largest[found <= least + np.float32(RESOLUTION)] = block
    return FreeBlockMaps(city, least, largest, (1 - least) * largest, maps)


def _checked(city: CityMap, block, domains, threads) -> tuple[int, tuple[int, ...]]:
    """B and all D, ascending, once they are known to be usable."""
    smaller = min(city.shape)
    try:
        block = operator.index(block)
        if domains is None:
            domains = 2 * block
        listed = domains if isinstance(domains, Iterable) else [domains]
        extents = tuple(sorted({operator.index(extent) for extent in listed}))
    except TypeError as error:
        raise GenomeError(
            f"{city.name}: block = {block!r}, domains = {domains!r}",
            "whole numbers of pixels: one B; one D or several",
            "give, for example, block=8, domains=(16, 20, 24)",
        ) from error
    if block < 2 or not extents or extents[0] <= block or extents[-1] > smaller:
        sides = ", ".join(map(str, extents)) or "none"
        raise GenomeError(
            f"{city.name}: range blocks of {block} px, domain blocks of {sides} px",
            f"B of 2 px or more, D above B and at most {smaller} px, the map's smaller side",
            "change the sizes of the blocks, or read a larger window",
        )
    if threads is not None and not threads >= 1:
        raise GenomeError(
            f"threads = {threads}", "1 or more, or None for all cores", "leave it out"
        )
    return block, extents


def _pairs(city: CityMap, block: int, extents: tuple[int, ...]) -> int:
    """Range positions × domain positions."""
    every = sum(_positions(city.shape, extent) for extent in extents)
    return _positions(city.shape, block) * every


def _positions(shape: tuple[int, int], extent: int) -> int:
    height, width = shape
    return (height - extent + 1) * (width - extent + 1)


class _Work:
    """How much is done, told as it grows."""

    def __init__(self, progress: Progress | None, total: int):
        self.progress, self.total, self.done = progress, total, 0.0

    def add(self, pairs: float) -> None:
        self.done += pairs
        if self.progress:
            self.progress(min(round(self.done), self.total), self.total)


def _maps(city: CityMap, block: int, extents, threads: int | None, work: _Work):
    start = time.perf_counter()
    errors, curve = _errors(city.heights, block, extents, threads, work)
    least = _over_holders(np.min, errors, block, outside=np.inf)
    holders = _over_holders(np.sum, np.ones_like(errors), block, outside=0)
    mean = _over_holders(np.sum, errors, block, outside=0) / holders
    return AutosimilarityMaps(
        city=city,
        block=block,
        mean=np.maximum(mean, least).astype(np.float32),  # they may differ by rounding
        least=least.astype(np.float32),
        curve=curve,
        seconds=time.perf_counter() - start,
    )


def _over_holders(combine, values: np.ndarray, block: int, outside: float) -> np.ndarray:
    """For each pixel of the map, ``combine`` over all range blocks that hold it."""
    for axis in (0, 1):
        around = [(block - 1, block - 1) if axis == k else (0, 0) for k in (0, 1)]
        padded = np.pad(values, around, constant_values=outside)
        values = combine(sliding_window_view(padded, block, axis=axis), axis=-1)
    return values


def _errors(heights, block, extents, threads, work: _Work) -> tuple[np.ndarray, dict[int, float]]:
    """min over D of µ(R, D), float64 ``(H − B + 1, W − B + 1)``, and the curve of means."""
    level = heights.astype(np.float64) - heights.min()
    level /= level.max() or 1.0
    errors = np.empty([side - block + 1 for side in level.shape])
    curve = dict.fromkeys(extents, 0.0)
    with Crew(threads) as crew:
        for rows in _bands(level, block, block):
            share, codes, of = _ranges(level[rows.start : rows.stop + block - 1], block)
            best = np.zeros(len(codes), np.float32)
            for extent in extents:
                found = _explained(level, block, extent, codes, crew, work, share.size)
                curve[extent] += float(_unexplained(share, of, found).sum()) / errors.size
                np.maximum(best, found, out=best)
            errors[rows] = _unexplained(share, of, best).reshape(-1, errors.shape[1])
    return errors, curve


def _unexplained(share: np.ndarray, of: np.ndarray, found: np.ndarray) -> np.ndarray:
    """What is left of the ``share`` of each position where its shape is ``found`` to ρ²."""
    left, busy = np.zeros_like(share), of >= 0
    left[busy] = share[busy] * (1 - found[of[busy]].astype(np.float64))
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
    return (d4_basis(block) @ unit).astype(np.float32)


def _explained(level, block, extent, codes, crew, work: _Work, positions: int) -> np.ndarray:
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


__all__ = [
    "RESOLUTION",
    "AutosimilarityMaps",
    "FreeBlockMaps",
    "autosimilarity_maps",
    "free_block_maps",
]
