"""GML: buildings of CityGML (LoD 0 to 2), and polygons of other GML, such as a WFS delivers.

References to other files (``xlink:href``, schemas) are not followed.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import shapely

from evocity.errors import MapError
from evocity.io.account import DEGENERATE, LOST_RINGS, NO_POLYGON, Account
from evocity.io.building_rest import DEGREE
from evocity.io.heights import check_columns, has_building_fields, is_building_name
from evocity.io.layer_choice import choose_layer
from evocity.io.projection import plane
from evocity.io.reader_types import Footprints, Request
from evocity.io.surfaces import WALL, sound_rings
from evocity.io.xml.citygml import read_building, with_unit
from evocity.io.xml.gml_geometry import (
    POLYGONS,
    NamedCRS,
    is_northing_first,
    parse_srs_name,
    rings_of,
    stated_sizes,
)
from evocity.io.xml.stream import Element, elements, local_name, xml_errors

_MEMBERS = ("member", "featureMember", "cityObjectMember", "featureMembers", "members")
_BUILDINGS = ("Building", "BuildingPart")
_BOUNDS = ("Envelope", "Box")


@dataclass
class _Layer:
    polygons: list[shapely.Geometry] = field(default_factory=list)
    tags: list[dict] = field(default_factory=list)
    account: Account = field(default_factory=Account)


@dataclass
class _Document:
    """What was read of a file so far."""

    path: Path
    is_city: bool = False
    srs: str | None = None
    named: NamedCRS | None = None
    is_of_bounds: bool = False  # whether only elements for bounds name it
    dimension: int | None = None
    layers: dict[str, _Layer] = field(default_factory=lambda: defaultdict(_Layer))

    @property
    def vertical(self) -> float:
        return self.named.vertical if self.named else 1.0

    @property
    def unit(self) -> float:
        """Metres in a unit of the coordinates, about."""
        if self.named is None or not self.named.crs.axis_info:
            return 1.0
        if self.named.crs.is_geographic:
            return DEGREE
        return float(self.named.crs.axis_info[0].unit_conversion_factor)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Numbers of coordinates that a point may have, the likeliest first."""
        if self.dimension is not None:
            return (self.dimension,)
        return (3, 2) if self.named is not None and self.named.axes == 3 else (2, 3)

    def note_system(self, element: Element) -> None:
        """Keep the reference system that an element names; raises ValueError for a second one. The
        order of axes that a geometry names comes before that of bounds."""
        text = element.get("srsName")
        if self.dimension is None and local_name(element) == "Envelope":
            stated = element.get("srsDimension", "")
            self.dimension = int(stated) if stated in ("2", "3") else None
        if text is None:
            return
        if text == self.srs:
            self.is_of_bounds &= local_name(element) in _BOUNDS
            return
        named = parse_srs_name(text, self.path.name)
        is_of_bounds = local_name(element) in _BOUNDS
        if self.named is None:
            self.srs, self.named, self.is_of_bounds = text, named, is_of_bounds
            return
        if named.crs != self.named.crs:
            raise ValueError(f"two reference systems, {self.srs!r} and {text[:80]!r}")
        if is_of_bounds:
            return
        if self.is_of_bounds:
            self.srs, self.is_of_bounds = text, False
            self.named = replace(self.named, northing_first=named.northing_first)
        elif named.northing_first != self.named.northing_first:
            raise ValueError(f"two orders of axes, of {self.srs!r} and {text[:80]!r}")


def read_gml(path: Path, request: Request) -> Footprints:
    """Read the buildings of a CityGML file; of other GML, the polygons of the named kind of
    feature, or of the only fitting one."""
    document = _Document(path)
    with xml_errors(path, "GML"):
        _read_document(document)
        chosen, layer = _chosen(document, request)
        polygons = np.array(layer.polygons, dtype=object)
        columns = {name for own in layer.tags for name in own}
        of_buildings = document.is_city or is_building_name(chosen) or has_building_fields(columns)
        if not document.is_city:
            check_columns(path.name, columns, (request.height_column, request.levels_column))
        if document.named is None:
            return Footprints(
                polygons, layer.tags, plane(), of_buildings=of_buildings, account=layer.account
            )
        if len(polygons):
            west, south, east, north = shapely.total_bounds(polygons)
            if is_northing_first(document.named, (west + east) / 2, (south + north) / 2):
                polygons = shapely.transform(polygons, lambda points: points[:, ::-1])
        return Footprints(
            polygons,
            layer.tags,
            document.named.crs,
            of_buildings=of_buildings,
            height_unit=document.vertical,
            account=layer.account,
        )


def _read_document(document: _Document) -> None:
    for event, element, above in elements(document.path):
        name = local_name(element)
        if event == "start":
            if not above:
                document.is_city = name == "CityModel"
            document.note_system(element)
            continue
        parent = local_name(above[-1]) if above else ""
        if len(above) == 2 and parent in _MEMBERS and local_name(above[0]) not in _MEMBERS:
            _take_feature(document, element)
            above[-1].remove(element)
        elif len(above) == 1 and name in _MEMBERS:
            above[0].remove(element)


def _take_feature(document: _Document, feature: Element) -> None:
    name = local_name(feature)
    if document.is_city:
        if name in _BUILDINGS:
            layer = document.layers["Building"]
            for polygon, own in read_building(
                feature, document.vertical, document.unit, layer.account
            ):
                layer.polygons.append(polygon)
                layer.tags.append(own)
        return
    layer = document.layers[name]
    layer.account.features += 1
    parts, lost = _polygons(feature, document.sizes)
    kept = [part for part in parts if part.area > WALL / document.unit**2]
    if not kept:
        layer.account.drop(DEGENERATE if parts or lost else NO_POLYGON)
        return
    layer.account.remark(LOST_RINGS, lost)
    layer.polygons.append(shapely.MultiPolygon(kept) if len(kept) > 1 else kept[0])
    layer.tags.append(_attributes(feature))


def _polygons(feature: Element, sizes: Sequence[int]) -> tuple[list[shapely.Polygon], int]:
    """Return the polygons of a feature, and the number of their degenerate rings."""
    found, lost = [], 0
    waiting = [(feature, sizes)]
    while waiting:
        element, usual = waiting.pop()
        if element.get("srsDimension") in ("2", "3"):
            usual = stated_sizes(element, usual)
        if local_name(element) in POLYGONS:
            rings, degenerate = sound_rings([ring[:, :2] for ring in rings_of(element, usual)])
            lost += degenerate
            if rings:
                found.append(shapely.Polygon(rings[0], rings[1:]))
        waiting += [(child, usual) for child in reversed(element)]
    return found, lost


def _attributes(feature: Element) -> dict[str, str]:
    """The texts of a feature's elements that have no elements in them, by their names."""
    found: dict[str, str] = {}
    waiting = [(child, "") for child in reversed(feature)]
    while waiting:
        element, above = waiting.pop()
        name = local_name(element)
        if len(element):
            if element.get("srsName") is None and name not in POLYGONS:
                waiting += [(child, name) for child in reversed(element)]
        elif element.text and element.text.strip():
            text = with_unit(element)
            # of INSPIRE: <HeightAboveGround><value uom="m">
            key = "height" if (above, name) == ("HeightAboveGround", "value") else name
            key = "levels" if key == "numberOfFloorsAboveGround" else key
            if key not in ("posList", "pos", "coordinates", "lowerCorner", "upperCorner"):
                found.setdefault(key, text)
    return found


def _chosen(document: _Document, request: Request) -> tuple[str, _Layer]:
    """Choose the layer that the request names, or the only fitting one."""
    layers = document.layers
    if not layers:
        kind = "building" if document.is_city else "feature"
        raise MapError(
            f"{document.path.name} has no {kind}",
            "CityGML with Building objects, or GML with features that have polygons",
            "check that the right file or layer was exported",
        )
    hints = {name: False for name, layer in layers.items() if layer.polygons}
    chosen = choose_layer(document.path.name, hints, request.layer, list(layers))
    return chosen, layers[chosen]
