"""OpenStreetMap extracts, XML or PBF: areas of buildings and of their parts.

pyosmium reads the elements in three passes, so that they may come in any order; shapely assembles
the areas. GDAL's driver and osmium's own assembler need nodes before ways, and lose some areas.
XML that pyosmium misreads goes to `overpass`: edits of JOSM, and relations of Overpass.
"""

import bz2
import gzip
import re
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO
from xml.parsers.expat import ExpatError

import osmium

from evocity.errors import MapError
from evocity.io.archives import DENSEST, LEAST
from evocity.io.heights import is_building
from evocity.io.openstreetmap.areas import assemble_areas
from evocity.io.openstreetmap.elements import Extract, Place
from evocity.io.openstreetmap.overpass import read_xml_elements
from evocity.io.reader_types import Footprints, Request

_FORMATS = ("pbf", "osm.gz", "osm.bz2", "osm")

# libosmium's x of a node without a place, as in a deletion
_NOWHERE = 2**31 - 1

# Marks of XML that libosmium misreads, and of an answer that Overpass cut off.
_DELETION = re.compile(rb"""\saction\s*=\s*["']delete""")
_CUT_OFF = re.compile(rb"<remark>\s*(runtime error[^<]{0,150})")
_LONGEST_MARK = 256

# libosmium's words for geometry that stands in elements where it expects none
_OVERPASS = ("No element inside <member> allowed", "Unknown element in <")


def read_osm(path: Path, request: Request) -> Footprints:
    """Read the buildings of an extract; the suffix of its name is its packing."""
    packing = next(known for known in _FORMATS if path.name.lower().endswith(known))
    try:
        edited = packing != "pbf" and _scan_xml(path, packing)
        return assemble_areas(_read_extract(path, packing, edited))
    except (
        *(RuntimeError, ValueError, OSError, EOFError, zlib.error, ExpatError),
        osmium.InvalidLocationError,
    ) as error:
        raise MapError(
            f"{path.name} cannot be read as OpenStreetMap data: {str(error)[:200]}",
            "a complete extract, as XML (.osm) or PBF (.osm.pbf)",
            "download the file again, because it may be cut off",
        ) from error


def _read_extract(path: Path, packing: str, edited: bool) -> Extract:
    """Read an extract by pyosmium; XML that is ``edited``, or has elements of Overpass, by
    `read_xml_elements`."""
    if not edited:
        try:
            # absolute, for libosmium would hand a name like "http:a.osm" to curl
            return _read_elements(osmium.io.File(str(path.absolute()), packing))
        except RuntimeError as error:
            if packing == "pbf" or not str(error).startswith(_OVERPASS):
                raise
    with _open(path, packing) as file:
        return read_xml_elements(file)


def _open(path: Path, packing: str) -> IO[bytes]:
    opened: dict = {"osm.gz": gzip.open, "osm.bz2": bz2.open}
    return opened.get(packing, open)(path, "rb")


def _scan_xml(path: Path, packing: str) -> bool:
    """Tell whether XML marks elements as deleted. Raises ValueError for a decompression bomb (XML
    of OpenStreetMap packs to a tenth), and for an answer that Overpass cut off."""
    most, size = max(LEAST, DENSEST * path.stat().st_size), 0
    edited, rest = False, b""
    with _open(path, packing) as file:
        while content := file.read(1 << 20):
            size += len(content)
            if packing != "osm" and size > most:
                raise ValueError(f"more than {most >> 20} MiB in {path.stat().st_size} bytes")
            content = rest + content
            edited = edited or _DELETION.search(content) is not None
            if match := _CUT_OFF.search(content):
                raise ValueError(f"Overpass ended with {match[1].decode(errors='replace')!r}")
            rest = content[-_LONGEST_MARK:]
    return edited


def _read_elements(file: osmium.io.File) -> Extract:
    """Read relations, then the ways that may belong to buildings, then the places of nodes."""
    extract = Extract()
    for relation in osmium.FileProcessor(file, osmium.osm.RELATION):
        members = [(way.ref, way.role) for way in relation.members if way.type == "w"]
        extract.take_relation(relation.id, dict(relation.tags), members, relation.deleted)
    for way in osmium.FileProcessor(file, osmium.osm.WAY):
        if way.deleted or way.id in extract.members or is_building(way.tags):
            nodes = [*_nodes(way)]
            extract.take_way(way.id, dict(way.tags), nodes, way.deleted)
    extract.choose_nodes()
    for node in osmium.FileProcessor(file, osmium.osm.NODE):
        place = node.location
        tags = dict(node.tags) if len(node.tags) else {}
        if place.x != _NOWHERE:
            extract.take_node(node.id, tags, node.deleted, lambda at=place: (at.lon, at.lat))
    return extract


def _nodes(way) -> Iterator[int | Place]:
    """Yield the nodes of a way: places that the way itself gives, otherwise ids."""
    for node in way.nodes:
        place = node.location
        yield node.ref if place.x == _NOWHERE else (place.lon, place.lat)
