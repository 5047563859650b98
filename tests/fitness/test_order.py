"""Alignment and the order of directions: jittered districts, turned grids, slow twins."""

import math
from functools import cache
from types import SimpleNamespace

import naive
import numpy as np
import pytest
from districts import burnt, grid, jittered, lattice
from hypothesis import given
from hypothesis import strategies as st
from scipy import ndimage
from shapely import affinity, box
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.fitness import (
    alignment,
    alignment_global,
    alignment_momepy,
    alignment_neighbours,
    orientation_order,
)
from evocity.fitness._kernels import pool_rows

ANGLES = (0, 5, 10, 20, 45)
series = cache(jittered)
turned_grid = cache(grid)

# -- pixel by pixel ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("degrees", "published"), [(0, 0.688), (5, 0.650), (10, 0.601), (20, 0.505), (45, 0.358)]
)
def test_alignment_falls_as_buildings_are_turned_at_random(degrees, published):
    seeds = range(3) if degrees else [0]
    values = [alignment(series(degrees, seed)) for seed in seeds]
    assert np.mean(values) == pytest.approx(published, abs=0.025)


@pytest.mark.parametrize(("pixel", "seed"), [(1.0, 0), (1.0, 1), (1.0, 2), (2.0, 0)])
def test_alignment_falls_strictly_with_the_angle(pixel, seed):
    values = [alignment(series(degrees, seed, pixel)) for degrees in ANGLES]
    assert np.all(np.diff(values) < 0)


@pytest.mark.slow
def test_alignment_does_not_see_which_way_a_grid_is_turned():
    for side, step in ((20, 30), (25, 40)):  # least at 5°, with long stairs
        values = [alignment(turned_grid(d, side, step)) for d in (0, 2.5, 5, 7.5, 10, 22.5, 30, 45)]
        assert np.ptp(values) < 0.04


@pytest.mark.parametrize("degrees", [0, 22.5])
def test_alignment_of_a_grid_and_of_buildings_turned_at_random(degrees):
    # the size of the grid of the published values, .855 and .244, is not told
    assert alignment(turned_grid(degrees, 25, 40)) == pytest.approx(0.855, abs=0.025)
    rng = np.random.default_rng(int(degrees))
    random = [
        alignment(lattice(lambda b: affinity.rotate(b, rng.uniform(0, 90), origin="centroid")))
        for _ in range(3)
    ]
    assert np.mean(random) == pytest.approx(0.244, abs=0.035)


@pytest.mark.parametrize("pixel", [0.5, 1.0, 2.0, 8.0])
def test_alignment_of_straight_walls_is_one_and_of_a_round_tower_near_none(pixel):
    y, x = np.mgrid[:128, :128] - 63.5
    for measure in (alignment, alignment_global):
        assert measure(CityMap(9 * (x // 16 % 2), pixel)) == pytest.approx(1, abs=1e-3)
        assert measure(CityMap(9 * (x > y), pixel)) > 0.98
    tower = CityMap(9 * (np.hypot(x, y) < 25), pixel)
    assert alignment_global(tower) < 0.05
    if 50 * pixel < 48:  # the tower's whole wall is in one neighbourhood
        assert alignment(tower) < 0.1


def test_alignment_is_not_moved_by_heights_or_by_open_ground_around():
    city = draw_town(7, side=128, buildings=60)
    for measure in (alignment, alignment_global):
        assert measure(city.replace(2 * city.heights)) == pytest.approx(measure(city), abs=1e-5)
    # enough open ground that no neighbourhood ends at the map's edge on either map
    framed = city.replace(np.pad(city.heights, 32))
    wider = city.replace(np.pad(city.heights, 96))
    assert alignment(wider) == pytest.approx(alignment(framed), abs=0.01)
    assert alignment_global(wider) == pytest.approx(alignment_global(framed), abs=1e-6)


@pytest.mark.parametrize("measure", [alignment, alignment_global], ids=lambda m: m.name)
@pytest.mark.parametrize("height", [0.0, 9.0])
def test_alignment_without_facades_is_undefined(measure, height):
    value = measure(CityMap(np.full((32, 32), height), 2.0))
    assert math.isnan(value)
    assert "façades" in value.reason


def test_global_alignment_is_that_of_one_neighbourhood_as_large_as_the_map():
    city = draw_town(7, side=64, buildings=40)
    real, imaginary = city.structure.astype(float)
    w = np.hypot(real, imaginary)
    angle = 2 * np.arctan2(imaginary, real)
    expected = abs((w * np.exp(1j * angle)).sum()) / w.sum()
    assert alignment_global(city) == pytest.approx(expected, rel=1e-5)
    # pixels so small that the window of `alignment` is level all over the map
    tiny = city.replace(city.heights, metres_per_pixel=1e-3)
    assert alignment(tiny) == pytest.approx(alignment_global(city), rel=1e-4)


def test_a_fabric_that_turns_little_by_little_is_aligned_nearby_not_all_in_all():
    y, x = np.mgrid[:512, :512] + 100.0
    rings = np.hypot(x, y) % 40 > 12
    rays = np.degrees(np.arctan2(y, x)) % 8 > 2.4
    bent = CityMap(9 * (rings & rays), 1.0)
    assert alignment(bent) > 0.8
    assert alignment_global(bent) < alignment(bent) - 0.4
    assert alignment_global(turned_grid(22.5)) > alignment(turned_grid(22.5)) - 0.02


@pytest.mark.parametrize("shape", [(1, 1), (5, 9), (64, 17)])
def test_rows_are_pooled_as_their_naive_twin_does(shape):
    rng = np.random.default_rng(3)
    fields = rng.normal(size=(3, *shape)).astype(np.float32)
    window = rng.random((4, shape[0])).astype(np.float32)
    window[rng.random(window.shape) < 0.5] = 0
    pooled = np.zeros((3, 4, shape[1]), np.float32)
    pool_rows(fields, window, pooled)
    np.testing.assert_allclose(pooled, naive.pool_rows(fields, window), atol=1e-4)


# -- building by building ----------------------------------------------------------------


def city_of(directions, points, perimeters=None):
    """A map whose table of buildings is given: directions in degrees, centroids (y, x) in m."""
    y, x = np.reshape(points, (-1, 2)).astype(float).T
    perimeter = np.full(len(directions), 40.0) if perimeters is None else np.array(perimeters)
    table = SimpleNamespace(
        direction=np.asarray(directions, float),
        area=np.full(len(directions), 100.0),
        y=y,
        x=x,
        perimeter=perimeter.astype(float),
    )
    city = CityMap(np.zeros((4, 4)), 1.0)
    city.__dict__["buildings"] = table
    return city


# Whole metres and few of them: centroids at one distance, and at one point, are common.
tables = st.lists(
    st.tuples(st.integers(0, 8), st.integers(0, 8), st.floats(0, 90, exclude_max=True)),
    min_size=2,
    max_size=25,
    unique_by=lambda row: row[:2],
)


@given(tables)
def test_neighbours_are_those_of_trying_every_pair(rows):
    points, directions = [row[:2] for row in rows], [row[2] for row in rows]
    city = city_of(directions, points)

    def folded(theta):
        return abs((theta + 45) % 90 - 45)

    expected = naive.mean_over_nearest(
        points, directions, 6, lambda a, b: min(abs(a - b), 90 - abs(a - b))
    )
    assert alignment_neighbours(city) == pytest.approx(expected, abs=1e-9)
    expected = naive.mean_over_nearest(
        points, directions, 6, lambda a, b: abs(folded(a) - folded(b))
    )
    assert alignment_momepy(city) == pytest.approx(expected, abs=1e-9)


@given(tables, st.floats(-90, 90))
def test_turning_all_buildings_changes_no_difference(rows, degrees):
    points, directions = [row[:2] for row in rows], np.array([row[2] for row in rows])
    turned = city_of((directions + degrees) % 90, points)
    expected = alignment_neighbours(city_of(directions, points))
    assert alignment_neighbours(turned) == pytest.approx(expected, abs=1e-9)


def test_momepys_alignment_is_blind_to_the_sign_and_ours_is_not():
    city = city_of([10, 80] * 8, [(i, j) for i in range(4) for j in range(4)])
    assert alignment_momepy(city) == pytest.approx(0, abs=1e-12)
    assert alignment_neighbours(city) > 8


def test_buildings_on_one_point_or_without_direction_are_borne():
    assert alignment_neighbours(city_of([0, 30] * 20, [(1, 1)] * 40)) >= 0
    assert alignment_neighbours(city_of([0, np.nan, 30], [(0, 0), (0, 1), (0, 5)])) == 30
    lonely = city_of([0, np.nan], [(0, 0), (0, 1)])
    for measure in (alignment_neighbours, alignment_momepy):
        assert measure(lonely).reason.startswith("1 buildings")


@pytest.mark.parametrize(
    ("directions", "perimeters", "entropy"),
    [
        ([0, 0, 3, 87], [9, 1, 1, 1], 0),
        ([0, 30], [1, 1], math.log(2)),
        ([0, 30], [3, 1], math.log(4) - 0.75 * math.log(3)),
        ([5], [1], math.log(2)),  # between two bins
        (range(0, 90, 10), [7] * 9, math.log(9)),
    ],
)
def test_order_is_the_entropy_of_ten_degrees_weighted_by_walls(directions, perimeters, entropy):
    city = city_of(directions, [(0, i) for i in range(len(directions))], perimeters)
    # of 36 bins, each building in 4 alike: ln 4 more, so (H − ln 4)/(ln 36 − ln 4) is this
    expected = 1 - (entropy / math.log(9)) ** 2
    assert orientation_order(city) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("directions", [[], [np.nan]])
def test_order_without_directions_is_undefined(directions):
    value = orientation_order(city_of(directions, [(0, 0)] * len(directions)))
    assert value.reason == "no building with a direction"


@pytest.mark.parametrize("iso", range(1, 8))
def test_directions_are_mirrored_with_the_city(iso):
    """Buildings at 45° and at multiples of 10°, on the borders and middles of bins."""
    rng = np.random.default_rng(1)
    heights = burnt(
        [
            affinity.rotate(box(x, y, x + 22, y + 14), rng.choice([0, 20, 45, 45, 70]))
            for x in range(8, 240, 40)
            for y in range(8, 240, 40)
        ],
        [12.0] * 36,
        1.0,
        (0, 0, 256, 256),
    ).heights
    city, mirrored = CityMap(heights, 1.0), CityMap(isometries.apply(iso, heights), 1.0)
    for measure in (alignment_neighbours, alignment_momepy, orientation_order):
        assert measure(mirrored) == pytest.approx(measure(city), abs=1e-3)


def test_buildings_turned_at_random_are_less_and_less_aligned():
    for measure, sign in (
        (alignment_neighbours, 1),
        (alignment_momepy, 1),
        (orientation_order, -1),
    ):
        values = [measure(series(degrees, 0)) for degrees in ANGLES]
        assert np.all(sign * np.diff(values) > 0), measure.name


@pytest.mark.parametrize("degrees", [0, 10, 22.5, 40])
def test_a_grid_has_one_direction_however_it_is_turned(degrees):
    # what the map's border cuts is no rectangle
    inner = turned_grid(degrees)
    labels, _ = ndimage.label(inner.built)
    rim = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
    city = inner.replace(np.where(np.isin(labels, rim), 0, inner.heights))
    assert orientation_order(city) == pytest.approx(1, abs=0.02)
    assert alignment_neighbours(city) < 1


@pytest.mark.parametrize("measure", [alignment_neighbours, alignment_momepy, orientation_order])
def test_crumbs_do_not_count(measure):
    rng = np.random.default_rng(4)
    city = lattice(lambda b: affinity.rotate(b, rng.uniform(0, 90), origin="centroid"), step=60)
    dusty = city.heights.copy()
    dust = np.zeros(city.shape, bool)
    dust[::4, ::4] = True
    dusty[dust & ndimage.binary_erosion(~city.built, iterations=2)] = 6
    dusty = city.replace(dusty)
    assert len(dusty.buildings) > 10 * len(city.buildings)
    assert measure(dusty) == pytest.approx(measure(city), rel=1e-9)
