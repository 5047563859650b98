"""The option --crs of all commands that write coordinates, and --print-side."""

import json
import zipfile

import geopandas
import pytest
import rasterio
from cli_tools import call, refused, run_of_two_towns
from pyproj import CRS

import evocity
from evocity.cli import main


@pytest.fixture(scope="module")
def genome(tmp_path_factory):
    path = tmp_path_factory.mktemp("crs") / "lyon.parquet"
    evocity.encode(evocity.read_map("lyon-1er", pixels=64), block=4).genome.write(path)
    return path


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_of_two_towns(tmp_path_factory.mktemp("runs") / "two")


@pytest.mark.parametrize("command", ["scene", "decode", "grow", "keep"])
def test_commands_that_write_coordinates_have_the_option(command):
    names = {name for option in main.commands[command].params for name in option.opts}
    assert "--crs" in names


def test_decoded_files_lie_in_the_system(genome, tmp_path):
    for suffix in (".gpkg", ".fgb", ".geoparquet", ".tif"):
        path = tmp_path / f"a{suffix}"
        call("decode", genome, "-o", path, "--crs", "EPSG:2154")
        if suffix == ".tif":
            with rasterio.open(path) as file:
                assert CRS(file.crs) == CRS("EPSG:2154")
        elif suffix == ".geoparquet":
            assert geopandas.read_parquet(path).crs == CRS("EPSG:2154")
        else:
            found = geopandas.read_file(path, layer="buildings")
            assert found.crs == CRS("EPSG:2154")
            assert list(found.columns) == ["id", "height", "area", "source", "class", "geometry"]


def test_a_scene_says_where_it_lies(genome, tmp_path):
    path = tmp_path / "a.city.json"
    told = call("scene", genome, "-o", path, "--crs", "EPSG:2154", "--json")
    (facts,) = json.loads(told.stdout)["scenes"]
    document = json.loads(path.read_text(encoding="utf-8"))
    assert facts["crs"] == "EPSG:2154"
    assert facts["offset"] == document["transform"]["translate"][:2]
    assert document["metadata"]["referenceSystem"].endswith("EPSG/0/2154")


def test_footprints_of_a_scene_may_have_degrees(genome, tmp_path):
    for suffix in (".gpkg", ".fgb", ".geoparquet"):
        path = tmp_path / f"a{suffix}"
        told = call("scene", genome, "-o", path, "--crs", "EPSG:4326", "--json")
        (facts,) = json.loads(told.stdout)["scenes"]
        assert facts["crs"] == "EPSG:4326"
        assert facts["offset"] == pytest.approx([4.83, 45.76], abs=0.02)
    found = geopandas.read_file(tmp_path / "a.gpkg", layer="buildings")
    assert found.total_bounds[:2] == pytest.approx(facts["offset"], abs=0.001)
    path = tmp_path / "a.glb"
    refused(tmp_path, "scene", genome, "-o", path, "--crs", "EPSG:4326", says="has degrees")


def test_a_grown_fabric_lies_in_the_system(genome, tmp_path):
    size = ("--width", 96, "--height", 64)
    for suffix in (".tif", ".gpkg"):
        call("grow", genome, *size, "-o", tmp_path / f"a{suffix}", "--crs", "EPSG:2154")
    with rasterio.open(tmp_path / "a.tif") as file:
        assert CRS(file.crs) == CRS("EPSG:2154")
        own = file.bounds
    west, south, east, north = geopandas.read_file(
        tmp_path / "a.gpkg", layer="buildings"
    ).total_bounds
    assert own.left - 4 <= west < east <= own.right + 4
    assert own.bottom - 4 <= south < north <= own.top + 4
    size = ("--width", 64, "--height", 64, "--crs", "EPSG:2154")
    refused(tmp_path, "grow", genome, *size, "-o", tmp_path / "a.npy", says="no coordinates")


def test_chosen_individuals_lie_in_the_system(run, tmp_path):
    path = tmp_path / "a.zip"
    call("keep", run, "--count", 1, "-o", path, "--at", "lyon-1er", "--crs", "EPSG:2154")
    with zipfile.ZipFile(path) as file:
        name = next(one for one in file.namelist() if one.endswith("footprints.gpkg"))
        file.extract(name, tmp_path)
    assert geopandas.read_file(tmp_path / name, layer="buildings").crs == CRS("EPSG:2154")
    refused(
        tmp_path, "decode", run, "--id", 2, "-o", tmp_path / "a.gpkg", "--crs", "EPSG:2154",
        says="has no place on Earth",
    )  # fmt: skip
    refused(tmp_path, "keep", run, "--crs", "EPSG:2154", says="without an output file")
    refused(
        tmp_path, "keep", run, "-o", tmp_path / "a.png", "--crs", "EPSG:2154", says="no coordinates"
    )


def test_systems_that_do_not_fit_are_refused(genome, tmp_path):
    for command, name, crs, says in (
        ("decode", "a.tif", "EPSG:4326", "has degrees"),
        ("decode", "a.tif", "EPSG:999999", "is unknown"),
        ("decode", "a.gpkg", "EPSG:2263", "outside the area of EPSG:2263"),
        ("decode", "a.png", "EPSG:2154", "no coordinates"),
        ("decode", "a.geojson", "EPSG:2154", "RFC 7946"),
        ("scene", "a.glb", "EPSG:4326", "has degrees"),
        ("scene", "a.glb", "EPSG:32756", "outside the area"),
        ("scene", "a.3mf", "EPSG:2154", "no coordinates"),
        ("scene", "a.png", "EPSG:2154", "no coordinates"),
    ):
        words = (command, genome, "-o", tmp_path / name, "--crs", crs)
        told = refused(tmp_path, *words, says=says)
        assert "--crs" in told or crs in told


def test_the_side_of_a_print(genome, tmp_path):
    sizes = []
    for side in (100, 200):
        call("scene", genome, "-o", tmp_path / "a.stl", "--print-side", side)
        sizes.append((tmp_path / "a.stl").read_bytes())
    assert sizes[0] != sizes[1]
    call("scene", genome, "-o", tmp_path / "b.stl")
    assert (tmp_path / "b.stl").read_bytes() == sizes[1]
    refused(
        tmp_path, "scene", genome, "-o", tmp_path / "a.glb", "--print-side", 100,
        says="--print-side cannot be used with the output a.glb",
    )  # fmt: skip
    assert (
        "--print-side"
        in call("scene", genome, "-o", tmp_path / "a.stl", "--print-side", 1, code=2).stderr
    )
