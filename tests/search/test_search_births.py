"""A birth in one job is the birth in two: the same bits, and the same to blame."""

import os
import time

import numpy as np
import pytest
from test_search_run import FAILING, rows, run

from evocity import operators
from evocity.evaluation.evaluator import Evaluator, Outcome
from evocity.search import Search, read_recipe
from evocity.search.breeding.birth_plans import BirthPlan
from evocity.search.breeding.births import stream_offspring, without_failed
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog

HEREDITY = """
@evocity.fitness(goal="max")
def kinship(city, genome, parents):
    return len(parents) + float(np.abs(genome.sigma).mean() - np.abs(parents[-1].sigma).mean())
"""


def in_two_steps(recipe, out, workers, **overrides):
    """The same search by ask() and tell(), each genome evaluated by a job of its own."""
    with Search(read_recipe(recipe, **overrides), out=out, workers=workers) as search:
        while not search.finished:
            search.ask()
            asked = without_failed(search._pending)
            jobs = [(o.breeding.genome, o.plan.genomes if o.plan.operator else ()) for o in asked]
            search.tell(search._pool.run("evaluate", jobs))


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_one_job_a_birth_or_two_the_births_are_the_same(toy, tmp_path, workers):
    recipe = toy("import numpy as np\n" + HEREDITY)
    run(recipe, tmp_path / "one", workers=workers)
    in_two_steps(recipe, tmp_path / "two", workers)
    assert rows(tmp_path / "one") == rows(tmp_path / "two")
    assert len(rows(tmp_path / "one")) == 4 * 8 * 2


@pytest.mark.slow
def test_whoever_hangs_or_dies_the_births_are_the_same(toy, tmp_path):
    recipe = toy(FAILING, population=16, generations=1, timeout=4.0, max_failures=0.9, workers=2)
    run(recipe, tmp_path / "one")
    in_two_steps(recipe, tmp_path / "two", None)
    one, two = rows(tmp_path / "one"), rows(tmp_path / "two")
    assert {row["status"] for row in one if "status" in row} >= {"ok", "timeout", "died"}
    lost = [row for row in one if row.get("status") in ("timeout", "died")]
    assert all(row["genome"] is not None for row in lost)
    assert repr(one) == repr(two)  # NaN is as NaN


class Hanging:
    """An operator that hangs, ends its process, or raises."""

    name = "hanging"
    parents = (1, 1)

    def __call__(self, parents, rng):
        fate = rng.integers(4)
        if fate == 0:
            time.sleep(1e6)
        if fate == 1:
            os._exit(3)
        raise ValueError("no child today")


@pytest.mark.slow
def test_a_failing_operator_is_to_blame_by_name(toy, tmp_path, monkeypatch):
    monkeypatch.setitem(operators.OPERATORS, "hanging", Hanging)
    recipe = toy(population=12, generations=1, timeout=2.0, max_failures=1.0, workers=2)
    text = recipe.read_text().replace("mutation = 2", "mutation = 0\nhanging = 9")
    recipe.write_text(text)
    run(recipe, tmp_path / "run")
    table = RunLog(tmp_path / "run").births(1)
    told = {row["status"]: row for row in table.to_pylist() if row["operator"] == "hanging"}
    assert set(told) == {"timeout", "died", "error"}
    assert told["timeout"]["error"] == "hanging: no result after 2 s"
    assert told["timeout"]["seconds"] == 2
    assert told["died"]["error"] == "hanging: the worker ended with exit code 3"
    assert "hanging: ValueError: no child today" in told["error"]["error"]
    assert all(row["genome"] is None for row in told.values())


def test_a_birth_that_is_lost_twice_is_told_as_the_second_loss():
    """Status, error and seconds are of one and the same attempt."""
    plan = BirthPlan(7, object(), (1,), (), np.random.default_rng(1))
    died = Outcome("died", "the worker ended with exit code 3", 0.25)
    late = Outcome("timeout", "no result after 3 s", 3.0)

    class Pool:
        def stream(self, method, jobs):
            next(jobs)
            yield 0, died
            next(jobs)
            yield 1, late

    (born,) = stream_offspring(Pool(), iter([plan]))
    assert (born.breeding, born.evaluation) == (late, None)


def test_born_is_breed_and_evaluate(toy):
    prepared = prepare(read_recipe(toy()))
    evaluator = Evaluator(prepared.setup)
    parents = [source.genome for source in prepared.sources]
    fuse = prepared.recipe.operator("pavement_fusion")
    at_once = evaluator.born(fuse, parents, np.random.default_rng(3))
    child = evaluator.breed(fuse, parents, np.random.default_rng(3)).genome
    assert at_once.genome == child
    assert at_once.values == evaluator.evaluate(child, parents).values
    assert at_once.status == "ok"
    founder = evaluator.born(None, parents[:1], np.random.default_rng(3))
    assert founder.genome is parents[0]
    assert founder.values == evaluator.evaluate(parents[0]).values
    failed = evaluator.born(fuse, parents[:1], np.random.default_rng(3))
    assert (failed.status, failed.genome, dict(failed.values)) == ("error", None, {})
