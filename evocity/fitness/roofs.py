"""How high roofs are, one beside the other: spread, variety and flatness."""

import math

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.fitness.density import FLOOR
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Heights are told apart in so many classes of one floor (`FLOOR`), upwards from `BUILT_ABOVE`;
#: what stands higher than the last (61.5 m) is of the last.
CLASSES = 20
#: Roofs that differ by no more than this, metres, are level with each other.
LEVEL = 0.5


@fitness(unit="m", range=(0, math.inf), any_site=True)
def height_deviation(city: CityMap) -> float:
    """Standard deviation of the height of what is built.

    Formula: √(Σ (h − h̄)² / n) over the n built pixels, h̄ their mean (`mean_height`).
    Unit: metres. Range: 0 (all of one height) upwards. Empty map: NaN, nothing is built.
    Source: none needed, a plain deviation weighted by footprint.

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
    """How evenly roofs are spread over all heights.

    Formula: −Σ p ln p / ln 20, p the share of the built pixels in each of 20 classes of one
    storey, 3 m, from 1.5 to 61.5 m; what is higher is of the last. The bounds are fixed, so
    that maps compare.
    Unit: none. Range: 0 (all of one class) to 1 (as much of each). Empty map: NaN, nothing is
    built.
    Source: Shannon 1948 (Bell System Technical Journal 27:379-423), normalised.

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
    """Share of what is built that lies level with all built ground beside it.

    Formula: n_level / n over the n built pixels, level being those that differ by at most 0.5 m
    from each of their built neighbours (4, by pixel sides). Real roofs of a 2D½ map end in
    walls; codes blur them into slopes, and this falls.
    Unit: none; at other pixel sizes other pixels are neighbours. Range: 0 to 1, a pixel without
    built neighbours is level. Empty map: NaN, nothing is built.
    Source: ours, to see how far coding and breeding have worn down roofs.

    >>> heights = np.zeros((8, 8))
    >>> heights[:, :4] = 9
    >>> heights[:, 4:6] = 12  # a step: a column of pixels on either side is not level
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
