"""Curved roofs on wide buildings: a surface, such as a vault or a dome, on the least rectangle."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
import shapely

from evocity.formats.shells import ROOF, WALL
from evocity.scene.roofs.choice import LOWEST

#: The shape of these roofs, in the attribute ``roof`` of buildings.
CURVED = "surface"
#: Least diameter of the largest circle in a plan, metres: from this span on, halls have shells.
WIDE = 12.0
#: Least share of a plan in its least rectangle, so that the form can be recognised.
FILLED = 0.5
#: Rise of a roof by the shorter side of the rectangle: the usual rise of a barrel vault.
RISE = 0.2
#: Most rise by the height of the eaves, and by the height of the top.
MOST_BY_EAVES, MOST_BY_TOP = 0.8, 0.4
#: Most length of a cell of a roof, metres, and most cells along a side.
CELL, MOST_CELLS = 1.5, 48

# Least distance between corners on the outline, and from the outline to corners inside, cells.
_APART, _INSIDE = 0.25, 0.65
# Most distance by which the outline is bent for triangulation, cells.
_BEND = 2e-3
# Least length of an edge of the outline that is divided once more, metres, and times of division.
_SHORTEST, _ROUNDS = 0.3, 8
# Sides of a rectangle that differ by a smaller share are equal.
_EQUAL = 0.01
# Parts of a metre to which corners are rounded: none lies half way between two millimetres.
_PARTS = 5000


@dataclass(frozen=True, eq=False)
class RoofSurface:
    """The form of curved roofs.

    heights : float64 ``(R, C)``, 0 to 1, as shares of the rise: the first row in the north, the
        columns along the longer side of a building.
    rise : metres, above 0; None means `RISE` of the shorter side.
    is_alone : whether all wide buildings have curved roofs, and all others flat roofs; otherwise
        curved roofs come after pitched roofs, on buildings that have none.
    """

    heights: np.ndarray
    rise: float | None = None
    is_alone: bool = False


@dataclass(frozen=True, eq=False)
class Frame:
    """The least rectangle about a plan.

    middle : float64 ``(2,)``, metres. along, north : unit vectors of the longer side, towards the
        east, and of the shorter side, towards the north. length, width : metres.
    """

    middle: np.ndarray
    along: np.ndarray
    north: np.ndarray
    length: float
    width: float

    def shares(self, points: np.ndarray) -> np.ndarray:
        """Convert ``points`` ``(k, 2)``, metres, to shares of the shorter side from the north, and
        of the longer side from the west."""
        local = points - self.middle
        down = 0.5 - local @ self.north / self.width
        return np.column_stack([down, 0.5 + local @ self.along / self.length])

    def points(self, shares: np.ndarray) -> np.ndarray:
        """Convert ``shares`` to metres."""
        down, right = (shares - 0.5).T
        across = np.outer(-down * self.width, self.north)
        return self.middle + across + np.outer(right * self.length, self.along)


def frame_of(plan: shapely.Polygon) -> Frame:
    """Return the least rectangle about a ``plan``."""
    ring = shapely.get_coordinates(shapely.oriented_envelope(plan))
    sides = ring[1:3] - ring[:2]
    lengths = np.hypot(*sides.T)
    ways = sides / np.maximum(lengths, 1e-9)[:, None]
    k = int(lengths.argmax())
    if abs(lengths[0] - lengths[1]) < _EQUAL * lengths[k]:
        k = int(np.abs(ways[:, 0]).argmax())
    along = ways[k]
    if along[0] < -1e-9 or (abs(along[0]) <= 1e-9 and along[1] > 0):
        along = -along
    north = np.array([-along[1], along[0]])
    middle = ring[:4].mean(axis=0)
    return Frame(middle, along, north, float(lengths[k]), float(lengths[1 - k]))


def are_wide(polygons: np.ndarray, heights: np.ndarray) -> np.ndarray:
    """Mark the plans, objects ``(n,)``, of buildings that may have a curved roof, bool ``(n,)``.
    ``heights``: of the buildings, metres."""
    wide = (heights >= LOWEST) & (shapely.area(polygons) >= np.pi / 4 * WIDE**2)
    if wide.any():
        rows = np.flatnonzero(wide)
        own = polygons[rows]
        # half a millimetre, so that a plan of exactly this width counts
        circles = 2 * shapely.length(shapely.maximum_inscribed_circle(own, tolerance=5e-3))
        filled = shapely.area(own) >= FILLED * shapely.area(shapely.oriented_envelope(own))
        wide[rows] = (circles >= WIDE - 0.02) & filled
    return wide


def rise_of(roof: RoofSurface, width: float, height: float, is_ridge: bool) -> float:
    """Return the rise of a roof on a rectangle of a ``width``, metres, of a building whose
    ``height`` is that of the top (``is_ridge``) or of the eaves."""
    most = (MOST_BY_TOP if is_ridge else MOST_BY_EAVES) * height
    if roof.rise is None:
        return min(RISE * width, most)
    return min(roof.rise, most) if is_ridge else roof.rise


def curved_roof(
    plan: shapely.Polygon,
    ring: np.ndarray,
    after: np.ndarray,
    frame: Frame,
    roof: RoofSurface,
    eaves: float,
    rise: float,
) -> tuple[np.ndarray, int, list[list[int]], list[int]] | None:
    """Lay a surface on a building, clipped at the outline; the walls reach up to it.

    plan : the outline, metres. ring : float64 ``(n, 2)``, its points. after : int64 ``(n,)``, the
        next point of each in its ring. eaves : height of the lowest part of the surface, metres.

    Returns points ``(p, 3)``, the number n of points on the outline's corners, and the corners and
    the part of each face: walls, and triangles of the roof. None if the outline is too intricate.
    """
    sides = frame.width, frame.length
    cells = np.array(
        [_cells(count - 1, side) for count, side in zip(roof.heights.shape, sides, strict=True)]
    )
    chains = [_crossings(ring[e], ring[b], frame, cells) for e, b in enumerate(after.tolist())]
    inside = _rounded(frame.points(_nodes(plan, frame, cells) / cells))
    for _ in range(_ROUNDS):
        flat, edges = _numbered(ring, after, chains)
        every = np.concatenate([flat, inside])
        places = _bent(frame.shares(every) * cells, edges)
        triangles = scipy.spatial.Delaunay(places).simplices
        lost = _lost(triangles, edges, len(every))
        if not len(lost):
            break
        if not _divide(chains, lost, edges, flat):
            return None
    else:
        return None
    outline = _refined(places, edges, after)
    if outline is None:
        return None
    middles = places[triangles].mean(axis=1)
    triangles = _upwards(every, triangles[shapely.contains_xy(outline, *middles.T)])
    shares = frame.shares(every)
    at = (shares * (np.array(roof.heights.shape) - 1)).T
    up = scipy.ndimage.map_coordinates(roof.heights, at, order=1, mode="nearest")
    points = np.column_stack([every, np.round(eaves + _rounded(rise * up), 6)])
    faces, parts, first = [], [], len(ring)
    for e, b in enumerate(after.tolist()):
        between = list(range(first, first + len(chains[e])))
        first += len(chains[e])
        faces.append([-1 - e, -1 - b, b, *between[::-1], e])
        parts.append(WALL)
    faces += triangles.tolist()
    parts += [ROOF] * len(triangles)
    return points, len(ring), faces, parts


def _rounded(values: np.ndarray) -> np.ndarray:
    return np.floor(values * _PARTS + 0.5) / _PARTS


def _cells(steps: int, side: float) -> int:
    """Choose into how many cells to divide a ``side``, metres, so that their corners lie on heights
    of a surface with ``steps`` between its heights."""
    counts = [count for count in range(1, min(steps, MOST_CELLS) + 1) if steps % count == 0]
    fine = [count for count in counts if side / count <= CELL]
    return fine[0] if fine else counts[-1]


def _crossings(start: np.ndarray, end: np.ndarray, frame: Frame, cells: np.ndarray) -> np.ndarray:
    """Return points on an edge at the borders of cells that it crosses, ``(m, 2)``, from ``start``
    on; a steep edge at the rows, another edge at the columns."""
    a, b = frame.shares(np.array([start, end])) * cells
    way = b - a
    axis = int(np.abs(way).argmax())
    low, high = sorted((a[axis], b[axis]))
    lines = np.arange(np.ceil(low + _APART), np.floor(high - _APART) + 1)
    if way[axis] < 0:
        lines = lines[::-1]
    if not len(lines):
        return np.empty((0, 2))
    return _rounded(start + np.outer((lines - a[axis]) / way[axis], end - start))


def _nodes(plan: shapely.Polygon, frame: Frame, cells: np.ndarray) -> np.ndarray:
    """Return the corners of cells inside a plan and not near its outline, ``(k, 2)``, in cells."""
    local = shapely.transform(plan, lambda points: frame.shares(points) * cells)
    counts = tuple((cells + 1).tolist())
    nodes = np.argwhere(np.ones(counts, bool)).astype(np.float64)
    nodes = nodes[shapely.contains_xy(local, *nodes.T)]
    return nodes[shapely.distance(local.boundary, shapely.points(nodes)) >= _INSIDE]


def _numbered(
    ring: np.ndarray, after: np.ndarray, chains: list[np.ndarray]
) -> tuple[np.ndarray, list[list[int]]]:
    """Join the corners of an outline and the points between them, and return for each edge the
    numbers of its points, with both ends."""
    edges, first = [], len(ring)
    for e, b in enumerate(after.tolist()):
        edges.append([e, *range(first, first + len(chains[e])), b])
        first += len(chains[e])
    return np.concatenate([ring, *chains]), edges


def _pairs(edges: list[list[int]]) -> Iterator[tuple[int, int, int, int]]:
    """Yield the edge, the place in it, and both ends of each piece of an outline."""
    for e, edge in enumerate(edges):
        for k in range(len(edge) - 1):
            yield e, k, edge[k], edge[k + 1]


def _lost(triangles: np.ndarray, edges: list[list[int]], wide: int) -> list[tuple[int, int]]:
    """List the pieces of an outline, by edge and place, that are no sides of ``triangles``."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    known = set((sides.min(axis=1) * wide + sides.max(axis=1)).tolist())
    return [(e, k) for e, k, a, b in _pairs(edges) if min(a, b) * wide + max(a, b) not in known]


def _divide(
    chains: list[np.ndarray],
    lost: list[tuple[int, int]],
    edges: list[list[int]],
    flat: np.ndarray,
) -> bool:
    """Divide the ``lost`` pieces in their middles; return whether all were long enough."""
    for e, k in lost[::-1]:
        a, b = flat[edges[e][k]], flat[edges[e][k + 1]]
        if np.hypot(*(b - a)) < _SHORTEST:
            return False
        chains[e] = np.insert(chains[e], k, _rounded((a + b) / 2), axis=0)
    return True


def _bent(places: np.ndarray, edges: list[list[int]]) -> np.ndarray:
    """Move the points between the ends of each edge inwards a little, so that no three points of an
    edge are a triangle of the roof."""
    places = places.copy()
    for edge in edges:
        a, b = places[edge[0]], places[edge[-1]]
        way = b - a
        share = (places[edge[1:-1]] - a) @ way / (way @ way)
        bend = np.outer(4 * _BEND * share * (1 - share), (-way[1], way[0])) / np.hypot(*way)
        places[edge[1:-1]] = a + np.outer(share, way) + bend
    return places


def _refined(
    places: np.ndarray, edges: list[list[int]], after: np.ndarray
) -> shapely.Polygon | None:
    """Return the outline with all its points; None if it is not valid."""
    lines, seen = [], set()
    for start in range(len(edges)):
        line, at = [], start
        while at not in seen:
            seen.add(at)
            line += edges[at][:-1]
            at = int(after[at])
        if line:
            lines.append(places[line])
    polygon = shapely.Polygon(lines[0], lines[1:])
    return polygon if polygon.is_valid else None


def _upwards(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Turn ``triangles`` counterclockwise from above."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    (ax, ay), (bx, by) = (b - a).T, (c - a).T
    down = ax * by < ay * bx
    triangles[down] = triangles[down, ::-1]
    return triangles
