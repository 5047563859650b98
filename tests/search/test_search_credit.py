"""Weights of operators that follow what their births earn."""

import dataclasses
import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_search_commands import SUMMED, events, steered
from test_search_run import rows, run
from toy_runs import unsealed

from evocity.fitness import Aims, Constraint, Objective, Wanted, crumbs, gsi
from evocity.search import Search, read_recipe
from evocity.search.breeding.credit import MOST, WINDOW, Credit, credit_of
from evocity.search.record import commands
from evocity.search.record.aims import aims_of_run
from evocity.search.record.commands import Reweight
from evocity.selection.fronts import Gain, Hypervolume
from evocity.store import Birth, RunLog

AIMS = Aims((Wanted(crumbs, Objective(crumbs)), Wanted(gsi, constraint=Constraint(gsi, 0.2))))


def birth(identifier, operator, loss, ok=True, dense=0.5):
    values = {"crumbs": loss, "gsi": dense}
    return Birth(1, identifier, (), operator, "ok" if ok else "error", None, 0.0, values, None)


@pytest.mark.parametrize("by", ["hypervolume", "archive"])
def test_who_earns_more_weighs_more(by):
    credit = Credit(by)
    assert credit.factors(["a", "b"]) == {"a": 1.0, "b": 1.0}
    for turn in range(WINDOW):
        good = [birth(20 * turn + k, "good", 9.0 - turn - k / 100) for k in range(8)]
        bad = [birth(20 * turn + 10 + k, "bad", 10.0) for k in range(8)]
        credit.learn(good + bad, AIMS, {one.id for one in good})
    factors = credit.factors(["good", "bad", "never"])
    assert factors["bad"] < 0.7 < 1.3 < factors["good"] <= 2
    assert factors["never"] == 1.0  # nothing is known of it
    assert all(1 / MOST <= one <= MOST for one in factors.values())
    for turn in range(WINDOW):  # what is older than the window is forgotten
        credit.learn([birth(1000 + turn, "bad", 0.0 - turn)], AIMS, {1000 + turn})
    assert credit.factors(["bad"]) == {"bad": 1.0}


@pytest.mark.parametrize("by", ["hypervolume", "archive"])
def test_only_what_keeps_the_constraints_enters_the_archive(by):
    credit = Credit(by)
    credit.learn([birth(0, "a", 5.0), birth(1, "b", 1.0, dense=0.1)], AIMS, ())
    factors = credit.factors(["a", "b"])
    assert factors["a"] > 1 > factors["b"]
    credit.learn([birth(2, "b", 6.0), birth(3, "a", 6.0, ok=False)], AIMS, ())  # dominated, failed
    assert credit.factors(["b"]) == {"b": 1.0} or credit.factors(["a", "b"])["b"] < 1


@given(st.integers(1, 4), st.integers(0, 12), st.integers(0, 2**32))
@settings(deadline=None)
def test_a_gain_is_what_the_hypervolume_grows_by(goals, count, seed):
    rng = np.random.default_rng(seed)
    first = rng.normal(size=(6, goals))
    front, point = rng.normal(size=(count, goals)), rng.normal(size=goals)
    volume = Hypervolume(first)
    before = volume(front) if count else 0.0
    after = volume(np.vstack([front, point]))
    assert Gain(first)(front, point) == pytest.approx(after - before, abs=1e-9)


def test_a_birth_earns_the_root_of_its_gain():
    """One goal: what is gained is how far the best of earlier generations falls."""
    credit = Credit()
    credit.learn([birth(0, "a", 10.0), birth(1, "a", 20.0)], AIMS, ())
    credit.learn([birth(2, "a", 9.0), birth(3, "b", 6.0), birth(4, "c", 12.0)], AIMS, ())
    told = credit._generations[-1]
    assert told["a"] == (1, pytest.approx((1 / 10) ** 0.5))
    assert told["b"] == (1, pytest.approx((4 / 10) ** 0.5))
    assert told["c"] == (1, 0.0)


def test_where_hypervolumes_take_long_births_earn_by_entering():
    names = [f"goal {number}" for number in range(13)]
    measures = [dataclasses.replace(crumbs, name=name) for name in names]
    aims = Aims(tuple(Wanted(one, Objective(one, goal="min")) for one in measures))

    def of(identifier, loss):
        values = dict.fromkeys(names, loss)
        return Birth(1, identifier, (), f"of {loss}", "ok", None, 0.0, values, None)

    credit = Credit()
    credit.learn([of(0, 3.0), of(1, 2.0)], aims, ())
    assert credit._generations[-1] == {"of 3.0": (1, 0.0), "of 2.0": (1, 1.0)}


def test_runs_that_did_not_note_their_credit_go_on_by_the_archive(toy, tmp_path):
    recipe = toy(recipe="[search]\nadapt = true\ncredit = 'archive'\n", generations=5)
    run(recipe, tmp_path / "whole", workers=0)
    out = tmp_path / "older"
    run(recipe, out, workers=0, generations=2)
    path = out / "provenance.json"
    told = unsealed(path)
    for key in ("credit", "births", "tournament", "steer"):
        del told["recipe"]["search"][key]
    path.write_text(json.dumps(told))
    text = (out / "recipe.toml").read_text()
    assert "credit" in text
    (out / "recipe.toml").write_text(text.replace("credit = 'archive'\n", ""))
    with Search.resume(out, generations=5, workers=0, accept_changes=True) as search:
        assert search.recipe.search.credit == "archive"
        for _ in search:
            pass
    assert rows(out) == rows(tmp_path / "whole")


def test_events_are_gone_through_once_however_many_generations(toy, tmp_path):
    """Each generation tells one: of 10 000 that would be 10⁸ looks."""
    run(toy(recipe="[search]\nadapt = true\n"), tmp_path / "run", workers=0, generations=3)
    looks = 0

    class Births(list):
        def __iter__(self):
            nonlocal looks
            looks += len(self)
            return super().__iter__()

    found = RunLog(tmp_path / "run")
    events = Births(found.events() + [{"event": "weights", "generation": k} for k in range(1000)])
    credit_of(found, aims_of_run(found), events)
    assert looks == len(events)


@pytest.mark.slow
def test_what_was_earned_is_taken_up_again(toy, tmp_path):
    recipe = toy(recipe="[search]\nadapt = true\n" + SUMMED, generations=5)
    assert read_recipe(recipe).search.settings["adapt"] is True
    asked = {2: [Reweight(weights={"gsi": 30.0, "mutation": 1})]}
    steered(recipe, tmp_path / "whole", asked)
    expected = rows(tmp_path / "whole")
    steered(recipe, tmp_path / "two", asked, workers=2)
    assert rows(tmp_path / "two") == expected
    for last in (0, 2, 3):
        out = tmp_path / f"stopped-{last}"
        steered(recipe, out, asked, stop_after=last)
        with Search.resume(out, workers=0) as search:
            for generation in search:
                search.flush()
                for command in asked.get(generation.number, ()):
                    commands.send(out, command)
        assert rows(out) == expected
    told = [one["weights"] for one in events(tmp_path / "whole", "weights")]
    assert len(told) == 5
    assert any(one != told[0] for one in told)
    run(toy(recipe=SUMMED, generations=5), tmp_path / "plain", workers=0)
    assert not events(tmp_path / "plain", "weights")


@pytest.mark.parametrize("count", [0, 3])
def test_no_births_teach_nothing(count):
    credit = Credit()
    for _ in range(count):
        credit.learn([], AIMS, ())
    assert credit.factors(["a"]) == {"a": 1.0}
