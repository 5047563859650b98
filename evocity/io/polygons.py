"""Maps written as footprints with heights: GeoPackage and GeoJSON, a polygon a building; and a
GeoPackage with the graph of the streets beside them.

The buildings are those of `CityMap.buildings`, with the straight walls of `CityMap.walls`, or, raw,
the pixels' edges of `CityMap.outline`. What a reader needs to lay the same window about them is
written beside them.
"""

import json
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
import shapely
from pyproj import CRS

from evocity.citymap import CityMap, Walls
from evocity.errors import MapError, keyword
from evocity.io.burning import crs_of
from evocity.io.projection import WGS84, code_of, is_metric, moved, moved_polygons, plainly

#: Name of the layer of a GeoPackage, and of those with its streets.
LAYER = "buildings"
EDGES, NODES, PLACES = "street_edges", "street_nodes", "places"

#: The middle of the window in a layer's metadata: "lon lat", or "x y" where the layer has no
#: place on Earth.
CENTER_TAG = "EVOCITY_CENTER"

#: What the heights are, for whoever opens the file.
HEIGHTS = "mean height above ground of the building's pixels, metres"

# What GDAL's GeoPackage calls metres that lie nowhere on Earth (srs_id -1).
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
    """A GeoPackage of the layer `LAYER`, in the map's reference system; in metres from its
    south-west corner if it has none. ``raw``: pixels' edges in place of straight walls.
    ``walls``: in place of `CityMap.walls`, with ``columns`` of their own. ``streets``:
    `CityMap.street_graph` too, as layers `EDGES`, `NODES` and `PLACES`, and of each building its
    quarter."""
    crs, tags = _NOWHERE, {"NAME": city.name, "ATTRIBUTION": city.attribution, "HEIGHT": HEIGHTS}
    x, y = _middle(city)
    if is_placed(city):
        own = _system(city, path.name)
        crs = code_of(own)
        x, y = moved(x, y, own, WGS84)
    tags[CENTER_TAG] = f"{float(x)!r} {float(y)!r}"
    polygons, *told = _footprints(city, raw, walls)
    fields = dict(zip(_FIELDS, told, strict=True)) | dict(columns or {})
    if streets:
        fields["quarter"] = city.street_graph.quarters[told[0] - 1] + np.int32(1)
    _layer(city, path, crs, LAYER, "Polygon", _oriented(polygons), fields, tags)
    if streets:
        told = {key: tags[key] for key in ("NAME", "ATTRIBUTION")}
        for name, kind, shapes, fields in _street_layers(city):
            _layer(city, path, crs, name, kind, shapes, fields, told)


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
    """Write one layer; but for the first, beside those that are there. Raises `OSError`."""
    import pyogrio  # which loads pandas, if it is there
    from pyogrio.errors import DataLayerError, DataSourceError

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GDAL's, of an empty layer
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
    """Name, kind of geometry, geometry and columns of each layer of the streets. Nodes, streets,
    quarters and places count from 1; 0 is no place."""
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
    yield PLACES, "Polygon", _oriented(np.array(places.polygons, dtype=object)), columns


def write_geojson(city: CityMap, path: Path, raw: bool = False) -> None:
    """GeoJSON after RFC 7946, in WGS84; `MapError` if the map has no place on Earth. ``raw``:
    pixels' edges in place of straight walls."""
    if not is_placed(city):
        raise no_geojson(city.name)
    crs = _system(city, path.name)
    polygons, *columns = _footprints(city, raw)
    polygons = _rounded(moved_polygons(polygons, crs, WGS84), city.name)
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
        _dumped(
            {
                "type": "Feature",
                "properties": dict(zip(_FIELDS, row, strict=True)),
                "geometry": shapely.geometry.mapping(polygon),
            }
        )
        for row, polygon in zip(rows, polygons, strict=True)
    )
    with open(path, "w", encoding="utf-8", newline="\n") as file:
        file.write(_dumped(head)[:-1] + ', "features": [')
        for number, feature in enumerate(features):
            file.write((",\n" if number else "\n") + feature)
        file.write("\n]}\n")


def is_placed(about) -> bool:
    """Whether a map's, a genome's or a fabric's ``crs`` and ``origin`` say where on Earth it is."""
    return about.crs is not None and about.origin is not None


def placing(city: CityMap) -> tuple[str | None, tuple[float, float]]:
    """By what code or PROJ string a map's reference system is found again, None if by none; and
    (x, y) of the middle of its window there."""
    return (plainly(crs_of(city, city.name)) if is_placed(city) else None), _middle(city)


def no_geojson(name: str) -> MapError:
    """Why a map that lies nowhere on Earth is not written as GeoJSON."""
    return MapError(
        f"{name} has no place on Earth, and GeoJSON has no coordinates but longitude and latitude",
        "a map with a reference system (RFC 7946 knows WGS84 alone)",
        "write a .gpkg, which takes local metres; or, for a child of a run, name the source city "
        f"on whose ground it is laid, with {keyword('at')}",
    )


#: What is told of each polygon.
_FIELDS = ("id", "height", "area")


def _footprints(
    city: CityMap, raw: bool, walls: Walls | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Polygons of the buildings, and the columns of `_FIELDS`: numbers, heights in m, areas in
    m²."""
    buildings = city.buildings
    if raw:
        polygons, areas = np.array(city.outline, dtype=object), buildings.area
        numbers, heights = np.arange(1, len(buildings) + 1, dtype=np.int32), buildings.height
    else:
        walls = city.walls if walls is None else walls
        polygons = np.array(walls.polygons, dtype=object)
        numbers, heights = walls.buildings, walls.heights
        areas = np.round(shapely.area(polygons), 3)
    # as short as float32, which the map's own heights are, can be told: 9.2, not 9.199999809
    short = [float(str(height)) for height in heights.astype(np.float32)]
    return polygons, numbers, np.array(short, dtype=float), areas


def _corner(city: CityMap) -> tuple[float, float]:
    """The north-west corner, where `CityMap.outline` has it."""
    return city.origin or (0.0, city.shape[0] * city.metres_per_pixel)


def _system(city: CityMap, name: str) -> CRS:
    """The reference system of a placed map; `MapError` unless it is one of metres that holds
    there."""
    crs = crs_of(city, name)
    if not is_metric(crs):
        raise MapError(
            f"{city.name}: reference system {crs.name[:80]!r}, not of metres",
            "a map whose pixels are metres of its reference system",
            "read it with evocity.read_map, which projects to metres",
        )
    middle = _middle(city)
    again = moved(*moved(*middle, crs, WGS84), WGS84, crs)  # beyond a system PROJ tells anything
    if not np.allclose(again, middle, rtol=0, atol=city.metres_per_pixel):
        raise _beyond(city.name)
    return crs


def _beyond(name: str) -> MapError:
    return MapError(
        f"{name} lies across the 180th meridian, or beyond its reference system",
        "a map on one side of it, where its reference system holds",
        "write a .gpkg, which keeps the map's own coordinates, or a raster",
    )


def _middle(city: CityMap) -> tuple[float, float]:
    """The middle of the smallest square window on the map's own pixels that covers it."""
    (rows, columns), side = city.shape, city.metres_per_pixel
    most, (left, top) = max(rows, columns), _corner(city)
    x = left - (most - columns) // 2 * side + most * side / 2
    y = top + (most - rows) // 2 * side - most * side / 2
    return x, y


def _window(city: CityMap, crs: CRS) -> dict[str, object]:
    """The member ``window``: what `read_map` shall look at, as in the bundled districts."""
    lon, lat = moved(*_middle(city), crs, WGS84)
    window = {"center": [float(lon), float(lat)]}
    window["side_m"] = max(city.shape) * city.metres_per_pixel
    if told := plainly(crs):
        window["projection"] = told  # else a local one is chosen
    return window


def _rounded(polygons: np.ndarray, name: str) -> np.ndarray:
    """Polygons of WGS84 with `_DIGITS` digits, valid."""
    if not len(polygons):
        return polygons
    west, south, east, north = shapely.total_bounds(polygons)
    if not (east - west < 180 and abs(south) <= 90 and abs(north) <= 90):
        raise _beyond(name)
    polygons = shapely.transform(polygons, lambda points: np.round(points, _DIGITS))
    broken = ~shapely.is_valid(polygons)
    polygons[broken] = shapely.make_valid(
        polygons[broken], method="structure", keep_collapsed=False
    )
    return _oriented(polygons)


def _oriented(polygons: np.ndarray) -> np.ndarray:
    """The same polygons, shells counter-clockwise and holes clockwise."""
    turned = np.empty(len(polygons), dtype=object)
    for number, polygon in enumerate(polygons):
        simple = isinstance(polygon, shapely.Polygon)
        turned[number] = shapely.geometry.polygon.orient(polygon) if simple else polygon
    return turned


def _dumped(what: dict) -> str:
    return json.dumps(what, ensure_ascii=False, allow_nan=False)


__all__ = [
    "CENTER_TAG",
    "EDGES",
    "HEIGHTS",
    "LAYER",
    "NODES",
    "PLACES",
    "is_placed",
    "no_geojson",
    "placing",
    "write_geojson",
    "write_geopackage",
]
