"""Fractal texture of built ground: box and correlation dimension, lacunarity."""

import itertools
import math

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness._kernels import count_around, count_boxes, gliding_moments, sum_corner
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Half sides of the windows around built pixels, metres, in which built pixels are counted.
WINDOWS = (4.0, 8.0, 16.0, 32.0, 64.0)
#: Side of the gliding box, metres: a building and its yard.
BOX = 32.0
#: Fewest sizes that give a slope.
FEWEST_SIZES = 3


@fitness(range=(0, 2))
def box_dimension(city: CityMap) -> float:
    """Box-counting dimension of the built ground.

    Formula: −slope of ln N(ε) on ln ε by least squares, with N(ε) the number of boxes of side ε
    that hold a built pixel. The sides, in pixels, are the common divisors of height and width of
    the map, up to half the shorter: the boxes tile the map. With fewer than 4 common divisors, the
    sides are powers of two, and N is the mean over grids from the four corners. So the value
    jumps with the map's size (Lyon at 2 m/px: 1.901 for 240², 1.838 for 241², 1.887 for 242²).
    Compare maps of one size only.
    Unit: none. Range: 0 (a point) to 2 (the plane). The value depends on the size of pixels: finer
    pixels read nearer to 2.
    Empty map: NaN, as on maps too small for three sides, for example all of less than 8 pixels.
    Source: Batty & Longley 1994, Fractal Cities, ch. 5.

    >>> built = np.ones((1, 1))
    >>> for _ in range(5):  # Sierpinski's carpet, ln 8 / ln 3
    ...     built = np.kron(built, [[1, 1, 1], [1, 0, 1], [1, 1, 1]])
    >>> round(box_dimension(CityMap(9 * built, 2.0)), 5)
    1.89279
    """
    if not city.built.any():
        return Undefined("nothing is built")
    sides = _box_sides(*city.shape)
    if len(sides) < FEWEST_SIZES:
        return Undefined("the map is too small for boxes of several sizes")
    sums = _sum_table(city.built)
    slope = _slope(np.log(sides), np.log([_boxes(sums, side) for side in sides]))
    return min(max(0.0, -slope), 2.0)


@fitness(range=(0, math.inf))
def correlation_dimension(city: CityMap) -> float:
    """Correlation dimension of the built ground: how built ground grows around built pixels.

    Formula: slope of ln N(ε) on ln ε by least squares. N(ε) is ε² times the share of built pixels
    in the windows of side ε centred on every built pixel. Only pixels on the map count. Windows
    reach 4, 8, 16, 32 and 64 m from their centre, in whole pixels, at least 1. Windows
    larger than the map do not count.
    Unit: none. Range: 0 (single points) upwards; 2 where built ground spreads evenly. Cities have
    1.48 to 1.91.
    Empty map: NaN, as where fewer than three windows fit pixels and map.
    Source: Grassberger & Procaccia 1983 (Physica D 9:189-208), with the square windows of Thomas,
    Frankhauser & Biernacki 2008 (Landscape and Urban Planning 84:99-115).

    >>> round(correlation_dimension(CityMap(np.full((64, 64), 9.0), 2.0)), 9)
    2.0
    """
    if not city.built.any():
        return Undefined("nothing is built")
    reaches = sorted({round(window / city.metres_per_pixel) for window in WINDOWS})
    reaches = [reach for reach in reaches if 1 <= reach <= (min(city.shape) - 1) // 2]
    if len(reaches) < FEWEST_SIZES:
        return Undefined("fewer than three windows of 4 to 64 m fit its pixels and the map")
    sums = _sum_table(city.built)
    sides = 2 * np.array(reaches) + 1
    shares = [within / room for within, room in (count_around(sums, reach) for reach in reaches)]
    return max(0.0, _slope(np.log(sides), np.log(sides**2 * np.array(shares))))


@fitness(range=(1, math.inf))
def lacunarity(city: CityMap) -> float:
    """How much the gaps in built ground differ, seen through a window of 32 m.

    Formula: Λ(r) = ⟨M²⟩ / ⟨M⟩², with M the number of built pixels in a box of side r = 32 m, whole
    pixels, at every place on the map. Noise built with probability p reads 1 + (1 − p)/(p r²),
    r in pixels.
    Unit: none. Range: 1 (all windows alike) upwards. Empty map: NaN, as where the box is smaller
    than a pixel or larger than the map.
    Source: Allain & Cloitre 1991 (Physical Review A 44:3552-3558).

    >>> stripes = 9.0 * (np.arange(64) // 8 % 2) * np.ones((64, 1))
    >>> lacunarity(CityMap(stripes, 2.0)), round(lacunarity(CityMap(stripes, 4.0)), 4)
    (1.0, 1.3553)
    """
    side = round(BOX / city.metres_per_pixel)
    if not 1 <= side <= min(city.shape):
        return Undefined(f"a box of {BOX:g} m does not fit its pixels and the map")
    if not city.built.any():
        return Undefined("nothing is built")
    first, second = gliding_moments(_sum_table(city.built), side)
    if not first:
        return Undefined(f"no box of {BOX:g} m holds anything built")
    places = (city.shape[0] - side + 1) * (city.shape[1] - side + 1)
    return places * int(second) / int(first) ** 2


def _sum_table(built: np.ndarray) -> np.ndarray:
    """Sum the built pixels north-west of each corner: int64 ``(H + 1, W + 1)``."""
    sums = np.empty((built.shape[0] + 1, built.shape[1] + 1), np.int64)
    sum_corner(built, sums)
    return sums


def _box_sides(height: int, width: int) -> list[int]:
    common, half = math.gcd(height, width), min(height, width) // 2
    sides = [side for side in range(1, half + 1) if common % side == 0]
    return sides if len(sides) >= 4 else [2**k for k in range(half.bit_length())]


def _boxes(sums: np.ndarray, side: int) -> float:
    """Average the number of boxes over the grids from the four corners, which are one grid
    where ``side`` divides the map."""
    rest = [{0, (size - 2) % side - side + 1} for size in sums.shape]  # shape is (H + 1, W + 1)
    counts = [count_boxes(sums, side, top, left) for top, left in itertools.product(*rest)]
    return sum(counts) / len(counts)


def _slope(x: np.ndarray, y: np.ndarray) -> float:
    """Fit a line through y by least squares, and return its slope."""
    x = x - x.mean()
    return float((x * y).sum() / (x * x).sum())
