import math

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.fitness import box_dimension, correlation_dimension, lacunarity
from evocity.fitness._kernels import count_around, count_boxes, gliding_moments, sum_corner

MEASURES = (box_dimension, correlation_dimension, lacunarity)


@st.composite
def masks(draw, smallest=1):
    shape = draw(st.integers(smallest, 12)), draw(st.integers(smallest, 12))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return rng.random(shape) < draw(st.sampled_from([0.0, 0.1, 0.5, 0.9, 1.0]))


def summed(mask):
    sums = np.empty((mask.shape[0] + 1, mask.shape[1] + 1), np.int64)
    sum_corner(mask, sums)
    return sums


def carpet(steps):
    """Sierpinski's carpet, 3 ** steps pixels a side."""
    built = np.ones((1, 1))
    for _ in range(steps):
        built = np.kron(built, [[1, 1, 1], [1, 0, 1], [1, 1, 1]])
    return 9 * built


def noise(p, seed, side=256):
    return 9.0 * (np.random.default_rng(seed).random((side, side)) < p)


# -- kernels -----------------------------------------------------------------------------


@settings(deadline=None)
@given(masks())
def test_sums_from_the_corner(mask):
    assert np.array_equal(summed(mask), np.pad(mask, ((1, 0), (1, 0))).cumsum(0).cumsum(1))


@settings(deadline=None)
@given(masks(), st.data())
def test_boxes_that_hold_something(mask, data):
    size = data.draw(st.integers(1, 14))
    top, left = (data.draw(st.integers(1 - size, 0)) for _ in range(2))
    assert count_boxes(summed(mask), size, top, left) == naive.count_boxes(mask, size, top, left)


@settings(deadline=None)
@given(masks(), st.integers(1, 6))
def test_pixels_around_pixels(mask, reach):
    assert count_around(summed(mask), reach) == naive.count_around(mask, reach)


@settings(deadline=None)
@given(masks(), st.data())
def test_moments_of_a_gliding_box(mask, data):
    size = data.draw(st.integers(1, min(mask.shape)))
    assert gliding_moments(summed(mask), size) == naive.gliding_moments(mask, size)


# -- known values ------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [4, 5])
def test_the_carpet_has_its_box_dimension(steps):
    dimension = box_dimension(CityMap(carpet(steps), 2.0))
    assert dimension == pytest.approx(math.log(8) / math.log(3), abs=1e-9)


def test_the_carpet_has_its_box_dimension_on_sides_without_divisors():
    padded = np.pad(carpet(5), ((0, 8), (0, 8)), mode="wrap")  # 251 is a prime
    assert box_dimension(CityMap(padded, 2.0)) == pytest.approx(1.893, abs=0.03)


def test_the_carpet_has_its_correlation_dimension():
    for pixel in (2.0, 3.0):
        dimension = correlation_dimension(CityMap(carpet(5), pixel))
        assert dimension == pytest.approx(1.893, abs=0.01)


@pytest.mark.parametrize("measure", [box_dimension, correlation_dimension])
def test_the_plane_has_two_dimensions_a_line_one_a_point_none(measure):
    heights = np.zeros((128, 128))
    heights[64, 64] = 9
    assert measure(CityMap(heights, 2.0)) == pytest.approx(0, abs=1e-9)
    heights[64] = 9
    assert measure(CityMap(heights, 2.0)) == pytest.approx(1, abs=0.01)
    heights[:] = 9
    assert measure(CityMap(heights, 2.0)) == pytest.approx(2, abs=1e-9)


@pytest.mark.parametrize(("p", "pixel"), [(0.02, 2.0), (0.3, 2.0), (0.1, 8.0), (0.7, 32.0)])
def test_lacunarity_of_noise(p, pixel):
    side = 32 / pixel
    values = [lacunarity(CityMap(noise(p, seed), pixel)) for seed in range(6)]
    expected = 1 + (1 - p) / (p * side**2)
    assert np.mean(values) - 1 == pytest.approx(expected - 1, rel=0.08)


def test_lacunarity_tells_clustered_from_spread_out():
    spread, clustered = noise(0.25, 0), np.zeros((256, 256))
    clustered[:128, :128] = 9
    assert lacunarity(CityMap(clustered, 2.0)) > 2 * lacunarity(CityMap(spread, 2.0))


# -- laws --------------------------------------------------------------------------------


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.name)
@pytest.mark.parametrize("shape", [(128, 128), (121, 97)])
@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_and_mirroring_changes_nothing(measure, shape, iso):
    heights = draw_town(7, side=128, buildings=150).heights[: shape[0], : shape[1]]
    value = measure(CityMap(heights, 2.0))
    assert not math.isnan(value)
    turned = CityMap(isometries.apply(iso, heights), 2.0)
    assert measure(turned) == pytest.approx(value, abs=1e-12)


def test_how_high_it_is_does_not_matter(town):
    taller = town.replace(town.heights * 3)
    for measure in MEASURES:
        assert measure(taller) == measure(town)


def test_windows_in_metres_see_the_same_city_on_finer_pixels():
    city = draw_town(7, side=128, buildings=150)
    finer = city.replace(np.kron(city.heights, np.ones((2, 2))), metres_per_pixel=1.0)
    assert lacunarity(finer) == pytest.approx(lacunarity(city), rel=0.01)
    assert correlation_dimension(finer) == pytest.approx(correlation_dimension(city), abs=0.05)


@settings(max_examples=30, deadline=None)
@given(masks(smallest=8))
def test_values_stay_in_their_range(mask):
    for pixel in (1.0, 2.0, 4.0):
        for measure in MEASURES:
            value = measure(CityMap(9.0 * mask, pixel))
            low, high = measure.range
            assert math.isnan(value) or low <= value <= high


@pytest.mark.parametrize(
    ("measure", "shape", "pixel", "reason"),
    [
        (box_dimension, (7, 7), 2.0, "too small for boxes"),
        (correlation_dimension, (64, 64), 60.0, "fewer than three windows"),
        (correlation_dimension, (8, 8), 2.0, "fewer than three windows"),
        (lacunarity, (64, 64), 70.0, "a box of 32 m does not fit"),
        (lacunarity, (15, 64), 2.0, "a box of 32 m does not fit"),
    ],
)
def test_what_does_not_fit_the_map_is_undefined(measure, shape, pixel, reason):
    assert reason in measure(CityMap(np.full(shape, 9.0), pixel)).reason


def test_nothing_built_has_no_texture():
    for measure in MEASURES:
        assert measure(CityMap(np.zeros((64, 64)), 2.0)).reason == "nothing is built"


def test_lacunarity_of_very_fine_pixels():
    assert lacunarity(CityMap(np.full((3000, 3000), 9.0), 32 / 1500)) == pytest.approx(1)
