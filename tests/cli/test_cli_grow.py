"""`evocity grow`: a fabric of any size, as a map, a picture or a genome."""

import json

import numpy as np
import pytest
import rasterio
from cli_tools import AT_2_M, PLAIN, call, refused, write_recipe, write_town
from codes import draw_code
from PIL import Image

import evocity
from evocity.growth import grow

SIZE = ("--width", 128, "--height", 96)


@pytest.fixture
def genome_file(tmp_path):
    path = tmp_path / "town.parquet"
    call("encode", write_town(tmp_path / "town.npy"), *AT_2_M, *PLAIN, "-o", path)
    return path


def test_a_map_is_written_by_windows(tmp_path, genome_file):
    path = tmp_path / "large.tif"
    result = call("grow", genome_file, *SIZE, "--seed", 4, "-o", path)
    fabric = grow(evocity.read_genome(genome_file), 96, 128, np.random.default_rng(4))
    back = evocity.read_map(path)
    assert np.array_equal(back.heights, fabric.city().heights)
    assert (back.name, back.metres_per_pixel) == ("town, grown", 2)
    assert "town, grown: 96 × 128 px at 2 m, 0.192 × 0.256 km" in result.stdout
    assert f"{fabric.account()['groups']} groups of 40 to 64 m laid" in result.stdout
    assert result.stdout.endswith(f"wrote {path}\n")


def test_options_arrive_and_json_tells_what_was_reached(tmp_path, genome_file):
    options = {"corner": (2, 3), "side_min": 32, "side_max": 48, "tolerance": 2.5, "candidates": 90}
    typed = ("--corner", 2, 3, "--side-min", 32, "--side-max", 48, "--tolerance", 2.5)
    words = (*SIZE, *typed, "--candidates", 90, "--straight", "-o", tmp_path / "f.npy", "--json")
    told = json.loads(call("grow", genome_file, *words).stdout)
    code = evocity.read_genome(genome_file)
    fabric = grow(code, 96, 128, np.random.default_rng(0), turned=False, **options)
    assert np.array_equal(np.load(tmp_path / "f.npy"), fabric.city().heights)
    assert told.pop("seconds") > 0
    assert told == {
        **fabric.account(),
        **{"top": -8, "left": -12, "cell": 4, "side_min": 32, "side_max": 48},
    }


@pytest.mark.slow
def test_streets_run_through_on_demand(tmp_path, genome_file):
    path = tmp_path / "f.npy"
    words = (*SIZE, "--streets", "--side-min", 42, "--side-max", 70, "--left", 300)
    result = call("grow", genome_file, *words, "-o", path)
    told = json.loads(call("grow", genome_file, *words, "-o", path, "--json").stdout)
    code = evocity.read_genome(genome_file)
    fabric = grow(
        code, 96, 128, np.random.default_rng(0), streets=True, side_min=42, side_max=70,
        corner=(0, 0),
    ).at(0, 300, 96, 128)  # fmt: skip
    assert np.array_equal(np.load(path), fabric.city().heights)
    assert f"{told['groups']} quarters of 42 to 70 m laid" in result.stdout
    assert told.pop("seconds") > 0
    place = {"top": 0, "left": 300, "cell": 4, "side_min": 42, "side_max": 70}
    assert told == {**fabric.account(), **place}
    refused(
        tmp_path, "grow", genome_file, *words, "--tolerance", 3, "-o", path,
        says="leave out --tolerance",
    )  # fmt: skip


def test_sizes_in_range_blocks_are_still_taken(tmp_path, genome_file):
    for name, typed in {
        "a": ("--side-min", 32, "--side-max", 48),
        "b": ("--size-min", 4, "--size-max", 6),
    }.items():
        call("grow", genome_file, *SIZE, *typed, "-o", tmp_path / f"{name}.npy")
    assert np.array_equal(np.load(tmp_path / "a.npy"), np.load(tmp_path / "b.npy"))


def test_any_place_of_the_same_fabric_is_shown(tmp_path, genome_file):
    def shown(*words):
        call("grow", genome_file, "--seed", 4, *words, "-o", tmp_path / "f.npy")
        return np.load(tmp_path / "f.npy")

    whole = shown("--width", 200, "--height", 150, "--top", -100, "--left", -131)
    part = shown("--width", 90, "--height", 77, "--top", -80, "--left", -60)
    assert np.array_equal(part, whole[20:97, 71:161])
    fabric = grow(evocity.read_genome(genome_file), rng=np.random.default_rng(4))
    assert np.array_equal(part, fabric.window(-80, -60, 77, 90))
    assert np.array_equal(shown(*SIZE, "--left", 40), fabric.window(0, 40, 96, 128))


@pytest.mark.slow
def test_cities_grow_into_each_other(tmp_path, genome_file):
    other = tmp_path / "other.parquet"
    call("encode", write_town(tmp_path / "other.npy", seed=2), *AT_2_M, "-o", other)
    codes = [evocity.read_genome(path) for path in (genome_file, other)]
    path = tmp_path / "f.npy"

    def grown(shape=(96, 128), **options):
        return grow(codes, *shape, np.random.default_rng(0), **options).city().heights

    result = call("grow", genome_file, other, *SIZE, "-o", path)
    assert result.stdout.startswith("town × other, grown")
    assert np.array_equal(np.load(path), grown())
    call("grow", genome_file, other, *SIZE, "--share", 0.3, "-o", path)
    assert np.array_equal(np.load(path), grown(share=0.3))
    painted = np.zeros((48, 64), np.uint8)
    painted[:, 20:] = 255
    Image.fromarray(painted).save(tmp_path / "share.png")
    call("grow", genome_file, other, *SIZE, "--share", tmp_path / "share.png", "-o", path)
    assert np.array_equal(np.load(path), grown(share=painted / 255))
    # a part of it, by what the share lies over
    over = ("--share-over", -16, 0, 96, 128, "--top", 4, "--left", 50, "--width", 40)
    words = (*over, "--height", 30, "--share", tmp_path / "share.png", "-o", path)
    call("grow", genome_file, other, *words)
    assert np.array_equal(np.load(path), grown(share=painted / 255)[20:50, 50:90])
    # and a share for each of three
    shares = ("--share", 1, "--share", tmp_path / "share.png", "--share", 0.5)
    call("grow", genome_file, other, genome_file, *SIZE, *shares, "-o", path)
    parts = np.stack([np.ones((48, 64)), painted / 255, np.full((48, 64), 0.5)])
    three = grow([*codes, codes[0]], 96, 128, np.random.default_rng(0), share=parts)
    assert np.array_equal(np.load(path), three.city().heights)


@pytest.mark.parametrize(
    ("count", "options", "says"),
    [
        (1, ("--share", 0.5), "1 × --share for 1 genomes"),
        (2, ("--share", 0.5, "--share", 0.5), "one for two genomes"),
        (3, ("--share", 0.5), "give --share 3 times"),
        (2, ("--share", 1.5), "--share 1.5"),
        (2, ("--share", "no.png"), "--share no.png"),
        (2, ("--share-over", 0, 0, 9, 9), "--share-over is given without --top and --left"),
        (2, ("--share-over", 0, 0, 0, 9, "--top", 0), "--share-over 0 0 0 9"),
    ],
)
def test_a_share_that_cannot_be_is_refused(tmp_path, genome_file, count, options, says):
    words = (*[genome_file] * count, *SIZE, *options, "-o", tmp_path / "f.tif")
    refused(tmp_path, "grow", *words, says=says)


def test_a_fabric_is_a_genome_too(tmp_path, genome_file):
    path = tmp_path / "large.parquet"
    told = json.loads(call("grow", genome_file, *SIZE, "-o", path, "--json").stdout)
    fabric = grow(evocity.read_genome(genome_file), 96, 128, np.random.default_rng(0))
    assert evocity.read_genome(path) == fabric.genome()
    assert told["repaired"] == fabric.genome().made["repaired"]
    assert "lifs repaired" in call("grow", genome_file, *SIZE, "-o", path).stdout


def test_attribution_and_place_travel(tmp_path):
    words = ("grow", "lyon-1er", "--block", 4, "--pixels", 64)
    words = (*words, "--width", 128, "--height", 96, "-o")
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
    refused(
        tmp_path,
        "grow",
        tmp_path / "run",
        *small,
        says="is a run folder, which contains many genomes",
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--height", 0), "--height 0"),
        (("--width", 0), "expected: a rectangle within these limits, in pixels: width 1 to 32767"),
        (("--height", 10**9), "--height 1000000000"),
        (("--corner", 9, 0, "--top", 3), "--corner cannot be combined with --top or --left"),
        (("--top", 1 << 60), "--top 1152921504606846976"),
        (("--cell", 5), "--cell 5"),
        (("--size-max", 20), "--size-max 20\n  expected: 24 to 112 m, 3 to 14 cells of 4 px"),
        (("--size-min", 2), "--size-min 2"),
        (("--side-min", 2), "--side-min 2"),
        (
            ("--side-min", 32, "--size-min", 4),
            "--side-min 32.0 is given together with --size-min 4",
        ),
        (("--tolerance", "nan"), "--tolerance nan"),
        (("--candidates", 0), "--candidates 0"),
        (("--id", 1), "run folders is 0"),
        (("--block", 8), "--block cannot be used with only genomes"),
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
        ("town.parquet", "both the input and the output"),
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
    draw_code(0, 2, 2, block=24).write(tmp_path / "coarse.parquet")
    words = ("grow", tmp_path / "coarse.parquet", *SIZE, "-o", tmp_path / "f.parquet")
    refused(tmp_path, *words, says="encode the maps again")
    words = ("grow", town, *AT_2_M, *SIZE, "--height", 98, "-o", tmp_path / "f.parquet")
    refused(tmp_path, *words, says="multiples of 4 px")
    refused(tmp_path, "grow", town, *SIZE, "-o", tmp_path / "f.tif", says="--metres-per-pixel")


def test_a_full_disk_is_told(tmp_path, genome_file, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(np.lib.format, "write_array_header_2_0", full)
    words = ("grow", genome_file, *SIZE, "-o", tmp_path / "f.npy")
    refused(tmp_path, *words, says="No space left")
