"""What a child kept: whole buildings of its source cities, and the map that breeding meant to
lay."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness._kernels import trace_copies
from evocity.fitness.measure import Undefined
from evocity.fitness.reference import maps_of
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import crumbs
from evocity.genome import VOID, Genome, unpacked
from evocity.isometries import AFFINE


@dataclass(frozen=True)
class Heritability:
    """How truly a code carries the map it is meant to be.

    distance : root mean square difference of the decoded map from the one meant, metres.
    crumbs : how many more crumbs (`crumbs`, 1/ha) the decoded map has than the one meant;
        NaN where nothing is built in one of them.
    """

    distance: float
    crumbs: float


def heritability(genome: Genome, intended: np.ndarray) -> Heritability:
    """How far a child's decoded map is from what its operator meant to lay.

    intended : float32 ``(H, W)``, metres, as in the `Draft` of an operator.
    """
    from evocity.coding.decode import decode

    decoded = decode(genome).city
    meant = decoded.replace(intended)
    distance = math.sqrt(float(np.mean((decoded.heights - meant.heights) ** 2, dtype=np.float64)))
    return Heritability(distance, float(crumbs(decoded)) - float(crumbs(meant)))


@fitness(goal="max", range=(0, 1))
def integrity(city: CityMap, genome: Genome, sources: Sequence[CityMap]) -> float:
    """Share of what is built that belongs to buildings of the source cities, still whole.

    Each range block of a genome shows a square of a source city, turned or mirrored or not: its
    stone. A building of a source city is whole where all its pixels are shown under one isometry
    and one translation, wherever on the map that is, through however many generations and
    whatever range blocks it came. Buildings are told apart by gaps and by steps of height.
    Macro-blocks cut buildings at their edges; this says how many. `evocity.fitness.whole_buildings`
    says which are whole, and where. Of children between two parents (interpolation), whose lifs
    are named after one of them, it says nothing.

    Formula: Σ area of whole buildings / Σ area of the pixels that show a built one of a source
    city; a building that is whole twice counts twice.
    Unit: none. Range: 0 to 1. Empty map: NaN, no stone is built on.
    Source: ours, see `evocity.operators` on crossing groups of lifs.

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
    """The measure `integrity` of a ``genome``; NaN if no stone is built on.

    sources : the maps that its source cities were encoded from, under their names there, in any
        order; others may be among them.

    Raises `FitnessError` if the genome has stones of another city than these, or from beyond the
    map of one. About 1.5 ms at 256².
    """
    pixels, full, *_ = _copies(genome, sources)
    total = pixels.sum()
    return float(pixels[pixels == full].sum() / total) if total else math.nan


@dataclass(frozen=True, eq=False)
class WholeBuildings:
    """The buildings of source cities that stand whole in the map of a genome, by `integrity`.

    One entry a copy, ordered by city (as in the genome), building, top, left, isometry:

    city : ``(n,)``, text, the source city.
    building : int64 ``(n,)``, its number in ``CityMap.buildings.labels`` of that city's map.
    iso : uint8 ``(n,)``, the isometry it is laid under, see `evocity.isometries`.
    top, left : int64 ``(n,)``, its first row and its first column on the genome's map, px.
    area : float64 ``(n,)``, its footprint, m².
    labels : int32 ``(H, W)``: on the genome's map 1…n where the copies stand, else 0.
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
        """All columns by name, ``(n,)`` each, as `pandas.DataFrame` takes them."""
        names = ("city", "building", "iso", "top", "left", "area")
        return {name: getattr(self, name) for name in names}


def whole_buildings(genome: Genome, sources: Sequence[CityMap]) -> WholeBuildings:
    """Which buildings of the ``sources`` stand whole in the map of a ``genome``, and where.

    Takes and raises what `integrity_of` does.
    """
    pixels, full, found, number, shown = _copies(genome, sources)
    (whole,) = np.nonzero(pixels == full)
    rows, columns = np.nonzero(shown)
    top, left = np.full((2, pixels.size), max(shown.shape))
    np.minimum.at(top, shown[rows, columns] - 1, rows)
    np.minimum.at(left, shown[rows, columns] - 1, columns)
    order = whole[np.lexsort([one[whole] for one in (found[0], left, top, found[3], number)])]
    labels = np.zeros(pixels.size + 1, np.int32)
    labels[order + 1] = np.arange(1, order.size + 1)
    return WholeBuildings(
        city=np.array(genome.cities)[number[order]],
        building=found[3, order],
        iso=found[0, order].astype(np.uint8),
        top=top[order],
        left=left[order],
        area=pixels[order] * genome.metres_per_pixel**2,
        labels=labels[shown],
    )


def _copies(genome: Genome, sources: Sequence[CityMap]):
    """The copies of buildings, n of them, whole or not, that a ``genome`` is laid of.

    Returns ``(n,)`` how many pixels show each, and how many the building has; (4, n) isometry,
    translation, building; ``(n,)`` which of the genome's cities it is of; ``(H, W)`` the number of
    the copy that each pixel shows, from 1, else 0.
    """
    p = genome.pavement
    maps = _maps_of(genome, sources)
    squares = np.array([*p.corners, p.side, *unpacked(genome.source), genome.turn], np.int64)
    shown = np.zeros((p.height, p.width), np.int32)
    found, full, number = [np.empty((5, 0), np.int64)], [], []
    for city, told in maps.items():
        labels, counts = _footprints(told)
        stones = squares[:, genome.parent == city]
        _check_inside(stones, told)
        first = sum(one.shape[1] for one in found)
        found.append(_traced(stones, labels, first, shown))
        full.append(counts[found[-1][3]])
        number.append(np.full(full[-1].size, city))
    copies = np.concatenate(found, axis=1)
    full, number = (np.concatenate([*one, np.empty(0, np.int64)]) for one in (full, number))
    return copies[4], full, copies[:4], number, shown


def _traced(stones: np.ndarray, labels: np.ndarray, first: int, shown: np.ndarray) -> np.ndarray:
    """The copies, (5, n), that the ``stones`` of one city show, as `trace_copies` tells them."""
    room = 2 * stones.shape[1] + 1024
    while True:
        table = np.zeros(1 << (2 * room).bit_length(), np.int32)
        copies = np.empty((5, room), np.int64)
        count = trace_copies(*stones, AFFINE, labels, first, table, copies, shown)
        if count >= 0:
            return copies[:, :count]
        room *= 4


def _maps_of(genome: Genome, sources: Sequence[CityMap]) -> dict[int, CityMap]:
    """The map of each of the genome's cities that it has stones of, but for the void."""
    named = {city.name: city for city in maps_of(sources)}
    stones = np.bincount(genome.parent, minlength=len(genome.cities))
    there = {k: name for k, name in enumerate(genome.cities) if stones[k] and name != VOID}
    strange = {k: name for k, name in there.items() if name not in named}
    if strange:
        raise FitnessError(
            f"{sum(stones[k] for k in strange)} lifs from {', '.join(strange.values())}, beside "
            f"maps of {', '.join(named) or 'no city'}",
            "the maps of all cities that the genome is made of",
            "give all of them as sources, under the names that the genome has for them",
        )
    return {k: named[name] for k, name in there.items()}


def _check_inside(stones: np.ndarray, city: CityMap) -> None:
    _, _, side, row, column, _ = stones
    beyond = (row + side > city.shape[0]) | (column + side > city.shape[1])
    if beyond.any():
        raise FitnessError(
            f"{np.count_nonzero(beyond)} lifs from beyond the map of {city.name}, "
            f"{city.shape[0]} × {city.shape[1]} px",
            "the map that the source city was encoded from",
            "give that, at the size it had then",
        )


def _footprints(city: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """The buildings of a source city, (H, W), and how many pixels each has, from 0 for none."""
    if city not in _known:
        labels = city.building_labels
        _known[city] = labels, np.bincount(labels.ravel())
    return _known[city]


# The source cities of a run are asked for at every birth.
_known: WeakKeyDictionary[CityMap, tuple[np.ndarray, np.ndarray]] = WeakKeyDictionary()

__all__ = [
    "Heritability",
    "WholeBuildings",
    "heritability",
    "integrity",
    "integrity_of",
    "whole_buildings",
]
