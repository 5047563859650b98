"""Births recomputed: the same bit for bit, or it is told what differs."""

import json
import shutil

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_search_commands import ASKED, steered
from test_search_islands import SUMS, THREE
from test_search_run import run

import evocity
from evocity.errors import RunError
from evocity.search import Search
from evocity.search.record.complete_run import differences
from evocity.store import Birth, RunLog

GSI = '[[fitness]]\nname = "gsi"\nweight = 20.0\nobjective = "form"\ntarget = 0.3\n'
FSI = '[[fitness]]\nname = "fsi"\nobjective = "form"\ntarget = 1.0\n'
REFINE = '[refine]\nbirths = 2\nevery = 2\nbudget = 6\nway = "heights"\nside = 2\n'
CELLS = '[search]\nalgorithm = "map_elites"\ndescriptors = ["gsi", "fsi"]\ngrid = [4, 4]\n'

DRAWS = """
import random
@evocity.fitness(goal="max")
def luck(city):
    return random.random()
"""
HANGS = """
@evocity.fitness(goal="max")
def slow(city):
    if number(city) % 5 == 0:
        time.sleep(60)
    return 1.0
@evocity.fitness(goal="max")
def shaky(city):
    if number(city) % 4 == 0:
        raise ValueError("no")
    return 1.0 if number(city) % 3 else float("nan")
"""


def all_the_same(path, **more):
    """Every birth of the run replays the same; the run stays as it is."""
    before = {one: one.read_bytes() for one in path.rglob("*") if one.is_file()}
    found = evocity.replay(path, **more)
    assert {one: one.read_bytes() for one in path.rglob("*") if one.is_file()} == before
    assert [one.id for one in found] == RunLog(path).births()["id"].to_pylist()
    assert [(one.id, one.differs, one.reason) for one in found if one.same is not True] == []


@pytest.mark.parametrize(
    "search",
    [
        '[search]\nalgorithm = "nsga2"\n',
        '[search]\nalgorithm = "nsga3"\n',
        '[search]\nalgorithm = "hypervolume"\nadapt = true\n',
        CELLS + GSI + FSI,
        GSI + FSI + REFINE,
        "[search]\nalgorithm = 'cma'\nside = 2\n",
        "[search]\nwindow = 5\n" + GSI + FSI + REFINE,
        "[search]\nwindow = 11\nadapt = true\n",
        THREE,
        SUMS,
    ],
)
def test_each_birth_is_the_same_once_more(toy, tmp_path, search):
    population = 15 if "islands" in search else 8
    recipe = toy(recipe=search, population=population)
    if "islands" not in search and "map_elites" in search:  # one goal: a sum
        text = recipe.read_text()
        recipe.write_text(text.replace('"toys.py"', '"toys.py"\nobjective = "form"'))
    run(recipe, tmp_path / "run", workers=0)
    all_the_same(tmp_path / "run")


@pytest.mark.slow_cases("[search]\\nwindow = 6\\n")
@pytest.mark.parametrize("search", ["", "[search]\nwindow = 6\n"])
def test_commands_and_resumes_are_replayed_too(toy, tmp_path, search):
    recipe = toy(recipe=search + GSI + FSI, generations=4)
    steered(recipe, tmp_path / "run", ASKED, stop_after=2)
    with Search.resume(tmp_path / "run", workers=0) as again:
        list(again)
    all_the_same(tmp_path / "run")


@pytest.mark.slow_cases("[search]\\nwindow = 6\\n")
@pytest.mark.parametrize("search", ["", "[search]\nwindow = 6\n"])
def test_births_before_another_recipe_are_drawn_by_the_recipe_of_then(toy, tmp_path, search):
    recipe = toy(recipe=search + GSI + FSI, generations=2)
    run(recipe, tmp_path / "run", workers=0)
    for change in (("mutation = 2", "mutation = 9"), ("size_max = 6", "size_max = 4")):
        recipe.write_text(recipe.read_text().replace(*change).replace("20.0", "3.0"))
        done = len(RunLog(tmp_path / "run").generations)
        with Search.resume(
            tmp_path / "run", workers=0, recipe=recipe, generations=done + 1
        ) as again:
            list(again)
    assert len(RunLog(tmp_path / "run").provenance["recipe"]["before"]) == 2
    all_the_same(tmp_path / "run")


@pytest.mark.slow
def test_births_that_failed_are_the_same_as_far_as_it_can_be_told(toy, tmp_path):
    recipe = toy(measures=HANGS, timeout=1.0, max_failures=1.0, generations=1, workers=2)
    run(recipe, tmp_path / "run")
    births = RunLog(tmp_path / "run").individuals(range(16))
    statuses = {birth.id: birth.status for birth in births}
    assert {"ok", "error", "invalid", "timeout"} == set(statuses.values())
    for one in evocity.replay(tmp_path / "run"):
        assert one.same is (None if statuses[one.id] == "timeout" else True), one
        assert ("ended by timeout" in (one.reason or "")) == (one.same is None)
    late = [birth for birth, status in statuses.items() if status == "timeout"][:1]
    (one,) = evocity.replay(tmp_path / "run", late, workers=1)
    assert one.same is True


def test_a_measure_that_draws_at_random_is_told(toy, tmp_path):
    run(toy(measures=DRAWS), tmp_path / "run", workers=0)
    for one in evocity.replay(tmp_path / "run", [9, 0, 31]):
        assert one.same is False
        assert list(one.differs) == ["fitness.luck"]
        (birth,) = RunLog(tmp_path / "run").individuals([one.id])
        assert one.differs["fitness.luck"]["then"] == birth.values["luck"]
        assert 0 <= one.differs["fitness.luck"]["now"] < 1


# -- a log that was changed -----------------------------------------------------------------------


def changed(path, column, row, value):
    """The run with one value of the births of its last generation replaced."""
    (piece,) = (path / "births").glob("generation-00000003*")
    table = pq.read_table(piece)
    at, name = table.column_names.index(column), table.schema.field(column)
    values = table[column].to_pylist()
    values[row] = value(values[row])
    pq.write_table(table.set_column(at, name, pa.array(values, name.type)), piece)
    return 24 + row


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    from toy_runs import write_toy

    folder = tmp_path_factory.mktemp("whole")
    run(write_toy(folder), folder / "run", workers=0)
    return folder


@pytest.fixture
def copy(whole, tmp_path):
    shutil.copytree(whole, tmp_path / "copy")
    return tmp_path / "copy" / "run"


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("fitness.spread", lambda old: old + 1e-9),
        ("status", lambda old: "error"),
        ("operator", lambda old: "relocation"),
        ("parents", lambda old: [*old, 0]),
    ],
)
def test_what_was_changed_in_the_log_is_told(copy, column, value):
    row = next(
        number
        for number, one in enumerate(RunLog(copy).births(3).to_pylist())
        if one["operator"] == "mutation"
    )
    identifier = changed(copy, column, row, value)
    (found,) = evocity.replay(copy, [identifier])
    assert found.same is False
    assert column in found.differs


def test_a_changed_genome_is_refused(copy):
    identifier = changed(copy, "beta", 2, lambda old: [old[0] + 1.0, *old[1:]])
    with pytest.raises(RunError, match="damaged"):
        evocity.replay(copy, [identifier])


@pytest.mark.parametrize("ids", [[32], [0, -1], [True], ["3"], [1.5]])
def test_ids_that_are_none_are_refused(whole, ids):
    with pytest.raises(RunError, match="individual"):
        evocity.replay(whole / "run", ids)


@pytest.mark.parametrize("workers", [-1, 1.5, True, "2"])
def test_workers_are_a_number(whole, workers):
    with pytest.raises(RunError, match="workers = "):
        evocity.replay(whole / "run", [0], workers=workers)


def test_a_run_that_goes_on_is_replayed_up_to_its_last_whole_generation(toy, tmp_path):
    with Search(evocity.read_recipe(toy()), tmp_path / "run", workers=0) as search:
        for generation in search:
            search.flush()
            if generation.number == 1:
                all_the_same(tmp_path / "run")


def test_births_are_told_in_the_order_asked_for(whole):
    assert [one.id for one in evocity.replay(whole / "run", [30, 2, 30, 9])] == [30, 2, 30, 9]


# -- what counts as a difference ------------------------------------------------------------------

NUMBERS = st.one_of(st.floats(), st.none())


def a_birth(values):
    values = {name: value for name, value in values.items() if value is not None}
    return Birth(1, 9, (1, 2), "mutation", "ok", None, 0.1, values, None)


@given(
    st.dictionaries(st.sampled_from("abc"), NUMBERS),
    st.dictionaries(st.sampled_from("abc"), NUMBERS),
)
@settings(max_examples=60)
def test_numbers_differ_by_their_bits(then, now):
    found = differences(a_birth(then), a_birth(now))
    for name in "abc":
        told = [json.dumps(one.get(name)) for one in (then, now)]  # tells -0.0 from 0.0
        assert (f"fitness.{name}" in found) == (told[0] != told[1])
