"""How far the buildings of a city are from those of other cities, as distributions."""

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

#: Fewer buildings than this say nothing of a distribution.
FEWEST = 20

#: What is known of each building: features that always count, and those that count in a number
#: of their own, by name; how many rows of the table each takes.
FEATURES = ("log area", "elongation", "rectangularity", "convexity", "share of party walls")
FURTHER = {"roughness": 1, "height": 1, "direction": 2}
NUMBERS = ("fabric_distance", *FURTHER)

# Features whose deviation is less are constant: what is left is rounding.
_CONSTANT = 1e-6


@fitness(goal="min", range=(-1, math.inf), numbers=NUMBERS, any_site=True)
def fabric_distance(
    city: CityMap, reference: Reference, genome: Genome | None = None
) -> Mapping[str, float]:
    """How far shapes of the city's buildings are from those of other cities; about 0 if alike.

    Of each building of 24 m² or more, told apart by gaps and by steps of height, five features
    count: logarithm of the area, elongation, rectangularity, convexity, share of party walls.
    `fabric_distance.roughness` counts the standard deviation of the heights within the building
    besides, `fabric_distance.height` its mean height, `fabric_distance.direction` the direction
    of its walls (as cos 4θ and sin 4θ: walls square to each other are one direction).

    The reference is a city, or several with weights: a building of a city weighs its city's
    weight by its city's number of buildings. Source cities of a run weigh by the genome: each of
    their buildings as much as the built ground of the map that comes from its city, by the built
    ground of that city. A map laid of whole buildings of its sources then is about 0 away.

    Each feature is divided by its standard deviation in the reference, the same for every map: of
    all its cities, these weighted alike. A feature that is the same in all buildings of the
    reference is left out (`left_out` tells which).

    Formula: 2 E\\|X − Y\\| − E\\|X − X′\\| − E\\|Y − Y′\\|, X and X′ two different buildings of the
    city, Y and Y′ of the reference; unbiased, so a map against itself has about 0, a little below.
    Unit: none, deviations of the reference. Two windows of one real city differ by about .05,
    Montpellier from Lyon by 1.1. Range: a little below 0, upwards. Empty map: NaN, and wherever
    the map or the reference has fewer than 20 buildings.
    Source: energy distance, Székely & Rizzo 2013 (Journal of Statistical Planning and Inference
    143:1249-1272); "statistical distributions extracted from real cities", Marsault 2005 §4.2.

    >>> lyon = evocity.read_map("lyon-1er")
    >>> round(fabric_distance(evocity.read_map("montpellier-pas-du-loup"), reference=lyon), 1)
    1.1
    >>> abs(fabric_distance(lyon, reference=lyon)) < 0.05
    True
    """
    scaled = _scaled(reference)
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
    own = scaled.of(own)
    between = np.array([scaled.mean(own, other) for other in scaled.buildings])
    numbers = (
        2 * np.einsum("k,kn", shares, between)
        - scaled.mean(own, own)
        - np.einsum("k,l,kln", shares, shares, scaled.within)
    )
    return dict(zip(NUMBERS, numbers.tolist(), strict=True))


def left_out(reference) -> tuple[str, ...]:
    """Which features `fabric_distance` leaves out: those that are the same in all buildings of
    the ``reference``. Raises `FitnessError` if that has too few."""
    scaled = _scaled(Reference.of(reference))
    if isinstance(scaled, Undefined):
        raise FitnessError(scaled.reason, f"{FEWEST} or more", "choose another reference")
    return scaled.left_out


def features(city: CityMap) -> np.ndarray:
    """Float64 ``(9, n)``: `FEATURES`, then `FURTHER`, of the n buildings of 24 m² or more.

    Area in m² (its logarithm), heights in m; a building without any wall but the map's border
    has no direction: 0 and 0. About 0.5 ms at 256² once `CityMap.buildings` has its shapes.
    """
    if city in _features:
        return _features[city]
    table = city.buildings
    large = table.area >= CRUMB
    long, short = table.box.T
    turn = np.radians(4 * np.nan_to_num(table.direction))
    pointing = ~np.isnan(table.direction)
    found = np.stack(
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
    _features[city] = found = np.ascontiguousarray(found[:, large])
    return found


def _roughness(city: CityMap) -> np.ndarray:
    """``(n,)``: standard deviation of the heights of each building, m."""
    table, squares = city.buildings, np.zeros(len(city.buildings))
    _kernels.off_squared(table.labels, city.heights, table.height, squares)
    return np.sqrt(squares * city.metres_per_pixel**2 / table.area)


@dataclass(frozen=True, eq=False)
class _Scaled:
    """The buildings of a reference in units of its deviations, and the distances among them.

    rows : which features count; ends : of the scaled rows, where those of each number end.
    buildings : float32 (F, n) of each city, scaled; counts : n of each.
    density : buildings by built pixel of each city.
    within : (k, k, numbers), mean distance between the buildings of two cities; of one city,
        between two different ones.
    """

    rows: np.ndarray
    deviation: np.ndarray
    ends: np.ndarray
    buildings: list[np.ndarray]
    counts: list[int]
    density: np.ndarray
    within: np.ndarray
    left_out: tuple[str, ...]

    def of(self, found: np.ndarray) -> np.ndarray:
        return (found[self.rows] / self.deviation[self.rows, None]).astype(np.float32)

    def mean(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return _mean(x, y, self.ends)


def _mean(x: np.ndarray, y: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """``(numbers,)``: mean distance of the columns of ``x`` and ``y``, of two different ones if
    they are one array; 0 where there is no such pair."""
    sums, n = np.zeros(ends.size), x.shape[1]
    _kernels.distances(x, y, ends, x is y, sums)
    return sums / max(n * (n - 1) / 2 if x is y else n * y.shape[1], 1)


def _scaled(reference: Reference) -> _Scaled | Undefined:
    if reference in _references:
        return _references[reference]
    found = [features(city) for city in reference.cities]
    counts = [one.shape[1] for one in found]
    reason = _too_few("the reference", sum(counts))
    _references[reference] = made = Undefined(reason) if reason else _made(reference, found, counts)
    return made


def _made(reference: Reference, found: list, counts: list[int]) -> _Scaled | Undefined:
    there = [one for one in found if one.shape[1]]
    centre = np.mean([one.mean(axis=1) for one in there], axis=0)
    variance = np.mean([((one.T - centre) ** 2).mean(axis=0) for one in there], axis=0)
    sizes = [1] * len(FEATURES) + list(FURTHER.values())
    names, ends = [*FEATURES, *FURTHER], np.cumsum(sizes)
    for first, end in zip(ends - sizes, ends, strict=True):
        variance[first:end] = variance[first:end].sum()  # of a direction, both rows together
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
        within=np.zeros((len(found), len(found), len(NUMBERS))),
        left_out=gone,
    )
    scaled.buildings.extend(map(scaled.of, found))
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

__all__ = ["FEATURES", "FEWEST", "FURTHER", "fabric_distance", "features", "left_out"]
