"""NLopt's wrapper: the least is found, whatever a function does passes through."""

import numpy as np
import pytest

from evocity.coding.optimiser import WITHOUT_GRADIENTS, Enough, Least, minimise

EDGES = {"lower": np.zeros(3), "upper": np.ones(3)}
CENTRE = np.array([0.3, 0.9, 0.5])


def bowl(point, gradient) -> float:
    if gradient.size:
        gradient[:] = 2 * (point - CENTRE)
    return float(((point - CENTRE) ** 2).sum())


@pytest.mark.parametrize("algorithm", [*WITHOUT_GRADIENTS, "mma"])
def test_the_least_of_a_bowl_is_found(algorithm):
    found = minimise(bowl, np.zeros(3), algorithm=algorithm, most=300, **EDGES)
    assert found.point == pytest.approx(CENTRE, abs=1e-2)
    assert found.value == bowl(found.point, np.empty(0))
    assert 0 < found.evaluations <= 300
    again = minimise(bowl, np.zeros(3), algorithm=algorithm, most=300, **EDGES)
    assert np.array_equal(found.point, again.point)


@pytest.mark.parametrize("algorithm", WITHOUT_GRADIENTS)
def test_points_stay_within_the_bounds_and_the_best_is_kept(algorithm):
    seen = []

    def beyond(point, _) -> float:  # its least lies beyond a corner
        seen.append((float(((point - [2, -1, 0.5]) ** 2).sum()), point.copy()))
        return seen[-1][0]

    found = minimise(beyond, np.full(3, 0.5), algorithm=algorithm, most=60, **EDGES)
    assert all((point >= 0).all() and (point <= 1).all() for _, point in seen)
    assert len(seen) == found.evaluations <= 60
    assert found.value == min(value for value, _ in seen)


@pytest.mark.parametrize("algorithm", [*WITHOUT_GRADIENTS, "mma"])
@pytest.mark.parametrize("raised", [KeyboardInterrupt, ValueError, SystemExit, MemoryError])
def test_what_a_function_raises_passes_through(algorithm, raised):
    asked = []

    def fails(point, gradient) -> float:
        asked.append(1)
        if len(asked) == 5:
            raise raised("in the middle")
        return bowl(point, gradient)

    with pytest.raises(raised, match="in the middle"):
        minimise(fails, np.zeros(3), algorithm=algorithm, most=100, **EDGES)
    assert len(asked) == 5  # nothing is asked once it has failed


@pytest.mark.parametrize("algorithm", WITHOUT_GRADIENTS)
def test_enough_ends_it_with_the_best_so_far(algorithm):
    seen = []

    def weary(point, gradient) -> float:
        if len(seen) == 7:
            raise Enough
        seen.append(bowl(point, gradient))
        return seen[-1]

    found = minimise(weary, np.zeros(3), algorithm=algorithm, most=1000, **EDGES)
    assert (found.value, found.evaluations) == (min(seen), 7)


@pytest.mark.parametrize("none", [None, np.nan, np.inf, -np.inf])
def test_what_is_no_value_is_worse_than_any(none):
    def half(point, _):
        return none if point[0] < 0.5 else float(point.sum())

    found = minimise(half, np.full(3, 0.6), algorithm="sbplx", most=80, **EDGES)
    assert found.point[0] >= 0.5
    assert np.isfinite(found.value)
    nothing = minimise(lambda *_: none, np.full(3, 0.6), algorithm="sbplx", most=20, **EDGES)
    assert isinstance(nothing, Least)
    assert np.array_equal(nothing.point, np.full(3, 0.6))
    assert nothing.value == np.inf


def test_bobyqa_takes_one_number():
    found = minimise(
        lambda point, _: float((point[0] - 0.25) ** 2),
        np.array([0.9]),
        algorithm="bobyqa",
        most=60,
        lower=np.zeros(1),
        upper=np.ones(1),
    )
    assert found.point[0] == pytest.approx(0.25, abs=1e-3)


@pytest.mark.parametrize("algorithm", WITHOUT_GRADIENTS)
def test_steps_beyond_the_bounds_are_shortened(algorithm):
    narrow = {"lower": np.zeros(3), "upper": np.full(3, 0.1)}
    found = minimise(bowl, np.full(3, 0.05), algorithm=algorithm, most=80, step=1.0, **narrow)
    assert found.point == pytest.approx(np.full(3, 0.1), abs=1e-2)
