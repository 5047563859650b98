"""Integrity and heritability: the whole buildings a child keeps, and the map it should carry."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness._kernels import trace_copies
from evocity.fitness.measure import Undefined, keep_result
from evocity.fitness.reference import check_sources
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import crumbs
from evocity.genome import VOID, Genome, unpacked
from evocity.isometries import AFFINE


@dataclass(frozen=True)
class Heritability:
    """How closely a code carries the map that its operator intended.

    distance : root mean square difference of the decoded map from the intended one, metres.
    crumbs : how many more crumbs (`crumbs`, 1/ha) the decoded map has than the intended one;
        NaN where one of the two has no buildings.
    """

    distance: float
    crumbs: float


def heritability(genome: Genome, intended: np.ndarray) -> Heritability:
    """Measure how far a child's decoded map is from the map that its operator intended.

    intended : heights of the intended map, float32 ``(H, W)``, metres, as in the `Draft` of an
        operator.
    """
    from evocity.coding.decode import decode

    decoded = decode(genome).city
    target = decoded.replace(intended)
    distance = math.sqrt(float(np.mean((decoded.heights - target.heights) ** 2, dtype=np.float64)))
    return Heritability(distance, float(crumbs(decoded)) - float(crumbs(target)))


@fitness(goal="max", range=(0, 1))
def integrity(city: CityMap, genome: Genome, sources: Sequence[CityMap]) -> float:
    """Share of built ground that belongs to whole buildings of the source cities.

    Each range block of a genome shows a square of a source city, possibly turned or mirrored. A
    building of a source city is whole if the map shows all pixels of the building under one
    isometry and one translation. The place of the building on the map does not matter. A building
    counts as whole, no matter how many generations it has passed through, or how many range blocks
    it covers. Gaps and differences in height separate buildings. Crossover of groups of range
    blocks cuts buildings at the edges of the groups; the measure shows how much stays whole. The
    function `evocity.fitness.whole_buildings` lists the whole buildings with their places. The
    measure does not suit children of an interpolation, because each of their lifs names only one of
    two parents.

    Formula: Σ area of whole buildings / Σ area of the pixels that show built pixels of a source
    city; a building that appears twice counts twice. Unit: none. Range: 0 to 1. Empty map: NaN (no
    range block shows built ground of a source city). Source: our own; see `evocity.operators` about
    crossing groups of lifs.

    >>> heights = np.zeros((32, 32))
    >>> heights[4:12, 4:20] = 9
    >>> lone = CityMap(heights, 2.0)
    >>> code = evocity.encode(lone).genome
    >>> integrity(evocity.decode(code).city, genome=code, sources=[lone])
    1.0
    """
    share = integrity_of(genome, sources)
    return Undefined("no stone is built on") if math.isnan(share) else share


def integrity_of(genome: Genome, sources: Sequence[CityMap]) -> float:
    """Compute the measure `integrity` of a ``genome``; NaN if no stone is built on. The parameters
    and errors are those of `whole_buildings`. About 1.5 ms at 256²."""
    pixels, full, *_ = _copies(genome, sources)
    total = pixels.sum()
    return float(pixels[pixels == full].sum() / total) if total else math.nan


@fitness(goal="max", range=(0, 1))
def smallest_share(
    city: CityMap, genome: Genome, sources: Sequence[CityMap] | None = None
) -> float:
    """Smallest share that any source city has in the built ground outside the lock.

    The attribute `parent` of the genome names the source city of each range block. Only built
    ground that comes from a source city counts; buildings on open ground that operators added do
    not count. Locked pixels do not count either, because no birth changes them. If the smallest
    share falls to 0, the city is no longer a cross of its parents, but a copy of one parent. With
    equal shares, the value is .5 for two source cities, and .33 for three source cities.

    The source cities are all cities that the genome or the run names. In a run of two cities, a map
    that comes from only one city has the value 0, and so have the source cities. Without the
    argument ``sources``, only the cities that the genome names count, so the code of a single city
    has the value 1.

    Formula: minimum over the source cities of (number of built pixels from this city / number of
    built pixels from all source cities), over the pixels that are not locked.
    Unit: none. Range: 0 (a source city is missing) to 1 (the genome and the run have only one
    source city). Empty map: NaN (nothing is built outside the lock). Source: our own.

    >>> lone = CityMap(np.pad(np.full((8, 16), 9.0), ((4, 20), (4, 12))), 2.0, name="lone")
    >>> code = evocity.encode(lone).genome
    >>> smallest_share(lone, genome=code)
    1.0
    >>> smallest_share(lone, genome=code, sources=[lone, lone.replace(lone.heights, name="other")])
    0.0
    """
    shares = source_shares(city, genome, sources)
    if not any(shares.values()):
        return Undefined("nothing built outside the locked pixels comes from a source city")
    return min(shares.values())


def source_shares(
    city: CityMap, genome: Genome, sources: Sequence[CityMap] | None = None
) -> dict[str, float]:
    """Compute the share of each source city in the built ground of ``city``, by name. Locked pixels
    of the ``genome`` do not count.

    The shares sum to 1, or are all 0 if no built ground comes from a source city. The result lists
    first the cities that the ``genome`` names, in the genome's order, and then the cities of
    ``sources``. The function takes about 0.2 ms for 256 × 256 px.
    """
    free = city.built
    if genome.condensation is not None:
        free = free & ~city.of_whole(genome.condensation.mask)
    parents = city.of_whole(genome.pavement.raster(genome.parent))[free]
    counts = np.bincount(parents, minlength=len(genome.cities))
    built = dict.fromkeys(genome.cities, 0)
    for name, count in zip(genome.cities, counts.tolist(), strict=False):
        built[name] += count
    built.pop(VOID, None)
    built |= {one.name: built.get(one.name, 0) for one in check_sources(sources or ())}
    total = max(sum(built.values()), 1)
    return {name: count / total for name, count in built.items()}


def building_sources(city: CityMap, genome: Genome) -> list[str]:
    """Return the name of the source city of each building, in the order of `CityMap.buildings`: the
    city of most pixels of the building. A building without a source city has an empty text.

    city : the map of the ``genome``, decoded at any zoom. The function takes about 2 ms for
        256 × 256 px.
    """
    parents, labels = genome.pavement.raster(genome.parent), city.buildings.labels
    if city.metres_per_pixel == genome.metres_per_pixel:
        parents = city.of_whole(parents)
    else:
        pairs = zip(city.shape, parents.shape, strict=True)
        parents = parents[np.ix_(*(np.arange(now) * was // now for now, was in pairs))]
    built, wide = labels > 0, len(genome.cities)
    pairs = (labels[built].astype(np.int64) - 1) * wide + parents[built]
    count = len(city.buildings)
    most = np.bincount(pairs, minlength=count * wide).reshape(count, wide).argmax(axis=1)
    names = ["" if name == VOID else name for name in genome.cities]
    return [names[k] for k in most.tolist()]


@dataclass(frozen=True, eq=False)
class WholeBuildings:
    """The buildings of source cities that are whole in the map of a genome, by `integrity`.

    Each copy has one entry. The order is by city (as in the genome), building, top, left, isometry.

    city : ``(n,)``, text, the source city.
    building : int64 ``(n,)``, its number in ``CityMap.buildings.labels`` of that city's map.
    iso : uint8 ``(n,)``, the isometry of the copy, see `evocity.isometries`.
    top, left : int64 ``(n,)``, its first row and its first column on the genome's map, px.
    area : float64 ``(n,)``, its footprint, m².
    labels : int32 ``(H, W)``: on the genome's map 1…n on the copies, 0 elsewhere.
    """

    city: np.ndarray
    building: np.ndarray
    iso: np.ndarray
    top: np.ndarray
    left: np.ndarray
    area: np.ndarray
    labels: np.ndarray

    def __len__(self) -> int:
        return len(self.building)

    def as_dict(self) -> dict[str, np.ndarray]:
        """Return all columns by name, ``(n,)`` each, as `pandas.DataFrame` takes them."""
        names = ("city", "building", "iso", "top", "left", "area")
        return {name: getattr(self, name) for name in names}


def whole_buildings(genome: Genome, sources: Sequence[CityMap]) -> WholeBuildings:
    """List the buildings of the source cities that appear whole in the map of a ``genome``, with
    their places.

    sources : the maps from which the genome's source cities were encoded, in any order. The map of
        each source city must have the name that the genome uses; the list may also hold maps of
        other cities.

    Raises `FitnessError` if a city of the genome has no map in ``sources``, or has a map that is
    too small.
    """
    pixels, full, copies, number, shown = _copies(genome, sources)
    (whole,) = np.nonzero(pixels == full)
    rows, columns = np.nonzero(shown)
    top, left = np.full((2, pixels.size), max(shown.shape))
    np.minimum.at(top, shown[rows, columns] - 1, rows)
    np.minimum.at(left, shown[rows, columns] - 1, columns)
    keys = copies[0], left, top, copies[3], number
    order = whole[np.lexsort([key[whole] for key in keys])]
    labels = np.zeros(pixels.size + 1, np.int32)
    labels[order + 1] = np.arange(1, order.size + 1)
    return WholeBuildings(
        city=np.array(genome.cities)[number[order]],
        building=copies[3, order],
        iso=copies[0, order].astype(np.uint8),
        top=top[order],
        left=left[order],
        area=pixels[order] * genome.metres_per_pixel**2,
        labels=labels[shown],
    )


def _copies(genome: Genome, sources: Sequence[CityMap]):
    """Trace the n copies of buildings, whole or not, that the map of a ``genome`` shows.

    Returns ``(n,)`` the number of pixels that show each copy, and that of the building's pixels;
    (4, n) isometry, translation, building; ``(n,)`` the number of its city among the genome's;
    ``(H, W)`` the number of the copy that each pixel shows, from 1, else 0.
    """
    p = genome.pavement
    maps = source_maps(genome, sources)
    squares = np.array([*p.corners, p.side, *unpacked(genome.source), genome.turn], np.int64)
    shown = np.zeros((p.height, p.width), np.int32)
    traced, full, number = [np.empty((5, 0), np.int64)], [], []
    for city, source in maps.items():
        labels, counts = _footprints(source)
        stones = squares[:, genome.parent == city]
        _check_inside(stones, source)
        first = sum(table.shape[1] for table in traced)
        traced.append(_trace(stones, labels, first, shown))
        full.append(counts[traced[-1][3]])
        number.append(np.full(full[-1].size, city))
    copies = np.concatenate(traced, axis=1)
    full, number = (np.concatenate([*parts, np.empty(0, np.int64)]) for parts in (full, number))
    return copies[4], full, copies[:4], number, shown


def _trace(stones: np.ndarray, labels: np.ndarray, first: int, shown: np.ndarray) -> np.ndarray:
    """List the copies, (5, n), that the ``stones`` of one city show, as `trace_copies` does."""
    room = 2 * stones.shape[1] + 1024
    while True:
        table = np.zeros(1 << (2 * room).bit_length(), np.int32)
        copies = np.empty((5, room), np.int64)
        count = trace_copies(*stones, AFFINE, labels, first, table, copies, shown)
        if count >= 0:
            return copies[:, :count]
        room *= 4


def source_maps(genome: Genome, sources: Sequence[CityMap]) -> dict[int, CityMap]:
    """Find the map of each of the genome's cities that it has stones of, without the void."""
    named = {city.name: city for city in check_sources(sources)}
    stones = np.bincount(genome.parent, minlength=len(genome.cities))
    there = {k: name for k, name in enumerate(genome.cities) if stones[k] and name != VOID}
    strange = {k: name for k, name in there.items() if name not in named}
    if strange:
        raise FitnessError(
            f"{sum(stones[k] for k in strange)} lifs (codes of one range block) come from "
            f"{', '.join(strange.values())}, but "
            f"the sources are maps of {', '.join(named) or 'no city'}",
            "the maps of all source cities of the genome",
            "give all these maps as sources, with the names that the genome uses",
        )
    return {k: named[name] for k, name in there.items()}


def _check_inside(stones: np.ndarray, city: CityMap) -> None:
    _, _, side, row, column, _ = stones
    beyond = (row + side > city.shape[0]) | (column + side > city.shape[1])
    if beyond.any():
        raise FitnessError(
            f"{np.count_nonzero(beyond)} lifs (codes of one range block) come from outside the "
            f"map of {city.name}, which has {city.shape[0]} × {city.shape[1]} px",
            "the map from which the source city was encoded",
            "give this map with the same number of pixels as at its encoding",
        )


@keep_result  # every birth of a run needs them
def _footprints(city: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """Return the buildings of a source city, (H, W), and the number of pixels of each label."""
    labels = city.building_labels
    return labels, np.bincount(labels.ravel())
