"""Lines in GeoJSON and along lines on maps; whatever is wrong with them is told."""

import json

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity import CityMap
from evocity.errors import MapError
from evocity.formats import geojson_lines
from evocity.io import PlacedLines, condensation_along, line_on, read_lines, write_lines

CITY = CityMap(np.zeros((50, 60)), 2.0, origin=(1000.0, 2000.0), crs="EPSG:2154")
HERE = CityMap(np.zeros((50, 60)), 2.0)
SLANT = np.array([(10.0, 10.0), (60.0, 40.0), (110.0, 90.0)])


@settings(deadline=None, max_examples=20)
@given(st.floats(-170, 170), st.floats(-80, 80), st.integers(0, 99))
def test_lines_on_earth_come_back(tmp_path_factory, lon, lat, seed):
    path = tmp_path_factory.mktemp("lines") / "a.geojson"
    steps = np.random.default_rng(seed).normal(0, 1e-4, (20, 2))
    line = np.cumsum(steps, axis=0) + np.array([lon, lat])
    path.write_text(json.dumps({"type": "LineString", "coordinates": line.tolist()}))
    placed = read_lines(path)
    assert np.abs(placed.lines[0]).max() < 1e4  # metres about their middle
    write_lines(placed, path)
    np.testing.assert_allclose(read_lines(path).lines[0], placed.lines[0], atol=1e-3)
    told = json.loads(path.read_text())["features"][0]["geometry"]["coordinates"]
    np.testing.assert_allclose(told, line, atol=1e-8)


def test_metric_files_and_windows_stay_in_their_metres(tmp_path):
    path = tmp_path / "a.geojson"
    shapes = [
        {"type": "LineString", "coordinates": [[0, 0], [0, 0], [5, 1, 9]]},
        {"type": "Polygon", "coordinates": [[[0, 0], [9, 0], [9, 9], [0, 0]]]},
        {"type": "Point", "coordinates": [3, 3]},
    ]
    document = {"type": "GeometryCollection", "geometries": shapes}
    path.write_text(json.dumps({**document, "window": True, "attribution": "the plan"}))
    found = read_lines(path)
    assert (found.crs, found.attribution) == (None, "the plan")
    np.testing.assert_array_equal(found.lines[0], [(0, 0), (5, 1)])
    assert len(found.lines[1]) == 4
    write_lines(found, path)
    np.testing.assert_array_equal(read_lines(path).lines[1], found.lines[1])
    named = {"type": "name", "properties": {"name": "EPSG:2154"}}
    path.write_text(json.dumps({**document, "crs": named}))
    assert read_lines(path).crs == "EPSG:2154"
    np.testing.assert_array_equal(read_lines(path).lines[0], [(0, 0), (5, 1)])


def test_lines_lie_on_maps_where_they_are():
    np.testing.assert_array_equal(line_on(HERE, SLANT, None), SLANT)
    np.testing.assert_allclose(line_on(CITY, SLANT, None), SLANT + np.array([1000, 1900]))
    np.testing.assert_allclose(line_on(CITY, SLANT, "EPSG:2154"), SLANT, atol=1e-6)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 999), st.floats(2, 30), st.floats(0, 50))
def test_a_strip_has_the_pixels_that_are_near_enough(seed, width, height):
    line = np.sort(np.random.default_rng(seed).uniform(0, 100, (4, 2)), axis=0)
    layer = condensation_along(HERE, line, width, height)
    rows, columns = np.mgrid[:50, :60]
    middles = shapely.points(2.0 * columns + 1, 100 - 2.0 * rows - 1)
    away = shapely.distance(middles, shapely.LineString(line))
    sure = np.abs(away - width / 2) > 0.02 * width  # ends are arcs of some points
    np.testing.assert_array_equal(layer.mask[sure], (away <= width / 2)[sure])
    assert (layer.heights[layer.mask] == np.float32(height)).all()


@pytest.mark.parametrize(
    ("line", "width", "height", "says"),
    [
        (SLANT, 1.0, 0.0, "1.0 m on pixels of 2 m"),
        (SLANT, np.nan, 0.0, "nan"),
        (SLANT, 5000.0, 0.0, "5000"),
        (SLANT, 10.0, -1.0, "-1"),
        (SLANT + 900, 10.0, 0.0, "covers no pixel"),
        ([(0, 0), (50, 50), (50, 0), (0, 50)], 10.0, 0.0, "crosses itself"),
    ],
)
def test_what_cannot_be_laid_is_told(line, width, height, says):
    with pytest.raises(MapError, match=says):
        condensation_along(HERE, np.array(line), width, height)


def test_a_line_on_earth_needs_a_map_on_earth():
    with pytest.raises(MapError, match="no position in a coordinate"):
        line_on(HERE, SLANT, "EPSG:2154")


def line_of(*points, **more):
    return {"type": "LineString", "coordinates": list(points), **more}


NESTED = line_of([0, 0], [1, 1])
for _ in range(30):
    NESTED = {"type": "GeometryCollection", "geometries": [NESTED]}


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (b"{", "not complete JSON"),
        (b"[1, 2]", "not GeoJSON"),
        (line_of(), "no line"),
        (line_of([0, 0]), "only lines of one point"),
        (line_of([1, 1], [1, 1]), "only lines of one point"),
        (line_of([0, "x"], [1, 1]), "cannot be read"),
        (line_of([0], [1, 1]), "cannot be read"),
        (line_of([0, float("nan")], [1, 1]), "not finite"),
        (line_of([0, 0], [1, 10**400]), "cannot be read"),
        ({"type": "LineString"}, "cannot be read"),
        ({"type": "FeatureCollection", "features": 7}, "no line"),
        (line_of([500, 500], [501, 500]), "longitude and latitude"),
        (line_of([0, 0], [1, 1], crs={"properties": {"name": "+init=/etc/passwd"}}), "system"),
        (NESTED, "no line"),
        ({"type": "Point", "coordinates": [0, 0]}, "no line"),
    ],
)
def test_what_is_no_line_is_told(tmp_path, content, says):
    path = tmp_path / "a.geojson"
    path.write_bytes(content if isinstance(content, bytes) else json.dumps(content).encode())
    with pytest.raises(MapError, match=says):
        read_lines(path)


def test_files_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(geojson_lines, "MOST_POINTS", 10)
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps(line_of(*[[k, 0] for k in range(11)])))
    with pytest.raises(MapError, match="11 points"):
        read_lines(path)
    with pytest.raises(MapError, match="No such file"):
        read_lines(tmp_path / "none.geojson")
    with pytest.raises(MapError, match="cannot be written"):
        write_lines(PlacedLines((SLANT,), None), tmp_path / "none" / "a.geojson")
