"""Wrong parameters are told when an operator is made, all at once, and never at a birth."""

import math
import pickle
from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import pytest

from evocity import operators
from evocity.errors import OperatorError
from evocity.operators import OPERATORS, Mutation, PavementFusion, make
from evocity.operators import registry as operator_registry

EVERY = {name: [field.name for field in fields(kind)] for name, kind in OPERATORS.items()}
FLOATS = {"fill", "margin", "tolerance", "repair", "share", "blend", "sigma_step", "beta_step"}
FLOATS |= {"sigma", "beta", "x", "y", "dx", "dy", "iso", "rate", "change", "cut", "alike", "side"}
FLOATS |= {"side_min", "side_max", "grain_side", "group_side", "area_max", "area_min", "halved_min"}
FLOATS |= {
    "storey",
    "highest",
    "spread",
    "density",
    "facades",
    "widened",
    "repeats",
    "neighbourhood",
}
#: Parameters in metres that are whole numbers of other operators.
METRES = {("asymmetric_fusion", "side")}
TRUTHS = {"void", "isometries", "choose", "stepwise"}


def faults(name, **parameters):
    with pytest.raises(OperatorError) as caught:
        make(name, **parameters)
    assert "supported between" not in str(caught.value)
    assert all(key in str(caught.value) for key in parameters)
    return caught.value.faults


@pytest.mark.parametrize("name", OPERATORS)
def test_no_parameter_takes_what_it_cannot_be(name):
    for key in EVERY[name]:
        for wrong in ("x", math.nan, math.inf, {}, b"x", [[[1]]], 1j, -1):
            found, allowed = faults(name, **{key: wrong})[key]
            assert found
            assert allowed


@pytest.mark.parametrize("name", OPERATORS)
def test_truth_is_no_number_and_a_number_no_truth(name):
    for key in EVERY[name]:
        wrong = 1 if key in TRUTHS else True
        assert faults(name, **{key: wrong})[key][0] == str(wrong)
        if key not in FLOATS | TRUTHS and (name, key) not in METRES:
            assert key in faults(name, **{key: 2.5})


@pytest.mark.parametrize(
    ("name", "parameters"),
    [
        ("pavement_fusion", {"positions": 5}),
        ("pavement_fusion", {"positions": [[1, 2, 3]]}),
        ("pavement_fusion", {"positions": [[1, 2.5]]}),
        ("pavement_fusion", {"positions": [[1, 10**20]]}),
        ("pavement_fusion", {"void": "no"}),
        ("pavement_fusion", {"fill": []}),
        ("pavement_fusion", {"fill": [0.5, math.nan]}),
        ("pavement_fusion", {"domains": []}),
        ("pavement_fusion", {"domains": [2, 2.5]}),
        ("mutation", {"stretch": 1.5}),
        ("mutation", {"move": 10**20}),
        ("lambda_crossover", {"grain": 10**9}),
        ("lambda_crossover", {"share": None}),
    ],
    ids=str,
)
def test_awkward_values_are_told(name, parameters):
    assert list(faults(name, **parameters)) == list(parameters)


def test_all_faults_come_at_once_those_of_type_and_those_of_value():
    wrong = {"sgima": 0.1, "sigma": "x", "group": 0, "move": 2.5}
    found = faults("mutation", **wrong)
    assert set(found) == set(wrong)
    assert found["sigma"] == ("'x'", "a finite number")
    assert found["move"] == ("2.5", "a whole number")
    assert "did you mean sigma?" in found["sgima"][1]
    with pytest.raises(OperatorError, match=r"move = 2\.5, group = 0"):
        Mutation(group=0, move=2.5)


def test_what_compares_with_a_parameter_at_fault_is_not_told():
    assert list(faults("pavement_fusion", size_min="x")) == ["size_min"]
    with pytest.raises(OperatorError) as caught:
        PavementFusion(size_min="x", size_max=3)
    assert list(caught.value.faults) == ["size_min"]


def test_types_are_told_in_words():
    found = faults("pavement_fusion", fill="x", positions="x", void="x", reach="x", domains="x")
    assert {key: allowed for key, (_, allowed) in found.items()} == {
        "fill": "a finite number or a list of finite numbers or none",
        "positions": "a list of lists of 2 whole numbers or none",
        "void": "true or false",
        "reach": "a whole number or none",
        "domains": "a list of whole numbers",
    }


def test_lists_and_arrays_and_whole_numbers_are_taken():
    fusion = PavementFusion(
        size_min=np.int64(3),
        fill=np.array([0.2, 0.8]),
        positions=[[1, 2]],
        domains=range(2, 4),
        tolerance=5,
        margin=np.float32(0.5),
    )
    assert (type(fusion.size_min), fusion.fill) == (int, (0.2, 0.8))
    assert make("pavement_fusion", positions=[[1, 2]], fill=1).positions == [[1, 2]]


def test_the_error_goes_to_another_process():
    with pytest.raises(OperatorError) as caught:
        make("mutation", sigma=2)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.faults) == (str(caught.value), {"sigma": ("2", "0…1")})


@pytest.mark.parametrize(
    ("fusion", "good", "bad"),
    [
        (PavementFusion(), (2, 3, 9), ()),
        (PavementFusion(fill=0.3), (2,), (3,)),
        (PavementFusion(fill=(0.2, 0.3, 0.5)), (3,), (2, 4)),
        (PavementFusion(fill=(0.2, 0.3, 0.5), void=True), (2,), (3,)),
        (PavementFusion(fill=0.3, void=True), (), (2, 3)),
        (PavementFusion(fill=(0.2, 0.3)), (), (2,)),
    ],
    ids=str,
)
def test_fill_suits_a_number_of_parents(fusion, good, bad):
    for count in good:
        fusion.check_count(count)
    for count in bad:
        with pytest.raises(OperatorError, match=f"one share for each of {count} parents"):
            fusion.check_count(count)


# -- plugins -----------------------------------------------------------------------------


@dataclass(frozen=True)
class Foreign:
    """An operator of another package: it checks nothing itself."""

    rate: float = 0.5
    places: Sequence[int] = ()

    name = "foreign"
    parents = (1, 1)

    def __post_init__(self):
        if self.rate == 0.25:
            raise ArithmeticError("no quarter")

    def __call__(self, parents, rng):
        return parents[0]


class Entry:
    def __init__(self, name, load):
        self.name, self.value, self.load = name, f"afar:{name}", load


@pytest.fixture
def plugins(monkeypatch):
    asked = []

    def install(*entries):
        found = lambda group: asked.append(group) or entries  # noqa: E731
        monkeypatch.setattr("evocity.plugins.entry_points", found)
        operator_registry._plugins.cache_clear()
        return asked

    yield install
    operator_registry._plugins.cache_clear()


def test_plugins_are_found_once_and_broken_ones_only_told(plugins):
    def raising():
        raise ImportError("its library is missing")

    asked = plugins(
        Entry("broken", raising),
        Entry("odd", lambda: 3),
        Entry("mutation", lambda: Foreign),
        Entry("foreign", lambda: Foreign),
    )
    assert make("foreign", rate=1, places=[1]) == Foreign(1, [1])
    assert operators.operators()["mutation"] is Mutation
    broken, odd, clash = operators.plugin_warnings()
    assert broken == "plugin broken (afar:broken) not loaded: ImportError: its library is missing"
    assert "is not a class" in odd
    assert "a second operator called mutation" in clash
    with pytest.raises(OperatorError, match="its library is missing"):
        make("broken")
    assert asked == ["evocity.operators"]


def test_operators_of_other_packages_are_checked_too(plugins):
    plugins(Entry("foreign", lambda: Foreign))
    assert set(faults("foreign", rate="x", places=["y"], rats=1)) == {"rate", "places", "rats"}
    with pytest.raises(OperatorError, match="no quarter"):
        make("foreign", rate=0.25)
