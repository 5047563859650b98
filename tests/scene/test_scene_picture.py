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
from evocity.scene._kernels import fill


def scene_of(heights, pixel: float = 2.0, **described):
    return evocity.scene(CityMap(np.asarray(heights, float), pixel, **described))


def tower(high: float = 30.0):
    heights = np.zeros((40, 40))
    heights[18:22, 18:22] = high
    return scene_of(heights)


def bare(scene, **how) -> np.ndarray:
    return np.asarray(scene.picture(width=200, legend=False, **how)).astype(int)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_fill_is_its_slow_twin(seed, count):
    rng = np.random.default_rng(seed)
    corners = rng.uniform(-4, 16, (count, 3, 3))
    depth, surface = np.full((11, 13), -np.inf, np.float32), np.full((11, 13), -1, np.int32)
    fill(corners, depth, surface)
    slow, deep = naive.filled(corners, 11, 13)
    # a centre within rounding of a side may be told otherwise
    assert np.count_nonzero(surface != slow) <= 1
    same = (surface == slow) & (slow >= 0)
    assert np.allclose(depth[same], deep[same], atol=1e-3)


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
        whole = shapely.area(ground.polygons).sum() + shapely.area(street.polygons).sum()
        assert whole == pytest.approx(scene.city.area, rel=1e-4)
        assert shapely.is_valid(ground.polygons).all()
        assert shapely.is_valid(street.polygons).all()


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
    assert layers == ["buildings", "street_edges", "street_nodes", "places"]
    assert pyogrio.read_info(tmp_path / "m.gpkg", layer="buildings")["features"] == len(scene.walls)
    evocity.scene(city).write(tmp_path / "m.gpkg")
    assert len(pyogrio.list_layers(tmp_path / "m.gpkg")) == 1
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
