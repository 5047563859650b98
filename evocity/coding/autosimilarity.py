"""Autosimilarity of a city: maps of the error µ over all range positions.

µ(R, D) = Σ (ω(D) − R)², divided by B²·(range of heights)² or by R's own variance, is the error of
the best domain block of side D for range block R, σ free (Marsault 2005 §1.3). R takes every pixel
position. D need not be a multiple of B: pixels at the seams count by area.
"""

import operator
import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evocity.citymap import CityMap
from evocity.coding.matching.residual import RESOLUTION, Progress, Work, least_errors, pairs
from evocity.errors import GenomeError, check_number, check_word, keyword, none_setting, setting

#: The divisors of µ.
NORMALISATIONS = ("heights", "variance")


@dataclass(frozen=True, eq=False)
class AutosimilarityMaps:
    """Maps that show how similar a city is to itself, for range blocks of one size.

    city : map that was searched.
    block : side B of the range blocks, px.
    normalise : divisor of the error µ, "heights" or "variance".
    mean : mean error µ̃(p) at each pixel p, float32 ``(H, W)``, from 0 to 1. The error of a range
        block R is the least µ(R, D) over all sides D of domain blocks. The value µ̃(p) is the mean
        of the errors of all range blocks that contain p.
    least : least error µ_min(p) at each pixel p, float32 ``(H, W)``, from 0 to 1. The value
        µ_min(p) is the least error of all range blocks that contain p, and never exceeds the mean
        error µ̃(p).
    domain : best side D of domain blocks at each pixel p, float32 ``(H, W)``, px. Among the range
        blocks that contain pixel p and are not flat, the range block with the least error
        determines the side D at p. If the errors of several sides D of domain blocks differ by at
        most `RESOLUTION`, the smallest of these sides wins. The side D at pixel p is NaN if all
        range blocks that contain p are flat.
    curve : mapping from each side D of domain blocks, in ascending order, to the mean error µ(R, D)
        over all range blocks R.
    seconds : wall time of the search, seconds.

    If ``normalise`` is "variance", the error µ of a flat range block is undefined. For "variance",
    the attributes ``mean``, ``least`` and ``curve`` omit flat blocks, and are NaN if all blocks are
    flat.
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
    """Maps that show how similar a city is to itself, for range blocks of several sizes.

    city : map that was searched.
    least : least error µ_min(p) at each pixel p over all sides B of range blocks, float32 ``(H,
        W)``, from 0 to 1.
    largest : largest side B_max(p) of range blocks whose error exceeds ``least`` by at most
        `RESOLUTION` at pixel p, float32 ``(H, W)``, px.
    likeness : product (1 − µ_min(p))·B_max(p) at each pixel p, float32 ``(H, W)``, px.
    domain : best side D of domain blocks for range blocks of side B_max(p), float32 ``(H, W)``, px.
    maps : mapping from each side B to the `AutosimilarityMaps` for this side.

    A pixel has the value NaN if the maps for all sides B are NaN at this pixel.
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
    """Map how well the best domain blocks of a city approximate its range blocks, by exact search.

    Parameters
    ----------
    city : map to search; each side must be at least the largest side of domain blocks.
    block : side B of the range blocks, px, 2 or more. The search compares range blocks at all pixel
        positions.
    domains : side D of the domain blocks, px, or several sides; each side must exceed B. Examples
        of ``domains`` are 20, (16, 20, 24) and ``range(9, 33)``. If ``domains`` is None, the domain
        blocks have the side 2B. The search compares domain blocks at all pixel positions under all
        8 isometries.
    normalise : divisor of the mean square error of a range block. With "heights", the divisor is
        the square of the map's range of heights. With "heights", a single tower makes µ small on
        the whole map. With "variance", the divisor is the variance of the range block. With
        "variance", flat blocks are omitted, and the error µ is the unexplained share 1 − ρ² of the
        variance, with ρ the correlation.
    threads : number of threads, or None for all cores; the result is the same for any number.
    progress : function to call during the search with two numbers: the amount of work that is done,
        and the total amount of work.

    Raises
    ------
    GenomeError : a parameter is out of bounds, or the map is smaller than a domain block.

    The search time grows with the fourth power of the map's side, and with the number of sides D of
    domain blocks. The memory of the search does not grow with the map.
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
    """Map the least error over several sides of range blocks, and the largest side that reaches
    this least error.

    The search combines each side B in ``blocks`` (px) with all sides in ``domains`` (px) that are
    larger than B. For each side B in ``blocks``, at least one side in ``domains`` must exceed B. If
    ``domains`` is None, domain blocks have the side 2B. All parameters except `blocks` and
    `domains` work as in `autosimilarity_maps`.
    """
    blocks = list(blocks)
    if not blocks:
        raise GenomeError(
            "the list in the argument 'blocks' is empty",
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
        domains = 2 * block if domains is None else domains
        listed = domains if isinstance(domains, Iterable) else [domains]
        extents = tuple(sorted({operator.index(extent) for extent in listed}))
    except TypeError as error:
        raise GenomeError(
            f"{city.name}: {setting('block', block)} or {setting('domains', domains)} has a side "
            "that is not an integer",
            "whole pixels: one number as block, and one or more numbers as domains",
            f"give, for example, {keyword('block', 8)}, {keyword('domains', (16, 20, 24))}",
        ) from error
    if block < 2 or not extents or extents[0] <= block or extents[-1] > smaller:
        sides = ", ".join(map(str, extents)) or "none"
        raise GenomeError(
            f"{city.name}: range blocks of B = {block} px do not fit domain blocks of D = {sides} "
            "px",
            f"2 ≤ B < D ≤ {smaller}, because the smaller side of the map has {smaller} px",
            "choose smaller blocks, or read a larger map",
        )
    if threads is not None:
        expected = f"1 or more, or {none_setting('threads')} for all cores"
        check_number("threads", threads, 1, np.inf, expected, GenomeError)
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
