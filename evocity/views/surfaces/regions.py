"""Regions of the ground: carriageways, streets, squares and water, before they are a coverage."""

import numpy as np
import shapely

from evocity.views.connected_components import pieces
from evocity.views.streets import LEAST_WIDTH, StreetGraph
from evocity.views.walls import walls_of

#: How far streets and squares reach beyond the discs of their middle lines, to meet the walls,
#: metres and pixels; the larger counts. Discs leave out dents of walls, and pixels are stairs.
REACH = 2.0, 1.5
#: Greatest move of a square's outline to a straight line across the mouth of a street, pixels.
MOUTH = 4.0
#: Greatest depth of a corner between walls that belongs to the square before it, pixels.
POCKET = 5.5
#: Share of a street's width for the pavement on each side; its least and greatest width, metres.
PAVEMENT, LEAST_PAVEMENT, MOST_PAVEMENT = 0.19, 0.8, 4.5
#: Half the width of the narrowest carriageway, metres.
LEAST_HALF = 1.25
#: Radius of kerbs at the corners of crossings, metres.
CORNER = 4.0
#: Least area of such a corner, m²; most parts below it are slivers between two polygons of an arc.
LEAST_CORNER = 0.1
#: Greatest move of an outline on the ground when it becomes simpler, metres.
SIMPLE = 0.3


def square_regions(
    graph: StreetGraph, moved: np.ndarray, ground: shapely.Geometry, pixel: float
) -> np.ndarray:
    """Make the squares of a graph with the walls around them in place of the edges of pixels:
    polygons ``(n,)``, empty for squares without ground. ``ground``: where nothing is built.
    ``moved``: from the graph's coordinates to those of the ground."""
    places = np.array(graph.places.polygons, dtype=object)
    places = shapely.transform(places, lambda p: p + moved)
    smooth = np.array([_without_stairs(place, pixel) for place in places], dtype=object)
    grown = shapely.buffer(smooth, REACH[1] * pixel, join_style="mitre")
    squares = np.full(len(grown), shapely.Polygon(), dtype=object)
    around, outlines = _Near(shapely.get_parts(ground)), _Near(_lines_of(ground))
    others, reach = _Near(grown), MOUTH * pixel
    for k, place in enumerate(grown):
        own = largest(around.within(place))
        own = _with_straight_mouths(own, shapely.multilinestrings(outlines.of(place)), pixel)
        before = others.indices(shapely.buffer(own, reach))
        free = around.within(own)
        squares[k] = largest(_without(free, squares[before[before < k]]))
    taken = _Near(squares)
    joined = shapely.get_parts(shapely.union_all(grown))
    rest = [polygons_of(_without(around.within(one), taken.of(one)))[0] for one in joined]
    squares = _with_parts(squares, _joined(rest), touched=2)
    # corners between walls, into which the discs of a place do not reach
    taken, corners = _Near(squares), []
    deep = shapely.buffer(shapely.union_all(squares), POCKET * pixel, join_style="mitre")
    for one in shapely.get_parts(deep):
        frame = shapely.box(*shapely.bounds(shapely.buffer(one, pixel)))
        left, _ = polygons_of(_without(around.within(frame), taken.of(frame)))
        corners.append(left[shapely.covers(one, left)])
    return _with_parts(squares, _joined(corners), touched=1)


class _Near:
    """Geometries ``(n,)`` that are searched by place."""

    def __init__(self, shapes: np.ndarray):
        self.shapes, self.tree = shapes, shapely.STRtree(shapes)

    def indices(self, place: shapely.Geometry) -> np.ndarray:
        return np.sort(self.tree.query(place))

    def of(self, place: shapely.Geometry) -> np.ndarray:
        return self.shapes[self.indices(place)]

    def within(self, place: shapely.Geometry) -> np.ndarray:
        """Return the parts of the geometries inside a ``place``."""
        return shapely.intersection(self.of(place), place)


def _lines_of(ground: shapely.Geometry) -> np.ndarray:
    """Return each ring around the ``ground`` as a line."""
    return shapely.get_parts(shapely.boundary(shapely.get_parts(ground)))


def _joined(lists: list[np.ndarray]) -> np.ndarray:
    return np.concatenate([np.empty(0, object), *lists])


def _without(shapes: np.ndarray, taken: np.ndarray) -> np.ndarray:
    return shapely.difference(shapes, shapely.union_all(taken)) if len(taken) else shapes


def _without_stairs(polygon: shapely.Polygon, pixel: float) -> shapely.Geometry:
    """Join the middles of the pixels' sides along a polygon's outline, and simplify the lines."""
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        points = shapely.get_coordinates(shapely.segmentize(ring, pixel))
        middles = (points[:-1] + points[1:]) / 2
        rings.append(np.concatenate([middles, middles[:1]]))
    smooth = shapely.buffer(shapely.Polygon(rings[0], rings[1:]), 0)
    return shapely.simplify(smooth, 0.6 * pixel)


def _with_parts(squares: np.ndarray, rest: np.ndarray, touched: int) -> np.ndarray:
    """Give those polygons of the ``rest`` that touch so many squares or more to the square with the
    longest common line."""
    gap, square = shapely.STRtree(squares).query(rest, predicate="intersects")
    enough = np.bincount(gap, minlength=len(rest))[gap] >= touched
    gap, square = gap[enough], square[enough]
    common = shapely.length(shapely.intersection(rest[gap], squares[square]))
    order = np.argsort(common, kind="stable")
    owner = np.full(len(rest), -1)
    owner[gap[order]] = square[order]  # the longest is written last
    joined = squares.copy()
    for k in np.unique(owner[owner >= 0]).tolist():
        joined[k] = shapely.union_all([squares[k], *rest[owner == k]])
    return joined


def _with_straight_mouths(
    square: shapely.Polygon, walls: shapely.Geometry, pixel: float
) -> shapely.Polygon:
    """Close the mouths of streets and other gaps between the ``walls`` around a square by straight
    lines from corner to corner, where its outline deviates less than `MOUTH` from them."""
    if shapely.is_empty(square):
        return square
    rings = [
        _straight_ring(shapely.get_coordinates(ring)[:-1], walls, pixel)
        for ring in (square.exterior, *square.interiors)
    ]
    straight = shapely.Polygon(rings[0], rings[1:])
    return straight if straight.is_valid else square


def _straight_ring(points: np.ndarray, walls: shapely.Geometry, pixel: float) -> np.ndarray:
    """Replace the parts of a ring beside no wall by straight lines, where these are near."""
    sides = np.stack([points, np.roll(points, -1, axis=0)], axis=1)
    free = shapely.distance(walls, shapely.points(sides.mean(axis=1))) > 1e-3
    if free.all() or not free.any():
        return points
    # behind the corner of a wall, a square reaches a little into the street
    behind = ~free & (np.hypot(*(sides[:, 1] - sides[:, 0]).T) <= 2 * REACH[1] * pixel)
    start = int(np.argmin(free))
    points, free, behind = (np.roll(rows, -start, axis=0) for rows in (points, free, behind))
    count, kept = len(points), np.ones(len(points), bool)
    firsts = np.flatnonzero(free & ~np.roll(free, 1))
    lasts = np.flatnonzero(free & ~np.roll(free, -1))
    for first, last in zip(firsts.tolist(), lasts.tolist(), strict=True):
        # from corner to corner; else from and to where the outline leaves the walls
        before, after = int(behind[first - 1]), int(behind[(last + 1) % count])
        for near, far in dict.fromkeys([(before, after), (before, 0), (0, after), (0, 0)]):
            a, b = first - near, last + 1 + far
            if a < 0 or b - a >= count - 1:
                continue
            part = np.arange(a + 1, b) % count
            chord = shapely.linestrings(points[[a, b % count]])
            away = shapely.distance(chord, shapely.points(points[part]))
            if away.max(initial=0.0) <= MOUTH * pixel and not shapely.crosses(chord, walls):
                kept[part] = False
                break
    return points[kept] if np.count_nonzero(kept) > 2 else points


def water_region(
    water: np.ndarray, ground: shapely.Geometry, pixel: float, corner: tuple[float, float]
) -> shapely.Geometry:
    """Make the surface of ``water``, bool ``(H, W)``, with straight shores; where water meets a
    building, its shore is the wall. ``corner``: (x, y) of the north-west corner, metres."""
    labels, count = pieces(water)
    if not count:
        return shapely.Polygon()
    unknown = np.full(count, np.nan)
    detail = min(2 * pixel, 20.0)
    shores = walls_of(labels, np.ones(count), unknown, pixel, corner, detail=detail)
    region = shapely.union_all(np.array(shores.polygons, dtype=object))
    # what is narrower than the pixels' stairs between shore and wall is water too
    reach = REACH[1] * pixel
    left = shapely.difference(ground, region)
    inner = shapely.buffer(shapely.buffer(left, -reach / 2), reach / 2 + 1e-3, join_style="mitre")
    gaps = shapely.difference(left, inner)
    beside = shapely.buffer(region, reach, join_style="mitre")
    return shapely.union(shapely.intersection(region, ground), shapely.intersection(gaps, beside))


def lane_region(
    lanes: StreetGraph, moved: np.ndarray, ground: shapely.Geometry, pixel: float
) -> shapely.Geometry:
    """Make the surface of lanes too narrow for a carriageway (`LEAST_WIDTH`), from wall to wall.
    Lanes lead from street to street; ways that end in a court are a part of the court."""
    narrow = ~np.isin(lanes.kind, ("place", "water")) & (lanes.least < LEAST_WIDTH)
    narrow &= _through(lanes)
    return _to_walls(shapely.transform(lanes.swept(narrow), lambda p: p + moved), ground, pixel)


def _through(graph: StreetGraph) -> np.ndarray:
    """Select the edges that do not lead to dead ends only: bool ``(m,)``."""
    kept = np.ones(len(graph), bool)
    while True:
        degree = np.bincount(graph.ends[kept].ravel(), minlength=len(graph.nodes))
        dead = (degree == 1) & ~graph.at_frame
        ending = kept & dead[graph.ends].any(axis=1)
        if not ending.any():
            return kept
        kept &= ~ending


def _to_walls(swept: np.ndarray, ground: shapely.Geometry, pixel: float) -> shapely.Geometry:
    """Widen surfaces to the walls beside them, and cut them there."""
    whole = shapely.simplify(shapely.union_all(swept), SIMPLE)
    reach = max(REACH[0], REACH[1] * pixel)
    return shapely.intersection(shapely.buffer(whole, reach, join_style="mitre"), ground)


def street_regions(
    graph: StreetGraph,
    moved: np.ndarray,
    ground: shapely.Geometry,
    built: shapely.Geometry,
    pixel: float,
) -> tuple[shapely.Geometry, list[tuple[str, shapely.Geometry]]]:
    """Make the surface of streets from wall to wall, and the carriageways of each kind of street,
    the widest kind first. Carriageways of two kinds overlap at crossings, where the first counts.

    moved : from the graph's coordinates to those of ``ground``, where nothing is built. built : all
    buildings. Edges along squares and in water have no street.

    A carriageway has the same width along an edge. It leaves a `PAVEMENT` on each side of the
    street, and keeps `LEAST_PAVEMENT` from walls.
    """
    chosen = ~np.isin(graph.kind, ("place", "water"))
    if not chosen.any():
        return shapely.Polygon(), []
    swept = shapely.transform(graph.swept(chosen), lambda p: p + moved)
    whole = _to_walls(swept, ground, pixel)
    edges = shapely.transform(np.array(graph.edges, dtype=object)[chosen], lambda p: p + moved)
    lines = shapely.simplify(edges, SIMPLE)
    blocks = shapely.buffer(shapely.get_parts(built), LEAST_PAVEMENT, join_style="mitre")
    free = shapely.difference(whole, shapely.disjoint_subset_union_all(blocks))
    width = np.minimum(graph.width, graph.clear)[chosen]
    aside = np.clip(PAVEMENT * width, LEAST_PAVEMENT, MOST_PAVEMENT)
    halves = np.maximum(width / 2 - aside, LEAST_HALF)
    surfaces = shapely.buffer(lines, halves, quad_segs=4)
    carriageways: list[tuple[str, shapely.Geometry]] = []
    kinds, first = np.unique(graph.kind[chosen], return_inverse=True)
    mean = np.bincount(first, width) / np.bincount(first)
    round_ = shapely.union_all(surfaces)
    corners = shapely.difference(
        shapely.buffer(shapely.buffer(round_, CORNER, quad_segs=4), -CORNER, quad_segs=4), round_
    )
    slivers = shapely.get_parts(corners)  # of arcs that are polygons
    corners = shapely.multipolygons(slivers[shapely.area(slivers) >= LEAST_CORNER])
    for kind in np.argsort(-mean, kind="stable").tolist():
        own = shapely.union_all(surfaces[first == kind])
        if not carriageways:
            own = shapely.union(own, corners)
        own = shapely.simplify(shapely.intersection(own, free), SIMPLE / 3)
        carriageways.append((str(kinds[kind]), shapely.intersection(own, free)))
    return whole, carriageways


def cut_out(ground: shapely.Geometry, areas: np.ndarray) -> shapely.Geometry:
    """Cut ``areas``, polygons ``(n,)``, out of the polygons of the ground that they meet."""
    parts = shapely.get_parts(ground)
    met = np.unique(shapely.STRtree(parts).query(areas, predicate="intersects")[1])
    left = shapely.difference(parts[met], shapely.disjoint_subset_union_all(areas))
    rest, _ = polygons_of(np.concatenate([np.delete(parts, met), left]), 0.0)
    return shapely.multipolygons(rest)


def largest(shapes: shapely.Geometry | np.ndarray) -> shapely.Polygon:
    """Return the largest polygon of results of an overlay; an empty polygon for none."""
    parts, _ = polygons_of(shapes)
    return parts[int(np.argmax(shapely.area(parts)))] if len(parts) else shapely.Polygon()


def polygons_of(shapes, least: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Return the polygons above an area of ``least``, m², in results of overlays, without points
    and lines, and the index of the result of each, int64 ``(k,)``."""
    parts, of = shapely.get_parts(np.atleast_1d(shapes), return_index=True)
    parts, again = shapely.get_parts(parts, return_index=True)  # of a collection's multipolygons
    kept = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > least)
    return parts[kept], of[again[kept]]
