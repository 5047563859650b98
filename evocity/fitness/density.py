"""Built densities: the indices of Spacematrix, floors and the mean height."""

import math

import numpy as np

from evocity.citymap import STOREY, CityMap
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.views.wanted_density import WantedDensity as WantedDensity

#: Height of one floor, metres.
FLOOR = STOREY


@fitness(range=(0, 1), any_site=True)
def gsi(city: CityMap) -> float:
    """Ground space index: the share of the ground that is built on.

    Formula: B / A, with B the footprint of all buildings and A the area of the map.
    Unit: none. Range: 0 to 1. Empty map: 0.
    Source: Berghauser Pont & Haupt, Spacematrix (2010).

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> gsi(CityMap(heights, 2.0))
    0.25
    """
    return np.count_nonzero(city.built) / city.pixels


@fitness(range=(0, math.inf), any_site=True)
def fsi(city: CityMap) -> float:
    """Floor space index: floor area per unit of ground.

    Formula: F / A, with A the area of the map, and F the area of a pixel times the total number of
    floors of the built pixels. The number of floors of a pixel is its height divided by 3 m,
    rounded.
    Unit: none. Range: 0 upwards. Empty map: 0. Source: Berghauser Pont & Haupt, Spacematrix (2010).

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> fsi(CityMap(heights, 2.0))
    0.75
    """
    return _floors(city) / city.pixels


@fitness(range=(0, math.inf), any_site=True)
def osr(city: CityMap) -> float:
    """Open space ratio: open ground per unit of floor area.

    A low open space ratio means that many floors share little open ground.

    Formula: (1 − GSI) / FSI, with GSI and FSI the measures `gsi` and `fsi`. Unit: none. Range: 0
    (no open ground) upwards. Empty map: NaN (nothing is built). Source: Berghauser Pont & Haupt,
    Spacematrix (2010), who call this ratio spaciousness, too.

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> osr(CityMap(heights, 2.0))
    1.0
    """
    count = np.count_nonzero(city.built)
    if not count:
        return Undefined("nothing is built")
    return (city.pixels - count) / _floors(city)


@fitness(range=(1, math.inf), any_site=True)
def storeys(city: CityMap) -> float:
    """Mean number of floors of built ground, weighted by footprint.

    Formula: FSI / GSI, with FSI and GSI the measures `fsi` and `gsi`.
    Unit: none. Range: 1 upwards, because pixels below half a floor in height do not count as built.
    Empty map: NaN (nothing is built).
    Source: Berghauser Pont & Haupt, Spacematrix (2010).

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> heights[4:, 4:] = 15
    >>> storeys(CityMap(heights, 2.0))
    4.0
    """
    return _per_built_pixel(city, _floors(city))


@fitness(unit="m", range=(0, math.inf), any_site=True)
def mean_height(city: CityMap) -> float:
    """Mean height of built ground, weighted by footprint.

    Formula: Σ h / n over the n built pixels, with h the height of a pixel.
    Unit: metres. Range: above 0. Empty map: NaN (nothing is built).
    Source: a plain mean of heights.

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> heights[4:, 4:] = 15
    >>> mean_height(CityMap(heights, 2.0))
    12.0
    """
    return _per_built_pixel(city, float(city.heights.sum(where=city.built, dtype=np.float64)))


def _per_built_pixel(city: CityMap, total: float) -> float:
    count = np.count_nonzero(city.built)
    return total / count if count else Undefined("nothing is built")


def _floors(city: CityMap) -> float:
    """Floors of all built pixels, summed; at least one each."""
    # np.rint would round 7.5 m, two floors and a half, down but 4.5 m up. A built pixel is above
    # half a floor, so open ground has no floors.
    floors = np.floor(city.heights / np.float32(FLOOR) + np.float32(0.5))
    return float(floors.sum(where=city.built, dtype=np.float64))
