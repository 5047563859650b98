"""GeoJSON footprints, after RFC 7946 or the older kind with a ``crs`` member; CityJSON by its type.

The reader knows these members beside the features: ``attribution``, and ``window`` with its
``center`` [lon, lat], ``projection`` (a PROJ string in metres) and ``side_m`` (metres).
"""

import math
from pathlib import Path

import numpy as np
import shapely

from evocity.errors import MapError, is_number
from evocity.formats.geojson_lines import read_document
from evocity.io.cityjson import read_cityjson
from evocity.io.projection import WGS84, is_metric, parse_crs
from evocity.io.reader_types import Footprints, Request


def read_json(path: Path, request: Request) -> Footprints:
    """Read a GeoJSON or CityJSON file, by the document's own ``type``."""
    document = read_document(path)
    kind = document.get("type")
    if kind == "CityJSON":
        return read_cityjson(path, document)
    if kind == "FeatureCollection":
        return _footprints(path, document, document.get("features"))
    if kind == "Feature":
        return _footprints(path, document, [document])
    if kind in ("Polygon", "MultiPolygon", "GeometryCollection"):
        return _footprints(path, {}, [{"geometry": document, "properties": {}}])
    raise MapError(
        f"{path.name}: the JSON has the type {kind!r}",
        "a GeoJSON FeatureCollection of polygons, or CityJSON",
        "export the building footprints as GeoJSON or CityJSON",
    )


def _footprints(path: Path, document: dict, features: object) -> Footprints:
    if not isinstance(features, list):
        raise MapError(
            f"{path.name}: the member 'features' is not a list",
            "a GeoJSON FeatureCollection",
            "export the file again as GeoJSON",
        )
    polygons, tags = [], []
    for number, feature in enumerate(features):
        where = f"{path.name}, feature {number}"
        if not isinstance(feature, dict):
            raise _geometry_error(where, "it is not an object")
        geometry = feature.get("geometry")
        properties = feature.get("properties")
        for polygon in _polygons(geometry, where):
            polygons.append(polygon)
            tags.append(properties if isinstance(properties, dict) else {})
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
    )


def _polygons(geometry: object, where: str) -> list[shapely.Geometry]:
    """List the areas of a GeoJSON geometry: one for a Polygon or MultiPolygon."""
    if geometry is None:
        return []
    try:
        kind = geometry["type"]
        if kind == "GeometryCollection":
            return [part for inner in geometry["geometries"] for part in _polygons(inner, where)]
        if kind == "Polygon":
            return [_polygon(geometry["coordinates"], where)] if geometry["coordinates"] else []
        if kind == "MultiPolygon":
            parts = [_polygon(rings, where) for rings in geometry["coordinates"]]
            return [shapely.MultiPolygon(parts)] if parts else []
    except (TypeError, KeyError, IndexError, ValueError, OverflowError) as error:
        raise _geometry_error(where, f"its geometry cannot be read ({error})") from error
    return []  # points and lines are not buildings


def _polygon(rings: list, where: str) -> shapely.Polygon:
    shell, *holes = (shapely.linearrings(_ring(ring, where)) for ring in rings)
    return shapely.polygons(shell, holes or None)


def _ring(ring: list, where: str) -> list[tuple[float, float]]:
    points = [(float(point[0]), float(point[1])) for point in ring]
    if len(set(points)) < 3:
        raise _geometry_error(where, f"a ring of {len(set(points))} different points")
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
    try:
        name = member["properties"]["name"]
    except (TypeError, KeyError):
        name = member
    return parse_crs(name, f"{path.name}, member 'crs'")


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
