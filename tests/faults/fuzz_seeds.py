"""Small whole files of every format that is read, to be damaged."""

import json
import shutil
from pathlib import Path

import numpy as np
import osmium
import pyogrio
import rasterio
import shapely
from PIL import Image
from pyproj import CRS

import evocity
from evocity.citymap import CityMap
from evocity.scene.library import Library

ROOT = Path(__file__).parents[2]
OLD = ROOT / "tests" / "old"
DATA = ROOT / "evocity" / "data"

# Those that lie where the map does that they are laid on.
MASKS = ("map.tif", "map-plain.tif", "map.png", "map.npy", "map.geojson", "map.gpkg")

CORNER = (770000.0, 6270000.0)

RECIPE = """
[run]
name = "whole"
seed = 3
population = 8
generations = 3
record = ["gsi", { name = "alignment" }]
[map]
pixels = 64
metres_per_pixel = 2.0
[genome]
block = 4
sigma_max = 0.9
[[parents]]
map = "lyon-1er"
center = [4.8344, 45.7685]
[[parents]]
map = "montpellier-pas-du-loup"
name = "south"
[operators]
pavement_fusion = { weight = 4, size_max = 6, size_min = 2 }
quarter_fusion = { weight = 2, fill = { from = 0.05, to = 0.6 } }
mutation = 2
[[fitness]]
name = "fsi"
goal = "min"
[[fitness]]
name = "salingaros"
[evaluation]
workers = 0
timeout = 60
[search]
algorithm = "nsga2"
[refine]
births = 0
"""


def whole_files(folder: Path) -> dict[str, list[Path]]:
    """Kind of input -> files; of a Shapefile and of folders the one that is named."""
    _polygons(folder), _osm(folder), _rasters(folder), _cityjson(folder)
    for name in ("demo", "recipe"):
        there = DATA / "recipes" / f"{name}.toml"
        (folder / f"{name}.toml").write_text(there.read_text() if there.is_file() else RECIPE)
    maps = sorted(folder.glob("map*"))
    maps = [one for one in maps if one.suffix not in (".dbf", ".shx", ".prj", ".cpg")]
    tables = {"classes": "classes", "kinds": "street-kinds", "types": "building-types"}
    return {
        "map": maps,
        "whole map": [one for one in maps if one.suffix in (".tif", ".png", ".npy")],
        "mask": [one for one in maps if one.name in MASKS],
        "genome": [*sorted(OLD.glob("*.parquet")), _genome(folder)],
        "run": sorted(OLD.glob("run-[1-6]")),
        "told": [OLD / "run-3", OLD / "run-6"],
        "report": [OLD / "run-6"],
        "recipe": [folder / "demo.toml", folder / "recipe.toml"],
        "library": [_library(folder)],
    } | {kind: [DATA / f"{name}.toml"] for kind, name in tables.items()}


def _town() -> np.ndarray:
    rng = np.random.default_rng(0)
    lots = np.where(rng.random((16, 16)) < 0.5, rng.integers(3, 20, (16, 16)), 0)
    return lots.repeat(4, 0).repeat(4, 1).astype(np.float32)


def _genome(folder: Path) -> Path:
    city = CityMap(_town(), 2.0, name="town", origin=CORNER, crs="EPSG:2154")
    evocity.encode(city).genome.write(folder / "genome.parquet")
    return folder / "genome.parquet"


def _library(folder: Path) -> Path:
    city = CityMap(_town(), 2.0, name="town")
    Library.of(city, licence="CC0-1.0", attribution="nobody").write(folder / "library")
    return folder / "library"


def _polygons(folder: Path) -> None:
    at = [(x * 12 + CORNER[0], y * 12 + CORNER[1]) for x, y in np.ndindex(6, 6)]
    boxes = np.array([shapely.box(x, y, x + 9, y + 9) for x, y in at])
    heights = np.arange(36) * 1.5
    for name in ("map.gpkg", "map.shp"):
        pyogrio.raw.write(
            folder / name,
            shapely.to_wkb(boxes),
            [heights, np.array(["yes"] * 36, object)],
            ["height", "building"],
            geometry_type="Polygon",
            crs="EPSG:2154",
        )
    features = [
        {
            "type": "Feature",
            "properties": {"height": float(height), "building": "yes", "note": "a [b] {c}"},
            "geometry": shapely.geometry.mapping(box),
        }
        for box, height in zip(boxes[:6], heights, strict=False)
    ]
    lon, lat = 3.87, 43.53
    for name, crs in (("map.geojson", "EPSG:2154"), ("map-plain.geojson", None)):
        document = {"type": "FeatureCollection", "features": features, "attribution": "somebody"}
        if crs:
            document["crs"] = {"type": "name", "properties": {"name": crs}}
        else:
            moved = json.loads(json.dumps(features))
            for k, one in enumerate(moved):
                ring = np.array(shapely.box(0, 0, 1e-4, 1e-4).exterior.coords)
                moved_ring = ring + np.array([lon + k * 2e-4, lat])
                one["geometry"]["coordinates"] = [moved_ring.tolist()]
            window = {"center": [lon, lat], "projection": "EPSG:2154", "side_m": 200}
            document |= {"features": moved, "window": window}
        (folder / name).write_text(json.dumps(document))


def _osm(folder: Path) -> None:
    square = [(0, 0), (0.001, 0), (0.001, 0.001), (0, 0.001)]
    inner = [(0.0002, 0.0002), (0.0008, 0.0002), (0.0008, 0.0008)]
    nodes = "".join(
        f'<node id="{i}" lat="{y}" lon="{x}" version="1"/>'
        for i, (x, y) in enumerate(square + inner, 1)
    )
    ways = (
        '<way id="1" version="1"><nd ref="1"/><nd ref="2"/><nd ref="3"/><nd ref="4"/><nd ref="1"/>'
        '<tag k="building" v="yes"/><tag k="height" v="12 m"/></way>'
        '<way id="2" version="1"><nd ref="5"/><nd ref="6"/><nd ref="7"/><nd ref="5"/></way>'
    )
    relation = (
        '<relation id="1" version="1"><member type="way" ref="1" role="outer"/>'
        '<member type="way" ref="2" role="inner"/><tag k="type" v="multipolygon"/>'
        '<tag k="building" v="house"/></relation>'
    )
    text = f'<?xml version="1.0"?><osm version="0.6">{nodes}{ways}{relation}</osm>'
    (folder / "map.osm").write_text(text)
    for name, packing in (
        ("map.osm.gz", "osm.gz"),
        ("map.osm.bz2", "osm.bz2"),
        ("map.osm.pbf", "pbf"),
        ("map-plain.osm.pbf", "pbf,pbf_compression=none"),
    ):
        with osmium.SimpleWriter(osmium.io.File(str(folder / name), packing)) as writer:
            for element in osmium.FileProcessor(folder / "map.osm"):
                writer.add(element)


def _rasters(folder: Path) -> None:
    town = _town()
    Image.fromarray(town.astype(np.uint8)).save(folder / "map.png")
    np.save(folder / "map.npy", town)
    head = "ncols 64\nnrows 64\nxllcorner 0\nyllcorner 0\ncellsize 2\n"
    rows = [" ".join(f"{height:g}" for height in row) for row in town]
    (folder / "map.asc").write_text(head + "\n".join(rows) + "\n")
    wkt = CRS.from_epsg(2154).to_wkt("WKT1_ESRI")
    (folder / "map.prj").write_text(wkt)
    for name, more in (("map.tif", {"compress": "deflate"}), ("map-plain.tif", {})):
        with rasterio.open(
            folder / name,
            "w",
            driver="GTiff",
            height=64,
            width=64,
            count=1,
            dtype="float32",
            crs="EPSG:2154",
            transform=rasterio.Affine(2, 0, CORNER[0], 0, -2, CORNER[1] + 128),
            **more,
        ) as tif:
            tif.write(town, 1)
            tif.update_tags(NAME="town", ATTRIBUTION="somebody")


def _cityjson(folder: Path) -> None:
    city = CityMap(_town()[:32, :32], 2.0, name="town", origin=CORNER, crs="EPSG:2154")
    evocity.scene(city).write(folder / "map.city.json")
    document = json.loads((folder / "map.city.json").read_text())
    objects, document["CityObjects"] = document["CityObjects"], {}
    lines = [document]
    for name, item in objects.items():
        feature = {"type": "CityJSONFeature", "id": name, "CityObjects": {name: item}}
        lines.append(feature | {"vertices": document["vertices"]})
    (folder / "map.city.jsonl").write_text("\n".join(map(json.dumps, lines[:4])) + "\n")


def copied(path: Path, folder: Path, content: bytes) -> Path:
    """A file of ``content`` in place of the one at ``path``, with those that belong to it."""
    target = folder / path.name
    target.write_bytes(content)
    for one in path.parent.glob(f"{path.stem}.*") if path.suffix == ".shp" else ():
        if one.suffix in (".dbf", ".shx", ".prj", ".cpg"):
            shutil.copyfile(one, folder / one.name)
    return target
