"""Encoder of maps: finds for every range block the domain block that rebuilds it best."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from numbers import Real

import numpy as np

from evocity.citymap import CityMap
from evocity.coding.decode import CollageMap, decode
from evocity.coding.fit import fit_attractor, psnr
from evocity.coding.parameters import Coding, check_encoding, is_whole
from evocity.coding.partition import LEAST, Level, Partition, coarsest_leaves, leaves_within
from evocity.condensation import Condensation
from evocity.errors import GenomeError, keyword, setting, spell
from evocity.genome import Genome, packed
from evocity.pavement import fitting_sides, halved_sides

#: Pixels of map for each lifs of the default budget.
PIXELS_A_LIFS = 8


@dataclass(frozen=True, eq=False)
class Encoding:
    """Genome of a map, with the error and the cost of coding.

    genome : code of the map.
    city : coded map, which contains the condensation.
    collage_rmse : root mean square of the collage error ω(d) − r, metres.
    uniform : number of range blocks that are coded as flat, without a search. They are the level
        range blocks, and those that a condensation covers wholly.
    above : number of leaves with a collage error above ``max_error``. They have the smallest side,
        so they cannot be split. 0 without ``max_error``.
    pairs : number of combinations that the search compared: range block × domain position ×
        isometry, for all sides.
    seconds : wall time of the search, the fit and any compilation.
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
        """`psnr` without settled roofs, dB: the quality of the code itself."""
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
    """Encode a map as an IFS by exact search (Jacquin 1992; Marsault 2005 §1.2, 2.1).

    The range blocks follow the city: they are leaves of a quadtree. First the search finds the best
    domain block for the leaves of each size. Then four leaves merge, from the smallest side up, if
    one lifs costs less. The cost is collage error + λ · number of lifs.

    Parameters
    ----------
    city : map to encode. Its sides must be multiples of the largest range block.
    block : smallest and largest side of the leaves, px; halving the largest side leads to the
        smallest. Or one side B for all, px, 2 or more. None gives leaves of 2 to 16 px, or smaller
        if 16 does not divide the map.
    lifs : largest number of lifs, which determines λ. Simple maps take fewer. None allows one lifs
        for each 8 px of the map: 8192 at 256².
    max_error : largest collage error (root mean square, metres) of a leaf above the smallest side,
        in place of ``lifs``. The leaves are as large as this error allows. See `Encoding.above`.
    domains : sides of domain blocks, as multiples of their range block's side. (2, 3) searches D =
        2B and 3B.
    reach : largest distance between the north-west corners of a domain block and its range block,
        px along each axis. None searches the whole map: the collage is better, the search slower,
        and the code less heritable.
    sigma_max : cap on \\|σ\\|, which the search respects. With a cap below 1, decoding always
        converges. Infinity sets no cap.
    fit : whether to refine σ and β by `fit_attractor`. The search minimises the error of the
        collage; this fit minimises the error of the decoded map. The collage error grows a little.
    settle : whether `decode` makes the roofs of this code and of its descendants flat.
    topological : share of the range block's energy ‖r̃‖². Domain blocks whose collage error exceeds
        the least by at most this share compete by their surroundings (`closest_neighbourhood`;
        Marsault 2005 §2.1). With 0, surroundings decide only ties, which costs no collage error.
        With None, ties go to the lowest (D, y, x, iso). The choice of leaves comes before this.
    condensation : heights that decoding keeps, of the map's size. The search reads the map with
        these heights, and skips range blocks that they cover wholly.
    threads : number of threads; None for all cores. The genome does not depend on it.
    progress : function that is called with (done, total) rows of domain blocks. With ``fit`` it is
        then called with the number of attractors tried, and their total.

    Returns
    -------
    Encoding : result with the `Genome` in ``.genome``.

    Raises
    ------
    GenomeError : the map's sides do not suit ``block``, a parameter is out of range, or the
        condensation has another size. Or the budget ``lifs`` is too small for the largest leaves,
        or ``lifs`` and ``max_error`` are both given. Or the code to be fitted diverges, which is
        possible only with a ``sigma_max`` of 1 or more.
    """
    if not isinstance(city, CityMap):
        raise GenomeError(
            f"a {type(city).__name__} cannot be encoded",
            "a CityMap",
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
    count = _row_counter(progress, city.shape[0], sides, coding, topological is not None)
    work = {"threads": threads, "progress": count}
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
        above=0 if max_error is None else leaves.count_above(max_error),
        pairs=sum(level.pairs for level in levels),
        seconds=time.perf_counter() - start,
    )


def _lay(condensation: Condensation, city: CityMap) -> np.ndarray:
    """Lay the ``condensation`` over the heights of ``city``; `GenomeError` unless it fits."""
    if not isinstance(condensation, Condensation) or condensation.shape != city.shape:
        raise GenomeError(
            f"{city.name}, {city.shape[0]} × {city.shape[1]} px, does not fit "
            f"{spell(condensation)}",
            "a Condensation with the size of the map",
            "make the Condensation from this map: Condensation.cut(city, mask)",
        )
    return condensation.laid(city.heights)


def _row_counter(progress, height: int, sides: Sequence[int], coding: Coding, twice: bool):
    """Make a function that adds rows of domain blocks and calls ``progress`` (done, total)."""
    if progress is None:
        return None
    total = sum(max(height - m * side + 1, 0) for side in sides for m in coding.domains)
    total *= 1 + twice
    done = 0.0

    def count(rows: float) -> None:
        nonlocal done
        done += rows
        progress(min(round(done, 6), total), total)

    return count


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
        f"{city.name}: {setting('block', block)}",
        "a whole number of pixels, 2 or more; or two numbers, the finest and the largest side",
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
