"""Areas of OpenStreetMap's ways and multipolygons, each with the tags of its building."""

import numpy as np
import shapely

from evocity.io.account import DEGENERATE, INCOMPLETE, NO_POLYGON, UNDERGROUND
from evocity.io.heights import is_building
from evocity.io.openstreetmap.elements import Extract, Relation, Tags, Way
from evocity.io.openstreetmap.parts import replace_outlines
from evocity.io.projection import WGS84
from evocity.io.reader_types import Footprints
from evocity.io.underground import is_underground

ATTRIBUTION = "© OpenStreetMap contributors"


def assemble_areas(extract: Extract) -> Footprints:
    """Assemble the areas of an extract's buildings. Raises ValueError if it has no places."""
    if not extract.located:
        raise ValueError("no nodes in it; of Overpass, ask for `out geom`")
    areas: list[shapely.Geometry] = []
    tags: list[Tags] = []
    account, tagged_outers = extract.account, set()
    for relation in extract.relations.values():
        own, outers = _tags_of(relation, extract)
        tagged_outers.update(outers)
        if is_building(own):
            _take(extract, own, _relation_area(relation, extract), areas, tags)
    for number, way in extract.ways.items():
        if is_building(way[1]) and number not in tagged_outers:
            _take(extract, way[1], _way_area(way, extract), areas, tags)
    polygons, tags = replace_outlines(np.array(areas, dtype=object), tags, account)
    return Footprints(polygons, tags, WGS84, ATTRIBUTION, account=account)


def _take(
    extract: Extract,
    own: Tags,
    area: shapely.Geometry | str,
    areas: list[shapely.Geometry],
    tags: list[Tags],
) -> None:
    """Count a feature with the tags ``own``, and append its ``area``, or drop it for a reason."""
    account = extract.account
    account.features += 1
    if is_underground(own):
        account.drop(UNDERGROUND)
    elif isinstance(area, str):
        account.drop(area)
    else:
        areas.append(area)
        tags.append(own)


def _tags_of(relation: Relation, extract: Extract) -> tuple[Tags, list[int]]:
    """Return the tags of a relation's building, and the outer ways which they are from, if any."""
    members, own = relation
    if is_building(own):
        return own, []
    outers = [way for way, role in members if role != "inner" and way in extract.ways]
    tagged = next((t for way in outers if is_building(t := extract.ways[way][1])), None)
    return (own, []) if tagged is None else (tagged, outers)


def _relation_area(relation: Relation, extract: Extract) -> shapely.Geometry | str:
    """Build the area of a relation from its ways, or return the reason why it has no area."""
    lines: dict[bool, list[shapely.LineString]] = {True: [], False: []}
    missing = False
    for number, role in relation[0]:
        points = extract.points(extract.ways[number][0]) if number in extract.ways else None
        missing = missing or points is None
        if points and len(points) > 1:
            lines[role != "inner"].append(shapely.LineString(points))
    if missing:  # rings that close without the missing ways
        outer, inner = (
            shapely.build_area(shapely.GeometryCollection(lines[role])) for role in (True, False)
        )
        area, reason = shapely.difference(outer, inner), INCOMPLETE
    else:
        # the even-odd rule makes holes of the inner rings
        every = shapely.GeometryCollection(lines[True] + lines[False])
        area, reason = shapely.build_area(every), NO_POLYGON
    return reason if area.is_empty else area


def _way_area(way: Way, extract: Extract) -> shapely.Geometry | str:
    """Make the polygon of a closed way, or return the reason why it has no area."""
    nodes, _ = way
    points = extract.points(nodes)
    if points is None:
        return INCOMPLETE
    if not nodes or nodes[0] != nodes[-1]:
        return NO_POLYGON
    if len(set(points)) < 3:
        return DEGENERATE
    polygon = shapely.Polygon(points)
    # outlines that cross themselves may have the area 0
    return polygon if polygon.area or polygon.convex_hull.area else DEGENERATE
