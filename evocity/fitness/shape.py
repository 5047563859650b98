"""The shapes of buildings, their number, and the walls they share.

Gaps and differences in height separate buildings (`CityMap.buildings`). Buildings of 24 m² and more
count; smaller footprints are `crumbs`.
"""

import math

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.views.buildings import CRUMB


@fitness(range=(0, 1), any_site=True)
def elongation(city: CityMap) -> float:
    """Mean ratio of the short side of a building to its long side.

    Formula: mean of s / l over all buildings, with s and l the short and the long side of the
    smallest rectangle around the footprint (`Buildings.box`). Long and narrow buildings have a low
    value.
    Unit: none. Range: above 0 (long and narrow) to 1 (as wide as long).
    Empty map: NaN, like every map without a building of 24 m² or more.
    Source: Gil, Beirão, Montenegro & Duarte 2012 (Urban Morphology 16:27-40), as
    momepy.elongation.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:24] = 9
    >>> elongation(CityMap(heights, 2.0))
    0.5
    """
    long, short = city.buildings.box.T
    return _mean(city, short / long)


@fitness(range=(0, 1), any_site=True)
def rectangularity(city: CityMap) -> float:
    """Mean ratio of a building's area to the area of the smallest rectangle around the building.

    Formula: mean of A / A_bb over all buildings, with A the area of the footprint and A_bb the area
    of the smallest rectangle around the footprint (`Buildings.box`). If rounding to pixels makes
    the ratio of a building larger than 1, the ratio counts as 1.
    Unit: none. Range: above 0 to 1 (rectangles). Empty map: NaN, like every map without a building
    of 24 m² or more.
    Source: Dibble, Prelorendjos, Romice, Zanella, Strano, Pagel & Porta 2019 (Environment and
    Planning B 46:707-730), as momepy.rectangularity.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:24, 8:24] = 9
    >>> heights[16:24, 16:24] = 0
    >>> rectangularity(CityMap(heights, 2.0))
    0.75
    """
    return _mean(city, np.minimum(_box_shares(city), 1))


@fitness(range=(0, 1), any_site=True)
def convexity(city: CityMap) -> float:
    """Mean ratio of a building's area to the area of its convex hull.

    Formula: mean of A / A_hull over all buildings, with A the area of the footprint and A_hull the
    area of its convex hull on the raster (`Buildings.hull_area`). Unit: none. Range: above 0 to 1
    (buildings without yards, wings or bends). Empty map: NaN, like every map without a building of
    24 m² or more. Source: Dibble and others 2019 (Environment and Planning B 46:707-730);
    momepy.convexity computes the same ratio.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> convexity(CityMap(heights, 2.0))
    1.0
    >>> heights[11:13, 11:13] = 0
    >>> convexity(CityMap(heights, 2.0))
    0.9375
    """
    return _mean(city, city.buildings.area / city.buildings.hull_area)


@fitness(range=(0, 1), any_site=True)
def compactness(city: CityMap) -> float:
    """Mean ratio of a building's area to the area of the smallest circle around the building.

    Formula: mean of A / (π R²) over all buildings, with A the area of the footprint and R the
    radius of the smallest circle around the footprint (`Buildings.circle`). Unit: none. Range:
    above 0 (long or branched) to 1 (a disc); a square has 2/π = .637. Empty map: NaN, like every
    map without a building of 24 m² or more. Source: Dibble and others 2019 (Environment and
    Planning B 46:707-730), after Reock 1961; momepy.circular_compactness computes the same ratio.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> round(compactness(CityMap(heights, 2.0)), 4)
    0.6366
    """
    return _mean(city, _circle_shares(city))


@fitness(range=(0, 1.5), any_site=True)
def eri(city: CityMap) -> float:
    """Equivalent rectangular index: how closely buildings resemble rectangles in area and outline.

    Formula: mean of √(A / A_bb) · P_bb / P over all buildings, with A the area and P the perimeter
    (Crofton's formula) of the footprint, and A_bb and P_bb those of the smallest rectangle around
    the footprint. Unit: none. Range: above 0 (jagged) to 1 (rectangles). The perimeter on a raster
    is uncertain, so the index may exceed 1: rectangles along the raster have 1.05, and a single
    pixel has 1.49. Empty map: NaN, like every map without a building of 24 m² or more. Source:
    Basaraner & Cetinkaya 2017 (International Journal of Geographical Information Science
    31:1952-1977), as momepy.equivalent_rectangular_index.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:56, 8:56] = 9
    >>> round(eri(CityMap(heights, 2.0)), 2)
    1.06
    >>> heights[11:56, 11:53] = 0
    >>> round(eri(CityMap(heights, 2.0)), 2)
    0.31
    """
    outline = 2 * city.buildings.box.sum(axis=1)
    return _mean(city, np.sqrt(_box_shares(city)) * outline / city.buildings.perimeter)


@fitness(range=(0, 1), any_site=True)
def shape_index(city: CityMap) -> float:
    """Mean roundness of buildings, as a ratio of lengths.

    Formula: mean of √(A / π) / R over all buildings, with A the area of the footprint and R the
    radius of the smallest circle around the footprint (`Buildings.circle`). The roundness of a
    building is the square root of the ratio that the measure `compactness` averages. Unit: none.
    Range: above 0 (long or branched) to 1 (a disc); a square has √(2/π) = .798. Empty map: NaN,
    like every map without a building of 24 m² or more. Source: momepy.shape_index (Fleischmann
    2019, JOSS 4:1807), whose longest axis is the diameter of the smallest circle.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> round(shape_index(CityMap(heights, 2.0)), 4)
    0.7979
    """
    return _mean(city, np.sqrt(_circle_shares(city)))


@fitness(unit="/ha", range=(0, math.inf), any_site=True)
def building_density(city: CityMap) -> float:
    """Number of buildings per hectare; differences in height separate the houses of a row.

    Formula: number of buildings of at least 24 m², divided by the area of the map in hectares.
    Gaps, and differences in height of more than half a storey, separate buildings
    (`CityMap.buildings`). The measure `component_density` separates buildings by gaps only.
    Unit: 1/ha. Range: 0 upwards. Empty map: 0.
    Source: a plain count of buildings, separated after Soille 2008 (IEEE PAMI 30:1132-1145).

    >>> heights = np.zeros((50, 50))
    >>> heights[10:20, 10:20] = 9
    >>> heights[10:20, 20:30] = 12  # a party wall
    >>> building_density(CityMap(heights, 2.0))
    2.0
    """
    return np.count_nonzero(city.buildings.area >= CRUMB) / (city.area / 1e4)


@fitness(unit="/ha", range=(0, math.inf), any_site=True)
def component_density(city: CityMap) -> float:
    """Number of connected components of built ground per hectare; a row of houses or a street block
    counts once.

    Formula: number of built components of at least 24 m², divided by the area of the map in
    hectares. Built pixels that share a side belong to one component (`CityMap.areas`). The measure
    `building_density` counts each house of a row.
    Unit: 1/ha. Range: 0 upwards. Empty map: 0.
    Source: a plain count of components.

    >>> heights = np.zeros((50, 50))
    >>> heights[10:20, 10:20] = heights[30:40, 10:20] = 9
    >>> component_density(CityMap(heights, 2.0))
    2.0
    """
    return np.count_nonzero(city.areas >= CRUMB) / (city.area / 1e4)


@fitness(range=(0, 1), any_site=True)
def party_wall_ratio(city: CityMap) -> float:
    """Length of party walls between two buildings, as a share of the length of all walls.

    Formula: 2 S / (2 S + E), with S the number of pixel sides between two buildings, and E the
    number of pixel sides between a building and open ground or the map's border. Pixel sides
    overstate the length of all walls that are oblique to the pixels, including party walls. Unit:
    none. Range: 0 (free-standing buildings only) to below 1. Empty map: NaN, like every map without
    a building of 24 m² or more. Source: Hamaina, Leduc & Moreau 2012 (Bridging the Geographic
    Information Sciences:327-346). In momepy, the measure is ``shared_walls`` divided by the
    perimeter.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> heights[8:16, 16:24] = 12
    >>> party_wall_ratio(CityMap(heights, 2.0))
    0.25
    """
    buildings = city.buildings
    large = buildings.area >= CRUMB
    if not large.any():
        return _undefined()
    return float(buildings.shared[large].sum() / buildings.sides[large].sum())


def _box_shares(city: CityMap) -> np.ndarray:
    """Divide the area of each building by that of its smallest rectangle: ``(n,)``."""
    return city.buildings.area / city.buildings.box.prod(axis=1)


def _circle_shares(city: CityMap) -> np.ndarray:
    """Divide the area of each building by that of its smallest circle: ``(n,)``."""
    return city.buildings.area / (np.pi / 4 * city.buildings.circle**2)


def _mean(city: CityMap, values: np.ndarray) -> float:
    """Average ``values`` ``(n,)`` over the buildings that are not crumbs."""
    large = city.buildings.area >= CRUMB
    return float(values[large].mean()) if large.any() else _undefined()


def _undefined() -> Undefined:
    return Undefined(f"no building of {CRUMB:.0f} m² or more")
