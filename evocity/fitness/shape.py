"""What shape buildings have, how many there are, and how many walls they share.

All of them are told apart by gaps and by steps of height (`CityMap.buildings`), and count from
24 m² on: what is smaller are `crumbs`.
"""

import math

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.views.buildings import CRUMB


@fitness(range=(0, 1), any_site=True)
def elongation(city: CityMap) -> float:
    """How long and narrow buildings are not: short by long side.

    Formula: mean over buildings of s / l, s and l the sides of the smallest rectangle about the
    footprint (`Buildings.box`).
    Unit: none. Range: above 0 (long and narrow) to 1 (as wide as long).
    Empty map: NaN, and on any other map without a building of 24 m².
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
    """How much of the smallest rectangles about them buildings fill.

    Formula: mean over buildings of A / A_bb, A the area of the footprint, A_bb that of the
    smallest rectangle about it (`Buildings.box`); at most 1 each, which rounding to pixels may
    exceed.
    Unit: none. Range: above 0 to 1 (rectangles). Empty map: NaN, and on any other map without a
    building of 24 m².
    Source: Dibble, Prelorendjos, Romice, Zanella, Strano, Pagel & Porta 2019 (Environment and
    Planning B 46:707-730), as momepy.rectangularity.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:24, 8:24] = 9
    >>> heights[16:24, 16:24] = 0
    >>> rectangularity(CityMap(heights, 2.0))
    0.75
    """
    return _mean(city, np.minimum(_boxed(city), 1))


@fitness(range=(0, 1), any_site=True)
def convexity(city: CityMap) -> float:
    """How much of their convex hulls buildings fill.

    Formula: mean over buildings of A / A_hull, A the area of the footprint, A_hull that of its
    convex hull on the raster (`Buildings.hull_area`).
    Unit: none. Range: above 0 to 1 (no yard, wing or bend). Empty map: NaN, and on any other
    map without a building of 24 m².
    Source: Dibble & al. 2019 (Environment and Planning B 46:707-730), as momepy.convexity.

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
    """How much of the smallest circles about them buildings fill.

    Formula: mean over buildings of A / (π R²), A the area of the footprint, R the radius of the
    smallest circle about it (`Buildings.circle`).
    Unit: none. Range: above 0 (far-flung) to 1 (a disc); a square has 2/π = .637.
    Empty map: NaN, and on any other map without a building of 24 m².
    Source: Dibble & al. 2019 (Environment and Planning B 46:707-730), after Reock 1961, as
    momepy.circular_compactness.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> round(compactness(CityMap(heights, 2.0)), 4)
    0.6366
    """
    return _mean(city, _rounded(city))


@fitness(range=(0, 1.5), any_site=True)
def eri(city: CityMap) -> float:
    """Equivalent rectangular index: how near buildings come to rectangles in area and outline.

    Formula: mean over buildings of √(A / A_bb) · P_bb / P, A and P area and perimeter of the
    footprint (Crofton), A_bb and P_bb those of the smallest rectangle about it.
    Unit: none. Range: above 0 (jagged) to 1 (rectangles). A raster's perimeter is so uncertain
    that it may exceed that: rectangles along the raster have 1.05, a single pixel 1.49.
    Empty map: NaN, and on any other map without a building of 24 m².
    Source: Basaraner & Cetinkaya 2017 (International Journal of Geographical Information
    Science 31:1952-1977), as momepy.equivalent_rectangular_index.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:56, 8:56] = 9
    >>> round(eri(CityMap(heights, 2.0)), 2)
    1.06
    >>> heights[11:56, 11:53] = 0
    >>> round(eri(CityMap(heights, 2.0)), 2)
    0.31
    """
    outline = 2 * city.buildings.box.sum(axis=1)
    return _mean(city, np.sqrt(_boxed(city)) * outline / city.buildings.perimeter)


@fitness(range=(0, 1), any_site=True)
def shape_index(city: CityMap) -> float:
    """How round buildings are, by lengths.

    Formula: mean over buildings of √(A / π) / R, A the area of the footprint, R the radius of
    the smallest circle about it (`Buildings.circle`): the root of what `compactness` averages.
    Unit: none. Range: above 0 (far-flung) to 1 (a disc); a square has √(2/π) = .798.
    Empty map: NaN, and on any other map without a building of 24 m².
    Source: momepy.shape_index (Fleischmann 2019, JOSS 4:1807), whose longest axis is that
    circle's diameter.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> round(shape_index(CityMap(heights, 2.0)), 4)
    0.7979
    """
    return _mean(city, np.sqrt(_rounded(city)))


@fitness(unit="/ha", range=(0, math.inf), any_site=True)
def building_density(city: CityMap) -> float:
    """How many buildings stand on a hectare, those in a row told apart by their heights.

    Formula: buildings of at least 24 m² (`CityMap.buildings`: gaps and steps of height of more
    than half a storey part them), by the area of the map in hectares. `component_density`
    counts by gaps alone.
    Unit: 1/ha. Range: 0 upwards. Empty map: 0.
    Source: none needed, a count; how they are told apart, Soille 2008 (IEEE PAMI 30:1132-1145).

    >>> heights = np.zeros((50, 50))
    >>> heights[10:20, 10:20] = 9
    >>> heights[10:20, 20:30] = 12  # a party wall
    >>> building_density(CityMap(heights, 2.0))
    2.0
    """
    return np.count_nonzero(city.buildings.area >= CRUMB) / (city.area / 1e4)


@fitness(unit="/ha", range=(0, math.inf), any_site=True)
def component_density(city: CityMap) -> float:
    """How many pieces of built ground stand on a hectare, rows and blocks counting once.

    Formula: built components of at least 24 m² (`CityMap.areas`: pixels that touch by sides are
    one), by the area of the map in hectares. `building_density` tells the houses of a row apart.
    Unit: 1/ha. Range: 0 upwards. Empty map: 0.
    Source: none needed, a count.

    >>> heights = np.zeros((50, 50))
    >>> heights[10:20, 10:20] = heights[30:40, 10:20] = 9
    >>> component_density(CityMap(heights, 2.0))
    2.0
    """
    return np.count_nonzero(city.areas >= CRUMB) / (city.area / 1e4)


@fitness(range=(0, 1), any_site=True)
def party_wall_ratio(city: CityMap) -> float:
    """Share of walls that buildings have in common.

    Formula: 2 S / (2 S + E), S the sides of pixels between two buildings, E those between a
    building and open ground or the border of the map. Sides overstate the length of a slanting
    wall, but of both kinds alike.
    Unit: none. Range: 0 (all stand free) to below 1. Empty map: NaN, and on any other map without
    a building of 24 m².
    Source: Hamaina, Leduc & Moreau 2012 (Bridging the Geographic Information Sciences:327-346),
    as momepy.shared_walls by perimeter.

    >>> heights = np.zeros((64, 64))
    >>> heights[8:16, 8:16] = 9
    >>> heights[8:16, 16:24] = 12
    >>> party_wall_ratio(CityMap(heights, 2.0))
    0.25
    """
    buildings = city.buildings
    large = buildings.area >= CRUMB
    if not large.any():
        return _nothing()
    return float(buildings.shared[large].sum() / buildings.sides[large].sum())


def _boxed(city: CityMap) -> np.ndarray:
    """``(n,)``: area of each building by that of its smallest rectangle."""
    return city.buildings.area / city.buildings.box.prod(axis=1)


def _rounded(city: CityMap) -> np.ndarray:
    """``(n,)``: area of each building by that of its smallest circle."""
    return city.buildings.area / (np.pi / 4 * city.buildings.circle**2)


def _mean(city: CityMap, values: np.ndarray) -> float:
    """Mean of ``values`` ``(n,)`` over the buildings that are no crumbs."""
    large = city.buildings.area >= CRUMB
    return float(values[large].mean()) if large.any() else _nothing()


def _nothing() -> Undefined:
    return Undefined(f"no building of {CRUMB:.0f} m² or more")
