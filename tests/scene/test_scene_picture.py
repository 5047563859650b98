"""Axonometric pictures of scenes."""

import naive
import numpy as np
import pyogrio
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image
from towns import draw_town

import evocity
import evocity.scene
from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.pictures.colours import PAPER, ramp
from evocity.scene import picture as room
from evocity.scene._kernels import fill, light, outlined, painted


def scene_of(heights, pixel: float = 2.0, **described):
    return evocity.scene(CityMap(np.asarray(heights, float), pixel, **described))


def tower(high: float = 30.0):
    heights = np.zeros((40, 40))
    heights[18:22, 18:22] = high
    return scene_of(heights)


def bare(scene, **how) -> np.ndarray:
    return np.asarray(scene.picture(width=200, legend=False, **how)).astype(int)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6), st.integers(-3, 5))
def test_fill_is_its_slow_twin(seed, count, first):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-4, 16, (count, 3, 3))
    depth, surface = np.full((11, 13), -np.inf, np.float32), np.full((11, 13), -1, np.int32)
    fill(corners, first, depth, surface)
    slow, deep = naive.filled(corners - [0, first, 0], 11, 13)
    # a centre within rounding of a side may be told otherwise
    assert np.count_nonzero(surface != slow) <= 1
    same = (surface == slow) & (slow >= 0)
    assert np.allclose(depth[same], deep[same], atol=1e-3)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_light_edges_and_paint_are_their_slow_twins(seed):
    rng = np.random.default_rng(seed)
    surface = rng.integers(-1, 4, (6, 4)).repeat(2, axis=1).astype(np.int32)
    depth = np.round(rng.uniform(0, 3, surface.shape)).astype(np.float32)
    onto, seen = rng.uniform(-0.7, 1.4, (3, 4)), rng.uniform(0, 9, (7, 9)).astype(np.float32)
    bias, first = rng.uniform(0, 1, 4), int(rng.integers(-2, 3))
    lit = np.empty(surface.shape, bool)
    light(depth, surface, first, onto, seen, bias, lit)
    assert np.array_equal(lit, naive.lit_by_the_sun(depth, surface, first, onto, seen, bias))
    plane = rng.integers(0, 3, 4).astype(np.int32)
    edge = np.empty(surface.shape, np.float32)
    outlined(depth, surface, plane, 1.5, 0.6, edge)
    assert np.array_equal(edge, naive.dark_edges(depth, surface, plane, 1.5, 0.6))
    colours = rng.uniform(0, 300, (2, 5, 3))
    picture, covered = np.empty((3, 4, 3), np.uint8), np.empty((3, 4), bool)
    painted(surface, lit, edge, colours, picture, covered)
    mixed, some = naive.paint_mixed(surface, lit, edge, colours, 2)
    assert np.abs(picture - mixed).max() <= 0.5 + 1e-6
    assert np.array_equal(covered, some)


def test_a_picture_is_as_wide_as_asked_and_always_the_same():
    scene = evocity.scene(draw_town(4, side=64))
    picture = scene.picture(width=320, legend=False)
    assert picture.width == 320
    assert picture.mode == "RGB"
    assert picture.tobytes() == scene.picture(width=320, legend=False).tobytes()
    around = scene.picture(width=320, legend=False, azimuth=25 + 360)
    assert picture.tobytes() == around.tobytes()
    assert scene.picture(width=320).width > 320


def test_a_shadow_lies_away_from_the_sun():
    scene = tower()
    lit = bare(scene, tilt=90, azimuth=0, shadows=False)
    for azimuth, axis, after in ((270, 1, True), (90, 1, False), (0, 0, True), (180, 0, False)):
        cast = bare(scene, tilt=90, azimuth=0, sun=(azimuth, 45)).sum(axis=2) < lit.sum(axis=2) - 9
        places = np.nonzero(cast)[axis]
        middle = lit.shape[axis] / 2
        assert len(places) > 100
        assert ((places > middle) if after else (places < middle)).mean() > 0.99


def test_a_shadow_is_as_long_as_the_sun_is_low():
    lit = bare(tower(), tilt=90, azimuth=0, shadows=False).sum(axis=2)
    cast = bare(tower(), tilt=90, azimuth=0, sun=(270, 45)).sum(axis=2) < lit - 9
    metres = np.ptp(np.nonzero(cast)[1]) * 80 / (200 * 0.94)
    assert metres == pytest.approx(30, abs=2)  # at 45° as long as what casts it is high


def test_what_stands_in_front_hides_what_is_behind():
    front = np.zeros((40, 40))
    front[24:28, 10:30] = 60
    both = front.copy()
    both[18:22, 18:22] = 9
    how = {"azimuth": 0, "shadows": False, "highest": 60.0}
    assert np.array_equal(bare(scene_of(front), **how), bare(scene_of(both), **how))
    how["azimuth"] = 180  # from the other side it is seen
    assert not np.array_equal(bare(scene_of(front), **how), bare(scene_of(both), **how))


@settings(max_examples=25, deadline=None)
@given(st.floats(0, 360), st.floats(1, 90), st.floats(0, 360), st.floats(5, 90))
def test_what_nothing_stands_before_has_no_shadow(sun, high, azimuth, tilt):
    box = scene_of(np.full((24, 32), 12.0))
    how = {"sun": (sun, high), "azimuth": azimuth, "tilt": tilt}
    changed = (bare(box, **how) != bare(box, shadows=False, **how)).any(axis=2)
    assert np.count_nonzero(changed) <= 3  # a hair of ground may show at the box's foot


def test_a_roof_in_the_sun_has_the_colour_of_the_scale():
    for sun in ((250, 40), (10, 5), (90, 90)):
        plan = bare(tower(), tilt=90, azimuth=0, sun=sun, highest=40)
        middle = plan[plan.shape[0] // 2, plan.shape[1] // 2]
        assert np.abs(middle - ramp(np.array([[30.0]]), 40)[0, 0]).max() <= 1


def test_bands_make_the_whole(monkeypatch):
    scene = evocity.scene(draw_town(4, side=64))
    whole = bare(scene)
    for pixels in (1, 200 * 4 * 7):  # a row at a time, and seven
        monkeypatch.setattr(room, "_AT_ONCE", pixels)
        assert np.array_equal(bare(scene), whole)


@pytest.mark.parametrize("azimuth", [0, 25, 90, 200, 315])
@pytest.mark.parametrize("tilt", [5, 40, 90])
def test_north_and_sun_stand_beside_what_is_drawn(azimuth, tilt):
    scene = evocity.scene(draw_town(4, side=64))
    shown = bare(scene, azimuth=azimuth, tilt=tilt)
    sheet = np.asarray(scene.picture(width=200, azimuth=azimuth, tilt=tilt)).astype(int)
    left = 22  # the margin of a sheet whose letters are 11 px high
    drawn = (shown != PAPER).any(axis=2)
    found = [
        top
        for top in range(sheet.shape[0] - len(shown))
        if np.array_equal(sheet[top : top + len(shown), left : left + 200][drawn], shown[drawn])
    ]
    assert len(found) == 1


def test_north_is_where_the_arrow_points():
    for azimuth, way in ((0, (0, -1)), (90, (-1, 0)), (180, (0, 1)), (270, (1, 0))):
        empty = Image.new("RGB", (300, 200), PAPER)
        covered, towards = np.zeros((200, 300), bool), room._directions(azimuth, 90)
        arrow, _ = room._add_north(empty, covered, towards)
        rows, columns = np.nonzero((np.asarray(arrow) != PAPER).any(axis=2))
        middle = np.array([np.ptp(columns) / 2 + columns.min(), np.ptp(rows) / 2 + rows.min()])
        # there are fewer dark pixels at the tip and the letter than at the foot
        heavy = np.array([columns.mean(), rows.mean()])
        assert (middle - heavy) @ way > 1


@pytest.mark.parametrize(
    "heights",
    [np.zeros((16, 24)), np.full((16, 24), 9.0), np.full((1, 1), 3.0), np.full((4, 4), 1500.0)],
    ids=["empty", "full", "one pixel", "over 1 km"],
)
def test_any_map_has_a_picture(heights):
    for colours in ("heights", "classes"):
        picture = scene_of(heights, name="any", attribution="drawn").picture(
            width=120, colours=colours
        )
        assert min(picture.size) > 100
        assert len(picture.getcolors(1 << 20)) > 2


def test_a_part_of_a_map_is_drawn_alone():
    city = draw_town(3, side=64)
    rows, columns = np.indices(city.shape)
    part = city.within((rows - 30) ** 2 + (columns - 28) ** 2 < 20**2)
    assert evocity.scene(part).picture(width=200).width > 200


def test_streets_are_surfaces_that_overlap_nothing():
    for name in ("new-york-west-village", "lyon-1er"):
        scene = evocity.scene(evocity.read_map(name), streets=True)
        ground, street = scene.groups[:2]
        assert (ground.name, street.name) == ("ground", "street")
        assert len(street) == len(street.attributes["kind"]) > 5
        assert {"pavement", "square", "court"} <= {group.name for group in scene.groups}
        # trees and posts stand on the ground
        groups = [one for one in scene.groups if one.name not in ("tree", "post")]
        polygons = np.concatenate([group.polygons for group in groups])
        assert shapely.area(polygons).sum() == pytest.approx(scene.city.area, rel=1e-9)
        assert shapely.coverage_is_valid(polygons)
        points = shapely.get_coordinates(polygons) * 100
        assert points == pytest.approx(np.round(points), abs=1e-6)


def test_low_objects_are_solids_of_their_class():
    heights = np.zeros((64, 64))
    heights[8:20, 8:24] = 9
    heights[30:40, 30:50] = 0.3
    scene = scene_of(heights, 1.0)
    by_name = {group.name: group for group in scene.groups}
    assert len(by_name["building"]) == 1
    pool = by_name["ground-levelled"]
    assert pool.heights == pytest.approx([0.3])
    assert pool.volume == pytest.approx(60, rel=0.01)


def test_pictures_and_geopackages_are_written(tmp_path):
    city = evocity.read_map("montpellier-pas-du-loup")
    scene = evocity.scene(city, streets=True, least_area=60)
    scene.write(tmp_path / "m.png", width=300)
    with Image.open(tmp_path / "m.png") as picture:
        assert picture.info["Copyright"] == city.attribution
    scene.write(tmp_path / "m.gpkg")
    layers = [name for name, _ in pyogrio.list_layers(tmp_path / "m.gpkg")]
    assert layers == [
        "buildings",
        "street_edges",
        "street_nodes",
        "places",
        "ground",
        "layer_styles",
    ]
    assert pyogrio.read_info(tmp_path / "m.gpkg", layer="buildings")["features"] == len(scene.walls)
    evocity.scene(city).write(tmp_path / "m.gpkg")
    assert len(pyogrio.list_layers(tmp_path / "m.gpkg")) == 2
    assert evocity.read_map(tmp_path / "m.gpkg").origin == pytest.approx(city.origin)


@pytest.mark.parametrize(
    ("how", "says"),
    [
        ({"width": 2}, "width = 2"),
        ({"width": float("nan")}, "width = nan"),
        ({"tilt": 0}, "tilt = 0"),
        ({"azimuth": float("inf")}, "azimuth = inf"),
        ({"sun": (90, 0)}, "sun = 0"),
        ({"colours": "red"}, "colours = 'red'"),
    ],
)
def test_bad_pictures_are_refused(how, says):
    with pytest.raises(MapError, match=says):
        tower().picture(**how)


def test_triangles_are_the_solids_from_outside_with_the_colours_of_the_picture():
    city = draw_town(7, side=64)
    scene = evocity.scene(city)
    corners, colours = scene.triangles(highest=25)
    assert (corners.dtype, colours.dtype, len(corners)) == (np.float32, np.uint8, len(colours))
    a, b, c = corners.astype(float).transpose(1, 0, 2)
    volume = (a * np.cross(b, c)).sum() / 6  # of what is closed, whatever the order of corners
    ground = next(group for group in scene.groups if not group.heights.any())
    low, high = ground.mesh.points.min(axis=0), ground.mesh.points.max(axis=0)
    assert (corners >= low - 1e-3).all()
    assert (corners[..., :2] <= high[:2] + 1e-3).all()
    wanted = sum((shapely.area(group.polygons) * group.heights).sum() for group in scene.groups)
    assert volume == pytest.approx(wanted, rel=1e-4)
    roofs = (np.ptp(corners[..., 2], axis=1) == 0) & (corners[:, 0, 2] > 2)
    assert np.abs(colours[roofs] - ramp(corners[roofs, 0, 2][None], 25)[0].astype(int)).max() <= 1
    kinds = np.unique(scene.triangles("classes")[1], axis=0)
    assert len(kinds) <= 2 * len(scene.groups)
    with pytest.raises(MapError, match="colours = 'red'"):
        scene.triangles("red")
    with pytest.raises(MapError, match="highest = 0"):
        scene.triangles(highest=0)
