"""Polygon coverage of walls: valid polygons of all labels, with fallbacks where lines cross."""

from dataclasses import dataclass

import numpy as np

from evocity.views.walls import _kernels
from evocity.views.walls.arcs import Arcs
from evocity.views.walls.fitting._kernels import place_nodes
from evocity.views.walls.fitting.lines import TOLERANCE, Lines, node_runs

#: Greatest move of a node from the meeting of three labels, and of a corner from the break of two
#: runs, px.
_MOST = 2.0
#: Grid of corners, metres from the map's south-west corner; or a thousandth of a pixel, if that is
#: less. So files with this precision hold the same valid polygons.
GRAIN = 1e-3
#: Corners of an arc nearer than this to the corner before are left out, steps of the grid:
#: validators take corners within 5 mm for one. No two corners are exactly this far apart.
NEAR = 4.9
#: A wall that turns back to within this of the wall beside it is at fault, steps of the grid:
#: validators take a corner within 1 mm of a wall for a point of this wall.
SPIKE = 2.0
#: Most pixels of a building that must not become a triangle.
FEW = 4
#: Levels of an arc: fitted lines, simplified edges of pixels, edges of pixels.
FITTED, SIMPLIFIED, STAIRS = 0, 1, 2


@dataclass(frozen=True, eq=False)
class Coverage:
    """Polygons of labels.

    polygons : objects ``(n,)``, valid shapely polygons without overlaps; two polygons have the same
        points along a shared wall.
    labels : int32 ``(n,)``: the label of each.
    levels : uint8, of each arc: 0 fitted, 1 simplified by Douglas and Peucker, 2 pixels' edges.
    """

    polygons: np.ndarray
    labels: np.ndarray
    levels: np.ndarray


def build_coverage(
    arcs: Arcs, lines: Lines, metres_per_pixel: float, corner: tuple[float, float]
) -> Coverage:
    """Make polygons of all labels over 0, in metres; ``corner``: (x, y) of the north-west corner.

    Arcs fall back where fitted walls cross, or a polygon is invalid or unlike its pixels: first to
    edges simplified by Douglas and Peucker, then to the pixels' edges. Polygons of pixels' edges
    are valid on any map.
    """
    import shapely  # slow to load

    if not len(arcs):
        return Coverage(np.empty(0, object), np.empty(0, np.int32), np.empty(0, np.uint8))
    nodes = _nodes(arcs, lines)
    rings = _Rings(arcs)
    fixed = arcs.beyond
    # a closed arc of fewer than three lines encloses a pixel or two
    small = arcs.closed & (np.diff(lines.begins) < 3) & (lines.box_of < 0)
    levels = np.where(fixed | small, STAIRS, FITTED).astype(np.uint8)

    # all tests count in steps of the grid, so that they have the same answer all over the map
    grain = min(1.0, metres_per_pixel) * GRAIN
    step = metres_per_pixel / grain
    south_west = corner[0], corner[1] - len(arcs.labels) * metres_per_pixel

    def lay():
        still = np.zeros(len(arcs.nodes), bool)
        stairs = (levels == STAIRS) & ~fixed & ~arcs.closed
        still[arcs.ends[stairs].ravel()] = True
        at = np.where(still[:, None], arcs.nodes, nodes)
        points, starts = _lay_arcs(arcs, lines, at, levels)
        return _drop_near(_to_grid(points, step, len(arcs.labels)), starts, NEAR)

    while True:
        points, starts = lay()
        odd = rings.odd(points, starts, step) & (levels < STAIRS)[:, None]
        if odd.any():
            levels[odd[:, 0]] += 1
            levels[odd[:, 1]] = STAIRS
            continue
        polygons, labels = rings.polygons(points, starts)
        bad = ~shapely.is_valid(polygons)
        edges = shapely.coverage_invalid_edges(polygons)
        bad |= ~(shapely.is_empty(edges) | shapely.is_missing(edges))
        bad |= find_pinched(polygons, 1e-6 / grain)
        bad |= find_spikes(polygons, SPIKE)
        if not bad.any():
            polygons = shapely.remove_repeated_points(polygons)
            placed = shapely.transform(polygons, lambda at: at * grain + south_west)
            bad = ~shapely.is_valid(placed)
            if not bad.any():
                return Coverage(placed, labels, levels)
        wrong = np.unique(labels[bad])
        beside = np.isin(arcs.left, wrong) | np.isin(arcs.right, wrong)
        crossing = _crossing(points, starts, beside) & (levels < STAIRS)
        if not crossing.any():
            crossing = beside & (levels < STAIRS)
        if not crossing.any():  # these have pixels' edges already: their neighbours give way
            crossing = levels < STAIRS
        while crossing.any():  # a test of crossings is quicker than one of validity
            levels[crossing] += 1
            points, starts = lay()
            crossing = _crossing(points, starts, beside) & (levels < STAIRS)


def _to_grid(points: np.ndarray, step: float, rows: int) -> np.ndarray:
    """Convert ``points`` from pixels to whole steps of the grid of `GRAIN`, ``step`` steps a pixel:
    x to the east, y to the north."""
    local = np.column_stack([points[:, 0], rows - points[:, 1]])
    return np.floor(local * step + 0.5)


def _drop_near(
    points: np.ndarray, starts: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Drop corners of arcs that lie within ``least`` of the corner before, or of the arc's end; the
    ends of arcs stay. Equal corners stay, too: arcs of a point are odd."""
    step = points[1:] - points[:-1]
    distance = (step**2).sum(axis=1)
    ends = np.zeros(len(points), bool)
    ends[starts[:-1]] = ends[starts[1:] - 1] = True
    arc = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
    near = (distance < least**2) & (distance > 0) & (arc[1:] == arc[:-1])
    dropped = np.zeros(len(points), bool)
    dropped[1:] = near & ~ends[1:]
    dropped[:-1] |= near & ends[1:] & ~ends[:-1]
    if not dropped.any():
        return points, starts
    before = np.concatenate([[0], np.cumsum(~dropped)])
    return points[~dropped], before[starts]


def find_pinched(polygons: np.ndarray, least: float = 1e-6) -> np.ndarray:
    """Select the polygons that pass a point twice, or come nearer than ``least`` to it: bool
    ``(n,)``. As solids they would have an edge of four walls. Other geometries are not selected."""
    import shapely

    plain = shapely.remove_repeated_points(polygons)
    rings, owner = shapely.get_rings(plain, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    last = np.r_[ring[1:] != ring[:-1], np.ones(min(len(ring), 1), bool)]
    points, owner = points[~last], owner[ring[~last]]
    order = np.lexsort((points[:, 1], points[:, 0], owner))
    points, owner = points[order], owner[order]
    twice = (points[1:] == points[:-1]).all(axis=1) & (owner[1:] == owner[:-1])
    pinches = np.zeros(len(polygons), bool)
    pinches[owner[1:][twice]] = True
    holed = np.flatnonzero(shapely.get_num_interior_rings(plain))  # with a corner on a wall
    pinches[holed] |= shapely.minimum_clearance(plain[holed]) < least
    return pinches


def find_spikes(polygons: np.ndarray, least: float) -> np.ndarray:
    """Select the polygons with a corner at which a wall turns back, and ends within ``least`` of
    the wall before or after: bool ``(n,)``."""
    import shapely

    rings, owner = shapely.get_rings(polygons, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    way = points[1:] - points[:-1]
    whole = (ring[1:] == ring[:-1]) & way.any(axis=1)
    way, of = way[whole], ring[1:][whole]
    # the way after each: the last one of a ring comes before the first
    first = np.r_[True, of[1:] != of[:-1]][: len(of)]
    after = np.roll(np.arange(len(of)), -1)
    last = np.roll(first, -1)
    after[last] = np.flatnonzero(first)
    onward = way[after]
    turn = np.abs(way[:, 0] * onward[:, 1] - way[:, 1] * onward[:, 0])
    longer = np.maximum((way**2).sum(axis=1), (onward**2).sum(axis=1))
    back = (way * onward).sum(axis=1) < 0
    spikes = np.zeros(len(polygons), bool)
    spikes[owner[of[back & (turn**2 < least**2 * longer)]]] = True
    return spikes


def _nodes(arcs: Arcs, lines: Lines) -> np.ndarray:
    """Place the nodes: float64 ``(m, 2)``."""
    nodes = arcs.nodes.astype(np.float64)
    height, width = arcs.labels.shape
    sides = np.zeros(len(nodes), np.int8)
    beyond = np.unique(arcs.ends[arcs.beyond])
    sides[beyond[beyond >= 0]] = 3
    x, y = arcs.nodes.T
    along_x, along_y = (y == 0) | (y == height), (x == 0) | (x == width)
    # on the border of a rectangular map nodes slide
    if not arcs.part:
        sides[along_x & ~along_y] = 1
        sides[along_y & ~along_x] = 2
    which, begins = node_runs(arcs, lines.begins)
    place_nodes(nodes, which, begins, lines.lines, lines.line, sides, _MOST)
    nodes[:, 0] = np.clip(nodes[:, 0], 0, width)
    nodes[:, 1] = np.clip(nodes[:, 1], 0, height)
    return nodes


def _lay_arcs(arcs: Arcs, lines: Lines, nodes, levels) -> tuple[np.ndarray, np.ndarray]:
    points = np.empty((2 * len(arcs.vertices) + 2 * len(arcs), 2))
    starts = np.empty(len(arcs) + 1, np.int64)
    _kernels.lay_arcs(
        arcs.vertices,
        arcs.starts,
        arcs.ends,
        nodes,
        levels,
        lines.runs,
        lines.begins,
        lines.lines,
        lines.line,
        _MOST,
        TOLERANCE[0],
        lines.box_of,
        lines.boxes,
        points,
        starts,
    )
    height, width = arcs.labels.shape
    points = points[: starts[-1]]
    np.clip(points, 0, (width, height), out=points)
    return points, starts


def _crossing(points: np.ndarray, starts: np.ndarray, among: np.ndarray) -> np.ndarray:
    """Select the arcs ``among`` these that cross another of them, or themselves, except at their
    ends: bool ``(n,)``."""
    import shapely

    arc = np.repeat(np.arange(len(among)), np.diff(starts))
    begins = np.flatnonzero((arc[:-1] == arc[1:]) & among[arc[:-1]])
    crossing = np.zeros(len(among), bool)
    if not len(begins):
        return crossing
    ends = np.stack([points[begins], points[begins + 1]], axis=1)
    segments = shapely.linestrings(ends)
    one, other = shapely.STRtree(segments).query(segments, predicate="intersects")
    one, other = one[one < other], other[one < other]
    a, b = ends[one], ends[other]
    # pairs that share an end and diverge from there
    shared = np.zeros(len(one), bool)
    for i in range(2):
        for j in range(2):
            same = (a[:, i] == b[:, j]).all(axis=1)
            u, v = a[:, 1 - i] - a[:, i], b[:, 1 - j] - b[:, j]
            cross = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
            diverge = (cross != 0) | ((u * v).sum(axis=1) < 0)
            shared |= same & diverge
    crossing[arc[begins[one[~shared]]]] = True
    crossing[arc[begins[other[~shared]]]] = True
    return crossing & among


class _Rings:
    """The rings of half arcs around each label: half arc 2a is arc a forwards, with its left label
    on the left; 2a + 1 is arc a backwards."""

    def __init__(self, arcs: Arcs):
        count = len(arcs)
        label = np.stack([arcs.left, arcs.right], axis=1).ravel()
        begin, end = np.empty((2, 2 * count), np.int64)
        begin[0::2], begin[1::2] = arcs.ends[:, 0], arcs.ends[:, 1]
        end[0::2], end[1::2] = arcs.ends[:, 1], arcs.ends[:, 0]
        after = np.arange(2 * count)  # a closed arc follows itself
        halves = np.flatnonzero((begin >= 0) & (label > 0))
        base = int(label.max(initial=0)) + 1
        keys = begin[halves] * base + label[halves]
        order = np.argsort(keys)
        place = np.searchsorted(keys[order], end[halves] * base + label[halves])
        after[halves] = halves[order][place]
        ring_of, order = np.empty((2, 2 * count), np.int64)
        rings = _kernels.follow(after, label, ring_of, order)
        self._order, self._ring_of = order, ring_of
        self._count = int(np.count_nonzero(ring_of >= 0))
        self._labels = np.zeros(rings, np.int32)
        self._labels[ring_of[ring_of >= 0]] = label[ring_of >= 0]
        # by the pixels' edges: shells are left of their arcs, holes right
        corners = arcs.vertices.astype(np.float64)
        corners[:, 1] *= -1
        points, at = self._points(corners, arcs.starts)
        self._shell = _areas(points, at, rings) > 0
        self._pixels = np.bincount(arcs.labels.ravel())

    def _points(self, points: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        most = 2 * len(points) + len(self._labels)
        out, at = np.empty((most, 2)), np.empty(most, np.int64)
        size = _kernels.lay_rings(self._order, self._count, self._ring_of, points, starts, out, at)
        return out[:size], at[:size]

    def odd(self, points, starts, step: float) -> np.ndarray:
        """Select arcs that must fall back: bool ``(arcs, 2)``.

        First column: arcs of rings that turned over or collapsed, and of buildings less than half
        or more than twice as large as their pixels. Second: arcs that are nearly a point, and those
        of triangles for buildings of a few pixels.
        """
        out, at = self._points(points, starts)
        areas = _areas(out, at, len(self._labels))
        same = (at[1:] == at[:-1]) & (out[1:] == out[:-1]).all(axis=1)
        corners = np.bincount(at, minlength=len(areas)) - 1
        corners -= np.bincount(at[1:][same], minlength=len(areas))
        flat = (corners < 3) | (np.where(self._shell, areas, -areas) <= 0)
        share = np.bincount(self._labels, areas, len(self._pixels)) / step**2
        share /= np.maximum(self._pixels, 1)
        unlike = ((share < 0.5) | (share > 2))[self._labels]
        triangle = self._shell & (corners < 4) & (self._pixels[self._labels] <= FEW)
        odd = np.empty((len(starts) - 1, 2), bool)
        for column, of_ring in enumerate((flat | unlike, triangle)):
            of_half = (self._ring_of >= 0) & of_ring[self._ring_of]
            odd[:, column] = of_half.reshape(-1, 2).any(axis=1)
        first, last = points[starts[:-1]], points[starts[1:] - 1]
        odd[:, 1] |= (np.diff(starts) == 2) & (((last - first) ** 2).sum(axis=1) < NEAR**2)
        return odd

    def polygons(self, points, starts) -> tuple[np.ndarray, np.ndarray]:
        """Make polygons, and their labels, of rings that are not `odd`."""
        import shapely

        out, at = self._points(points, starts)
        rings = shapely.linearrings(out, indices=at)
        shells, holes = np.flatnonzero(self._shell), np.flatnonzero(~self._shell)
        polygons = shapely.polygons(rings[shells])
        owner = self._owners(shells, holes, polygons, rings)
        if len(holes):
            order = np.argsort(owner, kind="stable")
            having, first = np.unique(owner[order], return_index=True)
            parts = np.split(rings[holes][order], first[1:])
            for k, inner in zip(having, parts, strict=True):
                polygons[k] = shapely.polygons(rings[shells[k]], inner)
        return polygons, self._labels[shells]

    def _owners(self, shells, holes, polygons, rings) -> np.ndarray:
        """Find the one of the ``shells`` around each of the ``holes``."""
        import shapely

        labels, counts = np.unique(self._labels[shells], return_counts=True)
        of_label = np.full(int(labels.max(initial=0)) + 1, -1)
        of_label[self._labels[shells]] = np.arange(len(shells))
        owner = of_label[self._labels[holes]]
        for label in labels[counts > 1]:  # in parts where it touched itself
            own = np.flatnonzero(self._labels[shells] == label)
            for hole in np.flatnonzero(self._labels[holes] == label):
                inside = shapely.Polygon(rings[holes[hole]]).representative_point()
                areas = [polygons[k].area if polygons[k].covers(inside) else np.inf for k in own]
                owner[hole] = own[int(np.argmin(areas))]
        return owner


def _areas(points: np.ndarray, at: np.ndarray, count: int) -> np.ndarray:
    """Compute the signed area of each ring, above 0 if it runs counter-clockwise."""
    if len(points) < 2:
        return np.zeros(count)
    same = at[1:] == at[:-1]
    twice = points[:-1, 0] * points[1:, 1] - points[1:, 0] * points[:-1, 1]
    return 0.5 * np.bincount(at[:-1][same], twice[same], count)
