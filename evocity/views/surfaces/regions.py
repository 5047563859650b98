"""Regions of the ground: carriageways, streets, squares and water, before they are a coverage."""

import numpy as np
import shapely

from evocity.views.connected_components import pieces
from evocity.views.streets import LEAST_WIDTH, StreetGraph
from evocity.views.walls import walls_of

#: How far streets and squares reach beyond the discs of their middle lines, to meet the walls,
#: metres and pixels; the larger counts. Discs leave out dents of walls, and pixels are stairs.
REACH = 2.0, 1.5
#: Share of a street's width for the pavement on each side; its least and greatest width, metres.
PAVEMENT, LEAST_PAVEMENT, MOST_PAVEMENT = 0.19, 0.8, 4.5
#: Half the width of the narrowest carriageway, metres.
LEAST_HALF = 1.25
#: Radius of kerbs at the corners of crossings, metres.
CORNER = 4.0
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
    taken = shapely.Polygon()
    for k, place in enumerate(grown):
        free = shapely.difference(shapely.intersection(place, ground), taken)
        squares[k] = largest(free)
        taken = shapely.union(taken, squares[k])
    return squares


def _without_stairs(polygon: shapely.Polygon, pixel: float) -> shapely.Geometry:
    """Join the middles of the pixels' sides along a polygon's outline, and simplify the lines."""
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        points = shapely.get_coordinates(shapely.segmentize(ring, pixel))
        middles = (points[:-1] + points[1:]) / 2
        rings.append(np.concatenate([middles, middles[:1]]))
    smooth = shapely.buffer(shapely.Polygon(rings[0], rings[1:]), 0)
    return shapely.simplify(smooth, 0.6 * pixel)


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
    the widest kind first.

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
    walls = shapely.buffer(built, LEAST_PAVEMENT, join_style="mitre")
    free = shapely.difference(whole, walls)
    width = np.minimum(graph.width, graph.clear)[chosen]
    aside = np.clip(PAVEMENT * width, LEAST_PAVEMENT, MOST_PAVEMENT)
    halves = np.maximum(width / 2 - aside, LEAST_HALF)
    surfaces = shapely.buffer(lines, halves, quad_segs=4)
    taken: shapely.Geometry = shapely.Polygon()
    carriageways: list[tuple[str, shapely.Geometry]] = []
    kinds, first = np.unique(graph.kind[chosen], return_inverse=True)
    mean = np.bincount(first, width) / np.bincount(first)
    round_ = shapely.union_all(surfaces)
    corners = shapely.difference(
        shapely.buffer(shapely.buffer(round_, CORNER, quad_segs=4), -CORNER, quad_segs=4), round_
    )
    for kind in np.argsort(-mean, kind="stable").tolist():
        own = shapely.union_all(surfaces[first == kind])
        if not carriageways:
            own = shapely.union(own, corners)
        own = shapely.simplify(shapely.intersection(own, free), SIMPLE / 3)
        own = shapely.difference(shapely.intersection(own, free), taken)
        taken = shapely.union(taken, own)
        carriageways.append((str(kinds[kind]), own))
    return whole, carriageways


def largest(shape: shapely.Geometry) -> shapely.Polygon:
    """Return the largest polygon of a result of an overlay; an empty polygon for none."""
    parts, _ = polygons_of(shape)
    return parts[int(np.argmax(shapely.area(parts)))] if len(parts) else shapely.Polygon()


def polygons_of(shapes, least: float = 1e-6) -> tuple[np.ndarray, np.ndarray]:
    """Return the polygons above an area of ``least``, m², in results of overlays, without points
    and lines, and the index of the result of each, int64 ``(k,)``."""
    parts, of = shapely.get_parts(np.atleast_1d(shapes), return_index=True)
    parts, again = shapely.get_parts(parts, return_index=True)  # of a collection's multipolygons
    kept = (shapely.get_type_id(parts) == 3) & (shapely.area(parts) > least)
    return parts[kept], of[again[kept]]
