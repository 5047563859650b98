"""Laws of plans: faces partition the ground, cut no building, and turn with their map."""

import json
import math

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.operators.plans import PLAN_VERSION, plan_of
from evocity.operators.plans.plan import LEAST_WIDTH, build_plan
from evocity.pictures import Faces, render_faces


@pytest.fixture(scope="module", params=["lyon-1er", "new-york-west-village"])
def city(request) -> CityMap:
    return evocity.read_map(request.param)


def assert_partition(city, plan):
    assert set(np.unique(plan.labels)) - {0} == set(range(1, len(plan) + 1))
    axes = plan.labels == 0
    if city.site is not None:
        axes &= city.site
    assert not (axes & ~city.street_graph_of(least_width=LEAST_WIDTH).lines).any()
    assert plan.area.sum() + axes.sum() * city.metres_per_pixel**2 == city.area
    assert (plan.lots[city.built] == plan.labels[city.built]).all()
    assert (plan.labels[plan.lots > 0] == plan.lots[plan.lots > 0]).all()
    for component in range(1, city.labels.max(initial=0) + 1):
        assert len(set(plan.labels[city.labels == component])) == 1


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10**6), buildings=st.integers(0, 60))
def test_faces_partition_the_ground_and_cut_no_building(seed, buildings):
    town = draw_town(seed, side=96, buildings=buildings)
    assert_partition(town, plan_of(town))


def test_real_cities_have_a_plan(city):
    plan = plan_of(city)
    assert_partition(city, plan)
    assert plan.version == PLAN_VERSION
    assert 20 < len(plan) < 80
    assert plan.open.any()
    assert (plan.coverage >= 0).all()
    assert (plan.coverage <= 1).all()
    assert np.median(plan.front[~plan.open]) > 0.6
    assert (np.diff(plan.area) <= 0).all()
    for face in range(1, len(plan) + 1):
        assert (plan.labels[plan.window(face)] == face).sum() == (plan.labels == face).sum()


def test_a_plan_is_a_pure_function_of_its_map(city):
    again = plan_of(city.replace(city.heights.copy()))
    plan = plan_of(city)
    assert plan is plan_of(city)
    assert plan is not again
    for name in ("labels", "lots", "area", "angle", "front", "centre", "neighbours"):
        assert np.array_equal(getattr(plan, name), getattr(again, name))
    assert plan.summary() == again.summary()


def test_the_summary_is_json(city):
    plan = plan_of(city)
    known = json.loads(json.dumps(plan.summary()))
    assert known["version"] == PLAN_VERSION
    assert len(known["faces"]) == len(plan)
    for row in known["faces"]:
        for other in row["neighbours"]:
            assert row["face"] in known["faces"][other - 1]["neighbours"]


def test_outlines_cover_the_faces(city):
    plan = plan_of(city)
    assert shapely.area(np.array(plan.outline)) == pytest.approx(plan.area)


@pytest.mark.parametrize("iso", range(8))
def test_faces_keep_their_numbers_when_map_and_streets_turn(city, iso):
    turned = city.replace(np.ascontiguousarray(turn(city.heights, iso)))
    axes = city.street_graph_of(least_width=LEAST_WIDTH).lines
    first, second = plan_of(city), build_plan(turned, turn(axes, iso))
    assert np.array_equal(turn(first.labels, iso), second.labels)
    assert np.array_equal(turn(first.lots, iso), second.lots)
    assert np.array_equal(first.neighbours, second.neighbours)
    for name in ("area", "lot_area", "coverage", "front", "open", "at_frame"):
        assert np.array_equal(getattr(first, name), getattr(second, name)), name
    # mirrors change the sense of angles, turns by quarters keep the frame
    mirrored = iso >= 4
    angles = np.mod(-first.angle if mirrored else first.angle, math.pi / 2)
    off = np.mod(second.angle - angles + math.pi / 4, math.pi / 2) - math.pi / 4
    assert np.abs(off[first.order > 0.1]).max() < 0.01


def turn(array: np.ndarray, iso: int) -> np.ndarray:
    """Turn an array by quarters, after a mirror for the last four."""
    return np.rot90(array.T if iso >= 4 else array, iso % 4)


@pytest.mark.parametrize("degrees", [0, 10, 37, 80])
def test_frames_follow_the_walls(degrees):
    y, x = np.mgrid[:160, :160] - 80
    angle = math.radians(degrees)
    along = x * math.cos(angle) + y * math.sin(angle)
    down = y * math.cos(angle) - x * math.sin(angle)
    built = (abs(along) < 40) & (abs(down) < 25)
    plan = plan_of(CityMap(np.where(built, 12.0, 0), 2.0))
    face = plan.lots[80, 80] - 1
    off = (plan.angle[face] - angle + math.pi / 4) % (math.pi / 2) - math.pi / 4
    assert abs(math.degrees(off)) < 1.5
    assert plan.order[face] > 0.8
    assert plan.coverage[face] == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("heights", [np.zeros((64, 64)), np.full((64, 64), 9.0)])
def test_a_map_without_streets_has_few_faces(heights):
    plan = plan_of(CityMap(heights, 2.0))
    assert len(plan) >= 1
    assert plan.open.all() == (not heights.any())
    assert plan.summary()["faces"][0]["face"] == 1


def test_a_site_bounds_its_faces():
    town = draw_town(3, side=96)
    y, x = np.mgrid[:96, :96]
    part = town.within((y - 48) ** 2 + (x - 48) ** 2 < 45**2)
    plan = plan_of(part)
    assert not plan.labels[~part.site].any()
    assert_partition(part, plan)


def test_the_picture_shows_axes_and_tints(city):
    plan = plan_of(city)
    faces = Faces(city, plan.labels, plan.lots, plan.centre, plan.angle)
    bare = render_faces(faces, legend=False, zoom=1)
    assert bare.size == city.shape[::-1]
    assert len(np.unique(np.asarray(bare)[plan.labels == 0], axis=0)) <= 2
    assert render_faces(faces).width > 4 * city.shape[1]


def test_isometries_here_are_those_of_the_square():
    square = np.arange(9).reshape(3, 3)
    ours = {turn(square, iso).tobytes() for iso in range(8)}
    assert ours == {
        np.ascontiguousarray(isometries.apply(iso, square)).tobytes() for iso in range(8)
    }
