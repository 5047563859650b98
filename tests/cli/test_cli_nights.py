"""Nights on the command line: runs that end by themselves, and how they go on."""

import json

import pytest
from cli_tools import call, refused, write_recipe

import evocity


def with_lines(recipe, lines: str):
    recipe.write_text(recipe.read_text() + lines)
    return recipe


@pytest.fixture
def recipe(tmp_path):
    return write_recipe(tmp_path)


def line_of(text: str, name: str) -> str:
    (line,) = [line for line in text.splitlines() if line.split()[:1] == [name]]
    return line.split(maxsplit=1)[1]


# -- [stop] --------------------------------------------------------------------------------------


def test_a_stop_ends_well_and_says_why_and_how_to_go_on(tmp_path, recipe):
    with_lines(recipe, "[stop]\ntarget = { alignment = 0.0 }\n")
    out = tmp_path / "run"
    result = call("run", recipe, "--out", out)
    assert "report:" in result.stdout
    assert (out / "report.html").is_file()
    (line,) = [one for one in result.stderr.splitlines() if one.startswith("stopped: ")]
    assert line.startswith("stopped: target reached by ")
    assert f"go on with: evocity resume {out}, and more generations (--generations)" in line
    reason = evocity.open_run(out).events()[-1]["reason"]
    told = json.loads(call("status", out, "--json").stdout)
    assert (told["stopped"], told["finished"], told["generation"]) == (reason, False, 0)
    assert line_of(call("status", out).stdout, "finished").startswith(f"no; stopped: {reason}; ")
    assert reason in (out / "report.html").read_text(encoding="utf-8")
    result = call("resume", out)
    assert "Note: target reached by" in result.stderr
    assert "generation 1/2" not in result.stderr
    result = call("resume", out, "--generations", 2)
    assert "generation 2/2" in result.stderr
    assert json.loads(call("status", out, "--json").stdout)["stopped"] is None


def test_a_time_is_an_option_of_run_and_resume(tmp_path, recipe):
    refused(tmp_path, "run", recipe, "--until", "soon", says="--until 'soon'; allowed: \"07:00\"")
    late = ("--until", "2020-01-01T07:00")
    message = refused(tmp_path, "run", recipe, *late, "--out", tmp_path / "run", says="has passed")
    assert "2020-01-01T07:00" in message
    call("run", recipe, "--generations", 0, "--out", tmp_path / "run")
    refused(tmp_path, "resume", tmp_path / "run", "--until", "7", says="--until '7'")
    result = call("resume", tmp_path / "run", "--generations", 2, *late)
    assert "past 2020-01-01 07:00 still" in result.stderr
    result = call("resume", tmp_path / "run", "--until", "none")
    assert "generation 2/2" in result.stderr


# -- [notify] ------------------------------------------------------------------------------------


def test_a_command_that_fails_is_told_and_costs_nothing(tmp_path, recipe):
    with_lines(recipe, '[notify]\non_end = "no-such-program {reason}"\n')
    result = call("run", recipe, "--out", tmp_path / "run")
    assert "Note: notify.on_end: no program no-such-program is found" in result.stderr
    assert "Note: notify.on_end failed: No such file or directory" in result.stderr
    assert json.loads(call("status", tmp_path / "run", "--json").stdout)["finished"]
