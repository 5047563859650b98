"""A run as one asks it: old, resumed, damaged, growing, empty ones."""

import csv
import os
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import networkx
import numpy as np
import pytest
from written_runs import written

import evocity
from evocity.analysis import scores
from evocity.analysis.likeness import Likeness
from evocity.analysis.shortlist import APART
from evocity.analysis.thumbnails import highest_of
from evocity.coding.decoding_cache import decoded
from evocity.errors import EvocityError, FitnessError, RunError
from evocity.genome import VOID
from evocity.pictures.sheet import sheet_of
from evocity.selection.thumbprints import look_of

OLD = sorted((Path(__file__).parent.parent / "old").glob("run-*[0-9]"))


def naive_ancestors(run, one: int) -> set[int]:
    found = {one}
    for parent in run.individuals([one])[0].parents:
        found |= naive_ancestors(run, parent)
    return found


# -- what there is ---------------------------------------------------------------------------


@pytest.mark.slow_cases("run-2", "run-4", "run-6", "run-10")
@pytest.mark.parametrize("path", OLD, ids=lambda path: path.name)
def test_runs_of_older_releases_are_asked_alike(path):
    run = evocity.open_run(path)
    assert len(run) == len(list(run)) == len(run.scores)
    assert len(run) == {"run-7": 36, "run-10": 16}.get(path.name, 24)
    assert (run[-1].id, run[len(run) - 1]) == (len(run) - 1, run[-1])
    assert [one.id for one in run[3:5]] == [3, 4]
    assert 7 in run
    assert len(run) not in run
    assert run[5] in run
    assert list(run.scores.columns[-len(run.header.columns) :]) == list(run.header.columns)
    assert run.series["living"].tolist()[-1] == len(set(run.members(3)["id"].to_pylist()))
    assert run.compromise().id in run.archive.ids
    assert set(run.front().index) <= set(run.where("alive").index)
    for aim in run.aims:
        if aim.goal != "bounds":
            assert run.best(aim.name).feasible
    for one in (0, 11, run[-1].id):
        assert set(run.lineage(one)) == naive_ancestors(run, one)
        assert sum(run.ancestry(one).values()) == pytest.approx(1)
    some = [run[-1].id, 0, 11, 7, 2]
    with patch("evocity.analysis.individual._AT_A_TIME", 2):
        shares = run.ancestry(some)
    assert shares.index.tolist() == some
    for one, share in zip(some, shares.to_dict("records"), strict=True):
        assert {city: part for city, part in share.items() if part} == pytest.approx(
            run.ancestry(one)
        )
    with pytest.raises(RunError, match=r"run\.score\(run\.front\(\), \['building_density'\]\)"):
        run.best("building_density")
    credit = run.credit()
    assert credit["births"].sum() == len(run)
    share = credit["births"] / len(run)
    np.testing.assert_allclose((credit["paid"] * share).sum(), 1)
    np.testing.assert_allclose(credit["paid"], credit["ancestors"] / share)
    assert set(run.clusters(2, by="scores", of=run.where("feasible"))["cluster"]) == {0, 1}


def test_births_are_chosen_by_a_condition(run):
    table = run.births(columns=["parents", "id"], where="operator == 'mutation' and alive")
    assert table.column_names == ["parents", "id"]
    assert table["id"].to_pylist() == run.where("operator == 'mutation' and alive").index.tolist()
    assert run.births(1, where="id >= 0")["generation"].to_pylist() == [1] * 8
    assert "genome" in run.births(where="alive").column_names
    with pytest.raises(RunError, match="no column"):
        run.births(columns=["nothing"], where="alive")


def test_an_individual_tells_what_the_log_does(run):
    one = run[9]
    (birth,) = run.individuals([9])
    assert (one.generation, one.operator, one.status) == (1, birth.operator, birth.status)
    assert one.scores == birth.values
    assert one.genome == birth.genome
    assert tuple(parent.id for parent in one.parents) == birth.parents
    assert one.made == birth.made
    assert one.losses["crumbs"] == birth.values["crumbs"]
    assert one.losses["alignment"] == -birth.values["alignment"]
    assert np.array_equal(one.city.heights, evocity.decode(birth.genome).city.heights)
    living = [set(run.members(g)["id"].to_pylist()) for g in run.generations]
    assert one.lived == sum(9 in ids for ids in living)
    assert one.alive == (9 in living[-1])
    assert one.picture(zoom=8).size[0] >= 512 > one.picture().size[0]
    assert one.ancestry_picture().size[0] >= 64
    assert one.scene().measures == one.scores


@pytest.mark.parametrize("name", ["a.parquet", "a.tif", "a.npy", "a.png", "a.gpkg", "a.city.json"])
def test_an_individual_becomes_a_file(run, tmp_path, name):
    run[9].save(tmp_path / name)
    assert (tmp_path / name).stat().st_size > 0


def test_a_file_of_no_kind_is_refused(run, tmp_path):
    with pytest.raises(EvocityError, match=r"evocity cannot write \.doc"):
        run[9].save(tmp_path / "a.doc")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("which", [10**6, -(10**6), 1.5, "9", None, True])
def test_what_is_no_birth_is_refused(run, which):
    with pytest.raises(RunError):
        run[which]
    assert which not in run


def test_questions_without_an_answer_are_refused(run):
    for ask in (
        lambda: run.best("nothing"),
        lambda: run.best("gsi"),  # recorded, so nothing was wanted of it
        lambda: run.best("gsi", "most"),
        lambda: run.clusters(0),
        lambda: run.clusters(99),
        lambda: run.clusters(2, by="smell"),
        lambda: run.nearest(9, 999),
        lambda: run.nearest(9, of=[]),
        lambda: run.front(99),
        lambda: run.survivors(0),
        lambda: run.lineage(9, -1),
        lambda: run.most_different(2, of=[1, 10**9]),
        lambda: run.compromise({"gsi": 1}),
        lambda: run.score(9, "nothing"),
        lambda: run.score(9, []),
        lambda: run.score(9, "gsi", workers=-1),
        lambda: run.score(9, "gsi", timeout=0),
    ):
        with pytest.raises(EvocityError) as caught:
            ask()
        assert caught.value.expected
        assert caught.value.remedy
    assert run.best("gsi", "max").scores["gsi"] == run.where("feasible")["gsi"].max()


@pytest.mark.parametrize(("name", "ask"), [("pandas", "scores"), ("networkx", "lineage")])
def test_a_library_that_is_not_there_is_named(run, monkeypatch, name, ask):
    monkeypatch.setitem(sys.modules, name, None)
    with pytest.raises(EvocityError, match=name) as caught:
        _ = run.scores if ask == "scores" else run.lineage(9)
    assert "evocity[notebook]" in caught.value.remedy
    assert run.best("alignment").picture()  # needs neither


# -- who is like whom ------------------------------------------------------------------------


def test_looks_differ_by_the_share_of_cells(run):
    ids = run.archive.ids[:4]
    found = Likeness(run.columns).matrix(ids, "looks")
    looks = [look_of(decoded(run.genome(int(one))).city).astype(int) for one in ids]
    expected = [[np.mean(np.abs(a - b) > 30) for b in looks] for a in looks]
    assert found == pytest.approx(np.array(expected))


def test_a_copy_is_the_next_of_kin(run):
    ids = run.columns.ids
    apart = Likeness(run.columns).from_one(9, ids, "kin")
    assert apart[9] == 0
    assert ((apart >= 0) & (apart <= 1)).all()
    assert apart[0] == pytest.approx(1 - run.ancestry(9).get("left", 0))  # stones stay in place
    assert run.nearest(9, 3, by="kin", of=ids)["distance"].is_monotonic_increasing


# -- resumed, growing, empty, damaged --------------------------------------------------------


@pytest.mark.slow
def test_lineage_of_a_resumed_run_with_islands_reaches_the_sources(archipelago):
    run = evocity.open_run(archipelago)
    assert any(event["event"] == "resume" for event in run.events())
    for one in run:
        graph = run.lineage(one)
        assert set(graph) == naive_ancestors(run, one.id)
        begins = {node for node, count in graph.in_degree() if not count}
        assert {graph.nodes[node]["operator"] for node in begins} == {"source"}
        assert sorted(graph.predecessors(one.id)) == sorted({p.id for p in one.parents})
        same = networkx.DiGraph()  # by networkx's own means
        same.add_nodes_from(graph.nodes(data=True))
        same.add_edges_from((p.id, node) for node in graph for p in run[node].parents)
        assert networkx.utils.graphs_equal(graph, same)
        assert graph.reverse().pred == graph.succ
    again = evocity.replay(run, sorted(run.lineage(run[-1])), trust=True)
    assert all(one.same for one in again)
    assert set(run.scores["island"]) == {"towers", "crowd"}
    ids, ranks = run.columns.ranked()
    assert len(set(ids.tolist())) == len(ids)
    assert set(run.front().index) == set(ids[ranks == 0].tolist())


def test_a_run_that_goes_on_is_one_until_it_is_refreshed(night, tmp_path):
    path = shutil.copytree(night, tmp_path / "run")
    run = evocity.open_run(path)
    before = run.scores
    with evocity.Search.resume(path, generations=4, workers=0, trust=True) as search:
        list(search)
    assert run.generations == range(4)
    assert run.archive.births["generation"].to_numpy().max() <= 3
    assert run.scores.equals(before)
    assert len(run.series) == 4
    assert run.refresh() is run
    assert (run.generations, len(run)) == (range(5), len(before) + 8)


def test_an_empty_run_has_no_births(tmp_path):
    run = written(tmp_path / "run", [], [])
    assert (len(run), list(run), 0 in run) == (0, [], False)
    for ask in (lambda: run.scores, lambda: run.archive, lambda: run[0], lambda: run.series):
        with pytest.raises(RunError, match="no complete generation"):
            ask()


@pytest.mark.parametrize(
    ("births", "members", "ask", "told"),
    [
        ([[{"id": 0}, {"id": 0}]], [[0]], "scores", "occurs twice"),
        ([[{"id": 0}, {"id": 1}]], [[7]], "scores", "no individual 7"),
        ([[{"id": 0}], [{"id": 1, "parents": (9,)}]], [[0], [1]], "credit", "no individual 9"),
        ([[{"id": 0, "parents": (0,)}]], [[0]], "credit", "younger than its child"),
    ],
)
def test_a_log_that_cannot_be_is_damaged(tmp_path, births, members, ask, told):
    run = written(tmp_path / "run", births, members)
    with pytest.raises(RunError, match=told):
        _ = run.credit() if ask == "credit" else run.scores


def test_a_damaged_end_is_left_out(night, tmp_path):
    path = shutil.copytree(night, tmp_path / "run")
    last = path / "births" / "generation-00000003.parquet"
    last.write_bytes(last.read_bytes()[:-100])
    run = evocity.open_run(path)
    assert run.generations == range(3)
    assert run.scores["generation"].max() == 2
    assert run.damaged


def test_a_measure_named_as_a_column_keeps_its_values(tmp_path):
    wanted = [{"name": "seconds", "goal": "min"}]
    births = [[{"id": 0, "values": {"seconds": 4.0}}]]
    run = written(tmp_path / "run", births, [[0]], wanted)
    row = run.scores.loc[0]
    assert (row["seconds"], row["fitness.seconds"]) == (0.5, 4.0)
    assert run.where("fitness.seconds > 1 and seconds < 1").index.tolist() == [0]


# -- measures of afterwards ------------------------------------------------------------------

OWN = """
import evocity

@evocity.fitness(goal="max")
def odd(city):
    if city.heights.max() > 15:
        raise ValueError("too high")
    return float(city.heights.max())
"""


def test_measures_of_afterwards(run, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    (tmp_path / "odd.py").write_text(OWN)
    before = sorted(path.stat().st_mtime_ns for path in run.path.rglob("*"))
    ids = run.archive.ids[:4]
    found = run.score(ids, ["gsi", "integrity", str(tmp_path / "odd.py")], workers=0)
    assert found.index.tolist() == ids.tolist()
    assert found["gsi"].tolist() == pytest.approx(run.scores.loc[ids, "gsi"].tolist())
    for one, row in found.iterrows():
        high = run[int(one)].city.heights.max()
        assert ("too high" in str(row["error"])) == bool(high > 15) == bool(np.isnan(row["odd"]))
    assert before == sorted(path.stat().st_mtime_ns for path in run.path.rglob("*"))

    monkeypatch.setattr(scores, "Here", None)  # what is known is not measured again
    again = evocity.open_run(run.path).score(ids, ["gsi", "integrity"], workers=0)
    assert again["integrity"].tolist() == found["integrity"].tolist()
    for path in (tmp_path / "cache").rglob("*.json"):
        path.write_text('{"a": [1]')
    with pytest.raises(TypeError):  # a cache that is damaged is none
        run.score(ids, "gsi", workers=0)


def test_measures_of_afterwards_by_workers(run, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    here = run.score([9, 10], "integrity", workers=0)
    shutil.rmtree(tmp_path / "cache")
    there = run.score([9, 10], "integrity", workers=1)
    assert there.equals(here)


@pytest.mark.slow
def test_a_script_without_a_guard_may_score_by_what_is_not_its_own(run, tmp_path):
    """Workers run it once more only for measures that it declares."""
    script = tmp_path / "morning.py"
    script.write_text(
        "import evocity\n"
        "print('begun')\n"
        f"run = evocity.open_run({str(run.path)!r})\n"
        "print(run.score([9, 10], ['sky_view_factor'], workers=2)['error'].isna().all())\n"
    )
    cache = {**os.environ, "XDG_CACHE_HOME": str(tmp_path / "cache")}
    words = [sys.executable, script]
    told = subprocess.run(words, capture_output=True, text=True, env=cache, timeout=100)
    assert (told.stdout.split(), told.returncode) == (["begun", "True"], 0), told.stderr


def test_an_unknown_measure_is_refused(run):
    with pytest.raises(FitnessError, match="no measure is called"):
        run.score(9, "gsj")


# -- which to keep, and files ----------------------------------------------------------------


def test_those_worth_keeping_have_reasons_in_their_numbers(run):
    kept = run.keep()
    ids = [one.individual.id for one in kept]
    assert len(ids) == len(set(ids)) == min(5, len(run.archive))
    assert set(ids) <= set(run.archive.ids)
    assert kept[0].individual == run.compromise()
    assert kept[0].role.startswith("compromise")
    goals = run.columns.goals
    losses = run.columns.losses[run.columns.rows(run.archive.ids)]
    for one in kept:
        assert one.why
        for goal in goals:
            if f"best {goal}" in one.role:
                least = losses[:, goals.index(goal)].min()
                assert one.individual.losses[goal] == least
                equal = int((losses[:, goals.index(goal)] == least).sum()) - 1
                told = re.search(rf"{goal} \([^)]*, as ([0-9]+) other", one.why)
                assert (int(told[1]) if told else 0) == equal
        assert ("no longer alive" in one.why) == (not one.individual.alive)
        assert ("not a child" in one.why) == (one.individual.operator == "source")
    assert kept.frame.index.tolist() == ids
    assert len(str(kept).splitlines()) == len(kept) + bool(kept.untraced)
    assert [one.individual.id for one in run.keep(1)] == ids[:1]
    most = run.keep(10**6)
    assert {one.individual.id for one in most} <= set(run.archive.ids)
    for count in range(1, len(run.archive) + 1):
        assert len(run.keep(count)) == min(count, len(most))
    near = Likeness(run.columns).matrix(most.frame.index.to_numpy(), "looks")
    of_their_own = [n for n, one in enumerate(most) if not one.role.startswith(("best", "comp"))]
    assert all(near[n, :n].min() > APART for n in of_their_own)


def test_a_goal_in_which_all_are_equal_gives_no_role(run, monkeypatch):
    (first, second, *_), ids, losses = run.columns.goals, run.archive.ids, run.columns.losses.copy()
    losses[:, 0] = 1.0
    monkeypatch.setitem(vars(run.columns), "losses", losses)
    roles = ", ".join(one.role for one in run.keep(of=ids))
    assert f"best {second}" in roles
    assert f"best {first}" not in roles


def test_some_are_chosen_of_those_that_are_given(run):
    feasible = run.where("feasible").index
    some = feasible[::2]
    kept = run.keep(3, of=some)
    assert {one.individual.id for one in kept} <= set(some)
    assert kept[0].individual == run.compromise(of=some)
    assert f"of the {len(some)} given that keep the constraints" in kept[0].why.lower()
    assert run.keep(3, of=run.archive.ids).frame["role"].equals(run.keep(3).frame["role"])
    (alone,) = run.keep(3, of=[some[0]] * 3)
    assert "only one given" in alone.why
    assert "better by" not in alone.why
    with pytest.raises(RunError, match="none of 0 births keeps the constraints"):
        run.keep(of=[])


def test_whose_stones_the_kept_are_is_told(run):
    kept = run.keep()
    for one in kept:
        assert one.built == pytest.approx(one.individual.ancestry(built=True))
        assert list(one.built.values()) == sorted(one.built.values(), reverse=True)
        assert one.stones.count("%") == len(one.built)
        assert one.stones in str(one)
    cities = {one.name for one in run.sources()} - {VOID}
    seen = {city for one in kept for city, share in one.built.items() if share > 0.01}
    assert set(kept.untraced) == cities - seen
    founder = run.keep(of=[0])  # a parent's own code has no stone of another
    assert founder.untraced == [city for city in run.header.cities[1:] if city != VOID]
    assert str(founder).splitlines()[-1] == founder.lacking
    assert all(city in founder.lacking for city in founder.untraced)


def test_a_source_without_buildings_leaves_no_trace_that_is_missed(run, monkeypatch):
    bare = [replace(one, city=one.city.replace(0 * one.city.heights)) for one in run.sources()]
    monkeypatch.setattr(type(run), "sources", lambda self: bare)
    assert run.keep(of=[0]).untraced == []


def test_those_compared_by_looks_are_of_all_times(run, monkeypatch):
    monkeypatch.setattr("evocity.analysis.shortlist.MOST_COMPARED", 6)
    asked = []
    matrix = Likeness.matrix
    monkeypatch.setattr(
        Likeness, "matrix", lambda self, ids, by: asked.append(ids) or matrix(self, ids, by)
    )
    kept = run.keep(len(run.archive))
    (compared,) = asked
    own = [one.individual.id for one in kept if one.role.startswith(("best", "compromise"))]
    assert len(compared) == max(6, len(own)) < len(run.archive)
    rest = np.sort(np.setdiff1d(compared, own))
    others = np.setdiff1d(run.archive.ids, own)
    assert not len(rest) or rest[0] == others.min()
    assert len(rest) < 2 or rest[-1] == others.max()
    for one in kept:
        assert "in the archive" not in one.why or not one.role.startswith("one of its")


def test_a_parent_that_is_kept_is_called_a_parent(tmp_path):
    run = written(tmp_path / "run", [[{"id": 0, "operator": "source"}, {"id": 1}]], [[0, 1]])
    said = [one.why for one in run.keep() if one.individual.id == 0]
    assert said
    assert f"It is the code of the parent {run.header.cities[0]}, not a child." in said[0]


def test_individuals_of_another_run_are_refused(run, archipelago):
    other = evocity.open_run(archipelago)[0]
    for ask in (run.ancestry, run.nearest, run.lineage, lambda one: run.score(one, "gsi")):
        with pytest.raises(RunError, match="an individual of this run"):
            ask(other)
    assert run.ancestry(run[3]) == run.ancestry(3)


def test_runs_in_which_nobody_was_measured_are_compared(tmp_path):
    failed = {"status": "error", "error": "no", "values": {}, "genome": None}
    run = written(tmp_path / "none", [[{"id": 0} | failed]])
    comparison = run.compare(written(tmp_path / "some", [[{"id": 0} | failed], [{"id": 1}]]))
    assert comparison.hypervolume.isna().all(axis=None)
    assert "Hypervolume" not in str(comparison)
    assert str(comparison)


STATED = {"name": "gsi", "goal": "min", "file": "mine.py", "hash": "a", "kept": "gsi/mine.py"}


@pytest.mark.parametrize(
    ("change", "same"),
    [
        ({}, True),
        ({"file": "moved/mine.py"}, True),
        ({"hash": "b"}, False),
        ({"file": "evocity/fitness/density.py", "hash": "b"}, False),
        ({"reference": {"lyon-1er": None}}, False),
        ({"reference": "parents"}, False),
        ({"within": "quarter"}, False),
        ({"target": 0.3, "goal": "target", "hash": "b"}, None),
    ],
)
def test_a_measure_of_another_source_is_another(tmp_path, change, same):
    births = [[{"id": 0}, {"id": 1}]]
    run = written(tmp_path / "one", births, wanted=[STATED])
    other = written(tmp_path / "other", births, wanted=[STATED | change])
    comparison = run.compare(other)
    assert comparison.goals == (("gsi",) if same else ())
    assert comparison.namesakes == (("gsi",) if same is False else ())
    assert ("and different sources: gsi." in str(comparison)) == (same is False)
    assert ("By the common goals, gsi" in str(comparison)) == bool(same)


def test_a_measure_of_evocity_is_one_in_all_releases(tmp_path):
    ours = {"name": "gsi", "goal": "min", "file": "evocity/fitness/density.py", "hash": "a"}
    old = ours | {"file": "/home/somebody/evocity/fitness/density.py", "hash": "b"}
    births = [[{"id": 0}, {"id": 1}]]
    run = written(tmp_path / "one", births, wanted=[ours])
    assert run.compare(written(tmp_path / "old", births, wanted=[old])).goals == ("gsi",)
    theirs = run.compare(written(tmp_path / "own", births, wanted=[STATED]))
    assert theirs.namesakes == ("gsi",)


def test_no_pictures_are_left_of_a_table_that_could_not_be_written(run, tmp_path, monkeypatch):
    def full(source, target, replace=os.replace):
        if str(target).endswith(".csv"):
            raise OSError(28, "No space left on device")
        replace(source, target)

    monkeypatch.setattr("evocity.files.os.replace", full)
    with pytest.raises(RunError, match="No space left"):
        run.to_csv(tmp_path / "explored.csv", form="design-explorer", of=[0])
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("read", [False, True])
@pytest.mark.parametrize("which", [[1], [[1]], [[1, 2], [3]], "1", 1.0, None, True, -1000, 2**70])
def test_what_is_no_birth_is_told_in_three_parts(night, which, read):
    run = evocity.open_run(night)
    if read:
        assert len(run.columns.ids)
    with pytest.raises(RunError, match=r"individual|ids") as caught:
        run[which]
    assert all((caught.value.found, caught.value.expected, caught.value.remedy))


def test_ids_stand_in_one_row(run):
    for ids in ([[1, 2]], [[[1, 2]]], np.ones((2, 2), int)):
        with pytest.raises(RunError, match="ids"):
            run.columns.rows(ids)
    assert run.columns.rows([]).tolist() == run.columns.rows([[]]).tolist() == []


def test_of_no_births_there_is_no_last_one(tmp_path):
    run = written(tmp_path / "run", [[]])
    assert len(run) == 0
    assert -1 not in run
    for which in (-1, 0):
        with pytest.raises(RunError, match=f"no individual {which}"):
            run[which]


def test_what_counts_no_births_names_no_births(run):
    for ask in (run.diversity, run.survivors, run.keep):
        key = "generations" if ask == run.diversity else "n"
        for count in (0, -1, 1.5, True, "all"):
            with pytest.raises(EvocityError, match="a whole number, 1 or more") as caught:
                ask(**{key: count})
            assert "of=" not in caught.value.remedy
    with pytest.raises(EvocityError, match="name other births with of="):
        run.clusters(10_000)


def test_of_an_empty_archive_none_is_kept(tmp_path):
    failed = {"status": "error", "error": "no", "values": {}, "genome": None}
    with pytest.raises(RunError, match="the archive is empty"):
        written(tmp_path / "none", [[{"id": 0} | failed]]).keep()


@pytest.mark.slow
def test_scores_become_csv(run, tmp_path):
    run.to_csv(tmp_path / "scores.csv")
    with open(tmp_path / "scores.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["id"]) for row in rows] == run.columns.ids.tolist()
    assert [float(row["alignment"]) for row in rows] == run.scores["alignment"].tolist()
    run.to_csv(tmp_path / "explored.csv", form="design-explorer")
    with open(tmp_path / "explored.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["in:id"]) for row in rows] == run.archive.ids.tolist()
    assert all((tmp_path / row["img"]).is_file() for row in rows)
    assert all(float(row["out:crumbs"]) >= 0 for row in rows)
    shares = [sum(float(row[f"in:{city}"]) for city in run.header.cities) for row in rows]
    assert shares == pytest.approx([1] * len(rows))
    before = sorted(tmp_path.iterdir())
    for fault in (
        lambda: run.to_csv(tmp_path / "explored.csv", form="design-explorer"),
        lambda: run.to_csv(tmp_path / "other.csv", form="excel"),
        lambda: run.to_csv(tmp_path / "nowhere" / "other.csv"),
    ):
        with pytest.raises(RunError):
            fault()
    assert sorted(tmp_path.iterdir()) == before


def test_no_text_in_a_table_is_a_formula(tmp_path):
    births = [[{"id": 0, "operator": "=1+1"}]]
    run = written(tmp_path / "run", births, [[0]])
    run.to_csv(tmp_path / "scores.csv")
    assert ",'=1+1," in (tmp_path / "scores.csv").read_text()


def test_chosen_births_become_a_zip(run, tmp_path):
    run.save([9, 3], tmp_path / "chosen.zip")
    with zipfile.ZipFile(tmp_path / "chosen.zip") as file:
        names = set(file.namelist())
        assert len(file.read("scores.csv").splitlines()) == 3
        file.extract("9/genome.parquet", tmp_path)
    files = {"map.tif", "footprints.gpkg", "picture.png", "genome.parquet", "scene.glb"}
    files.add("map.qml")
    assert names == {f"{one}/{name}" for one in (9, 3) for name in files} | {
        "scores.csv",
        "ATTRIBUTION.txt",
    }
    assert evocity.read_genome(tmp_path / "9" / "genome.parquet") == run[9].genome
    for which, name in (([9], "chosen.rar"), ([], "none.zip"), ([9], "nowhere/a.zip")):
        with pytest.raises(EvocityError):
            run.save(which, tmp_path / name)
    assert {path.name for path in tmp_path.iterdir()} == {"chosen.zip", "9"}


def test_chosen_births_become_a_contact_sheet(run, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        "evocity.analysis.export.sheet_of",
        lambda cells, *more: drawn.append((cells, *more)) or sheet_of(cells, *more),
    )
    kept = run.keep(3)
    run.save(kept, tmp_path / "sheet.png")
    run.save(kept[0], tmp_path / "one.png")
    cells, title, highest, attribution, columns, note = drawn[0]
    assert (title, attribution, note) == (run.path.name, run.header.attribution, "")
    assert columns == len(kept)
    assert highest == highest_of(run.columns)
    for (city, lines), one in zip(cells, kept, strict=True):
        assert np.array_equal(city.heights, one.individual.city.heights)
        assert lines[0] == f"individual {one.individual.id}"
        assert lines[1] == one.role
        assert [line.split()[0] for line in lines[2:]] == list(one.individual.scores)
    run.save([one.individual for one in kept], tmp_path / "sheet.png")
    for (_, lines), one in zip(drawn[2][0], kept, strict=True):
        assert [line.split()[0] for line in lines[1:]] == list(one.individual.scores)
    assert [lines[0] for _, lines in drawn[1][0]] == [f"individual {kept[0].individual.id}"]
    monkeypatch.setattr("evocity.analysis.export.MOST", 1)
    with pytest.raises(RunError, match="2 births are too many for one contact sheet"):
        run.save([9, 3], tmp_path / "many.png")
    assert {path.name for path in tmp_path.iterdir()} == {"sheet.png", "one.png"}


@pytest.mark.parametrize("name", ["run-5", "run-7", "run-8", "run-10"])
def test_stones_are_told_of_what_is_built_alone(name):
    run = evocity.open_run(OLD[0].parent / name)
    for one in (0, 1, run[-1].id):
        birth, city = run[one], run[one].city
        owner = np.zeros((*city.shape, len(run.header.cities)))
        genome = birth.genome
        corners = zip(*genome.pavement.corners, genome.pavement.side, strict=True)
        for at, (y, x, side) in enumerate(corners):
            block = owner[y : y + side, x : x + side]
            block[..., genome.parent[at]] += genome.part[at]
            block[..., genome.other[at]] += 1 - genome.part[at]
        shares = owner[city.built].mean(axis=0) if city.built.any() else np.zeros(owner.shape[2])
        told = birth.ancestry(built=True)
        expected = {
            name: share for name, share in zip(run.header.cities, shares, strict=True) if share > 0
        }
        assert told == pytest.approx(expected, abs=1e-6)
