"""Distance of fabrics: energy distance of building shapes from those of reference cities."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import _kernels
from evocity.fitness.measure import Undefined
from evocity.fitness.reference import Reference
from evocity.fitness.registry import fitness
from evocity.genome import Genome
from evocity.views.buildings import CRUMB

#: Fewest buildings that show a distribution.
FEWEST = 20

#: Features of each building: those that always count; by name, those that count in a number of
#: their own, with the number of rows that each takes in the table.
FEATURES = ("log area", "elongation", "rectangularity", "convexity", "share of party walls")
FURTHER = {"roughness": 1, "height": 1, "direction": 2}
NUMBERS = ("fabric_distance", *FURTHER)

# Deviation below which a feature is constant: the rest is rounding.
_CONSTANT = 1e-6


@fitness(goal="min", range=(-1, math.inf), numbers=NUMBERS, any_site=True)
def fabric_distance(
    city: CityMap, reference: Reference, genome: Genome | None = None
) -> Mapping[str, float]:
    """Distance of the shapes of buildings from those of other cities; about 0 if alike.

    Five features count for each building of 24 m² or more: logarithm of the area, elongation,
    rectangularity, convexity, and share of party walls. Gaps and steps of height separate
    buildings. Three further numbers add one feature each. `fabric_distance.roughness` adds the
    standard deviation of the heights within the building, `fabric_distance.height` its mean
    height. `fabric_distance.direction` adds the direction of its walls (as cos 4θ and sin 4θ:
    walls square to each other have one direction).

    The reference is a city, or several with weights. A building weighs the weight of its city,
    divided by the city's number of buildings. For the source cities of a run the genome gives the
    weights: the built ground of the map that comes from a city, divided by the built ground of
    that city. A map of whole buildings of its sources then has a distance of about 0.

    Each feature is divided by its standard deviation in the reference, over all its cities with
    equal weights. So the scale is the same for every map. A feature that is the same in all
    buildings of the reference does not count (`left_out` names it).

    Formula: 2 E\\|X − Y\\| − E\\|X − X′\\| − E\\|Y − Y′\\|, with X and X′ two different buildings
    of the city, Y and Y′ two of the reference. The estimate is unbiased: a map against itself has
    about 0, a little below.
    Unit: none, deviations of the reference. Two windows of one real city differ by about .05,
    Montpellier from Lyon by 1.1. Range: a little below 0, upwards. Empty map: NaN, as where the
    map or the reference has fewer than 20 buildings.
    Source: energy distance, Székely & Rizzo 2013 (Journal of Statistical Planning and Inference
    143:1249-1272); "statistical distributions extracted from real cities", Marsault 2005 §4.2.

    >>> lyon = evocity.read_map("lyon-1er")
    >>> round(fabric_distance(evocity.read_map("montpellier-pas-du-loup"), reference=lyon), 1)
    1.1
    >>> abs(fabric_distance(lyon, reference=lyon)) < 0.05
    True
    """
    scaled = _scaled_reference(reference)
    if isinstance(scaled, Undefined):
        return dict.fromkeys(NUMBERS, scaled)
    own = features(city)
    shares = reference.shares(city, genome)
    if reference.weights is None:
        shares = shares * scaled.density
        shares = shares / (shares.sum() or 1)
    reason = _too_few(city.name, own.shape[1])
    if not reason and not shares.any():
        reason = f"nothing built in {city.name} comes from a city of the reference"
    counted = sum(n for n, share in zip(scaled.counts, shares, strict=True) if share)
    reason = reason or _too_few("the reference", counted)
    if reason:
        return dict.fromkeys(NUMBERS, Undefined(reason))
    own = scaled.scale(own)
    between = np.array([scaled.mean(own, other) for other in scaled.buildings])
    numbers = (
        2 * np.einsum("k,kn", shares, between)
        - scaled.mean(own, own)
        - np.einsum("k,l,kln", shares, shares, scaled.within)
    )
    return dict(zip(NUMBERS, numbers.tolist(), strict=True))


def left_out(reference) -> tuple[str, ...]:
    """Name the features that `fabric_distance` leaves out: those that are the same in all buildings
    of the ``reference``. Raises `FitnessError` if the reference has too few buildings."""
    scaled = _scaled_reference(Reference.of(reference))
    if isinstance(scaled, Undefined):
        raise FitnessError(
            scaled.reason,
            f"{FEWEST} buildings or more that are not all alike",
            "choose another reference",
        )
    return scaled.left_out


def features(city: CityMap) -> np.ndarray:
    """Compute `FEATURES`, then `FURTHER`, of the n buildings of 24 m² or more: float64 ``(9, n)``.

    Area in m² (its logarithm), heights in m. A building without any wall but the map's border
    has no direction: its rows hold 0 and 0. About 0.5 ms at 256² once `CityMap.buildings` has
    its shapes.
    """
    if city in _features:
        return _features[city]
    table = city.buildings
    large = table.area >= CRUMB
    long, short = table.box.T
    turn = np.radians(4 * np.nan_to_num(table.direction))
    pointing = ~np.isnan(table.direction)
    stacked = np.stack(
        [
            np.log(table.area),
            short / long,
            np.minimum(table.area / (long * short), 1),
            table.area / table.hull_area,
            table.shared / table.sides,
            _roughness(city),
            table.height,
            pointing * np.cos(turn),
            pointing * np.sin(turn),
        ]
    )
    _features[city] = np.ascontiguousarray(stacked[:, large])
    return _features[city]


def _roughness(city: CityMap) -> np.ndarray:
    """Compute the standard deviation of the heights of each building, m: ``(n,)``."""
    table, squares = city.buildings, np.zeros(len(city.buildings))
    _kernels.off_squared(table.labels, city.heights, table.height, squares)
    return np.sqrt(squares * city.metres_per_pixel**2 / table.area)


@dataclass(frozen=True, eq=False)
class _Scaled:
    """The buildings of a reference in units of its deviations, and the distances among them.

    rows : which features count; ends : where the scaled rows of each number end.
    buildings : float32 (F, n) of each city, scaled; counts : n of each city.
    density : buildings per built pixel of each city.
    within : (k, k, numbers), mean distance between the buildings of two cities; for one city,
        between two different buildings.
    """

    rows: np.ndarray
    deviation: np.ndarray
    ends: np.ndarray
    buildings: list[np.ndarray]
    counts: list[int]
    density: np.ndarray
    within: np.ndarray
    left_out: tuple[str, ...]

    def scale(self, table: np.ndarray) -> np.ndarray:
        return (table[self.rows] / self.deviation[self.rows, None]).astype(np.float32)

    def mean(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return _mean(x, y, self.ends)


def _mean(x: np.ndarray, y: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Average the distances of the columns of ``x`` and ``y``: ``(numbers,)``; 0 without any pair.

    If both are one array, only pairs of two different columns count.
    """
    sums, n = np.zeros(ends.size), x.shape[1]
    _kernels.distances(x, y, ends, x is y, sums)
    return sums / max(n * (n - 1) / 2 if x is y else n * y.shape[1], 1)


def _scaled_reference(reference: Reference) -> _Scaled | Undefined:
    if reference in _references:
        return _references[reference]
    tables = [features(city) for city in reference.cities]
    counts = [table.shape[1] for table in tables]
    reason = _too_few("the reference", sum(counts))
    _references[reference] = Undefined(reason) if reason else _scale(reference, tables, counts)
    return _references[reference]


def _scale(reference: Reference, tables: list, counts: list[int]) -> _Scaled | Undefined:
    filled = [table for table in tables if table.shape[1]]
    centre = np.mean([table.mean(axis=1) for table in filled], axis=0)
    variance = np.mean([((table.T - centre) ** 2).mean(axis=0) for table in filled], axis=0)
    sizes = [1] * len(FEATURES) + list(FURTHER.values())
    names, ends = [*FEATURES, *FURTHER], np.cumsum(sizes)
    for first, end in zip(ends - sizes, ends, strict=True):
        variance[first:end] = variance[first:end].sum()  # a direction has two rows, taken together
    constant = np.sqrt(variance) < _CONSTANT
    rows = np.flatnonzero(~constant)
    gone = tuple(n for n, end in zip(names, ends, strict=True) if constant[end - 1])
    if set(FEATURES) <= set(gone):
        return Undefined("the buildings of the reference are all alike")
    counted = np.concatenate([[len(FEATURES)], ends[len(FEATURES) :]])
    scaled = _Scaled(
        rows=rows,
        deviation=np.sqrt(variance),
        ends=np.searchsorted(rows, counted),
        buildings=[],
        counts=counts,
        density=np.array(counts) / [max(np.count_nonzero(c.built), 1) for c in reference.cities],
        within=np.zeros((len(tables), len(tables), len(NUMBERS))),
        left_out=gone,
    )
    scaled.buildings.extend(map(scaled.scale, tables))
    for k, one in enumerate(scaled.buildings):
        for m, other in enumerate(scaled.buildings[: k + 1]):
            scaled.within[k, m] = scaled.within[m, k] = scaled.mean(one, other)
    return scaled


def _too_few(where: str, count: int) -> str:
    if count >= FEWEST:
        return ""
    return (
        f"{count} buildings of {CRUMB:.0f} m² or more in {where}; fewer than {FEWEST} tell nothing"
    )


_features: WeakKeyDictionary[CityMap, np.ndarray] = WeakKeyDictionary()
_references: WeakKeyDictionary[Reference, _Scaled | Undefined] = WeakKeyDictionary()
