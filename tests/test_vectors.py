"""Vector code against numpy, lane by lane."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import TypingError, njit

from evocity.accelerate.vectors import WIDTH, vector_code

LANES = WIDTH


@vector_code("none", known=0)
def combine(v, a, b, one, out):
    x, y = v.load(a.start), v.load(b.start)
    found = [
        v.add(x, y),
        v.sub(x, y),
        v.mul(x, y),
        v.plus_product(v.spread(one), x, y),
        v.plus_product(None, x, y),
        v.abs(x),
        v.larger(x, y),
        v.smaller(x, y),
        v.spread(v.largest(x)),
        v.spread(v.after(b.start, 1)),
        v.zero,
    ]
    for row, value in enumerate(found):
        v.store(value, out.at(v.number(row)))


@vector_code("int64", known=1)
def listed(v, times, a, b, which):
    """Numbers of the lanes where a ≥ b, ``times`` over, in ``which``; how many, and whether any."""
    used = v.variable(v.number(0))
    with v.loop(v.number(times)):
        truths = v.reaches(v.load(a.start), v.load(b.start))
        count = v.builder.load(used)
        more = v.list_lanes(truths, v.number(100), which.at(count))
        v.builder.store(v.builder.add(count, more), used)
    some = v.any(v.reaches(v.load(a.start), v.load(b.start)))
    return v.builder.add(v.builder.mul(v.builder.load(used), v.number(2)), some)


@njit
def run_combine(a, b, one, out):
    combine(a, b, one, out)


@njit
def run_twice(a, b, which):
    return listed(2, a, b, which)


@njit
def run_thrice(a, b, which):
    return listed(3, a, b, which)


@njit
def run_unknown(times, a, b, which):
    return listed(times, a, b, which)


lanes = st.lists(st.integers(-50, 50), min_size=LANES, max_size=LANES).map(
    lambda values: np.array(values, np.float32) / 4
)


@settings(max_examples=40, deadline=None)
@given(lanes, lanes, st.integers(-8, 8))
def test_lanes_are_numpys(a, b, one):
    out = np.full((11, LANES), np.nan, np.float32)
    run_combine(a, b, np.float32(one), out)
    truth = [a + b, a - b, a * b, one + a * b, a * b, abs(a), np.maximum(a, b), np.minimum(a, b)]
    truth += [np.full(LANES, a.max()), np.full(LANES, b[1]), np.zeros(LANES)]
    assert np.array_equal(out, truth)


@settings(max_examples=40, deadline=None)
@given(lanes, lanes)
def test_lanes_are_listed_in_order(a, b):
    for run, times in ((run_twice, 2), (run_thrice, 3)):  # what is known makes another code
        which = np.full(4 * LANES, -1, np.int32)
        told = run(a, b, which)
        numbers = 100 + np.flatnonzero(a >= b)
        assert told == 2 * times * numbers.size + bool(numbers.size)
        assert np.array_equal(which[: times * numbers.size], np.tile(numbers, times))
        assert (which[times * numbers.size :] == -1).all()


def test_what_must_be_known_cannot_be_an_argument():
    a = np.zeros(LANES, np.float32)
    with pytest.raises(TypingError):
        run_unknown(2, a, a, np.zeros(2 * LANES, np.int32))
