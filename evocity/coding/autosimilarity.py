"""How like itself is a city, and where? Maps of the error µ over all range positions.

µ(R, D) = Σ (ω(D) − R)² is what the best domain block of side D leaves unexplained of range
block R, σ unconstrained, divided by B²·(range of heights)² or by R's own variance, so that it
lies in 0…1 (Marsault 2005 §1.3). R takes every pixel position, not the pavement's alone, and D
need be no multiple of B: pixels at the seams are shared by area.
"""

import operator
import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from evocity.citymap import CityMap
from evocity.coding.matching.everywhere import RESOLUTION, Progress, Work, least_errors, pairs
from evocity.errors import GenomeError, check_word, keyword, setting, unset

#: What µ may be divided by.
NORMALISATIONS = ("heights", "variance")


@dataclass(frozen=True, eq=False)
class AutosimilarityMaps:
    """Where a city is like itself, for range blocks of one size.

    city : the map that was looked at.
    block : B, px.
    normalise : what µ is divided by, ``"heights"`` or ``"variance"``.
    mean : float32 ``(H, W)`` in 0…1: µ̃(p), the mean of min over D of µ(R, D) over all range
        blocks R that hold pixel p.
    least : float32 ``(H, W)`` in 0…1: µ_min(p), the least of the same, never above ``mean``.
    domain : float32 ``(H, W)``, px: of the range blocks that hold p and are not flat, the one of
        least µ is explained best by a domain block of this side D. Where several D are as good,
        within `RESOLUTION`, the smallest; NaN where all blocks that hold p are flat.
    curve : D → mean of µ(R, D) over all range positions R, in ascending order of D.
    seconds : wall time.

    Divided by the variance, µ has no value for flat range blocks: they are left out of ``mean``,
    ``least`` and ``curve``, which are NaN where no other block is left.
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
    """Where a city is like itself, the size of range blocks left free.

    city : the map that was looked at.
    least : float32 ``(H, W)`` in 0…1: µ_min(p), the least over all B.
    largest : float32 ``(H, W)``, px: B_max(p), the largest B that reaches it (within
        `RESOLUTION`).
    likeness : float32 ``(H, W)``, px: (1 − µ_min(p))·B_max(p).
    domain : float32 ``(H, W)``, px: the D that explains most at p with range blocks of B_max(p).
    maps : B → the maps for that B alone.

    NaN where those maps have no value, see `AutosimilarityMaps`.
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
    """Error maps µ̃ and µ_min, the best D, and the curve D → µ, by exact search of the whole map.

    Parameters
    ----------
    city : any map with room for the largest domain block.
    block : B, side of the range blocks, px, 2 or more. All its pixel positions are looked at.
    domains : D, side of the domain blocks, px, above B: 20, (16, 20, 24), or free up to a
        limit, range(B + 1, 33). None is 2B. All their pixel positions and 8 isometries.
    normalise : what the mean square error of a range block is divided by. ``"heights"``: the
        square of the map's range of heights, so that µ is an error on one scale for the whole
        map, and one tower makes it small everywhere. ``"variance"``: the block's own variance,
        so that µ is 1 − ρ², the share that is left unexplained, whatever the heights; flat
        blocks are left out.
    threads : threads to use; None for all cores. The result does not depend on it.
    progress : called with (done, total) as work goes on.

    Raises
    ------
    GenomeError : a parameter is out of bounds, or the map too small for it.

    Time grows with the fourth power of the side and with the number of D; memory does not.
    """
    block, domains = _checked(city, block, domains, threads, normalise)
    work = Work(progress, pairs(city.shape, block, domains))
    return _maps(city, block, domains, normalise, threads, work)


def free_block_maps(
    city: CityMap,
    *,
    blocks: Iterable[int] = (4, 6, 8),
    domains: int | Iterable[int] | None = None,
    normalise: str = "heights",
    threads: int | None = None,
    progress: Progress | None = None,
) -> FreeBlockMaps:
    """µ_min, B_max and (1 − µ_min)·B_max with B free among ``blocks`` (px).

    Each B is tried with those of the ``domains`` (px) that are larger than it; one at least must
    be. None is 2B for each. All else is as in `autosimilarity_maps`.
    """
    blocks = list(blocks)
    if not blocks:
        raise GenomeError("blocks = []", "one size of range blocks or more", "give some, in px")
    if isinstance(domains, Iterable):
        domains = list(domains)
    sizes = dict(
        sorted(
            _checked(city, block, _larger(domains, block), threads, normalise) for block in blocks
        )
    )
    work = Work(progress, sum(pairs(city.shape, *size) for size in sizes.items()))
    maps = {
        block: _maps(city, block, extents, normalise, threads, work)
        for block, extents in sizes.items()
    }
    least = np.fmin.reduce([found.least for found in maps.values()])
    largest, domain = np.full((2, *city.shape), np.nan, np.float32)
    for block, found in maps.items():  # ascending: the largest stays
        reached = found.least <= least + np.float32(RESOLUTION)
        largest[reached], domain[reached] = block, found.domain[reached]
    return FreeBlockMaps(city, least, largest, (1 - least) * largest, domain, maps)


def _larger(domains, block):
    """Those of the ``domains`` that are larger than the block; all, if they are at fault."""
    try:
        larger = [extent for extent in domains if extent > block]
    except TypeError:  # one number, none, or nonsense
        return domains
    return larger or domains


def _checked(city: CityMap, block, domains, threads, normalise) -> tuple[int, tuple[int, ...]]:
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
            f"{city.name}: {setting('block', block)}, {setting('domains', domains)}",
            "whole numbers of pixels: one B; one D or several",
            f"give, for example, {keyword('block', 8)}, {keyword('domains', (16, 20, 24))}",
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
            setting("threads", threads),
            f"1 or more, or {unset('threads')} for all cores",
            "leave it out",
        )
    check_word("normalise", normalise, NORMALISATIONS, "leave it out for heights", GenomeError)
    return block, extents


def _maps(city: CityMap, block: int, extents, normalise, threads: int | None, work: Work):
    start = time.perf_counter()
    errors, best, curve = least_errors(city.heights, block, extents, normalise, threads, work)
    known = ~np.isnan(errors)  # else flat and left out
    least = _least(errors, known, block)
    with np.errstate(invalid="ignore"):  # no block left: 0 of 0
        mean = _over_holders(np.sum, np.where(known, errors, 0), block, outside=0)
        mean /= _over_holders(np.sum, known.astype(float), block, outside=0)
    return AutosimilarityMaps(
        city=city,
        block=block,
        normalise=normalise,
        mean=np.maximum(mean, least).astype(np.float32),  # they may differ by rounding
        least=least.astype(np.float32),
        domain=_best_domain(errors, best, block),
        curve=curve,
        seconds=time.perf_counter() - start,
    )


def _least(errors: np.ndarray, among: np.ndarray, block: int) -> np.ndarray:
    """Of each pixel, the least error of those ``among`` the blocks that hold it; or NaN."""
    least = _over_holders(np.min, np.where(among, errors, np.inf), block, outside=np.inf)
    return np.where(np.isfinite(least), least, np.nan)


def _best_domain(errors: np.ndarray, best: np.ndarray, block: int) -> np.ndarray:
    """float32 ``(H, W)``: the ``best`` D (0 where flat) of the blocks that hold each pixel and
    err least; the smallest of several."""
    least = _least(errors, best > 0, block)
    domain = np.full(least.shape, np.nan, np.float32)
    for extent in np.unique(best[best > 0])[::-1]:  # falling: the smallest stays
        domain[_least(errors, best == extent, block) <= least + RESOLUTION] = extent
    return domain


def _over_holders(combine, values: np.ndarray, block: int, outside: float) -> np.ndarray:
    """For each pixel of the map, ``combine`` over all range blocks that hold it."""
    for axis in (0, 1):
        around = [(block - 1, block - 1) if axis == k else (0, 0) for k in (0, 1)]
        padded = np.pad(values, around, constant_values=outside)
        values = combine(sliding_window_view(padded, block, axis=axis), axis=-1)
    return values


__all__ = [
    "NORMALISATIONS",
    "RESOLUTION",
    "AutosimilarityMaps",
    "FreeBlockMaps",
    "autosimilarity_maps",
    "free_block_maps",
]
