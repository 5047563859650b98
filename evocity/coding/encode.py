"""CityMap -> Genome: for every range block, the domain block that rebuilds it best."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from numbers import Integral, Real

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.coding.decode import CollageMap, decode
from evocity.coding.fit import fit_attractor
from evocity.coding.matching import Matches, best_matches, near_best, pairs_compared
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.shapes import uneven_blocks
from evocity.coding.quality import psnr
from evocity.coding.topology import closest_neighbourhood
from evocity.condensation import Condensation
from evocity.errors import GenomeError, shown
from evocity.genome import Genome
from evocity.pavement import Pavement

#: The largest cap on \\|σ\\| that is a cap.
_STEEPEST = 1e9


@dataclass(frozen=True, eq=False)
class Encoding:
    """A map's genome, and what coding it cost and lost.

    genome : the code.
    city : the map that was coded, its condensation in place.
    collage_rmse : root mean square of the collage error ω(d) − r, metres.
    uniform : number of range blocks coded as flat, without search: level ones, and those that a
        condensation wholly covers.
    pairs : range block × domain position × isometry pairs the search decided.
    seconds : wall time of search and fit, compilation included if there was any.
    """

    genome: Genome
    city: CityMap
    collage_rmse: float
    uniform: int
    pairs: int
    seconds: float

    @cached_property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio of the decoded genome against the map, dB."""
        return psnr(self.city, decode(self.genome).city)


def encode(
    city: CityMap,
    *,
    block: int = 4,
    domains: Sequence[int] = (2,),
    reach: int | None = 24,
    sigma_max: float = 0.9,
    fit: bool = False,
    topological: float | None = None,
    condensation: Condensation | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Encoding:
    """Code a map as an IFS by exact search (Jacquin 1992; Marsault 2005 §1.2, 2.1).

    Parameters
    ----------
    city : sides must be multiples of ``block``.
    block : B, side of the range blocks, px, 2 or more.
    domains : sizes of domain blocks as multiples of B: (2, 3) searches D = 2B and 3B.
    reach : how far a domain block's north-west corner may lie from its range block's, px
        along each axis; None searches the whole map (better collage, slower, less heritable).
    sigma_max : cap on \\|σ\\|, inside the criterion. Below 1 decoding always converges;
        ``inf`` for no cap.
    fit : refine σ and β of what was found until the decoded map, not the collage, is closest
        (`fit_attractor`); the collage error then grows a little.
    topological : among domain blocks whose collage error is within this share of the range
        block's energy ‖r̃‖² of the best, take the one in surroundings most like the range
        block's (`closest_neighbourhood`; Marsault 2005 §2.1). 0 lets surroundings decide ties
        alone, at no cost in collage error; None leaves ties to the lowest (D, y, x, iso).
    condensation : heights that decoding shall keep, of the map's size: the map is coded with
        them in place. Range blocks wholly covered are not searched.
    threads : None for all cores; the genome does not depend on it.
    progress : called with (done, total), counted in rows of domain blocks; then, with
        ``fit``, in attractors tried.

    Returns
    -------
    Encoding : with the `Genome` in ``.genome``.

    Raises
    ------
    GenomeError : the map's sides do not suit the block, a parameter is out of range, the
        condensation is none of the map's size, or a code to be fitted diverges (possible only
        with ``sigma_max`` of 1 or more).
    """
    if not isinstance(city, CityMap):
        raise GenomeError(
            f"a {type(city).__name__} to encode",
            "a CityMap",
            "read one first: evocity.read_map(path or bundled name)",
        )
    domains = list(dict.fromkeys(domains)) if isinstance(domains, Iterable) else domains
    _check(city, block, domains, reach, sigma_max, topological, threads)
    pavement = Pavement(*city.shape, block)
    start = time.perf_counter()
    covered = np.zeros(len(pavement), bool)
    if condensation is not None:
        city = city.replace(_laid(condensation, city))
        covered = pavement.blocks(condensation.mask).all(axis=(1, 2))
    blocks = pavement.blocks(city.heights)
    flat = blocks.reshape(len(pavement), -1)
    searched = np.flatnonzero(uneven_blocks(blocks) & ~covered)
    corners = tuple(corner[searched] for corner in pavement.corners)
    asked = {"reach": reach, "sigma_max": sigma_max, "threads": threads}
    passes = 1 if topological is None else 2
    asked["progress"] = _counted(progress, city.shape[0], block, domains, passes)
    pools = partial(domain_pools, city.heights, block, domains)
    matches = best_matches(pools(), blocks[searched], corners, **asked)
    if topological is not None:
        choices = near_best(pools(), blocks[searched], corners, matches, topological, **asked)
        matches = _in_surroundings(city.heights, block, corners, matches, choices)
    everything = np.arange(len(pavement))
    level = flat.mean(axis=1, dtype=np.float64)
    nothing = np.zeros(len(pavement), np.int16)
    genome = Genome(
        pavement,
        sigma=nothing,
        beta=level,
        x=nothing,
        y=nothing,
        dx=nothing,
        dy=nothing,
        iso=nothing.astype(np.uint8),
        parent=nothing.astype(np.uint8),
        source=everything,
        metres_per_pixel=city.metres_per_pixel,
        cities=(city.name,),
        sigma_max=sigma_max,
        attribution=city.attribution,
        origin=city.origin,
        crs=city.crs,
        made={"operator": "encode", "domains": list(domains), "reach": reach},
        condensation=condensation,
    )
    genome = with_matches(genome, searched, matches)
    error = float(np.sum(matches.energy - matches.gain))
    if fit:
        genome = fit_attractor(genome, city, progress=progress)
    if fit or topological is not None or condensation is not None:
        collage = CollageMap(genome)(city.heights)
        error = float(np.sum((collage - city.heights) ** 2, dtype=np.float64))
    return Encoding(
        genome=genome,
        city=city,
        collage_rmse=float(np.sqrt(max(error, 0.0) / city.heights.size)),
        uniform=len(pavement) - searched.size,
        pairs=pairs_compared(city.shape, block, domains, corners, reach),
        seconds=time.perf_counter() - start,
    )


def _in_surroundings(heights, block: int, corners, matches: Matches, choices) -> Matches:
    """``matches`` with the domains, of ``choices`` (`near_best`), in the likest surroundings."""
    names = ("multiple", "y", "x", "iso", "sigma", "beta")
    columns = {name: getattr(matches, name).copy() for name in names}
    for part, candidates in choices:
        places = tuple(corner[part] for corner in corners)
        chosen = closest_neighbourhood(heights, block, places, candidates)
        found = chosen >= 0
        for name, column in columns.items():
            column[part[found]] = getattr(candidates, name)[chosen[found]]
    return replace(matches, **columns)


def _laid(condensation: Condensation, city: CityMap) -> np.ndarray:
    """The heights of ``city`` with the ``condensation`` in place; `GenomeError` if it is none."""
    if not isinstance(condensation, Condensation) or condensation.shape != city.shape:
        raise GenomeError(
            f"{city.name}, {city.shape[0]} × {city.shape[1]} px, with {shown(condensation)}",
            "a Condensation of the map's size",
            "make one on this very map: Condensation.cut(city, mask)",
        )
    return condensation.laid(city.heights)


def _counted(progress, height: int, block: int, domains: Sequence[int], passes: int):
    """From rows of domain blocks done to (done, total) for ``progress``."""
    if progress is None:
        return None
    total = passes * sum(max(height - multiple * block + 1, 0) for multiple in domains)
    done = 0.0

    def count(rows: float) -> None:
        nonlocal done
        done += rows
        progress(min(round(done, 6), total), total)

    return count


def with_matches(genome: Genome, lifs: np.ndarray, matches: Matches, **changes) -> Genome:
    """``genome`` with the given ``lifs`` (indices) coded by ``matches``; provenance is kept."""
    extent = matches.multiple * genome.pavement.block
    found = {
        "sigma": matches.sigma,
        "beta": matches.beta,
        "x": matches.x,
        "y": matches.y,
        "dx": extent,
        "dy": extent,
        "iso": matches.iso,
    }
    for name, values in found.items():
        column = getattr(genome, name).copy()
        column[lifs] = values
        changes[name] = column
    return genome.replace(**changes)


def _check(city, block, domains, reach, sigma_max, topological, threads) -> None:
    def whole(value, least: int) -> bool:
        return isinstance(value, Integral) and not isinstance(value, bool) and value >= least

    faults = []
    if not whole(block, 2):
        faults.append((f"block = {block!r}", "a whole number of pixels, 2 or more"))
    if not isinstance(domains, list) or not domains or not all(whole(m, 2) for m in domains):
        faults.append((f"domains = {domains!r}", "whole multiples of B, 2 or more"))
    elif whole(block, 2) and min(domains) * block > min(city.shape):
        faults.append((f"domains of {min(domains) * block} px", f"at most {min(city.shape)} px"))
    if reach is not None and not whole(reach, 0):
        faults.append((f"reach = {reach!r}", "a whole number of pixels, or None for the whole map"))
    if not (isinstance(sigma_max, Real) and (0 < sigma_max <= _STEEPEST or sigma_max == np.inf)):
        told = f"a number above 0, at most {_STEEPEST:g}, or inf for no cap"
        faults.append((f"sigma_max = {sigma_max!r}", told))
    if topological is not None and not (isinstance(topological, Real) and 0 <= topological <= 1):
        faults.append((f"topological = {topological!r}", "a share from 0 to 1"))
    if threads is not None and not whole(threads, 1):
        faults.append((f"threads = {threads!r}", "1 or more, or None for all cores"))
    if max(city.shape) > MAX_SIDE or city.heights.size > MAX_PIXELS:
        sides = f"a map of {city.shape[0]} × {city.shape[1]} px"
        faults.append(
            (sides, f"sides up to {MAX_SIDE} px, {MAX_PIXELS // 10**6} million pixels in all")
        )
    if faults:
        raise GenomeError(
            f"{city.name}: " + "; ".join(found for found, _ in faults),
            "; ".join(expected for _, expected in faults),
            "change the parameters of encode",
        )
