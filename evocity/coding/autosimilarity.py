"""Autosimilarity of a city: maps of the error µ over all range positions.

µ(R, D) = Σ (ω(D) − R)² is the error of the best domain block of side D for range block R, σ free.
It is divided by B²·(range of heights)² or by R's own variance, and so lies in 0…1 (Marsault 2005
§1.3). R takes every pixel position, also off the pavement. D need not be a multiple of B: pixels
at the seams count by area.
"""

import operator
import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evocity.citymap import CityMap
from evocity.coding.matching.residual import RESOLUTION, Progress, Work, least_errors, pairs
from evocity.errors import GenomeError, check_word, keyword, none_setting, setting

#: The divisors of µ.
NORMALISATIONS = ("heights", "variance")


@dataclass(frozen=True, eq=False)
class AutosimilarityMaps:
    """Maps that show how similar a city is to itself, for range blocks of one size.

    city : map that was searched.
    block : side B of the range blocks, px.
    normalise : divisor of the error µ, "heights" or "variance".
    mean : µ̃(p), float32 ``(H, W)`` in 0…1. Each range block R that contains the pixel p has a
        least µ(R, D) over all D. The mean of these values is µ̃(p).
    least : µ_min(p), float32 ``(H, W)`` in 0…1: the least of these values, never above ``mean``.
    domain : best domain side D, float32 ``(H, W)``, px. Among the range blocks that contain p and
        are not flat, the block with the least µ determines it. If several D differ by at most
        `RESOLUTION`, the smallest wins. NaN if all blocks that contain p are flat.
    curve : mapping from each D to the mean of µ(R, D) over all positions R, in ascending order of
        D.
    seconds : wall time of the search.

    Divided by the variance, µ has no value for flat range blocks. So ``mean``, ``least`` and
    ``curve`` omit these blocks. They are NaN where no other block remains.
    """

    city: CityMap
    block: int
    normalise: str
    mean: np.ndarray
    least: np.ndarray
    domain: np.ndarray
    curve: dict[int, float]
    seconds: float


@dataclass(frozen=True, eq=False)
class FreeBlockMaps:
    """Maps that show how similar a city is to itself, for range blocks of free size.

    city : map that was searched.
    least : µ_min(p), float32 ``(H, W)`` in 0…1: the least value over all B.
    largest : B_max(p), float32 ``(H, W)``, px: the largest B with this least value (within
        `RESOLUTION`).
    likeness : (1 − µ_min(p))·B_max(p), float32 ``(H, W)``, px.
    domain : domain side D that explains most at p with range blocks of side B_max(p), float32 ``(H,
        W)``, px.
    maps : mapping from each B to its maps.

    A value is NaN where ``maps`` have no value, see `AutosimilarityMaps`.
    """

    city: CityMap
    least: np.ndarray
    largest: np.ndarray
    likeness: np.ndarray
    domain: np.ndarray
    maps: dict[int, AutosimilarityMaps]


def autosimilarity_maps(
    city: CityMap,
    *,
    block: int = 8,
    domains: int | Iterable[int] | None = None,
    normalise: str = "heights",
    threads: int | None = None,
    progress: Progress | None = None,
) -> AutosimilarityMaps:
    """Compute the error maps µ̃ and µ_min, the best D, and the curve from D to µ, by exact search
    of the whole map.

    Parameters
    ----------
    city : map that is large enough for the largest domain block.
    block : side B of the range blocks, px, 2 or more. The search compares range blocks at all pixel
        positions.
    domains : side D of the domain blocks, px, above B. It may be 20, or several such as (16, 20,
        24), or all up to a limit, ``range(B + 1, 33)``. None is 2B. The search compares domain
        blocks at all pixel positions under all isometries.
    normalise : divisor of the mean square error of a range block. "heights" divides by the square
        of the map's range of heights. This scale is the same for the whole map, so a single tower
        makes µ small everywhere. "variance" divides by the variance of the block itself. Then µ is
        1 − ρ², the unexplained share, at any heights. Flat blocks are omitted.
    threads : number of threads; None for all cores. The result does not depend on it.
    progress : function that is called with (done, total) during the search.

    Raises
    ------
    GenomeError : a parameter is out of bounds, or the map is too small for it.

    The time grows with the fourth power of the side, and with the number of D. The memory does not
    grow with them.
    """
    block, domains = _check_sizes(city, block, domains, threads, normalise)
    work = Work(progress, pairs(city.shape, block, domains))
    return _search_maps(city, block, domains, normalise, threads, work)


def free_block_maps(
    city: CityMap,
    *,
    blocks: Iterable[int] = (4, 6, 8),
    domains: int | Iterable[int] | None = None,
    normalise: str = "heights",
    threads: int | None = None,
    progress: Progress | None = None,
) -> FreeBlockMaps:
    """Compute µ_min, B_max and (1 − µ_min)·B_max, where B ranges over ``blocks`` (px).

    Each B is searched with all larger ``domains`` (px); at least one must be larger. None searches
    2B for each B. Everything else works as in `autosimilarity_maps`.
    """
    blocks = list(blocks)
    if not blocks:
        raise GenomeError(
            "blocks = [] is empty",
            "at least one side of range blocks",
            "give sides in px, for example 4 and 8",
        )
    if isinstance(domains, Iterable):
        domains = list(domains)
    sizes = dict(
        _check_sizes(city, block, _larger_domains(domains, block), threads, normalise)
        for block in blocks
    )
    work = Work(progress, sum(pairs(city.shape, *size) for size in sizes.items()))
    maps = {
        block: _search_maps(city, block, sizes[block], normalise, threads, work)
        for block in sorted(sizes)
    }
    least = np.fmin.reduce([one_size.least for one_size in maps.values()])
    largest, domain = np.full((2, *city.shape), np.nan, np.float32)
    for block, one_size in maps.items():  # ascending: the largest stays
        attained = one_size.least <= least + np.float32(RESOLUTION)
        largest[attained], domain[attained] = block, one_size.domain[attained]
    return FreeBlockMaps(city, least, largest, (1 - least) * largest, domain, maps)


def _larger_domains(domains, block):
    """Select the ``domains`` larger than the block; faulty ones all stay, for the error message."""
    try:
        larger = [extent for extent in domains if extent > block]
    except TypeError:  # a number, None, or nonsense
        return domains
    return larger or domains


def _check_sizes(city: CityMap, block, domains, threads, normalise) -> tuple[int, tuple[int, ...]]:
    """Return B and all D, ascending; raise `GenomeError` unless they are usable."""
    smaller = min(city.shape)
    try:
        block = operator.index(block)
        if domains is None:
            domains = 2 * block
        listed = domains if isinstance(domains, Iterable) else [domains]
        extents = tuple(sorted({operator.index(extent) for extent in listed}))
    except TypeError as error:
        raise GenomeError(
            f"{city.name}: {setting('block', block)}, {setting('domains', domains)}",
            "whole numbers of pixels: one side of range blocks, and one or several sides of domain "
            "blocks",
            f"give, for example, {keyword('block', 8)}, {keyword('domains', (16, 20, 24))}",
        ) from error
    if block < 2 or not extents or extents[0] <= block or extents[-1] > smaller:
        sides = ", ".join(map(str, extents)) or "none"
        raise GenomeError(
            f"{city.name}: range blocks of B = {block} px do not fit domain blocks of D = {sides} "
            "px",
            f"B ≥ 2 px, and D above B and at most {smaller} px, the smaller side of the map",
            "change the sizes of the blocks, or read a larger window",
        )
    if threads is not None and not threads >= 1:
        raise GenomeError(
            setting("threads", threads),
            f"1 or more, or {none_setting('threads')} for all cores",
            f"leave {keyword('threads')} out",
        )
    check_word("normalise", normalise, NORMALISATIONS, "leave it out for heights", GenomeError)
    return block, extents


def _search_maps(city: CityMap, block: int, extents, normalise, threads: int | None, work: Work):
    start = time.perf_counter()
    errors, best, curve = least_errors(city.heights, block, extents, normalise, threads, work)
    known = ~np.isnan(errors)  # else flat and omitted
    least = _least_error(errors, known, block)
    with np.errstate(invalid="ignore"):  # without a block: 0 of 0
        mean = _combine_holders(np.sum, np.where(known, errors, 0), block, outside=0)
        mean /= _combine_holders(np.sum, known.astype(float), block, outside=0)
    return AutosimilarityMaps(
        city=city,
        block=block,
        normalise=normalise,
        mean=np.maximum(mean, least).astype(np.float32),  # rounding may put mean below least
        least=least.astype(np.float32),
        domain=_best_domain(errors, best, block),
        curve=curve,
        seconds=time.perf_counter() - start,
    )


def _least_error(errors: np.ndarray, among: np.ndarray, block: int) -> np.ndarray:
    """Find for each pixel the least error of those blocks ``among`` all that hold it, or NaN."""
    least = _combine_holders(np.min, np.where(among, errors, np.inf), block, outside=np.inf)
    return np.where(np.isfinite(least), least, np.nan)


def _best_domain(errors: np.ndarray, best: np.ndarray, block: int) -> np.ndarray:
    """Find for each pixel the ``best`` D (0 where flat) of the block of least error among those
    that hold it, the smallest of several: float32 ``(H, W)``."""
    least = _least_error(errors, best > 0, block)
    domain = np.full(least.shape, np.nan, np.float32)
    for extent in np.unique(best[best > 0])[::-1]:  # falling: the smallest stays
        domain[_least_error(errors, best == extent, block) <= least + RESOLUTION] = extent
    return domain


def _combine_holders(combine, values: np.ndarray, block: int, outside: float) -> np.ndarray:
    """Apply ``combine``, for each pixel of the map, to all range blocks that hold it."""
    for axis in (0, 1):
        around = [(block - 1, block - 1) if axis == k else (0, 0) for k in (0, 1)]
        padded = np.pad(values, around, constant_values=outside)
        values = combine(sliding_window_view(padded, block, axis=axis), axis=-1)
    return values
