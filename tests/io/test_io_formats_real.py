"""Real files of many towns and formats, as the README beside them says; skipped without them."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import rasterio
from pyproj import CRS

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.building_choice import choose_buildings
from evocity.io.heights import HeightRules
from evocity.io.map_reader import data_of
from evocity.io.reader_types import Request

MORE = Path(__file__).parents[2].parent / "shared" / "data" / "more"

pytestmark = pytest.mark.skipif(not MORE.is_dir(), reason="the real files are not here")

# file, built share of 512 m, of 1024 m if the README gives it, buildings in 512 m
TOWNS = [
    ("tokyo-ginza.geojson", 0.49, 0.44, 489),
    ("barcelona-eixample.geojson", 0.53, 0.44, 403),
    ("boulder-table-mesa.geojson", 0.13, 0.14, 164),
    ("st-petersburg-morskaya.geojson", 0.16, 0.16, 45),
    ("st-petersburg-lines.geojson", 0.45, 0.41, 228),
    ("kathmandu-ward-7.geojson", 0.31, 0.23, 758),
    ("heidelberg-altstadt.geojson", 0.41, 0.22, 561),
]
FORMATS = [
    ("original-vienna.city.jsonl", 0.09, {}),
    ("original-berlin-lod2.gml", 0.13, {}),
    ("original-potsdam-lod1.gml", 0.13, {}),
    ("original-overture-ochtendung.parquet", 0.04, {}),
    ("st-petersburg.parquet", 0.04, {"center": (30.25038, 59.943086)}),
    ("original-norway-overpass.json", 0.02, {}),
    ("original-zurich-epsg3857.fgb", 0.21, {"center": (8.522075, 47.384342)}),
    ("boulder-table-mesa-shapefile.zip", 0.14, {}),
    ("original-kml-samples.kml", 0.09, {"layer": "Google Campus"}),
]
# file, rule, number of heights by it, least, median and greatest height
HEIGHTS = [
    ("tokyo-ginza.geojson", "height", 2075, 2.6, 27.7, 189.6, {}),
    ("st-petersburg-morskaya.geojson", "height", 104, 3, 27, 66, {}),
    ("st-petersburg-lines.geojson", "height", 663, 3, 12, 27, {}),
    ("heidelberg-altstadt.geojson", "height", 192, 3, 9, 20, {}),
    ("original-vienna.city.jsonl", "measuredHeight", 175, 2.8, None, 30.3, {}),
    ("original-berlin-lod2.gml", "solid", 61, 0.1, 26.4, 34.9, {}),
    ("original-potsdam-lod1.gml", "solid", 97, 2.2, 6.6, 20, {}),
    ("original-overture-ochtendung.parquet", "height", 39, 3.2, 4.6, 6, {}),
    ("st-petersburg.parquet", "levels_column", 1611, 3, None, None, {"levels_column"}),
    ("original-zurich-epsg3857.fgb", "height", 6, None, None, None, {}),
    ("original-kml-samples.kml", "solid", 4, 17, None, 25, {"layer"}),
    ("boulder-table-mesa-shapefile.zip", "default", 788, 6, 6, 6, {}),
    ("original-norway-overpass.json", "default", 86, 6, 6, 6, {}),
]
OPTIONS = {"layer": "Google Campus", "levels_column": "storeys_count"}


@pytest.mark.parametrize(("name", "built", "wide", "buildings"), TOWNS)
def test_towns(name, built, wide, buildings):
    city = read_map(MORE / name)
    assert city.built.mean() == pytest.approx(built, abs=0.01)
    assert sum(city.height_rules.values()) == buildings
    assert read_map(MORE / name, pixels=512).built.mean() == pytest.approx(wide, abs=0.01)


@pytest.mark.parametrize(("name", "built", "options"), FORMATS)
def test_formats(name, built, options):
    assert read_map(MORE / name, **options).built.mean() == pytest.approx(built, abs=0.01)


@pytest.mark.parametrize(("name", "rule", "count", "least", "median", "most", "options"), HEIGHTS)
def test_heights_of_all_buildings(name, rule, count, least, median, most, options):
    request = Request(**{key: OPTIONS[key] for key in options})
    _, tags, _ = choose_buildings(data_of(MORE / name, request)[0], name, False)
    rules = HeightRules(6.0, levels_column=request.levels_column)
    counted, heights = 0, []
    for each in tags:
        height = rules.apply(each)
        if rules.used[rule] > counted:
            counted = rules.used[rule]
            heights.append(height)
    assert counted == count
    found = np.min(heights), np.median(heights), np.max(heights)
    for value, expected in zip(found, (least, median, most), strict=True):
        assert expected is None or value == pytest.approx(expected, abs=0.06)


def test_the_folders_of_a_kml_file_are_listed():
    with pytest.raises(MapError, match="3 layers") as fault:
        read_map(MORE / "original-kml-samples.kml")
    assert "Google Campus" in str(fault.value)
    pentagon = read_map(MORE / "original-kml-samples.kml", layer="Extruded Polygon")
    assert pentagon.heights.max() == 100.0


@pytest.mark.parametrize(
    ("town", "built", "highest", "lowest", "code"),
    [
        ("athens", 0.49, 25.0, -4.3, "EPSG:2100"),
        ("original-goteborg", 0.50, 52.4, -6.8, "EPSG:3007"),
    ],
)
def test_elevations_with_their_terrain(town, built, highest, lowest, code):
    surface, terrain = MORE / f"{town}-dsm.tif", MORE / f"{town}-dem.tif"
    for path in (surface, terrain):
        with pytest.raises(MapError, match="elevations above sea level") as fault:
            read_map(path)
        assert "terrain=" in str(fault.value)
    city = read_map(surface, terrain=terrain)
    assert city.built.mean() == pytest.approx(built, abs=0.01)
    assert city.heights.max() == pytest.approx(highest, abs=0.06)
    assert city.crs == code
    assert f"less the terrain {terrain.name}" in city.taken
    with rasterio.open(surface) as high, rasterio.open(terrain) as low:
        values = high.read(1).astype(float) - low.read(1)
    assert values.min() == pytest.approx(lowest, abs=0.06)
    assert np.abs(city.heights - values.clip(0)).max() < 1e-4
    with pytest.raises(MapError, match="does not give heights above ground"):
        read_map(terrain, terrain=surface)


def test_a_grid_of_trees(tmp_path):
    path = shutil.copy(MORE / "original-goteborg-cdsm.asc", tmp_path / "trees.asc")
    with pytest.raises(MapError, match="size of its pixels") as fault:
        read_map(path)
    assert ".prj" in str(fault.value)
    (tmp_path / "trees.prj").write_text(CRS.from_epsg(3007).to_wkt("WKT1_ESRI"))
    city = read_map(path)
    assert city.crs == "EPSG:3007"
    assert city.shape == (223, 234)
    assert city.built.mean() == pytest.approx(0.06, abs=0.01)
    assert city.heights.max() == pytest.approx(24.4, abs=0.06)
    assert "may hold no buildings" in city.taken


def test_every_file_has_a_test():
    tested = {row[0] for row in TOWNS + FORMATS}
    tested |= {
        f"{town}-{kind}.tif" for town in ("athens", "original-goteborg") for kind in ("dsm", "dem")
    }
    tested |= {"original-goteborg-cdsm.asc", "README.md"}
    assert {path.name for path in MORE.iterdir()} == tested
