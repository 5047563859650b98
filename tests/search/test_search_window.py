"""Steady state in an ordered window: who is bred from whom, whoever is done first."""

import sys
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import evocity
from evocity.errors import RecipeError, RunError
from evocity.evaluation import Here
from evocity.search import Search, read_recipe
from evocity.search.breeding.archipelago import Archipelago
from evocity.search.breeding.birth_plans import UNGUIDED
from evocity.search.breeding.births import stream_offspring
from evocity.search.preparation.preparation import prepare
from evocity.search.preparation.startup import Crew, start_engine
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.search.schedules import SteadyState

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from _virtual import Virtual, uneven

COLUMNS = ["generation", "id", "parents", "operator", "status", "genome", "made", "fitness.spread"]


def windowed(toy, window, search="", total=None, **settings):
    """A recipe of 6 births a generation, and so many generations; ``total``: the name of the sum
    of all goals."""
    recipe = f"[search]\nwindow = {window}\n{search}"
    path = toy(**({"population": 6, "generations": 4} | settings), recipe=recipe)
    if total is not None:
        text = path.read_text()
        path.write_text(
            text.replace('file = "toys.py"', f'file = "toys.py"\nobjective = "{total}"')
        )
    return read_recipe(str(path))


def simulated(workers, seconds=None):
    """In place of the search's engine: so many simulated workers."""

    def make(prepared, count, *others, **more):
        inner = start_engine(prepared, Crew(0), *others, **more)
        return Virtual(inner, workers, seconds or uneven())

    return patch("evocity.search.engine.start_engine", make)


def rows(path):
    run = evocity.open_run(path)
    return run.births(columns=COLUMNS).to_pylist(), [
        run.members(g).to_pylist() for g in run.generations
    ]


def bred(recipe, out, workers=0):
    with Search(recipe, out, workers=workers) as search:
        for _ in search:
            pass
    return rows(out)


def keeps_the_law(births, window, population=6):
    for row in births:
        if row["id"] < max(window, population):  # the sources are the births 0 and 1
            assert all(parent < 2 for parent in row["parents"])
        else:
            assert all(parent <= row["id"] - window for parent in row["parents"])


@pytest.mark.slow_cases("1", "6", "15")
@pytest.mark.parametrize("window", [1, 4, 6, 15])
def test_the_same_births_of_any_number_of_workers(toy, tmp_path, window):
    recipe = windowed(toy, window)
    expected = bred(recipe, tmp_path / "here")
    keeps_the_law(expected[0], window)
    assert any(max(row["parents"], default=0) >= 6 for row in expected[0])
    for workers in (1, 4, 16):
        with simulated(workers):
            assert bred(recipe, tmp_path / f"simulated-{workers}") == expected


@pytest.mark.parametrize("workers", [2, *(pytest.param(n, marks=pytest.mark.long) for n in (1, 4))])
def test_the_same_births_of_worker_processes(toy, tmp_path, workers):
    recipe = windowed(toy, 5)
    assert bred(recipe, tmp_path / "here") == bred(recipe, tmp_path / "workers", workers)


# -- a planner that does one after the other ------------------------------------------------------


class Shuffled:
    """An engine that has up to so many jobs at work, of which one drawn is done next."""

    def __init__(self, inner, room, rng):
        self._inner, self._room, self._rng = inner, room, rng

    def stream(self, method, jobs):
        at_work, number, ended = [], 0, False
        while True:
            while not ended and len(at_work) < self._room:
                job = next(jobs, "end")
                ended = job == "end"
                if job is None or ended:
                    break
                at_work.append((number, job))
                number += 1
            if not at_work:
                return
            done, job = at_work.pop(self._rng.integers(len(at_work)))
            yield done, self._inner.run(method, [job])[0]


def one_by_one(prepared, engine, total):
    """The births as the law says, each bred only when it is planned."""
    population, window = Archipelago(prepared), prepared.recipe.search.window
    island = population.single
    size = prepared.recipe.run.population
    births = [
        one.birth(0, prepared.aims)
        for one in stream_offspring(engine, iter(population.plans(0, UNGUIDED)))
    ]
    population.begin_with(births)
    let_in = 0
    for identifier in range(size, total):
        while let_in <= identifier - window:
            island.admit_birth(births[let_in])
            let_in += 1
        if identifier < window:
            plan = island.founder_plan(identifier)
        else:
            plan = island.plan(identifier, UNGUIDED)
        (one,) = stream_offspring(engine, iter([plan]))
        births.append(one.birth(identifier // size, prepared.aims))
    for birth in births[let_in:]:
        island.admit_birth(birth)
    return births, population.members


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    from toy_runs import write_toy

    recipe = read_recipe(str(write_toy(tmp_path_factory.mktemp("toy"), population=5)))
    return prepare(recipe)


def with_window(prepared, window, generations):
    recipe = prepared.recipe
    search = recipe.search.model_copy(update={"window": window})
    run = recipe.run.model_copy(update={"generations": generations})
    copy = recipe.model_copy(update={"search": search, "run": run})
    return replace(prepared, recipe=copy)


@pytest.mark.slow
@given(window=st.integers(1, 14), room=st.integers(1, 20), seed=st.integers(0, 2**32))
@settings(max_examples=12, deadline=None)
def test_whoever_is_done_first_the_births_are_those_of_one_by_one(prepared, window, room, seed):
    given_, total = with_window(prepared, window, 2), 15
    here = Here(given_.setup)
    engine = Shuffled(here, room, np.random.default_rng(seed))
    steady = SteadyState(given_, Archipelago(given_), engine)
    births = [birth for number in range(3) for birth in steady.births(number, UNGUIDED)]
    expected, members = one_by_one(given_, here, total)
    assert [(b.id, b.parents, b.operator, b.genome.digest, b.values) for b in births] == [
        (b.id, b.parents, b.operator, b.genome.digest, b.values) for b in expected
    ]
    assert steady.population.members == members


# -- taken up again -------------------------------------------------------------------------------


class Killed(BaseException):
    """As sudden as a kill."""


def killing(after, workers=3):
    """Simulated workers that go on no longer than so many jobs."""
    left = [after]

    def seconds(outcome, rng):
        left[0] -= 1
        if left[0] < 0:
            raise Killed
        return uneven()(outcome, rng)

    return simulated(workers, seconds)


def resumed(path, **more):
    with Search.resume(path, workers=0, **more) as search:
        for _ in search:
            pass
    return rows(path)


ADAPT = "adapt = true\n"
KILLED_TOO = [(2, ""), (2, ADAPT), (6, ADAPT), (13, "")]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("window", "adapt"),
    [
        (6, ""),
        (13, ADAPT),
        *(pytest.param(*one, marks=pytest.mark.long) for one in KILLED_TOO),
    ],
)
def test_a_run_that_was_killed_goes_on_to_the_same_births(toy, tmp_path, window, adapt):
    recipe = windowed(toy, window, adapt, generations=5)
    expected = bred(recipe, tmp_path / "whole")
    moments = np.random.default_rng(window).choice(36, 4, replace=False)
    for moment in moments.tolist():
        out = tmp_path / f"killed-{moment}"
        with killing(moment), pytest.raises(Killed):
            bred(recipe, out)
        assert resumed(out) == expected
    out = tmp_path / "twice"
    for moment in (9, 12):
        with killing(moment), pytest.raises(Killed):
            resumed(out) if out.exists() else bred(recipe, out)
    assert resumed(out) == expected


def test_more_generations_go_on_as_if_they_had_been_asked_for(toy, tmp_path):
    recipe, longer = windowed(toy, 9, generations=2), windowed(toy, 9, generations=4)
    bred(recipe, tmp_path / "short")
    assert resumed(tmp_path / "short", generations=4) == bred(longer, tmp_path / "long")


# -- what is asked of a run -----------------------------------------------------------------------


def asking(recipe, out, ask, at=1):
    with Search(recipe, out, workers=0) as search:
        for generation in search:
            if generation.number == at:
                search.flush()
                ask(search)
    return rows(out)


def drawn_again(path):
    """All births of a run are planned again as they were."""
    run = evocity.open_run(path)
    prepared, _ = read_preparation(run)
    for row in run.births(columns=["id", "parents"]).to_pylist():
        assert list(plan_of(run, prepared, row["id"]).parents) == row["parents"]


@pytest.mark.slow
@pytest.mark.parametrize("window", [4, 8])
def test_commands_count_from_a_window_after_the_block_that_they_precede(toy, tmp_path, window):
    recipe = windowed(toy, window, "adapt = true\n")
    plain, _ = bred(recipe, tmp_path / "plain")
    steered, members = asking(
        recipe,
        tmp_path / "steered",
        lambda search: (search.pick([1], share=1.0), search.reweight(mutation=0)),
    )
    first = 2 * 6 + window  # they were carried out before block 2
    assert steered[:first] == plain[:first]
    assert all(row["parents"][0] == 1 for row in steered[first:])
    assert "mutation" not in {row["operator"] for row in steered[first:]}
    drawn_again(tmp_path / "steered")
    # killed in the block after, and taken up again
    out, asked = tmp_path / "killed", []

    def ask(search):
        search.pick([1], share=1.0)
        search.reweight(mutation=0)

    with killing(2 * 6 + window + 3), pytest.raises(Killed):
        asking(recipe, out, ask)
    assert resumed(out) == (steered, members), asked


def test_a_stop_ends_after_the_block(toy, tmp_path):
    recipe = windowed(toy, 9)
    births, _ = asking(recipe, tmp_path / "run", lambda search: search.stop())
    assert births[-1]["id"] == 11
    assert resumed(tmp_path / "run") == bred(recipe, tmp_path / "whole")


WAYS = {
    "nsga2": ("algorithm = 'nsga2'\n", {}),
    "nsga3": ("algorithm = 'nsga3'\n", {}),
    "map_elites": (
        "algorithm = 'map_elites'\ndescriptors = ['gsi', 'alignment']\n"
        "ranges = [[0.1, 0.9], [0.1, 0.9]]\ngrid = [5, 5]\n",
        {"total": "worth"},
    ),
    "single": ("algorithm = 'single'\n", {"total": "worth"}),
    "refined": ("[refine]\nbirths = 2\nevery = 2\nbudget = 4\n", {}),
    "all that differ": ("distinct = 1.0\n", {}),
}


@pytest.mark.slow_cases("nsga3", "map_elites", "single", "refined", "all that differ")
@pytest.mark.parametrize("way", WAYS)
def test_algorithms_let_births_in_one_by_one(toy, tmp_path, way):
    search, asked = WAYS[way]
    recipe = windowed(toy, 4, search, generations=3, **asked)
    expected = bred(recipe, tmp_path / "here")
    keeps_the_law(expected[0], 4)
    with simulated(5):
        assert bred(recipe, tmp_path / "simulated") == expected
    drawn_again(tmp_path / "here")
    with killing(15), pytest.raises(Killed):
        bred(recipe, tmp_path / "killed")
    assert resumed(tmp_path / "killed") == expected
    if way == "refined":
        found = [row["id"] for row in expected[0] if row["operator"] == "refinement"]
        assert found == [16, 17]


# -- failures -------------------------------------------------------------------------------------


def test_nobody_to_breed_from_makes_more_founders(toy, tmp_path):
    """The first births fail: those planned of nobody are founders too."""
    fails = """
@evocity.fitness(goal="max")
def late(city, genome, parents):
    with open(__file__ + ".count", "a") as file:
        file.write(".")
    if os.path.getsize(__file__ + ".count") <= 4:
        raise ValueError("early")
    return 1.0
"""
    recipe = windowed(toy, 6, measures=fails, max_failures=0.9)
    births, _ = bred(recipe, tmp_path / "run")
    assert [row["status"] for row in births[:6]] == ["error"] * 4 + ["ok"] * 2
    assert all(set(row["parents"]) <= {0, 1} for row in births[:10])
    assert {row["operator"] for row in births[6:10]} <= {"pavement_fusion", "mutation"}
    assert all(min(row["parents"]) >= 4 for row in births[10:] if row["parents"])


def test_one_that_hangs_costs_itself_alone_and_others_go_on(toy, tmp_path):
    hangs = """
@evocity.fitness(goal="max")
def slow(city):
    if number(city) % 9 == 0:
        time.sleep(60)
    return 1.0
"""
    recipe = windowed(toy, 8, measures=hangs, timeout=1.0, max_failures=1.0)
    births, _ = bred(recipe, tmp_path / "run", workers=2)
    lost = [row for row in births if row["status"] == "timeout"]
    assert lost
    assert all(row["genome"] for row in lost)
    assert {row["status"] for row in births} == {"ok", "timeout"}
    keeps_the_law(births, 8)
    never = {row["id"] for row in lost}
    assert not any(never.intersection(row["parents"]) for row in births)


def test_what_does_not_go_with_a_window_is_refused(toy, tmp_path, finished_runs):
    with pytest.raises(RecipeError, match=r"search\.window: 4, with the algorithm 'cma'"):
        windowed(toy, 4, "algorithm = 'cma'\n")
    with pytest.raises(RecipeError, match=r"search\.window: 0"):
        windowed(toy, 0)
    recipe = windowed(toy, 4)
    with Search(recipe, workers=0) as search, pytest.raises(RunError, match="window = 4"):
        search.ask()
    out = finished_runs.copy("window", tmp_path)
    text = (out / "recipe.toml").read_text()
    (out / "recipe.toml").write_text(text.replace("window = 4", "window = 5"))
    with pytest.raises(RunError, match=r"search\.window was 4 and is now 5"):
        Search.resume(out, generations=5, workers=0, accept_changes=True)


# -- how busy workers are -------------------------------------------------------------------------


@pytest.mark.slow
def test_sixteen_workers_are_busy_in_a_window_and_wait_between_generations():
    """On a virtual clock: evaluations are uneven, and one in a hundred hangs to its deadline."""
    from steady import searched

    generational, _ = searched(16, None, 12)
    windowed_, _ = searched(16, 128, 12)
    assert generational.busy_share < 0.6
    assert windowed_.busy_share >= 0.85
