"""Polylines of a city: the edge of its fabric, its skyline, its façades, its streets.

Each is float ``(n, 2)``, as for `evocity.shapes`: x to the east and y to the north, in the map's
reference system if it has a place on Earth, else metres from its south-west corner.
"""

import math
from itertools import pairwise

import numpy as np
import shapely

from evocity.citymap import CityMap
from evocity.errors import MapError, check_number
from evocity.views.buildings import outlines
from evocity.views.connected_components import pieces
from evocity.views.ground.space import nearest_built

#: Gaps narrower than twice this, metres, belong to the fabric.
REACH = 12.0
#: Lines shorter than this, metres, are left out.
SHORTEST = 50.0


def fabric_edges(
    city: CityMap, reach: float = REACH, shortest: float = SHORTEST
) -> list[np.ndarray]:
    """Trace closed lines around the fabric and around the open ground within the fabric, the
    longest first.

    The fabric is the morphological closing of the built pixels by a disc with the radius ``reach``,
    metres. Lines connect the middles of pixel sides, so that slanted edges have no steps. At the
    map's border, the lines follow the border. The parameter ``shortest`` is the least length of a
    line, metres; shorter lines are left out.

    Raises `MapError` for negative numbers, and for a map without buildings.
    """
    _check(city, reach=reach, shortest=shortest)
    pixel = city.metres_per_pixel
    fabric = pieces(_close(city.built, reach / pixel))[0]
    rings = [
        ring
        for polygon in outlines(fabric.astype(np.int32), pixel, city.north_west)
        for part in shapely.get_parts(polygon)
        for ring in (part.exterior, *part.interiors)
    ]
    return _clean_lines([_between_middles(ring, pixel) for ring in rings], shortest)


def picture_outline(dark: np.ndarray, reach: float = 0.0) -> np.ndarray:
    """Trace the outline of the largest dark area of a picture, such as the border of a leaf.

    dark : dark pixels of the picture, bool ``(H, W)``.
    reach : half the width of the widest gap that the outline closes, in pixels.

    Return a closed line, float ``(n, 2)``, in pixels from the lower left corner. The line begins
    and ends at its lowest point, where a leaf has its stem. The outline leaves holes of the area
    out.

    Raises `MapError` for a negative ``reach``, and for a picture that is not a mask with dark
    pixels.
    """
    check_number("reach", reach, 0, max(np.shape(dark), default=0), "pixels, 0 or more", MapError)
    dark = np.asarray(dark)
    if dark.ndim != 2 or dark.dtype != bool or not dark.any():
        raise MapError(
            f"the mask of dark pixels has the shape {dark.shape}, or no dark pixel",
            "an array (H, W) of booleans with at least one true value",
            "draw a dark shape on a light ground",
        )
    areas = pieces(_close(np.pad(dark, 1), reach))[0]
    largest = np.bincount(areas[areas > 0]).argmax()
    corner = -1.0, areas.shape[0] - 1.0
    (polygon,) = outlines((areas == largest).astype(np.int32), 1.0, corner)
    part = max(shapely.get_parts(polygon), key=shapely.area)
    ring = _between_middles(part.exterior, 1.0)[:-1]
    ring = np.roll(ring, -int(ring[:, 1].argmin()), axis=0)
    return np.vstack([ring, ring[:1]])


def skyline(city: CityMap, bearing: float) -> np.ndarray:
    """Trace the outline of the roofs against the sky, as seen from far away. The viewer looks in
    the direction ``bearing``, in degrees clockwise from north. Return float ``(n, 2)``: for each of
    n points, the distance from left to right and the height, metres. The distance between
    neighbouring points is the side of a pixel.

    The roof of a pixel is level across the whole pixel. Raises `MapError` if the bearing is not
    finite.
    """
    check_number("bearing", bearing, -math.inf, math.inf, "degrees, a finite number", MapError)
    turn = math.radians(bearing)
    rows, columns = (
        np.arange(n, dtype=float) + 0.5 - n / 2 for n in city.shape
    )  # to the south, to the east
    right = math.cos(turn), -math.sin(turn)  # of a view along (sin, cos): east and north
    across = right[0] * columns[None, :] + right[1] * -rows[:, None]
    half = (abs(right[0]) + abs(right[1])) / 2  # of a pixel's width
    first = math.floor(across.min() - half + 1e-9)
    count = math.ceil(across.max() + half - 1e-9) - first
    heights = np.zeros(count)
    low = np.floor(across - half + 1e-6).astype(int) - first
    for further in range(3):  # a pixel is at most √2 wide
        at = low + further
        seen = (at < count) & (at + first < across + half - 1e-6)
        np.maximum.at(heights, at[seen], city.heights[seen])
    place = (np.arange(count) + 0.5) * city.metres_per_pixel
    return np.column_stack([place, heights])


def facades(city: CityMap, shortest: float = SHORTEST) -> list[np.ndarray]:
    """Trace the straight walls of buildings in ``city.walls`` as closed lines. The lines are the
    outer wall of each building and the walls of its courts, the longest first. The parameter
    ``shortest`` is the least length of a line, metres; shorter lines are left out. Raises
    `MapError` for the same reasons as `fabric_edges`."""
    _check(city, shortest=shortest)
    parts = shapely.get_parts(np.array(city.walls.polygons, dtype=object))
    rings = [ring for part in parts for ring in (part.exterior, *part.interiors)]
    return _clean_lines([shapely.get_coordinates(ring) for ring in rings], shortest)


def street_axes(city: CityMap, shortest: float = SHORTEST) -> list[np.ndarray]:
    """Trace the axes of streets, the longest first. Each line joins edges of ``city.street_graph``
    that continue straight across crossings. The parameter ``shortest`` is the least length of a
    line, metres; shorter lines are left out. Raises `MapError` if ``shortest`` is negative."""
    check_number("shortest", shortest, 0, math.inf, "metres, 0 or more", MapError)
    graph = city.street_graph
    edges = np.array(graph.edges, dtype=object)
    found = []
    for street in np.unique(graph.street):
        joined = shapely.line_merge(shapely.MultiLineString(list(edges[graph.street == street])))
        found += [shapely.get_coordinates(part) for part in shapely.get_parts(joined)]
    return _clean_lines(found, shortest)


def _close(mask: np.ndarray, reach: float) -> np.ndarray:
    """Close the gaps of a ``mask`` by a disc with the radius ``reach``, in pixels."""
    wide = math.ceil(reach) + 2
    padded = np.pad(mask, wide)
    grown = nearest_built(padded)[0] <= reach**2
    closed = (nearest_built(~grown)[0] > reach**2) | padded
    return closed[wide:-wide, wide:-wide]


def _between_middles(ring: shapely.LinearRing, pixel: float) -> np.ndarray:
    """Join the middles of the pixels' sides that a ring follows by straight lines."""
    points = shapely.get_coordinates(ring)
    found = []
    for start, end in pairwise(points):
        sides = round(float(np.abs(end - start).max()) / pixel)
        share = (np.arange(sides)[:, None] + 0.5) / sides
        found.append(start + share * (end - start))
    return np.vstack([*found, found[0][:1]])


def _clean_lines(lines: list[np.ndarray], shortest: float) -> list[np.ndarray]:
    """Drop points that repeat the one before, and short lines; sort by length, descending."""
    lines = [line[np.append(True, (np.diff(line, axis=0) != 0).any(axis=1))] for line in lines]
    lengths = [np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1)).sum() for line in lines]
    order = sorted(range(len(lines)), key=lambda k: -lengths[k])
    return [lines[k] for k in order if len(lines[k]) > 1 and lengths[k] >= shortest]


def _check(city: CityMap, **numbers: float) -> None:
    for name, value in numbers.items():
        check_number(name, value, 0, math.inf, "metres, 0 or more", MapError)
    if not city.built.any():
        raise MapError(f"{city.name} has no building", "a map with buildings", "choose another map")
