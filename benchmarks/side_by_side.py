"""Real map files read by evocity, and side by side by geopandas, rasterio or shapely:
python benchmarks/side_by_side.py FOLDER …

Footprints: square metres of the map's built pixels, and of the union of the outlines that geopandas
reads in the same window, on the ellipsoid. Shapely gets the parsed coordinates of formats that
geopandas cannot read. Rasters: square metres above 2 m, and the largest difference of a value. The
table gives the note of the map where the areas differ by more than .5 %.
"""

import argparse
import json
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from pathlib import Path

import geopandas
import numpy as np
import osmium
import rasterio
import shapely
from _machine import description
from pyproj import Geod

import evocity
from evocity.citymap import BUILT_ABOVE
from evocity.io import READERS

LIMIT = 0.005
# The side of the window in pixels, and of a pixel in metres.
PIXELS, SIDE = 2048, 0.5

#: Options of some files, for evocity.
OPTIONS = {
    "original-kml-samples.kml": {"layer": "Google Campus"},
    "original-goteborg-cdsm.asc": {"metres_per_pixel": 1.0},
}
#: Layers of some files, for geopandas.
LAYERS = {"original-prague-bubenec.gpkg": "buildings", "original-kml-samples.kml": "Google Campus"}


def outlines_of(path: Path) -> tuple[np.ndarray, str | None, str]:
    """Return the outlines of a file's buildings, their reference system, and who read them."""
    if path.name.endswith((".city.json", ".city.jsonl")):
        return *cityjson(path), "shapely"
    if path.suffix == ".gml":
        return *citygml(path), "shapely"
    if path.name.endswith("overpass.json"):
        ways = json.loads(path.read_text())["elements"]
        rings = [[(at["lon"], at["lat"]) for at in way["geometry"]] for way in ways]
        return np.array([shapely.Polygon(ring) for ring in rings]), "EPSG:4326", "shapely"
    if ".osm" in path.name:  # GDAL leaves out relations before their ways, and parts
        return openstreetmap(path), "EPSG:4326", "shapely"
    if path.suffix == ".parquet":
        table = geopandas.read_parquet(path)
    else:
        table = geopandas.read_file(path, layer=LAYERS.get(path.name), engine="pyogrio")
    return table.geometry.to_numpy(), table.crs.to_wkt(), "geopandas"


def cityjson(path: Path) -> tuple[np.ndarray, str | None]:
    """Project all surfaces of the buildings of a CityJSON document or sequence from above."""
    text = path.read_text()
    documents = [json.loads(line) for line in text.splitlines()] if "jsonl" in path.suffix else []
    documents = documents or [json.loads(text)]
    move = documents[0]["transform"]
    crs = documents[0].get("metadata", {}).get("referenceSystem")
    found = []
    for document in documents:
        points = np.array(document["vertices"] or np.empty((0, 3))) * move["scale"]
        points = points + move["translate"]
        for item in document["CityObjects"].values():
            if not item["type"].startswith("Building"):
                continue
            for geometry in item.get("geometry", []):
                found += list(surfaces(geometry["boundaries"], points[:, :2]))
    return np.array(found), crs


def surfaces(boundaries: list, points: np.ndarray) -> Iterator[shapely.Polygon]:
    """Yield the surfaces of nested lists of vertices."""
    if isinstance(boundaries[0][0], int):
        rings = [points[ring] for ring in boundaries]
        yield shapely.Polygon(rings[0], rings[1:])
        return
    for inner in boundaries:
        yield from surfaces(inner, points)


def citygml(path: Path) -> tuple[np.ndarray, str | None]:
    """Project all polygons of a CityGML document from above."""
    gml = "{http://www.opengis.net/gml}"
    found, root = [], ElementTree.parse(path).getroot()
    for polygon in root.iter(f"{gml}Polygon"):
        rings = []
        for ring in polygon.iter(f"{gml}LinearRing"):
            texts = [one.text or "" for one in ring if one.tag in (f"{gml}posList", f"{gml}pos")]
            rings.append(np.array(" ".join(texts).split(), dtype=float).reshape(-1, 3)[:, :2])
        found.append(shapely.Polygon(rings[0], rings[1:]))
    return np.array(found), "EPSG:25833"


def openstreetmap(path: Path) -> np.ndarray:
    """Build the buildings and parts of an OpenStreetMap file from its nodes."""
    places, ways, relations, found = {}, {}, [], []
    for item in osmium.FileProcessor(path):
        tags = dict(item.tags)
        kinds = {tags.get("building", "no"), tags.get("building:part", "no")}
        if item.is_node():
            places[item.id] = (item.lon, item.lat)
        elif item.is_way():
            ways[item.id] = [places[node.ref] for node in item.nodes if node.ref in places]
            if kinds != {"no"} and item.is_closed() and len(ways[item.id]) == len(item.nodes):
                found.append(shapely.Polygon(ways[item.id]))
        elif kinds != {"no"} and tags.get("type") == "multipolygon":
            relations.append([(member.ref, member.role) for member in item.members])
    for members in relations:  # which may come before their ways
        outer, inner = (
            shapely.union_all(
                shapely.get_parts(
                    shapely.polygonize(
                        [shapely.LineString(ways[ref]) for ref, is_in in members if is_in == side]
                    )
                )
            )
            for side in ("outer", "inner")
        )
        found.append(shapely.difference(outer, inner))
    return np.array(found)


def compare_footprints(path: Path) -> tuple[str, float, float, str, str]:
    """Return reader, square metres of the reader and of evocity, the system of the map and note."""
    options = {"pixels": PIXELS, "metres_per_pixel": SIDE} | OPTIONS.get(path.name, {})
    city = evocity.read_map(path, **options)
    built = float((city.heights > 0).sum()) * city.metres_per_pixel**2
    shapes, crs, reader = outlines_of(path)
    table = geopandas.GeoSeries(shapely.make_valid(shapes), crs=crs).dropna()
    if city.origin is None:
        whole = shapely.union_all(shapely.buffer(table.to_numpy(), 0))
        return reader, whole.area, built, "none", city.taken
    table = table.to_crs(city.crs)
    west, north = city.north_west
    wide = PIXELS * SIDE
    window = shapely.box(west, north - wide, west + wide, north)
    near = table[shapely.intersects(table.to_numpy(), window)].to_numpy()
    whole = shapely.union_all(shapely.intersection(shapely.buffer(near, 0), window))
    places = geopandas.GeoSeries(shapely.get_parts(whole), crs=city.crs).to_crs(4326)
    geod = Geod(ellps="WGS84")
    true = sum(abs(geod.geometry_area_perimeter(one)[0]) for one in shapely.normalize(places))
    code = city.crs if city.crs.startswith("EPSG") else "local"
    return reader, true, built, code, city.taken


def values_of(path: Path) -> tuple[np.ndarray, float]:
    """Return the values of a raster, NaN where missing, and the square metres of a pixel."""
    with rasterio.open(path) as source:
        read = source.read(1, masked=True).astype(float)
        return read.filled(np.nan), abs(source.transform.determinant)


def compare_rasters(path: Path) -> tuple[str, float, float, str, str]:
    """Return rasterio, square metres of rasterio and of evocity, the largest difference, note."""
    values, area = values_of(path)
    options = dict(OPTIONS.get(path.name, {}))
    ground = path.with_name(path.name.replace("-dsm", "-dem"))
    if ground != path:
        options["terrain"] = ground
        values = values - values_of(ground)[0]
    elif "-dem" in path.name:
        options["terrain"] = 0.0
    city = evocity.read_map(path, **options)
    values = np.where(values > 0, values, 0.0)
    built = float((city.heights > BUILT_ABOVE).sum()) * city.metres_per_pixel**2
    apart = "resampled"
    if city.shape == values.shape:
        apart = f"{np.abs(city.heights - values).max():.2g} m"
    return "rasterio", float((values > BUILT_ABOVE).sum()) * area, built, apart, city.taken


def main(folders: list[Path]) -> None:
    warnings.simplefilter("ignore")
    print(description())
    print(
        f"{'file':36} {'beside':9} {'m² beside':>10} {'evocity':>9} {'differs':>8}  "
        "system of the map, or the largest difference of a value"
    )
    faults = []
    for folder in folders:
        for path in sorted(folder.iterdir()):
            if not path.name.endswith(tuple(READERS)):
                continue
            raster = path.suffix in (".tif", ".asc")
            compare = compare_rasters if raster else compare_footprints
            reader, true, built, about, note = compare(path)
            apart = built / true - 1
            line = f"{path.name:36} {reader:9} {true:10.0f} {built:9.0f} {apart:+8.2%}  {about}"
            print(line, flush=True)
            if abs(apart) > LIMIT:
                print(f"    {note}")
                faults.append(path.name)
    print(
        f"{len(faults)} files differ by more than {LIMIT:.1%}{': ' * bool(faults)}"
        f"{', '.join(faults)}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    main(parser.parse_args().folders)
