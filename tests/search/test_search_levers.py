"""Operators that move a measure towards its target, chosen by the sign of the miss."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_search_recipe import faults, replaced
from test_search_run import rows, run
from towns import draw_town

import evocity
from evocity import operators
from evocity.fitness import Aims, Objective, Wanted, alignment, crumbs, fsi, gsi, mean_height
from evocity.recipe.mixture import STEERING_OPERATORS
from evocity.search import Search
from evocity.search.breeding.levers import LEVERS, draw_move, misses_of
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.store import RunLog

#: Goals of the toy towns: one with a lever, one without.
GOALS = """
[[fitness]]
name = "gsi"
target = 0.3
[[fitness]]
name = "crumbs"
"""


def aims(**targets):
    return Aims(
        tuple(
            Wanted(one, Objective(one, target=targets[one.name]))
            for one in (gsi, fsi, mean_height, alignment)
            if one.name in targets
        )
    )


@pytest.mark.parametrize("name", LEVERS)
@given(miss=st.floats(-1, 1e6), seed=st.integers(0, 2**32))
@settings(deadline=None)
def test_each_move_is_a_valid_operator(name, miss, seed):
    operator, parameters = LEVERS[name](miss, np.random.default_rng(seed))
    made = operators.make(operator, **parameters)
    assert operator in STEERING_OPERATORS
    if operator == "quarter_fusion":
        made.check_count(2)
    assert LEVERS[name](miss, np.random.default_rng(seed)) == (operator, parameters)


@given(miss=st.floats(-0.99, 10), seed=st.integers(0, 2**32))
def test_the_sign_of_a_miss_decides_the_direction(miss, seed):
    rng = np.random.default_rng(seed)
    _, parameters = LEVERS["fsi"](miss, rng)
    low, high = parameters["factors"]
    assert (low + high) / 2 >= 1 - 1e-3 if miss <= 0 else (low + high) / 2 <= 1 + 1e-3
    operator, parameters = LEVERS["gsi"](miss, rng)
    if miss > 0:
        assert operator == "quarter_fusion"
        assert parameters["void"]
        assert sum(parameters["fill"]) == pytest.approx(1)
    else:
        assert operator in ("quarter_refill", "relocation")
        assert parameters.get("density", 2) > 1
        assert parameters.get("mode", "copy") == "copy"


def test_a_miss_is_a_share_of_the_target():
    wanted = aims(gsi=0.4, fsi=2.0, mean_height=0.0)
    values = {"gsi": 0.3, "fsi": 2.5, "mean_height": 7.0, "alignment": 0.5}
    assert misses_of(wanted, values) == pytest.approx({"gsi": -0.25, "fsi": 0.25, "mean_height": 7})
    assert misses_of(wanted, {"gsi": 0.4}) == {"gsi": 0.0}
    maximised = Aims((Wanted(crumbs, Objective(crumbs)),))
    assert misses_of(maximised, {"crumbs": 3.0}) == {}


def test_larger_misses_are_drawn_more_often_and_nothing_where_none_is():
    wanted, values = aims(gsi=0.4, fsi=2.0), {"gsi": 0.36, "fsi": 1.0}
    drawn = [draw_move(wanted, values, np.random.default_rng(seed))[0] for seed in range(200)]
    assert drawn.count("height_scaling") > 150
    assert {"quarter_refill", "relocation"} < set(drawn)
    assert draw_move(wanted, {"gsi": 0.4, "fsi": 2.0}, np.random.default_rng(0)) is None
    assert draw_move(wanted, {}, np.random.default_rng(0)) is None
    assert draw_move(aims(alignment=0.5), {"alignment": 0.1}, np.random.default_rng(0)) is None


@pytest.fixture(scope="module")
def genomes():
    towns = [draw_town(seed, side=64, buildings=30) for seed in (3, 4)]
    return [evocity.encode(town, block=4, fit=False).genome for town in towns]


@pytest.mark.parametrize("measure", [gsi, mean_height], ids=lambda one: one.name)
@pytest.mark.parametrize("share", [0.7, 1.3])
def test_moves_bring_a_town_nearer(measure, share, genomes):
    before = measure(evocity.decode(genomes[0]).city)
    target, nearer = before * share, []
    for seed in range(6):
        rng = np.random.default_rng(seed)
        name, parameters = LEVERS[measure.name](before / target - 1, rng)
        operator = operators.make(name, **parameters)
        parents = genomes if name.startswith("quarter") else genomes[:1]
        value = measure(evocity.decode(operator(parents, rng)).city)
        nearer.append(abs(value - target) < abs(before - target))
    # loose houses leave few blocks to fill and few places for copies
    assert np.mean(nearer) >= 0.5 or (measure is gsi and share > 1 and any(nearer))


# -- in a search ----------------------------------------------------------------------------------


def steered(toy, **settings):
    return toy(recipe=GOALS + "[search]\nsteer = 0.7\n", **settings)


@pytest.mark.slow
def test_births_are_steered_and_drawn_again_from_the_log(toy, tmp_path):
    out = tmp_path / "run"
    run(steered(toy, generations=3), out, workers=0)
    log = RunLog(out)
    bred = log.births(columns=["id", "generation", "operator"]).to_pylist()
    later = [one for one in bred if one["generation"] > 0]
    moved = [one["id"] for one in later if one["operator"] in STEERING_OPERATORS]
    assert 0 < len(moved) < len(later)
    prepared, _ = read_preparation(log)
    for identifier in (moved[0], moved[-1], later[0]["id"]):
        assert plan_of(log, prepared, identifier).id == identifier


@pytest.mark.slow
def test_a_stop_changes_no_steered_birth(toy, tmp_path):
    recipe = steered(toy, generations=4)
    run(recipe, tmp_path / "whole", workers=0)
    run(recipe, tmp_path / "part", workers=0, generations=2)
    with Search.resume(tmp_path / "part", generations=4, workers=2) as search:
        for _ in search:
            pass
    assert rows(tmp_path / "part") == rows(tmp_path / "whole")


@pytest.mark.parametrize(
    ("lines", "says"),
    [
        ("steer = 0.5", "search.steer: 0.5, but no goal has a target; allowed: 0; or a target"),
        ("steer = 1.5", "search.steer: 1.5; allowed: 1.0 or less"),
        ("steer = 0.5\nalgorithm = 'cma'", "with the algorithm 'cma'; allowed: 0: this algorithm"),
    ],
)
def test_what_cannot_be_steered_is_a_fault(toy, lines, says):
    (line,) = faults(replaced(toy(), "[[fitness]]", f"[search]\n{lines}\n[[fitness]]", count=1))
    assert says in line


def test_targets_without_a_lever_are_a_fault(toy):
    (line,) = faults(replaced(steered(toy), '"gsi"', '"alignment"'))
    assert "search.steer: 0.7, but no goal with a target has a lever; allowed: 0; or a" in line
    for name in LEVERS:
        assert name in line
