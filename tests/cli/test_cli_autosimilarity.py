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
        "lowest": made.mean.min(),
        "mean": pytest.approx(made.mean.mean()),
        "highest": made.mean.max(),
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


@pytest.mark.parametrize("measure", ["least", "largest", "likeness"])
def test_blocks_left_free(tmp_path, town_file, city, measure):
    path = tmp_path / "free.npy"
    options = ("--block", "6,4", "--measure", measure)
    call("autosimilarity", town_file, *AT_2_M, *options, "-o", path)
    made = free_block_maps(city, blocks=(4, 6))
    np.testing.assert_array_equal(np.load(path), getattr(made, measure))


def test_blocks_left_free_are_weighted_unless_told_otherwise(tmp_path, town_file):
    result = call(
        "autosimilarity", town_file, *AT_2_M, "--block", "4,6", "-o", tmp_path / "f.npy", "--json"
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
        (("--block", "8", "--domains", "8"), "D above B"),
        (("--domains", "33"), "at most 32 px"),
        (("--block", "20"), "domain blocks of 40 px"),
        (("--block", "1"), "2 px or more"),
        (("--threads", "0"), "1 or more"),
        (("--measure", "largest"), "several sizes of blocks"),
        (("--block", "4,6", "--measure", "mean"), "several sizes of blocks"),
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
    assert "is no list of pixels" in result.stderr
    assert not (tmp_path / "mu.npy").exists()


def test_another_suffix_is_refused_before_any_work(tmp_path, town_file):
    refused(
        tmp_path, "autosimilarity", town_file, *AT_2_M, "-o", tmp_path / "mu.jpg",
        says=".jpg cannot be written here",
    )  # fmt: skip
