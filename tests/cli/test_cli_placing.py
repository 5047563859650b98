"""A child of two towns is laid on the ground of one of them."""

import json
import zipfile

import numpy as np
import pytest
from cli_tools import call, refused, run_of_two_towns

import evocity


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_of_two_towns(tmp_path_factory.mktemp("runs") / "two")


@pytest.mark.parametrize("town", [0, 1])
def test_it_lies_where_that_town_lies(run, tmp_path, town):
    opened = evocity.open_run(run)
    source = opened.sources()[town].city
    assert opened[2].city.crs is None
    call("decode", run, "--id", 2, "--at", source.name, "-o", tmp_path / "a.tif")
    laid = evocity.read_map(tmp_path / "a.tif")
    assert laid.origin == pytest.approx(source.origin)
    np.testing.assert_allclose(laid.heights, opened[2].city.heights)
    call("decode", run, "--id", 2, "--at", source.name, "-o", tmp_path / "a.geojson")
    west, north = json.loads((tmp_path / "a.geojson").read_text())["window"]["center"]
    asked = evocity.read_map(source.name, pixels=32, metres_per_pixel=16.0)
    evocity.write_map(asked, tmp_path / "source.geojson")
    window = json.loads((tmp_path / "source.geojson").read_text())["window"]
    assert [west, north] == pytest.approx(window["center"])


def test_a_scene_of_it_lies_there_too(run, tmp_path):
    opened = evocity.open_run(run)
    source = opened.sources()[1].city
    call("scene", run, "--id", 2, "--at", source.name, "-o", tmp_path / "a.city.json")
    opened[2].save(tmp_path / "b.city.json", at=source.name)
    here, there = (json.loads((tmp_path / f"{n}.city.json").read_text()) for n in "ab")
    assert here["transform"] == there["transform"]
    assert here["vertices"] == there["vertices"]
    words = ("scene", run, "--id", 2, "--at", "paris", "-o", tmp_path / "c.glb")
    refused(tmp_path, *words, says="'paris'")
    refused(tmp_path, "scene", "lyon-1er", "--at", "lyon-1er", "-o", tmp_path / "c.glb",
            says="which is not a run folder")  # fmt: skip


def test_python_lays_it_there_too(run, tmp_path):
    opened = evocity.open_run(run)
    source = opened.sources()[1].city
    opened[2].save(tmp_path / "b.parquet", at=source.name)
    opened[2].save(tmp_path / "b.npy")
    opened[2].save(tmp_path / "b.city.json", at=source.name)
    genome = evocity.read_genome(tmp_path / "b.parquet")
    assert (genome.origin, genome.crs) == (source.origin, source.crs)
    told = json.loads((tmp_path / "b.city.json").read_text())
    assert told["metadata"]["referenceSystem"].rsplit("/", 1)[1].startswith("326")  # a UTM zone
    placed = evocity.read_map(tmp_path / "b.city.json", pixels=32, metres_per_pixel=16.0)
    assert placed.origin == pytest.approx(source.origin, abs=0.01)


def test_keep_says_how_to_lay_it(run):
    shares = evocity.open_run(run).keep()[0].individual.ancestry()
    town = max(("lyon-1er", "montpellier-pas-du-loup"), key=lambda name: shares.get(name, 0))
    lines = call("keep", run).stdout.splitlines()
    assert f" --at {town} -o " in next(line for line in lines if "evocity decode" in line)


def test_other_places_are_refused(run, tmp_path):
    output = ("-o", tmp_path / "a.gpkg")
    told = refused(tmp_path, "decode", run, "--id", 2, "--at", "paris", *output, says="'paris'")
    assert "one of lyon-1er, montpellier-pas-du-loup" in told
    evocity.open_run(run).genome(0).write(tmp_path / "g.parquet")
    words = ("decode", tmp_path / "g.parquet", "--at", "lyon-1er", *output)
    refused(tmp_path, *words, says="which is not a run folder")


def test_what_lies_nowhere_is_told_and_what_is_kept_is_laid_together(run, tmp_path):
    town = "lyon-1er"
    told = call("decode", run, "--id", 0, "-o", tmp_path / "a.gpkg").stderr
    assert f"nowhere on Earth, since its parents lie in several places; --at {town} puts" in told
    assert "nowhere" not in call("decode", run, "--id", 0, "-o", tmp_path / "a.png").stderr
    laid = call("decode", run, "--id", 0, "--at", town, "-o", tmp_path / "b.gpkg")
    assert "nowhere" not in laid.stderr
    words = ("scene", run, "--id", 0)
    for more in (("--tiles", tmp_path / "tiles", "--tile", 32), ("-o", tmp_path / "a.fgb")):
        assert f"--at {town} puts" in call(*words, *more).stderr
    assert "nowhere" not in call(*words, "-o", tmp_path / "a.glb").stderr
    laid = call(*words, "--at", town, "--tiles", tmp_path / "placed", "--tile", 32)
    assert "nowhere" not in laid.stderr
    assert "no room for the whole attribution" in call(*words, "-o", tmp_path / "a.stl").stderr
    call("keep", run, "-o", tmp_path / "c.zip", "--at", town)
    opened = evocity.open_run(run)
    source, kept = opened.sources()[0].city, opened.keep()[0].individual.id
    with zipfile.ZipFile(tmp_path / "c.zip") as archive:
        archive.extract(f"{kept}/map.tif", tmp_path)
    assert evocity.read_map(tmp_path / f"{kept}" / "map.tif").origin == pytest.approx(source.origin)
    refused(tmp_path, "keep", run, "--at", town, says="is given without an output file")
    sheet = tmp_path / "d.png"
    refused(tmp_path, "keep", run, "-o", sheet, "--at", town, says="the contact sheet")


def test_what_is_kept_is_held_against_its_parents(run):
    opened = evocity.open_run(run)
    loss = dict(zip(opened.columns.ids.tolist(), opened.columns.losses[:, 0].tolist(), strict=True))
    best = min(loss[one] for one in opened.columns.founders.tolist())
    assert opened.columns.founders.tolist() == [0, 1]
    for one in opened.keep():
        own = loss[one.individual.id]
        assert ("No parent is as good in alignment." in one.why) == (own < best)
        if one.individual.id > 1 and own > best:
            assert "It beats all parents in no goal; a parent is better in alignment." in one.why
