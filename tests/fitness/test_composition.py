"""What is wanted together: constraints, weighted sums, and losses that can be compared."""

import math
import sys

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from evocity.errors import FitnessError
from evocity.fitness import Aims, Constraint, Objective, Wanted, crumbs, fsi, gsi, mean_height

numbers = st.floats(-1e6, 1e6)


@given(value=numbers, bounds=st.tuples(numbers, numbers).filter(lambda b: b[0] < b[1]))
def test_a_violation_is_the_distance_beyond_the_bounds_in_units_of_their_distance(value, bounds):
    low, high = bounds
    both = Constraint(gsi, low, high).violation(value)
    assert (both == 0) == (low <= value <= high)
    beyond = max(low - value, value - high, 0)
    assert both == pytest.approx(min(beyond / (high - low), sys.float_info.max))


@given(value=numbers, bound=numbers)
def test_one_bound_is_its_own_unit(value, bound):
    unit = abs(bound) or 1.0
    least, most = Constraint(gsi, low=bound), Constraint(gsi, high=bound)
    assert least.violation(value) == pytest.approx(
        min(max(bound - value, 0) / unit, sys.float_info.max)
    )
    assert most.violation(value) == pytest.approx(
        min(max(value - bound, 0) / unit, sys.float_info.max)
    )
    assert least.violation(value) == 0 or most.violation(value) == 0


@pytest.mark.parametrize("bounds", [(None, None), (2, 1), (math.nan, 1), (0, math.inf), ("0", 1)])
def test_bounds_that_are_none_are_refused(bounds):
    with pytest.raises(FitnessError, match="of gsi are invalid"):
        Constraint(gsi, *bounds)


def test_nan_is_the_worst_there_is():
    aims = Aims((Wanted(gsi, Objective(gsi, "max")), Wanted(fsi, constraint=Constraint(fsi, 1, 2))))
    lost, fine = ({"gsi": g, "fsi": f} for g, f in ((math.nan, math.nan), (0.1, 9.0)))
    assert aims.losses(lost) == (sys.float_info.max,)
    assert aims.violation(lost) == sys.float_info.max > aims.violation(fine)


def test_weighted_measures_make_one_objective():
    aims = Aims(
        (
            Wanted(gsi, Objective(gsi, target=0.3), weight=100, total="form"),
            Wanted(crumbs, Objective(crumbs)),
            Wanted(mean_height, Objective(mean_height, "max"), weight=2, total="form"),
            Wanted(fsi, constraint=Constraint(fsi, 1, 3)),
        )
    )
    assert aims.names == ("form", "crumbs")
    values = {"gsi": 0.35, "crumbs": 4.0, "mean_height": 10.0, "fsi": 4.0}
    assert aims.losses(values) == pytest.approx((100 * 0.05 - 2 * 10, 4.0))
    assert aims.violation(values) == pytest.approx(0.5)
    assert aims.wanted[-1].loss(4.0) == pytest.approx(0.5)


@example([sys.float_info.max, -sys.float_info.max, -1.0])
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=3))
def test_losses_and_violations_stay_finite(values):
    aims = Aims(
        (
            Wanted(gsi, Objective(gsi, target=-1e308), weight=1e6, total="both"),
            Wanted(fsi, Objective(fsi, "min"), weight=1e6, total="both"),
            Wanted(crumbs, constraint=Constraint(crumbs, low=1e-300)),
        )
    )
    told = dict(zip(("gsi", "fsi", "crumbs"), values, strict=True))
    assert all(math.isfinite(loss) for loss in aims.losses(told))
    assert math.isfinite(aims.violation(told))
