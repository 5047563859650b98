"""The heights of roofs: deviation, entropy and flatness."""

import math

import numpy as np

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.fitness.density import FLOOR
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Number of classes of heights, one floor (`FLOOR`) each, upwards from `BUILT_ABOVE`. The last
#: class takes all greater heights too (above 61.5 m).
CLASSES = 20
#: Greatest difference of level roofs, metres.
LEVEL = 0.5


@fitness(unit="m", range=(0, math.inf), any_site=True)
def height_deviation(city: CityMap) -> float:
    """Standard deviation of the heights of built ground.

    Formula: √(Σ (h − h̄)² / n) over the n built pixels, with h̄ their mean (`mean_height`).
    Unit: metres. Range: 0 (one height everywhere) upwards. Empty map: NaN (nothing is built).
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
    """How evenly built ground spreads over all heights.

    Formula: −Σ p ln p / ln 20, with p the share of the built pixels in each of 20 classes of one
    storey, 3 m, from 1.5 to 61.5 m. The last class takes all greater heights too. The bounds are
    fixed, so that maps compare.
    Unit: none. Range: 0 (one class) to 1 (equal shares of all classes).
    Empty map: NaN (nothing is built).
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
    """Share of built ground that is level with all its built neighbours.

    Formula: n_level / n over the n built pixels. A pixel is level if its height differs by at most
    0.5 m from each of its built neighbours (4, by pixel sides). Real roofs of a 2D½ map end in
    walls; codes blur them into slopes, and the share falls.
    Unit: none. The share depends on the size of pixels. Range: 0 to 1; a pixel without built
    neighbours is level. Empty map: NaN (nothing is built).
    Source: ours, to see how far coding and breeding wear down roofs.

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
