"""Attributions of sources, in every file of a map or of a scene."""

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import ezdxf
import numpy as np
import parsed
import PIL.Image
import pyarrow.parquet
import pyogrio
import pytest
import rasterio
import rhino3dm

import evocity
from evocity.citymap import CityMap
from evocity.scene import SUFFIXES

CREDIT = "© Été & Cie, édition – 2021"
PLAIN = "(c) Ete & Cie, edition - 2021"


def town(credit: str = CREDIT) -> CityMap:
    """Two houses with a street between them."""
    heights = np.zeros((32, 32))
    heights[4:12, 4:28], heights[18:28, 4:28] = 9.0, 12.0
    place = {"crs": "EPSG:2154", "origin": (842_300.0, 6_520_700.0)}
    return CityMap(heights, 2.0, name="town", attribution=credit, **place)


def comments(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    return next(line[2:] for line in lines[1:] if line.startswith("# "))


def cityjson(path: Path) -> str:
    objects = json.loads(path.read_text(encoding="utf-8"))["CityObjects"]
    return next(iter(objects.values()))["attributes"]["attribution"]


def cityjson_lines(path: Path) -> str:
    lines = map(json.loads, path.read_text(encoding="utf-8").splitlines())
    objects = [one for line in lines for one in line.get("CityObjects", {}).values()]
    return next(
        one["attributes"]["attribution"]
        for one in objects
        if "attribution" in one.get("attributes", {})
    )


def gltf(path: Path) -> str:
    document, _ = parsed.glb_document(path)
    (scene,) = document["scenes"]
    assert document["asset"]["copyright"] == scene["extras"]["attribution"]
    return document["asset"]["copyright"]


def vrml(path: Path) -> str:
    line = path.read_text(encoding="utf-8").splitlines()[1]
    assert line.startswith("WorldInfo")
    return line.split('"')[-2]


def x3d(path: Path) -> str:
    metas = ElementTree.parse(path).getroot().findall("head/meta")
    return {one.get("name"): one.get("content") for one in metas}["rights"]


def dxf(path: Path) -> str:
    return dict(ezdxf.readfile(path).header.custom_vars)["attribution"]


def rhino(path: Path) -> str:
    texts = rhino3dm.File3dm.Read(str(path)).Strings
    return dict(texts[k] for k in range(len(texts)))["evocity:attribution"]


def threemf(path: Path) -> str:
    with zipfile.ZipFile(path) as package:
        root = ElementTree.fromstring(package.read("3D/3dmodel.model"))
    return next(one.text for one in root if one.get("name") == "Copyright")


def stl(path: Path) -> str:
    return path.read_bytes()[:80].decode("ascii").removeprefix("evocity, ").split(", town")[0]


def layers(path: Path) -> str:
    names = [name for name, kind in pyogrio.list_layers(path) if kind is not None]
    found = {pyogrio.read_info(path, layer=name)["layer_metadata"]["ATTRIBUTION"] for name in names}
    assert len(found) == 1
    return found.pop()


def parquet(path: Path) -> str:
    return json.loads(pyarrow.parquet.read_schema(path).metadata[b"evocity"])["ATTRIBUTION"]


def png(path: Path) -> str:
    return PIL.Image.open(path).text["Copyright"]


def tiff(path: Path) -> str:
    with rasterio.open(path) as raster:
        tags = raster.tags()
    assert tags["TIFFTAG_COPYRIGHT"] == PLAIN
    return tags["ATTRIBUTION"]


SCENES: dict[str, Callable[[Path], str]] = {
    ".city.json": cityjson,
    ".glb": gltf,
    ".obj": comments,
    ".wrl": vrml,
    ".x3d": x3d,
    ".dxf": dxf,
    ".3dm": rhino,
    ".stl": stl,
    ".3mf": threemf,
    ".gpkg": layers,
    ".fgb": layers,
    ".geoparquet": parquet,
    ".png": png,
}


def test_all_suffixes_of_scenes_have_a_reader_here():
    assert set(SCENES) == set(SUFFIXES)


@pytest.mark.parametrize("suffix", SCENES)
@pytest.mark.parametrize("name", ["finest", "streets and roofs", "blocks"])
def test_each_file_of_a_scene_has_the_attribution(suffix, name, tmp_path):
    flat = suffix in (".fgb", ".geoparquet")
    options = {"streets and roofs": {"streets": not flat, "lod": "1.3" if flat else "2.2"}}
    options["streets and roofs"] |= {"lod": "1.3"} if suffix == ".gpkg" else {}
    options |= {"finest": {}, "blocks": {"lod": "1.0"}}
    path = tmp_path / f"a{suffix}"
    evocity.scene(town(), **options[name]).write(path)
    wanted = PLAIN if suffix == ".stl" else CREDIT
    assert SCENES[suffix](path) == wanted
    if suffix == ".obj":
        assert comments(path.with_suffix(".mtl")) == CREDIT


def test_the_header_of_an_stl_keeps_the_beginning_of_a_long_attribution(tmp_path):
    credits = "; ".join(f"© Source {k}" for k in range(20))
    evocity.scene(town(credits)).write(tmp_path / "a.stl")
    data = (tmp_path / "a.stl").read_bytes()
    assert data[:80].decode("ascii").startswith("evocity, (c) Source 0; (c) Source 1; ")
    assert len(data) == 84 + 50 * int.from_bytes(data[80:84], "little")


def test_each_file_of_tiles_has_the_attribution(tmp_path):
    folder = tmp_path / "tiles"
    evocity.scene.write_tiles(evocity.scene(town(), streets=True), folder, 16)
    readers = {".glb": gltf, ".jsonl": cityjson_lines}
    paths = [path for path in folder.rglob("*") if path.suffix in readers]
    assert len(paths) > 8
    assert {readers[path.suffix](path) for path in paths} == {CREDIT}
    document = json.loads((folder / "tileset.json").read_text(encoding="utf-8"))
    assert document["asset"]["extras"]["copyright"] == CREDIT
    assert document["extras"]["evocity"]["attribution"] == CREDIT


MAPS = {suffix: SCENES[suffix] for suffix in (".gpkg", ".fgb", ".geoparquet", ".png")}
MAPS |= {".tif": tiff}


@pytest.mark.parametrize("suffix", MAPS)
def test_each_file_of_a_map_has_the_attribution(suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    evocity.write_map(town(), path)
    assert MAPS[suffix](path) == CREDIT


@pytest.mark.parametrize("suffix", [".tif", ".gpkg", ".fgb", ".geoparquet", ".geojson"])
def test_a_map_that_is_read_again_has_the_attribution(suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    evocity.write_map(town(), path)
    assert evocity.read_map(path).attribution == CREDIT


def test_a_genome_and_a_scene_of_it_have_the_attribution(tmp_path):
    evocity.encode(town()).genome.write(tmp_path / "a.parquet")
    genome = evocity.read_genome(tmp_path / "a.parquet")
    assert genome.attribution == CREDIT
    assert evocity.scene(evocity.decode(genome).city).about.attribution == CREDIT
