"""CityMap -> Genome: for every range block, the domain block that rebuilds it best."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from evocity.citymap import CityMap
from evocity.coding.decode import decode
from evocity.coding.domains import DomainPool, domain_pool
from evocity.coding.quality import psnr
from evocity.coding.search import Matches, best_matches, window_sizes
from evocity.errors import GenomeError
from evocity.genome import Genome, Pavement


@dataclass(frozen=True, eq=False)
class Encoding:
    """A map's genome, and what coding it cost and lost.

    genome : the code.
    city : the map that was coded.
    collage_rmse : root mean square of the collage error ω(d) − r, metres.
    uniform : number of range blocks coded as flat, without search.
    pairs : range block × domain position × isometry pairs the search decided.
    seconds : wall time of the search, compilation included if there was any.
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
    threads : None for all cores; the genome does not depend on it.
    progress : called with (range blocks searched, range blocks to search).

    Returns
    -------
    Encoding : with the `Genome` in ``.genome``.

    Raises
    ------
    GenomeError : the map's sides do not suit the block, or a parameter is out of range.
    """
    _check(city, block, domains, reach, sigma_max)
    pavement = Pavement(*city.shape, block)
    start = time.perf_counter()
    blocks = pavement.blocks(city.heights)
    flat = blocks.reshape(len(pavement), -1)
    searched = np.flatnonzero(np.ptp(flat, axis=1) > 0)
    corners = tuple(corner[searched] for corner in pavement.corners)
    pools = domain_pools(city.heights, block, domains)
    matches = best_matches(
        pools,
        blocks[searched],
        corners,
        reach=reach,
        sigma_max=sigma_max,
        threads=threads,
        progress=progress,
    )
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
    )
    genome = with_matches(genome, searched, matches)
    error = float(np.sum(matches.energy - matches.gain))
    return Encoding(
        genome=genome,
        city=city,
        collage_rmse=float(np.sqrt(max(error, 0.0) / city.heights.size)),
        uniform=len(pavement) - searched.size,
        pairs=8 * int(sum(window_sizes(pool.shape, corners, reach).sum() for pool in pools)),
        seconds=time.perf_counter() - start,
    )


def domain_pools(heights: np.ndarray, block: int, domains: Sequence[int]) -> list[DomainPool]:
    """Pools of every domain size that fits a ``(H, W)`` map; sizes that do not are left out."""
    fits = [multiple for multiple in domains if multiple * block <= min(heights.shape)]
    return [domain_pool(heights, block, multiple) for multiple in fits]


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


def _check(city, block, domains, reach, sigma_max) -> None:
    faults = []
    if not domains or any(int(m) != m or m < 2 for m in domains):
        faults.append((f"domains = {tuple(domains)}", "whole multiples of B, 2 or more"))
    elif min(domains) * block > min(city.shape):
        faults.append((f"domains of {min(domains) * block} px", f"at most {min(city.shape)} px"))
    if reach is not None and (int(reach) != reach or reach < 0):
        faults.append((f"reach = {reach}", "a whole number of pixels, or None for the whole map"))
    if not sigma_max > 0:
        faults.append((f"sigma_max = {sigma_max}", "a number above 0"))
    if max(city.shape) > np.iinfo(np.int16).max:
        faults.append((f"a map of {city.shape[0]} × {city.shape[1]} px", "sides up to 32767 px"))
    if faults:
        raise GenomeError(
            f"{city.name}: " + "; ".join(found for found, _ in faults),
            "; ".join(expected for _, expected in faults),
            "change the parameters of encode",
        )
