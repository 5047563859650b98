"""Fronts along streets: laws, naive twins, drawn streets; and steps of height to neighbours."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import spatial
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.fitness import _kernels, frontage, height_context
from evocity.fitness.fronts import facades

seeds = st.integers(0, 2**32)


def street(setbacks=(), side=128, width=7, pixel=2.0):
    """Houses on both sides of a street; on one side (first, last, pixels) stand back."""
    heights = np.full((side, side), 9.0)
    heights[60 - width // 2 : 60 + width // 2 + width % 2] = 0
    for first, last, pixels in setbacks:
        heights[60 - width // 2 - pixels : 60 - width // 2, first:last] = 0
    return CityMap(heights, pixel)


# -- twins ---------------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_first_walls_as_their_naive_twin(seed):
    rng = np.random.default_rng(seed)
    height, width, many = *rng.integers(1, 24, 2), 20
    built = rng.random((height, width)) < 0.1
    ground = ~built & (rng.random((height, width)) < 0.95)
    start = rng.uniform(0, [[height], [width]], (2, many))
    turn = rng.uniform(0, 7, many)
    ray, reach = np.stack([np.cos(turn), np.sin(turn)]), rng.uniform(0, 20, many)
    distance = np.empty(many)
    _kernels.first_walls(built, ground, start, ray, reach, distance)
    assert distance.tolist() == naive.first_walls(built, ground, start, ray, reach)


@given(st.lists(st.lists(st.integers(0, 12), min_size=1, max_size=9), min_size=1, max_size=6))
def test_fullest_strips_as_their_naive_twin(groups):
    values = np.concatenate([np.sort(np.array(group, float)) for group in groups])
    starts = np.append(0, np.cumsum([len(group) for group in groups]))
    most = np.empty(len(groups), np.int64)
    _kernels.fullest_strips(values, starts, 3.0, most)
    assert most.tolist() == naive.fullest_strips([np.array(g, float) for g in groups], 3.0)


# -- fronts --------------------------------------------------------------------------------


def test_facades_of_a_street_lie_on_its_walls():
    x, y, front = facades(street())
    assert set(front) == {0, 1}
    assert np.diff(np.bincount(front)) == [0]
    wall = np.where(y > 134, 142, 128)  # rows 57 and 64 of 128, of 2 m, from the south
    assert abs(y - wall).max() <= 1
    assert x.min() < 10
    assert x.max() > 246


@pytest.mark.parametrize("pixels", [1, 2, 4])
def test_a_setback_counts_from_4_metres(pixels):
    back = street([(40, 60, pixels)])
    value = frontage(back)
    if pixels == 1:
        assert value > 0.98
    else:
        assert value == pytest.approx(1 - 20 / 256, abs=0.03)


def test_more_and_deeper_setbacks_are_worse():
    values = [
        frontage(street([(k, k + 8, 4) for k in range(4, 120, 24)][:many])) for many in range(4)
    ]
    assert (np.diff(values) < 0.01).all()
    assert values[0] == 1
    assert values[-1] < 0.9


@given(st.integers(0, 89))
@settings(max_examples=15, deadline=None)
def test_a_straight_street_under_any_angle_has_straight_fronts(degrees):
    y, x = np.mgrid[:128, :128] - 63.5
    turn = np.radians(degrees)
    off = abs(x * np.sin(turn) - y * np.cos(turn))
    assert frontage(CityMap(np.where(off < 3.6, 0, 9.0), 2.0)) > 0.93


def test_roofs_do_not_count_and_courts_neither():
    plain = street([(40, 60, 4)])
    rough = plain.replace(plain.heights * np.random.default_rng(1).uniform(0.5, 3, plain.shape))
    assert frontage(rough) == frontage(plain)
    court = plain.heights.copy()
    court[80:90, 40:60] = 0
    assert frontage(plain.replace(court)) == frontage(plain)


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "villeurbanne-gratte-ciel"])
def test_real_fronts_turned_and_scattered(name):
    city = evocity.read_map(name)
    value = frontage(city)
    assert 0.6 < value < 0.9
    for iso in (1, 4, 6):
        turned = city.replace(isometries.apply(iso, city.heights))
        assert frontage(turned) == pytest.approx(value, abs=0.02)


def test_blocks_that_are_moved_apart_lose_their_fronts():
    lyon = evocity.read_map("lyon-1er")
    rng, heights = np.random.default_rng(2), np.zeros(lyon.shape)
    table = lyon.buildings
    for k, (top, left, bottom, right) in enumerate(table.bounds):
        down, along = rng.integers(-3, 4, 2)
        rows, columns = np.nonzero(table.labels[top:bottom, left:right] == k + 1)
        rows, columns = rows + top + down, columns + left + along
        inside = (rows >= 0) & (rows < 256) & (columns >= 0) & (columns < 256)
        heights[rows[inside], columns[inside]] = table.height[k]
    assert frontage(lyon.replace(heights)) < frontage(lyon) - 0.05


def test_no_front_has_no_share():
    for heights in (np.zeros((64, 64)), np.full((64, 64), 9.0), np.zeros((1, 1))):
        assert frontage(CityMap(heights, 2.0)).reason == "no front of 20 m toward a street"


# -- steps of height -----------------------------------------------------------------------


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_steps_to_the_five_nearest_as_by_trying_every_pair(seed):
    table = (city := draw_town(seed % 60)).buildings
    kept = table.area >= 24
    points = np.column_stack([table.y, table.x])[kept].tolist()
    expected = naive.mean_over_nearest(
        points, table.height[kept].tolist(), 5, lambda a, b: abs(a - b)
    )
    assert height_context(city) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "cape-town-salt-river"])
def test_steps_of_real_cities_as_by_a_tree(name):
    table = (city := evocity.read_map(name)).buildings
    kept = table.area >= 24
    points, height = np.column_stack([table.y, table.x])[kept], table.height[kept]
    near = spatial.KDTree(points).query(points, k=6)[1][:, 1:]
    expected = abs(height[near] - height[:, None]).mean()
    assert height_context(city) == pytest.approx(expected, rel=0.02)
    # heights dealt to other buildings make the steps larger
    dealt = np.append(0, np.random.default_rng(3).permutation(table.height))[table.labels]
    assert height_context(city.replace(dealt)) > expected


@given(seeds, st.floats(0.5, 4))
@settings(max_examples=15, deadline=None)
def test_steps_grow_with_heights(seed, factor):
    rng = np.random.default_rng(seed)
    heights = np.zeros((64, 64))
    for y in range(4, 60, 12):
        for x in range(4, 60, 12):
            heights[y : y + 6, x : x + 6] = rng.integers(4, 20)
    city = CityMap(heights, 2.0)
    taller = CityMap(factor * heights, 2.0)
    assert height_context(taller) == pytest.approx(factor * height_context(city), rel=1e-5)
    level = CityMap(np.where(heights > 0, 9.0, 0), 2.0)
    assert height_context(level) == 0


def test_one_building_has_no_step():
    heights = np.zeros((32, 32))
    heights[4:12, 4:12] = 9
    heights[20:22, 20:22] = 9  # 16 m²
    reason = height_context(CityMap(heights, 2.0)).reason
    assert reason == "1 buildings of 24 m² or more; a step needs 2"
