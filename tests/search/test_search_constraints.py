"""Constraints, weighted sums, and measures that ask for genome and parents, in whole runs."""

import re

import numpy as np
import pytest

from evocity.errors import RecipeError
from evocity.evaluation.evaluator import Evaluator
from evocity.search import Search, read_recipe
from evocity.search.preparation import preparation
from evocity.store import RunLog

HEREDITY = """
import evocity
import numpy as np

@evocity.fitness(goal="max")
def litter(city, genome, parents):
    assert genome.pavement == parents[0].pavement
    return len(parents) + np.abs(genome.sigma).mean()

@evocity.fitness(numbers=("low", "high"), unit="m")
def roofs(city):
    return {"low": city.heights.min(), "high": city.heights.max()}
"""


COUNTED = """
import pathlib
import evocity

def note(what):
    with (pathlib.Path(__file__).parent / "calls").open("a") as notes:
        notes.write(what + "\\n")

note("loaded")

@evocity.fitness(numbers=("one", "two"))
def both(city):
    note("called")
    return {"one": 1.0, "two": city.heights.max()}
"""


@pytest.fixture
def bounded(toy):
    """The toy recipe, with roof no objective but bounded so that some break it."""

    def write(entries, **options):
        path = toy(**options)
        text = path.read_text(encoding="utf-8")
        head, tail = text.split('[[fitness]]\nfile = "toys.py"\n')
        path.write_text(head + entries + tail, encoding="utf-8")
        (path.parent / "heredity.py").write_text(HEREDITY, encoding="utf-8")
        return path

    return write


ROOF = """
[[fitness]]
file = "toys.py"
name = "spread"
[[fitness]]
file = "toys.py"
name = "roof"
max = {limit}
"""


def carried_out(recipe, out, **overrides):
    with Search(read_recipe(recipe, **overrides), out=out, workers=0) as search:
        return list(search)


def test_those_that_break_a_constraint_lose_to_those_that_do_not(bounded, tmp_path):
    free = carried_out(bounded(ROOF.format(limit=1000)), tmp_path / "free")
    roofs = [one.values["roof"] for one in free[0].population]
    limit = float(np.median(roofs))
    last = carried_out(bounded(ROOF.format(limit=limit)), tmp_path / "bound")[-1]
    births = RunLog(tmp_path / "bound").births(columns=["id", "fitness.roof", "feasible"])
    told = {row["id"]: row for row in births.to_pylist()}
    assert {row["feasible"] for row in told.values()} == {True, False}
    for row in told.values():
        assert row["feasible"] == (row["fitness.roof"] <= limit)
    broken = [one.violation > 0 for one in last.population]
    assert broken == sorted(broken)  # those that keep it come first
    assert sum(row["feasible"] for row in told.values()) < len(last.population) or not any(broken)
    assert list(last.best) == ["spread"]  # a constraint is kept or not, and nobody's best
    assert len(last.population[0].losses) == 1


def test_a_bounded_run_resumes_to_the_same_rows(bounded, tmp_path):
    recipe = bounded(ROOF.format(limit=5))
    carried_out(recipe, tmp_path / "whole", generations=3)
    carried_out(recipe, tmp_path / "parts", generations=1)
    with Search.resume(tmp_path / "parts", generations=3, workers=0) as search:
        list(search)
    rows = [
        RunLog(tmp_path / name).births().drop_columns(["seconds"]).to_pylist()
        for name in ("whole", "parts")
    ]
    assert rows[0] == rows[1]
    noted = RunLog(tmp_path / "whole").provenance["fitness"]
    assert [(one["goal"], one.get("max")) for one in noted] == [("max", None), (None, 5.0)]


def test_weighted_measures_are_one_objective(bounded, tmp_path):
    entries = """
[[fitness]]
file = "toys.py"
name = "spread"
weight = 2
[[fitness]]
file = "toys.py"
name = "roof"
weight = 0.5
[[fitness]]
name = "gsi"
target = 0.4
"""
    last = carried_out(bounded(entries), tmp_path / "run")[-1]
    for one in last.population:
        both = -2 * one.values["spread"] + 0.5 * one.values["roof"]
        assert one.losses == pytest.approx((both, abs(one.values["gsi"] - 0.4)))
    noted = RunLog(tmp_path / "run").provenance["fitness"]
    assert [one.get("objective") for one in noted] == ["weighted sum", "weighted sum", None]


def test_it_is_told_where_nobody_keeps_the_constraints(bounded, tmp_path):
    from click.testing import CliRunner

    from evocity.cli import main

    recipe = bounded(ROOF.format(limit=0.001))
    told = CliRunner().invoke(main, ["run", str(recipe), "--out", str(tmp_path / "run")])
    assert told.exit_code == 0, told.output
    assert "0 of 8 living keep the constraints" in told.output
    status = CliRunner().invoke(main, ["status", str(tmp_path / "run")]).output
    assert "kept by 0 of 8 living: roof at most 0.001 m" in status
    assert "best spread" in status
    assert "best roof" not in status
    report = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert re.search(r"break a constraint(</abbr>)?</dt>\s*<dd>8 of 8", report)
    assert report.count("It breaks the bounds: roof at most 0.001 m.") >= 1
    assert "best spread" in report
    assert "best roof" not in report


def test_a_file_of_measures_is_executed_once_a_worker(bounded, tmp_path):
    entries = '[[fitness]]\nfile = "counted.py"\nname = "both"\ngoal = "min"\n'
    recipe = bounded(entries)
    (recipe.parent / "counted.py").write_text(COUNTED, encoding="utf-8")
    search = read_recipe(recipe)
    prepared = preparation.prepare(search)
    before = (recipe.parent / "calls").read_text()
    evaluator = Evaluator(prepared.setup)
    outcome = evaluator.evaluate(prepared.sources[0].genome)
    assert outcome.status == "ok"
    calls = (recipe.parent / "calls").read_text().removeprefix(before)
    assert calls == "loaded\ncalled\n"


def test_a_measure_gets_the_genome_and_the_parents_it_asks_for(bounded, tmp_path):
    entries = """
[[fitness]]
file = "heredity.py"
name = "litter"
[[fitness]]
file = "heredity.py"
name = "roofs.high"
goal = "min"
"""
    carried_out(bounded(entries), tmp_path / "run")
    run = RunLog(tmp_path / "run")
    columns = ["id", "parents", "fitness.litter", "fitness.roofs.high", "generation"]
    for row in run.births(columns=columns).to_pylist():
        one = run.individuals([row["id"]])[0].genome
        parents = len(row["parents"]) or 1  # a source is its own parent
        assert row["fitness.litter"] == pytest.approx(parents + np.abs(one.sigma).mean())
        assert row["fitness.roofs.high"] > 0


@pytest.mark.parametrize(
    ("entries", "told"),
    [
        ('[[fitness]]\nname = "gsi"\nmin = 0.4\nmax = 0.2\n', "min = 0.4, max = 0.2"),
        ('[[fitness]]\nname = "gsi"\nmax = 0.2\n', "only constraints"),
        (
            '[[fitness]]\nname = "gsi"\nmin = 1.5\n',
            "min = 1.5 lies outside the range of gsi.*a bound from 0 to 1",
        ),
        ('[[fitness]]\nname = "crumbs"\nobjective = "a\\u001b"\n', "cannot be the name of a"),
        (
            '[[fitness]]\nfile = "heredity.py"\nname = "litter"\nlike = "lyon-1er"\n',
            "like for litter, which needs genome and parents",
        ),
        ('[[fitness]]\nname = "gsi"\nweight = 2\n', "gsi has no default goal"),
        ('[[fitness]]\nname = "gsi"\ntarget = 1\nweight = -2\n', r"weight \(gsi\): -2"),
        (
            '[[fitness]]\nfile = "heredity.py"\nname = "roofs"\nmax = 9\n',
            "the key 'max' needs one measure, but this entry has several: roofs",
        ),
        ('[[fitness]]\nfile = "heredity.py"\nname = "rofs"\n', "name = 'rofs'"),
        (
            '[[fitness]]\nname = "crumbs"\nobjective = "crumbs"\n',
            "objective = 'crumbs', which is a measure",
        ),
    ],
)
def test_wants_that_cannot_be_meant_are_faults(bounded, entries, told):
    with pytest.raises(RecipeError, match=told):
        read_recipe(bounded(entries))
