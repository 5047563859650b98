"""CityJSON (1.0 to 2.0), as one document, or as CityJSONSeq with a line for each feature.

`evocity.io.cityjson_objects` makes footprints and heights of the objects of a document or feature.
"""

import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS

from evocity.errors import MapError
from evocity.formats.cityjson import PLACE
from evocity.formats.geojson_lines import MOST_MEMORY, parse_document
from evocity.io.account import Account
from evocity.io.building_rest import DEGREE
from evocity.io.cityjson_objects import BESIDE, KINDS, Units, read_objects
from evocity.io.projection import (
    WGS84,
    flat,
    is_metric,
    parse_whole_crs,
    plane,
    transform_points,
    vertical_unit,
)
from evocity.io.reader_types import Footprints

# The longest header of a CityJSONSeq, and the longest part of a line in its test, bytes.
_LONGEST_HEADER = 1 << 20

_FAULTS = (
    *(TypeError, KeyError, IndexError, ValueError, AttributeError, OverflowError, RecursionError),
    shapely.errors.GEOSException,
)


def read_cityjson(path: Path, document: dict) -> Footprints:
    """Read the buildings of a CityJSON document, each with ``solid_height`` among its tags."""
    return _read_features(path, document, iter([(document, path.name)]))


def has_cityjson_lines(path: Path) -> bool:
    """Tell whether a file is a CityJSONSeq: its first line is a CityJSON document, with more
    lines after it."""
    with open(path, "rb") as file:
        head = file.readline(_LONGEST_HEADER)
        if b'"CityJSON"' not in head or not head.endswith(b"\n"):
            return False
        try:
            document = json.loads(head)
        except (ValueError, RecursionError):
            return False
        kind = document.get("type") if isinstance(document, dict) else None
        return kind == "CityJSON" and any(
            not part.isspace() for part in iter(lambda: file.readline(_LONGEST_HEADER), b"")
        )


def read_cityjson_lines(path: Path) -> Footprints:
    """Read the buildings of a CityJSONSeq, feature by feature."""
    lines = _lines(path)
    header, name = next(lines)
    return _read_features(path, header, _with_first(header, name, lines))


def _lines(path: Path) -> Iterator[tuple[dict, str]]:
    """Yield the document of each line, and its name in messages."""
    with open(path, "rb") as file:
        number = 0
        while line := file.readline(MOST_MEMORY // 2):
            number += 1
            if not line.isspace():
                name = f"{path.name}, line {number}"
                yield parse_document(line, name), name


def _with_first(
    header: dict, name: str, lines: Iterator[tuple[dict, str]]
) -> Iterator[tuple[dict, str]]:
    """Yield the header, which may have objects too, and then the features."""
    yield header, name
    for feature, where in lines:
        if feature.get("type") != "CityJSONFeature":
            raise MapError(
                f"{where}: the JSON has the type {str(feature.get('type'))[:40]!r}",
                "a CityJSONFeature on each line after the first",
                "export the file again as CityJSONSeq, or as one CityJSON document",
            )
        # features have the transform of the header
        yield {**feature, "transform": header.get("transform")}, where


def _read_features(path: Path, header: dict, features: Iterator[tuple[dict, str]]) -> Footprints:
    polygons: list[shapely.Geometry] = []
    tags: list[dict] = []
    account, where = Account(), path.name
    try:
        own = _scene_attributes(header.get("CityObjects") or {})
        whole = _crs(path, header, own)
        crs = flat(whole)
        window = _window(own, crs)
        kinds = KINDS + BESIDE if own else KINDS
        for feature, where in features:  # noqa: B007 (the errors below name it)
            vertices = _vertices(feature, crs)
            objects = feature["CityObjects"]
            areas, more = read_objects(objects, vertices, _units(whole, vertices), kinds, account)
            polygons += areas
            tags += more
    except _FAULTS as error:
        raise MapError(
            f"{where}: the CityJSON cannot be read ({type(error).__name__}: {error})",
            "CityJSON 1.0 to 2.0 with CityObjects, vertices and their geometry",
            "check the file with a CityJSON validator, or export it again",
        ) from error
    bare = bool(own) and not polygons
    return Footprints(
        np.array(polygons, dtype=object), tags, crs, **window, bare=bare, account=account
    )


def _units(crs: CRS, vertices: np.ndarray) -> Units:
    """Return metres of a unit of x, y and z at the ``vertices``."""
    if crs.is_geographic:
        middle = math.radians(float(vertices[:, 1].mean())) if len(vertices) else 0.0
        plan = DEGREE * np.array([max(math.cos(middle), 1e-6), 1.0])
    else:
        axes = flat(crs).axis_info
        plan = np.full(2, axes[0].unit_conversion_factor if axes else 1.0)
    return Units(plan, vertical_unit(crs))


def _scene_attributes(objects: dict) -> dict:
    """Find the attributes with which evocity writes the place of a scene; {} in other files."""
    for first in objects.values():
        attributes = first.get("attributes") or {}
        return attributes if PLACE[1] in attributes else {}
    return {}


def _crs(path: Path, document: dict, own: dict) -> CRS:
    """Parse the document's reference system, with its heights; without one, a `plane`."""
    named = (document.get("metadata") or {}).get("referenceSystem")
    if named is not None:
        return parse_whole_crs(named, f"{path.name}, metadata.referenceSystem")
    if PLACE[0] in own:
        return parse_whole_crs(own[PLACE[0]], f"{path.name}, {PLACE[0]}")
    return plane()


def _window(own: dict, crs: CRS) -> dict:
    """Read the window of evocity's own scene, as fields of `Footprints`."""
    if not own:
        return {}
    x, y = (float(number) for number in own[PLACE[1]])
    if not (math.isfinite(x) and math.isfinite(y)):
        raise ValueError(f"{PLACE[1]} is not finite")
    if PLACE[0] in own:  # the map's own, where the file is in a zone with a code
        crs = flat(parse_whole_crs(own[PLACE[0]], PLACE[0]))
    if not crs.is_engineering:
        x, y = transform_points(x, y, crs, WGS84)
    placed = {"projection": crs} if is_metric(crs) else {}
    attribution = own.get("attribution", "")
    return {
        "center": (float(x), float(y)),
        "attribution": attribution if isinstance(attribution, str) else "",
    } | placed


def _vertices(document: dict, crs: CRS) -> np.ndarray:
    """Unpack the vertices by ``transform``: float64 ``(n, 3)``."""
    vertices = np.array(document["vertices"], dtype=float).reshape(-1, 3)
    if packing := document.get("transform"):
        vertices = vertices * packing["scale"] + packing["translate"]
    if not np.isfinite(vertices).all():
        raise ValueError("a vertex is NaN or infinite")
    if crs.is_geographic and len(vertices):
        x, y = np.abs(vertices[:, :2]).max(axis=0)
        if x <= 90 < y:  # latitude first, in the order of the axes of EPSG codes
            vertices = vertices[:, [1, 0, 2]]
    return vertices
