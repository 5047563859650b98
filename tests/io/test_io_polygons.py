"""Maps -> footprints with heights -> maps: what is kept, what the formats ask for."""

import json
import re
import sqlite3

import geopandas
import momepy
import numpy as np
import pyogrio
import pytest
import shapely
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from pyproj import CRS

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import MapError
from evocity.io import attribution_of, cities, read_condensation, read_map, write_map
from evocity.io.bundled_cities import path_of

SUFFIXES = [".gpkg", ".geojson"]
PARIS = {"origin": (652_345.25, 6_862_345.5), "crs": "EPSG:2154"}

# A GeoPackage has a second layer, with styles.
LAYER = {".gpkg": {"layer": "buildings"}}


def levelled(city):
    """Float32 heights of a city whose buildings are as high as their mean, all else ground."""
    flat = np.r_[0.0, city.buildings.height].astype(np.float32)
    return flat[city.buildings.labels]


def town(seed=1, shape=(40, 40), side=2.0, placed=True, **more):
    """Blocks of some heights that touch by sides and corners, and courtyards of all shapes."""
    rng = np.random.default_rng(seed)
    coarse = rng.choice([0, 0, 1, 4, 8, 8.5, 30], size=[-(-n // 2) for n in shape])
    heights = coarse.repeat(2, axis=0).repeat(2, axis=1)[: shape[0], : shape[1]]
    heights[rng.random(shape) < 0.1] = 0
    place = PARIS if placed else {}
    return CityMap(heights, side, name="Đà Nẵng", attribution="© Ünë – x", **place, **more)


@pytest.mark.parametrize(
    ("name", "decoded"), [*((name, False) for name in cities()), ("lyon-1er", True)]
)
def test_bundled_cities_come_back_pixel_for_pixel(tmp_path, name, decoded):
    city = read_map(name)
    if decoded:
        city = decode(uniformly(city).genome).city
    for suffix in SUFFIXES:
        write_map(city, tmp_path / f"a{suffix}", raw=True)
        back = read_map(tmp_path / f"a{suffix}")
        np.testing.assert_array_equal(back.heights, levelled(city))
        assert back.attribution == attribution_of(name)
        assert back.origin == pytest.approx(city.origin, abs=1e-3)
        assert back.height_rules == {"height": len(city.buildings)}
        center = json.loads(path_of(name).read_text(encoding="utf-8"))["window"]["center"]
        assert center_in(tmp_path / f"a{suffix}") == pytest.approx(center, abs=1e-6)


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
def test_straight_walls_are_written_and_come_back(tmp_path, name, suffix):
    city = read_map(name)
    write_map(city, tmp_path / f"a{suffix}")
    table = geopandas.read_file(tmp_path / f"a{suffix}", **LAYER.get(suffix, {}))
    walls = city.walls
    assert table.id.tolist() == walls.buildings.tolist()
    np.testing.assert_allclose(table.height, walls.heights, rtol=1e-6)
    np.testing.assert_allclose(table["area"], shapely.area(walls.polygons), atol=1e-3)
    assert table.is_valid.all()
    metres = table.to_crs(city.crs).geometry.to_numpy()
    assert shapely.hausdorff_distance(metres, np.array(walls.polygons)).max() < 0.01
    if suffix == ".gpkg":
        assert shapely.coverage_is_valid(metres)
    for polygon in table.geometry:
        assert polygon.exterior.is_ccw
        assert not any(hole.is_ccw for hole in polygon.interiors)
    back = read_map(tmp_path / f"a{suffix}")
    assert (back.built == city.built).mean() > 0.985
    assert back.origin == pytest.approx(city.origin, abs=1e-3)


def center_in(path):
    if path.suffix == ".geojson":
        return json.loads(path.read_text(encoding="utf-8"))["window"]["center"]
    told = pyogrio.read_info(path, layer="buildings")["layer_metadata"]["EVOCITY_CENTER"]
    return [float(number) for number in told.split()]


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    side=st.floats(0.25, 30),
    placed=st.booleans(),
    suffix=st.sampled_from(SUFFIXES),
)
def test_any_map_comes_back_within_its_window(tmp_path_factory, seed, shape, side, placed, suffix):
    city = town(seed, shape, side, placed or suffix == ".geojson")
    path = tmp_path_factory.mktemp("polygons") / f"a{suffix}"
    write_map(city, path, raw=True)
    assert [p.name for p in path.parent.iterdir()] == [path.name]
    most = max(shape)
    back = read_map(path, pixels=most, metres_per_pixel=side)
    top, left = (most - shape[0]) // 2, (most - shape[1]) // 2
    expected = np.zeros((most, most), np.float32)
    expected[top : top + shape[0], left : left + shape[1]] = levelled(city)
    np.testing.assert_array_equal(back.heights, expected)
    assert back.crs == city.crs
    if city.crs is None:
        assert back.origin is None
    else:
        corner = city.origin[0] - left * side, city.origin[1] + top * side
        assert back.origin == pytest.approx(corner, abs=1e-3)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_polygons_are_the_buildings_and_as_ogc_wants_them(tmp_path, suffix):
    city = town(shape=(60, 50))
    assert (city.buildings.courtyards > 0).any()
    write_map(city, tmp_path / f"a{suffix}", raw=True)
    table = geopandas.read_file(tmp_path / f"a{suffix}", **LAYER.get(suffix, {}))
    buildings = city.buildings
    classes = ["class"] if suffix == ".gpkg" else []
    assert list(table.columns) == ["id", "height", "area", *classes, "geometry"]
    assert table.id.tolist() == list(range(1, len(buildings) + 1))
    np.testing.assert_allclose(table.height, buildings.height, rtol=1e-6)
    np.testing.assert_array_equal(table["area"], buildings.area)
    assert table.is_valid.all()
    assert set(table.geom_type) == {"Polygon"}
    assert sum(len(polygon.interiors) for polygon in table.geometry)
    for polygon in table.geometry:
        assert polygon.exterior.is_ccw
        assert not any(hole.is_ccw for hole in polygon.interiors)
    metres = table.to_crs(city.crs).geometry
    if suffix == ".gpkg":
        assert all(a.equals(b) for a, b in zip(metres, city.outline, strict=True))
    distances = shapely.hausdorff_distance(metres.to_numpy(), np.array(city.outline))
    assert distances.max() < 0.01
    assert metres.area.to_numpy() == pytest.approx(buildings.area, rel=0.02)
    # what an urban morphologist does next
    assert momepy.courtyard_area(metres).max() == pytest.approx(
        max(shapely.Polygon(p.exterior).area - p.area for p in city.outline), rel=0.02
    )


def test_heights_are_told_as_short_as_the_map_knows_them(tmp_path):
    city = CityMap(np.full((4, 4), 9.2), 2.0, **PARIS)
    write_map(city, tmp_path / "a.geojson")
    (feature,) = json.loads((tmp_path / "a.geojson").read_text(encoding="utf-8"))["features"]
    assert feature["properties"] == {"id": 1, "height": 9.2, "area": 64.0}


def test_geojson_is_rfc_7946_and_thanks_its_source(tmp_path):
    city = town()
    write_map(city, tmp_path / "a.geojson")
    text = (tmp_path / "a.geojson").read_text(encoding="utf-8")
    document = json.loads(text)
    assert (document["type"], document["name"]) == ("FeatureCollection", "Đà Nẵng")
    assert document["attribution"] == "© Ünë – x"
    assert document["window"]["projection"] == "EPSG:2154"
    assert "crs" not in document  # taken out of the standard
    assert not re.search(r"\d\.\d{8}", text.split('"features"')[1])
    shapes = [shapely.geometry.shape(f["geometry"]) for f in document["features"]]
    assert document["bbox"] == shapely.total_bounds(shapes).tolist()
    west, south, east, north = document["bbox"]
    assert 2.3 < west < east < 2.4
    assert 48.8 < south < north < 48.9


def test_a_geopackage_names_its_layer_its_place_and_its_source(tmp_path):
    write_map(town(), tmp_path / "a.gpkg")
    layers = pyogrio.list_layers(tmp_path / "a.gpkg").tolist()
    assert layers == [["buildings", "Polygon"], ["layer_styles", None]]
    told = pyogrio.read_info(tmp_path / "a.gpkg", layer="buildings")["layer_metadata"]
    assert (told["ATTRIBUTION"], told["NAME"]) == ("© Ünë – x", "Đà Nẵng")
    assert "metres" in told["HEIGHT"]
    assert contents(tmp_path / "a.gpkg") == ("Đà Nẵng", "© Ünë – x", 2154)


def contents(path):
    database = sqlite3.connect(path)
    try:
        return database.execute(
            "select identifier, description, srs_id from gpkg_contents"
        ).fetchone()
    finally:
        database.close()


def test_a_map_without_a_place_is_in_local_metres_or_refused(tmp_path):
    city = town(placed=False)
    write_map(city, tmp_path / "a.gpkg")
    assert contents(tmp_path / "a.gpkg")[2] == 100000  # no code
    table = geopandas.read_file(tmp_path / "a.gpkg", **LAYER[".gpkg"])
    assert CRS(table.crs).is_engineering
    assert table.total_bounds == pytest.approx(shapely.total_bounds(city.outline))
    assert 0 <= table.total_bounds.min() < table.total_bounds.max() <= 80
    with pytest.raises(MapError, match=r"no position in a reference system[^~]*WGS84[^~]*\.gpkg"):
        write_map(city, tmp_path / "a.geojson")
    assert [p.name for p in tmp_path.iterdir()] == ["a.gpkg"]


def test_local_footprints_take_no_place_and_only_metres(tmp_path):
    write_map(town(placed=False), tmp_path / "a.gpkg")
    with pytest.raises(MapError, match="no coordinate reference system, so center="):
        read_map(tmp_path / "a.gpkg", center=(2.3, 48.9))
    with pytest.raises(MapError, match="in foot"):
        read_map(local_layer(tmp_path / "b.gpkg", [0, 0, 40, 40], "foot", 0.3048))
    path = local_layer(tmp_path / "c.gpkg", [1000, 1000, 1040, 1040], "metre", 1)
    city = read_map(path, pixels=40)  # of somebody else: about the middle of the buildings
    assert (city.built.sum(), city.crs, city.origin) == (400, None, None)
    assert city.built[10:30, 10:30].all()
    lonely = local_layer(tmp_path / "d.gpkg", [0, 0, 40, 40], "metre", 1, EVOCITY_CENTER="999 0")
    with pytest.raises(MapError, match="about x = 999, y = 0"):
        read_map(lonely, pixels=40)


def test_local_footprints_lock_nothing_of_a_map_that_has_a_place(tmp_path):
    path = local_layer(tmp_path / "a.gpkg", [0, 0, 40, 40], "metre", 1)
    with pytest.raises(MapError, match=r"no coordinate reference system, but .* has"):
        read_condensation(path, town())


@pytest.mark.parametrize("told", ["1", "1 2 3", "a b", "nan 1"])
def test_a_broken_center_is_named(tmp_path, told):
    path = local_layer(tmp_path / "a.gpkg", [0, 0, 40, 40], "metre", 1, EVOCITY_CENTER=told)
    with pytest.raises(MapError, match="EVOCITY_CENTER"):
        read_map(path)


def local_layer(path, box, unit, size, **metadata):
    pyogrio.raw.write(
        path,
        geometry=shapely.to_wkb(np.array([shapely.box(*box)], dtype=object)),
        field_data=[np.array([12.0])],
        fields=["height"],
        geometry_type="Polygon",
        driver="GPKG",
        crs=f'LOCAL_CS["plan",UNIT["{unit}",{size}],AXIS["x",EAST],AXIS["y",NORTH]]',
        layer_metadata=metadata,
    )
    return path


def test_across_the_180th_meridian_geojson_is_refused(tmp_path):
    crs = CRS("+proj=tmerc +lon_0=180 +k=1 +x_0=500000 +y_0=10000000 +units=m").to_wkt()
    city = CityMap(np.full((20, 20), 9.0), 2.0, origin=(500_000 - 20, 8_000_000), crs=crs)
    with pytest.raises(MapError, match=r"180th meridian[^~]*\.gpkg"):
        write_map(city, tmp_path / "a.geojson")
    write_map(city, tmp_path / "a.gpkg")
    assert read_map(tmp_path / "a.gpkg", pixels=20).built.all()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_failed_write_leaves_the_old_file(tmp_path, suffix, monkeypatch):
    (tmp_path / f"a{suffix}").write_bytes(b"old")
    monkeypatch.setattr("evocity.io.footprint_files._footprints", fail)
    with pytest.raises(MapError, match="No space left"):
        write_map(town(), tmp_path / f"a{suffix}")
    assert [p.name for p in tmp_path.iterdir()] == [f"a{suffix}"]
    assert (tmp_path / f"a{suffix}").read_bytes() == b"old"


def fail(*_):
    raise OSError("No space left on device")


def test_only_metres_that_hold_are_written(tmp_path, town):
    for crs, origin in (("EPSG:4326", (10.0, 20.0)), ("EPSG:2154", (1e12, 6.52e6))):
        city = CityMap(town.heights, 2.0, name="strange", crs=crs, origin=origin)
        for suffix in (".gpkg", ".geojson"):
            path = tmp_path / f"strange{suffix}"
            with pytest.raises(MapError) as fault:
                write_map(city, path)
            assert "strange" in fault.value.found
            assert not path.exists()


def test_an_origin_without_a_system_is_kept(tmp_path, town):
    city = CityMap(town.heights, 2.0, name="afloat", origin=(10.0, 20.0))
    write_map(city, tmp_path / "afloat.gpkg", raw=True)
    side = max(city.shape)
    again = read_map(tmp_path / "afloat.gpkg", pixels=side, metres_per_pixel=2.0)
    assert np.array_equal(again.heights > 0, city.buildings.labels > 0)
