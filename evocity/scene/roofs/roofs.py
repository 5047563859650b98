"""Pitched roofs on the buildings of a scene."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import shapely

from evocity.formats import Group
from evocity.formats.shells import ROOF, WALL, Shells, flatness, slivers, triangulate, widths
from evocity.formats.solids import Rings, rings_of
from evocity.io.roof_shapes import SHAPES
from evocity.scene.roofs.choice import (
    FLAT,
    GABLED,
    HIPPED,
    PYRAMIDAL,
    SKILLION,
    WIDEST,
    Choice,
    choose_shapes,
    given_shapes,
    slopes_of,
)
from evocity.scene.roofs.curved import (
    CURVED,
    RoofSurface,
    are_wide,
    curved_roof,
    frame_of,
    rise_of,
)
from evocity.scene.roofs.plans import Sides, sides_of
from evocity.scene.roofs.skeleton import Skeleton, skeleton_of

#: Most distance of a corner from the plane of its face, metres.
FLATNESS = 5e-3
#: Lengths below which sides of roofs become points, metres, in the order of trial.
LEAST = 0.06, 8e-3
#: Least width of a face, metres.
NARROWEST = 4e-3
# Rounding of corners in files, metres, and the most a corner of a narrow face may tilt it.
_GRAIN, _TILT = 7e-4, 0.2
# Parts of a metre to which corners of roofs are rounded.
_PARTS = 5000
#: Most share of a plan under a flat part of a pitched roof.
_DECK = 0.5
# Names of the shapes of roofs.
_NAMES = (*SHAPES, CURVED)


@dataclass(frozen=True, eq=False)
class _Roof:
    """One roof: its skeleton, the weights of its edges, and triangles of its flat part."""

    skeleton: Skeleton
    weights: np.ndarray
    deck: np.ndarray


def raise_roofs(
    groups: Sequence[Group],
    size: tuple[float, float],
    storey: float,
    ridges: bool,
    shapes: np.ndarray | None = None,
    given: np.ndarray | None = None,
    curved: RoofSurface | None = None,
) -> list[Group]:
    """Put pitched roofs on the buildings of a scene.

    groups : the groups of a scene. Solids of CityJSON's type Building may have roofs, except copies
        of objects of a library. Their polygons are a valid coverage.
    size : width and depth of the map, metres. storey : metres.
    ridges : whether the heights of buildings are those of the ridges; otherwise they are those of
        the eaves.
    shapes : float64 ``(m, 4)``, shapes from the source, as of `CityMap.roof_shapes`, but in metres
        from the south-west corner; or None.
    given : int ``(n, 2)``, the roof of each building by its id, as of `evocity.scene.Scene`; it
        comes in place of ``ridges`` and ``shapes``. Or None.
    curved : the form of roofs on wide buildings without pitched roofs; or None.

    Each roof is the weighted straight skeleton of its plan. No roof slopes to a wall that it shares
    with a building that reaches its eaves, and no ridge is farther than 8 m from its eaves: what
    remains inside is flat. A roof whose faces are not flat, simple or closed gives way to eaves on
    all free walls, and then to a flat roof. Groups of buildings get the attributes ``roof``, one of
    `evocity.scene.roofs.SHAPES`, and ``eavesHeight`` in metres.

    Source: Aichholzer et al. 1995 for roofs by straight skeletons. A map of 256² with 300 buildings
    takes about .3 s.
    """
    chosen = [k for k, group in enumerate(groups) if "Building" in group.city_objects]
    if not chosen:
        return list(groups)
    polygons = np.concatenate([groups[k].polygons for k in chosen])
    heights = np.concatenate([groups[k].heights for k in chosen])
    able = np.concatenate([_able(groups[k]) for k in chosen])
    rings = rings_of(polygons)
    stated, ends = given_shapes(polygons, shapes), np.full(len(polygons), ridges)
    if given is not None:
        ids = [number or 0 for k in chosen for number in groups[k].attributes["id"]]
        stated, ends = np.concatenate([[(-1, 0)], given])[ids].T
        ends = ends > 0
    first = rings.starts[rings.first(len(polygons))]
    placed = rings.points
    # each building in metres from its first point, so that its roof is the same all over the map
    own = np.round(placed - placed[first[:-1]][rings.owner], 6)
    polygons = _moved_home(polygons)
    sides = sides_of(rings, heights, size, WIDEST, own)
    choice = choose_shapes(polygons, heights, able, sides, stated)
    rings = replace(rings, points=own)
    made = _Making(polygons, rings, placed, first, heights, sides, choice, storey, ends)
    is_pitched = curved is None or not curved.is_alone
    for moves in (choice.moves, choice.plain) if is_pitched else ():
        for least in LEAST:
            made.attempt(np.flatnonzero(choice.may & (made.shapes == FLAT)), moves, least)
    if curved is not None:
        made.lay(np.flatnonzero(able & (made.shapes == FLAT) & are_wide(polygons, heights)), curved)
    shells = made.shells()
    done, begin = list(groups), 0
    for k in chosen:
        group = groups[k]
        rows = np.arange(begin, begin + len(group))
        begin += len(group)
        named = np.array([kind == "Building" for kind in group.city_objects], bool)
        numbers = zip(made.shapes[rows], named, strict=True)
        shape = [_NAMES[number] if own else None for number, own in numbers]
        eaves = [
            round(float(z), 3) if own else None
            for z, own in zip(made.eaves[rows], named, strict=True)
        ]
        done[k] = replace(
            group,
            heights=made.tops[rows],
            attributes={**group.attributes, "roof": shape, "eavesHeight": eaves},
            roofs=None if shells is None else shells.take(rows),
        )
    return done


def _rounded(points: np.ndarray) -> np.ndarray:
    """Round points so that none lies half way between two millimetres, as files have them."""
    return np.floor(points * _PARTS + 0.5) / _PARTS


def _moved_home(polygons: np.ndarray) -> np.ndarray:
    """Move each polygon so that its first point is the origin."""
    points, of = shapely.get_coordinates(polygons, return_index=True)
    begin = np.searchsorted(of, np.arange(len(polygons)))
    return shapely.set_coordinates(polygons.copy(), np.round(points - points[begin][of], 6))


def count_shapes(groups: Sequence[Group]) -> dict[str, int]:
    """Count the roofs of each of `evocity.scene.roofs.SHAPES`, and the curved roofs, in the groups
    of a scene."""
    shapes = [shape for group in groups for shape in group.attributes.get("roof", [])]
    return {shape: shapes.count(shape) for shape in _NAMES}


def _able(group: Group) -> np.ndarray:
    able = np.array([kind == "Building" for kind in group.city_objects], bool)
    return able if group.copies is None else able & (group.copies.of < 0)


class _Making:
    """Roofs in the making: the shape, height of eaves and top of each building."""

    def __init__(
        self,
        polygons: np.ndarray,
        rings: Rings,
        placed: np.ndarray,
        first: np.ndarray,
        heights: np.ndarray,
        sides: Sides,
        choice: Choice,
        storey: float,
        ridges: np.ndarray,
    ):
        self.polygons, self.rings, self.first, self.sides = polygons, rings, first, sides
        self.placed = placed
        self.choice, self.storey, self.ridges = choice, storey, ridges
        self.after = rings.after
        self.shapes = np.full(len(polygons), FLAT)
        self.eaves, self.tops = heights.astype(np.float64), heights.astype(np.float64)
        self.parts: dict[int, Shells] = {}

    def attempt(self, rows: np.ndarray, moves: np.ndarray, least: float) -> None:
        """Put roofs on the buildings ``rows``, with eaves on the sides that move; edges of roofs
        shorter than ``least``, metres, become points."""
        roofs = {}
        for k in rows.tolist():
            weights = moves[self.sides.of_edge[self.first[k] : self.first[k + 1]]]
            roof = self._roof(k, weights, least)
            if roof is not None:
                roofs[k] = roof
        if not roofs:
            return
        rows = np.array(list(roofs))
        depth, given = np.zeros(len(self.shapes)), self.tops.copy()
        depth[rows] = [roof.skeleton.depth for roof in roofs.values()]
        slopes = slopes_of(depth, given, self.choice, self.storey, self.ridges)
        rises = slopes * depth
        eaves = np.where(self.ridges, given - rises, given)
        pieces = {
            k: self._faces(k, roof, float(slopes[k]), float(eaves[k]))
            for k, roof in roofs.items()
            if slopes[k] > 0
        }
        kept = _check(pieces, self)
        for k in kept:
            self.parts[k] = kept[k]
            self.eaves[k], self.tops[k] = eaves[k], eaves[k] + rises[k]
            self.shapes[k] = self._shape(k, moves, roofs[k].skeleton)

    def lay(self, rows: np.ndarray, roof: RoofSurface) -> None:
        """Put curved roofs on the buildings ``rows``."""
        pieces, ends = {}, {}
        for k in rows.tolist():
            frame, span = frame_of(self.polygons[k]), slice(self.first[k], self.first[k + 1])
            rise = rise_of(roof, frame.width, float(self.tops[k]), bool(self.ridges[k]))
            eaves = float(self.tops[k]) - (rise if self.ridges[k] else 0.0)
            ring, after = self.rings.points[span], self.after[span] - self.first[k]
            made = curved_roof(self.polygons[k], ring, after, frame, roof, eaves, rise)
            if made is not None:
                pieces[k], ends[k] = made, eaves
        self.parts |= (kept := _check(pieces, self))
        for k in kept:
            self.eaves[k], self.tops[k] = ends[k], pieces[k][0][:, 2].max()
            self.shapes[k] = _NAMES.index(CURVED)

    def _roof(self, k: int, weights: np.ndarray, least: float) -> _Roof | None:
        span = slice(self.first[k], self.first[k + 1])
        points, after = self.rings.points[span], self.after[span] - self.first[k]
        if not weights.any():
            return None
        found = skeleton_of(points, after, weights, WIDEST / 2, least)
        if found is None:
            return None
        found.nodes[len(points) :, :2] = _rounded(found.nodes[len(points) :, :2])
        deck = np.empty((0, 3), np.int64)
        if len(found.deck):
            made = _deck(found)
            if made is None:
                return None
            deck, area = made
            if area > _DECK * self.polygons[k].area:
                return None
        return _Roof(found, weights, deck)

    def _faces(self, k: int, roof: _Roof, slope: float, eaves: float):
        """Return points, corners, lengths and parts of the walls and roofs of a building."""
        skeleton, n = roof.skeleton, self.first[k + 1] - self.first[k]
        after = (self.after[self.first[k] : self.first[k + 1]] - self.first[k]).tolist()
        points = skeleton.nodes.copy()
        points[:, 2] = np.round(eaves + slope * points[:, 2], 6)
        corners, starts = skeleton.corners.tolist(), skeleton.starts.tolist()
        faces, parts = [], []
        for e, moves in enumerate((roof.weights > 0).tolist()):
            ring, b = corners[starts[e] : starts[e + 1]], after[e]
            if moves:
                faces += [[-1 - e, -1 - b, b, e], ring]
                parts += [WALL, ROOF]
            else:
                faces.append([-1 - e, -1 - b, *ring[1:], ring[0]])
                parts.append(WALL)
        faces += roof.deck.tolist()
        parts += [ROOF] * len(roof.deck)
        return points, n, faces, parts

    def _shape(self, k: int, moves: np.ndarray, skeleton: Skeleton) -> int:
        if self.choice.mono[k]:
            return SKILLION
        low, high = np.searchsorted(self.sides.owner, (k, k + 1))
        own, hips = moves[low:high] > 0, self.sides.ends[low:high]
        if own.sum() == 1:
            return SKILLION
        court = len(self.polygons[k].interiors) > 0
        if own.all() and not court and not len(skeleton.deck):
            tops = np.maximum.reduceat(skeleton.nodes[skeleton.corners, 2], skeleton.starts[:-1])
            high = skeleton.nodes[skeleton.corners]
            high = high[high[:, 2] > 0.95 * skeleton.depth, :2]
            if tops.min() > 0.85 * skeleton.depth and np.ptp(high, axis=0).max() < skeleton.depth:
                return PYRAMIDAL
        return HIPPED if own.all() or (own & hips).any() else GABLED

    def place(self, k: int, nodes: np.ndarray) -> np.ndarray:
        """Move the nodes of a building to its place on the map."""
        own = self.placed[self.first[k] : self.first[k + 1]]
        points = nodes.copy()
        points[:, :2] += own[0]
        points[: len(own), :2] = own
        return points

    def shells(self) -> Shells | None:
        """Join the faces of all buildings."""
        return _join([(k, self.parts[k]) for k in sorted(self.parts)])


def _deck(skeleton: Skeleton) -> tuple[np.ndarray, float] | None:
    """Return triangles of the flat part, as nodes, and its area; None if its outline is wrong."""
    following = dict(skeleton.deck.tolist())
    if len(following) != len(skeleton.deck):
        return None
    rings, seen = [], set()
    for start in following:
        if start in seen:
            continue
        ring, place = [], start
        while place not in seen:
            seen.add(place)
            ring.append(place)
            place = following.get(place, start)
        if place != start or len(ring) < 3:
            return None
        rings.append(ring)
    flat = skeleton.nodes[:, :2]
    lines = [shapely.LinearRing(flat[ring]) for ring in rings]
    shells = [line for line in lines if line.is_ccw]
    holes = [line for line in lines if not line.is_ccw]
    made = []
    for shell in shells:
        whole = shapely.Polygon(shell)
        own = [hole for hole in holes if len(shells) == 1 or whole.covers(hole)]
        made.append(shapely.Polygon(shell, own))
    if not made or not all(one.is_valid for one in made):
        return None
    nodes = np.concatenate([np.array(ring) for ring in rings])
    index = {tuple(flat[node]): node for node in nodes.tolist()}
    triangles = []
    for one in shapely.get_parts(shapely.constrained_delaunay_triangles(np.array(made))):
        for triangle in shapely.get_parts(one):
            points = shapely.get_coordinates(shapely.orient_polygons(triangle))[:3]
            triangles.append([index[tuple(point)] for point in points])
    return np.array(triangles, np.int64).reshape(-1, 3), float(shapely.area(made).sum())


def _check(pieces: dict, making: _Making) -> dict[int, Shells]:
    """Return the shells of the buildings whose faces are flat, simple and closed."""
    if not pieces:
        return {}
    places, starts, part, owner, corners, points = [], [0], [], [], [], {}
    for k, (nodes, _, faces, parts) in pieces.items():
        ground = np.column_stack(
            [
                making.rings.points[making.first[k] : making.first[k + 1]],
                np.zeros(len(nodes[: making.first[k + 1] - making.first[k]])),
            ]
        )
        flat = np.array([corner for face in faces for corner in face])
        every = np.concatenate([nodes, ground[::-1]])  # -1 is the first point on the ground
        places.append(every[flat])
        corners.append(flat)
        starts += (np.cumsum([len(face) for face in faces]) + starts[-1]).tolist()
        part += parts
        owner += [k] * len(faces)
        points[k] = nodes
    where, begin = np.concatenate(places), np.array(starts)
    kind, whose = np.array(part, np.uint8), np.array(owner)
    triangles, of, bad = triangulate(where, begin, kind)
    away, wide = flatness(where, begin), widths(where, begin, kind)
    bad |= (away > FLATNESS) | (wide < NARROWEST) | (away + _GRAIN > _TILT * wide)
    bad |= slivers(where, begin, _GRAIN)
    wrong = set(whose[bad].tolist())
    # faces cover the plan
    area = np.zeros(len(making.polygons))
    a, b, c = (where[triangles[:, j], :2] for j in range(3))
    cross = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    roof = kind[of] == ROOF
    np.add.at(area, whose[of[roof]], cross[roof] / 2)
    kept = {}
    for k, flat in zip(pieces, corners, strict=True):
        whole = making.polygons[k].area
        if k in wrong or abs(area[k] - whole) > 1e-3 * whole + 0.02:
            continue
        low, high = np.searchsorted(whose, (k, k + 1)).tolist()
        first, last = np.searchsorted(of, (low, high))
        shell = Shells(
            points=making.place(k, points[k]),
            corners=flat,
            starts=begin[low : high + 1] - begin[low],
            owner=np.zeros(high - low, np.int64),
            part=kind[low:high],
            triangles=triangles[first:last] - begin[low],
            of=of[first:last] - low,
        )
        if _closed(shell, making, k):
            kept[k] = shell
    return kept


def _closed(shell: Shells, making: _Making, k: int) -> bool:
    """Return whether a shell and its floor are closed and manifold: each side is once in each
    direction, and Euler's number is that of a solid with a passage for each court."""
    n = making.first[k + 1] - making.first[k]
    after = making.after[making.first[k] : making.first[k + 1]] - making.first[k]
    corners = shell.corners
    ahead = np.arange(1, len(corners) + 1)
    ahead[shell.starts[1:] - 1] = shell.starts[:-1]
    wide = len(shell.points) + n + 1
    one = np.concatenate([corners, -1 - after]) + n
    two = np.concatenate([corners[ahead], -1 - np.arange(n)]) + n
    way, back = one * wide + two, two * wide + one
    if len(np.unique(way)) != len(way) or not np.array_equal(np.sort(way), np.sort(back)):
        return False
    courts = shapely.get_num_interior_rings(making.polygons[k])
    faces = len(shell.starts)  # with the floor
    return len(np.unique(one)) - len(way) // 2 + faces == 2 - courts


def _join(parts: Sequence[tuple[int, Shells]]) -> Shells | None:
    if not parts:
        return None
    points, corners, starts, owner, part, triangles, of = [], [], [0], [], [], [], []
    above = length = faces = 0
    for k, shell in parts:
        used = np.unique(shell.corners[shell.corners >= 0])
        number = np.zeros(len(shell.points), np.int64)
        number[used] = np.arange(len(used)) + above
        points.append(shell.points[used])
        corners.append(np.where(shell.corners < 0, shell.corners, number[shell.corners]))
        starts += (shell.starts[1:] + length).tolist()
        owner.append(np.full(len(shell.part), k))
        part.append(shell.part)
        triangles.append(shell.triangles + length)
        of.append(shell.of + faces)
        above, length, faces = (
            above + len(used),
            length + len(shell.corners),
            faces + len(shell.part),
        )
    return Shells(
        np.concatenate(points),
        np.concatenate(corners),
        np.array(starts),
        np.concatenate(owner),
        np.concatenate(part),
        np.concatenate(triangles),
        np.concatenate(of),
    )
