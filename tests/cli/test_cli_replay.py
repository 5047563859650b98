"""`evocity replay`."""

import json

import pytest
from cli_tools import call, contents, refused, write_recipe
from toy_runs import append_events

from evocity.report import write_report
from evocity.search import schedules
from evocity.store import RunLog

OWN = """
import random
import evocity

@evocity.fitness(goal="max")
def own(city):
    print("noise on standard output")
    return city.heights.mean() + {more}
"""


@pytest.fixture(scope="module")
def ended(tmp_path_factory):
    """A run of 24 births."""
    folder = tmp_path_factory.mktemp("replayed")
    call("run", write_recipe(folder), "--generations", 3, "--out", folder / "run")
    return folder / "run"


def with_measure(folder, more):
    """A run of a measure of the user's own."""
    recipe = write_recipe(folder, fitness='file = "own.py"')
    (folder / "own.py").write_text(OWN.format(more=more))
    call("run", recipe, "--generations", 1, "--out", folder / "run")
    return folder / "run"


def test_births_are_told_to_be_the_same(ended):
    before = contents(ended)
    told = json.loads(call("replay", ended, 9, 0, 9, "--json").stdout)
    same = {"same": True, "differs": {}, "reason": None}
    assert told == [{"id": 9} | same, {"id": 0} | same]
    text = call("replay", ended, 9, 0).output
    assert "9: the same\n0: the same\n2 of 2 births the same\n" in text
    assert contents(ended) == before


def test_all_births_and_a_sample_of_them(ended):
    every = json.loads(call("replay", ended, "--all", "--json").stdout)
    assert [one["id"] for one in every] == list(range(len(every)))
    assert {one["same"] for one in every} == {True}
    drawn = [
        [one["id"] for one in json.loads(call(*words, "--json").stdout)]
        for seed in (0, 1)
        for words in [("replay", ended, "--sample", 5, "--seed", seed)] * 2
    ]
    assert drawn[0] == drawn[1] != drawn[2] == drawn[3]
    assert len(set(drawn[0])) == 5
    many = json.loads(call("replay", ended, "--sample", 10**6, "--json").stdout)
    assert many == every


def test_what_differs_is_told_with_exit_code_1(tmp_path):
    out = with_measure(tmp_path, "random.random()")
    (told,) = json.loads(call("replay", out, 9, "--json", code=1).stdout)
    assert (told["id"], told["same"], list(told["differs"])) == (9, False, ["fitness.own"])
    pair = told["differs"]["fitness.own"]
    assert abs(pair["then"] - pair["now"]) < 1
    text = call("replay", out, 9, 8, code=1).stdout
    assert text.startswith(f"9: differs: fitness.own was {pair['then']}, is ")
    assert text.endswith("0 of 2 births the same, 2 differ\n")


def test_a_strangers_run_is_replayed_only_with_trust(tmp_path, monkeypatch):
    out = with_measure(tmp_path, "0")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "mine"))
    message = refused(tmp_path, "replay", out, 9, says="was not started on this machine")
    assert "own.py" in message
    assert "--trust" in message
    assert json.loads(call("replay", out, 9, "--trust", "--json").stdout)[0]["same"]
    refused(tmp_path, "replay", out, 9, says="was not started on this machine")


def test_a_changed_measure_is_executed_only_if_that_is_accepted(tmp_path):
    out = with_measure(tmp_path, "0")
    for path in (tmp_path / "own.py", *out.rglob("own.py")):
        path.write_text(OWN.format(more="7"))
    refused(tmp_path, "replay", out, 9, says="changed since the run began")
    words = ("replay", out, 9, "--accept-changes", "--trust", "--json")
    (told,) = json.loads(call(*words, code=1).stdout)
    pair = told["differs"]["fitness.own"]
    assert pair["now"] == pytest.approx(pair["then"] + 7)


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ((), "none, or several, of the arguments IDs, --all and --sample"),
        ((3, "--all"), "none, or several, of the arguments IDs, --all and --sample"),
        (("--all", "--sample", 3), "none, or several, of the arguments IDs, --all and --sample"),
        ((10**6,), "no individual 1000000"),
    ],
)
def test_strange_births_are_refused(ended, tmp_path, words, says):
    refused(tmp_path, "replay", ended, *words, says=says)


@pytest.mark.parametrize("words", [("-1",), ("x",), ("--sample", 0), ("0", "--workers", -1)])
def test_strange_words_are_refused(ended, words):
    call("replay", ended, *words, code=2)


def test_no_run_is_told(tmp_path):
    refused(tmp_path, "replay", tmp_path / "none", 1, says="no run at")


# -- what a run replays by itself -----------------------------------------------------------------


def test_what_a_run_finds_to_differ_is_told_everywhere(tmp_path, monkeypatch):
    monkeypatch.setattr(schedules, "RATE", 0.5)
    recipe = write_recipe(tmp_path, fitness='file = "own.py"')
    (tmp_path / "own.py").write_text(OWN.format(more="random.random()"))
    out = tmp_path / "run"
    result = call("run", recipe, "--generations", 2, "--workers", 0, "--out", out)
    assert result.stderr.count("differs when replayed: fitness.own was") == 1
    found = [one for one in RunLog(out).events() if one["event"] == "differs"]
    told = json.loads(call("status", out, "--json").stdout)["differs"]
    keys = ("generation", "id", "differs")
    assert told == [{key: one[key] for key in keys} for one in found] != []
    says = f"{len(found)} births differ when replayed, such as {found[0]['id']}: fitness.own was"
    assert says in call("status", out).stdout
    assert says in write_report(out).read_text()


def test_a_run_of_sound_measures_tells_of_nothing(ended):
    assert json.loads(call("status", ended, "--json").stdout)["differs"] == []
    assert "when replayed" not in call("status", ended).stdout
    assert "when replayed" not in write_report(ended).read_text()


def test_strange_events_are_no_harm(tmp_path):
    out = with_measure(tmp_path, "0")
    pair = {"then": "\x1b[31m", "now": "<script>alert(1)</script>"}
    strange = 3, None, {"a": 1}, {"<b>": pair}, {"c": {"then": 1}}
    for number, differs in enumerate(strange):
        event = {"event": "differs", "id": number, "generation": [], "differs": differs}
        append_events(out, event)
    append_events(out, {"event": "differs", "id": "<b>", "differs": {}})
    append_events(out, {"event": "differs", "id": 3, "generation": 0, "differs": {"<b>": pair}})
    text = call("status", out).stdout
    assert "1 births differ" not in text
    assert "1 birth differs when replayed, such as 3: <b> was" in text
    assert "\x1b" not in text
    assert "<script>alert" not in write_report(out).read_text()
