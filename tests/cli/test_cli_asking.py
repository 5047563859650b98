"""`evocity pick`, `reweight` and `stop`."""

import json

import pytest
from cli_tools import call, refused, write_recipe

from evocity.store import RunLog


@pytest.fixture(scope="module")
def ended(finished_runs, tmp_path_factory):
    """A run that is finished."""
    return finished_runs.copy("commanded", tmp_path_factory.mktemp("ended"))


@pytest.mark.slow
def test_a_run_that_has_ended_takes_commands_up_when_it_is_resumed(tmp_path):
    ended = tmp_path / "run"
    call("run", write_recipe(tmp_path), "--out", ended)
    assert "once it goes on: evocity resume" in call("pick", ended, 2, 4, "--share", 1).output
    assert "weights: mutation 0" in call("reweight", ended, "mutation=0").output
    told = json.loads(call("status", ended, "--json").stdout)
    assert (told["picked"], told["weights"]) == ([], {})
    assert told["waiting"] == [
        "picked: 2 4, first parents of 100 % of the births",
        "weights: mutation 0",
    ]
    with (ended / "commands.jsonl").open("a") as lines:
        lines.write('{"command": "pick", "ids": [99]}\n')
    resumed = call("resume", ended, "--generations", 4).stderr
    assert "as requested, from generation 3 on: weights: mutation 0" in resumed
    assert "a command was refused: " in resumed
    told = json.loads(call("status", ended, "--json").stdout)
    assert (told["waiting"], told["picks_share"]) == ([], 1.0)
    assert [one["generation"] for one in told["refused"]] == [3]
    assert "before generation 3: " in call("status", ended).stdout
    assert (told["picked"], told["weights"]) == ([2, 4], {"mutation": 0.0})
    text = call("status", ended).stdout
    assert "2 4" in text
    assert "mutation 0" in text
    births = [b for b in RunLog(ended).births().to_pylist() if b["generation"] > 2]
    assert {b["parents"][0] for b in births} == {2, 4}
    assert {b["operator"] for b in births} == {"pavement_fusion"}
    call("pick", ended, 2, "--clear")
    call("resume", ended, "--generations", 5)
    assert json.loads(call("status", ended, "--json").stdout)["picked"] == [4]
    call("pick", ended, "--clear")
    call("resume", ended, "--generations", 6)
    assert json.loads(call("status", ended, "--json").stdout)["picked"] == []


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("pick", 99), "no individual 99"),
        (("pick",), "neither the id of an individual nor --clear"),
        (("pick", 1, "--clear"), "1 is not picked"),
        (("pick", 1, 2, "--share", 1.5), "the picked births 1 2 with the share 1.5"),
        (("reweight", "mutation=0", "pavement_fusion=0"), "all operators would have"),
        (("pick", 1, "--share", 0.5, "--clear"), "--share cannot be combined with --clear"),
        (("stop",), "this run is not in progress"),
        (("reweight", "mutation"), "NAME=WEIGHT"),
        (("reweight", "mutation=-1"), "NAME=WEIGHT"),
        (("reweight", "mutaton=1"), "did you mean mutation"),
        (("reweight", "gsi=2"), "has no weight 'gsi'"),
    ],
)
def test_what_cannot_be_carried_out_is_refused(ended, words, says):
    command, *rest = words
    refused(ended, command, ended, *rest, says=says)


def test_no_run_is_told_as_such(tmp_path):
    refused(tmp_path, "pick", tmp_path, 1, says="no run at")
