"""`evocity scene` and `evocity library new`: options, and what they refuse."""

import json

import geopandas
import numpy as np
import pytest
from cli_tools import call, refused
from towns import TWO_CLASSES, four_houses

import evocity
from evocity.scene.library import Library


def test_the_command_draws_as_it_is_asked(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1)
    call(*words, "-o", tmp_path / "plain.png", "--width", 300)
    call(*words, "-o", tmp_path / "plan.png", "--width", 300, "--tilt", 90, "--azimuth", 0)
    call(*words, "-o", tmp_path / "classes.png", "--width", 300, "--colours", "classes")
    drawn = {(tmp_path / f"{name}.png").read_bytes() for name in ("plain", "plan", "classes")}
    assert len(drawn) == 3
    refused(
        tmp_path,
        *words,
        "-o",
        tmp_path / "x.glb",
        "--tilt",
        60,
        says="--tilt cannot be used with the output x.glb",
    )
    assert "'--seed'" in call(*words, "-o", tmp_path / "x.glb", "--seed", -1, code=2).stderr
    refused(
        tmp_path, *words, "-o", tmp_path / "x.glb", "--storeys", "1e30", says="metres, 0.1 to 100"
    )


def test_nothing_that_is_read_is_written_over(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1)
    table = tmp_path / "own.city.json"
    table.write_text(TWO_CLASSES)
    refused(tmp_path, *words, "--classes", table, "-o", table, says="both the input and the output")
    Library.of(four_houses(), licence="CC0-1.0").write(tmp_path / "objects")
    path = tmp_path / "objects" / "objects.gpkg"
    library = ("--library", tmp_path / "objects", "-o", path)
    refused(tmp_path, *words, *library, says="both the input and the output")
    own = ("--licence", "CC0-1.0", "-o", tmp_path / "objects")
    refused(tmp_path, "library", "new", path, *own, says="both the input and the output")


def test_maps_of_one_name_make_a_library(tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        np.save(tmp_path / folder / "town.npy", four_houses().heights)
    maps = [tmp_path / folder / "town.npy" for folder in ("a", "b")]
    out = tmp_path / "objects"
    call("library", "new", *maps, "--metres-per-pixel", 1, "--licence", "CC0-1.0", "-o", out)
    assert {one.rpartition("-")[0] for one in Library.read(out).ids} == {"town", "town (2)"}


def test_objects_of_one_atmosphere(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    Library.of(four_houses(), licence="CC0-1.0", atmosphere="old town").write(tmp_path / "objects")
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1, "-o", tmp_path / "x.glb")
    library = ("--library", tmp_path / "objects", "--atmosphere")
    assert "4 replaced by objects of the library" in call(*words, *library, "old town").output
    refused(tmp_path, *words, *library, "old twon", says="one of 'old town'")
    refused(
        tmp_path, *words, "--atmosphere", "old town", says="--atmosphere is given without --library"
    )


def test_a_library_of_other_classes_is_told(tmp_path):
    np.save(tmp_path / "town.npy", four_houses().heights)
    (tmp_path / "own.toml").write_text(TWO_CLASSES)
    Library.of(four_houses(), licence="CC0-1.0").write(tmp_path / "objects")
    told = call(
        "scene", tmp_path / "town.npy", "--metres-per-pixel", 1, "--classes", tmp_path / "own.toml",
        "--library", tmp_path / "objects", "-o", tmp_path / "x.glb",
    )  # fmt: skip
    assert "the library has building, the map high" in told.stderr


def test_water_is_read_from_a_file(tmp_path):
    town = four_houses()
    town = town.replace(town.heights, origin=(842000.0, 6520000.0), crs="EPSG:2154")
    evocity.write_map(town, tmp_path / "town.tif")
    marks = np.zeros(town.shape, np.float32)
    marks[26:30] = 1  # across the town, and past no house
    river = town.replace(marks * 5, attribution="© the river", name="river")
    evocity.write_map(river, tmp_path / "river.tif")
    evocity.write_map(river, tmp_path / "river.gpkg")
    np.save(tmp_path / "river.npy", marks)
    words = ("scene", tmp_path / "town.tif", "--streets")
    made = evocity.scene(evocity.read_map(tmp_path / "town.tif"), streets=True, water=marks > 0)
    (group,) = (group for group in made.groups if group.name == "water")
    for name, credit in (("river.tif", "© drawn; © the river"), ("river.npy", "© drawn")):
        call(*words, "--water", tmp_path / name, "-o", tmp_path / "wet.city.json")
        document = json.loads((tmp_path / "wet.city.json").read_text(encoding="utf-8"))
        kinds = [one["type"] for one in document["CityObjects"].values()]
        assert kinds.count("WaterBody") == len(group) > 0
        assert credit in json.dumps(document, ensure_ascii=False)
    call(*words, "--water", tmp_path / "river.gpkg", "-o", tmp_path / "wet.gpkg")
    ground = geopandas.read_file(tmp_path / "wet.gpkg", layer="ground")
    wet = ground[ground["kind"] == "water"]
    assert wet.area.sum() == pytest.approx(marks.sum() * town.metres_per_pixel**2, rel=0.05)
    call(*words, "--water", tmp_path / "river.npy", "-o", tmp_path / "wet.glb")
    assert b'"water"' in (tmp_path / "wet.glb").read_bytes()
    tiles = ("--tiles", tmp_path / "tiles", "--tile", 32, "--lod", "1.3")
    call(*words, "--water", tmp_path / "river.npy", *tiles)
    assert any(b'"water"' in path.read_bytes() for path in tmp_path.glob("tiles/1.3/*.glb"))


def test_water_that_does_not_fit_is_refused(tmp_path):
    town = four_houses()
    np.save(tmp_path / "town.npy", town.heights)
    words = ("scene", tmp_path / "town.npy", "--metres-per-pixel", 1, "-o", tmp_path / "x.glb")
    np.save(tmp_path / "houses.npy", (town.heights > 0).astype(np.float32))
    np.save(tmp_path / "small.npy", np.ones((8, 8), np.float32))
    water = ("--streets", "--water")
    refused(tmp_path, *words, "--water", tmp_path / "houses.npy", says="given without --streets")
    refused(tmp_path, *words, *water, tmp_path / "houses.npy", says="marks no open ground")
    refused(tmp_path, *words, *water, tmp_path / "small.npy", says="small has 8 × 8 px")
    refused(tmp_path, *words, *water, tmp_path / "none.gpkg", says="none.gpkg")
