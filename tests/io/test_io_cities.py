"""Real districts: the bundled ones, and the originals they were cut from."""

from pathlib import Path

import numpy as np
import pytest
import shapely
from pyproj import CRS

from evocity.errors import MapError
from evocity.io import attribution_of, bundled_cities, cities, read_map, write_map
from evocity.io.geojson import read_json
from evocity.io.map_reader import data_of
from evocity.io.projection import transform_polygons
from evocity.io.rasterization import rasterize_onto
from evocity.io.reader_types import Request

SHARED = Path(__file__).parents[3] / "shared" / "data" / "cities"
with_shared = pytest.mark.skipif(not SHARED.is_dir(), reason=f"there is no {SHARED}")

# built share and buildings in the window, from the districts' own README
BUNDLED = {
    "lyon-1er": (0.60, 771),
    "new-york-west-village": (0.47, 670),
    "montpellier-pas-du-loup": (0.20, 312),
    "cape-town-salt-river": (0.37, 699),
    "villeurbanne-gratte-ciel": (0.40, 367),
}


def test_all_are_bundled_with_their_thanks():
    assert cities() == sorted(BUNDLED)
    written = (bundled_cities.path_of("lyon-1er").parent / "ATTRIBUTION.md").read_text(
        encoding="utf-8"
    )
    for name in cities():
        assert attribution_of(name) in written
        assert f"`{name}`" in written


@pytest.mark.parametrize("name", BUNDLED)
def test_bundled_district(name):
    built, buildings = BUNDLED[name]
    city = read_map(name)
    assert city.shape == (256, 256)
    assert city.metres_per_pixel == 2.0
    assert city.name == name
    assert city.attribution == attribution_of(name)
    assert city.built.mean() == pytest.approx(built, abs=0.02)
    assert sum(city.height_rules.values()) == buildings


@pytest.mark.parametrize("suffix", [".tif", ".gpkg", ".geojson", ".npy"])
def test_what_a_licence_asks_for_can_be_told_of_any_file(tmp_path, suffix):
    city = read_map("cape-town-salt-river", pixels=64)
    path = tmp_path / f"town{suffix}"
    write_map(city, path)
    size = {"metres_per_pixel": 2.0} if suffix == ".npy" else {}
    own = read_map(path, **size)
    told = read_map(path, attribution="© the town", **size)
    assert told.attribution == "© the town" != own.attribution
    assert np.array_equal(told.heights, own.heights)
    assert told.name == own.name


def test_what_the_licence_of_a_bundled_city_asks_for_stays():
    assert read_map("lyon-1er", attribution="mine").attribution == attribution_of("lyon-1er")


@pytest.mark.parametrize("told", ["", "  ", 5, ["a"], "x" * 1001], ids=repr)
def test_what_is_no_line_of_attribution_is_refused(tmp_path, told):
    path = tmp_path / "town.npy"
    np.save(path, np.ones((8, 8), np.float32))
    with pytest.raises(MapError, match=r"attribution = .*\s+expected: a text of 1 to 1000"):
        read_map(path, metres_per_pixel=2.0, attribution=told)


def test_lyon_is_built_as_the_project_says():
    assert read_map("lyon-1er").built.mean() == pytest.approx(0.59, abs=0.02)


@pytest.mark.parametrize("name", BUNDLED)
def test_burnt_area_is_the_area_of_the_union(name):
    """Oracle: shapely's union of the footprints, cut to the window."""
    found = read_json(bundled_cities.path_of(name), Request())
    polygons = transform_polygons(found.polygons, found.crs, found.projection)
    window = shapely.box(-256, -256, 256, 256)
    area = shapely.union_all(shapely.make_valid(polygons)).intersection(window).area
    for pixels, side, tolerance in ((256, 2.0, 0.005), (1024, 0.5, 0.0015)):
        city = read_map(name, pixels=pixels, metres_per_pixel=side)
        assert (city.heights > 0).sum() * side**2 == pytest.approx(area, rel=tolerance)


def test_unknown_heights_take_the_default():
    low, high = (
        read_map("montpellier-pas-du-loup", default_height=height) for height in (6.0, 30.0)
    )
    assert low.height_rules == high.height_rules == {"height": 290, "levels": 4, "default": 18}
    changed = low.heights != high.heights
    assert changed.any()
    assert (high.heights[changed] == 30).all()


@with_shared
def test_bundled_files_are_the_shared_ones():
    for name in BUNDLED:
        assert (
            bundled_cities.path_of(name).read_bytes() == (SHARED / f"{name}.geojson").read_bytes()
        )


# file, options, built share, heights by rule
ORIGINALS = [
    (
        "original-lyon-1er-epsg3946.geojson",
        {"center": (4.834374, 45.768472)},
        0.60,
        {"HAUTEUR": 768},
    ),
    ("original-new-york-west-village.osm.pbf", {"center": (-74.00669, 40.7364)}, 0.47, None),
    ("original-moscow-north.osm", {"center": (37.612, 55.8195)}, None, None),
    ("original-prague-bubenec.gpkg", {}, None, {"default": 144}),
    ("original-delft.city.json", {}, None, {"measuredHeight": 160}),
    ("barakaldo-ndsm.tif", {}, 0.34, {}),
    ("original-barakaldo-ndsm.tif", {}, None, {}),
]


@with_shared
@pytest.mark.parametrize(("file", "options", "built", "rules"), ORIGINALS)
def test_original_file(file, options, built, rules, capfd):
    city = read_map(SHARED / file, **options)
    assert city.built.any()
    assert CRS.from_user_input(city.crs).is_projected
    if built is not None:
        assert city.built.mean() == pytest.approx(built, abs=0.02)
    if rules is not None:
        assert city.height_rules == rules
    assert capfd.readouterr() == ("", "")


@with_shared
@pytest.mark.slow
def test_every_shared_file_is_read_as_it_is():
    for path in SHARED.iterdir():
        if path.suffix != ".md":
            assert read_map(path).built.any(), path.name


@with_shared
def test_old_and_new_geojson_of_lyon_agree():
    new = read_map("lyon-1er")
    path = SHARED / "original-lyon-1er-epsg3946.geojson"
    old, _ = data_of(path, Request())
    heights = np.nan_to_num(rasterize_onto(new, old, "old"))
    assert (new.heights != heights).mean() < 0.001
    assert read_map(path).crs == "EPSG:3946"  # turned by 1.3° against the grid of the other


@with_shared
def test_pbf_and_geojson_of_new_york_agree():
    new = read_map("new-york-west-village")
    old = read_map(SHARED / "original-new-york-west-village.osm.pbf", center=(-74.00669, 40.7364))
    assert (new.heights != old.heights).mean() < 0.005
    assert old.attribution == "© OpenStreetMap contributors"


@with_shared
def test_moscow_tells_levels_and_its_tower():
    city = read_map(SHARED / "original-moscow-north.osm", center=(37.6117, 55.8197), pixels=512)
    assert city.heights.max() > 300  # the mast above is thinner than a pixel
    wide = read_map(SHARED / "original-moscow-north.osm", pixels=1600)
    assert wide.height_rules["levels"] >= 100
    assert sum(wide.height_rules.values()) > 600


@with_shared
def test_prague_in_true_metres():
    """EPSG:3857 stretches areas by 1.56² there; true areas come from the national grid."""
    path = SHARED / "original-prague-bubenec.gpkg"
    import pyogrio

    _, _, shapes, _ = pyogrio.raw.read(path, layer="buildings")
    source = shapely.from_wkb(shapes)
    true = transform_polygons(source, CRS.from_epsg(3857), CRS.from_epsg(32633))
    area = shapely.union_all(true).area
    city = read_map(path, metres_per_pixel=1.0, pixels=512)
    assert city.built.sum() == pytest.approx(area, rel=0.005)
    assert shapely.union_all(source).area / city.built.sum() == pytest.approx(1.56**2, rel=0.01)


@with_shared
def test_barakaldo_is_kept_as_it_is():
    cut = read_map(SHARED / "barakaldo-ndsm.tif")
    whole = read_map(SHARED / "original-barakaldo-ndsm.tif")
    assert cut.shape == (410, 410)
    assert cut.crs == "EPSG:25830"
    assert cut.metres_per_pixel == pytest.approx(2.502, abs=0.001)
    np.testing.assert_array_equal(cut.heights, whole.heights[949 : 949 + 410, 371 : 371 + 410])
    assert (cut.heights > 2).mean() == pytest.approx(0.34, abs=0.005)
    window = read_map(SHARED / "barakaldo-ndsm.tif", pixels=256, metres_per_pixel=2.0)
    assert window.shape == (256, 256)
    assert window.built.mean() == pytest.approx(cut.built[103:307, 103:307].mean(), abs=0.02)
