"""`evocity grow`: a fabric of any size, as a map, a picture or a genome."""

import json

import numpy as np
import pytest
import rasterio
from cli_tools import AT_2_M, call, refused, write_recipe, write_town
from PIL import Image

import evocity
from evocity.growth import grow

SIZE = ("--width", 128, "--height", 96)


@pytest.fixture
def genome_file(tmp_path):
    path = tmp_path / "town.parquet"
    call("encode", write_town(tmp_path / "town.npy"), *AT_2_M, "-o", path)
    return path


def test_a_map_is_written_by_windows(tmp_path, genome_file):
    path = tmp_path / "large.tif"
    result = call("grow", genome_file, *SIZE, "--seed", 4, "-o", path)
    fabric = grow(evocity.read_genome(genome_file), 96, 128, np.random.default_rng(4))
    back = evocity.read_map(path)
    assert np.array_equal(back.heights, fabric.city().heights)
    assert (back.name, back.metres_per_pixel) == ("town, grown", 2)
    assert "town, grown: 96 × 128 px at 2 m, 0.192 × 0.256 km" in result.stdout
    assert f"{fabric.made['groups']} groups of 5 to 8 range blocks laid" in result.stdout
    assert result.stdout.endswith(f"wrote {path}\n")


def test_options_arrive_and_json_tells_what_was_reached(tmp_path, genome_file):
    options = {"corner": (2, 3), "size_min": 4, "size_max": 6, "tolerance": 2.5, "candidates": 90}
    typed = ("--corner", 2, 3, "--size-min", 4, "--size-max", 6, "--tolerance", 2.5)
    words = (*SIZE, *typed, "--candidates", 90, "--straight", "-o", tmp_path / "f.npy", "--json")
    told = json.loads(call("grow", genome_file, *words).stdout)
    code = evocity.read_genome(genome_file)
    fabric = grow(code, 96, 128, np.random.default_rng(0), turned=False, **options)
    assert np.array_equal(np.load(tmp_path / "f.npy"), fabric.city().heights)
    assert told.pop("seconds") > 0
    assert told == {
        key: fabric.made[key]
        for key in ("groups", "step", "forced", "repeated", "corner", "size_min", "size_max")
    }


def test_a_fabric_is_a_genome_too(tmp_path, genome_file):
    path = tmp_path / "large.parquet"
    told = json.loads(call("grow", genome_file, *SIZE, "-o", path, "--json").stdout)
    fabric = grow(evocity.read_genome(genome_file), 96, 128, np.random.default_rng(0))
    assert evocity.read_genome(path) == fabric.genome()
    assert told["repaired"] == fabric.genome().made["repaired"]
    assert "lifs repaired" in call("grow", genome_file, *SIZE, "-o", path).stdout


def test_attribution_and_place_travel(tmp_path):
    words = ("grow", "lyon-1er", "--pixels", 64, "--width", 128, "--height", 96, "-o")
    call(*words, tmp_path / "large.tif")
    call(*words, tmp_path / "large.png")
    lyon = evocity.read_map("lyon-1er", pixels=64)
    with rasterio.open(tmp_path / "large.tif") as file:
        assert file.tags()["ATTRIBUTION"] == lyon.attribution
        assert file.bounds.left == lyon.origin[0] - 32 * 2
        assert file.bounds.top == lyon.origin[1] + 16 * 2
    with Image.open(tmp_path / "large.png") as picture:
        assert picture.info["Title"] == "lyon-1er, grown"
        assert picture.info["Copyright"] == lyon.attribution


def test_individuals_of_runs_grow(tmp_path):
    call("run", write_recipe(tmp_path), "--generations", 0, "--out", tmp_path / "run")
    small = ("--width", 64, "--height", 32, "-o", tmp_path / "f.npy")
    call("grow", tmp_path / "run", "--id", 3, *small)
    code = evocity.open_run(tmp_path / "run").genome(3)
    expected = grow(code, 32, 64, np.random.default_rng(0)).city().heights
    assert np.array_equal(np.load(tmp_path / "f.npy"), expected)
    refused(tmp_path, "grow", tmp_path / "run", *small, says="is a run, with many genomes")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--height", 97), "--height 97"),
        (("--height", 97), "height 96 or 100"),
        (("--width", 60), "from the original's 64 × 64"),
        (("--width", 0), "--width 0"),
        (("--height", 10**9), "height 32764"),
        (
            ("--corner", 9, 0),
            "--corner 9 0\n  expected: (row, column) in range blocks, rows 0 to 8",
        ),
        (("--size-max", 20), "--size-max 20\n  expected: 3 to 14 range blocks of 4 px"),
        (("--size-min", 2), "--size-min 2"),
        (("--tolerance", "nan"), "--tolerance nan"),
        (("--candidates", 0), "--candidates 0"),
        (("--id", 1), "for 0 run folders"),
        (("--block", 8), "--block with genomes alone"),
    ],
)
def test_an_option_out_of_bounds_is_refused(tmp_path, genome_file, options, says):
    words = ("grow", genome_file, *SIZE, *options, "-o", tmp_path / "f.tif")
    refused(tmp_path, *words, says=says)


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("f.jpg", ".jpg cannot be written here"),
        ("f", "without a suffix"),
        ("town.parquet", "both read and written"),
        ("no/f.tif", "there is no folder"),
    ],
)
def test_an_output_that_cannot_be_is_refused(tmp_path, genome_file, name, says):
    refused(tmp_path, "grow", genome_file, *SIZE, "-o", tmp_path / name, says=says)


@pytest.mark.parametrize("suffix", [".png", ".parquet"])
def test_what_is_made_whole_has_a_limit(tmp_path, genome_file, suffix):
    words = ("grow", genome_file, "--width", 8192, "--height", 4096, "-o", tmp_path / f"f{suffix}")
    refused(tmp_path, *words, says="write a .tif or .npy")


def test_a_city_that_cannot_grow_is_refused(tmp_path):
    town = write_town(tmp_path / "t.npy", side=48)
    words = ("grow", town, *AT_2_M, "--block", 24, *SIZE, "-o", tmp_path / "f.tif")
    refused(tmp_path, *words, says="again with --block 4")
    refused(tmp_path, "grow", town, *SIZE, "-o", tmp_path / "f.tif", says="--metres-per-pixel")


def test_a_full_disk_is_told(tmp_path, genome_file, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array_header_2_0", full)
    words = ("grow", genome_file, *SIZE, "-o", tmp_path / "f.npy")
    refused(tmp_path, *words, says="No space left")
