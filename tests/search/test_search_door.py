"""What an operator of another package returns costs one birth at most, never the run."""

import json

import numpy as np
import pytest
from codes import uniformly
from test_search_run import rows, run

from evocity import operators
from evocity.citymap import CityMap
from evocity.errors import OperatorError
from evocity.evaluation.evaluator import admit
from evocity.search import Search, read_recipe
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog


@pytest.fixture
def prepared(toy):
    return prepare(read_recipe(toy()))


@pytest.fixture
def parent(prepared):
    return prepared.sources[0].genome


def of_side(side: int, name: str):
    lots = np.random.default_rng(side).integers(0, 3, (side // 4, side // 4)) * 5.0
    return uniformly(CityMap(lots.repeat(4, 0).repeat(4, 1), 2.0, name=name), reach=8).genome


def steeper(genome, sigma=1.5):
    changed = genome.sigma.copy()
    changed[~genome.uniform] = sigma
    return genome.replace(sigma=changed, sigma_max=2.0)


STRANGE = {
    "nothing": (lambda g: None, "a child that is None", "a Genome"),
    "another size": (
        lambda g: of_side(32, "left"),
        "a child of 32 × 32 px",
        "64 × 64 px, as the run",
    ),
    "another pixel size": (
        lambda g: g.replace(metres_per_pixel=1.0),
        "pixels of 1.0 m",
        "pixels of 2.0 m",
    ),
    "steep": (steeper, r"\|σ\| up to 1.5 in \d+ lifs", r"\|σ\| ≤ 0.9, the run's genome.sigma_max"),
    "unknown city": (
        lambda g: g.replace(cities=("atlantis", "right")),
        "cities 'atlantis'",
        "cities of the run: left, right",
    ),
    "tuple keys": (
        lambda g: g.replace(made={(1, 2): "a"}),
        "the record of a birth, with the key 'made', cannot be written as JSON "
        r"\(TypeError: keys must be",
        "a dictionary with texts as keys",
    ),
    "lone surrogate": (
        lambda g: g.replace(made={"name": "\ud800"}),
        "the record of a birth, with the key 'made', cannot be written as JSON",
        "a dictionary with texts as keys",
    ),
    "both": (
        lambda g: of_side(32, "left").replace(metres_per_pixel=9.0),
        "a child of 32 × 32 px; pixels of 9.0 m",
        "64 × 64 px, as the run; pixels of 2.0 m",
    ),
}


@pytest.mark.parametrize("kind", STRANGE)
def test_what_does_not_suit_the_run_is_named(prepared, parent, kind):
    make, found, expected = STRANGE[kind]
    with pytest.raises(OperatorError, match=found) as caught:
        admit(make(parent), prepared.header)
    assert caught.match(expected)


def test_what_suits_is_told_in_the_runs_terms(prepared, parent):
    child = parent.replace(
        sigma_max=5.0,  # a bound that no lifs of it needs
        cities=("right", "left"),
        made={"shares": (0.5, np.float32(0.25)), "grid": np.arange(2), 3: None},
    )
    genome = admit(child, prepared.header)
    assert genome == child
    assert genome.sigma_max == prepared.header.sigma_max
    assert genome.cities == ("left", "right")
    assert genome.made == {"shares": [0.5, 0.25], "grid": [0, 1], "3": None}
    assert json.loads(json.dumps(dict(genome.made))) == genome.made


class Strange:
    """An operator of another package: a good child, then each fault in turn."""

    name = "strange"
    parents = (1, 1)
    calls = 0

    def __call__(self, parents, rng):
        kinds = [lambda g: g.replace(beta=g.beta + 1, made={"shares": (1, 2)}), *FAULTY]
        Strange.calls += 1
        return kinds[Strange.calls % len(kinds)](parents[0])


FAULTY = [make for make, _, _ in STRANGE.values()]


def test_a_plugins_fault_costs_its_births_alone(toy, tmp_path, monkeypatch):
    monkeypatch.setitem(operators.OPERATORS, "strange", Strange)
    monkeypatch.setattr(Strange, "calls", 0)
    recipe = toy(population=20, generations=1, max_failures=0.95)
    recipe.write_text(recipe.read_text().replace("mutation = 2", "mutation = 2\nstrange = 20"))
    run(recipe, tmp_path / "run", workers=0)
    born = [one for one in rows(tmp_path / "run") if one.get("operator") == "strange"]
    failed = [one for one in born if one["status"] == "error"]
    assert len(failed) >= len(STRANGE)
    assert {one["status"] for one in born} == {"ok", "error"}
    assert all(one["error"].startswith("strange: ") for one in failed)
    assert all("(expected: " in one["error"] for one in failed)
    assert all(one["genome"] is None for one in failed)
    log = RunLog(tmp_path / "run")
    for birth in log.individuals(log.births()["id"].to_pylist()):  # all of it can be read
        assert birth.genome is None or birth.genome.sigma_max == 0.9
    with Search.resume(tmp_path / "run", generations=2, workers=0) as search:
        assert [one.number for one in search] == [2]
