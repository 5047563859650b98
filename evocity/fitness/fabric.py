"""Distance of fabrics: energy distance of building shapes from those of reference cities."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import _kernels
from evocity.fitness.energy import mean_distance
from evocity.fitness.measure import Undefined, keep_result
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
    """Distance between the shapes of the map's buildings and the shapes of buildings in other
    cities; similar shapes give about 0.

    Each building of 24 m² or more has five features: logarithm of the area, elongation,
    rectangularity, convexity, and share of party walls. Gaps and differences in height separate
    buildings. Besides the distance, the function returns three numbers: distances with one
    additional feature each. The number `fabric_distance.roughness` adds one feature to the
    distance: the standard deviation of the heights within a building. The number
    `fabric_distance.height` adds one feature to the distance: the mean height of a building. The
    number `fabric_distance.direction` adds one feature to the distance: the direction of the walls,
    as cos 4θ and sin 4θ, so that perpendicular walls have the same direction.

    The reference is one city, or several cities with weights. Each building has the weight of its
    city, divided by the number of the city's buildings. If the reference holds the source cities of
    a run, the genome gives the weight of each city. The weight of a city is the built ground of the
    map that comes from the city, divided by all built ground of the city. A map made of whole
    buildings of its source cities has a distance of about 0 from these cities.

    The measure divides each feature by its standard deviation in the reference, with equal weights
    for all cities. The distance is in standard deviations of the reference, so its unit is the same
    for every map. A feature that has the same value in all buildings of the reference does not
    count.

    Formula: 2 E\\|X − Y\\| − E\\|X − X′\\| − E\\|Y − Y′\\|, with E the mean over pairs, X and X′
    two different buildings of the city, and Y and Y′ two different buildings of the reference. The
    estimate is unbiased: a map compared with itself has a value slightly below 0. Unit: none;
    features count in standard deviations of the reference. Two districts of one real city have a
    distance of about .05; the distance between Montpellier and Lyon is 1.1. Range: from slightly
    below 0 upwards. Empty map: NaN. The distance is NaN if the map or the reference has fewer than
    20 buildings. Source: energy distance, Székely & Rizzo 2013 (Journal of Statistical Planning and
    Inference 143:1249-1272); "statistical distributions extracted from real cities", Marsault 2005
    §4.2.

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
    between = np.array([mean_distance(own, other, scaled.ends) for other in scaled.buildings])
    numbers = (
        2 * np.einsum("k,kn", shares, between)
        - mean_distance(own, own, scaled.ends)
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


@keep_result
def features(city: CityMap) -> np.ndarray:
    """Compute `FEATURES`, then `FURTHER`, of the n buildings of 24 m² or more: float64 ``(9, n)``.

    Area in m² (its logarithm), heights in m. A building without any wall but the map's border
    has no direction: its rows hold 0 and 0. About 0.5 ms at 256² once `CityMap.buildings` has
    its shapes.
    """
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
    return np.ascontiguousarray(stacked[:, large])


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


@keep_result
def _scaled_reference(reference: Reference) -> _Scaled | Undefined:
    tables = [features(city) for city in reference.cities]
    counts = [table.shape[1] for table in tables]
    reason = _too_few("the reference", sum(counts))
    return Undefined(reason) if reason else _scale(reference, tables, counts)


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
            scaled.within[k, m] = scaled.within[m, k] = mean_distance(one, other, scaled.ends)
    return scaled


def _too_few(where: str, count: int) -> str:
    if count >= FEWEST:
        return ""
    return f"{count} buildings of {CRUMB:.0f} m² or more in {where}; the comparison needs {FEWEST}"
