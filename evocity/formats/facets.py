"""Flat faces of solids: normals and texture coordinates of their corners."""

from dataclasses import dataclass

import numpy as np

from evocity.formats import _kernels
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
    roof, count = mesh.part == ROOF, len(mesh.triangles)
    keys = np.empty(count, np.int64)
    major = mesh.owner.astype(np.int64) * 2 + roof
    _kernels.keys_of_faces(mesh.points, mesh.triangles, major, _STEPS, keys)
    order = np.argsort(keys, kind="stable")
    begins = np.diff(keys[order], prepend=-1) != 0  # keys are 0 or more
    face, firsts = np.cumsum(begins) - 1, order[begins]
    owner, wall = mesh.owner[firsts].astype(np.int64), mesh.part[firsts] == WALL
    index = np.empty((count, 3), np.int64)
    used, of_face = np.empty(3 * count, np.int64), np.empty(3 * count, np.int64)
    normals = np.zeros((len(firsts), 3))
    given = (mesh.points, mesh.triangles[order], face)
    corners = _kernels.corners_of_faces(*given, used, index, of_face, normals)
    points, of_face = mesh.points[used[:corners]], of_face[:corners]
    normal, uv = np.empty((corners, 3)), np.empty((corners, 2))
    _kernels.texture(points, of_face, normals, wall, tiles[owner], _LEVEL, normal, uv)
    return Facets(
        points=points,
        normals=normal,
        uv=uv,
        owner=owner[of_face],
        triangles=index,
        of=mesh.owner[order].astype(np.int64),
        of_roof=roof[order],
    )


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
