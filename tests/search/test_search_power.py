"""Arithmetic of benchmarks/search_power.py."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from _peer_table import Union, entered
from _power_curves import REFERENCE, Unit, curve, passed

FIRST = np.array([[0.0, 10.0], [2.0, 20.0], [np.nan, np.nan]])
PARENTS = np.array([[2.0, 12.0], [1.0, 20.0]])
ALL = np.ones(3, bool)


def test_the_unit_is_the_range_of_the_first_births_and_the_zero_the_worst_parent():
    unit = Unit.of(FIRST, PARENTS)
    assert unit.worst == [2, 20]
    assert unit.ranges == [2, 10]
    assert unit(np.array([[2.0, 20.0], [0.0, 10.0]])).tolist() == [[0, 0], [-1, -1]]


def test_a_curve_grows_by_what_is_counted():
    unit = Unit([2, 20], [2, 10])
    losses = np.array([[2.0, 20.0], [0.0, 10.0], [1.0, 15.0]])
    found = curve(unit, losses, ALL, 1)
    assert found == pytest.approx([REFERENCE**2, 1.1**2, 1.1**2])
    assert curve(unit, losses, np.array([True, False, True]), 1)[-1] == pytest.approx(0.6**2)
    assert curve(unit, losses + 100, ALL, 1).tolist() == [0, 0, 0]  # beyond the reference
    assert curve(unit, np.full((2, 2), np.nan), np.zeros(2, bool), 1).tolist() == [0, 0]


def test_when_a_value_is_passed():
    own = np.array([0.1, 0.2, 0.5, 0.5])
    assert passed(own, 0.2) == 0.75
    assert passed(own, 0.05) == 0.25
    assert np.isinf(passed(own, 0.5))


@given(st.integers(1, 3), st.integers(0, 30), st.integers(0, 2**32))
@settings(deadline=None)
def test_who_entered_holds_the_front_at_every_time(goals, count, seed):
    rng = np.random.default_rng(seed)
    losses = rng.integers(0, 5, (count, goals)).astype(float)
    keeps = rng.random(count) < 0.7
    rows = entered(losses, keeps)
    assert keeps[rows].all()
    for end in range(count + 1):
        every = {tuple(one) for one in losses[:end][keeps[:end]]}
        own = {tuple(one) for one in losses[rows[rows < end]]}

        def front(points):
            return {
                one
                for one in points
                if not any(other != one and np.all(np.less_equal(other, one)) for other in points)
            }

        assert front(own) == front(every)


def test_the_front_of_all_methods_is_the_unit():
    one, other = np.array([[0.0, 4.0], [9.0, 9.0]]), np.array([[2.0, 0.0], [1.0, 2.0]])
    union = Union([one, other])
    assert sorted(map(tuple, union.front.tolist())) == [(0, 1), (0.5, 0.5), (1, 0)]
    assert union.share(np.vstack([one, other])) == pytest.approx(1)
    # of one: 1.1 x 0.1; of all: 0.1 x 1.1 + 0.5 x 0.6 + 0.5 x 0.1
    assert union.share(one) == pytest.approx(0.11 / 0.46)
    assert union.epsilon(np.vstack([one, other])) == 0
    assert union.epsilon(one) == 1
    assert union.epsilon(other) == pytest.approx(0.5)
    assert union.share(np.empty((0, 2))) == 0
    assert np.isinf(union.epsilon(np.empty((0, 2))))
