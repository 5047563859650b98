"""`record` of `[run]`: measures logged of every birth that nothing is wanted of."""

import itertools
import json
import math
import re
import shutil
from unittest.mock import patch

import pytest
from test_search_recipe import faults, replaced
from test_search_run import run
from toy_runs import unsealed

import evocity
from evocity import fitness
from evocity.analysis.goals import recorded_of
from evocity.analysis.page import Page
from evocity.analysis.thumbnails import cities_of
from evocity.coding import decode
from evocity.errors import RunError
from evocity.evaluation.evaluator import Evaluator
from evocity.fitness import registry
from evocity.report import unrecorded, write_report
from evocity.report.html import other_measures
from evocity.search import Search, archive, read_recipe
from evocity.search.preparation.preparation import prepare
from evocity.store import Header, RunLog

#: A measure that fails in each of the ways there are, by the child it is asked of.
MOODS = """
@evocity.fitness()
def mood(city):
    kind = number(city) % 4
    if kind == 0:
        raise ValueError("out of sorts")
    if kind == 1:
        return evocity.fitness.Undefined("no mood today")
    if kind == 2:
        return "glad"
    return 1.5
"""


def recording(toy, record, measures="", **settings):
    path = toy(**settings)
    (path.parent / "more.py").write_text("from toys import number\nimport evocity\n" + measures)
    return replaced(path, 'name = "toy"', f'name = "toy"\nrecord = {record}')


def without(table, *names):
    return table.drop_columns([*names, "seconds"]).replace_schema_metadata(None)


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_every_birth_is_measured_and_the_search_is_what_it_was(
    toy, tmp_path, finished_runs, workers
):
    record = '["fsi", "mean_height"]'
    run(recording(toy, record), tmp_path / "recorded", workers=workers)
    finished_runs.copy("plain", tmp_path)
    found, plain = RunLog(tmp_path / "recorded"), RunLog(tmp_path / "run")
    names = ("fitness.fsi", "fitness.mean_height")
    assert without(found.births(), *names).equals(without(plain.births()))
    assert found.members().to_pylist() == plain.members().to_pylist()
    assert [{**one, "evaluations_per_second": 0} for one in found.history()] == [
        {**one, "evaluations_per_second": 0} for one in plain.history()
    ]
    for row in found.births().to_pylist():
        city = decode(found.genome(row["id"])).city
        for name in names:
            assert row[name] == fitness.get(name.removeprefix("fitness."))(city)
        assert found.individuals([row["id"]])[0].values["fsi"] == row["fitness.fsi"]
    assert found.header.measures == ("spread", "roof")
    assert found.header.recorded == ("fsi", "mean_height")
    assert set(found.status()["best"]) == {"spread", "roof"}
    assert "fitness.fsi" in found.ancestors(9).column_names


def test_goals_fronts_and_the_archive_do_not_see_them(toy, tmp_path, finished_runs):
    run(recording(toy, '["fsi"]'), tmp_path / "recorded", workers=0)
    finished_runs.copy("plain", tmp_path)
    one, other = (archive(RunLog(tmp_path / name)) for name in ("recorded", "run"))
    assert one.births["id"].equals(other.births["id"])
    assert one.hypervolume == other.hypervolume
    told = RunLog(tmp_path / "recorded").provenance
    assert [entry["name"] for entry in told["fitness"]] == ["spread", "roof"]
    assert [entry["name"] for entry in told["recorded"]] == ["fsi"]


@pytest.mark.slow
def test_the_report_tells_them_as_recorded(toy, tmp_path):
    run(recording(toy, '["fsi"]'), tmp_path / "run", workers=0)
    shown = Page(evocity.open_run(tmp_path / "run"))
    assert [aim.name for aim in shown.run.aims] == ["spread", "roof"]
    first = shown.keep[0]["id"]
    (others,) = other_measures(shown, cities_of(shown.run.columns, [first])).values()
    assert others
    assert "fsi" not in [one[0] for one in others]
    page = write_report(tmp_path / "run").read_text()
    assert re.search(r"<td>fsi</td><td></td><td>recorded</td>", page)
    assert page.count('<th scope="row">fsi<small>recorded</small>') == len(shown.keep)
    folded = [part.split("</details>")[0] for part in page.split("<details>")[1:]]
    cell = '<th scope="row">fsi</th>'
    assert not any(cell in part for part in folded)
    assert page.count(cell) == len(shown.parents)


@pytest.mark.parametrize("workers", [0, 2])
def test_what_fails_to_be_recorded_fails_nothing(toy, tmp_path, finished_runs, workers):
    run(recording(toy, '["more.py", "fsi"]', MOODS), tmp_path / "recorded", workers=workers)
    finished_runs.copy("plain", tmp_path)
    found = RunLog(tmp_path / "recorded")
    names = ("fitness.mood", "fitness.fsi", "error")
    plain = RunLog(tmp_path / "run").births()
    assert without(found.births(), *names).equals(without(plain, "error"))
    seen = set()
    for row in found.births().to_pylist():
        assert row["status"] == "ok"
        assert row["fitness.fsi"] is not None
        if row["fitness.mood"] is not None:
            assert (row["fitness.mood"], row["error"]) == (1.5, None)
            seen.add("value")
            continue
        assert row["error"].startswith("not recorded: mood")
        seen |= {word for word in ("out of sorts", "no mood today", "glad") if word in row["error"]}
    assert seen == {"value", "out of sorts", "no mood today", "glad"}
    assert "births, such as: mood" in unrecorded(found)
    assert found.status()["failures"] == 0


def test_a_birth_that_fails_is_recorded_as_far_as_it_can_be(toy):
    measures = "@evocity.fitness(goal='max')\ndef bad(city):\n    return float('nan')\n"
    prepared = prepare(read_recipe(recording(toy, '["fsi"]')))
    evaluator = Evaluator(prepared.setup)
    genome = prepared.sources[0].genome
    assert evaluator.evaluate(genome).values["fsi"] > 0
    path = recording(toy, '["fsi"]')
    (path.parent / "toys.py").write_text((path.parent / "toys.py").read_text() + measures)
    told = Evaluator(prepare(read_recipe(path)).setup).evaluate(genome)
    assert (told.status, told.error) == ("invalid", "bad is nan: no reason given")
    assert told.values["fsi"] > 0


def test_a_stopped_run_records_on(toy, tmp_path):
    recipe = recording(toy, '["fsi", { file = "more.py", name = "mood" }]', MOODS)
    run(recipe, tmp_path / "whole", workers=0)
    with Search(read_recipe(recipe), tmp_path / "away" / "parted", workers=0) as search:
        next(iter(search))
    for path in [*tmp_path.glob("*.py"), *tmp_path.glob("*.npy")]:
        path.unlink()
    (tmp_path / "away").rename(tmp_path / "far")
    parted = tmp_path / "far" / "parted"
    with Search.resume(parted, workers=0) as search:
        assert search.notes == []
        list(search)
    whole, other = RunLog(tmp_path / "whole").births(), RunLog(parted).births()
    for name in ("genome", "fitness.fsi", "fitness.mood"):
        assert whole.column(name).equals(other.column(name))


def test_a_change_of_what_is_recorded_is_told(toy, tmp_path):
    run(recording(toy, '["fsi", "more.py"]', MOODS), tmp_path / "run", workers=0, generations=1)
    (tmp_path / "more.py").write_text((tmp_path / "more.py").read_text() + "\n# edited\n")
    with pytest.raises(RunError, match="the source of the measure mood"):
        Search.resume(tmp_path / "run", generations=2)
    with Search.resume(tmp_path / "run", generations=2, workers=0, accept_changes=True) as search:
        list(search)
    kept = (tmp_path / "run" / "fitness" / "more.py").read_text()
    assert kept.endswith("# edited\n")
    text = (tmp_path / "run" / "recipe.toml").read_text()
    (tmp_path / "run" / "recipe.toml").write_text(text.replace('"fsi", ', ""))
    with pytest.raises(RunError, match=r"run\.record was .*fsi.* and is now"):
        Search.resume(tmp_path / "run", generations=3, accept_changes=True)


def test_recorded_measures_may_compare_and_ask_for_genomes(toy, tmp_path):
    record = '["integrity", { name = "fabric_distance", reference = ["right"] }]'
    run(recording(toy, record, population=4), tmp_path / "run", workers=0, generations=0)
    found = RunLog(tmp_path / "run")
    right = found.sources()[1].city
    for row in found.births().to_pylist():
        genome = found.genome(row["id"])
        city = decode(genome).city
        expected = fitness.fabric_distance(city, right)
        told = row["fitness.fabric_distance"]
        assert math.isnan(expected) if told is None else told == pytest.approx(expected)
        assert 0 <= row["fitness.integrity"] <= 1
    assert found.provenance["recorded"][1]["reference"].keys() == {"right.npy"}


def test_who_evaluates_elsewhere_may_leave_them_out(toy, tmp_path):
    recipe = read_recipe(recording(toy, '["fsi"]', population=4, generations=0))
    with Search(recipe, tmp_path / "run", workers=0) as search:
        one = {"spread": 1.0, "roof": 2.0}
        told = [one, one | {"fsi": 3.0}, one | {"fsi": math.nan}, one | {"fsi": "many"}]
        count = len(search.ask())
        with pytest.raises(RunError, match="with values of fsi if they are known"):
            search.tell([one | {"gsi": 1.0}] * count)
        search.tell(told[:count])
    births = RunLog(tmp_path / "run").births().to_pylist()
    assert [row["fitness.fsi"] for row in births] == [None, 3.0, None, None]
    assert [row["status"] for row in births] == ["ok"] * 4
    assert births[2]["error"] == "not recorded: fsi is nan"


def test_versions_tell_what_a_run_has(toy, tmp_path):
    """3 of crowding alone, 4 with what is recorded, 5 by another algorithm."""
    crowding = "\n[search]\nalgorithm = 'nsga2'\n"
    for name, version, more, record in (
        ("run", 4, crowding, True),
        ("plain", 3, crowding, False),
        ("new", 5, "", True),
        ("newest", 5, "", False),
    ):
        path = recording(toy, '["fsi"]') if record else toy()
        path.write_text(path.read_text(encoding="utf-8") + more, encoding="utf-8")
        run(path, tmp_path / name, workers=0, generations=0)
        told = RunLog(tmp_path / name).provenance
        assert told["schema_version"] == version
        assert ("recorded" in told["header"]) == (version > 3)
        assert ("recorded" in told) == record
        assert ("marks" in told["header"]) == (version > 4)
        path.unlink()
    shutil.copytree(tmp_path / "run", tmp_path / "harmed")
    told = unsealed(tmp_path / "harmed" / "provenance.json")
    told["header"]["recorded"] = ["spread"]
    (tmp_path / "harmed" / "provenance.json").write_text(json.dumps(told))
    with pytest.raises(RunError, match="damaged"):
        RunLog(tmp_path / "harmed")


def test_headers_travel(toy):
    about = (16, 16, 2.0, 0.9, ("town",), "", None, None, 7, 2, "hash", ("gsi",))
    every = itertools.product(((), ("fsi", "osr")), (("crowding",), ("contribution",), ()))
    for recorded, marks in every:
        header = Header(*about, recorded=recorded, marks=marks)
        assert Header.from_json(header.to_json(), "run") == header


@pytest.mark.parametrize(
    ("record", "key", "says"),
    [
        ('["fsy"]', "run.record[0]", "did you mean fsi?"),
        ('["fsi", "fsi"]', "run.record[1]", "fsi twice"),
        ('["fsi", "gsi"]', "run.record[1]", "gsi, which is in [[fitness]] too"),
        ('["toys.py"]', "run.record[0]", "roof, which is in [[fitness]] too"),
        (
            "[{ file = 'toys.py', name = 'roof' }]",
            "run.record[0]",
            "roof, which is in [[fitness]] too",
        ),
        ('["none.py"]', "run.record[0]", "no Python file"),
        ('"fsi"', "run.record", "a list"),
        ("[3]", "run.record[0]", "the name of a measure, a file NAME.py, or a table"),
        ("[{ name = 'fsi', goal = 'max' }]", "run.record[0].goal", "name, file, reference"),
        ("[{ name = 'fsi', reference = 'parents' }]", "run.record[0]", "compares with no city"),
        ("[{}]", "run.record[0]", "neither a name nor a file"),
    ],
)
def test_bad_records_are_told(toy, record, key, says):
    path = recording(toy, record)
    path.write_text(path.read_text() + "[[fitness]]\nname = 'gsi'\ntarget = 0.3\n")
    lines = faults(path)
    assert any(line.startswith(f"{key}: ") and says in line for line in lines), lines


def test_of_a_whole_file_what_is_a_goal_already_is_not_recorded_twice(toy):
    measures = "@evocity.fitness()\ndef more(city):\n    return 1.0\n"
    path = recording(toy, '[{ file = "more.py" }]', measures + measures.replace("more", "most"))
    goal = "[[fitness]]\nname = 'more'\nfile = 'more.py'\ntarget = 1\n"
    path.write_text(path.read_text() + goal)
    recipe = read_recipe(path)
    assert [one.name for one in recipe.recorded] == ["most"]
    found = Evaluator(prepare(recipe).setup).header
    assert found.recorded == ("most",)


def test_what_an_own_measure_says_of_itself_is_known_without_it(toy, tmp_path):
    """Its unit and its meaning, wanted or recorded; a later process has not loaded its file."""
    told = {"widest": ("max", "m²"), "farthest": (None, "km")}
    head = "import evocity\n@evocity.fitness(goal={!r}, unit={!r})\ndef {}(city):\n"
    body = '    """The {}.\n\n    By far.\n    """\n    return city.heights.max()\n'
    recipe = toy(population=4, generations=0)
    for name, (goal, unit) in told.items():
        text = head.format(goal, unit, name) + body.format(name)
        (recipe.parent / f"{name}.py").write_text(text)
    text = recipe.read_text().replace('file = "toys.py"', 'file = "widest.py"')
    recipe.write_text(text.replace("[run]", '[run]\nrecord = ["farthest.py"]'))
    run(recipe, tmp_path / "run", workers=0)
    with patch.object(registry, "_from_files", {}):
        found = evocity.open_run(tmp_path / "run")
        aims = [*found.aims, *recorded_of(found)]
    assert [(one.name, one.unit, one.meaning) for one in aims] == [
        ("widest", "m²", "The widest."),
        ("farthest", "km", "The farthest."),
    ]
