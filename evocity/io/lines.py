"""Lines in GeoJSON files and on maps: polylines in metres, and strips of pixels along them."""

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely
from rasterio.features import rasterize

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import MapError, keyword
from evocity.formats.geojson_lines import lines_in, read_document
from evocity.io.geojson import parse_crs_member
from evocity.io.heights import TALLEST
from evocity.io.projection import (
    WGS84,
    code_of,
    is_metric,
    local_metres,
    parse_crs,
    portable_code,
    transform_points,
)
from evocity.io.rasterization import crs_of
from evocity.io.reader_types import north_up
from evocity.io.writers import open_output

#: The widest strip along a line, metres.
WIDEST = 1000.0


@dataclass(frozen=True, eq=False)
class PlacedLines:
    """Polylines with their reference system.

    Each line is float ``(n, 2)``, metres: x to the east, y to the north. The field ``crs`` is a
    code or a plain PROJ string; it is None for lines without a place on Earth. The field
    ``attribution`` is the line that the licence of the file demands.
    """

    lines: tuple[np.ndarray, ...]
    crs: str | None
    attribution: str = ""


def read_lines(path: str | os.PathLike) -> PlacedLines:
    """Read the lines of a GeoJSON file: LineStrings and the rings of polygons, in their order.

    Degrees (RFC 7946) become metres, in a projection about the middle of the lines. If a ``crs``
    member names a metric reference system, the coordinates stay. A document with ``"window": true``
    has metres from the south-west corner of a window without a place on Earth. A point equal to the
    point before it is left out; so is a line of one point.

    Raises `MapError` if the file is not GeoJSON, has no lines, or has too many points.
    """
    path = Path(path)
    document = read_document(path)
    if not isinstance(document.get("type"), str):
        raise MapError(
            f"{path.name} is not GeoJSON",
            "a GeoJSON file with a line",
            "export the line as GeoJSON",
        )
    read = lines_in(document, path.name)
    lines = tuple(line for line in read if len(line) > 1)
    if not lines:
        raise MapError(
            f"{path.name}: " + ("only lines of one point" if read else "no line in its features"),
            "a LineString or a polygon",
            "draw one, for example in QGIS",
        )
    attribution = document.get("attribution")
    attribution = attribution if isinstance(attribution, str) else ""
    if document.get("window") is True:
        return PlacedLines(lines, None, attribution)
    source = parse_crs_member(path, document.get("crs"))
    if source is not WGS84 and is_metric(source):
        return PlacedLines(lines, portable_code(source), attribution)
    points = np.vstack(lines)
    lon, lat = transform_points(*((points.min(axis=0) + points.max(axis=0)) / 2), source, WGS84)
    if not (math.isfinite(lon) and abs(lon) <= 180 and abs(lat) < 90):
        raise MapError(
            f"{path.name}: its lines lie about {lon:g}, {lat:g}, which is not on Earth",
            "longitude and latitude in degrees",
            'repair the coordinates, or add a "crs" member; or set "window": true for '
            "metres without a place on Earth",
        )
    target = parse_crs(portable_code(local_metres(round(lon, 6), round(lat, 6))), path.name)
    moved = tuple(_transform_line(line, source, target, path.name) for line in lines)
    return PlacedLines(moved, portable_code(target), attribution)


def write_lines(placed: PlacedLines, path: str | os.PathLike) -> None:
    """Write lines as GeoJSON, as `read_lines` reads them: in degrees if they lie on Earth, else in
    metres with ``"window": true``. Raises `MapError` if the file cannot be written."""
    lines = list(placed.lines)
    if placed.crs is not None:
        source = parse_crs(placed.crs, "crs")
        lines = [_transform_line(line, source, WGS84, "a line") for line in lines]
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
    with open_output(Path(path)) as temporary:
        temporary.write_text(json.dumps(document) + "\n", encoding="utf-8")


def crs_code(city: CityMap) -> str | None:
    """Name a city's reference system by code or plain PROJ string; None for a city without a place
    on Earth."""
    return None if city.origin is None else portable_code(crs_of(city, city.name))


def line_on(city: CityMap, line: np.ndarray, crs: str | None) -> np.ndarray:
    """Convert a ``line`` ``(n, 2)`` of ``crs`` to the coordinates of a city.

    These are in the city's reference system, or in metres from its south-west corner if it has no
    place on Earth. A line without ``crs`` is in metres from that corner. Raises `MapError` if the
    line lies on Earth and the city does not.
    """
    if crs is None:
        if city.origin is None:
            return line
        left, top = city.origin
        return line + np.array([left, top - city.shape[0] * city.metres_per_pixel])
    return _transform_line(line, parse_crs(crs, "the line"), crs_of(city, "the line"), "the line")


def condensation_along(
    city: CityMap, line: np.ndarray, width: float, height: float = 0.0
) -> Condensation:
    """Make a condensation of a strip along a ``line`` ``(n, 2)``, in the coordinates of the map.

    Pixels of ``city`` belong to the strip if their centres lie within half a ``width`` of the line,
    metres. They become ``height`` metres high: 0 for ground or water, more for a wall.

    Raises `MapError` if the width is below a pixel or over `WIDEST`, or the height is beyond 0…1000
    m. Raises it too if the line crosses itself, or covers no pixel of the map.
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
            f"{keyword('height', height)} m is out of range",
            f"0 (ground, water) to {TALLEST:g} m",
            "correct the height",
        )
    drawn = shapely.linestrings(line)
    if not drawn.is_simple:
        raise MapError(
            "the line crosses itself",
            "a line without crossings",
            "correct the line, or drop or reduce its details",
        )
    left, top = city.north_west
    mask = rasterize(
        [(shapely.buffer(drawn, width / 2), 1)],
        out_shape=city.shape,
        transform=north_up(left, top, pixel),
        dtype="uint8",
    ).astype(bool)
    if not mask.any():
        west, south, east, north = drawn.bounds
        raise MapError(
            f"the line from x = {west:.0f} to {east:.0f} and y = {south:.0f} to {north:.0f} "
            f"covers no pixel of {city.name}",
            f"a line that meets x = {left:.0f} to {left + columns * pixel:.0f} and "
            f"y = {top - rows * pixel:.0f} to {top:.0f}",
            "draw the line on this map",
        )
    return Condensation(np.full(city.shape, height, np.float32), mask)


def _transform_line(line: np.ndarray, source, target, name: str) -> np.ndarray:
    points = np.column_stack(transform_points(*line.T, source, target))
    if not np.isfinite(points).all():
        raise MapError(
            f"{name}: some points have no place in {code_of(target)[:60]}",
            "points near each other on Earth",
            "repair the coordinates",
        )
    return points
