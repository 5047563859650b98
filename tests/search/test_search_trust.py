"""What a run folder brings is executed where it was begun, or where somebody trusts it."""

import json
import shutil
import stat
import sys

import pytest
from test_search_run import run
from toy_runs import unsealed

import evocity
from evocity.errors import RunError
from evocity.report import write_report
from evocity.search import Search
from evocity.search.preparation.trust import list_executed, list_untrusted, state_folder
from evocity.store import RunLog, hash_of_file, hash_of_text


@pytest.fixture
def elsewhere(monkeypatch, tmp_path):
    """Another machine, or another user's account."""

    def move(name="elsewhere"):
        monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / f"state-{name}"))

    return move


@pytest.fixture
def traced(toy, tmp_path):
    """A run whose measures leave a trace when they are executed, and no trace of it yet."""
    trace = tmp_path / "executed"
    path = toy(f"\nopen({str(trace)!r}, 'w').close()\n")
    run(path, tmp_path / "run", workers=0, generations=1)
    trace.unlink()
    return tmp_path / "run", trace


def rewritten(out, change):
    """Change what the provenance tells."""
    path = out / "provenance.json"
    told = unsealed(path)
    change(told)
    path.write_text(json.dumps(told), encoding="utf-8")


def test_a_run_begun_elsewhere_asks_for_trust_once(traced, elsewhere, monkeypatch):
    out, trace = traced
    home = state_folder()
    elsewhere()
    with pytest.raises(RunError, match="not started on this machine") as caught:
        Search.resume(out, workers=0)
    assert "toys.py" in caught.value.found
    assert "trust=True" in caught.value.remedy
    with pytest.raises(RunError, match="not started on this machine"):
        evocity.refine(out, 3, budget=2)
    assert not trace.exists()
    Search.resume(out, workers=0, trust=True).close()
    assert trace.exists()
    Search.resume(out, workers=0).close()  # it is remembered here,
    monkeypatch.setenv("XDG_STATE_HOME", str(home.parent))
    Search.resume(out, workers=0).close()  # and where it was begun


def test_a_copy_on_the_same_machine_needs_no_trust(traced, tmp_path):
    out, _ = traced
    shutil.copytree(out, tmp_path / "deep" / "copy")
    Search.resume(tmp_path / "deep" / "copy", workers=0).close()


@pytest.mark.parametrize("kind", ["measure", "recipe", "command", "marks"])
def test_a_stranger_cannot_change_what_a_marked_run_executes(traced, kind, tmp_path):
    out, trace = traced
    if kind == "measure":  # the run's own copy, and its hash too
        (tmp_path / "toys.py").unlink()
        path = out / "fitness" / "toys.py"
        path.write_text(path.read_text() + "\n# and more\n")

        def change(told):
            for one in told["fitness"]:
                one["hash"] = hash_of_file(path)
    elif kind == "marks":

        def change(told):
            told["marks"] = ["0" * 64]
    else:
        path = out / "recipe.toml"
        added = '[[fitness]]\nfile = "more.py"\n'
        if kind == "command":
            added = '[notify]\non_end = "touch here"\n'
        (tmp_path / "more.py").write_text(f"open({str(trace)!r}, 'w').close()\n")
        path.write_text(path.read_text() + added)

        def change(told):
            told["recipe"]["hash"] = hash_of_text(path.read_text())

    rewritten(out, change)
    with pytest.raises(RunError, match="would execute files or commands") as caught:
        Search.resume(out, workers=0, accept_changes=True)
    assert ("'touch here'" in caught.value.found) == (kind == "command")
    assert not trace.exists()


def test_changed_copies_are_no_users_own_change(traced, tmp_path):
    out, trace = traced
    (tmp_path / "toys.py").unlink()
    path = out / "fitness" / "toys.py"
    path.write_text(path.read_text() + "\n# and more\n")
    with pytest.raises(RunError, match="would execute files or commands"):
        Search.resume(out, workers=0, accept_changes=True)
    assert not trace.exists()


def test_commands_in_another_folder_are_others(toy, tmp_path):
    recipe = toy(recipe=f'[notify]\non_end = "{sys.executable} tell.py"\n')
    out = tmp_path / "run"
    run(recipe, out, workers=0, generations=0)
    assert list_untrusted(RunLog(out)) == []
    rewritten(out, lambda told: told["recipe"].update(folder="fitness"))
    assert list_untrusted(RunLog(out)) == ["toys.py", repr(f"{sys.executable} tell.py")]


def test_who_brings_nothing_needs_no_trust(toy, tmp_path, elsewhere):
    path = toy()
    path.write_text(path.read_text().replace('file = "toys.py"', 'name = "alignment"'))
    run(path, tmp_path / "run", workers=0, generations=0)
    elsewhere()
    assert list_executed(RunLog(tmp_path / "run")) == []
    Search.resume(tmp_path / "run", workers=0, generations=1).close()


def test_all_that_is_executed_is_told(toy, tmp_path):
    recipe = toy(recipe='[notify]\non_improvement = "a b"\non_end = "c"\n')
    text = recipe.read_text().replace('name = "toy"', 'name = "toy"\nrecord = ["more.py"]')
    recipe.write_text(text)
    more = "import evocity\n\n@evocity.fitness(goal='max')\ndef more(city):\n    return 1.0\n"
    (tmp_path / "more.py").write_text(more)
    run(recipe, tmp_path / "run", workers=0, generations=0)
    assert list_executed(RunLog(tmp_path / "run")) == ["more.py", "toys.py", "'a b'", "'c'"]


def test_looking_at_a_run_executes_nothing(traced, elsewhere):
    out, trace = traced
    elsewhere()
    opened = RunLog(out)
    opened.status(), opened.births(), opened.genome(3), opened.history(), opened.ancestors(5)
    evocity.archive(opened)
    write_report(out)
    assert not trace.exists()


def test_without_a_place_for_the_key_a_run_is_made_and_asks(toy, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("no folder")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=0)
    assert "marks" not in RunLog(out).provenance
    with pytest.raises(RunError, match="not started on this machine"):
        Search.resume(out, workers=0)
    Search.resume(out, workers=0, trust=True).close()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such modes")
def test_the_key_is_the_users_alone(toy, tmp_path, elsewhere):
    elsewhere("fresh")
    run(toy(), tmp_path / "run", workers=0, generations=0)
    key = state_folder() / "key"
    assert stat.S_IMODE(key.stat().st_mode) == 0o600
    assert len(key.read_bytes()) == 32
    assert key.read_bytes().hex() not in (tmp_path / "run" / "provenance.json").read_text()
    assert str(tmp_path) not in json.dumps(RunLog(tmp_path / "run").provenance["marks"])
