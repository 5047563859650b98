"""Encoder of maps: finds for every range block the domain block that rebuilds it best."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from numbers import Real

import numpy as np

from evocity.citymap import CityMap
from evocity.coding.collage_map import CollageMap
from evocity.coding.decode import decode
from evocity.coding.fit import fit_attractor, psnr
from evocity.coding.matching.residual import Work
from evocity.coding.parameters import Coding, check_encoding
from evocity.coding.partition import LEAST, Level, Partition, coarsest_leaves, leaves_within
from evocity.coding.source_roofs import roofs_of_map
from evocity.condensation import Condensation
from evocity.errors import GenomeError, is_whole, keyword, setting, spell
from evocity.genome import Genome, packed
from evocity.pavement import fitting_sides, halved_sides

#: Pixels of map for each lifs of the default budget.
PIXELS_A_LIFS = 8


@dataclass(frozen=True, eq=False)
class Encoding:
    """Genome of a map, with the error and the cost of coding.

    genome : code of the map.
    city : coded map, including the heights of the condensation.
    collage_rmse : root mean square of the collage error ω(d) − r, metres, with ω the lifs, d the
        domain block and r the range block.
    uniform : number of range blocks that are coded as flat, without a search. A range block is
        coded as flat if the map is flat there, or if a condensation covers the range block
        completely.
    above : number of range blocks with a collage error above ``max_error``; 0 if ``max_error`` is
        not given. Range blocks with a collage error above ``max_error`` have the smallest side, and
        cannot be split further.
    pairs : number of comparisons in the search: range blocks × positions of domain blocks ×
        isometries, summed over the sides of range blocks.
    seconds : wall time, in seconds, of the search, the fit and any compilation of code.
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
        """Peak signal-to-noise ratio of the raw attractor, without flat roofs, against the map,
        dB."""
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
    settle: bool | str = True,
    topological: float | None = None,
    condensation: Condensation | None = None,
    threads: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Encoding:
    """Encode a map as an iterated function system, by exact search (Jacquin 1992; Marsault 2005
    §2.1).

    The range blocks are the leaves of a quadtree, larger where the city is simpler. First, the
    search finds the best domain block for each possible leaf of the quadtree. From the smallest
    side up, four leaves merge into one larger leaf if the merge lowers the cost of the code. The
    cost of a code is its collage error plus a weight λ times its number of lifs.

    Parameters
    ----------
    city : map to encode; the sides of the map must be multiples of the largest range block's side.
    block : smallest and largest side of the range blocks, px; repeated halving of the largest side
        must give the smallest side. If `block` is a single number, all range blocks have this side,
        px, 2 or more. If ``block`` is None, range blocks have sides of 2 to 16 px. If 16 does not
        divide the sides of the map, the largest range blocks are smaller.
    lifs : largest number of lifs; this limit determines the weight λ in the cost of a code. The
        code of a simple map has fewer lifs than this limit. By default, a code has at most one lifs
        for each 8 pixels of the map: 8192 for 256 × 256 px.
    max_error : largest collage error of a range block (root mean square, metres); this limit
        replaces the limit ``lifs``. Range blocks are as large as the limit ``max_error`` allows.
        Range blocks of the smallest side may exceed the limit ``max_error`` (see `Encoding.above`).
    domains : sides of the domain blocks, as multiples of the side B of their range block. With
        ``domains=(2, 3)``, for example, the search uses domain blocks with the sides 2B and 3B.
    reach : largest distance between the corners of a domain block and its range block, px along
        each axis. If ``reach`` is None, the search covers the whole map. A search of the whole map
        gives a better collage, but takes longer and makes the code less heritable.
    sigma_max : upper bound on \\|σ\\| in the search; infinity sets no bound. If ``sigma_max`` is
        below 1, decoding always converges.
    fit : whether to refine σ and β by `fit_attractor`. The search minimises the error of the
        collage, and the fit minimises the error of the decoded map. After the fit, the collage
        error is a little higher than after the search.
    settle : whether `decode` makes roofs flat by default, for this genome and its descendants:
        True, False or ``"roofs"``, as in `decode`.
    topological : tolerance of the collage error, as a share of the energy ‖r̃‖², with r̃ the
        heights of the range block minus their mean. Among the domain blocks whose error is within
        the tolerance of the lowest error, the block with the most similar surroundings wins. The
        function `closest_neighbourhood` compares surroundings (Marsault 2005 §2.1). With the
        tolerance 0, surroundings decide only between domain blocks with equal errors, so the
        collage error does not grow. If ``topological`` is None, the domain block with the lowest
        side D, row y, column x and isometry iso, in this order, wins a tie. The search chooses the
        sides of range blocks before it compares surroundings.
    condensation : fixed heights, which decoding does not change; the condensation has the same size
        as the map. The search uses the map with the fixed heights of the condensation, and skips
        range blocks that the condensation covers completely.
    threads : number of threads, or None for all cores; the genome is the same for any number.
    progress : function that is called with the number of finished rows of domain blocks, and the
        number of all rows. During the fit, the function is called with the number of attractors
        tried and the largest number to try.

    Returns
    -------
    Encoding : result of the search, with the `Genome` in ``.genome``.

    Raises
    ------
    GenomeError : a parameter is out of range, or the sides of the map do not suit ``block``. A
        condensation that differs in size from the map raises GenomeError. If ``lifs`` is smaller
        than the number of largest leaves, or is given together with ``max_error``, the function
        raises GenomeError. If ``sigma_max`` is 1 or more, a code that diverges can raise
        GenomeError.
    """
    if not isinstance(city, CityMap):
        raise GenomeError(
            f"an object of the class {type(city).__name__} cannot be encoded",
            "an object of the class CityMap",
            "read a map first: evocity.read_map(path or bundled name)",
        )
    coding = Coding(reach, domains, sigma_max)
    sides = _sides(city, block)
    check_encoding(city, sides[0], coding, topological, threads)
    _check_leaves(city, sides, lifs, max_error)
    start = time.perf_counter()
    covered = None
    if condensation is not None:
        city, covered = city.replace(_lay(condensation, city)), condensation.mask
    rows = sum(max(city.shape[0] - m * side + 1, 0) for side in sides for m in coding.domains)
    count = Work(progress, rows * (1 + (topological is not None)), digits=6)
    work = {"threads": threads, "progress": count.add}
    levels = [Level.search(city.heights, side, covered, coding, **work) for side in sides]
    if max_error is None:
        budget = lifs or -(-city.heights.size // PIXELS_A_LIFS)
        least = LEAST * float(city.heights.max(initial=0)) ** 2
        choose = partial(leaves_within, budget=budget, least=max(least, 1e-30))
    else:
        choose = partial(coarsest_leaves, sides=sides, most=max_error)
    leaves = Partition.of(levels, choose)
    if topological is not None:
        leaves = leaves.follow_surroundings(topological, coding, **work)
    pavement = leaves.pavement
    made = {"operator": "encode", "domains": list(coding.domains), "reach": reach}
    if len(sides) > 1:
        made |= {"sides": list(sides), "lifs": lifs, "max_error": max_error}
    roofs = roofs_of_map(city)
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
        roofs={} if roofs is None else {city.name: roofs},
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
        above=0 if max_error is None else leaves.count_above(max_error),
        pairs=sum(level.pairs for level in levels),
        seconds=time.perf_counter() - start,
    )


def _lay(condensation: Condensation, city: CityMap) -> np.ndarray:
    """Lay the ``condensation`` over the heights of ``city``; `GenomeError` unless it fits."""
    if not isinstance(condensation, Condensation) or condensation.shape != city.shape:
        raise GenomeError(
            f"{spell(condensation)} does not fit the map {city.name}, which has {city.shape[0]} × "
            f"{city.shape[1]} px",
            "an object of the class Condensation that has the size of the map",
            "make the Condensation from this map: Condensation.cut(city, mask)",
        )
    return condensation.laid(city.heights)


def _sides(city: CityMap, block) -> tuple[int, ...]:
    """List the sides of range blocks to search, the finest first."""
    if block is None:
        finest, root = fitting_sides(*city.shape)
        return halved_sides(finest, root)[::-1]
    if isinstance(block, Sequence) and len(block) == 2 and all(is_whole(side, 2) for side in block):
        return halved_sides(*map(int, block))[::-1]
    if is_whole(block, 2):
        return (int(block),)
    raise GenomeError(
        f"{city.name}: {setting('block', block)} is not a side of range blocks",
        "a whole number of pixels, 2 or more; or two numbers, the smallest and the largest side",
        f"use for example {keyword('block', 4)}, or {keyword('block', (2, 16))}",
    )


def _check_leaves(city: CityMap, sides, lifs, max_error) -> None:
    """Raise `GenomeError` unless budget or bound suit the ``sides``, and each other."""
    given = {"lifs": lifs, "max_error": max_error}
    given = {name: value for name, value in given.items() if value is not None}
    found, root = " and ".join(setting(name, value) for name, value in given.items()), sides[-1]
    if len(given) == 2:
        expected = "a budget of lifs or a largest error, not both"
        remedy = "leave one of them out"
    elif given and len(sides) == 1:
        found += f" with one side, {setting('block', root)}"
        expected = "leaves of several sides"
        remedy = f"give a range of sides: {keyword('block', (root, 4 * root))}"
    elif lifs is not None and not is_whole(lifs, 1):
        expected, remedy = "a whole number of lifs, 1 or more", "use for example 8192"
    elif max_error is not None and not (isinstance(max_error, Real) and 0 <= max_error < np.inf):
        expected, remedy = "metres, 0 or more", "use for example 0.5"
    elif len(sides) > 1 and (city.shape[0] % root or city.shape[1] % root):
        near = [max(side // root, 1) * root for side in city.shape]
        found = f"a map of {city.shape[0]} × {city.shape[1]} px for leaves of up to {root} px"
        expected = f"sides that are multiples of {root}, for example {near[0]} × {near[1]}"
        remedy = "crop or read the map at such a size, or choose a smaller root"
    else:
        return
    raise GenomeError(f"{city.name}: {found}", expected, remedy)
