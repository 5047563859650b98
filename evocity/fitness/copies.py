"""Repetition: places of the source cities that stand more than once on a map, and footprints that
come again."""

import math
from typing import NamedTuple

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import _kernels
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness
from evocity.genome import VOID, Genome
from evocity.isometries import AFFINE

#: Distance, metres, up to which two pixels of a map stand together and not elsewhere.
TOGETHER = 12.0
#: Least area of a building whose footprint counts, m².
LARGE = 100.0
#: Fewest pixels of a footprint that counts.
FEWEST = 25
#: Fewest pixels of a footprint that a raster shows well enough to compare it under any angle.
CLEAR = 100

# Degrees of the moments of `footprints`.
_DEGREES = np.array([2, 2, 3, 3, 4, 4, 4])
# Differences of two rasters of one footprint: of its area, in roots of its pixels; of its moments,
# as if it were a square. Measured on turned and mirrored buildings of the bundled districts: .93
# to .96 of them keep to it, and at most .03 of their different buildings.
_AREA, _MOMENTS = 0.3, 0.008
# Difference of equal moments by rounding.
_ROUNDING = 1e-6
# The second moment of a square of the area 1.
_SQUARE = 1 / 6


@fitness(goal="min", range=(0, 1))
def repetition(city: CityMap, genome: Genome) -> float:
    """Share of built ground whose place of origin in a source city appears again elsewhere on the
    map.

    Each pixel of a decoded map has a place of origin: a source city, and the row and column of a
    pixel of this city. The attributes `parent`, `source` and `turn` of the genome give the place of
    origin of each pixel, through any number of generations. A place of origin is repeated if
    another built pixel shows the same place, or one of the 8 pixels around this place. Two pixels
    count as a repetition only if they are more than 12 m apart on the map, along rows or along
    columns. Open ground that an operator added has no place of origin.

    Maps from a search that mirrors or copies quarters have a high value. Other measures do not show
    copies: `street_distance` and `fabric_distance` stay near 0 even for a map that is full of
    copies.

    Formula: number of built pixels whose place of origin is repeated / number of all built pixels.
    Unit: none. Range: 0 (no place of origin is repeated, as in the code of a source city) to 1.
    Empty map: NaN (nothing is built). Source: our own.

    >>> lone = CityMap(np.pad(np.full((8, 16), 9.0), ((4, 20), (4, 12))), 2.0)
    >>> code = evocity.encode(lone).genome
    >>> repetition(evocity.decode(code).city, genome=code)
    0.0
    """
    built = city.built
    if not built.any():
        return Undefined("nothing is built")
    return float(np.count_nonzero(repeated_places(city, genome)) / np.count_nonzero(built))


def repeated_places(city: CityMap, genome: Genome) -> np.ndarray:
    """Mark the built pixels whose place of origin stands elsewhere on the map too: bool ``(H, W)``.
    See `repetition`. About 2 ms at 256².

    Raises `FitnessError` if the genome has a map of another size than ``city``.
    """
    pixels, places, _ = _trace(city, genome)
    apart = max(2, math.ceil(TOGETHER / city.metres_per_pixel))
    heads = np.zeros((1 << max(1, (max(city.shape) - 1).bit_length()),) * 2, np.int32)
    again = np.zeros(pixels.shape[1], bool)
    following = np.empty(pixels.shape[1], np.int32)
    _kernels.stand_elsewhere(places, pixels, apart, heads, following, again)
    marked = np.zeros(city.shape, bool)
    marked[pixels[0, again], pixels[1, again]] = True
    return marked


class Origins(NamedTuple):
    """The places of origin of the n built pixels of a map that come from a source city.

    rows, columns : int64 ``(n,)``, the pixels on the map.
    number : int64 ``(n,)``, the source city of each, numbered in the order of the different names
        in the genome's `cities`.
    row, column : int64 ``(n,)``, the place in this city, px.
    a : int64 ``(6, n)``, the isometry of each pixel, as `evocity.isometries.AFFINE` has it. One
        pixel down on the map is ``(a[2], a[3])`` in the city, and one along is ``(a[4], a[5])``.
    """

    rows: np.ndarray
    columns: np.ndarray
    number: np.ndarray
    row: np.ndarray
    column: np.ndarray
    a: np.ndarray


def places_of_origin(city: CityMap, genome: Genome) -> Origins:
    """Find the places of origin of the built pixels of a map. About 1 ms at 256².

    Raises `FitnessError` if the genome has a map of another size than ``city``.
    """
    pixels, places, lifs = _trace(city, genome)
    (rows, columns), (number, row, column) = pixels, places
    return Origins(rows, columns, number, row, column, AFFINE[genome.turn].T[:, lifs])


def _trace(city: CityMap, genome: Genome) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the rows and columns of the n built pixels that come from a source city, int64 ``(2,
    n)``; their places of origin, city, row and column, int64 ``(3, n)``; and their lifs."""
    p = genome.pavement
    if city.shape != (p.height, p.width):
        raise FitnessError(
            f"{city.name} has {city.shape[0]} × {city.shape[1]} px, but its genome has "
            f"{p.height} × {p.width} px",
            "the map that the genome decodes to",
            "give the genome of this map",
        )
    names = {name: k for k, name in enumerate(dict.fromkeys(genome.cities))}
    number = np.array([-1 if name == VOID else names[name] for name in genome.cities])
    room = np.count_nonzero(city.built)
    pixels, places = np.empty((2, room), np.int64), np.empty((3, room), np.int64)
    lifs = np.empty(room, np.int32)
    count = _kernels.trace_origins(
        p.index, city.built, number[genome.parent], *p.corners, p.side, genome.source,
        genome.turn, AFFINE, pixels, places, lifs,
    )  # fmt: skip
    if count == room:
        return pixels, places, lifs
    return pixels[:, :count].copy(), places[:, :count].copy(), lifs[:count]


@fitness(goal="min", range=(0, 1), any_site=True)
def repeated_footprints(city: CityMap) -> float:
    """Share of buildings whose footprint occurs again on the map, possibly turned or mirrored.

    Only buildings with at least 100 m² and at least 25 pixels count. Gaps and differences in height
    separate buildings. The measure compares the areas of footprints, and moments that change
    neither with rotation nor with mirroring. A raster shows a small footprint too coarsely for a
    comparison of moments. A footprint of less than 100 pixels is repeated only if another footprint
    equals it pixel by pixel. The comparison pixel by pixel allows turns by 90, 180 and 270 degrees,
    and mirroring.

    Real cities have repeated footprints, for example in rows of equal houses: the bundled districts
    have values up to .05. The measure `repetition` shows copies of any size, but needs the genome.

    Formula: number of buildings with an equal footprint elsewhere on the map / number of all
    buildings that count. The moments of a footprint are \\|Σ z^p z̄^q\\| / n^{1 + (p + q)/2} over
    its n pixels, with z the place of a pixel as a complex number from the centroid. The exponents
    (p, q) of the seven moments are (1, 1), (2, 0), (2, 1), (3, 0), (2, 2), (3, 1) and (4, 0). Two
    footprints of n pixels are equal if the logarithms of their areas differ by at most .3 / √n, and
    each moment differs by at most .008 m^{(p + q)/2}. The factor m is the moment with the exponents
    (1, 1), divided by the same moment of a square, but at least 1. Unit: none. Range: 0 to 1.
    Empty map: NaN, like every map without a building of at least 100 m² and 25 pixels. Source: our
    own; moments that do not change with a rotation, Flusser 2000 (Pattern Recognition
    33:1405-1410).

    >>> heights = np.zeros((64, 64))
    >>> heights[4:12, 4:24] = heights[30:50, 40:48] = heights[30:40, 4:14] = 9
    >>> round(repeated_footprints(CityMap(heights, 2.0)), 2)
    0.67
    """
    count = np.count_nonzero(_counted(city))
    if not count:
        return Undefined(f"no building of {LARGE:.0f} m² and {FEWEST} pixels or more")
    return float(np.count_nonzero(equal_footprints(city)) / count)


def _counted(city: CityMap) -> np.ndarray:
    return city.buildings.area >= max(LARGE, FEWEST * city.metres_per_pixel**2)


def equal_footprints(city: CityMap) -> np.ndarray:
    """Mark the buildings whose footprint comes again, as `repeated_footprints` counts them: bool
    ``(n,)``, in the order of `CityMap.buildings`. About 1 ms at 256²."""
    large = np.flatnonzero(_counted(city))
    pixels, moments = footprint_moments(city)
    pixels, moments = pixels[large], moments[:, large]
    clear = pixels >= CLEAR
    stretched = np.maximum(moments[0] / _SQUARE, 1) ** (_DEGREES[:, None] / 2)
    table = np.concatenate([np.log(pixels)[None], moments])
    slack = np.concatenate([_AREA / np.sqrt(pixels)[None], _MOMENTS * stretched])
    slack = np.where(clear, slack, _ROUNDING)
    order = np.argsort(pixels, kind="stable")
    equal = np.zeros(large.size, bool)
    _kernels.come_again(
        np.ascontiguousarray(table[:, order]), np.ascontiguousarray(slack[:, order]), equal
    )
    marked = np.zeros(len(city.buildings), bool)
    marked[large[order[equal]]] = True
    return marked


def footprint_moments(city: CityMap) -> tuple[np.ndarray, np.ndarray]:
    """Compute the pixels of each building, float64 ``(n,)``, and the moments of its footprint by
    `repeated_footprints`, float64 ``(7, n)``. About 0.5 ms at 256²."""
    table, pixel = city.buildings, city.metres_per_pixel
    pixels = table.area / pixel**2
    sums = np.zeros((len(table), 12))
    _kernels.add_moments(table.labels, table.y / pixel - 0.5, table.x / pixel - 0.5, sums)
    s = sums.T
    lengths = [s[0], np.hypot(s[1], s[2]), np.hypot(s[3], s[4]), np.hypot(s[5], s[6])]
    lengths += [s[7], np.hypot(s[8], s[9]), np.hypot(s[10], s[11])]
    scale = pixels ** (1 + _DEGREES[:, None] / 2)
    return pixels, np.array(lengths) / scale
