"""Writers of footprints with heights: GeoPackage and GeoJSON, a polygon for each building, with the
straight walls of `CityMap.walls` or, raw, the pixels' edges of `CityMap.outline`. The GeoPackage
also has the street graph. The files name the window, so that readers find it again."""

import json
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS

from evocity.citymap import CityMap, Walls
from evocity.errors import MapError, keyword
from evocity.io.projection import (
    WGS84,
    code_of,
    is_metric,
    portable_code,
    transform_points,
    transform_polygons,
)
from evocity.io.rasterization import crs_of

#: Name of the layer of a GeoPackage, and of those with its streets.
LAYER = "buildings"
EDGES, NODES, PLACES = "street_edges", "street_nodes", "places"

#: The key of the window's middle in a layer's metadata: "lon lat", or "x y" in local metres.
CENTER_TAG = "EVOCITY_CENTER"

#: The meaning of the heights, written into the files.
HEIGHTS = "mean height above ground of the building's pixels, metres"

# The name of GDAL's GeoPackage for metres without a place on Earth (srs_id -1).
_NOWHERE = (
    'ENGCRS["Undefined Cartesian SRS",EDATUM["unknown"],CS[Cartesian,2],'
    'AXIS["x",east],AXIS["y",north],LENGTHUNIT["metre",1]]'
)

# Digits of a degree: 1 cm.
_DIGITS = 7


def write_geopackage(
    city: CityMap,
    path: Path,
    raw: bool = False,
    streets: bool = False,
    walls: Walls | None = None,
    columns: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write the layer `LAYER` of a GeoPackage, in the map's reference system; in metres from its
    south-west corner if it has none. ``raw``: pixels' edges instead of straight walls. ``walls``:
    these instead of `CityMap.walls`, with additional ``columns``. ``streets``: also the layers
    `EDGES`, `NODES` and `PLACES` of `CityMap.street_graph`, and the quarter of each building."""
    crs, tags = _NOWHERE, {"NAME": city.name, "ATTRIBUTION": city.attribution, "HEIGHT": HEIGHTS}
    x, y = _middle(city)
    if is_placed(city):
        own = _system(city, path.name)
        crs = code_of(own)
        x, y = transform_points(x, y, own, WGS84)
    tags[CENTER_TAG] = f"{float(x)!r} {float(y)!r}"
    polygons, *values = _footprints(city, raw, walls)
    fields = dict(zip(_FIELDS, values, strict=True)) | dict(columns or {})
    if streets:
        fields["quarter"] = city.street_graph.quarters[values[0] - 1] + np.int32(1)
    _layer(city, path, crs, LAYER, "Polygon", _orient(polygons), fields, tags)
    if streets:
        about = {key: tags[key] for key in ("NAME", "ATTRIBUTION")}
        for name, kind, shapes, fields in _street_layers(city):
            _layer(city, path, crs, name, kind, shapes, fields, about)


def _layer(
    city: CityMap,
    path: Path,
    crs: str,
    name: str,
    kind: str,
    shapes: np.ndarray,
    fields: dict[str, np.ndarray],
    tags: dict[str, str],
) -> None:
    """Write one layer: `LAYER` makes the file, the others are added. Raises `OSError`."""
    import pyogrio  # which loads pandas, if it is there
    from pyogrio.errors import DataLayerError, DataSourceError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL warns of an empty layer
        try:
            pyogrio.raw.write(
                path,
                geometry=shapely.to_wkb(shapes),
                field_data=list(fields.values()),
                fields=list(fields),
                layer=name,
                driver="GPKG",
                geometry_type=kind,
                crs=crs,
                layer_metadata={key: text for key, text in tags.items() if text},
                layer_options={
                    "IDENTIFIER": city.name if name == LAYER else f"{city.name}: {name}",
                    "DESCRIPTION": city.attribution,
                },
                append=name != LAYER,
            )
        except (DataSourceError, DataLayerError) as error:
            raise OSError(str(error)) from error


def _street_layers(city: CityMap) -> Iterator[tuple[str, str, np.ndarray, dict]]:
    """Yield name, kind of geometry, geometry and columns of each layer of the streets. Nodes,
    streets, quarters and places count from 1; 0 means no place."""
    graph, one = city.street_graph, np.int32(1)
    ends = graph.ends + one
    edges = {
        "id": np.arange(1, len(graph) + 1, dtype=np.int32),
        "u": np.ascontiguousarray(ends[:, 0]),
        "v": np.ascontiguousarray(ends[:, 1]),
        "length": np.round(graph.length, 3),
        "width": np.round(graph.width, 3),
        "least": np.round(graph.least, 3),
        "kind": graph.kind.astype(object),
        "street": graph.street + one,
        "place": graph.place + one,
        "leaves": graph.leaves,
    }
    yield EDGES, "LineString", np.array(graph.edges, dtype=object), edges
    nodes = {
        "id": np.arange(1, len(graph.nodes) + 1, dtype=np.int32),
        "degree": graph.degree,
        "at_frame": graph.at_frame,
    }
    yield NODES, "Point", shapely.points(graph.nodes), nodes
    places = graph.places
    columns = {
        "id": np.arange(1, len(places) + 1, dtype=np.int32),
        "area": np.round(places.area, 3),
        "width": np.round(places.width, 3),
    }
    yield PLACES, "Polygon", _orient(np.array(places.polygons, dtype=object)), columns


def write_geojson(city: CityMap, path: Path, raw: bool = False) -> None:
    """Write GeoJSON after RFC 7946, in WGS84; raises `MapError` for a map without a place on Earth.
    ``raw``: pixels' edges instead of straight walls."""
    if not is_placed(city):
        raise no_geojson(city.name)
    crs = _system(city, path.name)
    polygons, *columns = _footprints(city, raw)
    polygons = _round_degrees(transform_polygons(polygons, crs, WGS84), city.name)
    head = {
        "type": "FeatureCollection",
        "name": city.name,
        "attribution": city.attribution,
        "heights": HEIGHTS,
        "window": _window(city, crs),
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
    code = f"EPSG:{(32600 if lat >= 0 else 32700) + int((lon + 180) // 6) % 60 + 1}"
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
    return _orient(polygons)


def _orient(polygons: np.ndarray) -> np.ndarray:
    """Orient polygons: shells counter-clockwise, holes clockwise."""
    turned = np.empty(len(polygons), dtype=object)
    for number, polygon in enumerate(polygons):
        simple = isinstance(polygon, shapely.Polygon)
        turned[number] = shapely.geometry.polygon.orient(polygon) if simple else polygon
    return turned


def _to_json(what: dict) -> str:
    return json.dumps(what, ensure_ascii=False, allow_nan=False)
