"""`evocity curve`: from a map to a line, to a curve, to another line, and back onto a map."""

import json

import numpy as np
import pytest
from cli_tools import AT_2_M, call, refused, write_town
from PIL import Image

import evocity
from evocity.io import PlacedLines, read_lines, write_lines
from evocity.shapes import Curve, Detailed, read_curve, write_curve

AT = np.linspace(0, 120, 3 * 32 + 1)
WAVE = np.column_stack([AT, 60 + 20 * np.sin(AT / 25)])


@pytest.fixture
def files(tmp_path):
    """A town, a smooth line, a rough one that does not cross itself, and curves of both."""
    write_town(tmp_path / "town.npy")
    rng = np.random.default_rng(4)
    rough = WAVE + np.column_stack([np.zeros(len(AT)), rng.normal(0, 0.8, len(AT))])
    for name, line in (("smooth", WAVE), ("rough", rough)):
        write_lines(PlacedLines((line,), None, f"© {name}"), tmp_path / f"{name}.geojson")
        one = Detailed.of(line, Curve.bezier(np.zeros((4, 2))).maps)
        write_curve(one, tmp_path / f"{name}.json", None, f"© {name}")
    return tmp_path


@pytest.mark.parametrize("what", ["edge", "facades", "streets", "skyline"])
def test_lines_of_a_map_are_traced(files, what):
    path = files / "lines.geojson"
    words = ["--what", what, "--bearing", "30"] if what == "skyline" else ["--what", what]
    told = call("curve", "trace", files / "town.npy", *AT_2_M, *words, "--json", "-o", path)
    lines = read_lines(path).lines
    assert [one["points"] for one in json.loads(told.stdout)["lines"]] == [len(lines[0])]


def test_the_outline_of_a_picture_is_traced(files):
    dark = np.full((40, 60), 255, np.uint8)
    dark[5:30, 10:50] = 0
    Image.fromarray(dark).save(files / "leaf.png")
    words = "curve", "trace", files / "leaf.png", "--what", "outline"
    told = call(*words, "--json", "-o", files / "leaf.geojson")
    (line,) = read_lines(files / "leaf.geojson").lines
    assert json.loads(told.stdout)["lines"][0]["points"] == len(line)
    refused(files, *words, "--id", 1, "-o", files / "a.geojson", says="--what outline")
    words = "curve", "trace", files / "town.npy", "--what", "outline"
    refused(files, *words, "-o", files / "a.geojson", says="PNG")


@pytest.mark.slow
def test_a_line_is_fitted_and_told(files):
    path = files / "fitted.parquet"
    told = json.loads(
        call(
            "curve", "fit", files / "rough.geojson", "--starts", 2, "--drawn", 2, "-o", path,
            "--json",
        ).stdout
    )  # fmt: skip
    assert (told["points"], told["depth"], told["numbers"]) == (97, 5, 25)
    assert told["contraction"]["proved"]
    assert 0 < told["rms"] < 2
    stored = read_curve(path)
    assert (stored.crs, stored.attribution) == (None, "© rough")
    words = call("curve", "fit", files / "smooth.geojson", "--drawn", "all", "-o", path).stdout
    assert "without the finest 5 levels: 4 points" in words

    for suffix in (".png", ".svg", ".geojson"):
        call("curve", "detail", files / "rough.json", "-o", files / f"a{suffix}")
    with Image.open(files / "a.png") as picture:
        assert np.asarray(picture).min() < 100
    assert (files / "a.svg").read_text().count("L") == 96
    told = json.loads(
        call(
            "curve", "detail", files / "rough.json", "--drop", 3, "-o", files / "b.json", "--json"
        ).stdout
    )
    assert [one["amount"] > 0 for one in told["levels"]] == [True, True, False, False, False]
    assert len(json.loads((files / "b.json").read_text())["points"]) == 13
    assert 0.9 < told["dimension"] < 1.2
    assert "level  points  detail" in call("curve", "detail", files / "rough.json").stdout


def test_details_go_from_one_to_another_and_grow(files):
    path = files / "a.json"
    told = call("curve", "transfer", files / "smooth.json", files / "rough.json", "-o", path,
                "--levels", 3, "--json")  # fmt: skip
    assert json.loads(told.stdout)["crosses"] is None
    found, donor = read_curve(path), read_curve(files / "rough.json")
    assert found.attribution == "© smooth; © rough"
    np.testing.assert_allclose(found.detailed.details[3], donor.detailed.details[3], atol=1e-9)

    told = call("curve", "amplify", files / "rough.json", "--gain", 60, "--levels", "3,4",
                "-o", path, "--json")  # fmt: skip
    assert "crosses itself at (" in told.stderr
    assert len(json.loads(told.stdout)["crosses"]) == 2
    np.testing.assert_allclose(
        read_curve(path).detailed.details[4], 60 * donor.detailed.details[4], atol=1e-6
    )
    refused(files, "curve", "lay", path, files / "town.npy", *AT_2_M, "--width", 8,
            "-o", files / "b.npy", says="crosses itself")  # fmt: skip


def test_a_course_is_laid_and_kept_by_decoding(files):
    path, mask = files / "with.npy", files / "mask.npy"
    told = call("curve", "lay", files / "smooth.json", files / "town.npy", *AT_2_M,
                "--width", 8, "-o", path, "--mask", mask, "--json")  # fmt: skip
    covered = np.load(mask) > 0
    assert json.loads(told.stdout)["pixels"] == covered.sum() > 200
    before, after = np.load(files / "town.npy"), np.load(path)
    assert (after[covered] == 0).all()
    assert (after[~covered] == before[~covered]).all()
    assert json.loads(told.stdout)["built"] == 4 * (before[covered] > 0).sum()
    call(
        "encode",
        path,
        *AT_2_M,
        "--lock",
        mask,
        "--no-fit",
        "--no-settle",
        "-o",
        files / "g.parquet",
    )
    city = evocity.decode(evocity.read_genome(files / "g.parquet")).city
    assert (city.heights[covered] == 0).all()
    call("curve", "lay", files / "smooth.json", files / "town.npy", *AT_2_M, "--width", 4,
         "--height", 12, "-o", path)  # fmt: skip
    assert (np.load(path) == 12).sum() > 100


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["trace", "{}/town.npy", *AT_2_M, "-o", "{}/a.shp"], ".geojson"),
        (["fit", "{}/none.geojson", "-o", "{}/a.json"], "No such file"),
        (["fit", "{}/smooth.geojson", "-o", "{}/a.txt"], ".json"),
        (["fit", "{}/smooth.geojson", "--drawn", "x", "-o", "{}/a.json"], "--drawn x"),
        (["fit", "{}/smooth.geojson", "--number", "1", "-o", "{}/a.json"], "--number 1"),
        (["fit", "{}/smooth.json", "-o", "{}/a.json"], "not GeoJSON"),
        (["detail", "{}/smooth.geojson"], "not a curve"),
        (["detail", "{}/smooth.json", "--drop", "6"], "levels = 6"),
        (["transfer", "{}/smooth.json", "{}/rough.json", "--levels", "9", "-o", "{}/a.json"], "9"),
        (["amplify", "{}/smooth.json", "--gain", "nan", "-o", "{}/a.json"], "--gain nan"),
        (["amplify", "{}/smooth.json", "--gain", "1", "--levels", "7", "-o", "{}/a.json"], "7"),
        (["amplify", "{}/smooth.json", "--gain", "1", "--levels", "x", "-o", "{}/a.json"], "x"),
        (
            ["lay", "{}/smooth.json", "{}/town.npy", *AT_2_M, "--width", "1", "-o", "{}/a.npy"],
            "--width 1",
        ),
        (
            ["lay", "{}/far.json", "{}/town.npy", *AT_2_M, "--width", "9", "-o", "{}/a.npy"],
            "covers no pixel",
        ),
        (
            ["lay", "{}/earth.json", "{}/town.npy", *AT_2_M, "--width", "9", "-o", "{}/a.npy"],
            "no position in a",
        ),
    ],
)
def test_what_cannot_be_done_is_refused(files, words, says):
    one = read_curve(files / "smooth.json").detailed
    write_curve(one.moved(one.curve.points + 1e5), files / "far.json")
    write_curve(one, files / "earth.json", "EPSG:2154")
    refused(files, "curve", *(word.format(files) for word in words), says=says)
