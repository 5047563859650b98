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
from evocity.errors import MapError, check_number, keyword
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
    """Polylines, the reference system of their coordinates, and their attribution.

    Each line is a float array ``(n, 2)`` in metres, with x to the east and y to the north. The
    field ``crs`` is a code, a plain PROJ string, or None for lines without a place on Earth. The
    field ``attribution`` is the credit that the licence of the file demands.
    """

    lines: tuple[np.ndarray, ...]
    crs: str | None
    attribution: str = ""


def read_lines(path: str | os.PathLike) -> PlacedLines:
    """Read the lines of a GeoJSON file: LineStrings and the rings of polygons, in the order of the
    file.

    Coordinates in degrees (RFC 7946) are projected to metres; the middle of the lines is the centre
    of the projection. Coordinates stay unchanged if a ``crs`` member names a metric reference
    system. A document with ``"window": true`` has no place on Earth; its coordinates are metres
    from a south-west corner. The function leaves out repeated points, and lines of a single point.

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
            f"{path.name}: the middle of its lines, {lon:g}, {lat:g}, is not a longitude and "
            "latitude",
            "coordinates as longitude and latitude in degrees",
            'do one of these: repair the coordinates; add a "crs" member; set "window": true for '
            "metres without a reference system",
        )
    target = parse_crs(portable_code(local_metres(round(lon, 6), round(lat, 6))), path.name)
    moved = tuple(_transform_line(line, source, target, path.name) for line in lines)
    return PlacedLines(moved, portable_code(target), attribution)


def write_lines(placed: PlacedLines, path: str | os.PathLike) -> None:
    """Write lines as GeoJSON that `read_lines` can read. Lines with a place on Earth are written in
    degrees; lines without a place on Earth are written in metres, with ``"window": true``. Raises
    `MapError` if the file cannot be written."""
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
    """Convert a ``line`` ``(n, 2)`` from the reference system ``crs`` to the coordinates of a city.

    The coordinates of a city with a place on Earth are in the city's reference system; the
    coordinates of other cities are metres from the city's south-west corner. A line without ``crs``
    is in metres from the south-west corner of the city. Raises `MapError` if the line has a place
    on Earth but the city has no place on Earth.
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
    """Make a condensation of a strip along a ``line``, ``(n, 2)`` in the coordinates of the map.

    A pixel of ``city`` belongs to the strip if its centre lies within ``width`` / 2 metres of the
    line. All pixels of the strip get the height ``height``, metres: 0 for ground or water, more for
    a wall.

    Raises `MapError` if the width is less than a pixel or more than the constant ``WIDEST``. The
    height of the strip must be 0 to 1000 m. A line that crosses itself, or covers no pixel of the
    map, raises MapError.
    """
    pixel, (rows, columns) = city.metres_per_pixel, city.shape
    if not pixel <= width <= WIDEST:
        raise MapError(
            f"{keyword('width', width)} m on pixels of {pixel:g} m",
            f"{pixel:g}…{WIDEST:g} m",
            "widen it, or make the map with smaller pixels" if width < pixel else "narrow it",
        )
    expected = f"a height from 0 m (ground, water) to {TALLEST:g} m"
    check_number("height", height, 0, TALLEST, expected, MapError)
    drawn = shapely.linestrings(line)
    if not drawn.is_simple:
        raise MapError(
            "the line crosses itself",
            "a line without crossings",
            "draw the line again, or simplify it",
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
            f"a line that crosses the map: x = {left:.0f} to {left + columns * pixel:.0f}, y = "
            f"{top - rows * pixel:.0f} to {top:.0f}",
            "draw the line on this map",
        )
    return Condensation(np.full(city.shape, height, np.float32), mask)


def _transform_line(line: np.ndarray, source, target, name: str) -> np.ndarray:
    points = np.column_stack(transform_points(*line.T, source, target))
    if not np.isfinite(points).all():
        raise MapError(
            f"{name}: some points cannot be converted to {code_of(target)[:60]}",
            "points that lie near each other on Earth",
            "repair the coordinates",
        )
    return points
