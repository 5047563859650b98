"""Another recipe with other measures: old births are scored by them, and none is lost."""

import json
import os
import shutil
import sys
import weakref
from contextlib import contextmanager
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pyarrow.parquet as pq
import pytest
from test_search_leaving import LOG, left_out, same_as_all
from test_search_run import rows, run
from toy_runs import write_toy

import evocity
from evocity.coding import decode
from evocity.errors import EvocityError, RecipeError, RunError
from evocity.evaluation.evaluator import Evaluator
from evocity.fitness import registry
from evocity.kinds.fabric import Fabric
from evocity.report import write_report
from evocity.search import Search, archive
from evocity.search.resume.replay import replay
from evocity.store import RunLog

MORE = """
import evocity
from evocity.coding import decode

@evocity.fitness(goal="max", unit="m")
def tall(city):
    return float(city.heights.max())

@evocity.fitness(goal="min")
def odd(city):
    if int(city.heights.sum()) % 3 == 0:
        raise ValueError("an odd one")
    return float((city.heights > 0).mean())

@evocity.fitness(goal="max")
def likeness(city, parents):
    return float(sum((decode(one).city.heights != city.heights).mean() for one in parents))

@evocity.fitness(goal="max")
def never(city):
    raise ValueError("never")
"""

#: What a recipe says more, or what stands in the place of its [[fitness]].
TALL = '[[fitness]]\nfile = "more.py"\nname = "tall"\n'
ODD = '[[fitness]]\nfile = "more.py"\nname = "odd"\n'


def goes_on(out, recipe=None, **how) -> list[int]:
    with Search.resume(out, recipe=recipe, **({"workers": 0} | how)) as search:
        return [one.number for one in search]


def recipe_with(folder, more="", replacing=None, **settings):
    """A toy recipe in ``folder``, its measures replaced or with more of them; its path."""
    (folder / "more.py").write_text(MORE)
    path = write_toy(folder, **({"generations": 2} | settings))
    text = path.read_text()
    if replacing is not None:
        assert '[[fitness]]\nfile = "toys.py"\n' in text
        text = text.replace('[[fitness]]\nfile = "toys.py"\n', replacing)
    new = folder / "new.toml"
    new.write_text(text + more)
    return new


@pytest.fixture(scope="module")
def begun_once(tmp_path_factory):
    folder = tmp_path_factory.mktemp("begun")
    with patch.dict(registry._from_files):
        run(write_toy(folder), folder / "run", workers=0, generations=2)
    return folder


@pytest.fixture
def begun(begun_once, tmp_path):
    """A folder with the run of three generations in it, and what its recipe names."""
    shutil.copytree(begun_once, tmp_path, dirs_exist_ok=True)
    return tmp_path


def columns(out, names=None) -> dict[str, list]:
    table = RunLog(out).births()
    return {name: table[name].to_pylist() for name in names or table.column_names}


# -- what is scored ------------------------------------------------------------------------


@pytest.mark.slow
def test_old_births_have_what_score_says_of_them_and_keep_all_else(begun):
    out, before = begun / "run", columns(begun / "run")
    members = RunLog(out).members().select(["generation", "id"]).to_pylist()
    told = []
    recipe = recipe_with(begun, TALL + '[[fitness]]\nfile = "more.py"\nname = "likeness"\n')
    assert goes_on(out, recipe, generations=4, progress=told.append) == [3, 4]
    after = RunLog(out)
    assert after.header.measures == ("spread", "roof", "tall", "likeness")
    now, count = columns(out), len(before["id"])
    for name, values in before.items():
        assert now[name][:count] == values, name
    measures = {one.name: one for one in evocity.fitness.load_file(begun / "more.py")}
    births = after.individuals(range(count))
    for birth, parents in zip(births, after.parents(births), strict=True):
        city = decode(birth.genome).city
        assert birth.values["tall"] == measures["tall"](city)
        assert birth.values["likeness"] == measures["likeness"](city, parents=parents)
    lived = after.members().select(["generation", "id"]).to_pylist()[: len(members)]
    assert sorted(map(str, lived)) == sorted(map(str, members))
    assert any(f"scoring births by tall, likeness: {count} of {count}" in one for one in told)
    (event,) = [one for one in after.events() if one["event"] == "recipe"]
    scored = {"measures": ["tall", "likeness"], "births": count, "lacking": {}}
    assert event["scored"] == scored == after.provenance["recipe"]["before"][0]["scored"]
    assert sorted(one.name for one in out.iterdir() if one.name.startswith(".")) == []
    assert all(one.same for one in replay(out))  # by the recipe of then, and of now
    assert goes_on(out, generations=5) == [5]


def test_generations_before_are_judged_by_the_goals_of_now(begun):
    out = begun / "run"
    goes_on(out, recipe_with(begun, TALL))
    after = RunLog(out)
    history = after.history()
    assert [set(one["best"]) for one in history] == [{"spread", "roof", "tall"}] * 3
    best = {one["id"]: one["fitness.tall"] for one in after.births().to_pylist()}
    for one in history:
        living = after.members(one["generation"])["id"].to_pylist()
        assert one["best"]["tall"] == max(best[id_] for id_ in living)
    assert archive(after).hypervolume_alive == pytest.approx(history[-1]["hypervolume"], rel=1e-12)
    assert archive(after, 0).hypervolume_alive == pytest.approx(history[0]["hypervolume"])


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, pytest.param(2, marks=pytest.mark.long)])
def test_workers_do_not_matter(begun, tmp_path, workers):
    out, recipe = begun / "run", recipe_with(begun, TALL)
    shutil.copytree(out, tmp_path / "other")
    goes_on(out, recipe, generations=3)
    goes_on(tmp_path / "other", recipe, generations=3, workers=workers)
    assert rows(out) == rows(tmp_path / "other")


@pytest.mark.slow
def test_goals_become_bounds_or_recorded_and_goals_again(begun):
    out, first = begun / "run", columns(begun / "run")
    roofs = '[[fitness]]\nfile = "toys.py"\nname = "roof"\n'
    spread = '[[fitness]]\nfile = "toys.py"\nname = "spread"\n'
    record = '\nrecord = [{ file = "toys.py", name = "spread" }, "gsi"]\n[map]'
    steps = [
        ("max = 5.6\n" + TALL, ("roof", "tall"), ("spread", "gsi")),
        (TALL + '[[fitness]]\nname = "gsi"\nmax = 0.54\n' + spread, None, ()),
    ]
    for more, measures, recorded in steps:
        recipe = recipe_with(begun, replacing=roofs + more)
        if recorded:
            recipe.write_text(recipe.read_text().replace("\n[map]", record, 1))
        goes_on(out, recipe)
        now = RunLog(out)
        assert now.header.measures == (measures or ("roof", "tall", "gsi", "spread"))
        assert now.header.recorded == recorded
        told = columns(out)
        bounded = [
            roof <= 5.6 if measures else gsi <= 0.54
            for roof, gsi in zip(told["fitness.roof"], told["fitness.gsi"], strict=True)
        ]
        assert told["feasible"] == bounded
        assert len(archive(now)) > 0
    assert columns(out, [f"fitness.{name}" for name in ("roof", "spread")]) == {
        f"fitness.{name}": first[f"fitness.{name}"] for name in ("roof", "spread")
    }
    assert goes_on(out, generations=3) == [3]
    assert all(one.same for one in replay(out))


@pytest.mark.slow
@pytest.mark.parametrize("way", ["survivors", "front"])
def test_births_whose_genomes_the_log_leaves_out_are_scored_too(tmp_path, way):
    goals = TALL + '[[fitness]]\nfile = "more.py"\nname = "likeness"\n'
    for name, more in (("all", ""), ("less", LOG.format(way))):
        run(write_toy(tmp_path, recipe=more), tmp_path / name, workers=0, generations=2)
        before = left_out(evocity.open_run(tmp_path / name)) if more else []
        goes_on(tmp_path / name, recipe_with(tmp_path, goals + more), generations=4)
    less, whole = (evocity.open_run(tmp_path / name) for name in ("less", "all"))
    same_as_all(tmp_path / "less", whole)
    assert [one for one in left_out(less) if one < 24] == before != []
    assert left_out(less)[-1] >= 24
    assert (less.header.schema_version, whole.header.schema_version) == (8, 5)
    assert None not in columns(tmp_path / "less", ["fitness.likeness"])["fitness.likeness"]
    assert all(one.same for one in replay(tmp_path / "less"))
    assert goes_on(tmp_path / "less", generations=5) == [5]
    same_as_all(tmp_path / "less", evocity.open_run(tmp_path / "less"))


@pytest.mark.slow
@pytest.mark.parametrize(("at_once", "block"), [(12, 16), (3, 4)])
def test_genomes_are_held_a_few_at_a_time_however_long_the_run(begun, monkeypatch, at_once, block):
    """Of 96 those of a block of births, and of their parents; a generation may be several."""
    monkeypatch.setattr("evocity.search.resume.rescore._AT_ONCE", at_once)
    goes_on(begun / "run", generations=11)
    read, known, most = Fabric.genome, [], 0

    def counted(*given):
        nonlocal most
        found = read(*given)
        known.append(weakref.ref(found))
        most = max(most, sum(one() is not None for one in known))
        return found

    monkeypatch.setattr(Fabric, "genome", counted)
    likeness = '[[fitness]]\nfile = "more.py"\nname = "likeness"\n'
    goes_on(begun / "run", recipe_with(begun, likeness, generations=11))
    assert len(known) > 96 + 40  # births, and their parents
    assert most <= 3 * block + 3  # and the last one that was scored


def test_who_opened_the_run_before_is_told_to_open_it_again(begun):
    early = RunLog(begun / "run")
    assert len(early.births(0)) == 8
    goes_on(begun / "run", recipe_with(begun, TALL))
    for read in (early.births, early.members, lambda: early.individuals([3])):
        with pytest.raises(RunError, match="have changed since the run was opened") as told:
            read()
        assert "open the run again" in told.value.remedy
    path = begun / "run" / "births" / "generation-00000001.parquet"
    path.write_bytes(path.read_bytes()[::-1])
    with pytest.raises(RunError, match="is damaged or not part of a run"):
        RunLog(begun / "run").births(0) and RunLog(begun / "run").individuals([9])


# -- measures that fail --------------------------------------------------------------------


@pytest.mark.slow
def test_a_birth_on_which_a_new_measure_fails_is_kept_and_not_judged(begun):
    out = begun / "run"
    before = columns(out)
    recipe = recipe_with(begun, ODD, max_failures=0.9)
    with Search.resume(out, recipe=recipe, workers=0, generations=4) as search:
        (note,) = search.notes
        list(search)
    after, now = RunLog(out), columns(out)
    count = len(before["id"])
    lacking = [id_ for id_ in range(count) if now["fitness.odd"][id_] is None]
    assert 0 < len(lacking) < count
    assert f"{len(lacking)} of them have no value of odd" in note
    assert {now["status"][one] for one in lacking} == {"ok"}
    assert not any(now["feasible"][one] for one in lacking)
    assert all("odd one" in now["error"][one] for one in lacking)
    assert now["fitness.spread"][:count] == before["fitness.spread"]
    assert not set(archive(after).births["id"].to_pylist()) & set(lacking)
    for generation in range(3):  # they come last, whoever lived
        members = after.members(generation)["id"].to_pylist()
        without = [one in lacking for one in members]
        assert without == sorted(without)
    assert not set(after.members(4)["id"].to_pylist()) & set(lacking)
    assert not evocity.open_run(out).columns.feasible[lacking].any()
    assert write_report(out).is_file()
    assert goes_on(out, generations=5) == [5]
    assert all(one.same for one in replay(out))


def test_a_measure_that_nobody_has_a_value_of_is_refused_unless_recorded(begun):
    out = begun / "run"
    contents = everything(out)
    never = '[[fitness]]\nfile = "more.py"\nname = "never"\n'
    with pytest.raises(RunError, match=r"no individual of generation 0 has a value of each.*never"):
        goes_on(out, recipe_with(begun, never))
    assert everything(out) == contents
    recipe = recipe_with(begun)
    record = '\nrecord = [{ file = "more.py", name = "never" }]\n[map]'
    recipe.write_text(recipe.read_text().replace("\n[map]", record, 1))
    goes_on(out, recipe)
    assert set(columns(out)["fitness.never"]) == {None}
    assert all(columns(out)["feasible"])


# -- islands, grids, and what is refused ---------------------------------------------------


@pytest.mark.slow
def test_islands_and_their_grids_go_on_by_other_measures(tmp_path):
    islands = """
[[islands]]
name = "many"
[[islands]]
name = "cells"
algorithm = "map_elites"
measures = ["roof"]
descriptors = ["gsi", "spread"]
grid = [4, 4]
ranges = [[0.0, 1.0], [4.0, 8.0]]
[migration]
every = 1
"""
    write_toy(tmp_path, recipe=islands)
    run(tmp_path / "toy.toml", tmp_path / "run", workers=0, generations=2)
    out = tmp_path / "run"
    shutil.copytree(out, tmp_path / "other")
    before = columns(out)
    recipe = recipe_with(tmp_path, ODD + islands)
    goes_on(out, recipe, generations=4)
    after = RunLog(out)
    assert after.header.measures == ("spread", "roof", "odd")
    assert columns(out)["fitness.gsi"][: len(before["id"])] == before["fitness.gsi"]
    told = after.history()[1]["islands"]
    assert set(told["many"]["best"]) == {"spread", "roof", "odd"}
    assert set(told["cells"]["best"]) == {"roof"}
    with Search.resume(tmp_path / "other", recipe=recipe, workers=0, generations=4) as search:
        next(iter(search))
    goes_on(tmp_path / "other")
    assert rows(out) == rows(tmp_path / "other")
    assert all(one.same for one in replay(out))


@pytest.mark.slow
def test_a_grid_is_filled_by_another_goal(tmp_path):
    search = """
[search]
algorithm = "map_elites"
descriptors = ["gsi", "spread"]
grid = [4, 4]
ranges = [[0.0, 1.0], [4.0, 8.0]]
"""
    roof = '[[fitness]]\nfile = "toys.py"\nname = "roof"\n'
    first = recipe_with(tmp_path, search, roof)
    run(first, tmp_path / "run", workers=0, generations=2)
    record = '\nrecord = [{ file = "toys.py", name = "roof" }]\n[map]'
    recipe = recipe_with(tmp_path, search, TALL)
    recipe.write_text(recipe.read_text().replace("\n[map]", record, 1))
    goes_on(tmp_path / "run", recipe, generations=4)
    after = RunLog(tmp_path / "run")
    assert after.header.measures == ("tall",)
    assert set(after.header.recorded) == {"roof", "gsi", "spread"}
    bins = archive(after).births
    told = columns(tmp_path / "run", ["id", "fitness.tall"])
    tall = dict(zip(*told.values(), strict=True))
    assert bins["fitness.tall"].to_pylist() == [tall[one] for one in bins["id"].to_pylist()]
    assert all(one.same for one in replay(tmp_path / "run"))


def test_all_that_measures_cannot_be_is_told_at_once_and_nothing_is_changed(begun):
    out = begun / "run"
    contents = everything(out)
    (begun / "apart").mkdir()
    (begun / "apart" / "toys.py").write_text(MORE)
    apart = '[[fitness]]\nfile = "apart/toys.py"\nname = "tall"\n'
    spread = '[[fitness]]\nfile = "toys.py"\nname = "spread"\n'
    far = '[[fitness]]\nname = "fabric_distance"\nreference = ["lyon-1er"]\n'
    recipe = recipe_with(begun, replacing=apart + spread + far)
    (begun / "toys.py").write_text((begun / "toys.py").read_text().replace("std()", "var()"))
    with pytest.raises(RecipeError, match=r"cannot continue with new\.toml") as caught:
        goes_on(out, recipe)
    told = [line.strip() for line in caught.value.found.splitlines()[1:]]
    assert [one.split(":")[0] for one in told] == [
        "fitness",
        "spread",
        "reference of fabric_distance",
        "fitness/toys.py",
    ]
    assert "roof is missing" in told[0]
    assert "its source has changed" in told[1]
    assert "a file of their own" in told[1]
    assert "'parents'" in told[2]
    assert everything(out) == contents


@pytest.mark.parametrize(
    ("search", "reason"),
    [("window = 8\n", "under way"), ('algorithm = "cma"\n', "learns from all")],
)
def test_a_window_and_an_algorithm_that_learns_keep_their_measures(tmp_path, search, reason):
    text = f"[search]\n{search}"
    goal = '[[fitness]]\nfile = "toys.py"\nname = "roof"\n'
    first = recipe_with(tmp_path, text, goal)
    run(first, tmp_path / "run", workers=0, generations=1)
    goals = goal + TALL.replace('"tall"\n', '"tall"\nmin = 1.0\n')
    with pytest.raises(RecipeError, match=f"other measures; they cannot change: .*{reason}"):
        goes_on(tmp_path / "run", recipe_with(tmp_path, text, goals))


def test_new_measures_are_trusted_as_those_of_any_recipe(begun, monkeypatch):
    """The recipe that is given is the user's own; a run that was not begun here is marked then, and
    its file of measures, changed by somebody, is not executed."""
    out, recipe = begun / "run", recipe_with(begun, TALL)
    monkeypatch.setenv("XDG_STATE_HOME", str(begun / "elsewhere"))
    with pytest.raises(RunError, match="was not started on this machine"):
        goes_on(out, generations=3)
    assert goes_on(out, recipe, generations=3) == [3]
    assert goes_on(out, generations=4) == [4]
    (begun / "more.py").write_text(MORE + "raise SystemExit\n")
    with pytest.raises(RunError, match=r"changed since the run began: .*tall"):
        goes_on(out, generations=5)


# -- kills ---------------------------------------------------------------------------------


class Killed(BaseException):
    """In the place of SIGKILL: nothing more is done to files."""


class _Hook:
    """What an audit hook asks, which can never be taken away."""

    place, left = None, 0


def _watch(event: str, given: tuple) -> None:
    if _Hook.place is None or event not in (
        "open",
        "os.rename",
        "os.remove",
        "os.mkdir",
        "os.rmdir",
        "shutil.rmtree",
    ):
        return
    if event == "open" and not (isinstance(given[1], str) and set(given[1]) & set("wax+")):
        return
    named = given[0] if isinstance(given[0], str | os.PathLike) else ""
    inside = os.fspath(named).startswith(_Hook.place)
    by_descriptor = event not in ("open", "shutil.rmtree") and not os.path.isabs(named)
    if inside or by_descriptor:
        _Hook.left -= 1
        if _Hook.left < 0:
            raise Killed


sys.addaudithook(_watch)


@contextmanager
def killed(place: Path, deed: int):
    """No deed on files in ``place`` is done any more from the ``deed``-th on."""
    _Hook.place, _Hook.left = str(place), deed
    try:
        yield
    finally:
        _Hook.place = None


def everything(out: Path) -> dict[str, bytes]:
    return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()}


def leftovers(out: Path) -> set[str]:
    return {one.name for one in out.iterdir()}


@pytest.fixture
def changing(tmp_path):
    """A short run, another recipe for it, and rows: of before, of the old one that goes on, of the
    new one, and of the new one that goes on."""
    run(write_toy(tmp_path), tmp_path / "run", workers=0, generations=1)
    recipe, found = recipe_with(tmp_path, ODD), {"before": rows(tmp_path / "run")}
    for name, new, more in (
        ("old", None, 2),
        ("changed", recipe, 1),
        ("new", recipe, 2),
    ):
        shutil.copytree(tmp_path / "run", tmp_path / name)
        goes_on(tmp_path / name, new, generations=more)
        found[name] = rows(tmp_path / name)
    found["parts"] = {name: leftovers(tmp_path / name) for name in ("old", "new")}
    return tmp_path, recipe, found


LONG = [pytest.mark.long, pytest.mark.timeout(3600)]


@pytest.mark.slow
@pytest.mark.parametrize("share", [pytest.param(1, marks=LONG), 23])
def test_killed_before_any_deed_on_files_a_run_is_the_old_one_or_the_new_one(changing, share):
    """Read at once, gone on with by its own recipe, and by the other one once more."""
    folder, recipe, found = changing
    deed, ended, states = 3, False, set()
    while not ended:
        out = folder / f"deed-{deed}"
        shutil.copytree(folder / "run", out)
        with killed(out, deed):
            try:
                goes_on(out, recipe, generations=1)
                ended = True
            except Killed:
                pass
        read = rows(out)
        changed = read == found["changed"]
        assert changed or read == found["before"], deed
        states.add(changed)
        assert len(archive(RunLog(out))) > 0
        shutil.copytree(out, folder / "again")
        goes_on(out, generations=2)
        kind = "new" if changed else "old"
        assert rows(out) == found[kind], deed
        # a copy of the recipe, or of a measure, may be there before it counts
        assert leftovers(out) - {"recipe-1.toml"} <= found["parts"][kind], deed
        events = [one["event"] for one in RunLog(out).events()]
        assert events.count("recipe") == changed, deed
        goes_on(folder / "again", None if changed else recipe, generations=2)
        assert rows(folder / "again") == found["new"], deed
        assert leftovers(folder / "again") == found["parts"]["new"], deed
        shutil.rmtree(folder / "again")
        deed += share
    assert deed > 40
    assert states == {True, False}


def test_what_was_scored_before_a_kill_is_not_scored_again(begun, monkeypatch):
    out, recipe, scored = begun / "run", recipe_with(begun, TALL), []
    evaluate = Evaluator.evaluate

    def counted(self, genome, *given):
        scored.append(genome.digest)
        if len(scored) == 12:
            raise Killed
        return evaluate(self, genome, *given)

    monkeypatch.setattr(Evaluator, "evaluate", counted)
    with pytest.raises(Killed):
        goes_on(out, recipe)
    (room,) = out.glob(".measures-*")
    assert [one.name for one in (room / "membership").iterdir()] == ["generation-00000000.parquet"]
    goes_on(out, recipe)
    assert len(scored) == 12 + 16  # those of generation 0 not twice
    assert not list(out.glob(".measures-*"))


@pytest.mark.parametrize("other", ["another recipe", "another source", "no recipe"])
def test_what_was_scored_for_another_change_is_dropped(begun, monkeypatch, other):
    out, recipe = begun / "run", recipe_with(begun, TALL)
    evaluate, left = Evaluator.evaluate, 12

    def few(self, genome, *given):
        nonlocal left
        left -= 1
        if left == 0:
            raise Killed
        return evaluate(self, genome, *given)

    monkeypatch.setattr(Evaluator, "evaluate", few)
    with pytest.raises(Killed):
        goes_on(out, recipe)
    (room,) = out.glob(".measures-*")
    if other == "another source":
        (begun / "more.py").write_text(MORE.replace("heights.max()", "heights.max() + 1"))
    if other == "another recipe":
        recipe.write_text(recipe.read_text() + 'goal = "min"\n')
    goes_on(out, None if other == "no recipe" else recipe)
    assert not room.exists()
    if other == "no recipe":
        assert RunLog(out).header.measures == ("spread", "roof")
        return
    more = float(other == "another source")
    births = RunLog(out).individuals(range(24))
    assert [b.values["tall"] for b in births] == [
        float(decode(b.genome).city.heights.max()) + more for b in births
    ]


# -- the files -----------------------------------------------------------------------------


def test_the_log_that_is_written_anew_is_sealed_and_merged(begun, monkeypatch):
    from evocity.store import layout, merge, rewrite

    for module in (layout, merge):
        monkeypatch.setattr(module, "SPANS", (2, 8))
    monkeypatch.setattr(rewrite, "SEGMENT", 2)
    out = begun / "run"
    goes_on(out, recipe_with(begun, TALL))
    names = sorted(one.name for one in (out / "births").iterdir())
    assert names == ["generation-00000002.parquet", "segment-00000000-00000001.parquet"]
    path = out / "births" / names[1]
    about = pq.read_metadata(path).metadata
    assert b"evocity.seal" in about
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(EvocityError, match="damaged"):
        RunLog(out).births()


def test_readers_see_the_new_log_before_it_is_moved(begun):
    """Provenance counts: as a kill right after it leaves a run."""
    out, moved = begun / "run", []
    from evocity.store import writer

    with patch.object(writer, "finish", moved.append):
        goes_on(out, recipe_with(begun, TALL), generations=3)
    assert moved
    (room,) = out.glob(".measures-*")
    assert json.loads((room / "about.json").read_text())
    assert RunLog(out).header.measures == ("spread", "roof", "tall")
    assert len(RunLog(out).births()) == 32
    before = rows(out)
    assert np.isfinite(columns(out)["fitness.tall"]).all()
    goes_on(out)
    assert rows(out) == before
    assert not room.exists()
