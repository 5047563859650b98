"""CityJSON as its users write it: parts, stacked parts, feet, degrees, a line for each feature."""

import json

import numpy as np
import pytest

from evocity.errors import MapError
from evocity.io import read_map
from evocity.io.map_reader import data_of
from evocity.io.reader_types import Request

RD = 7415
CORNERS = {RD: (85000.0, 447000.0), 2263: (983000.0, 206000.0), 4979: (139.76, 35.68)}


class Model:
    """Objects of blocks: x, y, width, depth, bottom and top in metres, or in units of the CRS."""

    def __init__(self, crs=RD, unit=(1.0, 1.0)):
        self.crs, self.unit, self.objects, self.vertices = crs, unit, {}, []

    def corners(self, x, y, wide, deep, z):
        first = len(self.vertices)
        left, low = CORNERS[self.crs]
        for a, b in ((0, 0), (1, 0), (1, 1), (0, 1)):
            at = left + (x + a * wide) * self.unit[0], low + (y + b * deep) * self.unit[1]
            self.vertices.append([*at, z])
        return [first + k for k in range(4)]

    def flat(self, x, y, wide, deep, z=0.0):
        ring = self.corners(x, y, wide, deep, z)
        return {"type": "MultiSurface", "lod": "0", "boundaries": [[ring]]}

    def block(self, x, y, wide, deep, low, high, lod="1.2"):
        below, above = (self.corners(x, y, wide, deep, z) for z in (low, high))
        walls = [[[below[k], below[k - 3], above[k - 3], above[k]]] for k in range(4)]
        return {"type": "Solid", "lod": lod, "boundaries": [[[below[::-1]], [above], *walls]]}

    def add(self, name, *geometry, parent=None, kind=None, **attributes):
        item = {"type": kind or ("BuildingPart" if parent else "Building")}
        item |= {"attributes": attributes, "geometry": list(geometry)}
        if parent:
            item["parents"] = [parent]
        self.objects[name] = item
        return self

    def document(self):
        system = f"https://www.opengis.net/def/crs/EPSG/0/{self.crs}"
        return {
            "type": "CityJSON",
            "version": "2.0",
            "metadata": {"referenceSystem": system},
            "CityObjects": self.objects,
            "vertices": self.vertices,
        }

    def write(self, tmp_path):
        path = tmp_path / "a.city.json"
        path.write_text(json.dumps(self.document()))
        return path


def areas(path):
    city = read_map(path, pixels=512, metres_per_pixel=0.5)
    heights, counts = np.unique(city.heights, return_counts=True)
    return {
        round(float(h), 2): pytest.approx(n / 4, rel=0.04)
        for h, n in zip(heights, counts, strict=True)
        if h
    }


def account(path):
    found = data_of(path, Request())[0].account
    return found.features, dict(found.dropped)


REPLACED = "replaced by building parts"


@pytest.mark.parametrize("lod", ["1.2", "2.2"])
@pytest.mark.parametrize("high", [3, 12])
def test_parts_replace_a_parent_of_lod_0(tmp_path, lod, high):
    model = Model()
    model.add("a", model.flat(0, 0, 20, 20))
    model.add("a-0", model.block(0, 0, 20, 20, 0, high, lod), parent="a")
    path = model.write(tmp_path)
    assert areas(path) == {high: 400}
    assert account(path) == (2, {REPLACED: 1})


def test_a_parent_keeps_the_ground_without_parts(tmp_path):
    model = Model()
    model.add("a", model.flat(0, 0, 40, 40), measuredHeight=9)
    model.add("b", model.block(0, 0, 20, 20, 0, 3), parent="a")
    assert areas(model.write(tmp_path)) == {9: 1200, 3: 400}


@pytest.mark.parametrize("ground", [0, -2, 170])
def test_a_part_on_a_podium_stands_on_the_ground(tmp_path, ground):
    model = Model()
    model.add("a")
    model.add("p", model.block(0, 0, 40, 40, ground, ground + 20), parent="a")
    model.add("t", model.block(10, 10, 20, 20, ground + 20, ground + 60), parent="a")
    model.add("s", model.block(15, 15, 10, 10, ground + 60, ground + 75), parent="t")
    path = model.write(tmp_path)
    assert areas(path) == {20: 1200, 60: 300, 75: 100}
    assert account(path) == (4, {REPLACED: 1})


def test_a_measured_height_that_repeats_the_part_gives_way(tmp_path):
    model = Model()
    model.add("a")
    model.add("p", model.block(0, 0, 40, 40, 0, 20), parent="a")
    model.add("t", model.block(10, 10, 20, 20, 20, 60), parent="a", measuredHeight=40)
    assert areas(model.write(tmp_path)) == {20: 1200, 60: 400}


def test_a_detached_part_stands_on_its_own_ground(tmp_path):
    model = Model()
    model.add("a")
    model.add("p", model.block(0, 0, 20, 20, 0, 20), parent="a")
    model.add("t", model.block(50, 0, 20, 20, 10, 15), parent="a")
    assert areas(model.write(tmp_path)) == {20: 400, 5: 400}


@pytest.mark.parametrize(
    ("own", "height"),
    [({}, 5), ({"measuredHeight": 7}, 7), ({"measuredHeight": 0}, 5), ({"height": 8}, 8)],
)
def test_the_own_height_of_a_part_comes_first(tmp_path, own, height):
    model = Model()
    model.add("a", measuredHeight=30.0)
    model.add("b", model.block(0, 0, 20, 20, 0, 5), parent="a", **own)
    assert areas(model.write(tmp_path)) == {height: 400}


def test_a_part_without_a_height_inherits_it(tmp_path):
    model = Model()
    model.add("a", measuredHeight=30.0)
    model.add("b", model.flat(0, 0, 20, 20), parent="a")
    assert areas(model.write(tmp_path)) == {30: 400}


@pytest.mark.parametrize("measured", [0, 42890, None, "unknown"])
def test_a_measured_height_that_is_none_gives_way_to_the_solid(tmp_path, measured):
    model = Model()
    model.add("a", model.block(0, 0, 20, 20, 0, 12), measuredHeight=measured)
    assert areas(model.write(tmp_path)) == {12: 400}


@pytest.mark.parametrize("storeys", [2, 5])
def test_storeys_of_cityjson(tmp_path, storeys):
    model = Model()
    model.add("a", model.flat(0, 0, 20, 20), storeysAboveGround=storeys)
    assert areas(model.write(tmp_path)) == {3 * storeys: 400}


@pytest.mark.parametrize(("own", "height"), [({}, 30.48), ({"measuredHeight": 100}, 30.48)])
def test_feet(tmp_path, own, height):
    model = Model(2263)
    model.add("a", model.block(0, 0, 60, 60, 10, 110), **own)
    assert areas(model.write(tmp_path)) == {height: 3600 * 0.3048**2}


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("side", [5, 20])
def test_degrees(tmp_path, swapped, side):
    model = Model(4979, (1 / 111_195 / np.cos(np.radians(35.68)), 1 / 111_195))
    model.add("a", model.block(0, 0, side, side, 3, 15))
    if swapped:
        model.vertices = [[y, x, z] for x, y, z in model.vertices]
    assert areas(model.write(tmp_path)) == {12: side**2}


def test_a_degenerate_hole_costs_the_hole(tmp_path):
    model = Model()
    roof = model.flat(0, 0, 20, 20)
    roof["boundaries"][0].append([0, 1])
    model.add("a", roof).add("b", {**roof, "boundaries": [[[0, 1]]]})
    path = model.write(tmp_path)
    assert areas(path) == {6: 400}
    assert account(path) == (2, {"with a degenerate outline": 1})


def features(count, tail=""):
    header = Model().document()
    lines = [json.dumps(header)]
    for k in range(count):
        model = Model().add("a")
        model.add("b", model.block(40 * k, 0, 20, 20, 0, 3 * (k + 1)), parent="a")
        lines.append(json.dumps({**model.document(), "type": "CityJSONFeature", "id": "a"}))
    return "\n".join(lines) + tail


@pytest.mark.parametrize("name", ["a.city.jsonl", "a.jsonl", "a.city.json", "a.json"])
@pytest.mark.parametrize("count", [1, 3])
def test_a_line_for_each_feature(tmp_path, name, count):
    path = tmp_path / name
    path.write_text(features(count, "\n\n"))
    assert areas(path) == {3 * (k + 1): 400 for k in range(count)}
    assert account(path) == (2 * count, {REPLACED: count})


@pytest.mark.parametrize(
    ("tail", "found"),
    [
        ("\n{", "line 3 is not complete JSON"),
        ('\n{"type": "Feature"}', "line 3: the JSON has the type 'Feature'"),
        ('\n{"type": "CityJSONFeature"}', "line 3: the CityJSON cannot be read"),
    ],
)
def test_bad_lines(tmp_path, tail, found):
    path = tmp_path / "a.city.jsonl"
    path.write_text(features(1, tail))
    with pytest.raises(MapError, match=found):
        read_map(path)
