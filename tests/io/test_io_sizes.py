"""Files of whole countries are refused before they fill the memory."""

import json
import tracemalloc

import pytest

from evocity.errors import MapError
from evocity.formats import geojson_lines
from evocity.io import cityjson, json_sequence, read_map
from evocity.io.openstreetmap import elements
from evocity.io.xml import stream


def test_json_that_takes_too_much_once_read_is_refused_unread(tmp_path, monkeypatch):
    path = tmp_path / "a.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [[]] * 1000}))
    monkeypatch.setattr(geojson_lines, "SMALL", 0)
    monkeypatch.setattr(geojson_lines, "MOST_MEMORY", 100_000)
    with pytest.raises(MapError, match="1002 lists and objects"):
        read_map(path)


@pytest.mark.parametrize(("ways", "nodes"), [(2, 1000), (1000, 14)])
def test_an_extract_with_too_many_buildings_is_refused(tmp_path, monkeypatch, ways, nodes):
    where = enumerate([(0, 0), (0, 9e-5), (9e-5, 9e-5), (9e-5, 0)], 1)
    nodes_told = "".join(
        f'<node id="{k}" lat="{43.5 + y}" lon="{3.8 + x}"/>' for k, (x, y) in where
    )
    refs = "".join(f'<nd ref="{k}"/>' for k in (1, 2, 3, 4, 1))
    tags = '<tag k="building" v="yes"/><tag k="height" v="6"/>'
    three = "".join(f'<way id="{k}">{refs}{tags}</way>' for k in (1, 2, 3))
    path = tmp_path / "a.osm"
    path.write_text(f'<osm version="0.6">{nodes_told}{three}</osm>')
    assert read_map(path, pixels=16).heights.max() == 6
    monkeypatch.setattr(elements, "_MOST_WAYS", ways)
    monkeypatch.setattr(elements, "_MOST_NODES", nodes)
    with pytest.raises(MapError, match="cut it to the city"):
        read_map(path, pixels=16)


def lines_of(count, feature=None, lon=4.8, lat=45.7):
    """GeoJSON lines of houses in a row."""
    for number in range(count):
        west = lon + number % 10 * 1e-3
        east, north = west + 2e-4, lat + 2e-4
        ring = [[west, lat], [east, lat], [east, north], [west, north], [west, lat]]
        geometry = {"type": "Polygon", "coordinates": [ring]}
        own = {"type": "Feature", "properties": {"height": 9}, "geometry": geometry}
        yield json.dumps(own | (feature or {})) + "\n"


def test_lines_that_take_too_much_memory_once_read_are_refused(tmp_path, monkeypatch):
    path = tmp_path / "a.geojsonl"
    path.write_text("".join(lines_of(40)))
    assert read_map(path, pixels=512).heights.max() == 9
    monkeypatch.setattr(json_sequence, "MOST_MEMORY", 50_000)
    with pytest.raises(MapError, match="of memory for features"):
        read_map(path)
    monkeypatch.setattr(json_sequence, "SMALL", 4)  # with a window, far lines cost nothing
    assert read_map(path, center=(4.8, 45.7), pixels=64).heights.max() == 9
    path.write_text("".join(lines_of(2, {"more": [[]] * 1000})))
    with pytest.raises(MapError, match="line 1, needs more than 50 kB of memory"):
        read_map(path)


def test_a_window_beyond_a_sequence_names_its_places(tmp_path, monkeypatch):
    path = tmp_path / "a.geojsonl"
    path.write_text("".join(lines_of(40)))
    monkeypatch.setattr(json_sequence, "SMALL", 4)
    words = r"among its 40 features, from longitude 4\.80000 to 4\.80920"
    with pytest.raises(MapError, match=words):
        read_map(path, center=(5.8, 45.7))
    with pytest.raises(MapError, match="give longitude first"):
        read_map(path, center=(45.7001, 4.8001))


def test_a_long_line_after_a_header_of_cityjson_is_not_read_in_the_test(tmp_path, monkeypatch):
    monkeypatch.setattr(cityjson, "_LONGEST_HEADER", 64)
    path = tmp_path / "a.city.jsonl"
    head = '{"type": "CityJSON", "CityObjects": {}}\n'
    for rest, is_sequence in ((" " * 1000, False), ("\n\n", False), (" " * 1000 + "x", True)):
        path.write_text(head + rest)
        assert cityjson.has_cityjson_lines(path) == is_sequence
    path.write_text(head + "x" * 20_000_000)
    tracemalloc.start()
    assert cityjson.has_cityjson_lines(path)
    assert tracemalloc.get_traced_memory()[1] < 5_000_000
    tracemalloc.stop()


def test_xml_of_too_many_elements_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(stream, "MOST_ELEMENTS", 400)
    monkeypatch.setattr(stream, "_CHUNK", 256)
    place = (
        "<Placemark><Polygon><extrude>1</extrude><outerBoundaryIs><LinearRing><coordinates>"
        "4.8,45.7,9 4.801,45.7,9 4.801,45.701,9 4.8,45.701,9 4.8,45.7,9"
        "</coordinates></LinearRing></outerBoundaryIs></Polygon></Placemark>"
    )
    path = tmp_path / "a.kml"
    top = '<kml xmlns="http://www.opengis.net/kml/2.2"><Document>{}</Document></kml>'
    path.write_text(top.format(place * 300))  # freed one by one
    assert read_map(path, pixels=16).heights.max() > 0
    for more in ("<a/>" * 2000, "<Placemark>" + "<a/>" * 2000 + "</Placemark>"):
        path.write_text(top.format(place + more))
        with pytest.raises(MapError, match="more than 400 XML elements"):
            read_map(path)
