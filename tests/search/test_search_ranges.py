"""Parameters of operators that each birth draws from a range: drawn within it, by the birth's own
generator, and told in `made`."""

import json

import numpy as np
import pytest
from test_search_recipe import faults, replaced
from test_search_run import rows, run

from evocity import operators
from evocity.errors import OperatorError
from evocity.operators import OPERATORS
from evocity.operators.parameters import number_of, wrong_types
from evocity.recipe.mixture import Drawn, Range
from evocity.search import Search, read_recipe
from evocity.search.breeding.birth_plans import founder_plans
from evocity.store import RunLog

RANGES = "fill = { from = 0.2, to = 0.6 }, size_max = { from = 3, to = 5 }"
MUTATION = (
    "mutation = { weight = 2, beta_step = { from = 0.5, to = 4 }, move = { from = 0, to = 2 } }"
)


def ranged(toy, **settings):
    path = replaced(toy(**settings), "size_max = 6", RANGES)
    return replaced(path, "mutation = 2", MUTATION)


def drawn(path, name) -> list[dict]:
    births = RunLog(path).births(columns=["operator", "made"]).to_pylist()
    return [json.loads(one["made"])["drawn"] for one in births if one["operator"] == name]


@pytest.mark.parametrize("whole", [False, True])
def test_both_ends_are_drawn_and_nothing_beyond_them(whole):
    rng = np.random.default_rng(1)
    values = [Range(2, 4, whole).draw(rng) for _ in range(300)]
    assert 2 <= min(values) <= max(values) <= 4
    assert {type(one) for one in values} == {int if whole else float}
    if whole:
        assert {values.count(number) > 60 for number in (2, 3, 4)} == {True}
    else:
        assert np.histogram(values, 4, (2, 4))[0].min() > 50
    assert Range(3, 3, whole).draw(rng) == 3


def test_each_birth_draws_its_own_and_tells_it(toy, tmp_path):
    run(ranged(toy, population=16), tmp_path / "run", workers=0)
    fusions, mutants = (drawn(tmp_path / "run", n) for n in ("pavement_fusion", "mutation"))
    assert min(len(fusions), len(mutants)) > 10
    assert all(set(one) == {"fill", "size_max"} for one in fusions)
    assert all(0.2 <= one["fill"] <= 0.6 for one in fusions)
    assert len({one["fill"] for one in fusions}) == len(fusions)
    assert {one["size_max"] for one in fusions} == {3, 4, 5}
    assert all(isinstance(one["size_max"], int) for one in fusions)
    assert {one["move"] for one in mutants} == {0, 1, 2}
    found = RunLog(tmp_path / "run")
    for row in found.births().to_pylist():
        genome = found.genome(row["id"])
        if row["operator"] == "pavement_fusion":
            told = genome.made["drawn"]["fill"]
            assert genome.made["fill"] == [round(1 - told, 4), round(told, 4)]
        elif row["operator"] == "lambda_crossover":
            assert "drawn" not in genome.made


@pytest.mark.slow
def test_births_do_not_depend_on_workers_nor_on_a_stop(toy, tmp_path):
    recipe = ranged(toy)
    run(recipe, tmp_path / "0", workers=0)
    for workers in (1, 2):
        run(recipe, tmp_path / f"{workers}", workers=workers)
        assert rows(tmp_path / f"{workers}") == rows(tmp_path / "0")
    with Search(read_recipe(recipe), tmp_path / "parted", workers=0) as search:
        next(iter(search))
    with Search.resume(tmp_path / "parted", workers=0) as search:
        list(search)
    assert rows(tmp_path / "parted") == rows(tmp_path / "0")


def test_a_range_of_one_value_is_that_value_but_for_the_draw(toy):
    """The operator gets what it would get from a recipe with the value, and no other parameter."""
    given = "fill = 0.3, size_max = 5"
    fixed = read_recipe(replaced(toy(), "size_max = 6", given))
    ends = "fill = { from = 0.3, to = 0.3 }, size_max = { from = 5, to = 5 }"
    recipe = read_recipe(replaced(toy(), "size_max = 6", ends))
    chosen = recipe.operator_drawn("pavement_fusion", np.random.default_rng(0))
    assert isinstance(chosen, Drawn)
    made = operators.make(chosen.name, **chosen.parameters, **chosen.drawn)
    assert made == fixed.operator("pavement_fusion") == recipe.operator("pavement_fusion")


def test_without_ranges_nothing_is_drawn(toy):
    recipe, rng = read_recipe(toy()), np.random.default_rng(5)
    before = rng.bit_generator.state
    assert recipe.operator_drawn("pavement_fusion", rng) == recipe.operator("pavement_fusion")
    assert rng.bit_generator.state == before


def test_a_list_keeps_its_meaning(toy):
    path = replaced(toy(), "size_max = 6", "fill = [0.2, 0.8]")
    chosen = read_recipe(path).operator_drawn("pavement_fusion", np.random.default_rng(0))
    assert chosen.fill == [0.2, 0.8]


def test_the_first_population_draws_its_fill_from_the_recipes_range(toy):
    recipe = read_recipe(ranged(toy, population=20))
    plans = founder_plans(recipe, ["left", "right"])
    fusions = [plan.operator for plan in plans if plan.name == "pavement_fusion"]
    assert len(fusions) == 12
    assert all(0.2 <= one.drawn["fill"] <= 0.6 for one in fusions)
    other = read_recipe(toy(population=20))
    plans = founder_plans(other, ["left", "right"])
    assert any(plan.operator.fill > 0.6 for plan in plans if plan.name == "pavement_fusion")


class Fussy:
    """An operator that refuses some values, as one of another package may, within its ends too."""

    name = "fussy"
    parents = (1, 1)

    def __init__(self, chance=0.5):
        if 0.4 < chance < 0.6:
            raise OperatorError("fussy: chance in the middle", "another", "choose one")

    def __call__(self, parents, rng):
        return parents[0].replace(sigma=parents[0].sigma * 0.9, made={"operator": "fussy"})


def test_a_value_that_an_operator_refuses_costs_its_birth(toy, tmp_path, monkeypatch):
    monkeypatch.setitem(operators.OPERATORS, "fussy", Fussy)
    path = toy(population=16, generations=1, max_failures=1.0)
    path = replaced(path, "mutation = 2", "fussy = { weight = 20, chance = { from = 0, to = 1 } }")
    run(path, tmp_path / "run", workers=0)
    told = {True: 0, False: 0}
    for one in RunLog(tmp_path / "run").births(1).to_pylist():
        if one["operator"] == "fussy":
            chance = json.loads(one["made"])["drawn"]["chance"]
            assert (one["status"] == "ok") != (0.4 < chance < 0.6)
            told[one["status"] == "ok"] += 1
    assert min(told.values()) > 0


def test_which_parameters_are_numbers():
    taken = {
        (name, key): number_of(kind, key)
        for name, kind in OPERATORS.items()
        for key in operators.parameters_of(kind)
    }
    assert taken["pavement_fusion", "fill"] is float
    assert taken["pavement_fusion", "size_max"] is int
    assert taken["mutation", "move"] is int
    assert taken["mutation", "reach"] is int
    assert taken["mutation", "repair"] is float
    for key in ("void", "places", "domains"):
        assert taken["pavement_fusion", key] is None
    for (name, key), number in taken.items():
        wrong = wrong_types(OPERATORS[name], {key: 0.5})
        assert (not wrong) == (number is float)


@pytest.mark.parametrize(
    ("given", "key", "says"),
    [
        ("fill = { from = 0.8, to = 0.2 }", "fill", "from = 0.8, to = 0.2; allowed: a from that"),
        ("fill = { from = 'low', to = 0.2 }", "fill.from", "'low'; allowed: a finite number"),
        ("fill = { from = true, to = 1 }", "fill.from", "True; allowed: a finite number"),
        ("fill = { from = 0, to = inf }", "fill.to", "inf; allowed: a finite number"),
        ("fill = { from = 0, to = nan }", "fill.to", "nan; allowed: a finite number"),
        ("fill = { from = 0, to = [1] }", "fill.to", "[1]; allowed: a finite number"),
        ("fill = { from = 0 }", "fill.to", "missing"),
        ("fill = {}", "fill.from", "missing"),
        ("fill = { from = 0, to = 1, step = 2 }", "fill.step", "unknown key; allowed: from, to"),
        ("fill = { form = 0, from = 0, to = 1 }", "fill.form", "did you mean from?"),
        ("fill = { from = -0.5, to = 0.8 }", "fill.from", "-0.5; allowed: "),
        ("fill = { from = 0.5, to = 1.8 }", "fill.to", "1.8; allowed: "),
        ("size_max = { from = 2.5, to = 8 }", "size_max.from", "2.5; allowed: a whole number"),
        ("void = { from = 0, to = 1 }", "void", "allowed: true or false"),
        ("positions = { from = 0, to = 1 }", "positions", "allowed: a list of lists of 2"),
        ("weight = { from = 0, to = 1 }", "weight", "a number"),
        ("parents = { from = 2, to = 3 }", "parents", "a whole number"),
        ("fil = { from = 0, to = 1 }", "fil", "did you mean fill?"),
        ("fill = { from = 0.2, to = 0.3 }, parents = 3", "fill.from", "3"),
        ("size_min = 6, size_max = { from = 4, to = 8 }", "size_max.from", "4; allowed: "),
    ],
)
def test_ranges_at_fault_are_told_at_their_keys(toy, given, key, says):
    path = replaced(toy(), "size_max = 6, size_min = 2", given)
    path.write_text(path.read_text().replace("weight = 4, weight", "weight"))
    line, *more = faults(path)
    assert line.startswith(f"operators.pavement_fusion.{key}: "), line
    assert says in line
    assert all(one.startswith("operators.pavement_fusion.fill.") for one in more)


def test_two_ranges_are_held_against_each_other(toy):
    given = "size_min = { from = 2, to = 8 }, size_max = { from = 5, to = 9 }"
    found = faults(replaced(toy(), "size_max = 6, size_min = 2", given))
    assert any(".size_m" in line for line in found)


def test_ranges_of_sizes_in_blocks_are_refused_of_leaves(toy):
    path = replaced(toy(genome=""), "size_max = 6", "size_max = { from = 6, to = 8 }")
    assert any("side_max = 48 (m, 6 range blocks" in line for line in faults(path))
