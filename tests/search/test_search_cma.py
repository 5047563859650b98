"""MO-CMA-ES: fields that learn, and a state that the log gives back."""

import random

import numpy as np
import pytest
from test_search_recipe import faults, replaced
from test_search_run import rows, run

from evocity import open_run
from evocity.errors import RunError
from evocity.search import Search, read_recipe
from evocity.search.record import commands
from evocity.search.record.commands import Pick
from evocity.selection.algorithms import algorithms
from evocity.selection.backends.deap import Covariances
from evocity.selection.individual import Individual

Cma = algorithms()["cma"]
CMA = '[search]\nalgorithm = "cma"\nside = 3\n'


class Named:
    def __init__(self, digest):
        self.digest = digest


def searched(goals, generations, size=12, side=2, seed=0):
    """The losses of those who live in turn, of a search of which ``goals`` tell the losses and the
    violation of a vector."""
    one = Cma(size, Cma.Keys(side=side))
    living, past = [], []
    for generation in range(generations):
        told = one.settings(generation * size, 2, np.random.default_rng([seed, generation]))
        born = []
        for slot, settings in enumerate(told):
            vector = np.array(settings["values"])
            assert vector.shape == (side**2,)
            assert ((vector >= 0) & (vector <= 1)).all()
            losses, violation = goals(vector)
            number = generation * size + slot
            born.append(Individual(number, Named(str(number)), {}, losses, violation))
        living = one.survivors([*living, *born], None, np.random.default_rng(0))
        past.append(living)
    return past


def two(vector):
    """Two goals in conflict along one line, for which all but the first value should be .7."""
    off = float(((vector[1:] - 0.7) ** 2).sum())
    return (float(vector[0] ** 2) + off, float((vector[0] - 1) ** 2) + off), 0.0


def test_it_finds_the_front_between_two_goals():
    past = searched(two, 60)
    first, last = (np.array([one.losses for one in past[k]]) for k in (0, -1))
    true = np.linspace(0, 1, 101)
    front = np.stack([true**2, (true - 1) ** 2], axis=1)

    def igd(found):
        return np.linalg.norm(front[:, None] - found[None], axis=2).min(axis=1).mean()

    assert igd(last) < 0.07 < 0.2 < igd(first)
    assert len(past[-1]) == 12


def test_steps_shrink_as_it_converges():
    past = searched(lambda v: ((float(((v - 0.4) ** 2).sum()),), 0.0), 80)
    steps = [np.median([one.marks["step"] for one in past[k]]) for k in (0, -1)]
    assert steps[1] < 0.5 * steps[0]
    assert min(one.losses[0] for one in past[-1]) < 2e-3


def test_whoever_breaks_a_constraint_comes_after_all_others():
    past = searched(lambda v: (two(v)[0], max(0.0, 0.5 - float(v[1]))), 30)
    assert any(one.violation for one in past[0])
    assert not any(one.violation for one in past[-1])


def test_the_global_generators_are_left_as_they_were():
    before = random.getstate(), np.random.get_state()[1].tolist()  # noqa: NPY002
    past = [searched(two, 3, seed=seed) for seed in (1, 1, 2)]
    losses = [[one.losses for one in each[-1]] for each in past]
    assert losses[0] == losses[1] != losses[2]
    assert before == (random.getstate(), np.random.get_state()[1].tolist())  # noqa: NPY002


def test_who_is_selected_is_told_by_number():
    vectors = np.random.default_rng(3).random((4, 5))
    search = Covariances(vectors, np.arange(8.0).reshape(4, 2), 0.1, lambda front: 0)
    assert search.offspring(np.random.default_rng(1)).shape == (4, 5)
    better = np.full((4, 2), -1.0)
    better[2] = 99
    assert sorted(search.select(better)) == [0, 4, 5, 7]
    assert len(search.steps) == 4


# -- in a run -------------------------------------------------------------------------------------


def recipe_of(toy, **settings):
    return replaced(toy(**settings), "[[fitness]]", CMA + "[[fitness]]", count=1)


@pytest.mark.slow
def test_a_run_goes_on_as_if_it_had_not_stopped(toy, tmp_path):
    recipe = recipe_of(toy, generations=4)
    run(recipe, tmp_path / "whole", workers=0)
    expected = rows(tmp_path / "whole")
    run(recipe, tmp_path / "two", workers=2)
    assert rows(tmp_path / "two") == expected
    for last in range(4):
        out = tmp_path / f"to-{last}"
        run(recipe, out, workers=0, generations=last)
        with Search.resume(out, workers=0, generations=4) as search:
            list(search)
        assert rows(out) == expected
    births = open_run(tmp_path / "whole").births().to_pylist()
    assert {one["operator"] for one in births[2:]} == {"lambda_field"}
    assert all(one["parents"] == [0, 1] for one in births[2:])
    members = open_run(tmp_path / "whole").members()
    assert (members["step"].to_numpy() > 0).all()
    assert 1 not in members["id"].to_pylist()  # the second source is no field


def test_nothing_can_be_picked(toy, tmp_path):
    out = tmp_path / "run"
    run(recipe_of(toy, generations=1), out, workers=0)
    with pytest.raises(RunError, match="cma chooses all parents"):
        commands.send(out, Pick(ids=(1,)))
    with Search.resume(out, workers=0, generations=2) as search:
        search.pick([2])
        list(search)
    refused = [one for one in open_run(out).events() if one["event"] == "command refused"]
    assert "chooses all parents" in refused[0]["reason"]


def test_fields_that_cannot_be_are_faults(toy):
    path = recipe_of(toy)
    path.write_text(path.read_text().replace('[[parents]]\nmap = "right.npy"\n', ""))
    (line,) = faults(path)
    assert "2 or more" in line
    path = recipe_of(toy)
    path.write_text(path.read_text().replace("side = 3", "side = 17"))
    assert "16 or less" in faults(path)[0]
    many = '[[parents]]\nmap = "right.npy"\n'
    text = recipe_of(toy).read_text().replace(many, 5 * many).replace("side = 3", "side = 9")
    path.write_text(text)
    assert any("405 values for 6 parents" in line for line in faults(path))
    assert read_recipe(recipe_of(toy)).breeding == ["lambda_field"]
