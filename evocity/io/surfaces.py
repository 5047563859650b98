"""Shadows of surfaces in space: what they cover of a map, seen from above."""

from collections.abc import Iterable, Sequence

import numpy as np
import shapely

from evocity.io.polygon_repair import MOST, crossings

#: Areas up to this are those of walls, m².
WALL = 1e-6

Rings = Sequence[np.ndarray]


def shadow(surfaces: Iterable[Rings], wall: float = WALL) -> shapely.Geometry | None:
    """Unite the ``surfaces``, seen from above; None if all of them are walls.

    surfaces : rings of float ``(n, 2)`` or more columns; the first ring is the outer one.
    wall : area of a wall, in the square of the coordinates' unit.
    """
    areas = [area for rings in surfaces if (area := _project_down(rings, wall)) is not None]
    return shapely.union_all(areas) if areas else None


def sound_rings(rings: Rings) -> tuple[list[np.ndarray], int]:
    """Return the ``rings`` of a polygon without degenerate holes, no rings if the outer ring is
    degenerate, and the number of degenerate rings: those with less than three different points."""
    sound = [ring for ring in rings if len(set(map(tuple, ring.tolist()))) > 2]
    lost = len(rings) - len(sound)
    return (sound if sound and sound[0] is rings[0] else []), lost


def _project_down(rings: Rings, wall: float) -> shapely.Geometry | None:
    if not rings or len(rings[0]) < 3:
        return None
    polygon = shapely.Polygon(rings[0][:, :2], [ring[:, :2] for ring in rings[1:] if len(ring) > 2])
    if not polygon.area > wall:
        return None
    if polygon.is_valid:
        return polygon
    if crossings(polygon) > MOST:
        raise ValueError(f"a surface that crosses itself more than {MOST} times")
    return polygon.buffer(0)
