"""Options of reading at the recipe desk: missing pixels, ground of elevations, columns, zips."""

import contextlib
import tomllib
import zipfile
from unittest.mock import patch

import numpy as np
import pyogrio
import pytest
import rasterio
import shapely
from brought import bring, chosen, desk, is_read, wait
from chromium import BROWSER
from test_studio_desk import at_desk

from evocity.studio import desk_maps
from evocity.studio.server import running_server

SMALL = {"window": {"pixels": 32, "metres_per_pixel": 4.0}}
NORTH_UP = rasterio.Affine(2, 0, 842000, 0, -2, 6519128)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The folder of the desk's runs."""
    return tmp_path_factory.mktemp("desk") / "runs"


@pytest.fixture(scope="module")
def client(runs):
    """One desk for all tests here: its process that reads maps has loaded what it needs."""
    with at_desk(runs) as found:
        yield found


def raster(path, heights):
    profile = {"driver": "GTiff", "count": 1, "dtype": "float32", "crs": "EPSG:2154"}
    rows, columns = heights.shape
    with rasterio.open(
        path, "w", height=rows, width=columns, transform=NORTH_UP, **profile
    ) as target:
        target.write(heights.astype(np.float32), 1)
    return path


def town(seed):
    rng = np.random.default_rng(seed)
    heights = np.zeros((64, 64))
    for row, column in np.ndindex(4, 4):
        tall, wide = rng.integers(5, 11, 2)
        top, left = 16 * row + 2, 16 * column + 2
        heights[top : top + tall, left : left + wide] = 3 * rng.integers(2, 8)
    return heights


@pytest.fixture
def rasters(tmp_path):
    """Elevations on a hill of 170 m with -9999 in a corner, and the hill."""
    surface = town(1) + 170
    surface[:2, :2] = -9999
    surface[60:, :] = 170
    return raster(tmp_path / "dsm.tif", surface), raster(
        tmp_path / "dtm.tif", np.full((64, 64), 170.0)
    )


def state(client, number):
    return next(one for one in wait(client, is_read)["maps"] if one["map"] == number)


def put(client, *choices):
    return chosen(client, [], maps=[{"chosen": True} | one for one in choices], **SMALL)


@pytest.mark.slow
def test_the_ground_of_elevations(client, rasters):
    surface, ground = (bring(client, path.name, path.read_bytes()).json["map"] for path in rasters)
    assert {"nodata", "terrain"} < set(state(client, surface)["takes"])
    assert "-9999" in state(client, surface)["fault"]["found"]
    assert "above sea level" in state(client, ground)["fault"]["found"]
    for terrain in ({"terrain": 170}, {"terrain_map": ground}):
        told = put(client, {"map": surface, "nodata": -9999, **terrain})
        assert told.status == 200
        read = state(client, surface)
        assert read["fault"] is None
        assert read["about"]["highest"] == pytest.approx(town(1)[:60].max(), abs=0.01)
        assert "heights less" in read["about"]["taken"]
    both = {"map": surface, "terrain": 170, "terrain_map": ground}
    own = {"map": surface, "terrain_map": surface}
    wrong = [{"map": surface, "terrain_map": 99}, both, own, {"map": surface, "nodata": "a"}]
    for choice in wrong:
        assert put(client, choice).status in (400, 404)
    assert client.post("/api/desk-drop", {"map": ground}).status == 200
    assert "terrain_map" not in {
        key for one in desk(client)["draft"]["maps"] for key, value in one.items() if value
    }
    assert "above sea level" in state(client, surface)["fault"]["found"]


@pytest.mark.slow
def test_only_a_raster_is_the_ground(client, rasters, tmp_path):
    pyogrio.raw.write(
        tmp_path / "a.gpkg",
        shapely.to_wkb([shapely.box(842000, 6519000, 842020, 6519020)]),
        [],
        [],
        geometry_type="Polygon",
        crs="EPSG:2154",
    )
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as packed:
        packed.write(tmp_path / "a.gpkg", "a.gpkg")
    surface, layer, packed = (
        bring(client, path.name, path.read_bytes()).json["map"]
        for path in (rasters[0], tmp_path / "a.gpkg", tmp_path / "a.zip")
    )
    assert state(client, packed)["about"]["rules"]
    for ground in (layer, packed):
        told = put(client, {"map": surface, "terrain_map": ground})
        assert told.status == 400
        assert "not a raster" in told.json["error"]["found"]
    told = put(client, {"map": surface, "terrain_map": surface})
    assert told.status == 400
    assert "its own raster of the ground" in told.json["error"]["found"]


@pytest.mark.slow
def test_columns_and_a_zip(client, rasters, tmp_path):
    corners = 20.0 * np.array(list(np.ndindex(6, 6))) + (842000, 6519000)
    pyogrio.raw.write(
        tmp_path / "a.shp",
        shapely.to_wkb(shapely.box(*corners.T, *(corners + 12).T)),
        [np.arange(36.0), np.resize([3, 4, 5], 36)],
        ["roof", "floors"],
        geometry_type="Polygon",
        crs="EPSG:2154",
    )
    with zipfile.ZipFile(tmp_path / "shape.zip", "w") as archive:
        for path in tmp_path.glob("a.*"):
            archive.write(path, path.name)
    with zipfile.ZipFile(tmp_path / "raster.zip", "w") as archive:
        archive.write(rasters[0], "dsm.tif")
    shape, packed = (
        bring(client, name, (tmp_path / name).read_bytes()).json["map"]
        for name in ("shape.zip", "raster.zip")
    )
    first = {"map": shape, "height_column": "roof", "levels_column": "floors"}
    assert put(client, first, {"map": packed, "nodata": -9999, "terrain": 170}).status == 200
    about = state(client, shape)["about"]
    assert about["rules"] == {"height_column": 35, "levels_column": 1}
    assert state(client, packed)["about"]["highest"] == pytest.approx(town(1)[:60].max(), abs=0.01)


@pytest.mark.slow
def test_a_recipe_with_the_ground_of_elevations(client, runs, rasters, tmp_path):
    other = raster(tmp_path / "other.tif", town(2))
    surface, ground, second = (
        bring(client, path.name, path.read_bytes()).json["map"] for path in (*rasters, other)
    )
    choice = {"map": surface, "nodata": -9999, "terrain_map": ground}
    assert put(client, choice, {"map": second}).status == 200
    assert client.post("/api/desk-calibrate", {}).json["busy"]
    told = wait(client, lambda one: not one["busy"])
    assert told["fault"] is None, told["fault"]
    parent = tomllib.loads(told["found"]["text"])["parents"][0]
    assert parent["terrain"] == f"map-{ground}.tif"
    assert parent["nodata"] == -9999
    started = client.post("/api/desk-begin", {}).json["started"][-1]
    recipe = runs / started["recipe"]
    assert (recipe.parent / parent["terrain"]).read_bytes() == rasters[1].read_bytes()
    wait(client, lambda one: one["started"][-1].get("has") or one["started"][-1].get("ended"))


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="chromium is not there")
def test_the_fields_of_the_page(tmp_path, rasters, browser):
    from test_studio_desk_in_a_browser import until

    with (
        patch.object(desk_maps, "DISTRICTS", {}),
        running_server(folder=tmp_path / "runs", fresh=True) as server,
        contextlib.closing(browser.new_page()) as page,
    ):
        page.goto(server.url)
        until(page, "typeof studio !== 'undefined' && studio.desk.stateText")
        page.get_by_label("width of the square map in pixels").fill("32")
        page.get_by_label("metres per pixel").fill("4")
        page.set_input_files("#desk input[type=file]", [str(path) for path in rasters])
        reading = "JSON.parse(studio.desk.stateText).maps"
        until(page, f"{reading}.length === 2 && {reading}.every((one) => one.fault)")
        card = page.locator(".evocity-cards li:has(b:text-is('dsm'))")
        card.get_by_label("value of missing pixels").fill("-9999")
        card.get_by_label("raster of the ground").select_option("dtm")
        until(page, f"{reading}.some((one) => one.about)")
        taken = page.evaluate(f"() => {reading}.find((one) => one.about).about.taken")
        assert "heights less" in taken
        page.reload()
        until(page, f"typeof studio !== 'undefined' && studio.desk.stateText && {reading}.length")
        ground = card.get_by_label("raster of the ground")
        assert ground.evaluate("(one) => one.selectedOptions[0].text") == "dtm"
        ground.evaluate("(one) => { one.closest('details').open = true; }")
        ground.select_option("none")
        card.get_by_label("elevation of the ground, m").fill("170")
        card.get_by_label("elevation of the ground, m").blur()
        until(page, f"{reading}.some((one) => one.about && one.about.taken.includes('less 170 m'))")
