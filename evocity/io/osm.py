"""OpenStreetMap extracts, XML or PBF: areas of buildings and of their parts.

pyosmium reads the elements in three passes, so that they may come in any order; shapely assembles
the areas. GDAL's driver and osmium's own assembler need nodes before ways, and lose some areas.
"""

import bz2
import gzip
import itertools
import zlib
from pathlib import Path

import numpy as np
import osmium
import shapely

from evocity.errors import MapError
from evocity.io.heights import is_building
from evocity.io.projection import WGS84
from evocity.io.reader_types import Footprints, Request

ATTRIBUTION = "© OpenStreetMap contributors"

# A multipolygon with only these tags has those of its outer way: the custom before 2017.
_SILENT_TAGS = {"type", "source", "created_by", "note", "fixme"}

_FORMATS = ("pbf", "osm.gz", "osm.bz2", "osm")

# A packed file may grow by this factor, and always up to so many bytes.
_DENSEST, _LEAST_BOMB = 100, 1 << 26

# The most ways of buildings, and nodes of these, in memory: about 2 GB.
_MOST_WAYS, _MOST_NODES = 1_000_000, 6_000_000

# libosmium's x of a node without a place, as in a deletion
_NOWHERE = 2**31 - 1

Places = dict[int, tuple[float, float]]  # lon, lat of node ids
Way = tuple[list[int], dict[str, str]]  # node ids, tags
Relation = tuple[list[tuple[int, str]], dict[str, str]]  # (way id, role) of members, tags


def read_osm(path: Path, request: Request) -> Footprints:
    """Read the buildings of an extract; the suffix of its name is its packing."""
    packing = next(known for known in _FORMATS if path.name.lower().endswith(known))
    try:
        _check_unpacked(path, packing)
        # absolute, for libosmium would hand a name like "http:a.osm" to curl
        relations, ways, places = _elements(osmium.io.File(str(path.absolute()), packing))
    except (
        *(RuntimeError, ValueError, OSError, EOFError, zlib.error),
        osmium.InvalidLocationError,
    ) as error:
        raise MapError(
            f"{path.name} cannot be read as OpenStreetMap data: {str(error)[:200]}",
            "a complete extract, as XML (.osm) or PBF (.osm.pbf)",
            "download the file again, because it may be cut off",
        ) from error
    return _assemble(relations, ways, places)


def _check_unpacked(path: Path, packing: str) -> None:
    """Raise ValueError for a decompression bomb: XML of OpenStreetMap packs to a tenth."""
    opened = {"osm.gz": gzip.open, "osm.bz2": bz2.open}.get(packing)
    if opened is None:
        return
    most, size = max(_LEAST_BOMB, _DENSEST * path.stat().st_size), 0
    with opened(path) as file:
        while content := file.read(1 << 20):
            size += len(content)
            if size > most:
                raise ValueError(f"more than {most >> 20} MiB in {path.stat().st_size} bytes")


def _elements(file: osmium.io.File) -> tuple[list[Relation], dict[int, Way], Places]:
    """Read what may belong to buildings: relations, ways by id, the places of the ways' nodes."""
    relations, ways, places, count = [], {}, {}, 0
    for relation in osmium.FileProcessor(file, osmium.osm.RELATION):
        tags = dict(relation.tags)
        relevant = is_building(tags) or _SILENT_TAGS.issuperset(tags)
        if relevant and tags.get("type") == "multipolygon":
            members = [(way.ref, way.role) for way in relation.members if way.type == "w"]
            relations.append((members, tags))
            count += len(members)
            _check_room(0, count)
    in_relations = {way for members, _ in relations for way, _ in members}
    for way in osmium.FileProcessor(file, osmium.osm.WAY):
        if way.id in in_relations or is_building(way.tags):
            ways[way.id] = [node.ref for node in way.nodes], dict(way.tags)
            count += len(way.nodes)
            _check_room(len(ways), count)
    wanted = {node for nodes, _ in ways.values() for node in nodes}
    empty = True
    for node in osmium.FileProcessor(file, osmium.osm.NODE):
        place = node.location
        if place.x != _NOWHERE:
            empty = False
            if node.id in wanted:
                places[node.id] = place.lon, place.lat
    if empty:
        raise ValueError("no nodes in it")
    return relations, ways, places


def _check_room(ways: int, nodes: int) -> None:
    """Raise ValueError for more ways or nodes than fit into memory."""
    if ways > _MOST_WAYS or nodes > _MOST_NODES:
        raise ValueError(
            f"its buildings have more than {_MOST_WAYS} outlines, or {_MOST_NODES} corners; "
            "cut it to the city: osmium extract --bbox"
        )


def _assemble(relations: list[Relation], ways: dict[int, Way], places: Places) -> Footprints:
    polygons, tags, tagged_outers = [], [], set()
    for members, own in relations:
        known = [(way, role) for way, role in members if way in ways]
        if not is_building(own):
            outer = [way for way, role in known if role != "inner"]
            own = next((t for w in outer if is_building(t := ways[w][1])), own)
            tagged_outers.update(outer if is_building(own) else ())
        if is_building(own):
            lines = (_line(ways[way][0], places) for way, _ in known)
            # the even-odd rule makes holes of the inner rings
            area = shapely.build_area(
                shapely.GeometryCollection([line for line in lines if line is not None])
            )
            if not area.is_empty:
                polygons.append(area)
                tags.append(own)
    for way, (nodes, own) in ways.items():
        if is_building(own) and way not in tagged_outers and nodes and nodes[0] == nodes[-1]:
            line = _line(nodes, places)
            if line is not None and len(line.coords) > 2:
                polygons.append(shapely.Polygon(line))
                tags.append(own)
    return Footprints(np.array(polygons, dtype=object), tags, WGS84, ATTRIBUTION)


def _line(nodes: list[int], places: Places) -> shapely.LineString | None:
    points = [place for place, _ in itertools.groupby(places[n] for n in nodes if n in places)]
    return shapely.LineString(points) if len(points) > 1 else None
