"""Footprints with heights for files, and the writer of GeoJSON: a polygon for each building, with
the straight walls of `CityMap.walls` or, raw, the edges of pixels (`CityMap.outline`). The files
name the window, so that readers find it again."""

import json
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
import shapely
from pyproj import CRS

from evocity.citymap import CityMap, Classes, Walls
from evocity.errors import MapError, keyword
from evocity.io.export.reference_systems import (
    export_system,
    file_system,
    utm_code,
)
from evocity.io.projection import (
    WGS84,
    code_of,
    is_metric,
    portable_code,
    transform_points,
    transform_polygons,
)
from evocity.io.rasterization import crs_of

#: Name of the layer of buildings.
LAYER = "buildings"

#: The key of the window's middle in a layer's metadata: "lon lat", or "x y" in local metres.
CENTER_TAG = "EVOCITY_CENTER"

#: The key of evocity's tags in the metadata of a GeoParquet file.
TAGS = b"evocity"

#: The meaning of the heights, written into the files.
HEIGHTS = "mean height above ground of the building's pixels, metres"

# Digits of a degree: 1 cm.
_DIGITS = 7


class Footprints(NamedTuple):
    """Polygons of buildings for a file: their columns, tags of the file, and the reference system,
    None for metres from the map's south-west corner."""

    polygons: np.ndarray
    fields: dict[str, np.ndarray]
    tags: dict[str, str]
    system: str | None


def footprints_of(
    city: CityMap,
    name: str,
    *,
    raw: bool = False,
    walls: Walls | None = None,
    columns: Mapping[str, np.ndarray] | None = None,
    classes: Classes | None = None,
    crs: str | None = None,
) -> Footprints:
    """Return the footprints of a map for the file ``name``: `CityMap.walls`, with ``raw`` the
    pixels' edges, or the given ``walls``. The additional ``columns`` follow those of `_FIELDS`;
    without a column ``class``, it comes from ``classes`` or `CityMap.classes`. ``crs`` names
    another reference system than the map's."""
    polygons, *values = _footprints(city, raw, walls)
    fields = dict(zip(_FIELDS, values, strict=True)) | dict(columns or {})
    if "class" not in fields:
        table = city.classes if classes is None else classes
        fields["class"] = np.array(table.names, dtype=object)[table.of_buildings[values[0] - 1]]
    tags = {"NAME": city.name, "ATTRIBUTION": city.attribution, "HEIGHT": HEIGHTS}
    (x, y), system = _middle(city), None
    target = export_system(city, crs, metres=False)
    if is_placed(city):
        own = _system(city, name)
        system = file_system(code_of(own if target is None else target))
        polygons = moved(polygons, city, target)
        x, y = transform_points(x, y, own, WGS84)
    tags[CENTER_TAG] = f"{float(x)!r} {float(y)!r}"
    return Footprints(orient(polygons), fields, tags, system)


def moved(shapes: np.ndarray, city: CityMap, target: CRS | None) -> np.ndarray:
    """Convert shapes of a map to the reference system ``target``; None keeps them."""
    if target is None:
        return shapes
    return transform_polygons(shapes, crs_of(city, city.name), target)


def write_geojson(city: CityMap, path: Path, raw: bool = False, crs: str | None = None) -> None:
    """Write GeoJSON after RFC 7946, in WGS84; raises `MapError` for a map without a place on Earth,
    or another ``crs``. ``raw``: pixels' edges instead of straight walls."""
    if not is_placed(city):
        raise no_geojson(city.name)
    target = export_system(city, crs, metres=False)
    if target is not None and target not in (WGS84, CRS.from_user_input("OGC:CRS84")):
        raise MapError(
            f"{keyword('crs', crs)} cannot be the reference system of a GeoJSON file",
            "EPSG:4326, because RFC 7946 allows only longitude and latitude",
            f"write a .gpkg or .geoparquet file, or leave {keyword('crs')} out",
        )
    own = _system(city, path.name)
    polygons, *columns = _footprints(city, raw)
    polygons = _round_degrees(transform_polygons(polygons, own, WGS84), city.name)
    head = {
        "type": "FeatureCollection",
        "name": city.name,
        "attribution": city.attribution,
        "heights": HEIGHTS,
        "window": _window(city, own),
    }
    if len(polygons):
        head["bbox"] = shapely.total_bounds(polygons).tolist()
    rows = zip(*(column.tolist() for column in columns), strict=True)
    features = (
        _to_json(
            {
                "type": "Feature",
                "properties": dict(zip(_FIELDS, row, strict=True)),
                "geometry": shapely.geometry.mapping(polygon),
            }
        )
        for row, polygon in zip(rows, polygons, strict=True)
    )
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(_to_json(head)[:-1] + ', "features": [')
        for number, feature in enumerate(features):
            file.write((",\n" if number else "\n") + feature)
        file.write("\n]}\n")


def is_placed(about) -> bool:
    """Tell whether a map or genome has a place on Earth, by its ``crs`` and ``origin``."""
    return about.crs is not None and about.origin is not None


def placement(city: CityMap) -> tuple[str | None, tuple[float, float]]:
    """Return a map's reference system, a code or PROJ string or None, and (x, y) of the middle of
    its window there."""
    return (portable_code(crs_of(city, city.name)) if is_placed(city) else None), _middle(city)


def coded_grid(city: CityMap) -> tuple[str, Callable[[np.ndarray], np.ndarray]] | None:
    """Return the code of the UTM zone of a map whose reference system has no code, and the function
    that converts points ``(n, 2)`` of the map to it. None for maps with a code or without a place.
    """
    if not is_placed(city):
        return None
    own = crs_of(city, city.name)
    if not code_of(own).startswith("PROJCRS"):
        return None
    lon, lat = transform_points(*_middle(city), own, WGS84)
    if not (abs(lon) <= 180 and abs(lat) <= 84):
        return None
    code = utm_code(lon, lat)
    zone = CRS.from_user_input(code)
    return code, lambda points: np.column_stack(transform_points(*points.T, own, zone))


def no_geojson(name: str) -> MapError:
    """Make the error for GeoJSON of a map without a place on Earth."""
    return MapError(
        f"{name} has no position in a reference system, but GeoJSON needs longitude and latitude",
        "a map with a coordinate reference system and an origin, which evocity converts to WGS84",
        "write a .gpkg, which accepts local metres; or give the map the coordinates of a source "
        f"city with {keyword('at')}",
    )


#: The columns of each polygon.
_FIELDS = ("id", "height", "area")


def _footprints(
    city: CityMap, raw: bool, walls: Walls | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the polygons of the buildings, and the columns of `_FIELDS`: numbers, heights in m,
    areas in m²."""
    buildings = city.buildings
    if raw:
        polygons, areas = np.array(city.outline, dtype=object), buildings.area
        numbers, heights = np.arange(1, len(buildings) + 1, dtype=np.int32), buildings.height
    else:
        walls = city.walls if walls is None else walls
        polygons = np.array(walls.polygons, dtype=object)
        numbers, heights = walls.buildings, walls.heights
        areas = np.round(shapely.area(polygons), 3)
    # the shortest text of a float32, as the map's heights are: 9.2, not 9.199999809
    short = [float(str(height)) for height in heights.astype(np.float32)]
    return polygons, numbers, np.array(short, dtype=float), areas


def _system(city: CityMap, name: str) -> CRS:
    """Return the reference system of a placed map; raises `MapError` unless it has metres and is
    valid there."""
    crs = crs_of(city, name)
    if not is_metric(crs):
        raise MapError(
            f"{city.name}: its reference system {crs.name[:80]!r} is not in metres",
            "a map whose reference system is in metres",
            "read the map with evocity.read_map, which projects to metres",
        )
    middle = _middle(city)
    again = transform_points(
        *transform_points(*middle, crs, WGS84), WGS84, crs
    )  # PROJ computes beyond its range
    if not np.allclose(again, middle, rtol=0, atol=city.metres_per_pixel):
        raise _range_error(city.name)
    return crs


def _range_error(name: str) -> MapError:
    return MapError(
        f"{name} lies across the 180th meridian, or outside the area of its reference system",
        "a map on one side of this meridian, inside the area of its reference system",
        "write a .gpkg, which keeps the map's own coordinates, or a raster",
    )


def read_center(path: Path, metadata: Mapping[str, str]) -> tuple[float, float] | None:
    """Read the middle of the window from the ``metadata`` of a file of evocity; None without."""
    text = metadata.get(CENTER_TAG)
    if text is None:
        return None
    try:
        x, y = (float(number) for number in text.split())
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise MapError(
            f"{path.name}: the metadata entry {CENTER_TAG} = {text[:80]!r} is invalid",
            "two numbers, longitude and latitude",
            "correct this entry, or remove it to use the middle of the buildings",
        )
    return x, y


def _middle(city: CityMap) -> tuple[float, float]:
    """Return the middle of the smallest square window on the map's pixels that covers it."""
    (rows, columns), side = city.shape, city.metres_per_pixel
    most, (left, top) = max(rows, columns), city.north_west
    x = left - (most - columns) // 2 * side + most * side / 2
    y = top + (most - rows) // 2 * side - most * side / 2
    return x, y


def _window(city: CityMap, crs: CRS) -> dict[str, object]:
    lon, lat = transform_points(*_middle(city), crs, WGS84)
    window = {"center": [float(lon), float(lat)]}
    window["side_m"] = max(city.shape) * city.metres_per_pixel
    if projection := portable_code(crs):
        window["projection"] = projection  # without one, readers choose a local projection
    return window


def _round_degrees(polygons: np.ndarray, name: str) -> np.ndarray:
    """Round polygons of WGS84 to `_DIGITS` digits, and keep them valid."""
    if not len(polygons):
        return polygons
    west, south, east, north = shapely.total_bounds(polygons)
    if not (east - west < 180 and abs(south) <= 90 and abs(north) <= 90):
        raise _range_error(name)
    polygons = shapely.transform(polygons, lambda points: np.round(points, _DIGITS))
    broken = ~shapely.is_valid(polygons)
    polygons[broken] = shapely.make_valid(
        polygons[broken], method="structure", keep_collapsed=False
    )
    return orient(polygons)


def orient(polygons: np.ndarray) -> np.ndarray:
    """Orient polygons: shells counter-clockwise, holes clockwise."""
    turned = np.empty(len(polygons), dtype=object)
    for number, polygon in enumerate(polygons):
        simple = isinstance(polygon, shapely.Polygon)
        turned[number] = shapely.geometry.polygon.orient(polygon) if simple else polygon
    return turned


def _to_json(what: dict) -> str:
    return json.dumps(what, ensure_ascii=False, allow_nan=False)
