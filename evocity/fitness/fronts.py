"""Fronts: the façades that face a street, and the lines on which they stand."""

from typing import NamedTuple

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness import _kernels
from evocity.fitness.measure import Undefined
from evocity.fitness.registry import fitness

#: Width of a common line, metres.
STRIP = 3.0
#: Distance between the viewpoints along a street, metres.
EVERY = 2.0
#: Depth behind the width of a street in which a façade still faces the street, metres.
DEPTH = 12.0
#: Least length of a front, metres.
SHORTEST = 20.0

# Distance along a street, each way, over which its direction is taken, metres.
_SEEN = 8.0


@fitness(goal="max", range=(0, 1), any_site=True)
def frontage(city: CityMap) -> float:
    """Share of street façades that lie within 3 m of the common line of their street front.

    A street front is the set of all façades on one side of an edge of the street graph. The street
    graph contains streets and alleys of 4 m or more, as for `street_distance`. Viewpoints lie on
    the middle line of the street, 2 m apart. From each viewpoint, one ray goes to each side, at a
    right angle to the street. The first wall on a ray is a façade if its distance is less than half
    the median width of the street plus 12 m. The line of a street front runs in the direction in
    which the façades of the front scatter most. A street front of fewer than 10 façades does not
    count.

    Formula: Σ m / Σ n over all street fronts, with n the number of a front's façades, and m the
    largest number of these façades in one strip. The strip is 3 m wide, runs along the line of the
    street front, and lies where it contains the most façades. Unit: none. Range: above 0, to 1 (all
    façades of each street front lie in one strip). The map of Lyon has the value .83, and the map
    of New York has the value .77. Maps have values of about .67 after many generations of breeding
    without selection. Empty map: NaN, like every map without a street front of 20 m. Source: our
    own, after the street walls and setbacks of Araldi & Fusco 2019 (EPB 46:1243-1263).

    >>> heights = np.full((80, 80), 9.0)
    >>> heights[40:45] = 0
    >>> frontage(CityMap(heights, 2.0))
    1.0
    >>> heights[36:40, 20:30] = heights[36:40, 50:60] = 0  # setbacks of 8 m
    >>> frontage(CityMap(heights, 2.0)) < 0.9
    True
    """
    x, y, front = facades(city)
    if not front.size:
        return Undefined(f"no front of {SHORTEST:.0f} m toward a street")
    count = np.bincount(front)
    x, y = (one - (np.bincount(front, one) / count)[front] for one in (x, y))
    spread = np.bincount(front, x * x) - np.bincount(front, y * y)
    turn = np.arctan2(2 * np.bincount(front, x * y), spread)[front] / 2
    off = y * np.cos(turn) - x * np.sin(turn)
    off = off[np.lexsort([off, front])]
    most = np.empty(count.size, np.int64)
    _kernels.fullest_strips(off, np.append(0, np.cumsum(count)), STRIP, most)
    return float(most.sum() / count.sum())


class Facades(NamedTuple):
    """The façades of n rays from streets, in the order of their fronts.

    x, y : float64 ``(n,)``, places on the walls, metres, in the coordinates of `CityMap.outline`.
    front : int64 ``(n,)``, the number of each front, from 0.
    """

    x: np.ndarray
    y: np.ndarray
    front: np.ndarray


def facades(city: CityMap) -> Facades:
    """List the façades of all fronts of 20 m or more. See `frontage`. About 2 ms at 256² once the
    street graph is there."""
    import shapely

    graph, pixel = city.alley_graph, city.metres_per_pixel
    if not len(graph):
        return Facades(np.empty(0), np.empty(0), np.empty(0, np.int64))
    points, edge = shapely.get_coordinates(graph.edges, return_index=True)
    # lengths along all edges, one behind another, with gaps
    steps = np.where(np.diff(edge) == 0, np.hypot(*np.diff(points, axis=0).T), 1.0)
    along = np.append(0, np.cumsum(steps))
    first, last = (along[np.searchsorted(edge, np.arange(len(graph)) + k) - k] for k in (0, 1))
    count = np.maximum(np.rint((last - first) / EVERY), 1).astype(np.int64)
    edge = np.repeat(np.arange(len(graph)), count)
    number = np.arange(edge.size) - np.repeat(np.cumsum(count) - count, count)
    at = first[edge] + (number + 0.5) * ((last - first) / count)[edge]
    back, onward = np.maximum(at - _SEEN, first[edge]), np.minimum(at + _SEEN, last[edge])

    def place(at):
        return np.array([np.interp(at, along, values) for values in points.T])

    eye, way = place(at), place(onward) - place(back)
    way /= np.maximum(np.hypot(*way), 1e-9)
    square = np.array([-way[1], way[0]])
    eye, square = np.tile(eye, 2), np.concatenate([square, -square], axis=1)
    left, top = city.north_west
    start = np.stack([top - eye[1], eye[0] - left]) / pixel
    ray = np.stack([-square[1], square[0]])
    reach = np.tile((graph.clear / 2 + DEPTH)[edge] / pixel, 2)
    distance = np.empty(reach.size)
    _kernels.first_walls(city.built, city.open_ground, start, ray, reach, distance)
    front = np.concatenate([2 * edge, 2 * edge + 1])
    counts = np.bincount(front[distance >= 0], minlength=2 * len(graph))
    kept = np.flatnonzero((distance >= 0) & (counts * EVERY >= SHORTEST)[front])
    kept = kept[np.argsort(front[kept], kind="stable")]
    x, y = eye[:, kept] + square[:, kept] * (distance[kept] * pixel)
    return Facades(x, y, np.unique(front[kept], return_inverse=True)[1].astype(np.int64))
