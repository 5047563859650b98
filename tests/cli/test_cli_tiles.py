"""Levels of detail and tiles on the command line."""

import json

import numpy as np
import pyogrio
import pytest
from cli_tools import AT_2_M, PLAIN, call, refused, write_town
from towns import draw_town

import evocity
from evocity.growth import Growth, grow
from evocity.growth.surroundings import map_with_margin
from evocity.scene import write_tiles

SIZE = ("--width", 128, "--height", 96)


@pytest.fixture(scope="module")
def town_file(tmp_path_factory):
    return write_town(tmp_path_factory.mktemp("town") / "town.npy")


@pytest.fixture(scope="module")
def genome_file(tmp_path_factory, town_file):
    path = tmp_path_factory.mktemp("genome") / "town.parquet"
    call("encode", town_file, *AT_2_M, *PLAIN, "-o", path)
    return path


def files_of(folder) -> dict[str, bytes]:
    held = (path for path in folder.rglob("*") if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in held}


def test_a_level_and_a_budget_arrive(tmp_path, town_file):
    path = tmp_path / "t.glb"
    made = call("scene", town_file, *AT_2_M, "-o", path, "--lod", "1.2", "--json").stdout
    (facts,) = json.loads(made)["scenes"]
    city = evocity.read_map(town_file, metres_per_pixel=2)
    scene = evocity.scene(city, lod="1.2")
    assert facts["lod"] == "1.2"
    assert sum(facts["triangles"].values()) == scene.triangle_count
    scene.write(tmp_path / "same.glb")
    assert path.read_bytes() == (tmp_path / "same.glb").read_bytes()
    few = evocity.scene(city, lod="1.0").triangle_count
    made = call("scene", town_file, *AT_2_M, "-o", path, "--triangles", few, "--json").stdout
    assert json.loads(made)["scenes"][0]["lod"] == "1.0"


def test_tiles_are_those_of_the_library(tmp_path, town_file):
    words = ("scene", town_file, *AT_2_M, "--streets", "--tile", 32, "--tiles", tmp_path / "t")
    made = call(*words).stdout
    assert "wrote 4 tiles of LoD 1.3, 1.2, 1.0, afar, 21 files, to" in made
    scene = evocity.scene(evocity.read_map(town_file, metres_per_pixel=2), streets=True)
    facts = write_tiles(scene, tmp_path / "same", 32)
    assert files_of(tmp_path / "t") == files_of(tmp_path / "same")
    (told,) = json.loads(call(*words, "--json").stdout)["scenes"]
    assert told["tiles"] == facts
    assert "file" not in told


@pytest.mark.slow
def test_a_grown_fabric_becomes_a_scene_and_tiles(tmp_path, genome_file):
    path = tmp_path / "grown.glb"
    call("grow", genome_file, *SIZE, "--seed", 4, "-o", path, "--lod", "1.2")
    fabric = grow(evocity.read_genome(genome_file), 96, 128, np.random.default_rng(4))
    evocity.scene(fabric.city(), lod="1.2").write(tmp_path / "same.glb")
    assert path.read_bytes() == (tmp_path / "same.glb").read_bytes()
    call("grow", genome_file, *SIZE, "--seed", 4, "-o", path, "--roofs")
    evocity.scene(fabric.city(), roofs=True).write(tmp_path / "same.glb")
    assert path.read_bytes() == (tmp_path / "same.glb").read_bytes()
    words = (*SIZE, "--seed", 4, "--tiles", tmp_path / "t", "--tile", 32)
    made = json.loads(call("grow", genome_file, *words, "--json").stdout)
    city, margin = map_with_margin(fabric)
    own = json.loads((tmp_path / "t" / "tileset.json").read_text(encoding="utf-8"))
    settings = own["extras"]["evocity"]["settings"]
    assert (settings["seed"], settings["width"], settings["tile"]) == (4, 128, 32)
    scene = evocity.scene(city)
    facts = write_tiles(scene, tmp_path / "same", 32, margin=margin, settings=settings)
    assert made["tiles"] == facts
    assert facts["tiles"] == 12
    assert files_of(tmp_path / "t") == files_of(tmp_path / "same")


@pytest.mark.slow
def test_a_grown_fabric_has_streets_and_squares_on_demand(tmp_path, genome_file):
    fabric = grow(evocity.read_genome(genome_file), 96, 128, np.random.default_rng(4))
    words = ("grow", genome_file, *SIZE, "--seed", 4, "--ground")
    call(*words, "-o", tmp_path / "grown.glb")
    evocity.scene(fabric.city(), streets=True).write(tmp_path / "same.glb")
    assert (tmp_path / "grown.glb").read_bytes() == (tmp_path / "same.glb").read_bytes()
    call(*words, "-o", tmp_path / "grown.gpkg")
    assert "street_edges" in pyogrio.list_layers(tmp_path / "grown.gpkg")[:, 0]
    call(*words, "--tiles", tmp_path / "t", "--tile", 32)
    city, margin = map_with_margin(fabric)
    scene = evocity.scene(city, streets=True)
    write_tiles(scene, tmp_path / "same", 32, margin=margin)
    found, same = files_of(tmp_path / "t"), files_of(tmp_path / "same")
    assert found.keys() == same.keys()
    assert {name for name in found if found[name] != same[name]} == {"tileset.json"}


def test_tiles_of_other_settings_are_refused_before_growth(tmp_path, genome_file, monkeypatch):
    def account(*_, **__):
        raise AssertionError("the fabric grew")

    monkeypatch.setattr(Growth, "account", account)
    write_tiles(evocity.scene(draw_town(1), lod="1.0"), tmp_path / "scene", 32)
    words = ("grow", genome_file, *SIZE, "--seed", 4, "--tile", 32, "--tiles")
    refused(tmp_path, *words, tmp_path / "scene", says="tiles of another fabric, or")
    code = evocity.read_genome(genome_file)
    made = grow(code, 96, 128, np.random.default_rng(4)).made
    settings = {"genomes": [code.digest], "seed": 4, "width": 128, "height": 96, "tile": 32}
    settings |= {"top": -16, "left": -32, "share": None, "share_over": None, "lod": "1.3"}
    settings |= {"crs": None, "ground": False}
    names = ("cell", "side_min", "side_max", "tolerance", "candidates", "turned")
    settings |= {name: made[name] for name in names}
    scene = evocity.scene(draw_town(1), lod="1.0")
    write_tiles(scene, tmp_path / "t", 32, settings=settings)
    for more, names in (
        (("--seed", 5), "seed"),
        (("--ground", "--left", 7), "ground, left, top"),
        (("--tolerance", 3, "--lod", "1.0"), "lod, tolerance"),
    ):
        refused(tmp_path, *words, tmp_path / "t", *more, says=f"which differs in {names}\n")
    with pytest.raises(AssertionError, match="the fabric grew"):
        call(*words, tmp_path / "t")
    town = ("scene", tmp_path / "town.npy", *AT_2_M, "--tile", 32, "--tiles", tmp_path / "t")
    write_town(tmp_path / "town.npy")
    refused(tmp_path, *town, says="tiles of another fabric, or")


def test_lines_have_a_national_grid(tmp_path):
    path = tmp_path / "town.tif"
    evocity.write_map(
        draw_town(1).replace(draw_town(1).heights, origin=(842000.0, 6520000.0), crs="EPSG:2154"),
        path,
    )
    words = ("scene", path, "--tile", 32, "--tiles", tmp_path / "t", "--lod", "1.0")
    call(*words, "--crs", "EPSG:32631")
    (first, *_) = sorted(tmp_path.glob("t/1.0/*.city.jsonl"))
    head = json.loads(first.read_text(encoding="utf-8").splitlines()[0])
    assert head["metadata"]["referenceSystem"].endswith("/EPSG/0/32631")
    refused(tmp_path, *words, "--crs", "EPSG:1", says="is unknown")
    refused(tmp_path, *words, "--crs", "EPSG:4326", says="has degrees")


def test_bad_input(tmp_path, town_file, genome_file):
    town = ("scene", town_file, *AT_2_M)
    refused(tmp_path, *town, says="neither -o nor --tiles")
    refused(tmp_path, *town, "-o", tmp_path / "t.glb", "--triangles", 3, says="--triangles 3")
    refused(tmp_path, *town, "-o", tmp_path / "t.glb", "--tile", 3, says="--tile is given without")
    refused(tmp_path, *town, "--tiles", tmp_path / "t", "--tile", 30, says="do not divide")
    refused(tmp_path, *town, "--tiles", tmp_path / "no" / "t", says="no folder")
    refused(tmp_path, *town, "--tiles", town_file, says="is a file")
    refused(tmp_path, *town, "--tiles", tmp_path / "t", "--triangles", 900, says="--triangles")
    refused(tmp_path, *town, "--tiles", tmp_path / "t", "--width", 90, says="--width")
    more = ("--zoom", 1, "--zoom", 2)
    refused(tmp_path, "scene", genome_file, "--tiles", tmp_path / "t", *more, says="2 × --zoom")
    path = tmp_path / "t.city.json"
    refused(tmp_path, *town, "-o", path, "--lod", "afar", says='level of detail "afar"')
    refused(tmp_path, "grow", genome_file, *SIZE, says="neither -o nor --tiles")
    grown = ("grow", genome_file, *SIZE, "-o", tmp_path / "t.tif")
    refused(tmp_path, *grown, "--lod", "1.2", says="--lod is given without")
    path = tmp_path / "t.npy"
    tiles = ("-o", path, "--tiles", tmp_path / "t")
    refused(tmp_path, "grow", genome_file, *SIZE, *tiles, "--tile", 30, says="do not divide")
    for name in ("--merge", "--instances"):
        refused(tmp_path, *town, "--tiles", tmp_path / "t", name, says="the output of --tiles")
    refused(tmp_path, *town, "--streets", "-o", tmp_path / "t.fgb", says="streets cannot go into")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "other").touch()
    tiles = ("-o", path, "--tiles", tmp_path / "full", "--tile", 32)
    refused(tmp_path, "grow", genome_file, *SIZE, *tiles, says="holds other files")
    refused(tmp_path, *grown, "--roofs", says="--roofs is given without")
    refused(tmp_path, *grown, "--ground", says="--ground is given without a scene, a .gpkg file")
    placed = ("--tiles", tmp_path / "t", "--tile", 32, "--crs", "EPSG:2154")
    refused(tmp_path, *town, *placed, says="no place on Earth")
    refused(tmp_path, "grow", genome_file, *SIZE, *placed, says="no place on Earth")
    grown = ("grow", genome_file, *SIZE, "-o", tmp_path / "t.city.json")
    refused(tmp_path, *grown, "--lod", "afar", says='level of detail "afar"')
    large = ("--width", 8192, "--height", 8192, "--tiles", tmp_path / "t")
    refused(tmp_path, "grow", genome_file, *large, says="too large for tiles")
