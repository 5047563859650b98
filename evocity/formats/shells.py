"""Shells: walls and roofs of solids as flat faces in space, for solids that are not prisms."""

from dataclasses import dataclass, replace

import numpy as np
import shapely

from evocity.formats import _kernels

#: Parts of a solid to which faces belong.
FLOOR, WALL, ROOF = 0, 1, 2

# A corner counts as convex above this share of the product of its sides.
_CONVEX = 1e-6


@dataclass(frozen=True, eq=False)
class Shells:
    """Walls and roofs of some solids of a group; a solid with its floor is closed and manifold.

    points : float64 ``(p, 3)``: x, y, z up, metres; corners above the ground.
    corners : int64 ``(c,)``: a point, or -1 - j for point j of the solid's own polygon on the
        ground, counted over its rings as in `evocity.formats.solids.Rings`.
    starts : int64 ``(f + 1,)``: face k has ``corners[starts[k] : starts[k + 1]]``, counterclockwise
        from outside.
    owner : int64 ``(f,)``, rising: the solid of each face.
    part : uint8 ``(f,)``: `WALL` or `ROOF`.
    triangles : int64 ``(t, 3)``: three of a face's corners, as indices of ``corners``.
    of : int64 ``(t,)``, rising: the face of each triangle.
    """

    points: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    owner: np.ndarray
    part: np.ndarray
    triangles: np.ndarray
    of: np.ndarray

    def owned(self, count: int) -> np.ndarray:
        """Mark the solids that have faces here, bool ``(count,)``."""
        owned = np.zeros(count, bool)
        owned[self.owner] = True
        return owned

    def move(self, shift: tuple[float, float]) -> "Shells":
        """Return the faces with x and y less ``shift``, metres; the ground moves with the solids'
        polygons."""
        return replace(self, points=self.points - (*shift, 0.0))

    def take(self, rows: np.ndarray) -> "Shells | None":
        """Return the faces of the solids ``rows``, int ``(k,)``, numbered in their order; None if
        these solids have no faces."""
        first, last = (np.searchsorted(self.owner, rows, side=side) for side in ("left", "right"))
        faces, owner = _spans(first, last)
        if not len(faces):
            return None
        corners, of_corner = _spans(self.starts[faces], self.starts[faces + 1])
        lengths = np.bincount(of_corner, minlength=len(faces))
        starts = np.concatenate([[0], np.cumsum(lengths)])
        low, high = (np.searchsorted(self.of, faces, side=side) for side in ("left", "right"))
        triangles, of = _spans(low, high)
        moved = starts[of] - self.starts[faces[of]]
        return Shells(
            points=self.points,
            corners=self.corners[corners],
            starts=starts,
            owner=owner,
            part=self.part[faces],
            triangles=self.triangles[triangles] + moved[:, None],
            of=of,
        )


def _spans(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all indices from ``first`` to ``last``, and the row of each."""
    counts = last - first
    row = np.repeat(np.arange(len(counts)), counts)
    within = np.arange(len(row)) - np.repeat(np.cumsum(counts) - counts, counts)
    return first[row] + within, row


def triangulate(
    places: np.ndarray, starts: np.ndarray, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Divide flat faces into triangles.

    places : float64 ``(c, 3)``, the corners of all faces, counterclockwise from outside.
    starts : int64 ``(f + 1,)``; part : uint8 ``(f,)``, as of `Shells`.

    Returns int64 ``(t, 3)`` indices of ``places``, the face of each ``(t,)``, rising, and the faces
    whose outline is not simple, bool ``(f,)``. These faces have no triangles.
    """
    flat = flattened(places, starts, part)
    count = np.diff(starts)
    faces = np.arange(len(count))
    first, last = starts[:-1], starts[1:]
    face = np.repeat(faces, count)
    here = np.arange(len(flat))
    ahead, behind = here + 1, here - 1
    ahead[last - 1], behind[first] = first, last - 1
    one, two = flat - flat[behind], flat[ahead] - flat
    turn = one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0]
    size = np.hypot(*one.T) * np.hypot(*two.T)
    convex = np.logical_and.reduceat(turn > _CONVEX * size, first) if len(first) else count > 0
    three, four = convex & (count == 3), convex & (count == 4)
    start = first[three | four]
    triangles = [np.stack([start, start + 1, start + 2], axis=1)]
    start = first[four]
    triangles.append(np.stack([start, start + 2, start + 3], axis=1))
    of = [faces[three | four], faces[four]]
    rest = faces[~(three | four)]
    bad = np.zeros(len(count), bool)
    if len(rest):
        rings = _rings(flat, starts, rest)
        polygons = shapely.polygons(rings)
        simple = shapely.is_valid(polygons) & shapely.is_ccw(rings)
        found, owner = shapely.get_parts(
            shapely.constrained_delaunay_triangles(polygons[simple]), return_index=True
        )
        corner = shapely.get_coordinates(found).reshape(-1, 4, 2)[:, :3]
        own = rest[simple][owner]
        matched = match_corners(corner, own, flat, face)
        whole = np.zeros(len(count), bool)
        numbers = np.bincount(own, minlength=len(count))
        whole[rest[simple]] = numbers[rest[simple]] == count[rest[simple]] - 2
        bad[rest] = ~whole[rest]
        matched, own = matched[whole[own]], own[whole[own]]
        a, b, c = (flat[matched[:, k]] for k in range(3))
        clockwise = (b - a)[:, 0] * (c - a)[:, 1] < (b - a)[:, 1] * (c - a)[:, 0]
        matched[clockwise] = matched[clockwise, ::-1]
        triangles.append(matched)
        of.append(own)
    rows, owners = np.concatenate(triangles), np.concatenate(of)
    order = np.argsort(owners, kind="stable")
    return rows[order], owners[order], bad


def match_corners(
    corner: np.ndarray, own: np.ndarray, flat: np.ndarray, face: np.ndarray
) -> np.ndarray:
    """Find the points of triangles by their exact coordinates: int64 ``(t, 3)``, rows of ``flat``.

    corner : float64 ``(t, 3, 2)``; own : int64 ``(t,)``, the face of each triangle.
    flat : float64 ``(p, 2)``, the points of all faces; face : int64 ``(p,)``, the face of each.
    """
    # 0 and -0 have different bits
    rows, sought = (
        np.column_stack([numbers, (places + 0.0).view(np.int64)])
        for numbers, places in ((face, flat), (np.repeat(own, 3), corner.reshape(-1, 2)))
    )
    table = np.full(1 << max(4, (2 * len(rows)).bit_length()), -1)
    found = np.empty(len(sought), np.int64)
    _kernels.match_rows(rows, sought, table, found)
    return found.reshape(-1, 3)


def flattened(places: np.ndarray, starts: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Project faces on a plane, float64 ``(c, 2)``, counterclockwise from outside: roofs on the
    ground, walls on the vertical plane of their first side, from their first corner on."""
    count = np.diff(starts)
    first = starts[:-1]
    way = places[first + 1, :2] - places[first, :2]
    way = way / np.maximum(np.hypot(*way.T), 1e-12)[:, None]
    wall = np.repeat(part == WALL, count)
    local = places[:, :2] - np.repeat(places[first, :2], count, axis=0)
    along = (local * np.repeat(way, count, axis=0)).sum(axis=1)
    upright = np.stack([along, places[:, 2]], axis=1)
    return np.where(wall[:, None], upright, places[:, :2])


def widths(places: np.ndarray, starts: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Measure how narrow faces are at their narrowest place, metres, float64 ``(f,)``: the least
    distance between a corner and another corner or side. Walls of four corners count their sides
    only."""
    found = np.full(len(part), np.inf)
    tested = np.flatnonzero((part == ROOF) | (np.diff(starts) != 4))
    if len(tested):
        flat = flattened(places, starts, part)
        found[tested] = shapely.minimum_clearance(shapely.polygons(_rings(flat, starts, tested)))
    ahead = np.arange(1, len(places) + 1)
    ahead[starts[1:] - 1] = starts[:-1]
    side = np.linalg.norm(places[ahead] - places, axis=1)
    return np.minimum(found, np.minimum.reduceat(side, starts[:-1])) if len(part) else found


def _rings(flat: np.ndarray, starts: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Make shapely rings of the ``faces``."""
    corners, of = _spans(starts[faces], starts[faces + 1])
    closed = np.concatenate([corners, starts[faces]])
    order = np.argsort(np.r_[of, np.arange(len(faces))], kind="stable")
    index = np.sort(np.r_[of, np.arange(len(faces))])
    return shapely.linearrings(flat[closed[order]], indices=index)


def flatness(places: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Measure the greatest distance of a corner from the mean plane of its face, metres,
    float64 ``(f,)``; the plane has the normal of Newell and passes the mean of the corners."""
    count = np.diff(starts)
    if not len(count):
        return np.zeros(0)
    face = np.repeat(np.arange(len(count)), count)
    middle = np.stack([np.bincount(face, axis) for axis in places.T], axis=1) / count[:, None]
    local = places - middle[face]
    ahead = np.arange(1, len(places) + 1)
    ahead[starts[1:] - 1] = starts[:-1]
    cross = np.cross(local, local[ahead])
    normal = np.stack([np.bincount(face, axis) for axis in cross.T], axis=1)
    normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    away = np.abs((local * normal[face]).sum(axis=1))
    return np.maximum.reduceat(away, starts[:-1])


def slivers(places: np.ndarray, starts: np.ndarray, grain: float) -> np.ndarray:
    """Mark faces that have a thin triangle of three following corners, bool ``(f,)``: so thin that
    corners rounded to ``grain``, metres, tilt it by more than 15 degrees, and so short that it is a
    part of the face's Delaunay triangulation."""
    count = np.diff(starts)
    if not len(count):
        return np.zeros(0, bool)
    face = np.repeat(np.arange(len(count)), count)
    here = np.arange(len(places))
    ahead, behind = here + 1, here - 1
    ahead[starts[1:] - 1], behind[starts[:-1]] = starts[:-1], starts[1:] - 1
    chord = places[ahead] - places[behind]
    length = np.linalg.norm(chord, axis=1)
    area = np.linalg.norm(np.cross(places - places[behind], chord), axis=1)
    high = area / np.maximum(length, 1e-12)
    size = np.linalg.norm(places - places[starts[:-1]][face], axis=1)
    size = np.maximum.reduceat(size, starts[:-1])[face]
    thin = (high < 4 * grain) & (length**2 < 8 * np.maximum(high, grain / 2) * size)
    marked = np.zeros(len(count), bool)
    marked[face[thin]] = True
    return marked
