"""`evocity autosimilarity`: what is written, what is printed, what is refused."""

import csv
import json

import numpy as np
import pytest
import rasterio
from cli_tools import AT_2_M, call, refused, write_town
from PIL import Image

import evocity
from evocity.coding import autosimilarity_maps, free_block_maps
from evocity.pictures.colours import NOTHING


@pytest.fixture
def town_file(tmp_path):
    return write_town(tmp_path / "town.npy", side=32)


@pytest.fixture
def city(town_file):
    return evocity.read_map(town_file, metres_per_pixel=2)


def test_mean_is_written_and_told(tmp_path, town_file, city):
    path = tmp_path / "mu.npy"
    result = call("autosimilarity", town_file, *AT_2_M, "--domains", 20, "-o", path, "--json")
    made = autosimilarity_maps(city, block=8, domains=20)
    written = np.load(path)
    assert written.dtype == np.float32
    np.testing.assert_array_equal(written, made.mean)
    told = json.loads(result.stdout)
    assert told.pop("seconds") > 0
    assert told == {
        "measure": "mean",
        "normalise": "heights",
        "lowest": made.mean.min(),
        "mean": pytest.approx(made.mean.mean()),
        "highest": made.mean.max(),
        "known": 1,
        "curve": {"8": {"20": made.curve[20]}},
    }


def test_least_with_domains_free_and_its_curve(tmp_path, town_file, city):
    path, curve = tmp_path / "mu.tif", tmp_path / "curve.csv"
    options = ("--block", 4, "--domains", "5-7,9", "--measure", "least", "--curve", curve)
    result = call("autosimilarity", town_file, *AT_2_M, *options, "-o", path)
    made = autosimilarity_maps(city, block=4, domains=(5, 6, 7, 9))
    with rasterio.open(path) as file:
        np.testing.assert_array_equal(file.read(1), made.least)
        assert file.dtypes == ("float32",)
        assert file.descriptions == ("least autosimilarity error",)
        assert file.res == (2, 2)
    with open(curve, newline="") as file:
        rows = list(csv.DictReader(file))
    assert {int(row["domain"]): float(row["mean_error"]) for row in rows} == made.curve
    assert {row["block"] for row in rows} == {"4"}
    assert f"wrote {path}" in result.stdout
    assert f"wrote {curve}" in result.stdout


@pytest.mark.parametrize("measure", ["least", "largest", "likeness", "domain"])
def test_blocks_left_free(tmp_path, town_file, city, measure):
    path = tmp_path / "free.npy"
    options = ("--block", "8,4", "--measure", measure)
    call("autosimilarity", town_file, *AT_2_M, *options, "-o", path)
    made = free_block_maps(city, blocks=(4, 8))
    np.testing.assert_array_equal(np.load(path), getattr(made, measure))


def test_blocks_and_domains_left_free(tmp_path, town_file, city):
    path = tmp_path / "free.npy"
    options = ("--block", "2,4,8", "--domains", "7-10", "--json")
    result = call("autosimilarity", town_file, *AT_2_M, *options, "-o", path)
    np.testing.assert_array_equal(
        np.load(path), free_block_maps(city, blocks=(2, 4, 8), domains=range(7, 11)).likeness
    )
    curve = json.loads(result.stdout)["curve"]
    assert [list(curve[b]) for b in curve] == 2 * [["7", "8", "9", "10"]] + [["9", "10"]]


@pytest.mark.parametrize("measure", ["mean", "domain"])
def test_by_the_variance_what_is_flat_has_no_value(tmp_path, town_file, city, measure):
    path, picture = tmp_path / "mu.tif", tmp_path / "mu.png"
    options = ("--block", 4, "--domains", "5-7", "--normalise", "variance", "--measure", measure)
    result = call("autosimilarity", town_file, *AT_2_M, *options, "-o", path)
    made = autosimilarity_maps(city, block=4, domains=range(5, 8), normalise="variance")
    values = getattr(made, measure)
    with rasterio.open(path) as file:
        np.testing.assert_array_equal(file.read(1), values)
        assert np.isnan(file.nodata)
    known = ~np.isnan(values)
    assert 0 < known.mean() < 1
    assert f"{100 * known.mean():.0f} % of the pixels have a value" in result.stdout
    assert f"mean {values[known].mean(dtype=float):.4g}" in result.stdout
    result = call("autosimilarity", town_file, *AT_2_M, *options, "-o", picture, "--json")
    told = json.loads(result.stdout)
    assert told["normalise"] == "variance"
    assert told["known"] == known.mean()
    assert told["highest"] == values[known].max()
    with Image.open(picture) as drawn:
        assert NOTHING in [colour for _, colour in drawn.convert("RGB").getcolors(1 << 24)]


def test_a_flat_map_has_no_value_and_says_so(tmp_path):
    np.save(tmp_path / "flat.npy", np.zeros((24, 24)))
    words = ("autosimilarity", tmp_path / "flat.npy", *AT_2_M, "--normalise", "variance")
    assert "no pixel has a value" in call(*words, "-o", tmp_path / "mu.png").stdout
    told = json.loads(call(*words, "-o", tmp_path / "mu.npy", "--json").stdout)
    assert (told["lowest"], told["mean"], told["highest"], told["known"]) == (None,) * 3 + (0,)
    assert told["curve"] == {"8": {"16": None}}


def test_blocks_left_free_are_weighted_unless_told_otherwise(tmp_path, town_file):
    result = call(
        "autosimilarity", town_file, *AT_2_M, "--block", "4,8", "-o", tmp_path / "f.npy", "--json"
    )
    assert json.loads(result.stdout)["measure"] == "likeness"


def test_a_picture_tells_what_it_shows(tmp_path, town_file):
    path = tmp_path / "mu.png"
    call("autosimilarity", town_file, *AT_2_M, "-o", path)
    with Image.open(path) as picture:
        assert picture.text["Title"] == "town: mean autosimilarity error"
        assert picture.width > picture.height * 0.8
        assert len(picture.getcolors(1 << 24)) > 50


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--block", "8", "--domains", "8"), "2 ≤ B < D"),
        (("--domains", "33"), "B < D ≤ 32"),
        (("--block", "20"), "domain blocks of D = 40 px"),
        (("--block", "1"), "2 ≤ B < D"),
        (("--threads", "0"), "1 or more"),
        (("--block", "4,6,12", "--domains", "9-12"), "range blocks of B = 12 px"),
        (("--measure", "largest"), "cannot be used with --block"),
        (("--block", "4,6", "--measure", "mean"), "cannot be used with --block"),
        (("--curve", "curve.txt"), "cannot be written here"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, town_file, options, says):
    refused(
        tmp_path, "autosimilarity", town_file, *AT_2_M, *options, "-o", tmp_path / "mu.npy",
        says=says,
    )  # fmt: skip


@pytest.mark.parametrize("sizes", ["eight", "9-5", "1-99999999999", "-4", "4,", ""])
def test_sizes_that_cannot_be_parsed(tmp_path, town_file, sizes):
    result = call(
        "autosimilarity", town_file, *AT_2_M, f"--domains={sizes}", "-o", tmp_path / "mu.npy",
        code=2,
    )  # fmt: skip
    assert "is not a list of pixels" in result.stderr
    assert not (tmp_path / "mu.npy").exists()


def test_another_suffix_is_refused_before_any_work(tmp_path, town_file):
    refused(
        tmp_path, "autosimilarity", town_file, *AT_2_M, "-o", tmp_path / "mu.jpg",
        says=".jpg cannot be written here",
    )  # fmt: skip
