"""Which way buildings are turned, building by building: to those next to them, and all in all."""

import math

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.fitness._kernels import nearest
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import CRUMB

#: A building is compared with so many, those whose centroids are nearest.
NEAREST = 6
#: Distances within this share of each other are one: which of them a raster makes the shorter
#: is chance.
_TIE = 1e-6
#: Directions within a quarter turn are told apart in so many bins of 10°, the first about east.
BINS = 9
# So many buildings are compared with each other as soon as a tree is asked.
_FEW = 1000


@fitness(goal="min", unit="°", range=(0, 45), any_site=True)
def alignment_neighbours(city: CityMap) -> float:
    """How far buildings are turned against those next to them.

    Formula: mean over buildings of 24 m² or more of the mean over their 6 nearest (by centroid;
    fewer if the map has fewer, more if several are as near as the sixth) of min(d, 90 − d),
    d = \\|θ_i − θ_j\\| mod 90, θ the direction of a building's walls (`CityMap.buildings`).
    Unit: degrees. Range: 0 (neighbours parallel or square) to 45; directions at random have 22.5.
    Empty map: NaN, and on any other map of fewer than two buildings. Needs pixels of 1 m or
    less: the direction of a building of few pixels is a guess.
    Source: ours, after momepy's alignment (Fleischmann 2019, JOSS 4:1807), which folds each
    direction first, see `alignment_momepy`.

    >>> heights = np.zeros((64, 128))
    >>> heights[16:48, 8:40] = 9
    >>> y, x = np.mgrid[:64, :128] - np.array([32, 90])[:, None, None]
    >>> heights[np.abs(y) + np.abs(x) < 20] = 9
    >>> round(alignment_neighbours(CityMap(heights, 1.0)))
    45
    """
    return _mean_over_neighbours(city, lambda a, b: np.abs((a - b + 45) % 90 - 45))


@fitness(unit="°", range=(0, 45), any_site=True)
def alignment_momepy(city: CityMap) -> float:
    """Momepy's alignment, to compare with numbers of other studies.

    Formula: mean over buildings of the mean over their 6 nearest (as in `alignment_neighbours`)
    of \\|o_i − o_j\\|, o = \\|((θ + 45) mod 90) − 45\\| how far a building is turned from north and
    east. Blind to the sign: walls turned by +10° and −10° read as aligned. Do not breed by it.
    Unit: degrees. Range: 0 to 45.
    Empty map: NaN, and on any other map of fewer than two buildings. Needs pixels of 1 m or
    less, as `alignment_neighbours`.
    Source: Fleischmann 2019 (JOSS 4:1807), momepy.alignment of momepy.orientation; there the
    direction is that of the least rectangle around the building.

    >>> heights = np.zeros((64, 128))
    >>> heights[16:48, 8:40] = 9
    >>> y, x = np.mgrid[:64, :128] - np.array([32, 90])[:, None, None]
    >>> heights[np.abs(y) + np.abs(x) < 20] = 9
    >>> round(alignment_momepy(CityMap(heights, 1.0)))
    45
    """

    def turned(theta):
        return np.abs((theta + 45) % 90 - 45)

    return _mean_over_neighbours(city, lambda a, b: np.abs(turned(a) - turned(b)))


@fitness(range=(0, 1), any_site=True)
def orientation_order(city: CityMap) -> float:
    """How few directions the walls of the whole map have.

    Formula: φ = 1 − ((H − ln 4)/(ln 36 − ln 4))², H = −Σ p ln p the entropy of 36 bins of 10°,
    the first centred on east. p is a bin's share of the length of walls: a building's perimeter
    counts in the direction of its walls (`CityMap.buildings`), square to it, and opposite to
    both, a quarter each. So a building fills 4 bins alike, and H − ln 4 is the entropy of 9.
    Unit: none. Range: 0 (as many walls in each direction) to 1 (a grid: one direction and that
    square to it). A fabric that lies between two bins, at 5° say, fills both and has .90.
    Empty map: NaN, and on any other map without a building of 24 m² that has a direction. Needs
    pixels of 1 m or less, as `alignment_neighbours`.
    Source: Boeing 2019 (Applied Network Science 4:67), of streets; here of walls.

    >>> y, x = np.mgrid[:256, :256]
    >>> grid = 9 * ((x % 32 > 8) & (y % 32 > 8))
    >>> orientation_order(CityMap(grid, 1.0))
    1.0
    """
    directions = city.buildings.direction
    known = _known(city)
    if not known.any():
        return Undefined("no building with a direction")
    lengths = np.zeros(BINS)
    # A hair to either side: a direction on the border of two bins, as 45° is, counts half in
    # each, and a map's mirror image has the same shares.
    for hair in (-1e-3, 1e-3):
        bins = np.rint(directions[known] * (BINS / 90) + hair).astype(np.intp) % BINS
        lengths += np.bincount(bins, city.buildings.perimeter[known], BINS)
    share = lengths[lengths > 0] / lengths.sum()
    entropy = float((share * np.log(1 / share)).sum())
    return max(0.0, 1 - (entropy / math.log(BINS)) ** 2)


def _known(city: CityMap) -> np.ndarray:
    """Bool ``(n,)``: the buildings that have a direction and are no crumbs, which would all seem to
    lie along the raster."""
    return np.isfinite(city.buildings.direction) & (city.buildings.area >= CRUMB)


def _mean_over_neighbours(city: CityMap, difference) -> float:
    """Mean over buildings of the mean ``difference`` of their direction and their neighbours'."""
    buildings, known = city.buildings, _known(city)
    direction = buildings.direction[known]
    count = direction.size
    if count < 2:
        return Undefined(f"{count} buildings with a direction; fewer than 2 have no neighbours")
    # The building itself comes first, or another on the very same point.
    looked_at = min(count, 2 * NEAREST + 1)
    distance, index = _nearest(buildings.y[known], buildings.x[known], looked_at)
    others = index != np.arange(count)[:, None]
    others[others.all(axis=1), -1] = False
    reach = distance[:, min(NEAREST, count - 1)] * (1 + _TIE)
    weights = others & (distance <= reach[:, None])
    differences = difference(direction[:, None], direction[index])
    return float(np.average(differences, axis=1, weights=weights).mean())


def _nearest(y: np.ndarray, x: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """How far the ``count`` points are that are nearest to each point, itself among them, rising,
    and their numbers, ``(n, count)`` each. Those equally far stand as SciPy's tree has them, which
    takes a fifth of a second to load: nearly all maps by rule have such, few districts."""
    if y.size <= _FEW:
        distance, index = np.empty((y.size, count)), np.empty((y.size, count), np.int64)
        if not nearest(np.ascontiguousarray(y), np.ascontiguousarray(x), distance, index):
            return distance, index
    points = np.column_stack([y, x])
    return scipy.spatial.KDTree(points).query(points, k=count)
