"""Nights on the command line: runs that end by themselves, and how they go on."""

import json

import pytest
from cli_tools import call, refused, write_recipe
from click.testing import CliRunner

import evocity
from evocity.cli import main


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


@pytest.mark.slow
def test_a_stop_ends_well_and_says_why_and_how_to_go_on(tmp_path, recipe):
    with_lines(recipe, "[stop]\ntarget = { alignment = 0.0 }\n")
    out = tmp_path / "run"
    result = call("run", recipe, "--out", out, report=True)
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


@pytest.mark.slow
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


# -- trust ---------------------------------------------------------------------------------------

OWN = """
import evocity

@evocity.fitness(goal="max")
def own(city):
    return city.heights.mean()
"""


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    """A run of somebody else's, with a measure of their own."""
    recipe = write_recipe(tmp_path, fitness='file = "own.py"')
    (tmp_path / "own.py").write_text(OWN)
    call("run", recipe, "--generations", 1, "--out", tmp_path / "run")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "mine"))
    return tmp_path / "run"


def test_a_strangers_run_is_executed_only_with_trust(stranger, tmp_path):
    refine = ("refine", stranger, "--id", 3, "-o", tmp_path / "x.parquet")
    for words in (("resume", stranger), refine):
        message = refused(tmp_path, *words, says="was not started on this machine")
        assert "own.py" in message
        assert "--trust" in message
    for words in (("status", stranger), ("score", stranger, "--id", 3)):
        call(*words)
    call("resume", stranger, "--generations", 2, "--trust")
    call("resume", stranger)


@pytest.mark.parametrize(("answer", "code"), [("y\n", 0), ("n\n", 2), ("\n", 2)])
def test_at_a_terminal_trust_is_asked_for(stranger, monkeypatch, answer, code):
    monkeypatch.setattr("evocity.cli.shared.inputs._at_terminal", lambda: True)
    result = CliRunner().invoke(main, ["resume", str(stranger)], input=answer)
    assert result.exit_code == code
    assert "commands:\n  own.py\n" in result.stderr


# -- another recipe, an estimate -----------------------------------------------------------------


@pytest.mark.slow
def test_a_run_goes_on_by_another_recipe(tmp_path, recipe):
    result = call("run", recipe, "--generations", 1, "--out", tmp_path / "run")
    assert "estimate: 12 births of " in result.stderr
    text = recipe.read_text()
    recipe.write_text(text.replace("seed = 3", "seed = 4"))
    message = refused(tmp_path, "resume", tmp_path / "run", "--recipe", recipe, says="run.seed: ")
    assert "it cannot change: all births are drawn from it" in message
    recipe.write_text(text.replace("target = 0.35", "target = 0.5"))
    result = call("resume", tmp_path / "run", "--recipe", recipe)
    assert "Note: goes on by another recipe, changed in fitness" in result.stderr
    assert "generation 2/2" in result.stderr
    assert "estimate" not in result.stderr
    assert (tmp_path / "run" / "recipe-1.toml").read_text() == text
