"""Roofs: spread, variety and flatness of heights, against loops and SciPy."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays
from scipy import stats
from towns import draw_town

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.fitness import (
    fsi,
    gsi,
    height_deviation,
    height_entropy,
    mean_height,
    osr,
    roof_flatness,
    storeys,
)
from evocity.fitness.density import FLOOR
from evocity.fitness.roofs import CLASSES, LEVEL

# Few heights, so that equal neighbours, bounds of classes and steps of 0.5 m are common.
maps = arrays(
    np.float32,
    array_shapes(min_dims=2, max_dims=2, max_side=7),
    elements=st.one_of(
        st.sampled_from([0, 1.5, 1.75, 4.5, 5.0, 5.25, 61.0, 61.5, 64.5, 3e38]),
        st.floats(0, 300, width=32),
    ),
)


def naive_flatness(city):
    level = count = 0
    rows, columns = city.shape
    for y, x in np.ndindex(rows, columns):
        if not city.built[y, x]:
            continue
        count += 1
        beside = [(y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
        steps = [
            abs(float(city.heights[y, x]) - float(city.heights[v, u]))
            for v, u in beside
            if 0 <= v < rows and 0 <= u < columns and city.built[v, u]
        ]
        level += all(step <= LEVEL for step in steps)
    return level / count


@given(maps)
def test_roofs_are_those_of_looking_at_each_pixel(heights):
    city = CityMap(heights, 2.0)
    standing = heights[heights > BUILT_ABOVE].astype(float)
    if not standing.size:
        for measure in (height_deviation, height_entropy, roof_flatness, osr, storeys):
            assert measure(city).reason == "nothing is built"
        return
    assert roof_flatness(city) == pytest.approx(naive_flatness(city), abs=1e-12)
    assert height_deviation(city) == pytest.approx(math.sqrt(np.var(standing)), rel=1e-6, abs=1e-9)
    classes = [min(int((h - BUILT_ABOVE) // FLOOR), CLASSES - 1) for h in standing]
    _, counts = np.unique(classes, return_counts=True)
    expected = stats.entropy(counts, base=CLASSES)
    assert height_entropy(city) == pytest.approx(expected, abs=1e-9)


@given(maps)
def test_spacematrix_is_one_identity(heights):
    city = CityMap(np.minimum(heights, 300), 2.0)
    if city.built.any():
        assert storeys(city) * gsi(city) == pytest.approx(fsi(city), rel=1e-12)
        assert osr(city) * fsi(city) == pytest.approx(1 - gsi(city), abs=1e-12)
        floors = [math.floor(float(h) / 3 + 0.5) for h in heights[city.built].clip(max=300)]
        assert storeys(city) == pytest.approx(np.mean(floors), rel=1e-12)


def test_what_counts_is_what_is_built(town):
    framed = town.replace(np.pad(town.heights, 20))
    for measure in (height_deviation, height_entropy, roof_flatness, storeys):
        assert measure(framed) == pytest.approx(measure(town), rel=1e-12)
    assert osr(framed) > osr(town)


def test_a_town_of_one_height_is_flat_and_without_variety(town):
    level = town.replace(np.where(town.built, 12, 0))
    assert (height_deviation(level), height_entropy(level), roof_flatness(level)) == (0, 0, 1)
    assert (mean_height(level), storeys(level)) == (12, 4)


def test_as_much_of_each_class_is_all_variety_there_is():
    middles = BUILT_ABOVE + FLOOR * (np.arange(CLASSES) + 0.5)
    city = CityMap(np.tile(middles, (3, 1)), 2.0)
    assert height_entropy(city) == pytest.approx(1)
    # what stands above the last class is of it
    higher = city.replace(np.where(city.heights == middles.max(), 500, city.heights))
    assert height_entropy(higher) == height_entropy(city)


def test_a_slope_is_less_flat_the_steeper_it_is():
    _, x = np.mgrid[:32, :32]
    assert roof_flatness(CityMap(9 + 0.49 * x, 2.0)) == 1
    assert roof_flatness(CityMap(9 + 0.51 * x, 2.0)) == 0
    blurred = CityMap(np.clip(1.0 * x, 0, 9), 2.0)  # a wall drawn out over 9 pixels
    assert 0.5 < roof_flatness(blurred) < 0.8


def test_the_spread_is_in_metres_and_variety_is_not():
    city = draw_town(7, side=128, buildings=150)
    taller = city.replace(2 * city.heights)
    assert height_deviation(taller) == pytest.approx(2 * height_deviation(city), rel=1e-6)
    assert 0 < height_entropy(city) < 1
    assert height_entropy(city.replace(city.heights + 3 * city.built)) == pytest.approx(
        height_entropy(city)
    )
