"""Repair of outlines that cross themselves, as far as it ends in seconds: it costs about 80 µs and
2 kB for each crossing, and 5 000 corners may cross 12 million times."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import shapely
from pyproj.exceptions import ProjError

from evocity.errors import MapError

#: The most crossings to repair: of an outline, and of a file.
MOST, MOST_IN_ALL = 20_000, 60_000

# An outline is degenerate if its convex hull has at most this share of its length's square.
_THINNEST = 1e-12

# Pairs of sides in memory at once.
_PAIRS = 1 << 20


def crossings(polygon: shapely.Geometry, most: int = MOST) -> int:
    """Count how often sides of a ``polygon`` meet, up to ``most`` + 1. A side and the next do not
    count; the last and the first side of a ring do."""
    rings = shapely.get_rings(shapely.get_parts(polygon))
    points, of = shapely.get_coordinates(rings, return_index=True)
    every = np.stack([points[:-1], points[1:]], axis=1)
    # both ends of each side of a ring, without sides of length 0
    every = every[(of[1:] == of[:-1]) & (every[:, 0] != every[:, 1]).any(axis=1)]
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


def are_degenerate(polygons: np.ndarray) -> np.ndarray:
    """Tell which of the ``polygons`` have no area, because all points of each of their parts lie on
    a line: bool ``(n,)``. Empty polygons are not among them."""
    with np.errstate(invalid="ignore"):
        thin = ~(shapely.area(polygons) > _THINNEST * shapely.length(polygons) ** 2)
    for at in np.flatnonzero(thin & ~shapely.is_empty(polygons)):
        # a ring that crosses itself like an eight has the area 0, but its hull has an area
        hulls = shapely.convex_hull(shapely.get_parts(polygons[at]))
        lengths = shapely.length(hulls)
        thin[at] = not (shapely.area(hulls) > _THINNEST * lengths**2).any()
        thin[at] &= bool(np.isfinite(lengths).all())
    return thin & ~shapely.is_empty(polygons)


def repair_polygons(
    polygons: np.ndarray, where: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Repair ``polygons`` that cross themselves. Also return bool ``(n,)``: those that would take
    too long, and stay as they are. ``where``: the polygons to check, default all. Raises what GEOS
    raises where it cannot repair."""
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
def geometry_errors(name: str) -> Iterator[None]:
    """Turn errors of GEOS and PROJ about outlines of the file ``name`` into a `MapError`."""
    try:
        with np.errstate(all="ignore"):  # coordinates beyond all numbers
            yield
    except ProjError as error:
        raise MapError(
            f"{name}: its reference system cannot be converted to metres ({str(error)[:200]})",
            "a reference system that PROJ can convert",
            "assign the right reference system, for example with ogr2ogr -a_srs EPSG:…",
        ) from error
    except shapely.errors.ShapelyError as error:
        raise MapError(
            f"{name}: GEOS cannot process an outline ({str(error)[:200]})",
            "polygons with finite coordinates that do not cross themselves",
            "repair the polygons, for example with the tool Fix geometries of QGIS",
        ) from error
