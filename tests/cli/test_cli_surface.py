"""`evocity surface`: from a raster of the ground to a surface, and to the ground of another."""

import json
import shutil

import numpy as np
import pytest
import rasterio
from affine import Affine
from cli_tools import call, refused

from evocity.shapes import read_surface


def write_ground(path, seed, crs="EPSG:2154", side=25, holes=0):
    heights = np.cumsum(np.cumsum(np.random.default_rng(seed).normal(size=(side, side)), 0), 1)
    heights = 200 + heights
    heights[0, :holes] = -9999
    with rasterio.open(
        path, "w", driver="GTiff", height=side, width=side, count=1, dtype="float32", crs=crs,
        transform=Affine(2, 0, 840_000, 0, -2, 6_520_000), nodata=-9999,
    ) as file:  # fmt: skip
        file.write(heights.astype(np.float32), 1)


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    folder = tmp_path_factory.mktemp("grounds")
    for seed, name in enumerate(("plain", "hills")):
        write_ground(folder / f"{name}.tif", seed)
        call("surface", "fit", folder / f"{name}.tif", "--starts", 1, "--drawn", 2,
             "-o", folder / f"{name}.json")  # fmt: skip
    return folder


@pytest.fixture
def files(fitted, tmp_path):
    """Rasters of two grounds, and surfaces of both."""
    return shutil.copytree(fitted, tmp_path, dirs_exist_ok=True)


def test_a_ground_is_fitted_changed_and_written_as_a_raster(files):
    told = call("surface", "fit", files / "plain.tif", "--starts", 1, "--drawn", 2, "--json",
                "-o", files / "a.parquet")  # fmt: skip
    facts = json.loads(told.stdout)
    assert (facts["heights"], facts["depth"], facts["numbers"]) == ([25, 25], 2, 7 * 7 + 2 * 66)
    stored = read_surface(files / "a.parquet")
    assert (stored.crs, stored.corner, stored.surface.spacing) == (
        "EPSG:2154", (840_001, 6_519_999), (2, 2),
    )  # fmt: skip
    levels = json.loads(call("surface", "detail", files / "plain.json", "--json").stdout)["levels"]
    assert levels[0]["rms"] == pytest.approx(facts["rms"])
    call("surface", "transfer", files / "plain.json", files / "hills.json", "-o", files / "b.tif",
         "--levels", 2)  # fmt: skip
    call("surface", "amplify", files / "plain.json", "--gain", 1, "-o", files / "c.tif")
    with rasterio.open(files / "plain.tif") as before, rasterio.open(files / "c.tif") as after:
        assert before.transform == after.transform
        assert before.crs == after.crs
        np.testing.assert_allclose(before.read(1), after.read(1), atol=1e-3)
    call("surface", "detail", files / "plain.json", "--drop", 2, "-o", files / "smooth.json")
    assert len(json.loads((files / "smooth.json").read_text())["heights"]) == 7


def test_rasters_at_fault_are_refused(files):
    write_ground(files / "holes.tif", 2, holes=3)
    write_ground(files / "degrees.tif", 2, crs="EPSG:4326")
    write_ground(files / "few.tif", 2, side=3)
    for name, says in (
        ("holes.tif", "holes: 3 of 625"),
        ("degrees.tif", "degrees"),
        ("few.tif", "at least 7 heights"),
        ("plain.json", "raster"),
    ):
        refused(files, "surface", "fit", files / name, "-o", files / "x.json", says=says)
    refused(files, "surface", "fit", files / "plain.tif", "-o", files / "x.txt", says=".json")
    words = "surface", "amplify", files / "plain.json", "--gain", 2, "-o", files / "x.tif"
    refused(files, *words, "--levels", "9", says="levels")
    refused(files, *words, "--levels", "x", says="--levels x")
