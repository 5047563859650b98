"""DEAP's own algorithms on city genomes."""

import copy
import random

import numpy as np
import pytest
from deap import algorithms, tools

import evocity
from evocity.errors import OperatorError
from evocity.fitness import get
from evocity.search import Search, read_recipe
from evocity.search.toolbox import BROKEN, FAILED, City


@pytest.fixture
def toolbox(toy):
    with evocity.deap_toolbox(read_recipe(toy(recipe=BOUND)), workers=0) as box:
        yield box


BOUND = '[[fitness]]\nname = "gsi"\nmin = 0.3\n'


def evolved(box, algorithm, seed=1, **how):
    random.seed(seed)
    population, log = algorithm(box.population(n=8), box, verbose=False, **how)
    return population, log


@pytest.mark.parametrize(
    ("algorithm", "how"),
    [
        (algorithms.eaSimple, {"cxpb": 0.6, "mutpb": 0.4, "ngen": 2}),
        (algorithms.eaMuPlusLambda, {"mu": 8, "lambda_": 8, "cxpb": 0.6, "mutpb": 0.3, "ngen": 3}),
        (algorithms.eaMuCommaLambda, {"mu": 6, "lambda_": 8, "cxpb": 0.6, "mutpb": 0.4, "ngen": 3}),
    ],
    ids=lambda one: getattr(one, "__name__", ""),
)
def test_any_algorithm_of_deap_breeds_cities(toolbox, algorithm, how):
    hall = tools.ParetoFront()
    population, log = evolved(toolbox, algorithm, halloffame=hall, **how)
    assert log[-1]["gen"] == how["ngen"]
    assert {one.operator for one in population} - {None}
    for one in population:
        assert one.fitness.valid
        assert set(one.values) == {"spread", "roof", "gsi"}
        assert one.values["gsi"] == get("gsi")(one.city)
        broken = one.values["gsi"] < 0.3
        assert (one.fitness.values[0] >= BROKEN) is broken
        if not broken:
            assert one.fitness.values == (-one.values["spread"], one.values["roof"])
    assert all(not one.violation for one in hall) or all(one.violation for one in hall)


def test_the_workers_do_not_matter(toy):
    found = []
    for count in (0, 2):
        with evocity.deap_toolbox(read_recipe(toy()), workers=count) as box:
            how = {"mu": 8, "lambda_": 8, "cxpb": 0.7, "mutpb": 0.3, "ngen": 2}
            population, _ = evolved(box, algorithms.eaMuPlusLambda, **how)
            found.append([(one.genome.digest, one.fitness.values) for one in population])
    assert found[0] == found[1]


def test_founders_are_those_of_a_search(toolbox, toy):
    with Search(read_recipe(toy()), workers=0) as search:
        genomes = search.ask()
    assert [one.genome.digest for one in toolbox.population(n=8)] == [g.digest for g in genomes]
    assert toolbox.individual().genome.digest == genomes[0].digest
    assert toolbox.individual().genome.digest == genomes[1].digest
    assert len(toolbox.population()) == 8


def test_clones_are_apart(toolbox):
    one = toolbox.individual()
    one.fitness.values = toolbox.evaluate(one)
    other = toolbox.clone(one)
    assert other == one
    assert other.fitness.values == one.fitness.values
    del other.fitness.values
    assert one.fitness.valid
    assert copy.deepcopy(toolbox.individual()).fitness.valid is False


def test_children_of_children_that_were_not_evaluated(toolbox):
    first, second = toolbox.population(n=2)
    child, other = toolbox.mate(first, second)
    (mutant,) = toolbox.mutate(child)
    assert mutant.genome != child.genome
    losses = toolbox.map(toolbox.evaluate, [mutant, other, child])
    assert len(losses) == 3
    assert losses[2] == toolbox.evaluate(child)
    assert toolbox.map(len, ["a", "bc"]) == [1, 2]


def test_what_fails_is_worse_than_all_others(toy):
    body = """
@evocity.fitness(goal="max")
def picky(city):
    if number(city) % 2:
        raise ValueError("no")
    return 1.0
"""
    with evocity.deap_toolbox(read_recipe(toy(body)), workers=0) as box:
        population = box.population(n=8)
        for one, losses in zip(population, box.map(box.evaluate, population), strict=True):
            assert (losses == (FAILED,) * 3) is (one.error is not None)
        assert 0 < sum(one.error is not None for one in population) < 8


def test_an_operator_that_fails_costs_its_child(toolbox, monkeypatch):
    first, second = toolbox.population(n=2)
    child, _ = toolbox.mate(first, second)
    child.plan = (lambda parents, rng: 1 / 0), *child.plan[1:]
    child.plan[0].__name__ = "broken"
    assert toolbox.evaluate(child) == (FAILED,) * 2
    assert "ZeroDivisionError" in child.error
    with pytest.raises(OperatorError, match="ZeroDivisionError"):
        child.genome  # noqa: B018
    after, _ = toolbox.mate(child, second)  # nothing comes of it
    assert after == second


@pytest.mark.parametrize("values", [(1.0,), (1.0, np.nan), (1.0, 2.0, 3.0), "ab", None, 3.0])
def test_fitnesses_of_a_wrong_shape_are_told(toolbox, values):
    one = toolbox.individual()
    with pytest.raises(OperatorError, match="2 finite numbers, one for each goal"):
        one.fitness.values = values


def test_functions_that_return_something_else_are_told(toolbox):
    toolbox.register("mutate", lambda one: (3,))
    with pytest.raises((OperatorError, AttributeError)):
        evolved(toolbox, algorithms.eaMuPlusLambda, mu=8, lambda_=8, cxpb=0, mutpb=1, ngen=1)
    for call in (toolbox.evaluate, lambda one: toolbox.mate(one, one)):
        with pytest.raises(OperatorError, match="3 is not an individual"):
            call(3)
    toolbox.register("evaluate", lambda one: (1.0,))
    with pytest.raises(OperatorError, match="fitness values"):
        evolved(toolbox, algorithms.eaSimple, cxpb=0, mutpb=0, ngen=1)
    with pytest.raises(OperatorError, match="is not a recipe"):
        evocity.deap_toolbox("demo")


def test_a_recipe_without_a_crossing_says_so(toy):
    recipe = toy()
    text = recipe.read_text()
    start = text.index("pavement_fusion")
    recipe.write_text(text[:start] + text[text.index("mutation = 2") :])
    with evocity.deap_toolbox(read_recipe(recipe), workers=0) as box:
        with pytest.raises(OperatorError, match="an operator that breeds from two parents"):
            box.mate(*box.population(n=2))
        assert isinstance(box.mutate(box.individual())[0], City)
