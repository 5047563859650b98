"""CityMap -> Genome: for every range block, the domain block that rebuilds it best."""

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from numbers import Integral, Real

import numpy as np

from evocity.citymap import MAX_PIXELS, MAX_SIDE, CityMap
from evocity.coding.decode import CollageMap, decode
from evocity.coding.fit import fit_attractor
from evocity.coding.matching import Matches
from evocity.coding.partition import LEAST, Level, Partition, coarsest_leaves, leaves_within
from evocity.coding.quality import psnr
from evocity.condensation import Condensation
from evocity.errors import GenomeError, keyword, setting, shown, unset
from evocity.genome import Genome, packed
from evocity.pavement import fitting_sides, halved_sides

#: The largest cap on \\|σ\\| that is a cap.
_STEEPEST = 1e9
#: Pixels of map that one lifs of the usual budget codes.
PIXELS_A_LIFS = 8


@dataclass(frozen=True, eq=False)
class Encoding:
    """A map's genome, and what coding it cost and lost.

    genome : the code.
    city : the map that was coded, its condensation in place.
    collage_rmse : root mean square of the collage error ω(d) − r, metres.
    uniform : number of range blocks coded as flat, without search: level ones, and those that a
        condensation wholly covers.
    above : number of leaves whose collage error is above the ``max_error`` asked for: leaves of
        the finest side, which cannot be split. 0 where none was asked for.
    pairs : range block × domain position × isometry pairs the search decided, at all sides.
    seconds : wall time of search and fit, compilation included if there was any.
    """

    genome: Genome
    city: CityMap
    collage_rmse: float
    uniform: int
    above: int
    pairs: int
    seconds: float

    @cached_property
    def psnr(self) -> float:
        """Peak signal-to-noise ratio of the decoded genome against the map, dB."""
        return psnr(self.city, decode(self.genome).city)

    @cached_property
    def psnr_unsettled(self) -> float:
        """`psnr` before roofs are settled, dB: what the code alone says of the map."""
        return psnr(self.city, decode(self.genome, settle=False).city)


def encode(
    city: CityMap,
    *,
    block: int | tuple[int, int] | None = None,
    lifs: int | None = None,
    max_error: float | None = None,
    domains: Sequence[int] = (2,),
    reach: int | None = 24,
    sigma_max: float = 0.9,
    fit: bool = True,
    settle: bool = True,
    topological: float | None = None,
    condensation: Condensation | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Encoding:
    """Code a map as an IFS by exact search (Jacquin 1992; Marsault 2005 §1.2, 2.1).

    The range blocks follow the city: leaves of a quadtree, each side of which is searched exactly,
    then merged from the finest up where one lifs costs less than its four children, in collage
    error + λ · number of lifs.

    Parameters
    ----------
    city : sides must be multiples of the largest range block.
    block : (finest, largest) side of the leaves, px, the largest halving to the finest; or B, one
        side for all, px, 2 or more. None for leaves of 2 to 16 px, fewer where 16 does not
        divide the map.
    lifs : budget, the number of lifs at most; λ is found for it. Simple maps take fewer. None for
        one for 8 px of map: 8192 at 256².
    max_error : in place of a budget, the coarsest leaves of which none has a collage error (root
        mean square, metres) above this, but those of the finest side, see `Encoding.above`.
    domains : sizes of domain blocks as multiples of their range block's side: (2, 3) searches D =
        2B and 3B.
    reach : how far a domain block's north-west corner may lie from its range block's, px
        along each axis; None searches the whole map (better collage, slower, less heritable).
    sigma_max : cap on \\|σ\\|, inside the criterion. Below 1 decoding always converges;
        ``inf`` for no cap.
    fit : refine σ and β of what was found until the decoded map, not the collage, is closest
        (`fit_attractor`); the collage error then grows a little.
    settle : whether `decode` settles the roofs of this code and of all that is bred from it.
    topological : among domain blocks whose collage error is within this share of the range
        block's energy ‖r̃‖² of the best, take the one in surroundings most like the range
        block's (`closest_neighbourhood`; Marsault 2005 §2.1). 0 lets surroundings decide ties
        alone, at no cost in collage error; None leaves ties to the lowest (D, y, x, iso). The
        leaves are chosen before.
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
    GenomeError : the map's sides do not suit the block, a parameter is out of range, the budget
        is below what the coarsest partition needs, budget and ``max_error`` are both given, the
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
    sides = _sides(city, block)
    _check(city, sides, domains, reach, sigma_max, topological, threads)
    _check_choice(city, sides, lifs, max_error)
    start = time.perf_counter()
    covered = None
    if condensation is not None:
        city, covered = city.replace(_laid(condensation, city)), condensation.mask
    asked = {"reach": reach, "sigma_max": sigma_max, "threads": threads}
    asked["progress"] = _counted(progress, city.shape[0], sides, domains, topological is not None)
    levels = [Level.search(city.heights, side, covered, domains, **asked) for side in sides]
    if max_error is None:
        budget = lifs or -(-city.heights.size // PIXELS_A_LIFS)
        least = LEAST * float(city.heights.max(initial=0)) ** 2
        choose = partial(leaves_within, budget=budget, least=max(least, 1e-30))
    else:
        choose = partial(coarsest_leaves, sides=sides, most=max_error)
    leaves = Partition.of(levels, choose)
    if topological is not None:
        leaves = leaves.in_surroundings(topological, domains, **asked)
    pavement = leaves.pavement
    made = {"operator": "encode", "domains": list(domains), "reach": reach}
    if len(sides) > 1:
        made |= {"sides": list(sides), "lifs": lifs, "max_error": max_error}
    genome = Genome(
        pavement,
        **leaves.columns,
        parent=np.zeros(len(pavement), np.uint8),
        source=packed(*pavement.corners),
        metres_per_pixel=city.metres_per_pixel,
        cities=(city.name,),
        sigma_max=sigma_max,
        attribution=city.attribution,
        origin=city.origin,
        crs=city.crs,
        made=made,
        condensation=condensation,
        settle=settle,
    )
    error = leaves.error
    if fit:
        genome = fit_attractor(genome, city, progress=progress)
    if fit or topological is not None or condensation is not None:
        collage = CollageMap(genome)(city.heights)
        error = float(np.sum((collage - city.heights) ** 2, dtype=np.float64))
    return Encoding(
        genome=genome,
        city=city,
        collage_rmse=float(np.sqrt(max(error, 0.0) / city.heights.size)),
        uniform=leaves.uniform,
        above=0 if max_error is None else leaves.above(max_error),
        pairs=sum(level.pairs for level in levels),
        seconds=time.perf_counter() - start,
    )


def _laid(condensation: Condensation, city: CityMap) -> np.ndarray:
    """The heights of ``city`` with the ``condensation`` in place; `GenomeError` if it is none."""
    if not isinstance(condensation, Condensation) or condensation.shape != city.shape:
        raise GenomeError(
            f"{city.name}, {city.shape[0]} × {city.shape[1]} px, with {shown(condensation)}",
            "a Condensation of the map's size",
            "make one on this very map: Condensation.cut(city, mask)",
        )
    return condensation.laid(city.heights)


def _counted(progress, height: int, sides: Sequence[int], domains: Sequence[int], twice: bool):
    """From rows of domain blocks done to (done, total) for ``progress``."""
    if progress is None:
        return None
    total = sum(max(height - m * side + 1, 0) for side in sides for m in domains)
    total *= 1 + twice
    done = 0.0

    def count(rows: float) -> None:
        nonlocal done
        done += rows
        progress(min(round(done, 6), total), total)

    return count


def with_matches(genome: Genome, lifs: np.ndarray, matches: Matches, **changes) -> Genome:
    """``genome`` with the given ``lifs`` (indices) coded by ``matches``; provenance is kept."""
    extent = matches.multiple * genome.pavement.side[lifs]
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


def _sides(city: CityMap, block) -> tuple[int, ...]:
    """The sides of range blocks to search, the finest first."""
    if block is None:
        finest, root = fitting_sides(*city.shape)
        return halved_sides(finest, root)[::-1]
    if isinstance(block, Sequence) and len(block) == 2 and all(_whole(one, 2) for one in block):
        return halved_sides(*(int(one) for one in block))[::-1]
    if _whole(block, 2):
        return (int(block),)
    raise GenomeError(
        f"{city.name}: {setting('block', block)}",
        "a whole number of pixels, 2 or more, or two: the finest side and the largest",
        f"use for example {keyword('block', 4)}, or {keyword('block', (2, 16))}",
    )


def _whole(value, least: int) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and value >= least


def _check_choice(city: CityMap, sides, lifs, max_error) -> None:
    """Raise `GenomeError` unless budget or bound suit the ``sides``, and each other."""
    found = expected = remedy = ""
    given = {"lifs": lifs, "max_error": max_error}
    given = {name: value for name, value in given.items() if value is not None}
    told = " and ".join(setting(name, value) for name, value in given.items())
    if len(given) == 2:
        found, expected = told, "a budget of lifs or a largest error, not both"
        remedy = "leave one of them out"
    elif given and len(sides) == 1:
        found = f"{told} with one side, {setting('block', sides[0])}"
        expected, remedy = (
            "leaves to choose among",
            f"give a range of sides: {keyword('block', (sides[0], 4 * sides[0]))}",
        )
    elif lifs is not None and not _whole(lifs, 1):
        found, expected, remedy = told, "a whole number of lifs, 1 or more", "use for example 8192"
    elif max_error is not None and not (isinstance(max_error, Real) and 0 <= max_error < np.inf):
        found, expected, remedy = told, "metres, 0 or more", "use for example 0.5"
    elif len(sides) > 1 and (city.shape[0] % sides[-1] or city.shape[1] % sides[-1]):
        near = [max(side // sides[-1], 1) * sides[-1] for side in city.shape]
        found = f"a map of {city.shape[0]} × {city.shape[1]} px for leaves of up to {sides[-1]} px"
        expected = f"sides that are multiples of {sides[-1]}, for example {near[0]} × {near[1]}"
        remedy = "crop or read the map at such a size, or choose a smaller root"
    if found:
        raise GenomeError(f"{city.name}: {found}", expected, remedy)


def _check(city, sides, domains, reach, sigma_max, topological, threads) -> None:
    faults = []
    if not isinstance(domains, list) or not domains or not all(_whole(m, 2) for m in domains):
        faults.append((setting("domains", domains), "whole multiples of B, 2 or more"))
    elif min(domains) * sides[0] > min(city.shape):
        faults.append((f"domains of {min(domains) * sides[0]} px", f"at most {min(city.shape)} px"))
    if reach is not None and not _whole(reach, 0):
        told = f"a whole number of pixels, or {unset('reach')} for the whole map"
        faults.append((setting("reach", reach), told))
    if not (isinstance(sigma_max, Real) and (0 < sigma_max <= _STEEPEST or sigma_max == np.inf)):
        told = f"a number above 0, at most {_STEEPEST:g}, or inf for no cap"
        faults.append((setting("sigma_max", sigma_max), told))
    if topological is not None and not (isinstance(topological, Real) and 0 <= topological <= 1):
        faults.append((setting("topological", topological), "a share from 0 to 1"))
    if threads is not None and not _whole(threads, 1):
        faults.append(
            (setting("threads", threads), f"1 or more, or {unset('threads')} for all cores")
        )
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
