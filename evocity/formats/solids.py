"""Solids as arrays: prisms on polygons, in metres from a local corner, and their triangles."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import shapely

from evocity.formats.kerbs import kerb_edges
from evocity.formats.shells import FLOOR, ROOF, WALL, Shells, match_corners


@dataclass(frozen=True)
class About:
    """Description of a scene besides its solids: ``name`` and ``attribution`` as of a map, and
    ``measures`` of the map by name.

    crs : its reference system, an authority code or a PROJ string, or None.
    offset, size : (x, y) of the local corner in ``crs``, or (0, 0); (x, y) of the ground, metres.
    grid : for a ``crs`` without a code, a reference system with one, and the function that converts
        float64 ``(n, 2)`` from ``crs`` to it; else None.
    window : for reading a map again: (x, y) of a square window's middle in ``crs``, and metres a
        pixel.
    lod : level of detail of the solids, one of `evocity.scene.detail.LEVELS`.
    """

    name: str
    attribution: str
    crs: str | None
    offset: tuple[float, float]
    size: tuple[float, float]
    window: tuple[float, float, float]
    measures: Mapping[str, float] = field(default_factory=dict)
    grid: tuple[str, Callable[[np.ndarray], np.ndarray]] | None = None
    lod: str = "1.3"


@dataclass(frozen=True, eq=False)
class Copies:
    """Shapes, and the solids of a group that are copies of them, scaled, turned and moved.

    names, polygons, heights : of m shapes: texts, objects ``(m,)`` and float64 ``(m,)``, metres
        about their own origin.
    of : int ``(n,)``, the shape of each solid; -1 for solids that are not copies.
    scales : float64 ``(n, 3)``, along the shape's x, y and z; x below 0 mirrors it.
    turns : float64 ``(n,)``, radians counterclockwise, after scaling.
    places : float64 ``(n, 2)``, metres, the place of the shape's origin.
    """

    names: tuple[str, ...]
    polygons: np.ndarray
    heights: np.ndarray
    of: np.ndarray
    scales: np.ndarray
    turns: np.ndarray
    places: np.ndarray

    def take(self, rows: np.ndarray) -> "Copies":
        """Return the solids at ``rows``, int ``(k,)``, as copies of the same shapes."""
        places = {key: getattr(self, key)[rows] for key in ("of", "scales", "turns", "places")}
        return replace(self, **places)

    @cached_property
    def mesh(self) -> "Mesh":
        """The shapes as triangles."""
        return _mesh(self.polygons, rings_of(self.polygons), self.heights)


@dataclass(frozen=True, eq=False)
class Relief:
    """The ground on which a group stands.

    lift : float64 ``(n,)``, the lowest ground below the outline of each solid or surface, metres.
        Solids move up by it as they are.
    heights : function from places, float64 ``(k, 2)``, metres as of `Group.polygons`, to the
        heights of the ground there, ``(k,)``, metres.
    pieces, of : for surfaces, which follow the ground: their parts, objects ``(m,)``, and the
        surface of each, rising; None for solids.
    """

    lift: np.ndarray
    heights: Callable[[np.ndarray], np.ndarray]
    pieces: np.ndarray | None = None
    of: np.ndarray | None = None

    def take(self, rows: np.ndarray) -> "Relief":
        """Return the ground of the solids or surfaces at ``rows``, int ``(k,)``."""
        if self.pieces is None or self.of is None:
            return replace(self, lift=self.lift[rows])
        number = np.full(len(self.lift), -1)
        number[rows] = np.arange(len(rows))
        own = np.flatnonzero(number[self.of] >= 0)
        own = own[np.argsort(number[self.of[own]], kind="stable")]
        return Relief(self.lift[rows], self.heights, self.pieces[own], number[self.of[own]])


@dataclass(frozen=True, eq=False)
class Group:
    """Solids of one kind and colour: prisms on polygons, surfaces of height 0, or solids with
    pitched roofs.

    name : the kind.
    colour : sRGB, three numbers of 0…1.
    polygons : objects ``(n,)``, valid shapely polygons, metres from the south-west corner, x to the
        east, y to the north.
    heights : float64 ``(n,)``, metres: of the highest points.
    attributes : lists of n values by name: text, whole numbers, numbers, or None.
    city_object : CityJSON's type of all of them; or a list of the type of each.
    copies : the solids that are copies of shapes, also in `polygons` and `heights`; or None.
    floors : whether `mesh` has the floors, which nobody sees.
    roofs : walls and roofs of the solids that have pitched roofs; all others are prisms. None if
        all solids are prisms.
    level : height of surfaces, metres, 0 or less: carriageways lie below the ground beside them.
    kerbs : shapely lines along which a low wall leads from the level of surfaces up to the ground;
        or None.
    relief : the ground on which the group stands; None for flat ground of the height 0.
    """

    name: str
    colour: tuple[float, float, float]
    polygons: np.ndarray
    heights: np.ndarray
    attributes: Mapping[str, list[Any]] = field(default_factory=dict)
    city_object: str | Sequence[str] = "Building"
    copies: Copies | None = None
    floors: bool = True
    roofs: Shells | None = None
    level: float = 0.0
    kerbs: shapely.Geometry | None = None
    relief: Relief | None = None

    def __len__(self) -> int:
        return len(self.polygons)

    def take(self, rows: np.ndarray) -> "Group":
        """Return the solids at ``rows``, int ``(k,)``."""
        kinds = self.city_object
        return replace(
            self,
            polygons=self.polygons[rows],
            heights=self.heights[rows],
            attributes={
                name: [column[row] for row in rows.tolist()]
                for name, column in self.attributes.items()
            },
            city_object=kinds if isinstance(kinds, str) else [kinds[row] for row in rows.tolist()],
            copies=None if self.copies is None else self.copies.take(rows),
            roofs=None if self.roofs is None else self.roofs.take(rows),
            relief=None if self.relief is None else self.relief.take(rows),
        )

    @property
    def city_objects(self) -> Sequence[str]:
        """CityJSON's type of each."""
        kind = self.city_object
        return [kind] * len(self) if isinstance(kind, str) else kind

    @property
    def lift(self) -> np.ndarray:
        """Height of the ground on which each solid stands, metres, float64 ``(n,)``."""
        return np.zeros(len(self)) if self.relief is None else self.relief.lift

    @property
    def is_draped(self) -> bool:
        """Whether the group consists of surfaces that follow a relief."""
        return self.relief is not None and self.relief.pieces is not None

    @property
    def volume(self) -> float:
        """Volume of all, m³."""
        if self.roofs is None:
            return float(shapely.area(self.polygons) @ self.heights)
        mesh = replace(self, relief=None).mesh
        a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
        return float((a * np.cross(b, c)).sum() / 6)

    @cached_property
    def rings(self) -> "Rings":
        """The rings of the polygons."""
        return rings_of(self.polygons)

    @cached_property
    def mesh(self) -> "Mesh":
        """The solids as triangles."""
        polygons, rings, heights = self.polygons, self.rings, self.heights
        relief = self.relief
        if relief is not None and relief.pieces is not None:
            polygons, rings = relief.pieces, rings_of(relief.pieces)
            heights = np.zeros(len(polygons))
        mesh = _mesh(polygons, rings, heights, self.roofs)
        if self.level:
            mesh = _sink(mesh, rings, self.level, self.kerbs)
        if relief is not None:
            mesh = _drape(mesh, relief) if self.is_draped else _raise(mesh, relief.lift)
        return mesh if self.floors else mesh.select(mesh.part != FLOOR)


@dataclass(frozen=True, eq=False)
class Rings:
    """Rings of polygons: shells counterclockwise, holes clockwise, a polygon's shell first.

    points : ``(p, 2)``, x and y, without the repeated point at a ring's end.
    starts : int64 ``(r + 1,)``: ring k has ``points[starts[k] : starts[k + 1]]``.
    of : int64 ``(r,)``, rising: the polygon of each ring.
    """

    points: np.ndarray
    starts: np.ndarray
    of: np.ndarray

    @property
    def owner(self) -> np.ndarray:
        """Int64 ``(p,)``: the polygon of each point."""
        return np.repeat(self.of, np.diff(self.starts))

    @property
    def after(self) -> np.ndarray:
        """Int64 ``(p,)``: the next point of the same ring."""
        following = np.arange(1, len(self.points) + 1)
        following[self.starts[1:] - 1] = self.starts[:-1]
        return following

    def first(self, polygons: int) -> np.ndarray:
        """Index rings, int64 ``(polygons + 1,)``: polygon k has ``first[k]`` to ``first[k + 1] −
        1``."""
        return np.searchsorted(self.of, np.arange(polygons + 1))

    def on_grid(self, grain: float) -> "Rings":
        """Round to whole numbers of ``grain``, int64; drop points that then equal the one before,
        and rings of less than three points."""
        whole = np.round(self.points / grain).astype(np.int64)
        kept = (whole != whole[self.after]).any(axis=1)
        ring = np.repeat(np.arange(len(self.of)), np.diff(self.starts))
        lasting = np.bincount(ring[kept], minlength=len(self.of)) >= 3
        kept &= lasting[ring]
        counts = np.bincount(ring[kept], minlength=len(self.of))[lasting]
        return Rings(whole[kept], np.concatenate([[0], np.cumsum(counts)]), self.of[lasting])


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of solids, each closed and manifold by itself: ``points``, float64 ``(p, 3)``, x,
    y, z up, metres; the solid (``owner``) and `FLOOR`, `WALL` or `ROOF` (``part``) of each triangle
    ``(t,)``.

    triangles : int32 ``(t, 3)``, counterclockwise from outside.
    """

    points: np.ndarray
    triangles: np.ndarray
    owner: np.ndarray
    part: np.ndarray

    def select(self, chosen: np.ndarray) -> "Mesh":
        """Select the triangles ``chosen``, bool ``(t,)``."""
        rows = (self.triangles[chosen], self.owner[chosen], self.part[chosen])
        return Mesh(self.points, *rows)

    @property
    def normals(self) -> np.ndarray:
        """Float64 ``(t, 3)``, of length 1, outwards."""
        cross = self.crosses
        return cross / np.maximum(np.sqrt((cross**2).sum(axis=1, keepdims=True)), 1e-300)

    @property
    def crosses(self) -> np.ndarray:
        """Float64 ``(t, 3)``, the cross product of two sides of each triangle: outwards, of twice
        the triangle's area."""
        (ax, ay, az), b, c = (self.points[self.triangles[:, k]].T for k in range(3))
        (bx, by, bz), (cx, cy, cz) = ((x - ax, y - ay, z - az) for x, y, z in (b, c))
        return np.stack([by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx], axis=1)


def rings_of(polygons: np.ndarray) -> Rings:
    """Return the rings of valid shapely ``polygons``, objects ``(n,)``."""
    polygons = shapely.remove_repeated_points(polygons)
    rings, of = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    if not _are_oriented(points, ring, of):
        rings = shapely.get_rings(shapely.orient_polygons(polygons))
        points = shapely.get_coordinates(rings)
    last = np.r_[ring[1:] != ring[:-1], True] if len(ring) else np.zeros(0, bool)
    counts = np.bincount(ring, minlength=len(of)) - 1
    return Rings(points[~last], np.concatenate([[0], np.cumsum(counts)]), of)


def _are_oriented(points: np.ndarray, ring: np.ndarray, of: np.ndarray) -> bool:
    """Whether closed rings are counterclockwise, and those of holes clockwise. ``ring`` is the ring
    of each of the points, ``of`` the polygon of each ring; the first of a polygon is no hole."""
    if not len(ring):
        return True
    starts = np.flatnonzero(np.diff(ring, prepend=-1))
    x, y = (points - points[starts][ring]).T
    twice = np.add.reduceat(np.append(x[:-1] * y[1:] - x[1:] * y[:-1], 0.0), starts)
    hole = np.diff(of, prepend=-1) == 0
    return bool(np.all((twice < 0) == hole))


def _mesh(
    polygons: np.ndarray, rings: Rings, heights: np.ndarray, roofs: Shells | None = None
) -> Mesh:
    points, owner, after = rings.points, rings.owner, rings.after
    count = len(points)
    prism = np.ones(len(polygons), bool) if roofs is None else ~roofs.owned(len(polygons))
    raised = prism[owner]
    above = count - 1 + np.cumsum(raised, dtype=np.int32)  # the point above each point
    # walls: from each point to the next of its ring
    a = np.flatnonzero((heights[owner] > 0) & raised)
    b = after[a]
    walls = np.empty((2, len(a), 3), np.int32)
    walls[0, :, 0] = walls[1, :, 0] = a
    walls[0, :, 1], walls[1, :, 2] = b, above[a]
    walls[0, :, 2] = walls[1, :, 1] = above[b]
    floor, of_floor = _triangles(polygons, points, owner)
    floor, owner = floor.astype(np.int32), owner.astype(np.int32)
    of_floor = of_floor.astype(np.int32)
    high = heights[of_floor] > 0
    flat = prism[of_floor]
    tops = np.where(high[:, None], above[floor], floor)[flat]
    floors, of_floors = floor[high][:, ::-1], of_floor[high]
    parts = [floors, walls.reshape(-1, 3), tops]
    owners = [of_floors, owner[a], owner[a], of_floor[flat]]
    part = [
        np.full(len(rows), kind, np.uint8)
        for rows, kind in zip(parts, (FLOOR, WALL, ROOF), strict=True)
    ]
    tall = np.column_stack([points, heights[owner]])[raised]
    levels = [np.column_stack([points, np.zeros(count)]), tall]
    if roofs is not None:
        first = rings.starts[rings.first(len(polygons))]
        of_face = np.repeat(np.arange(len(roofs.owner)), np.diff(roofs.starts))
        ground = first[roofs.owner[of_face]] - 1 - roofs.corners
        corner = np.where(roofs.corners < 0, ground, roofs.corners + count + len(tall))
        parts.append(corner[roofs.triangles])
        owners.append(roofs.owner[roofs.of])
        part.append(roofs.part[roofs.of])
        levels.append(roofs.points)
    return Mesh(
        points=np.concatenate(levels),
        triangles=np.concatenate(parts).astype(np.int32, copy=False).reshape(-1, 3),
        owner=np.concatenate(owners).astype(np.int32, copy=False),
        part=np.concatenate(part).astype(np.uint8, copy=False),
    )


def _sink(mesh: Mesh, rings: Rings, level: float, kerbs: shapely.Geometry | None) -> Mesh:
    """Lower the surfaces of a ``mesh`` to ``level``, metres, and add a wall up to the ground on
    each edge of ``rings`` that lies on ``kerbs``. These walls face the surface."""
    points = mesh.points.copy()
    points[:, 2] = level
    a = kerb_edges(rings.points, rings.after, kerbs)
    b = rings.after[a]
    first, second = (len(points) + k * len(a) + np.arange(len(a)) for k in range(2))
    tops = np.concatenate([rings.points[a], rings.points[b]])
    halves = [np.stack([b, a, first], axis=1), np.stack([b, first, second], axis=1)]
    return Mesh(
        points=np.concatenate([points, np.column_stack([tops, np.zeros(len(tops))])]),
        triangles=np.concatenate([mesh.triangles, *halves]).astype(np.int32),
        owner=np.concatenate([mesh.owner, np.tile(rings.owner[a], 2)]).astype(np.int32),
        part=np.concatenate([mesh.part, np.full(2 * len(a), WALL, np.uint8)]),
    )


def _drape(mesh: Mesh, relief: Relief) -> Mesh:
    """Move the points of surfaces up to the ground below each."""
    assert relief.of is not None
    points = mesh.points.copy()
    points[:, 2] += relief.heights(points[:, :2])
    owner = relief.of[mesh.owner].astype(np.int32)
    order = np.argsort(owner, kind="stable")
    return Mesh(points, mesh.triangles[order], owner[order], mesh.part[order])


def _raise(mesh: Mesh, lift: np.ndarray) -> Mesh:
    """Move each solid of a ``mesh`` up by its ``lift``; solids then have points of their own."""
    wide = max(len(mesh.points), 1)
    keys = mesh.owner.astype(np.int64)[:, None] * wide + mesh.triangles
    pairs, number = np.unique(keys, return_inverse=True)
    points = mesh.points[pairs % wide]
    points[:, 2] += lift[pairs // wide]
    return replace(mesh, points=points, triangles=number.reshape(-1, 3).astype(np.int32))


def _triangles(
    polygons: np.ndarray, points: np.ndarray, owner: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Triangulate the polygons: counterclockwise indices of their own ``points``, and the polygon
    of each triangle."""
    if not len(polygons):
        return np.empty((0, 3), np.int64), np.empty(0, np.int64)
    found = shapely.constrained_delaunay_triangles(polygons)
    closed, of = shapely.get_coordinates(found, return_index=True)  # four points a triangle
    corners, of = closed.reshape(-1, 4, 2)[:, :3], of[::4]
    (ax, ay), (bx, by) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
    clockwise = ax * by < ay * bx
    corners[clockwise] = corners[clockwise, ::-1]
    return match_corners(corners, of, points, owner), of
