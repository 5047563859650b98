"""Fractal texture of built ground: box and correlation dimension, lacunarity, autosimilarity."""

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
#: Side of the range blocks, pixels; domain blocks are twice as large.
RANGE = 4
#: Greatest distance of a domain block from its range block, pixels along each axis.
REACH = 12


@fitness(range=(0, 2))
def box_dimension(city: CityMap) -> float:
    """Box-counting dimension of the built ground.

    Formula: −slope of ln N(ε) on ln ε by least squares, with N(ε) the number of boxes of side ε
    that hold a built pixel. The sides ε are the common divisors of the map's height and width in
    pixels, up to half of the map's shorter side. Boxes whose side divides height and width cover
    the map without gaps or overlaps. If height and width have fewer than 4 common divisors, the
    sides are powers of two. If the sides ε are powers of two, N(ε) is the mean over four grids of
    boxes, one grid from each corner of the map. Maps of nearly equal size may have different values
    (Lyon at 2 m/px: 1.901 for 240², 1.838 for 241², 1.887 for 242²). Box dimensions can be compared
    only between maps of equal height and width.
    Unit: none. Range: 0 (a point) to 2 (the plane). The value depends on the size of pixels: finer
    pixels give values nearer to 2. Empty map: NaN, like every map that is too small for three sizes
    of boxes, for example a map of 7 × 7 px. Source: Batty & Longley 1994, Fractal Cities, chapter
    5.

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
    """Correlation dimension of the built ground: how the amount of built ground grows with the
    distance from built pixels.

    Formula: slope of ln N(ε) on ln ε by least squares, with N(ε) = ε² times the share of built
    pixels in all windows of side ε that are centred on built pixels. If a part of a window lies
    outside the map, this part does not count. Windows reach 4, 8, 16, 32 and 64 m from their
    centre, rounded to whole pixels, at least 1 px. Windows larger than the map do not count. Unit:
    none. Range: 0 (single points) upwards; 2 if built ground spreads evenly. Cities have values
    from 1.48 to 1.91.
    Empty map: NaN, like every map in which fewer than three of the five windows fit. Source:
    Grassberger & Procaccia 1983 (Physica D 9:189-208), with the square windows of Thomas,
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
    """How much the amount of built ground varies between windows of 32 m.

    Formula: Λ(r) = ⟨M²⟩ / ⟨M⟩², with M the number of built pixels in a box of side r, and ⟨ ⟩ the
    mean over all places of the box on the map. The side r is 32 m, rounded to whole pixels. Noise
    in which each pixel is built with probability p has the value 1 + (1 − p)/(p r²), with r in
    pixels. Unit: none. Range: 1 (equal amounts in all windows) upwards. Empty map: NaN. The
    lacunarity is NaN for a map that is smaller than the box, or has pixels larger than the box.
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


@fitness(goal="max", range=(0, 1))
def autosimilarity(city: CityMap) -> float:
    """How well the small blocks of a map resemble larger blocks nearby.

    Formula: 1 − mean of (1 − ρ²), with ρ the best correlation of a range block with a shrunk domain
    block under the 8 isometries. Range blocks have 4 × 4 px; blocks of constant height do not
    count. Domain blocks have 8 × 8 px and lie at most 12 px away from the range block. Flat ground
    and low contrast do not raise the value. Unit: none. Range: 0 to 1; noise has a value of about
    0.66, and districts have values of .90 to .97. Empty map: 0, like every map made only of blocks
    without differences in height. Rows and columns beyond the last complete block do not count.
    Source: Marsault 2005 §1.3. The error µ of Marsault 2005, divided by the variance of the block,
    equals 1 − ρ².

    >>> stripes = np.zeros((32, 32))
    >>> stripes[:, 14:18] = 9
    >>> autosimilarity(CityMap(np.zeros((32, 32)), 2.0))
    0.0
    >>> round(autosimilarity(CityMap(stripes, 2.0)), 6)
    1.0
    """
    from evocity.coding.matching import best_correlations

    height, width = (side - side % RANGE for side in city.shape)
    heights = np.ascontiguousarray(city.heights[:height, :width])
    rho2, uniform = best_correlations(heights, RANGE, (2,), REACH)
    return float(rho2[~uniform].mean(dtype=np.float64)) if not uniform.all() else 0.0


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
