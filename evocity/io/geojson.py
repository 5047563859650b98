"""GeoJSON, after RFC 7946 or of the older kind with a ``crs`` member; and which JSON it is.

Members beside the features that are understood: ``attribution``, and ``window`` with its
``center`` [lon, lat], ``projection`` (a PROJ string in metres) and ``side_m`` (metres).
"""

import json
import math
from pathlib import Path

import numpy as np
import shapely

from evocity.errors import MapError
from evocity.io.cityjson import read_cityjson
from evocity.io.projection import WGS84, crs_named, is_metric
from evocity.io.sources import Footprints, Request

#: Bytes that a document may take once it is read.
MOST = 1_200_000_000


def read_json(path: Path, request: Request) -> Footprints:
    """Read a GeoJSON or CityJSON file; which of the two it is, it says itself."""
    document = document_of(path)
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
        f"{path.name}: JSON with type {kind!r}",
        "a GeoJSON FeatureCollection of polygons, or CityJSON",
        "export the building footprints as GeoJSON or CityJSON",
    )


def document_of(path: Path) -> dict:
    """The JSON object of a file, empty for other JSON. Raises `MapError` for what is none, or too
    large."""
    try:
        content = path.read_bytes()
        if _unpacked(content) > MOST:
            raise MapError(
                f"{path.name} has {content.count(b'[') + content.count(b'{')} lists and objects in "
                f"{len(content) / 1e6:.0f} MB of JSON, too much to be held at once",
                f"what takes at most {MOST / 1e9:g} GB once read, some 100 MB of footprints",
                "cut it to the district and what lies around it, for example in QGIS",
            )
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise MapError(
            f"{path.name} is not whole JSON: {error}",
            "a GeoJSON or CityJSON file",
            "download or export it again; it may have been cut off",
        ) from error
    return document if isinstance(document, dict) else {}


def _unpacked(content: bytes) -> int:
    """Bytes that JSON takes once it is read, about: of lists, objects, numbers and texts."""
    lists, objects, values = (content.count(sign) for sign in (b"[", b"{", b","))
    return 2 * len(content) + 100 * lists + 250 * objects + 40 * values


def _footprints(path: Path, document: dict, features: object) -> Footprints:
    if not isinstance(features, list):
        raise MapError(
            f"{path.name}: its member 'features' is no list",
            "a GeoJSON FeatureCollection",
            "export it again as GeoJSON",
        )
    polygons, tags = [], []
    for number, feature in enumerate(features):
        where = f"{path.name}, feature {number}"
        if not isinstance(feature, dict):
            raise _broken(where, "it is no object")
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
        crs=crs_in(path, document.get("crs")),
        attribution=attribution if isinstance(attribution, str) else "",
        center=center,
        projection=projection,
        side=_side(document.get("window")),
        bare=center is not None and not features,
    )


def _polygons(geometry: object, where: str) -> list[shapely.Geometry]:
    """The area of a GeoJSON geometry, in one piece if it is a polygon or many."""
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
        raise _broken(where, f"its geometry cannot be read ({error})") from error
    return []  # points and lines are no buildings


def _polygon(rings: list, where: str) -> shapely.Polygon:
    shell, *holes = (shapely.linearrings(_ring(ring, where)) for ring in rings)
    return shapely.polygons(shell, holes or None)


def _ring(ring: list, where: str) -> list[tuple[float, float]]:
    points = [(float(point[0]), float(point[1])) for point in ring]
    if len(set(points)) < 3:
        raise _broken(where, f"a ring of {len(set(points))} different points")
    if not all(math.isfinite(x) and math.isfinite(y) for x, y in points):
        raise _broken(where, "a coordinate is NaN or infinite")
    return points


def _broken(where: str, found: str) -> MapError:
    return MapError(
        f"{where}: {found}",
        "polygons whose rings have at least three different points of two or three numbers",
        "repair or delete this feature, for example in QGIS",
    )


def crs_in(path: Path, member: object):
    if member is None:
        return WGS84
    try:
        name = member["properties"]["name"]
    except (TypeError, KeyError):
        name = member
    return crs_named(name, f"{path.name}, member 'crs'")


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
            '{"center": [longitude, latitude]}, and "projection" if need be',
            "correct the member or take it out",
        ) from error
    if named is None:
        return center, None
    projection = crs_named(named, f"{where}, 'projection'")
    if not is_metric(projection):
        raise MapError(
            f"{where}: projection {named!r}",
            "a projection in metres",
            "correct it or take it out: a local one is then chosen",
        )
    return center, projection


def _side(window: object) -> float | None:
    side = window.get("side_m") if isinstance(window, dict) else None
    number = isinstance(side, int | float) and not isinstance(side, bool)
    return float(side) if number and 0 < side < 1e9 else None


__all__ = ["crs_in", "document_of", "read_json"]
