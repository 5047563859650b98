"""Files of whole countries are refused before they fill the memory."""

import json

import pytest

from evocity.errors import MapError
from evocity.formats import geojson_lines
from evocity.io import read_map
from evocity.io.openstreetmap import elements


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
