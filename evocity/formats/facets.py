"""Flat faces of solids: normals and texture coordinates of their corners."""

from dataclasses import dataclass

import numpy as np

from evocity.formats.solids import ROOF, WALL, Mesh

# Steps of a normal's component within which triangles are of one flat face.
_STEPS = 2000
# The z of a normal above which a face counts as level.
_LEVEL = 0.9999


@dataclass(frozen=True, eq=False)
class Facets:
    """Triangles of flat faces that share no corners with other faces.

    points : float64 ``(p, 3)``, metres, x, y, z up.
    normals : float64 ``(p, 3)``, of length 1, outwards.
    uv : float64 ``(p, 2)``: texture coordinates, v upwards. A wall has the unit of a tile from its
        lower left corner; floors, roofs and ground have metres. On level faces u and v are x and
        y; on slopes u runs along the eaves and v up the slope.
    owner : int ``(p,)``: the solid of each corner.
    triangles : int64 ``(t, 3)``, counterclockwise from outside.
    of : int64 ``(t,)``: the solid of each triangle.
    of_roof : bool ``(t,)``: whether each triangle is of a roof.
    """

    points: np.ndarray
    normals: np.ndarray
    uv: np.ndarray
    owner: np.ndarray
    triangles: np.ndarray
    of: np.ndarray
    of_roof: np.ndarray


def facets(mesh: Mesh, tiles: np.ndarray) -> Facets:
    """Return the flat faces of a ``mesh``.

    Corners and triangles are in the order of their solids, and in a solid walls and floors come
    before roofs.

    tiles : float64, the height of a texture's tile on the walls of each solid, metres.
    """
    owner, roof = mesh.owner.astype(np.int64), mesh.part == ROOF
    major = owner * 2 + roof
    turned = np.round(mesh.normals * _STEPS).astype(np.int64) + _STEPS
    key = ((major << 12 | turned[:, 0]) << 12 | turned[:, 1]) << 12 | turned[:, 2]
    order = np.argsort(key, kind="stable")
    key = key[order]
    corners, part = mesh.triangles[order].astype(np.int64), mesh.part[order]
    first = np.r_[True, key[1:] != key[:-1]][: len(key)]
    face = np.cumsum(first) - 1
    wide = max(len(mesh.points), 1)
    pairs, index = np.unique((face[:, None] * wide + corners).ravel(), return_inverse=True)
    of_face, points = pairs // wide, mesh.points[pairs % wide]
    firsts = np.flatnonzero(first)
    normal = _face_normals(mesh.points[corners], face, len(firsts))[of_face]
    own, of_part = owner[order][firsts][of_face], part[firsts][of_face]
    return Facets(
        points=points,
        normals=normal,
        uv=_texture(points, normal, of_face, of_part, tiles[own]),
        owner=own,
        triangles=index.reshape(-1, 3),
        of=owner[order],
        of_roof=part == ROOF,
    )


def _face_normals(corners: np.ndarray, face: np.ndarray, count: int) -> np.ndarray:
    """Return the mean normal of each of ``count`` faces, weighted by area."""
    a, b, c = (corners[:, k] for k in range(3))
    cross = np.cross(b - a, c - a)
    mean = np.stack([np.bincount(face, cross[:, k], count) for k in range(3)], axis=1)
    length = np.sqrt((mean**2).sum(axis=1, keepdims=True))
    # a face without area has any normal of length 1
    return np.where(length > 0, mean / np.maximum(length, 1e-300), (0.0, 0.0, 1.0))


def _texture(
    points: np.ndarray, normal: np.ndarray, face: np.ndarray, part: np.ndarray, tiles: np.ndarray
) -> np.ndarray:
    x, y, z = points.T
    level = np.abs(normal[:, 2]) > _LEVEL
    flat = np.sqrt(normal[:, 0] ** 2 + normal[:, 1] ** 2)
    east, north = -normal[:, 1] / np.maximum(flat, 1e-9), normal[:, 0] / np.maximum(flat, 1e-9)
    along = x * east + y * north
    # up the slope: the cross product of the normal and the direction along the eaves
    up = (y * east - x * north) * normal[:, 2] + z * flat
    wall = part == WALL
    unit = np.where(wall, tiles, 1.0)
    own = np.stack([along, np.where(wall, z, up)], axis=1) / unit[:, None]
    if len(face):
        starts = np.flatnonzero(np.r_[True, face[1:] != face[:-1]])
        least = np.minimum.reduceat(own[:, 0], starts)
        own[:, 0] -= np.repeat(least, np.diff(np.r_[starts, len(face)]))
    return np.where((level & ~wall)[:, None], np.stack([x, y], axis=1), own)


def pair_walls(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the faces of a ``mesh``: walls of four corners where two triangles make one, all other
    faces of three.

    Four arrays: int ``(q, 4)`` corners, int ``(q,)`` the solid of each; int ``(t, 3)`` corners, int
    ``(t,)`` the row of each in the mesh's triangles.
    """
    wall = np.flatnonzero(mesh.part == WALL)
    first, second = _halves(mesh, wall)
    a, b = mesh.triangles[first], mesh.triangles[second]
    normals = mesh.normals
    paired = (normals[first] * normals[second]).sum(axis=1) > _LEVEL
    single = np.ones(len(mesh.triangles), bool)
    single[first[paired]] = single[second[paired]] = False
    quads = np.column_stack([a[paired], b[paired, 2]])
    rest = np.flatnonzero(single)
    return quads, mesh.owner[first[paired]], mesh.triangles[rest], rest


def _halves(mesh: Mesh, wall: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows of the first and of the second halves of walls of four corners, among the
    rows ``wall``: a side that ends the first begins the second."""
    corners, wide = mesh.triangles[wall].astype(np.int64), max(len(mesh.points), 1)
    ending, beginning = corners[:, 0] * wide + corners[:, 2], corners[:, 0] * wide + corners[:, 1]
    order = np.argsort(beginning, kind="stable")
    at = np.minimum(np.searchsorted(beginning[order], ending), len(wall) - 1)
    other = order[at] if len(wall) else at
    first = np.flatnonzero(beginning[other] == ending)
    second = other[first]
    # a triangle between two others is a part of a larger face
    own, follows = np.zeros(len(wall), bool), np.zeros(len(wall), bool)
    own[first], follows[second] = True, True
    alone = ~(own & follows)
    kept = alone[first] & alone[second] & (mesh.owner[wall[first]] == mesh.owner[wall[second]])
    return wall[first[kept]], wall[second[kept]]
