"""GeoJSON footprints, after RFC 7946 or the older kind with a ``crs`` member; CityJSON by its type.

The reader knows these members beside the features: ``attribution``, and ``window`` with its
``center`` [lon, lat], ``projection`` (a PROJ string in metres) and ``side_m`` (metres).
"""

import dataclasses
import math
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS

from evocity.errors import MapError, is_number
from evocity.formats.geojson_lines import read_document
from evocity.io.account import DEGENERATE, EMPTY, NO_POLYGON, OUTSIDE, Account
from evocity.io.cityjson import has_cityjson_lines, read_cityjson, read_cityjson_lines
from evocity.io.heights import check_columns, has_building_fields, is_building_name
from evocity.io.json_sequence import is_sequence, read_sequence
from evocity.io.openstreetmap.overpass import is_overpass, read_overpass
from evocity.io.projection import WGS84, is_metric, parse_crs, vertical_unit
from evocity.io.reader_types import Footprints, Request


def read_json(path: Path, request: Request) -> Footprints:
    """Read a GeoJSON or CityJSON file, by the document's own ``type``."""
    if has_cityjson_lines(path):
        return read_cityjson_lines(path)
    if is_sequence(path):
        return _sequence(path, request)
    document = read_document(path)
    if is_overpass(document):
        return read_overpass(path, document)
    kind = document.get("type")
    if kind == "CityJSON":
        return read_cityjson(path, document)
    if kind == "FeatureCollection":
        return _footprints(path, document, document.get("features"), request)
    if kind == "Feature":
        return _footprints(path, document, [document], request)
    if kind in ("Polygon", "MultiPolygon", "GeometryCollection"):
        parts = document.get("geometries") if kind == "GeometryCollection" else [document]
        features = [{"geometry": part} for part in parts] if isinstance(parts, list) else None
        return _footprints(path, {}, features, request)
    raise MapError(
        f"{path.name}: the JSON has the type {kind!r}",
        "a GeoJSON FeatureCollection of polygons, or CityJSON",
        "export the building footprints as GeoJSON or CityJSON",
    )


def _sequence(path: Path, request: Request) -> Footprints:
    document, count = read_sequence(path, request)
    footprints = _footprints(path, document, document["features"], request)
    account = footprints.account or Account(count)
    outside = count - len(document["features"])
    account.features = count
    account.drop(OUTSIDE, outside)
    note = f"; evocity read all {count} lines of the file" if outside else ""
    return dataclasses.replace(footprints, account=account, note=note)


def _footprints(path: Path, document: dict, features: object, request: Request) -> Footprints:
    if not isinstance(features, list):
        raise MapError(
            f"{path.name}: the member 'features' is not a list",
            "a GeoJSON FeatureCollection",
            "export the file again as GeoJSON",
        )
    polygons, tags, columns, account = [], [], set(), Account(len(features))
    for number, feature in enumerate(features):
        where = f"{path.name}, feature {number}"
        if not isinstance(feature, dict):
            raise _geometry_error(where, "it is not an object")
        geometry = feature.get("geometry")
        properties = feature.get("properties")
        shapes = _Shapes(where)
        shapes.add(geometry)
        columns.update(properties if isinstance(properties, dict) else ())
        if shapes.polygons:
            several = len(shapes.polygons) > 1
            polygons.append(
                shapely.MultiPolygon(shapes.polygons) if several else shapes.polygons[0]
            )
            tags.append(properties if isinstance(properties, dict) else {})
            account.remark("degenerate rings left out", shapes.degenerate)
        else:
            empty = EMPTY if shapes.is_area else NO_POLYGON
            account.drop(DEGENERATE if shapes.degenerate else empty)
    check_columns(path.name, columns, (request.height_column, request.levels_column))
    title = document.get("name")
    center, projection = _window(path, document.get("window"))
    attribution = document.get("attribution")
    return Footprints(
        polygons=np.array(polygons, dtype=object),
        tags=tags,
        crs=parse_crs_member(path, document.get("crs")),
        attribution=attribution if isinstance(attribution, str) else "",
        center=center,
        projection=projection,
        side=_side(document.get("window")),
        bare=center is not None and not features,
        of_buildings=has_building_fields(columns) or is_building_name(title),
        height_unit=_height_unit(document.get("crs")),
        account=account,
    )


class _Shapes:
    """The areas of a feature: ``polygons``, the number of ``degenerate`` rings, and whether the
    geometry ``is_area``."""

    def __init__(self, where: str):
        self._where = where
        self.polygons: list[shapely.Polygon] = []
        self.degenerate, self.is_area = 0, False

    def add(self, geometry: object) -> None:
        """Add the areas of a GeoJSON geometry. Raises `MapError`."""
        if geometry is None:
            return
        try:
            kind = geometry["type"]
            if kind == "GeometryCollection":
                for inner in geometry["geometries"]:
                    self.add(inner)
            elif kind == "Polygon":
                self._add_polygon(geometry["coordinates"])
            elif kind == "MultiPolygon":
                self.is_area = True
                for rings in geometry["coordinates"]:
                    self._add_polygon(rings)
        except (TypeError, KeyError, IndexError, ValueError, OverflowError) as error:
            found = f"its geometry cannot be read ({error})"
            raise _geometry_error(self._where, found) from error

    def _add_polygon(self, rings: list) -> None:
        self.is_area = True
        points = [_ring(ring, self._where) for ring in rings]
        lines = [shapely.linearrings(ring) if len(set(ring)) > 2 else None for ring in points]
        self.degenerate += lines.count(None)
        if lines and lines[0] is not None:
            holes = [line for line in lines[1:] if line is not None]
            self.polygons.append(shapely.polygons(lines[0], holes or None))


def _ring(ring: list, where: str) -> list[tuple[float, float]]:
    points = [(float(point[0]), float(point[1])) for point in ring]
    if not all(math.isfinite(x) and math.isfinite(y) for x, y in points):
        raise _geometry_error(where, "a coordinate is NaN or infinite")
    return points


def _geometry_error(where: str, found: str) -> MapError:
    return MapError(
        f"{where}: {found}",
        "polygons with rings of three or more different points, each of two or three numbers",
        "repair or delete this feature, for example in QGIS",
    )


def parse_crs_member(path: Path, member: object):
    """Parse the ``crs`` member of GeoJSON; WGS84 without one. Raises `MapError`."""
    if member is None:
        return WGS84
    return parse_crs(_crs_name(member), f"{path.name}, member 'crs'")


def _crs_name(member: object) -> object:
    try:
        return member["properties"]["name"]
    except (TypeError, KeyError):
        return member


def _height_unit(member: object) -> float:
    """Return the metres of a unit of height in the valid ``crs`` member of GeoJSON."""
    return 1.0 if member is None else vertical_unit(CRS.from_user_input(_crs_name(member)))


def _window(path: Path, window: object):
    if window is None:
        return None, None
    where = f"{path.name}, member 'window'"
    try:
        center = tuple(float(value) for value in window["center"])
        lon, lat = center
        if not (abs(lon) <= 180 and abs(lat) <= 90):
            raise ValueError("out of range")
        named = window.get("projection")
    except (TypeError, KeyError, ValueError, OverflowError, AttributeError) as error:
        raise MapError(
            f"{where} cannot be read ({error})",
            '{"center": [longitude, latitude]}, and optionally "projection"',
            "correct the member 'window', or remove it",
        ) from error
    if named is None:
        return center, None
    projection = parse_crs(named, f"{where}, 'projection'")
    if not is_metric(projection):
        raise MapError(
            f"{where}: the projection {named!r} is invalid",
            "a projection in metres",
            "correct the projection, or remove it to use a local projection",
        )
    return center, projection


def _side(window: object) -> float | None:
    side = window.get("side_m") if isinstance(window, dict) else None
    return float(side) if is_number(side) and 0 < side < 1e9 else None
