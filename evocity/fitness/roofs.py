"""The heights of roofs: deviation, entropy and flatness."""

import math

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.fitness.density import FLOOR
from evocity.fitness.measure import Undefined
from evocity.fitness.neighbours import mean_over_neighbours
from evocity.fitness.registry import fitness
from evocity.views.buildings import CRUMB

#: Number of classes of heights, one floor (`FLOOR`) each, upwards from `BUILT_ABOVE`. The last
#: class takes all greater heights too (above 61.5 m).
CLASSES = 20
#: Number of neighbours that a building's height is compared with, nearest centroids first.
NEAREST = 5
#: Greatest difference of level roofs, metres.
LEVEL = 0.5


@fitness(unit="m", range=(0, math.inf), any_site=True)
def height_deviation(city: CityMap) -> float:
    """Standard deviation of the heights of built ground.

    Formula: √(Σ (h − h̄)² / n) over the n built pixels, with h the height of a pixel, and h̄ the
    mean of these heights (`mean_height`). Unit: metres. Range: 0 (equal heights) upwards.
    Empty map: NaN (nothing is built). Source: a plain standard deviation, weighted by footprint.

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> heights[4:, 4:] = 15
    >>> height_deviation(CityMap(heights, 2.0))
    3.0
    """
    heights = city.heights[city.built]
    if not heights.size:
        return Undefined("nothing is built")
    return float(heights.std(dtype=np.float64))


@fitness(range=(0, 1), any_site=True)
def height_entropy(city: CityMap) -> float:
    """How evenly built ground spreads over all heights.

    Formula: −Σ p ln p / ln 20 over 20 classes of heights, with p the share of the built pixels in
    each class. Each class spans a storey of 3 m, from 1.5 to 61.5 m; heights above 61.5 m belong to
    the last class. The classes are the same for all maps, so that values can be compared. Unit:
    none. Range: 0 (one class) to 1 (equal shares of all classes). Empty map: NaN (nothing is
    built). Source: Shannon 1948 (Bell System Technical Journal 27:379-423), normalised.

    >>> heights = np.zeros((8, 8))
    >>> heights[:4, :4] = 9
    >>> heights[4:, 4:] = 15
    >>> round(height_entropy(CityMap(heights, 2.0)), 4)  # ln 2 / ln 20
    0.2314
    """
    heights = city.heights[city.built]
    if not heights.size:
        return Undefined("nothing is built")
    above = np.minimum((heights - np.float32(BUILT_ABOVE)) / np.float32(FLOOR), CLASSES - 1)
    counts = np.bincount(above.astype(np.intp))
    share = counts[counts > 0] / heights.size
    return float((share * np.log(1 / share)).sum()) / math.log(CLASSES)


@fitness(goal="max", range=(0, 1), any_site=True)
def roof_flatness(city: CityMap) -> float:
    """Share of built pixels that are level with all their built neighbours.

    Formula: n_level / n, with n the number of built pixels, and n_level the number of level pixels.
    A pixel is level if its height differs by at most 0.5 m from each built pixel that shares a side
    with this pixel. Real roofs end at vertical walls. Fractal coding blurs vertical walls into
    slopes, and these slopes lower the share of level pixels. Unit: none. The share of level pixels
    depends on the size of pixels. Range: 0 to 1; a pixel without built neighbours is level.
    Empty map: NaN (nothing is built). Source: our own, to show how much coding and breeding roughen
    roofs.

    >>> heights = np.zeros((8, 8))
    >>> heights[:, :4] = 9
    >>> heights[:, 4:6] = 12  # a step: on either side a column of pixels is not level
    >>> round(roof_flatness(CityMap(heights, 2.0)), 4)
    0.6667
    """
    built, heights = city.built, city.heights
    count = np.count_nonzero(built)
    if not count:
        return Undefined("nothing is built")
    level = built.copy()
    for here, there in (
        (np.s_[1:], np.s_[:-1]),
        (np.s_[:, 1:], np.s_[:, :-1]),
    ):
        step = np.abs(heights[here] - heights[there]) > np.float32(LEVEL)
        step &= built[here] & built[there]
        level[here] &= ~step
        level[there] &= ~step
    return np.count_nonzero(level) / count


@fitness(unit="m", range=(0, math.inf), any_site=True)
def height_context(city: CityMap) -> float:
    """Mean difference in height between a building and its five nearest buildings.

    A search that places buildings anywhere puts towers among houses, with larger differences in
    height than in the parents. Equal heights everywhere are not a good goal for a search. As a
    goal, give the measure `height_context` a target or a bound from real cities.

    Formula: mean of m_i over all buildings i of 24 m² or more, with m_i the mean of \\|h_i − h_j\\|
    over the 5 buildings j nearest to i, and h the mean height of a building (`CityMap.buildings`).
    Distances between buildings run from centroid to centroid. Buildings that are exactly as near as
    the fifth nearest building also count as nearest buildings. On a map of few buildings, fewer
    than 5 nearest buildings count. Unit: metres. Range: 0 (equal heights) upwards.
    Empty map: NaN, like every map of fewer than two buildings. Source: our own.

    >>> heights = np.zeros((32, 32))
    >>> heights[4:12, 4:12], heights[4:12, 20:28], heights[20:28, 4:12] = 9, 9, 15
    >>> height_context(CityMap(heights, 2.0))  # (3 + 3 + 6) / 3
    4.0
    """
    table = city.buildings
    counted = table.area >= CRUMB
    count = np.count_nonzero(counted)
    if count < 2:
        return Undefined(f"{count} buildings of {CRUMB:.0f} m² or more; a step needs 2")
    y, x, height = (column[counted] for column in (table.y, table.x, table.height))
    return mean_over_neighbours(y, x, height, NEAREST, lambda a, b: np.abs(a - b))
