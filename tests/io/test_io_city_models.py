"""City models: parts and their feet, axes and rings of GML, parts in tables, columns of heights."""

import json
import re
import time

import format_writers as w
import numpy as np
import pytest
import shapely

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.building_feet import find_feet

FINE = {"pixels": 256, "metres_per_pixel": 1.0}
A, B, C = w.box(), w.box(40), w.box(0, 40)
HOUSE = {"height": 9.0}
CITIES = {
    "a.city.json": w.write_cityjson,
    "a.city.jsonl": w.write_cityjson_lines,
    "a.gml": w.write_citygml,
}
of_cities = pytest.mark.parametrize("name", CITIES)


def read(path, **options):
    return read_map(path, **FINE | options)


def areas(city):
    """Square metres by height, to compare within 6 %."""
    heights, counts = np.unique(city.heights[city.heights > 0].round(2), return_counts=True)
    pairs = zip(heights.tolist(), counts.tolist(), strict=True)
    return {round(high, 2): pytest.approx(count, rel=0.06) for high, count in pairs}


def replaced(path, old, new):
    """Replace the first match of ``old`` in a file."""
    text, count = re.subn(old, new, path.read_text(encoding="utf-8"), count=1)
    assert count == 1
    path.write_text(text, encoding="utf-8")
    return path


# ---------------------------------------------------------------- coordinates of a point in GML

_pentagon = shapely.union(
    A, shapely.Polygon(np.add(w.CORNERS[2154], [(20, 0), (30, 10), (20, 20)]))
)
_angle = w.box(0, 0, 40).difference(w.box(20, 20, 20))


@pytest.mark.parametrize("srs", ["EPSG:2154", "urn:ogc:def:crs:EPSG::5698", ""])
@pytest.mark.parametrize(("shape", "area"), [(A, 400), (_pentagon, 500), (_angle, 1200)])
def test_points_with_z_without_a_dimension(tmp_path, srs, shape, area):
    high = shapely.force_3d(shape, 170.0)
    path = w.write_gml(tmp_path / "a.gml", [high], [HOUSE], code=None, srs=srs)
    assert areas(read(path)) == {9: area}


@pytest.mark.parametrize("srs", ["EPSG:2154", "urn:ogc:def:crs:EPSG::5698"])
@pytest.mark.parametrize("shape", [A, _angle])
def test_points_without_z_whatever_the_system_has(tmp_path, srs, shape):
    path = w.write_gml(tmp_path / "a.gml", [shape], [HOUSE], srs=srs)
    assert areas(read(path)) == {9: shape.area}


@pytest.mark.parametrize("size", [2, 3])
def test_a_surface_states_the_dimension_of_its_points(tmp_path, size):
    shape = shapely.force_3d(_angle, 170.0) if size == 3 else _angle
    path = w.write_gml(tmp_path / "a.gml", [shape], [HOUSE])
    replaced(path, "<gml:MultiSurface", f'<gml:MultiSurface srsDimension="{size}"')
    assert areas(read(path)) == {9: 1200}


def test_a_ring_of_part_of_a_point_is_refused(tmp_path):
    path = w.write_gml(tmp_path / "a.gml", [A], [HOUSE])
    replaced(path, "</gml:posList>", " 1</gml:posList>")
    with pytest.raises(MapError, match="11 numbers for points of 2"):
        read(path)


# ---------------------------------------------------------------- two spellings of one system


@pytest.mark.parametrize(
    ("bounds", "geometry", "swapped"),
    [
        ("EPSG:4326", "urn:ogc:def:crs:EPSG::4326", True),
        ("urn:ogc:def:crs:EPSG::4326", "EPSG:4326", False),
        ("EPSG:4326", "http://www.opengis.net/def/crs/EPSG/0/4326", True),
        ("EPSG:4326", "EPSG:4326", False),
    ],
)
@pytest.mark.parametrize("box", ["Envelope", "Box"])
def test_the_system_of_the_geometry_orders_the_axes(tmp_path, bounds, geometry, swapped, box):
    path = w.write_gml(
        tmp_path / "a.gml", w.degrees([A, B]), [HOUSE] * 2, srs=geometry, swapped=swapped
    )
    bounded = f'<gml:boundedBy><gml:{box} srsName="{bounds}"/></gml:boundedBy>'
    replaced(path, "(?=<gml:featureMember>)", bounded)
    city = read(path)
    assert areas(city) == {9: 800}
    assert "4.8" in city.crs.partition(",")[0]


def test_two_orders_of_axes_are_refused(tmp_path):
    path = w.write_gml(tmp_path / "a.gml", w.degrees([A, B]), [HOUSE] * 2, srs="EPSG:4326")
    replaced(path, 'srsName="EPSG:4326"', 'srsName="urn:ogc:def:crs:EPSG::4326"')
    with pytest.raises(MapError, match="two orders of axes"):
        read(path)


# ---------------------------------------------------------------- degenerate outer rings

_spot = np.add(w.CORNERS[2154], (50, 10))
_bad = shapely.Polygon([_spot, _spot + 1, _spot, _spot], [B.exterior])


@pytest.mark.parametrize(
    ("name", "write"),
    [("a.gml", w.write_gml), ("b.gml", w.write_citygml), ("a.kml", w.write_kml)],
)
def test_a_hole_without_an_outline_is_no_building(tmp_path, name, write):
    rows = [HOUSE, HOUSE]
    city = read(write(tmp_path / name, [shapely.MultiPolygon([_bad, A]), C], rows))
    assert areas(city) == {9: 800}
    assert "1 degenerate rings left out" in city.taken


def test_a_hole_of_kml_without_an_outer_boundary_is_no_building(tmp_path):
    path = w.write_kml(tmp_path / "a.kml", [A.difference(w.box(5, 5, 10)), B], [HOUSE] * 2)
    replaced(path, "<outerBoundaryIs>.*?</outerBoundaryIs>", "")
    assert areas(read(path)) == {9: 400}


# ---------------------------------------------------------------- parts of buildings


@of_cities
@pytest.mark.parametrize("key", ["height", "measuredHeight", "storeysAboveGround", "num_floors"])
def test_a_solid_part_inherits_no_height(tmp_path, name, key):
    rows = [{key: 30, "parts": [(A, {"solid": 5.0}), (B, {"solid": 7.0, "height": 8})]}]
    assert areas(read(CITIES[name](tmp_path / name, [None], rows))) == {5: 400, 8: 400}


@of_cities
def test_a_flat_part_inherits_a_height(tmp_path, name):
    rows = [{"height": 30, "parts": [(A, {}), (B, {"measuredHeight": 7})]}]
    assert areas(read(CITIES[name](tmp_path / name, [None], rows))) == {30: 400, 7: 400}


@of_cities
@pytest.mark.parametrize("share", [0.1, 0.4, 0.6])
def test_a_tower_that_stands_partly_on_a_podium(tmp_path, name, share):
    podium = w.box(0, 0, 40), {"solid": 20.0}
    tower = w.box(40 - 20 * share), {"solid": 40.0, "low": 20.0}
    mast = w.box(42, 5, 5), {"solid": 10.0, "low": 60.0}
    rows = [{"parts": [podium, tower, mast]}]
    city = read(CITIES[name](tmp_path / name, [None], rows))
    assert areas(city) == {20: 1600 - 400 * share, 60: 375, 70: 25}


def test_feet_of_many_parts_are_soon_found():
    count = 2000
    side = [shapely.box(30.0 * at, 0, 30.0 * at + 20, 20) for at in range(count)]
    lows = np.repeat(0.0, count)
    start = time.process_time()
    assert not find_feet(side, lows, lows + 9, [True] * count, 1.0).any()
    stack = [shapely.box(0, 0, 20, 20)] * count
    lows = 3.0 * np.arange(count)
    assert not find_feet(stack, lows, lows + 3, [True] * count, 1.0).any()
    assert time.process_time() - start < 5


def test_a_building_of_many_parts_is_soon_read(tmp_path):
    places = [(30 * (at % 20), 30 * (at // 20)) for at in range(600)]
    rows = [{"parts": [(w.box(*place), {"solid": 9.0}) for place in places]}]
    path = w.write_citygml(tmp_path / "a.gml", [None], rows)
    start = time.process_time()
    assert areas(read(path, pixels=1024)) == {9: 400 * 600}
    assert time.process_time() - start < 5


@pytest.mark.parametrize(("length", "is_read"), [(20, True), (1200, False)])
def test_chains_of_parents(tmp_path, length, is_read):
    path = w.write_cityjson(tmp_path / "a.city.json", [A], [{"solid": 9.0}])
    document = json.loads(path.read_text())
    objects = document["CityObjects"]
    for at in range(1, length):
        objects[f"b{at}"] = {"type": "BuildingPart", "parents": [f"b{at - 1}"]}
    path.write_text(json.dumps(document))
    if is_read:
        assert areas(read(path)) == {9: 400}
    else:
        with pytest.raises(MapError, match="more than 32 parents"):
            read(path)


# ---------------------------------------------------------------- columns of heights


@pytest.mark.parametrize("name", ["a.geojson", "a.geojsonl", "a.parquet"])
def test_a_column_of_storeys_does_not_choose_among_heights(tmp_path, name):
    write = {"a.geojson": w.write_geojson, "a.geojsonl": w.write_sequence}
    rows = [{"height": high, "Height": 20.0, "floors": None} for high in (9.0, 12.0, 15.0)]
    path = write.get(name, w.write_geoparquet)(tmp_path / name, [A, B, C], rows)
    with pytest.raises(MapError, match="two columns of heights") as fault:
        read(path, levels_column="floors")
    assert "levels_column" not in str(fault.value)
    assert areas(read(path, height_column="height")) == {9: 400, 12: 400, 15: 400}


def test_a_column_of_storeys_chooses_among_storeys(tmp_path):
    rows = [{"levels": 3, "Levels": 5}, {"levels": 4, "Levels": 6}]
    path = w.write_geojson(tmp_path / "a.geojson", [A, B], rows)
    with pytest.raises(MapError, match="two columns of heights"):
        read(path)
    assert areas(read(path, levels_column="levels")) == {9: 400, 12: 400}
