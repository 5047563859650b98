"""Outlines that cross themselves, repaired as far as that ends in seconds.

What a repair costs goes with the crossings: about 80 µs and 2 kB each, and 5 000 corners may cross
12 million times.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import shapely
from pyproj.exceptions import ProjError

from evocity.errors import MapError

#: Crossings of one outline, and of all of a file, that are repaired.
MOST, MOST_IN_ALL = 20_000, 60_000

# Pairs of sides that are held in memory at once.
_PAIRS = 1 << 20


def crossings(polygon: shapely.Geometry, most: int = MOST) -> int:
    """How often the sides of a ``polygon`` meet each other, the next ones left out and the last and
    the first of a ring not; counted up to ``most`` + 1."""
    rings = shapely.get_rings(shapely.get_parts(polygon))
    sides = [_sides(shapely.get_coordinates(ring)) for ring in rings]
    every = np.concatenate(sides) if sides else np.empty((0, 2, 2))
    count = len(every)
    if count > 1 << 20:
        return most + 1
    lines = shapely.linestrings(every)
    tree = shapely.STRtree(lines)
    at_once = max(1, _PAIRS // max(count, 1))
    met = 0
    for first in range(0, count, at_once):
        one, other = tree.query(lines[first : first + at_once], predicate="intersects")
        # each pair once; the next side meets at the corner
        met += int(np.count_nonzero(other > one + first + 1))
        if met > most:
            return most + 1
    return met


def mended(polygons: np.ndarray, where: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """``polygons`` that cross themselves repaired, and bool ``(n,)``: those that would take too
    long, which are as they were. ``where``: those that are looked at, all if not given.

    Raises `MapError` where GEOS finds no way.
    """
    polygons = polygons.copy()
    broken = ~shapely.is_valid(polygons)
    if where is not None:
        broken &= where
    tangled, left = np.zeros(len(polygons), bool), MOST_IN_ALL
    for at in np.flatnonzero(broken):
        number = crossings(polygons[at], min(MOST, left))
        if number > min(MOST, left):
            tangled[at] = True
            continue
        left -= number
        polygons[at] = shapely.make_valid(polygons[at], method="structure", keep_collapsed=False)
    return polygons, tangled


@contextmanager
def geometry_trouble(name: str) -> Iterator[None]:
    """Turn what GEOS and PROJ raise of the outlines of the file ``name`` into a `MapError`."""
    try:
        with np.errstate(all="ignore"):  # coordinates beyond all numbers
            yield
    except ProjError as error:
        raise MapError(
            f"{name}: no way from its reference system to metres ({str(error)[:200]})",
            "a reference system that PROJ can compute with",
            "assign the right one, for example with ogr2ogr -a_srs EPSG:…",
        ) from error
    except shapely.errors.ShapelyError as error:
        raise MapError(
            f"{name}: an outline that cannot be computed with ({str(error)[:200]})",
            "polygons of finite corners that do not cross themselves",
            "repair them, for example with the tool Fix geometries of QGIS",
        ) from error


def _sides(points: np.ndarray) -> np.ndarray:
    """Float64 ``(n, 2, 2)``: both ends of each side of a ring, those of no length left out."""
    sides = np.stack([points[:-1], points[1:]], axis=1)
    return sides[(sides[:, 0] != sides[:, 1]).any(axis=1)]


__all__ = ["MOST", "MOST_IN_ALL", "crossings", "geometry_trouble", "mended"]
