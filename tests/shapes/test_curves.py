"""Curves against closed forms, scipy's splines and subdivision done directly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import BSpline
from scipy.special import comb

from evocity.shapes import Curve, ShapeError, known

AT = np.linspace(0, 1, 2**6 + 1)


def some_points(count, seed, size=2):
    return np.random.default_rng(seed).normal(0, 10, (count, size))


@settings(deadline=None)
@given(st.integers(1, 5), st.integers(0, 1000), st.sampled_from([2, 3]))
def test_bezier_curves_are_those_of_bernstein(degree, seed, size):
    points = some_points(degree + 1, seed, size)
    weights = [comb(degree, k) * AT**k * (1 - AT) ** (degree - k) for k in range(degree + 1)]
    curve = Curve.bezier(points)
    np.testing.assert_allclose(curve.line(6), np.array(weights).T @ points, atol=1e-9)
    assert curve.gap < 1e-9


@settings(deadline=None)
@given(st.integers(1, 5), st.integers(0, 1000))
def test_uniform_splines_are_those_of_scipy(degree, seed):
    points = some_points(degree + 1, seed)
    spline = BSpline(np.arange(-degree, degree + 2, dtype=float), points, degree)
    curve = Curve.b_spline(points)
    np.testing.assert_allclose(curve.line(6)[:-1], spline(AT[:-1]), atol=1e-9)
    assert curve.gap < 1e-9


@given(st.integers(0, 1000))
def test_the_four_point_scheme_is_subdivision(seed):
    points = some_points(6, seed)
    finer = points
    for _ in range(6):
        between = (-finer[:-3] + 9 * finer[1:-2] + 9 * finer[2:-1] - finer[3:]) / 16
        inner = finer[1:-1]
        finer = np.empty((2 * len(inner) - 1, 2))
        finer[::2], finer[1::2] = inner, between
    # of 6 points the middle two are 2 and 3; of finer ones those between them
    line = Curve.four_point(points).line(6)
    start = int(np.abs(finer - points[2]).sum(axis=1).argmin())
    np.testing.assert_allclose(line, finer[start : start + 65], atol=1e-9)


def test_koch_is_a_curve_of_two_complex_points():
    """T = [[1 - a, 1 - b], [a, b]] of each arc from a to b, here with real points of four."""
    koch = known("koch")
    ends = np.array([[0.0, 0.0], [1.0, 0.0]])
    line = koch.pieces(4).maps @ np.array([*ends[0], 1.0])
    # an affine map of the plane is one of barycentric coordinates of a triangle
    corners = np.array([[0, 0], [1, 0], [0, 1]], float)
    whole = np.vstack([corners.T, np.ones(3)])
    maps = [np.linalg.solve(whole, np.vstack([one, [0, 0, 1]]) @ whole) for one in koch.maps]
    curve = Curve(corners, np.array(maps))
    np.testing.assert_allclose(curve.line(4)[:-1], line, atol=1e-12)
    np.testing.assert_allclose(curve.line(4)[-1], [1, 0], atol=1e-12)
    assert curve.gap < 1e-12


@given(st.integers(0, 1000), st.integers(0, 4))
def test_polygons_are_products_of_maps(seed, depth):
    curve = Curve.b_spline(some_points(4, seed))
    polygons = curve.polygons(depth)
    assert polygons.shape == (2**depth, 4, 2)
    for number in {0, len(polygons) // 3, len(polygons) - 1}:
        told = curve.points.T
        for letter in np.binary_repr(number, depth)[:depth] if depth else "":
            told = told @ curve.maps[int(letter)]
        np.testing.assert_allclose(polygons[number], told.T, atol=1e-9)


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: Curve([(0, 0)], np.ones((2, 1, 1))), "control points have the shape"),
        (
            lambda: Curve([(0, 0), (1, 0)], np.ones((2, 3, 3))),
            "the maps for 2 control points have the shape",
        ),
        (lambda: Curve([(0, 0), (1, 0)], np.ones((2, 2, 2))), "differs from 1 by 1"),
        (lambda: Curve([(0, 0), (np.nan, 0)], np.ones((2, 2, 2)) / 2), "not finite"),
        (lambda: Curve([(0, 0), (1, 0)], [[[3, 0], [-2, 1]], [[1, 0], [0, 1]]]), "radius is 3"),
        (lambda: Curve.four_point([(0, 0)] * 5), "5 points"),
        (lambda: Curve.bezier([(0, 0), (1, 0)]).line(30), "depth = 30"),
        (lambda: Curve.bezier([(0, 0), (1, 0)]).line(-1), "depth = -1"),
    ],
)
def test_what_is_no_curve_is_told(fault, says):
    with pytest.raises(ShapeError, match=says):
        fault()
