"""What the analysis reckons, by another way to the same."""

import math
import sys
import warnings
from itertools import combinations

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity.analysis.clusters import build, farthest_first, label_clusters, medoids, swap
from evocity.analysis.condition import Condition
from evocity.analysis.goals import Aim
from evocity.analysis.pedigree import archive_entries
from evocity.analysis.shortlist import achievement, best_compromise, weights_of
from evocity.errors import EvocityError
from evocity.fitness import Aims, Constraint, Objective, Wanted
from evocity.search.record.aims import judge_births, uncallable_measure

# -- losses by an aim ------------------------------------------------------------------------

EDGES = [0.0, 1.0, -1.0, 1.7e308, -1.7e308, math.inf, -math.inf, math.nan]
VALUES = st.one_of(st.floats(), st.sampled_from(EDGES))
BOUNDS = st.one_of(st.none(), st.floats(allow_nan=False, allow_infinity=False))
AIMS = st.builds(
    Aim,
    st.just("gsi"),
    st.just(""),
    st.sampled_from(["max", "min", "like", "bounds", "none", "unknown"]),
    target=BOUNDS,
    low=BOUNDS,
    high=BOUNDS,
)


def naive_loss(aim: Aim, value: float) -> float:
    if aim.goal == "bounds":
        if math.isnan(value):
            return sys.float_info.max
        below = 0.0 if aim.low is None else aim.low - value
        above = 0.0 if aim.high is None else value - aim.high
        return min(max(below, above, 0.0), sys.float_info.max)
    if aim.target is not None:
        return min(abs(value - aim.target), sys.float_info.max)
    return value if aim.goal == "min" else -value


@settings(max_examples=200)
@given(AIMS, st.lists(VALUES, max_size=6))
def test_losses_of_many_are_those_of_each(aim, values):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = aim.losses(np.array(values))
        each = [aim.loss(one) for one in values]
    expected = [naive_loss(aim, one) for one in values]
    np.testing.assert_array_equal(found, expected)
    np.testing.assert_array_equal(each, expected)


# -- who entered the archive -----------------------------------------------------------------


class Births:
    """Losses of two goals, by the generation."""

    goals = ("a", "b")

    def __init__(self, rows):
        self.generation = np.sort([row[0] for row in rows])
        self.losses = np.array([row[1:3] for row in rows], float)
        self.feasible = np.array([row[3] for row in rows], bool)

    def __len__(self):
        return len(self.losses)


FEW = st.integers(0, 3)


@settings(max_examples=60)
@given(st.lists(st.tuples(FEW, FEW, FEW, st.booleans()), min_size=1, max_size=12))
def test_who_entered_was_dominated_by_none_until_then_and_is_the_first_of_equal_ones(rows):
    told = Births(rows)
    kept = np.flatnonzero(told.feasible)
    expected = np.zeros(len(rows), bool)
    for one in kept:
        known = [other for other in kept if told.generation[other] <= told.generation[one]]
        no_worse = [k for k in known if (told.losses[k] <= told.losses[one]).all()]
        equal = [k for k in no_worse if (told.losses[k] == told.losses[one]).all()]
        expected[one] = len(no_worse) == len(equal) and min(equal) == one
    assert archive_entries(told).tolist() == expected.tolist()


# -- losses ----------------------------------------------------------------------------------

NUMBERS = st.one_of(
    st.sampled_from([0.0, -0.0, 1.0, -1.0, math.nan, math.inf, -math.inf, sys.float_info.max]),
    st.floats(-1e308, 1e308),
    st.floats(-10, 10),
)
FINITE = st.floats(-1e308, 1e308)


@st.composite
def aims(draw) -> Aims:
    wanted = []
    for number in range(draw(st.integers(1, 5))):
        measure = uncallable_measure(f"m{number}")
        goal = draw(st.sampled_from(["max", "min", "target", None])) if number else "max"
        target = draw(FINITE) if goal == "target" else None
        objective = None if goal is None else Objective(measure, goal, target)
        low, high = sorted([draw(FINITE), draw(FINITE)])
        bounds = draw(st.sampled_from([(low, None), (None, high), (low, high), None]))
        if goal is None or bounds is not None:
            bounds = bounds if bounds is not None and low < high else (low, None)
        total = draw(st.sampled_from([None, "one", "other"]))
        weight = draw(st.floats(1e-6, 1e9)) if total else 1.0
        constraint = None if bounds is None else Constraint(measure, *bounds)
        wanted.append(Wanted(measure, objective, constraint, weight, total))
    return Aims(tuple(wanted))


@settings(deadline=None)
@given(aims(), st.data())
def test_losses_by_columns_are_those_by_rows_to_the_bit(told, data):
    names = [one.measure.name for one in told.wanted]
    rows = data.draw(st.lists(st.tuples(*[NUMBERS] * len(names)), max_size=6))
    table = pa.table(
        {
            f"fitness.{name}": pa.array([row[place] for row in rows], pa.float64())
            for place, name in enumerate(names)
        }
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        losses, kept = judge_births(table, told)
    every = [dict(zip(names, row, strict=True)) for row in rows]
    expected = np.array([told.losses(one) for one in every], float).reshape(-1, len(told.names))
    assert losses.tobytes() == expected.tobytes()
    assert kept.tolist() == [told.violation(one) == 0 for one in every]


# -- the compromise --------------------------------------------------------------------------


@pytest.mark.parametrize("goals", [2, 3, 5])
def test_the_compromise_is_pymoos(goals):
    asf = pytest.importorskip("pymoo.decomposition.asf").ASF()
    rng = np.random.default_rng(goals)
    for _ in range(40):
        losses = rng.normal(size=(30, goals)) * rng.uniform(0.1, 1e3, goals)
        weights = rng.uniform(0.2, 5, goals)
        scaled = (losses - losses.min(axis=0)) / np.ptp(losses, axis=0)
        expected = asf.do(scaled, 1 / weights, utopian_point=np.zeros(goals))
        assert achievement(losses, weights) == pytest.approx(np.ravel(expected))
        assert best_compromise(losses, weights) == int(np.argmin(expected))


def test_of_equally_far_ones_the_better_sum_is_the_compromise():
    losses = np.array([[0.0, 4.0, 2.0], [4.0, 0.0, 2.0], [2.0, 2.0, 4.0], [2.0, 2.0, 2.0]])
    assert best_compromise(losses, np.ones(3)) == 3
    assert best_compromise(losses[[0, 1]], np.array([1.0, 0, 0])) == 0  # what does not count
    assert best_compromise(losses[:1], np.ones(3)) == 0


@pytest.mark.parametrize(
    "told", [{"a": -1}, {"a": math.nan}, {"a": math.inf}, {"a": "1"}, {"c": 1}, {"a": 0, "b": 0}, 3]
)
def test_weights_that_are_none_are_refused(told):
    with pytest.raises(EvocityError) as caught:
        weights_of(told, ("a", "b"))
    assert "weights = " in caught.value.found
    assert weights_of({"b": 2}, ("a", "b")).tolist() == [1, 2]


# -- clusters --------------------------------------------------------------------------------


def distances_of(points: np.ndarray) -> np.ndarray:
    return np.sqrt(np.square(points[:, None] - points[None]).sum(axis=2))


def cost(distances: np.ndarray, chosen) -> float:
    return distances[:, list(chosen)].min(axis=1).sum()


def brute(distances: np.ndarray, k: int) -> float:
    return min(cost(distances, one) for one in combinations(range(len(distances)), k))


@pytest.mark.parametrize("k", [1, 2, 3, 4])
def test_medoids_are_the_best_there_are(k):
    rng = np.random.default_rng(k)
    worse = []
    for _ in range(25):
        distances = distances_of(rng.random((int(rng.integers(k, 14)), 2)))
        best = brute(distances, k)
        assert cost(distances, medoids(distances, k)) == pytest.approx(best)
        worse.append(cost(distances, swap(distances, build(distances, k))) / max(best, 1e-300))
    assert np.median(worse) == pytest.approx(1)  # PAM alone: seldom off, and never far
    assert max(worse) < 1.2


def test_many_births_in_clear_groups_are_told_apart():
    rng = np.random.default_rng(0)
    middles = np.array([[0, 0], [9, 0], [0, 9], [9, 9], [4, 4]])
    which = rng.integers(0, 5, 90)
    distances = distances_of(middles[which] + rng.normal(0, 0.3, (90, 2)))
    assert math.comb(90, 5) > 20_000  # so it is PAM's answer
    chosen = medoids(distances, 5)
    labels = label_clusters(distances, chosen)
    assert sorted(which[chosen].tolist()) == [0, 1, 2, 3, 4]
    assert (which[chosen][labels] == which).all()
    for number, one in enumerate(chosen):
        own = np.flatnonzero(labels == number)
        assert distances[np.ix_(own, own)].sum(axis=1).min() == distances[one, own].sum()


def test_equal_ones_have_a_medoid_each():
    distances = np.zeros((4, 4))
    chosen = medoids(distances, 3)
    assert len(set(chosen.tolist())) == 3
    assert label_clusters(distances, chosen)[chosen].tolist() == [0, 1, 2]


def test_the_farthest_come_first():
    points = np.array([[0.0], [1.0], [10.0], [5.0], [9.0]])
    assert farthest_first(distances_of(points), 4).tolist() == [0, 2, 3, 1]
    assert farthest_first(distances_of(points), 1).tolist() == [0]
    assert farthest_first(np.zeros((3, 3)), 3).tolist() == [0, 1, 2]


# -- conditions ------------------------------------------------------------------------------

COLUMNS = {
    "fsi": np.array([0.5, 2.5, 3.0, math.nan]),
    "crumbs": np.array([1.0, 3.0, 9.0, 2.0]),
    "operator": np.array(["mutation", "relocation", "mutation", "source"], object),
    "alive": np.array([True, False, True, True]),
    "generation": np.array([0, 1, 2, 3], np.int32),
    "types.house": np.array([0.1, 0.2, 0.3, 0.4]),
    "gsi@old town": np.array([0.1, 0.2, 0.3, 0.4]),
    "gsi@west": np.array([0.4, 0.3, 0.2, 0.1]),
}


def kept(text: str) -> list[int]:
    found = Condition.read(text, COLUMNS).kept(COLUMNS.__getitem__, 4)
    assert found.dtype == bool
    return np.flatnonzero(found).tolist()


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("fsi > 2 and crumbs < 4", [1]),
        ("fsi > 2 or crumbs < 4", [0, 1, 2, 3]),
        ("2 < fsi <= 3", [1, 2]),
        ("fitness.fsi >= 3", [2]),
        ("operator == 'mutation' and not generation == 0", [2]),
        ('operator != "mutation"', [1, 3]),
        ("'source' == operator", [3]),
        ("alive", [0, 2, 3]),
        ("not alive", [1]),
        ("alive == False", [1]),
        ("-fsi < -2", [1, 2]),
        ("fsi / crumbs > 0.4 and fsi + crumbs * 2 - 1 < 5", [0]),
        ("fsi / 0 > 1", [0, 1, 2]),
        ("fsi != 0.5", [1, 2]),  # no number differs from none
        ("types.house > 0.2", [2, 3]),
        ("gsi@west > 0.2", [0, 1]),
        ("`gsi@old town` > 0.2 and `fsi` > 0", [2]),
        ("True", [0, 1, 2, 3]),
        (" \n alive", [0, 2, 3]),
    ],
)
def test_conditions_say_what_they_mean(text, rows):
    assert kept(text) == rows


@pytest.mark.parametrize(
    "text",
    [
        "", "fsi >", "fsi", "fsi + 1", "3", "'a'", "__import__('os').system('x')", "fsi.real()",
        "(lambda: 1)()", "[fsi][0] > 1", "fsi if alive else crumbs", "(x := 1) > 0", "f'{fsi}' > 1",
        "fsi in (1, 2)", "fsi is 1", "{1} > 0", "fsi ** 9 > 1", "fsi // 2 > 1", "fsi % 2 > 1",
        "~alive", "alive & alive", "fsi @ 2 > 1", "1j > fsi", "None == fsi", "b'a' == operator",
        "fsi > 'a'", "operator > 'a'", "operator + 'a' == 'b'", "alive + 1 > 1", "alive > False",
        "fsi and crumbs", "alive and 1", "not fsi", "fsi == alive", "fsi > 1; crumbs", "import os",
        "fsi > " + "9" * 400, "(" * 300 + "alive" + ")" * 300, "not " * 200 + "alive",
        "alive and " * 400 + "alive", "fsi > 1 \x00", "fsi > 1e", "\ud800 > 1", "`fsi > 1", "``> 1",
    ],
)  # fmt: skip
def test_what_is_no_condition_is_refused(text):
    with pytest.raises(EvocityError) as caught:  # and no warning, which is an error here
        kept(text)
    assert caught.value.expected
    assert len(str(caught.value)) <= 1000


@pytest.mark.parametrize("text", [None, 3, ["alive"], b"alive"])
def test_a_condition_is_a_text(text):
    with pytest.raises(EvocityError, match="not a text"):
        kept(text)


def test_the_column_that_was_meant_is_named():
    with pytest.raises(EvocityError, match="did you mean crumbs"):
        kept("crumb < 4")
