"""Arithmetic of benchmarks/search_power.py."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

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
