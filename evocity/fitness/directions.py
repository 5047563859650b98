"""The directions of buildings: alignment with neighbours, and order over the whole map."""

import math

import numpy as np
import scipy

from evocity.citymap import CityMap
from evocity.fitness._kernels import nearest
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import CRUMB

#: Number of neighbours that a building is compared with, nearest centroids first.
NEAREST = 6
#: Relative difference below which two distances are equal: on a raster the shorter one is
#: chance.
_TIE = 1e-6
#: Number of bins of 10° within a quarter turn, the first centred on east.
BINS = 9
# Up to so many buildings the distances of all pairs take no longer than a tree.
_FEW = 1000


@fitness(goal="min", unit="°", range=(0, 45), any_site=True)
def alignment_neighbours(city: CityMap) -> float:
    """Mean angle between the walls of buildings and those of their neighbours.

    Formula: mean over buildings of 24 m² or more of the mean over their 6 nearest neighbours of
    min(d, 90 − d). d = \\|θ_i − θ_j\\| mod 90, with θ the direction of a building's walls
    (`CityMap.buildings`). Centroids give the distances. If several neighbours are as near as the
    sixth, all of them count; a small map may have fewer than 6.
    Unit: degrees. Range: 0 (neighbours parallel or square) to 45; random directions have 22.5.
    Empty map: NaN, as on any map of fewer than two buildings. Use pixels of 1 m or less: the
    direction of a building of few pixels is a guess.
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
    """Alignment as momepy defines it, to compare with numbers of other studies.

    Formula: mean over buildings of the mean over their 6 nearest (as in `alignment_neighbours`)
    of \\|o_i − o_j\\|, with o = \\|((θ + 45) mod 90) − 45\\| the turn of a building from north and
    east. The formula ignores the sign: walls turned by +10° and −10° read as aligned. Do not breed
    by it.
    Unit: degrees. Range: 0 to 45.
    Empty map: NaN, as on any map of fewer than two buildings. Use pixels of 1 m or less, as for
    `alignment_neighbours`.
    Source: Fleischmann 2019 (JOSS 4:1807), momepy.alignment of momepy.orientation. Momepy takes
    the direction of the smallest rectangle about the building.

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
    """How far the walls of the whole map follow few directions.

    Formula: φ = 1 − ((H − ln 4)/(ln 36 − ln 4))², with H = −Σ p ln p the entropy of 36 bins of 10°,
    the first centred on east. p is a bin's share of the length of walls. A quarter of a building's
    perimeter counts in the direction of its walls (`CityMap.buildings`), a quarter square to it,
    and a quarter opposite to each. So a building fills 4 bins alike, and H − ln 4 is the entropy
    of 9 bins.
    Unit: none. Range: 0 (equal lengths in all directions) to 1 (a grid: one direction and that
    square to it). A fabric between two bins, for example at 5°, fills both and has .90.
    Empty map: NaN, as on any map without a building of 24 m² that has a direction. Use pixels of
    1 m or less, as for `alignment_neighbours`.
    Source: Boeing 2019 (Applied Network Science 4:67), of streets; here of walls.

    >>> y, x = np.mgrid[:256, :256]
    >>> grid = 9 * ((x % 32 > 8) & (y % 32 > 8))
    >>> orientation_order(CityMap(grid, 1.0))
    1.0
    """
    directions = city.buildings.direction
    known = _oriented(city)
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


def _oriented(city: CityMap) -> np.ndarray:
    """Select the buildings that have a direction and are not crumbs, bool ``(n,)``.

    Crumbs would all seem to lie along the raster.
    """
    return np.isfinite(city.buildings.direction) & (city.buildings.area >= CRUMB)


def _mean_over_neighbours(city: CityMap, difference) -> float:
    """Average over buildings the mean ``difference`` of their direction and their neighbours'."""
    buildings, known = city.buildings, _oriented(city)
    direction = buildings.direction[known]
    count = direction.size
    if count < 2:
        return Undefined(f"{count} buildings with a direction; fewer than 2 have no neighbours")
    # The building itself comes first, or another on the very same point.
    candidates = min(count, 2 * NEAREST + 1)
    distance, index = _nearest(buildings.y[known], buildings.x[known], candidates)
    others = index != np.arange(count)[:, None]
    others[others.all(axis=1), -1] = False
    reach = distance[:, min(NEAREST, count - 1)] * (1 + _TIE)
    weights = others & (distance <= reach[:, None])
    differences = difference(direction[:, None], direction[index])
    return float(np.average(differences, axis=1, weights=weights).mean())


def _nearest(y: np.ndarray, x: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Find the distances of the ``count`` points nearest to each point, itself among them, rising,
    and their numbers, ``(n, count)`` each.

    Equal distances come in the order of SciPy's tree, which takes a fifth of a second to load.
    Nearly all maps built by rule have equal distances, few districts have.
    """
    if y.size <= _FEW:
        distance, index = np.empty((y.size, count)), np.empty((y.size, count), np.int64)
        if not nearest(np.ascontiguousarray(y), np.ascontiguousarray(x), distance, index):
            return distance, index
    points = np.column_stack([y, x])
    return scipy.spatial.KDTree(points).query(points, k=count)
