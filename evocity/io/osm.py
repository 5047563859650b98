"""OpenStreetMap extracts, XML or PBF: areas of buildings and of their parts.

GDAL's driver is not used: it wants nodes before ways before relations, which neither
Overpass nor every tool that cuts extracts keeps to, takes areas that are only a
``building:part`` for lines, and drops what it cannot assemble without a word.
"""

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import shapely

from evocity.errors import MapError
from evocity.io.heights import is_building
from evocity.io.projection import WGS84
from evocity.io.sources import Footprints, Request

ATTRIBUTION = "© OpenStreetMap contributors"

# A multipolygon with no tags but these has those of its outer way: the custom of before 2017.
_SILENT_TAGS = {"type", "source", "created_by", "note", "fixme"}


@dataclass
class Elements:
    """The raw elements of an extract, in any order.

    ``nodes`` holds arrays of ids and of (lon, lat); ``ways`` maps an id to node ids and
    tags; ``relations`` are lists of (way id, role) with tags, multipolygons only.
    """

    nodes: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    ways: dict[int, tuple[Iterable[int], dict[str, str]]] = field(default_factory=dict)
    relations: list[tuple[list[tuple[int, str]], dict[str, str]]] = field(default_factory=list)


def read_osm_xml(path: Path, request: Request) -> Footprints:
    """Read the buildings of an ``.osm`` file."""
    elements = Elements()
    ids, places = [], []
    try:
        for _, element in ElementTree.iterparse(path):
            if element.tag == "node":
                # a deleted node in a file of changes has no place
                if element.get("action") != "delete" and element.get("lat"):
                    ids.append(int(element.get("id")))
                    places.append((float(element.get("lon")), float(element.get("lat"))))
            elif element.tag == "way":
                refs = [int(nd.get("ref")) for nd in element.iter("nd")]
                elements.ways[int(element.get("id"))] = refs, _tags(element)
            elif element.tag == "relation":
                tags = _tags(element)
                if tags.get("type") == "multipolygon":
                    ways = [m for m in element.iter("member") if m.get("type") == "way"]
                    members = [(int(m.get("ref")), m.get("role", "")) for m in ways]
                    elements.relations.append((members, tags))
            else:
                continue
            element.clear()
    except (ElementTree.ParseError, LookupError, ValueError, TypeError, OverflowError) as error:
        raise broken_extract(path, error) from error
    elements.nodes.append((np.array(ids, dtype=np.int64), np.array(places).reshape(-1, 2)))
    return footprints_of(path, elements)


def _tags(element: ElementTree.Element) -> dict[str, str]:
    return {tag.get("k"): tag.get("v") for tag in element.iter("tag")}


def broken_extract(path: Path, error: Exception) -> MapError:
    """What to say about an extract that cannot be read."""
    return MapError(
        f"{path.name} cannot be read as OpenStreetMap data: {error}",
        "a whole extract, as .osm (XML) or .osm.pbf",
        "download it again; it may have been cut off",
    )


def footprints_of(path: Path, elements: Elements) -> Footprints:
    """Assemble areas: closed ways, and multipolygons of ways."""
    if not sum(len(ids) for ids, _ in elements.nodes):
        raise broken_extract(path, ValueError("no nodes in it"))
    ids, places = (np.concatenate(arrays) for arrays in zip(*elements.nodes, strict=True))
    if not np.isfinite(places).all():
        raise broken_extract(path, ValueError("a node has no finite place"))
    order = np.argsort(ids, kind="stable")
    ids, places = ids[order], places[order]
    polygons, tags, outers_told = [], [], set()
    for members, told in elements.relations:
        known = [(way, role) for way, role in members if way in elements.ways]
        if not is_building(told) and _SILENT_TAGS.issuperset(told):
            outer = [way for way, role in known if role != "inner"]
            told = next((t for w in outer if is_building(t := elements.ways[w][1])), told)
            outers_told.update(outer if is_building(told) else ())
        if is_building(told):
            lines = (_line(elements.ways[way][0], ids, places) for way, _ in known)
            # the even-odd rule makes holes of the inner rings
            area = shapely.build_area(
                shapely.GeometryCollection([line for line in lines if line is not None])
            )
            if not area.is_empty:
                polygons.append(area)
                tags.append(told)
    for way, (refs, told) in elements.ways.items():
        if is_building(told) and way not in outers_told and len(refs) and refs[0] == refs[-1]:
            line = _line(refs, ids, places)
            if line is not None and len(line.coords) > 3:
                polygons.append(shapely.Polygon(line))
                tags.append(told)
    return Footprints(np.array(polygons, dtype=object), tags, WGS84, ATTRIBUTION)


def _line(refs: Iterable[int], ids: np.ndarray, places: np.ndarray) -> shapely.LineString | None:
    """A way's line through those of its nodes that are there."""
    refs = np.asarray(refs, dtype=np.int64)
    if len(refs) < 2:
        return None
    at = np.minimum(np.searchsorted(ids, refs), len(ids) - 1)
    points = places[at[ids[at] == refs]]
    distinct = [point for point, _ in itertools.groupby(map(tuple, points.tolist()))]
    return shapely.LineString(distinct) if len(distinct) > 1 else None


__all__ = ["ATTRIBUTION", "Elements", "broken_extract", "footprints_of", "read_osm_xml"]
