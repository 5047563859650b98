"""Shapes of trees and lamps: one shape for all objects of a class, scaled to each."""

import math
from functools import cache

import numpy as np
import shapely

from evocity.formats.materials import is_surface
from evocity.formats.solids import FLOOR, ROOF, WALL, Group, Mesh

#: Profiles of forms by class, from the ground to the top: radius by diameter, height by height, and
#: the part above each point.
_PROFILES = {
    "tree": (
        (0.06, 0.0, WALL),
        (0.045, 0.28, ROOF),
        (0.36, 0.3, ROOF),
        (0.5, 0.48, ROOF),
        (0.43, 0.74, ROOF),
        (0.22, 0.94, ROOF),
    ),
    "post": (
        (0.05, 0.0, WALL),
        (0.035, 0.92, WALL),
        (0.13, 0.93, WALL),
        (0.1, 0.99, ROOF),
    ),
}
_SIDES = 7


def form_of(group: Group) -> Mesh | None:
    """Return the shape of all objects of a ``group``, closed and manifold, of the
    diameter 1 and the height 1 about the origin; None if the objects have their own shapes."""
    if group.name not in _PROFILES or group.copies is not None or is_surface(group):
        return None
    return None if "Building" in group.city_objects else _revolve(group.name)


def places_of(group: Group) -> tuple[np.ndarray, np.ndarray]:
    """Return where forms stand: the middle of each polygon, float64 ``(n, 2)``, and the diameter of
    a disc of its area and its height, ``(n, 2)``; metres."""
    middles = shapely.get_coordinates(shapely.centroid(group.polygons))
    diameters = 2 * np.sqrt(shapely.area(group.polygons) / math.pi)
    return middles, np.stack([diameters, group.heights], axis=1)


def mesh_of(group: Group) -> Mesh:
    """Return the triangles of a ``group``, with the common shape in place of each tree and lamp."""
    form = form_of(group)
    if form is None or not len(group):
        return group.mesh
    middles, (diameters, heights) = places_of(group)[0], places_of(group)[1].T
    scale = np.stack([diameters, diameters, heights], axis=1)
    places = np.column_stack([middles, group.lift])
    points = form.points * scale[:, None] + places[:, None]
    count, corners = len(group), len(form.points)
    triangles = form.triangles + (np.arange(count) * corners)[:, None, None]
    return Mesh(
        points=points.reshape(-1, 3),
        triangles=triangles.reshape(-1, 3).astype(np.int32),
        owner=np.repeat(np.arange(count, dtype=np.int32), len(form.triangles)),
        part=np.tile(form.part, count),
    )


@cache
def _revolve(name: str) -> Mesh:
    """Turn a profile about the vertical axis."""
    profile = _PROFILES[name]
    angles = np.arange(_SIDES) * 2 * math.pi / _SIDES
    rings = [
        np.stack([r * np.cos(angles), r * np.sin(angles), np.full(_SIDES, z)], axis=1)
        for r, z, _ in profile
    ]
    points = np.concatenate([[[0.0, 0, 0], [0.0, 0, 1]], *rings])
    here = np.arange(_SIDES)
    after = (here + 1) % _SIDES
    first = 2 + _SIDES * np.arange(len(profile))
    triangles = [np.stack([np.zeros(_SIDES, int), first[0] + after, first[0] + here], axis=1)]
    parts = [FLOOR] * _SIDES
    for k, (_, _, part) in enumerate(profile[:-1]):
        a, b, c, d = first[k] + here, first[k] + after, first[k + 1] + after, first[k + 1] + here
        triangles += [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
        parts += [part] * (2 * _SIDES)
    triangles.append(np.stack([first[-1] + here, first[-1] + after, np.ones(_SIDES, int)], axis=1))
    parts += [profile[-1][2]] * _SIDES
    faces = np.concatenate(triangles).astype(np.int32)
    return Mesh(points, faces, np.zeros(len(faces), np.int32), np.array(parts, np.uint8))
