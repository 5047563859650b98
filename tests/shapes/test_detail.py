"""Lines as curves with details: exact, least squares at every level, carried over in frames."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from naive import all_that_maps_draw, nearest_of
from scipy.interpolate import make_lsq_spline

from evocity.shapes import Curve, Detailed, ShapeError, fit_curve, known, rms_of
from evocity.shapes.curve_fit import _Model, bezier_maps
from evocity.shapes.detail import point_count
from evocity.shapes.lines import crossing_of, resampled


def rough(count, seed, size=1.0):
    """A random walk: rough at every scale."""
    steps = np.random.default_rng(seed).normal(0, size, (count, 2))
    return np.cumsum(steps + size * np.array([0.5, 0]), axis=0)


def some_maps(parts, size, seed):
    """Maps with shared ends that are no polynomial's."""
    rng = np.random.default_rng(seed)
    maps = bezier_maps(size, parts)
    for part in range(parts):
        maps[part, :, 1:-1] += rng.normal(0, 0.1, (size, size - 2))
        maps[part] += (1 - maps[part].sum(axis=0)) / size
    for part in range(parts - 1):
        joint = maps[part, :, -1] + rng.normal(0, 0.05, size)
        maps[part, :, -1] = maps[part + 1, :, 0] = joint / joint.sum()
    return maps


layouts = st.tuples(
    st.integers(2, 3), st.integers(2, 5), st.integers(1, 3), st.booleans(), st.integers(0, 500)
)


@settings(deadline=None, max_examples=40)
@given(layouts)
def test_synthesis_undoes_analysis_and_each_level_is_the_least_squares_of_its_maps(layout):
    parts, size, depth, shared, seed = layout
    maps = some_maps(parts, size, seed)
    line = rough(point_count(size, parts, depth, shared), seed)
    found = Detailed.of(line, maps, shared=shared)
    np.testing.assert_allclose(found.line(), line, atol=1e-9)
    assert sum(one.size for one in found.details) + size == len(line)  # no number too many
    for levels in range(1, depth + 1):
        told = nearest_of(all_that_maps_draw(maps, depth, levels, shared), line, shared)
        np.testing.assert_allclose(found.dropped(levels).line(), told, atol=1e-6)
        assert found.dropped(levels).kept <= depth - levels


@settings(deadline=None, max_examples=30)
@pytest.mark.filterwarnings("ignore:.*crosses itself")
@given(layouts, st.floats(0.01, 100), st.floats(0, 6.2), st.floats(-1e3, 1e3))
def test_what_is_carried_over_goes_with_every_similarity(layout, scale, turn, way):
    parts, size, depth, shared, seed = layout
    maps = some_maps(parts, size, seed)
    count = point_count(size, parts, depth, shared)
    cosine, sine = scale * np.cos(turn), scale * np.sin(turn)
    turned = np.array([[cosine, sine], [-sine, cosine]])
    smooth, other = rough(count, seed, 0.1), rough(count, seed + 1)
    one, donor = (Detailed.of(line, maps, shared=shared) for line in (smooth, other))
    moved = Detailed.of(smooth @ turned + way, maps, shared=shared)
    elsewhere = Detailed.of(other @ turned.T - way, maps, shared=shared)
    line = one.transferred(donor).line()
    np.testing.assert_allclose(moved.transferred(donor).line(), line @ turned + way, atol=1e-6)
    np.testing.assert_allclose(one.transferred(elsewhere).line(), line, atol=1e-6)
    np.testing.assert_array_equal(one.transferred(one).line(), one.line())


@settings(deadline=None, max_examples=30)
@given(layouts, st.floats(0.1, 3) | st.floats(-3, -0.1), st.integers(0, 2))
@pytest.mark.filterwarnings("ignore:.*crosses itself")
def test_a_gain_scales_the_chosen_levels_alone(layout, gain, chosen):
    parts, size, depth, shared, seed = layout
    maps, chosen = some_maps(parts, size, seed), min(chosen, depth - 1)
    line = rough(point_count(size, parts, depth, shared), seed)
    one = Detailed.of(line, maps, shared=shared)
    again = Detailed.of(one.amplified(gain, [chosen]).line(), maps, shared=shared)
    for level, (before, after) in enumerate(zip(one.details, again.details, strict=True)):
        factor = gain if level == chosen else 1.0
        np.testing.assert_allclose(after, factor * before, atol=1e-6)


def test_a_closed_line_stays_closed_and_has_a_frame():
    at = np.linspace(0, 2 * np.pi, point_count(4, 2, 6, True))
    ring = np.column_stack([np.cos(at), np.sin(at)]) * (1 + 0.2 * np.sin(9 * at))[:, None]
    ring[-1] = ring[0]
    one = Detailed.of(ring, bezier_maps(4, 2))
    for levels in range(7):
        line = one.dropped(levels).line()
        np.testing.assert_allclose(line[[0, -1]], ring[[0, 0]], atol=1e-12)
    assert all(np.abs(level).max() < 100 for level in one.details)


def test_a_crossing_is_told_and_where():
    at = np.linspace(0, 20, point_count(4, 2, 5, True))
    one = Detailed.of(np.column_stack([at, np.sin(at)]), bezier_maps(4, 2))
    other = Detailed.of(rough(len(at), 2), bezier_maps(4, 2))
    with pytest.warns(UserWarning, match=r"crosses itself at \("):
        one.transferred(other, gain=5.0)
    loop = [(0, 0), (2, 0), (2, 2), (1, 2), (1, -1)]
    np.testing.assert_allclose(crossing_of(loop), [1, 0])
    assert crossing_of([(0, 0), (2, 0), (2, 2), (0, 0)]) is None
    np.testing.assert_allclose(crossing_of([(0, 0), (2, 0), (1, 0)]), [2, 0])


# -- fitted ------------------------------------------------------------------------------------


def test_koch_is_found_from_its_points():
    koch = known("koch").pieces(4).maps[:, :, 2]
    line = np.vstack([koch, [1, 0]])
    found = fit_curve(line, points=3, maps=2, drawn=None)
    assert found.curve.contraction.proved
    pure = found.dropped(found.depth)
    assert np.abs(pure.line() - line).max() < 1e-6
    # what draws it: control points, and of the maps what is free
    assert found.curve.points.size + _Model(line, 3, 2, 7, 7).unknown <= 13
    finer = np.vstack([known("koch").pieces(6).maps[:, :, 2], [1, 0]])
    np.testing.assert_allclose(found.curve.line(12), finer, atol=1e-6)


@pytest.mark.parametrize(("size", "parts", "drawn"), [(3, 2, 2), (4, 2, 3), (3, 3, 1), (2, 2, 3)])
def test_the_jacobian_is_that_of_differences_where_it_says_so(size, parts, drawn):
    """Of the residuals Kaufman's leaves out a term that the gradient does not feel; what unstable
    maps cost has none."""
    line = rough(point_count(size, parts, 4, True), 3)
    model = _Model((line - line[0]) / 30, size, parts, 4, drawn)
    for stretch in (1.0, 2.0):
        at = model.start(np.random.default_rng(1)) * stretch
        jacobian, left = model.jacobian(at), model.residuals(at)
        steps = 1e-6 * np.eye(len(at))
        told = np.array(
            [(model.residuals(at + s) - model.residuals(at - s)) / 2e-6 for s in steps]
        ).T
        scale = max(1.0, np.abs(told.T @ left).max())
        np.testing.assert_allclose(jacobian.T @ left / scale, told.T @ left / scale, atol=1e-6)
        pens = slice(model.rest, None)
        high = max(1.0, np.abs(told[pens]).max())
        np.testing.assert_allclose(jacobian[pens] / high, told[pens] / high, atol=1e-6)
    assert (left[model.rest :] > 0).any()  # maps twice as large do cost


def test_a_fitted_line_is_near_a_spline_of_as_many_numbers_and_its_maps_contract():
    line = rough(point_count(4, 2, 7, True), 5)
    found = fit_curve(line, starts=3)
    assert not found.curve.contraction.refuted
    np.testing.assert_allclose(found.line(), line, atol=1e-9)
    kept = point_count(4, 2, found.depth - 3, True)
    at = np.linspace(0, 1, len(line))
    knots = np.r_[[0.0] * 3, np.linspace(0, 1, kept - 2), [1.0] * 3]
    spline = make_lsq_spline(at, line, knots, 3)(at)
    assert rms_of(found, 3) < 1.1 * np.sqrt(((spline - line) ** 2).sum(axis=1).mean())
    assert rms_of(found, 3) <= rms_of(Detailed.of(line, bezier_maps(4, 2)), 3)
    same = fit_curve(line, starts=3)
    np.testing.assert_array_equal(same.curve.maps, found.curve.maps)


# -- what is none ------------------------------------------------------------------------------

ONE = Detailed.of(rough(25, 1), bezier_maps(4, 2))


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: Detailed.of([(0, 0)], bezier_maps(4, 2)), "the line has 1 point"),
        (lambda: Detailed.of([(0, 0), (0, 0), (1, 1)], bezier_maps(4, 2), 2), "points 0 and 1"),
        (lambda: Detailed.of([(0, 0), (np.inf, 0)], bezier_maps(4, 2), 2), "entry 1 of the points"),
        (lambda: Detailed.of([(0, 0, 0), (1, 1, 1)], bezier_maps(4, 2), 2), "shape"),
        (lambda: Detailed.of(rough(26, 1), bezier_maps(4, 2)), "a line of 26 points"),
        (lambda: Detailed.of(rough(26, 1), bezier_maps(4, 2), 40), "depth = 40"),
        (lambda: Detailed.of(rough(26, 1), np.ones((2, 4, 4)), 2), "differs from 1 by 3"),
        (
            lambda: Detailed.of(rough(9, 1), Curve.b_spline(rough(4, 0)).maps, 2, shared=True),
            "neighbouring parts of the curve do not meet",
        ),
        (lambda: ONE.dropped(4), "levels = 4"),
        (lambda: ONE.amplified(np.nan), "gain = nan"),
        (lambda: ONE.amplified(2.0, [3]), "levels"),
        (lambda: ONE.points(4), "level = 4"),
        (
            lambda: ONE.transferred(Detailed.of(rough(9, 1), bezier_maps(5, 2))),
            "different affine maps",
        ),
        (lambda: ONE.moved([(0, 0)] * 3), "3 control points"),
        (lambda: Detailed(ONE.curve, ONE.details[1:], True), "details of level 0"),
        (lambda: Detailed(Curve.bezier(np.zeros((3, 3))), (), True), "is not two-dimensional"),
        (lambda: fit_curve([(0, 0), (1, 1)], points=1), "points = 1"),
        (lambda: fit_curve([(0, 0), (1, 1)], maps=1), "maps = 1"),
        (lambda: fit_curve([(0, 0), (1, 1)], drawn=0), "drawn = 0"),
        (lambda: fit_curve([(0, 0), (1, 1)], starts=0), "starts = 0"),
        (lambda: resampled([(0, 0), (1, 1)], 1), "count = 1"),
    ],
)
def test_what_is_no_line_is_told(fault, says):
    with pytest.raises(ShapeError, match=says):
        fault()
