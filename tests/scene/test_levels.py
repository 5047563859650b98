"""Levels of detail of scenes: fewer triangles, solids that stay closed, and budgets."""

import functools
import json

import numpy as np
import pytest
import shapely
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.formats.materials import is_surface
from evocity.formats.solids import FLOOR, Group
from evocity.scene import LEVELS
from evocity.scene.blocks import merge_parts, neighbours, walls_at
from evocity.scene.detail import Level, simplify_ground

SOLID = ("1.3", "1.2", "1.0", "afar")


@functools.cache
def town() -> CityMap:
    return draw_town(5, side=128)


@functools.cache
def lyon() -> CityMap:
    return evocity.read_map("lyon-1er")


def solids(scene):
    return [group for group in scene.groups if not is_surface(group) and len(group)]


def row() -> CityMap:
    """Two houses of like height and a tower in a row, and a house that stands free."""
    heights = np.zeros((40, 60))
    heights[10:20, 5:15], heights[10:20, 15:25], heights[10:20, 25:35] = 9, 11, 30
    heights[10:20, 45:55] = 6
    return CityMap(heights, 2.0)


def test_levels_have_the_shares_of_triangles_of_the_issue():
    counts = [evocity.scene(lyon(), lod=lod).triangle_count for lod in SOLID]
    shares = np.array(counts) / counts[0]
    assert (shares <= (1, 0.6, 0.25, 0.05)).all()


@pytest.mark.parametrize("lod", SOLID[1:])
@pytest.mark.parametrize("make", [town, row, lyon])
def test_coarser_levels_are_valid_coverages_of_closed_solids(make, lod):
    scene = evocity.scene(make(), lod=lod)
    polygons = np.concatenate([group.polygons for group in solids(scene)])
    assert shapely.coverage_is_valid(polygons)
    wide, deep = scene._size
    assert shapely.box(0, 0, wide, deep).buffer(1e-6).contains(polygons).all()
    for group in solids(scene):
        whole = evocity.formats.Group(group.name, group.colour, group.polygons, group.heights).mesh
        edges = np.concatenate([whole.triangles[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
        way = edges[:, 0].astype(np.int64) * len(whole.points) + edges[:, 1]
        back = edges[:, 1].astype(np.int64) * len(whole.points) + edges[:, 0]
        assert np.array_equal(np.sort(way), np.sort(back))
        assert len(np.unique(way)) == len(way)
        assert not (group.mesh.part == FLOOR).any()
        ids = group.attributes["id"]
        assert len(set(ids)) == len(ids)


def test_parts_of_like_height_are_one_at_1_2_and_all_that_touch_at_1_0():
    city = row()
    (tall,) = (evocity.scene(city, lod="1.2").groups[1],)
    assert sorted(tall.heights) == pytest.approx([6, 10, 30])
    blocks = evocity.scene(city, lod="1.0").groups[1]
    assert sorted(blocks.heights) == pytest.approx([6, 50 / 3], rel=0.02)
    assert len(evocity.scene(city).groups[1]) == 4


def test_owners_keep_buildings_apart():
    city = row()
    owners = np.arange(len(city.buildings))
    for lod in ("1.2", "1.0"):
        assert len(walls_at(city, Level(lod), {}, owners)) == 4
    assert len(walls_at(city, Level("1.0"), {}, owners // 2)) == 3


def test_small_parts_join_the_longest_wall():
    heights = np.zeros((20, 40))
    heights[5:15, 5:20], heights[5:15, 20:35] = 9, 30
    heights[5:10, 20:21] = 20  # 5 px along the tower, 5 along the house
    heights[5:8, 19:20] = 20
    city = CityMap(heights, 1.0)
    becomes = merge_parts(city.told_apart(), np.zeros(len(city.buildings), int))
    assert len(np.unique(becomes)) == 2


def test_neighbours_count_shared_sides():
    labels = np.array([[1, 1, 2], [1, 3, 2], [0, 3, 3]], np.int32)
    one, other, sides = neighbours(labels)
    found = dict(zip(zip(one.tolist(), other.tolist(), strict=True), sides.tolist(), strict=True))
    assert found == {(0, 1): 1, (0, 2): 2, (1, 2): 2}


def test_footprints_lie_in_the_ground():
    scene = evocity.scene(town(), lod="0", streets=True)
    assert scene.about.lod == "0"
    surfaces = [group for group in scene.groups if is_surface(group)]
    standing = shapely.union_all(np.concatenate([group.polygons for group in solids(scene)]))
    assert sum(shapely.area(shapely.intersection(g.polygons, standing)).sum() for g in surfaces) < 1
    assert all((group.mesh.points[:, 2] == 0).all() for group in scene.groups)


def test_simple_ground_does_not_touch_itself_at_a_building():
    # without the corner (87.5, 419), the outline passes the building's corner (88, 416)
    right = [(88.8, 400), (88.8, 413.8), (87.5, 419), (84.8, 424.8)]
    outline = shapely.Polygon([(74, 400), *right, (74, 424.8)])
    pavement = shapely.difference(outline, shapely.box(80, 408, 88, 416))
    street = shapely.difference(shapely.box(60, 390, 100, 440), outline)
    polygons = [np.array([one], dtype=object) for one in (street, pavement)]
    (touching,) = shapely.coverage_simplify(np.concatenate(polygons), 3.0)[1:]
    assert shapely.minimum_clearance(touching) < 1e-6
    names = zip(("street", "pavement"), polygons, strict=True)
    flat = [Group(name, (0, 0, 0), own, np.zeros(1)) for name, own in names]
    simple = np.concatenate([group.polygons for group in simplify_ground(flat, 3.0)])
    assert shapely.minimum_clearance(simple).min() > 0.1
    assert shapely.coverage_is_valid(simple)


def test_cityjson_says_its_level(tmp_path):
    for lod in ("0", "1.0", "1.2", "1.3"):
        path = tmp_path / "t.city.json"
        evocity.scene(town(), lod=lod).write(path)
        objects = json.loads(path.read_text(encoding="utf-8"))["CityObjects"].values()
        built = [one for one in objects if one["type"] == "Building"]
        assert {one["geometry"][0]["lod"] for one in built} == {lod}
        assert all(one["attributes"]["measuredHeight"] > 1.5 for one in built)


def test_a_budget_chooses_the_finest_level_that_fits():
    counts = {lod: evocity.scene(lyon(), lod=lod).triangle_count for lod in SOLID}
    for lod in SOLID:
        scene = evocity.scene(lyon(), triangles=counts[lod])
        assert (scene.lod, scene.triangle_count) == (lod, counts[lod])
    assert evocity.scene(lyon(), triangles=counts["afar"] - 1).triangle_count < counts["afar"]
    assert evocity.scene(lyon(), lod="1.0", triangles=10**6).lod == "1.0"


def test_bad_input(tmp_path):
    city = row()
    with pytest.raises(
        MapError, match=r"(?s)level of detail 1\.2 is unknown.*one of '2\.2', '1\.3'"
    ):
        evocity.scene(city, lod=1.2)
    with pytest.raises(MapError, match="level of detail '3' is unknown"):
        evocity.scene(city, lod="3")
    for wrong in (1, 2.5, True, "many"):
        with pytest.raises(MapError, match="triangles"):
            evocity.scene(city, triangles=wrong)
    with pytest.raises(MapError, match="coarsest level of the scene"):
        evocity.scene(city, triangles=12)
    with pytest.raises(MapError, match="afar"):
        evocity.scene(city, lod="afar").write(tmp_path / "t.city.json")
    with pytest.raises(MapError, match="detail"):
        evocity.scene(city, lod="1.2", detail=-1)
    assert list(tmp_path.iterdir()) == []
    assert LEVELS == ("2.2", "1.3", "1.2", "1.0", "afar", "0")


def test_an_empty_map_has_all_levels():
    for lod in SOLID:
        scene = evocity.scene(CityMap(np.zeros((32, 32)), 2.0), lod=lod)
        assert scene.triangle_count == 2
