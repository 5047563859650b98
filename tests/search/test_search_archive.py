"""The archive of a run: what no birth ever dominated, against a comparison of all with all."""

import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import evocity
from evocity.citymap import CityMap
from evocity.errors import RunError
from evocity.search import Search, read_recipe
from evocity.search.record import archive
from evocity.selection.fronts import not_dominated
from evocity.store import Birth, Header, Member, RunLog, RunWriter, Source, environment

LOSSES = st.integers(1, 5).flatmap(
    lambda m: st.integers(0, 40).flatmap(
        lambda n: arrays(float, (n, m), elements=st.integers(-2, 2).map(float))
    )
)
MAP = CityMap(np.kron(np.eye(4), np.full((4, 4), 6.0)), 2.0, name="A", attribution="© A")
POPULATION = 5


def dominates(one, other) -> bool:
    return all(a <= b for a, b in zip(one, other, strict=True)) and tuple(one) != tuple(other)


def naive(losses) -> list[int]:
    rows = [tuple(row) for row in losses]
    return [
        i
        for i, row in enumerate(rows)
        if not any(dominates(other, row) for other in rows) and row not in rows[:i]
    ]


@given(LOSSES)
@settings(deadline=None)
def test_what_is_not_dominated_is_what_all_with_all_leaves(losses):
    assert np.flatnonzero(not_dominated(losses)).tolist() == naive(losses)


def test_losses_to_compare_are_finite():
    with pytest.raises(ValueError, match="finite"):
        not_dominated(np.array([[1.0, math.nan]]))


def write_run(folder, rows, goals, alive=lambda ids: ids[-POPULATION:]):
    """A run whose births have the values ``rows``; None is a birth that failed."""
    names = tuple(f"m{i}" for i in range(len(goals)))
    header = Header(16, 16, 2.0, 0.9, ("A",), "© A", None, None, 7, POPULATION, "h", names)
    genome = header.chromosome.adopt(uniformly(MAP).genome, header, None)
    noted = [{"name": name} | goal for name, goal in zip(names, goals, strict=True)]
    recorded = environment() | {"fitness": noted}
    writer = RunWriter.create(folder, "[run]\n", recorded, header, [Source(MAP, genome)])
    good = []
    for generation in range(-(-len(rows) // POPULATION)):
        births = []
        for slot in range(POPULATION):
            at = generation * POPULATION + slot
            row = rows[at] if at < len(rows) else None
            values = {} if row is None else dict(zip(names, map(float, row), strict=True))
            state = ("error", "it failed") if row is None else ("ok", None)
            births.append(Birth(generation, at, (), "mutation", *state, 0.1, values, genome))
            good += [at] * (row is not None)
        members = [Member(n, one, 0, {"crowding": 0.0}) for n, one in enumerate(alive(good))]
        writer.write_generation(generation, births, members, {"births": 1, "failures": 0})
    writer.close()
    return RunLog(folder)


GOALS = [
    {"goal": "max", "target": None},
    {"goal": "target", "target": 1.0},
    {"goal": "min", "target": None, "min": -1.0, "max": 1.5},
]


class GoingOn(RunLog):
    """A run that writes a generation whenever somebody looks into its births."""

    def births(self, *arguments, **options):
        table = super().births(*arguments, **options)
        number = len(self.generations)
        ids = range(number * POPULATION, (number + 1) * POPULATION)
        values = {"m0": 9.0}  # better than all before, and not to be seen
        births = [Birth(number, i, (), "mutation", "ok", None, 0.1, values, GENOME) for i in ids]
        members = [Member(slot, one.id, 0, {"crowding": 0.0}) for slot, one in enumerate(births)]
        writer = RunWriter.reopen(self.path)
        writer.write_generation(number, births, members, {"births": 1, "failures": 0})
        writer.close()
        return table


GENOME = uniformly(MAP).genome


def test_of_a_run_that_goes_on_one_generation_is_seen(tmp_path):
    rows = [(float(number % 4),) for number in range(2 * POPULATION)]
    still = evocity.archive(write_run(tmp_path / "run", rows, [{"goal": "max"}]))
    found = evocity.archive(GoingOn(tmp_path / "run"))
    assert len(RunLog(tmp_path / "run").generations) > 2
    assert found.births.equals(still.births)
    assert found.hypervolume_alive == still.hypervolume_alive > 0
    assert found.births["alive"].to_pylist() == [True]


@given(
    st.lists(st.none() | st.tuples(*[st.integers(-2, 2)] * 3), min_size=POPULATION, max_size=35),
    st.integers(1, 9),
)
@settings(deadline=None, max_examples=25)
def test_the_archive_is_what_no_birth_ever_dominated(rows, at_a_time):
    losses = {
        i: (-row[0], abs(row[1] - 1.0), row[2])
        for i, row in enumerate(rows)
        if row is not None and -1 <= row[2] <= 1.5
    }
    with tempfile.TemporaryDirectory() as folder, pytest.MonkeyPatch.context() as patch:
        patch.setattr(archive, "_ROWS", at_a_time)
        run = write_run(Path(folder) / "run", rows, GOALS)
        found = evocity.archive(run)
        living = set(run.members(run.generations[-1])["id"].to_pylist())
    ids = found.births["id"].to_pylist()
    assert ids == [list(losses)[i] for i in naive(losses.values())]
    for i, loss in losses.items():
        better = any(dominates(other, loss) for other in losses.values())
        double = any(losses[j] == loss for j in ids if j < i)
        assert (i in ids) != (better or double)
    equals = {losses[i] for i in living if i in losses}
    assert found.births["alive"].to_pylist() == [losses[i] in equals for i in ids]
    assert found.hypervolume >= found.hypervolume_alive - 1e-9
    for row in found.births.to_pylist():
        assert row["generation"] == row["id"] // POPULATION
        assert tuple(row[f"fitness.m{i}"] for i in range(3)) == rows[row["id"]]


def test_sums_of_weighted_measures_are_one_goal(tmp_path):
    goals = [
        {"goal": "max", "target": None, "objective": "form", "weight": 3.0},
        {"goal": "min", "target": None, "objective": "form", "weight": 1.0},
    ]
    rows = [(0, 0), (1, 1), (2, 9), (1, 1), (0, -1)]  # 3a - b: 0, 2, -3, 2, 1
    assert evocity.archive(write_run(tmp_path / "run", rows, goals)).births["id"].to_pylist() == [1]


@pytest.mark.slow
def test_the_last_hypervolume_is_that_of_the_search(toy, tmp_path):
    recipe = read_recipe(toy(generations=4, workers=1))
    for _ in Search(recipe, tmp_path / "run"):
        pass
    run = RunLog(tmp_path / "run")
    found = evocity.archive(run)
    assert found.hypervolume_alive == pytest.approx(run.status()["hypervolume"], rel=1e-12)
    assert found.hypervolume >= found.hypervolume_alive


def test_a_run_of_failures_has_an_empty_archive(tmp_path):
    found = evocity.archive(write_run(tmp_path / "run", [None] * POPULATION, GOALS))
    assert (len(found), found.hypervolume, found.hypervolume_alive) == (0, 0.0, 0.0)


def test_the_hypervolume_of_many_births_of_many_goals_is_left_out(tmp_path):
    rng = np.random.default_rng(1)
    points = np.abs(rng.normal(size=(65, 9)))  # of a sphere: no one is better than another
    rows = points / np.linalg.norm(points, axis=1)[:, None]
    found = evocity.archive(write_run(tmp_path / "run", rows, [{"goal": "max"}] * 9))
    assert len(found) == 65
    assert found.hypervolume is None
    assert found.hypervolume_alive > 0


@pytest.mark.parametrize(
    "told",
    [
        {},
        {"goal": "best"},
        {"goal": "target", "target": 10**400},
        {"goal": "max", "weight": "much", "objective": "a"},
        {"goal": "max", "min": 2.0, "max": 1.0},
        {"min": 1.0},
        {"goal": ["max"]},
        {"goal": "target", "target": sys.float_info.max * 2},
    ],
)
def test_a_run_that_does_not_tell_its_goals_is_said(tmp_path, told):
    run = write_run(tmp_path / "run", [(1.0,)], [told])
    with pytest.raises(RunError, match="lacks a measure's goal"):
        evocity.archive(run)


def test_a_strangers_provenance_is_said(tmp_path):
    run = write_run(tmp_path / "run", [(1.0,)], [{"goal": "max"}])
    for told in (None, 3, [3], [{"name": "other"}], {"name": 1}):
        run.provenance["fitness"] = told
        with pytest.raises(RunError, match="lacks a measure's goal"):
            evocity.archive(run)


def test_no_generation_is_said(tmp_path):
    with pytest.raises(RunError, match="no complete generation"):
        evocity.archive(write_run(tmp_path / "run", [], [{"goal": "max"}]))
