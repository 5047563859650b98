"""`evocity scene`."""

import json

import numpy as np
import pytest
from cli_tools import AT_2_M, call, refused, write_town

import evocity
from evocity.citymap import CityMap


@pytest.fixture(scope="module")
def town_file(tmp_path_factory):
    return write_town(tmp_path_factory.mktemp("town") / "town.npy")


@pytest.fixture(scope="module")
def genome_file(town_file, tmp_path_factory):
    path = tmp_path_factory.mktemp("genome") / "town.parquet"
    call("encode", town_file, *AT_2_M, "-o", path)
    return path


@pytest.mark.parametrize("suffix", [".city.json", ".glb", ".obj", ".wrl", ".x3d"])
def test_a_map_becomes_what_the_library_writes(tmp_path, town_file, suffix):
    path = tmp_path / f"town{suffix}"
    told = call("scene", town_file, *AT_2_M, "-o", path).stdout
    assert f"wrote {path}" in told
    city = evocity.read_map(town_file, metres_per_pixel=2)
    assert f"{len(city.walls)} buildings" in told
    (tmp_path / "same").mkdir()
    evocity.scene(city).write(tmp_path / "same" / f"town{suffix}")
    assert path.read_bytes() == (tmp_path / "same" / f"town{suffix}").read_bytes()


def test_its_options_arrive(tmp_path, town_file):
    path = tmp_path / "town.city.json"
    words = ("--tolerance", 5, "--angles", "square", "--storeys", 3.5, "--least-area", 30)
    told = json.loads(call("scene", town_file, *AT_2_M, *words, "-o", path, "--json").stdout)
    city = evocity.read_map(town_file, metres_per_pixel=2)
    scene = evocity.scene(city, detail=5, squared=True, storeys=3.5, least_area=30)
    (told,) = told["scenes"]
    assert told["file"] == str(path)
    assert told["bytes"] == path.stat().st_size
    assert told["buildings"] == len(scene.walls)
    assert told["dropped"] == scene.walls.dropped
    assert told["volume"] == pytest.approx(sum(group.volume for group in scene.groups))
    scene.write(tmp_path / "same.city.json")
    assert path.read_bytes() == (tmp_path / "same.city.json").read_bytes()


def test_levels_of_detail_are_a_set_of_files(tmp_path, genome_file):
    told = call("scene", genome_file, "-o", tmp_path / "t.glb", "--zoom", 2, "--zoom", 1).stdout
    assert {path.name for path in tmp_path.iterdir()} == {"t-z1.glb", "t-z2.glb"}
    assert "128 × 128 px at 1 m" in told
    call("scene", genome_file, "-o", tmp_path / "one.glb", "--zoom", 1)
    assert (tmp_path / "one.glb").read_bytes() == (tmp_path / "t-z1.glb").read_bytes()


def test_roofs_are_counted_and_their_heights_explained(tmp_path, town_file):
    town = ("scene", town_file, *AT_2_M)
    said = call(*town, "--roofs", "-o", tmp_path / "t.glb").stdout
    assert "roofs: " in said
    assert "heights are those of the " in said
    told = json.loads(call(*town, "--roofs", "-o", tmp_path / "t.city.json", "--json").stdout)
    roofs = told["scenes"][0]["roofs"]
    assert sum(roofs["forms"].values()) > 0
    assert roofs["heights"] in ("eaves", "ridges")
    assert told["scenes"][0]["lod"] == "2.2"
    refused(tmp_path, *town, "--roofs", "--lod", "1.2", "-o", tmp_path / "x.glb", says="--roofs")


def test_streets_classes_and_pictures(tmp_path, town_file):
    town = ("scene", town_file, *AT_2_M)
    told = json.loads(call(*town, "--streets", "-o", tmp_path / "t.glb", "--json").stdout)
    assert told["scenes"][0]["triangles"]["street"] > 0
    assert told["scenes"][0]["substitution"] is None
    call(*town, "--streets", "-o", tmp_path / "t.gpkg")
    call(*town, "-o", tmp_path / "t.png")
    table = tmp_path / "own.toml"
    table.write_text(
        '[[class]]\nname = "low"\nheight = { below = 9 }\n[[class]]\nname = "high"\n'
        '[colours]\nlow = "#ff0000"\nhigh = "#00ff00"\n',
        encoding="utf-8",
    )
    words = ("--classes", table, "-o", tmp_path / "own.glb", "--json")
    found = json.loads(call(*town, *words).stdout)["scenes"][0]["classes"]
    assert set(found) == {"low", "high"}
    table.write_text('[[class]]\nname = "low"\nheight = { below = 9 }\n', encoding="utf-8")
    refused(tmp_path, *town, "--classes", table, "-o", tmp_path / "x.glb", says="own.toml")


def test_an_empty_map_is_a_scene_of_ground(tmp_path):
    np.save(tmp_path / "empty.npy", np.zeros((16, 16)))
    path = tmp_path / "empty.glb"
    told = call("scene", tmp_path / "empty.npy", *AT_2_M, "-o", path, "--json").stdout
    assert json.loads(told)["scenes"][0]["triangles"] == {"ground": 2, "building": 0}
    assert json.loads(told)["scenes"][0]["volume"] == 0


def test_a_scene_that_exists_is_written_over(tmp_path, town_file):
    path = tmp_path / "town.obj"
    path.write_text("before", encoding="utf-8")
    call("scene", town_file, *AT_2_M, "-o", path)
    assert path.read_text(encoding="utf-8").startswith("# evocity: town")


def test_bad_input(tmp_path, town_file, genome_file):
    town = ("scene", town_file, *AT_2_M)
    refused(tmp_path, *town, "-o", tmp_path / "t.json", says="use .city.json, not .json")
    refused(tmp_path, *town, "-o", tmp_path / "t.gltf", says="scenes cannot be written to .gltf")
    refused(tmp_path, *town, "-o", tmp_path / "no" / "t.glb", says="no folder")
    refused(tmp_path, *town, "-o", tmp_path / "t.glb", "--tolerance", -1, says="--tolerance -1")
    refused(tmp_path, *town, "-o", tmp_path / "t.glb", "--storeys", 0, says="--storeys 0")
    refused(
        tmp_path,
        *town,
        "-o",
        tmp_path / "t.glb",
        "--zoom",
        2,
        says="--zoom cannot be used with the map",
    )
    code = ("scene", genome_file, "-o", tmp_path / "t.glb")
    refused(tmp_path, *code, "--pixels", 9, says="--pixels cannot be used with the genome")
    refused(tmp_path, *code, "--zoom", 1, "--zoom", 0, says="--zoom 0")
    refused(tmp_path, *code, "--zoom", 1, "--zoom", 1e6, says="million pixels")
    refused(tmp_path, *code, "--id", 3, says="not a run folder")
    path = tmp_path / "t.city.json"
    evocity.scene(CityMap(np.full((4, 4), 9.0), 2.0)).write(path)
    refused(tmp_path, "scene", path, "-o", path, says="both the input and the output")
