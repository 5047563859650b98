"""Answers of Overpass, as JSON or as XML, and edited XML of JOSM, which marks what it deletes.

Overpass gives places in nodes of their own, or beside the nodes of ways and the ways of relations
(``out geom``). Other answers have the elements without places, which is an error.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import IO
from xml.parsers import expat

from evocity.errors import MapError
from evocity.io.openstreetmap.areas import assemble_areas
from evocity.io.openstreetmap.elements import Extract, Node, Place
from evocity.io.reader_types import Footprints

# Elements of a document, at most; about 2 GB.
_MOST_ELEMENTS = 6_000_000

_DIGITS = 7  # of a degree, as OpenStreetMap stores them

# the way (id, role, its nodes if the relation says them) of a relation
_Member = tuple[int, str, list[Node]]


@dataclass
class _Element:
    """A node, way or relation of a document."""

    kind: str
    number: int
    tags: dict[str, str] = field(default_factory=dict)
    deleted: bool = False
    place: Place | None = None
    nodes: list[Node] = field(default_factory=list)
    members: list[_Member] = field(default_factory=list)


def is_overpass(document: Mapping) -> bool:
    """Tell whether a JSON document has elements of OpenStreetMap."""
    return "type" not in document and isinstance(document.get("elements"), list)


def read_overpass(path: Path, document: Mapping) -> Footprints:
    """Read the buildings of a JSON document of Overpass, or of the API of OpenStreetMap."""
    try:
        remark = document.get("remark")
        if isinstance(remark, str) and "error" in remark:
            raise ValueError(f"Overpass ended with {remark!r}")
        elements = [_parse_json(item) for item in document["elements"]]
        return assemble_areas(_collect([one for one in elements if one is not None]))
    except (TypeError, KeyError, ValueError, AttributeError, OverflowError) as error:
        said = str(error) if type(error) is ValueError else f"{type(error).__name__}: {error}"
        raise MapError(
            f"{path.name} cannot be read as OpenStreetMap data: {said[:200]}",
            "a complete JSON document of Overpass, with the places of its nodes",
            "query Overpass again, with `[out:json]`, and `out geom` at the end",
        ) from error


def read_xml_elements(file: IO[bytes]) -> Extract:
    """Read XML of OpenStreetMap that pyosmium misreads. Raises ValueError or `ExpatError`."""
    reader = _XmlReader()
    reader.parser.ParseFile(file)
    return _collect(reader.elements)


def _collect(elements: list[_Element]) -> Extract:
    extract = Extract()
    by_kind: dict[str, list[_Element]] = {"relation": [], "way": [], "node": []}
    for one in elements:
        if one.kind in by_kind:
            by_kind[one.kind].append(one)
    for one in by_kind["relation"]:
        members = [(number, role) for number, role, _ in one.members]
        extract.take_relation(one.number, one.tags, members, one.deleted)
    for one in by_kind["relation"]:
        for number, _, nodes in one.members:
            if nodes and not one.deleted:
                extract.take_way(number, {}, nodes)
    for one in by_kind["way"]:
        extract.take_way(one.number, one.tags, one.nodes, one.deleted)
    extract.choose_nodes()
    for one in by_kind["node"]:
        if one.place is not None:
            extract.take_node(one.number, one.tags, one.deleted, partial(_same, one.place))
    return extract


def _same(place: Place) -> Place:
    return place


def _place(lon: object, lat: object) -> Place:
    """Check and round a place. Raises ValueError or TypeError if it is not on Earth."""
    x, y = float(lon), float(lat)  # type: ignore[arg-type]
    if not (abs(x) <= 180 and abs(y) <= 90):
        raise ValueError(f"invalid location {x:g}, {y:g}")
    return round(x, _DIGITS), round(y, _DIGITS)


def _parse_json(item: Mapping) -> _Element | None:
    """Parse an element of a JSON document; None for other kinds of elements."""
    kind = item["type"]
    if kind not in ("node", "way", "relation"):
        return None
    tags = {str(key): str(value) for key, value in (item.get("tags") or {}).items()}
    deleted = item.get("visible") is False or item.get("action") == "delete"
    one = _Element(kind, int(item["id"]), tags, deleted)
    if kind == "node" and item.get("lat") is not None:
        one.place = _place(item["lon"], item["lat"])
    elif kind == "way":
        one.nodes = _nodes(item.get("nodes") or [], item.get("geometry"))
    elif kind == "relation":
        one.members = [
            (int(way["ref"]), str(way.get("role", "")), _nodes([], way.get("geometry")))
            for way in item.get("members") or []
            if way["type"] == "way"
        ]
    return one


def _nodes(numbers: list, geometry: list | None) -> list[Node]:
    """List the nodes of a way: places of its ``geometry``; otherwise their ``numbers``, also for a
    null of the geometry, which is a node outside the box of the query."""
    if geometry is None:
        return [int(number) for number in numbers]
    numbers = numbers or [-1 - at for at in range(len(geometry))]
    if len(numbers) != len(geometry):
        raise ValueError(f"a way of {len(numbers)} nodes and {len(geometry)} places")
    return [
        int(number) if at is None else _place(at["lon"], at["lat"])
        for number, at in zip(numbers, geometry, strict=True)
    ]


class _XmlReader:
    """Reader of XML of OpenStreetMap: ``elements`` of the document that its ``parser`` parses."""

    def __init__(self) -> None:
        self.elements: list[_Element] = []
        self._path: list[str] = []
        self.parser = expat.ParserCreate()
        self.parser.StartElementHandler = self._start
        self.parser.EndElementHandler = self._end
        self.parser.StartDoctypeDeclHandler = self._refuse  # entities grow without end

    def _refuse(self, *_declared: object) -> None:
        raise ValueError("a document type, which XML of OpenStreetMap does not have")

    def _start(self, name: str, given: dict[str, str]) -> None:
        if not self._path and name != "osm":
            raise ValueError(f"the root element is {name[:40]!r}")
        self._path.append(name)
        depth = len(self._path)
        if depth == 2 and name in ("node", "way", "relation"):
            self._begin(name, given)
        elif depth >= 3 and self._path[1] in ("node", "way", "relation"):
            self._add(self.elements[-1], depth, name, given)

    def _end(self, _name: str) -> None:
        self._path.pop()

    def _begin(self, kind: str, given: dict[str, str]) -> None:
        if len(self.elements) >= _MOST_ELEMENTS:
            raise ValueError(f"more than {_MOST_ELEMENTS} elements; cut it to the city")
        deleted = given.get("action") == "delete" or given.get("visible") == "false"
        one = _Element(kind, _whole(given, "id"), deleted=deleted)
        if kind == "node" and "lat" in given and "lon" in given:
            one.place = _place(given["lon"], given["lat"])
        self.elements.append(one)

    def _add(self, one: _Element, depth: int, name: str, given: dict[str, str]) -> None:
        """Add to an element what stands in it: tags, nodes, members and their nodes."""
        if name == "tag" and depth == 3:
            one.tags[given.get("k", "")] = given.get("v", "")
        elif name == "nd" and depth == 3:
            one.nodes.append(_node(given, -1 - len(one.nodes)))
        elif name == "member" and depth == 3:
            # also nodes and relations, so that places in them are not those of the way before
            self._member: list[Node] = []
            if given.get("type") == "way":
                one.members.append((_whole(given, "ref"), given.get("role", ""), self._member))
        elif name == "nd" and depth == 4 and self._path[2] == "member":
            self._member.append(_node(given, -1 - len(self._member)))


def _node(given: Mapping[str, str], otherwise: int) -> Node:
    """Return a node of a way: its place; without one its id, if it has one, or ``otherwise``."""
    if "lat" in given and "lon" in given:
        return _place(given["lon"], given["lat"])
    return _whole(given, "ref") if "ref" in given else otherwise


def _whole(given: Mapping[str, str], key: str) -> int:
    if key not in given:
        raise ValueError(f"an element without {key!r}")
    return int(given[key])
