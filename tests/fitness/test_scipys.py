"""What measures reckon without SciPy is the same to the bit."""

import math

import numpy as np
import pytest
from scipy import optimize, spatial

from evocity.fitness import neighbours, sizes
from evocity.fitness.sizes import root_between


@pytest.mark.parametrize(
    ("function", "low", "high"),
    [
        (lambda x: x**3 - 2, 0, 3),
        (lambda x: math.cos(x) - x, 0, 2),
        (lambda x: math.exp(x) - 5, -10, 10),
        (lambda x: x - 1, 1, 4),
        (lambda x: x - 1, 0, 1),
    ],
)
def test_roots_are_those_of_brentq(function, low, high):
    expected = optimize.brentq(function, low, high, xtol=1e-10)
    assert root_between(function, low, high, 1e-10) == expected


def test_slopes_of_sizes_are_those_of_brentq():
    ends = -sizes._STEEPEST, sizes._STEEPEST
    for mean in np.linspace(0.02, 0.98, 241):
        expected = optimize.brentq(lambda y, mean=mean: sizes._mean(y) - mean, *ends, xtol=1e-10)
        assert sizes._slope(mean) == expected


@pytest.mark.parametrize("count", [2, 12, 13, 14, 300])
@pytest.mark.parametrize("grain", [0, 8])  # points of a grid are often equally far
def test_nearest_buildings_are_those_of_a_tree(count, grain):
    points = np.random.default_rng(count).random((count, 2)) * 100
    points = np.round(points / grain) * grain if grain else points
    many = min(count, 13)
    found = neighbours.nearest_points(*points.T, many)
    for one, other in zip(found, spatial.KDTree(points).query(points, k=many), strict=True):
        np.testing.assert_array_equal(one, other)
