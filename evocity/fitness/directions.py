"""The directions of façades and buildings: alignment with neighbours, order over the whole map.

Façades are compared pixel by pixel, by the structure tensor of the heights' gradient.
"""

import math
from functools import lru_cache

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness._kernels import fourfold, pool_rows
from evocity.fitness.measure import Undefined
from evocity.fitness.neighbours import mean_over_neighbours
from evocity.fitness.registry import fitness
from evocity.fitness.sizes import CRUMB
from evocity.views.limit_tables import read_only

#: σ of the Gaussian neighbourhood in which façades are compared, metres.
NEIGHBOURHOOD = 24.0
#: Reach of the Gaussian window, in σ.
_CUT = 2.0
#: Least gradient of a façade, metres per metre.
_FLAT = 1e-3
#: Number of neighbours that a building is compared with, nearest centroids first.
NEAREST = 6
#: Number of bins of 10° within a quarter turn, the first centred on east.
BINS = 9


@fitness(goal="max", range=(0, 1), any_site=True)
def alignment(city: CityMap) -> float:
    """Share of façades that are parallel or perpendicular to their neighbouring façades.

    Formula: Σ \\|G ∗ (w e^{4iθ})\\| / Σ G ∗ w over the map, with θ the angle of the gradient ∇h of
    the heights h, w = \\|∇h\\|² its weight, G a Gaussian window (σ = 24 m, cut at 2σ), and ∗ a
    convolution. The factor 4 makes two directions equal if they differ by a quarter turn. Façades
    on a raster look like staircases. A binomial filter (σ = √2 px) smooths first the gradient, and
    then the square of the gradient, w e^{2iθ}. In the smoothed square of the gradient, w is the
    length, and θ is half the angle. Unit: none. Range: 0 (façades in all directions everywhere) to
    1 (two perpendicular directions in every neighbourhood). The two perpendicular directions may
    differ between neighbourhoods. A regular grid of blocks has a value of about .8 because of its
    corners and of the raster; coarse pixels lower the value slightly. Empty map: NaN, like every
    map without differences in height, because such a map has no façades. Source: Marsault 2002
    proposes this measure, but gives no formula. The formula is evocity's own: a circular mean of
    fourfold symmetry over the structure tensor of Bigün & Granlund (1987).

    >>> y, x = np.mgrid[:64, :64]
    >>> walls, tower = 9 * (x // 8 % 2), 9 * (np.hypot(x - 32, y - 32) < 15)
    >>> round(alignment(CityMap(walls, 2.0)), 2), alignment(CityMap(tower, 2.0)) < 0.1
    (1.0, True)
    """
    fields = _fourfold(city)
    if fields is None:
        return Undefined("no height steps, so no façades")
    height, width = city.shape
    sigma = NEIGHBOURHOOD / city.metres_per_pixel
    down = _pool(fields, _window(height, sigma))
    cosine, sine, weight = _pool(down.swapaxes(1, 2), _window(width, sigma))
    lengths = np.hypot(cosine, sine)
    if city.site is not None:
        shares = _site_pixels(city.site.T, weight.shape)  # the axes were swapped
        lengths, weight = lengths * shares, weight * shares
    return float(min(1.0, lengths.sum() / weight.sum()))


@fitness(goal="max", range=(0, 1), any_site=True)
def alignment_global(city: CityMap) -> float:
    """Share of façades that are parallel or perpendicular to the rest of the map's façades.

    Formula: \\|Σ w e^{4iθ}\\| / Σ w over the map, with θ the angle of the gradient of heights, and
    w its weight, as in `alignment`. Streets that turn gradually give a high `alignment` and a low
    `alignment_global`. Unit: none. Range: 0 (façades in all directions) to 1 (two perpendicular
    directions everywhere). Empty map: NaN, like every map without differences in height, because
    such a map has no façades. Source: our own formula, which uses the angles and weights of the
    measure `alignment`. The formula is the mean resultant length (Mardia & Jupp 2000, §2.3) of four
    times the angles.

    >>> y, x = np.mgrid[:64, :64]
    >>> walls, tower = 9 * (x // 8 % 2), 9 * (np.hypot(x - 32, y - 32) < 15)
    >>> round(alignment_global(CityMap(walls, 2.0)), 2)
    1.0
    >>> alignment_global(CityMap(tower, 2.0)) < 0.1
    True
    """
    fields = _fourfold(city)
    if fields is None:
        return Undefined("no height steps, so no façades")
    cosine, sine, weight = fields.sum(axis=(1, 2), dtype=np.float64)
    return min(1.0, math.hypot(cosine, sine) / weight)


@fitness(goal="min", unit="°", range=(0, 45), any_site=True)
def alignment_neighbours(city: CityMap) -> float:
    """Mean angle between the walls of buildings and those of their neighbours.

    Formula: mean of min(d, 90 − d) over all buildings i of 24 m² or more and their 6 nearest
    neighbours j, with d = \\|θ_i − θ_j\\| mod 90, and θ the direction of a building's walls
    (`CityMap.buildings`). Each building has the same weight. Distances between buildings run from
    centroid to centroid. If several buildings are as near as the sixth neighbour, all of them count
    as neighbours. On a map of few buildings, fewer than 6 neighbours count. Unit: degrees. Range: 0
    (neighbours parallel or perpendicular) to 45; random directions have the value 22.5. Empty map:
    NaN, like every map of fewer than two buildings. Use pixels of 1 m or less, because the
    direction of a building of few pixels is uncertain. Source: our own variant of momepy's
    alignment (Fleischmann 2019, JOSS 4:1807); `alignment_momepy` is the original.

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
    """Alignment of buildings by momepy's definition, for comparison with the values of other
    studies.

    Formula: mean of \\|o_i − o_j\\| over all buildings i and their 6 nearest neighbours j, with o =
    \\|((θ + 45) mod 90) − 45\\| the angle between a building's direction θ and the axes to the
    north and east. The neighbours of a building are those of the measure `alignment_neighbours`.
    The formula ignores the sign of the angle o: walls turned by +10° and walls turned by −10° count
    as aligned. The measure `alignment_momepy` is not suitable as the goal of a search. Unit:
    degrees. Range: 0 to 45.
    Empty map: NaN, like every map of fewer than two buildings. Use pixels of 1 m or less, as for
    `alignment_neighbours`. Source: Fleischmann 2019 (JOSS 4:1807), momepy.alignment of
    momepy.orientation. Momepy defines the direction of a building as the direction of the smallest
    rectangle around the building.

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
    """How strongly the walls of the whole map concentrate on a few directions.

    Formula: φ = 1 − ((H − ln 4)/(ln 36 − ln 4))², with H = −Σ p ln p the entropy of 36 bins of 10°,
    and p the share of a bin in the length of all walls. The first of the 36 bins is centred on
    east. A building adds a quarter of its perimeter to each of four perpendicular directions, one
    of which is the direction of its walls (`CityMap.buildings`). Each building fills 4 of 36 bins
    equally, so H − ln 4 is the entropy of 9 bins. Unit: none. Range: 0 (equal lengths in all
    directions) to 1 (a grid of two perpendicular directions). A grid with a direction between two
    bins, for example at 5°, fills both of these bins and has the value .90. Empty map: NaN, like
    every map in which no building of 24 m² or more has a direction. Use pixels of 1 m or less, as
    for `alignment_neighbours`. Source: Boeing 2019 (Applied Network Science 4:67), who applies the
    formula to streets; this measure applies the formula to walls.

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
    if direction.size < 2:
        return Undefined(
            f"{direction.size} buildings with a direction; fewer than 2 have no neighbours"
        )
    return mean_over_neighbours(
        buildings.y[known], buildings.x[known], direction, NEAREST, difference
    )


def _fourfold(city: CityMap) -> np.ndarray | None:
    """Compute w cos 4θ, w sin 4θ and w of a map's façades: float32 ``(3, H, W)``; None without
    façades."""
    fields = np.empty((3, *city.shape), np.float32)
    steepest = fourfold(city.structure, fields)
    if city.site is not None:
        fields[:, ~city.site] = 0
        steepest = fields[2].max()
    return fields if steepest > _FLAT**2 else None


def _site_pixels(site: np.ndarray, samples: tuple[int, int]) -> np.ndarray:
    """Count the pixels of the ``site`` about each centre of the windows of `_window`, an array of
    shape ``samples``; windows centred elsewhere do not belong to the map."""
    rows, columns = np.nonzero(site)
    (height, width), (down, along) = site.shape, samples
    cells = rows * down // height * along + columns * along // width
    return np.bincount(cells, minlength=down * along).reshape(samples)


def _pool(fields: np.ndarray, window: np.ndarray) -> np.ndarray:
    """Sum the rows of ``fields`` ``(n, H, W)`` under each ``window``: ``(n, samples, W)``."""
    count, _, columns = fields.shape
    pooled = np.zeros((count, len(window), columns), np.float32)
    pool_rows(np.ascontiguousarray(fields), window, pooled)
    return pooled


@lru_cache(maxsize=32)
def _window(size: int, sigma: float) -> np.ndarray:
    """Make Gaussian windows along an axis of ``size`` px: float32 ``(samples, size)``, one row for
    each centre.

    The pooled fields vary slowly, so centres a third of σ apart are enough. They lie symmetrically.
    """
    samples = int(np.ceil(size / max(1.0, sigma / 3)))
    centres = (np.arange(samples) + 0.5) * (size / samples) - 0.5
    distance = np.abs(np.arange(size) - centres[:, None]) / sigma
    window = np.where(distance <= _CUT, np.exp(-0.5 * distance**2), 0)
    return read_only(window.astype(np.float32))
