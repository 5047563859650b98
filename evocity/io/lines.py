"""Lines in files, and laid on maps: GeoJSON becomes polylines in metres, polylines GeoJSON."""

import json
import math
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from rasterio.features import rasterize

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import MapError, keyword
from evocity.files import whole_file
from evocity.io.burning import crs_of
from evocity.io.geojson import crs_in, document_of
from evocity.io.heights import TALLEST
from evocity.io.projection import WGS84, code_of, crs_named, is_metric, local_metres, moved, plainly
from evocity.io.sources import north_up

#: The most points of all lines of a file.
MOST_POINTS = 1_000_000
#: The widest strip that is laid along a line, metres.
WIDEST = 1000.0


@dataclass(frozen=True, eq=False)
class PlacedLines:
    """Polylines, each float ``(n, 2)``, metres: x to the east, y to the north in ``crs``, a code or
    a plain PROJ string; None for what lies nowhere on Earth. attribution : what the file asks for.
    """

    lines: tuple[np.ndarray, ...]
    crs: str | None
    attribution: str = ""


def read_lines(path: str | os.PathLike) -> PlacedLines:
    """The lines of a GeoJSON file: LineStrings, and rings of polygons, in their order.

    Degrees (RFC 7946) become metres of a projection about their middle; coordinates of a metric
    reference system that a ``crs`` member names stay. Beside ``"window": true`` they are metres
    that lie nowhere on Earth, from a window's south-west corner. Points that follow each other at
    one place are one, and lines of one point are left out.

    Raises `MapError` for what is no such file, or has no lines or too many points.
    """
    path = Path(path)
    document = _read(path)
    parts = list(_parts(path, document))
    if sum(map(len, parts)) > MOST_POINTS:
        raise MapError(
            f"{path.name}: {sum(map(len, parts))} points", f"at most {MOST_POINTS}", "simplify it"
        )
    parted = [line for line in parts if len(line)]
    lines = [one[np.append(True, (np.diff(one, axis=0) != 0).any(axis=1))] for one in parted]
    lines = [line for line in lines if len(line) > 1]
    if not lines:
        raise MapError(
            f"{path.name}: no line of two points among its features" if not parts
            else f"{path.name}: lines of one point alone",
            "a LineString or a polygon",
            "draw one, for example in QGIS",
        )  # fmt: skip
    told = document.get("attribution")
    attribution = told if isinstance(told, str) else ""
    if document.get("window") is True:
        return PlacedLines(tuple(lines), None, attribution)
    source = crs_in(path, document.get("crs"))
    if source is not WGS84 and is_metric(source):
        return PlacedLines(tuple(lines), plainly(source), attribution)
    every = np.vstack(lines)
    lon, lat = moved(*((every.min(axis=0) + every.max(axis=0)) / 2), source, WGS84)
    if not (math.isfinite(lon) and abs(lon) <= 180 and abs(lat) < 90):
        raise MapError(
            f"{path.name}: lines about {lon:g}, {lat:g}", "longitude and latitude in degrees",
            'repair the coordinates, or name their system: a "crs" member, or "window": true for '
            "metres that lie nowhere on Earth",
        )  # fmt: skip
    target = crs_named(plainly(local_metres(round(lon, 6), round(lat, 6))), path.name)
    return PlacedLines(
        tuple(_moved(line, source, target, path.name) for line in lines),
        plainly(target),
        attribution,
    )


def write_lines(placed: PlacedLines, path: str | os.PathLike) -> None:
    """Write lines as GeoJSON, in degrees if they lie on Earth, else in metres with ``"window":
    true``, which `read_lines` knows. Raises `MapError` if the file cannot be written."""
    lines = list(placed.lines)
    if placed.crs is not None:
        source = crs_named(placed.crs, "crs")
        lines = [_moved(line, source, WGS84, "a line") for line in lines]
    digits = 3 if placed.crs is None else 9
    features = [
        {
            "type": "Feature",
            "properties": {},
            "geometry": {"type": "LineString", "coordinates": np.round(line, digits).tolist()},
        }
        for line in lines
    ]
    document: dict = {"type": "FeatureCollection", "features": features}
    if placed.crs is None:
        document["window"] = True
    if placed.attribution:
        document["attribution"] = placed.attribution
    try:
        with whole_file(path) as temporary:
            temporary.write_text(json.dumps(document) + "\n", encoding="utf-8")
    except OSError as error:
        raise MapError(
            f"{os.fspath(path)} cannot be written: {error.strerror}",
            "a name in a folder that exists",
            "choose another",
        ) from None


def crs_told(city: CityMap) -> str | None:
    """The code or plain PROJ string of a city's reference system; None for a city that lies nowhere
    on Earth."""
    return None if city.origin is None else plainly(crs_of(city, city.name))


def line_on(city: CityMap, line: np.ndarray, crs: str | None) -> np.ndarray:
    """A ``line`` ``(n, 2)`` of ``crs`` in the coordinates of a ``city``: its reference system, or
    metres from its south-west corner if it has none. What lies nowhere on Earth is taken to be in
    metres from that corner. Raises `MapError` for a line on Earth and a city that is not."""
    if crs is None:
        if city.origin is None:
            return line
        left, top = city.origin
        return line + np.array([left, top - city.shape[0] * city.metres_per_pixel])
    return _moved(line, crs_named(crs, "the line"), crs_of(city, "the line"), "the line")


def condensation_along(
    city: CityMap, line: np.ndarray, width: float, height: float = 0.0
) -> Condensation:
    """What lies along a ``line`` ``(n, 2)``, in the coordinates of the map, as a condensation: all
    pixels of ``city`` whose centres are at most half a ``width`` from it, metres, are ``height``
    metres high: 0 for ground or water, more for a wall.

    Raises `MapError` for a width below a pixel or over `WIDEST`, a height beyond 0…1000 m, a line
    that crosses itself, and one that covers no pixel of the map.
    """
    pixel, (rows, columns) = city.metres_per_pixel, city.shape
    if not pixel <= width <= WIDEST:
        raise MapError(
            f"{keyword('width', width)} m on pixels of {pixel:g} m",
            f"{pixel:g}…{WIDEST:g} m",
            "widen it, or make the map with smaller pixels" if width < pixel else "narrow it",
        )
    if not 0 <= height <= TALLEST:
        raise MapError(
            f"{keyword('height', height)} m", f"0 (ground, water) to {TALLEST:g} m", "correct it"
        )
    drawn = shapely.linestrings(line)
    if not drawn.is_simple:
        raise MapError(
            "a line that crosses itself",
            "one that does not",
            "correct it, or drop or lessen its details",
        )
    left, top = city.origin or (0.0, rows * pixel)
    mask = rasterize(
        [(shapely.buffer(drawn, width / 2), 1)],
        out_shape=city.shape,
        transform=north_up(left, top, pixel),
        dtype="uint8",
    ).astype(bool)
    if not mask.any():
        west, south, east, north = drawn.bounds
        raise MapError(
            f"a line from x = {west:.0f} to {east:.0f} and y = {south:.0f} to {north:.0f}, which "
            f"covers no pixel of {city.name}",
            f"one that meets x = {left:.0f} to {left + columns * pixel:.0f} and "
            f"y = {top - rows * pixel:.0f} to {top:.0f}",
            "draw it on this very map",
        )
    return Condensation(np.full(city.shape, height, np.float32), mask)


def _read(path: Path) -> dict:
    try:
        document = document_of(path)
    except OSError as error:
        raise MapError(
            f"{path}: {error.strerror}", "a GeoJSON file with a line", "check the path"
        ) from None
    if not isinstance(document.get("type"), str):
        raise MapError(f"{path.name}: JSON that is no GeoJSON", "a file with a line", "export it")
    return document


def _parts(path: Path, document: dict):
    """Of the lines and rings of a document each, float ``(n, 2)``."""
    waiting: list[tuple[object, int]] = [(document, 0)]
    while waiting:
        node, depth = waiting.pop()
        if not isinstance(node, dict) or depth > 20:
            continue
        kind, inner = node.get("type"), node.get("coordinates")
        try:
            if kind == "FeatureCollection":
                below = node["features"]
            elif kind == "Feature":
                below = [node["geometry"]]
            elif kind == "GeometryCollection":
                below = node["geometries"]
            else:
                below = []
                yield from map(_points, _rows(kind, inner))
            waiting += [(one, depth + 1) for one in reversed(below)]
        except (TypeError, KeyError, ValueError, OverflowError, IndexError) as error:
            raise MapError(
                f"{path.name}: coordinates that cannot be read ({error})",
                "lists of [x, y], finite numbers",
                "repair or delete this feature, for example in QGIS",
            ) from None


def _rows(kind: object, inner: object) -> Sequence:
    if kind == "LineString":
        return [inner]
    if kind in ("MultiLineString", "Polygon"):
        return list(inner)
    if kind == "MultiPolygon":
        return [ring for rings in inner for ring in rings]
    return []


def _points(row: Sequence) -> np.ndarray:
    points = np.array([(float(one[0]), float(one[1])) for one in row], np.float64).reshape(-1, 2)
    if not np.isfinite(points).all():
        raise ValueError("a number that is not finite")
    return points


def _moved(line: np.ndarray, source, target, name: str) -> np.ndarray:
    found = np.column_stack(moved(*line.T, source, target))
    if not np.isfinite(found).all():
        raise MapError(
            f"{name}: points that have no place in {code_of(target)[:60]}",
            "points near each other on Earth",
            "repair the coordinates",
        )
    return found


__all__ = [
    "MOST_POINTS",
    "WIDEST",
    "PlacedLines",
    "condensation_along",
    "crs_told",
    "line_on",
    "read_lines",
    "write_lines",
]
