"""A run folder is whole: moved to another place, it goes on to the same births."""

import json
import shutil
import sys

import numpy as np
import pytest
from click.testing import CliRunner
from test_search_run import rows, run
from toy_runs import unsealed

from evocity.cli import main
from evocity.errors import RecipeError, RunError
from evocity.search import Search
from evocity.store import RunLog

HELPER = "def scaled(value):\n    return 3.0 * value\n"
USING = """
from pathlib import Path
from helper import scaled

@evocity.fitness(goal="max", data="levels.csv")
def far(city):
    level = float(Path(__file__).with_name("levels.csv").read_text())
    return scaled(city.heights.max()) + number(city) % 7 + level
"""
LOCKED = '[locked]\nmask = "mask.npy"\n'
LIKE = '[[fitness]]\nname = "gsi"\nlike = "left.npy"\n'


@pytest.fixture
def home(tmp_path):
    """The folder of the recipe, its maps and measures."""
    return tmp_path


@pytest.fixture
def recipe(toy, home):
    (home / "helper.py").write_text(HELPER)
    (home / "levels.csv").write_text("0.5")
    mask = np.zeros((64, 64), np.float32)
    mask[8:16, 8:24] = 1
    np.save(home / "mask.npy", mask)
    return toy(USING, LIKE + LOCKED)


def moved(home, tmp_path):
    """The run, moved to where nothing else is; the recipe's folder is emptied."""
    place = tmp_path / "elsewhere" / "deep"
    place.mkdir(parents=True)
    shutil.move(home / "run", place / "run")
    for path in home.iterdir():
        if path.is_file():
            path.unlink()
    shutil.rmtree(home / "__pycache__", ignore_errors=True)
    return place / "run"


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_a_moved_run_goes_on_to_the_same_births(recipe, home, tmp_path, workers):
    run(recipe, home / "whole", workers=0)
    run(recipe, home / "run", workers=0, generations=1)
    out = moved(home, tmp_path)
    for _ in range(2):  # finished, it can be taken up once more
        with Search.resume(out, generations=3, workers=workers) as search:
            list(search)
            assert search.notes == []
    assert rows(out) == rows(home / "whole")
    assert "helper" not in sys.modules


def test_no_path_of_the_machine_is_kept(recipe, home, tmp_path):
    run(recipe, home / "run", workers=0, generations=0)
    told = RunLog(home / "run").provenance
    assert told["recipe"]["folder"] == ".."
    far = next(one for one in told["fitness"] if one["name"] == "far")
    assert (far["file"], far["kept"], far["beside"]) == (
        "toys.py",
        "fitness/toys.py",
        ["helper.py", "levels.csv"],
    )
    gsi = next(one for one in told["fitness"] if one["name"] == "gsi")
    assert gsi["file"] == "evocity/fitness/density.py"
    assert (home / "run" / "fitness" / "helper.py").read_text() == HELPER
    assert (home / "run" / "fitness" / "toys.py").read_bytes() == (home / "toys.py").read_bytes()
    del told["command"]
    assert str(tmp_path) not in json.dumps(told)
    assert sys.prefix not in json.dumps(told)


def test_moved_with_its_recipe_it_follows_the_files_there(recipe, home, tmp_path):
    run(recipe, home / "run", workers=0, generations=0)
    there = tmp_path / "there"
    shutil.copytree(home, there, ignore=lambda _, names: {"there"} & set(names))
    Search.resume(there / "run", workers=0, generations=1).close()
    (there / "helper.py").write_text(HELPER.replace("3.0", "4.0"))
    with pytest.raises(RunError, match=r"the measure far \(toys\.py, or what it imports: helper"):
        Search.resume(there / "run")
    with Search.resume(there / "run", workers=0, generations=1, accept_changes=True) as search:
        list(search)
    assert "4.0" in (there / "run" / "fitness" / "helper.py").read_text()
    (there / "helper.py").unlink()
    (there / "toys.py").unlink()
    Search.resume(there / "run", workers=0, generations=2).close()  # its copy is the one accepted
    Search.resume(home / "run", workers=0, generations=1).close()  # nothing changed there


def test_an_edited_copy_is_named_and_not_executed(recipe, home, tmp_path):
    run(recipe, home / "run", workers=0, generations=0)
    out = moved(home, tmp_path)
    trace = tmp_path / "executed"
    copy = out / "fitness" / "helper.py"
    copy.write_text(HELPER + f"open({str(trace)!r}, 'w').close()\n")
    with pytest.raises(RunError, match="the source of the measure far"):
        Search.resume(out)
    for words in (("status", out), ("report", out), ("show", out, "-o", tmp_path / "a.png")):
        assert CliRunner().invoke(main, list(map(str, words))).exit_code == 0
    assert not trace.exists()
    confirmed = {"accept_changes": True, "trust": True}
    Search.resume(out, workers=0, generations=1, **confirmed).close()
    assert trace.exists()


def test_a_copy_that_is_gone_is_told(recipe, home, tmp_path):
    run(recipe, home / "run", workers=0, generations=0)
    out = moved(home, tmp_path)
    (out / "fitness" / "toys.py").unlink()
    with pytest.raises(RunError, match=r"measure spread, .*toys\.py, .*which is missing"):
        Search.resume(out)
    with pytest.raises(RecipeError, match=r"no Python file at .*toys\.py"):
        Search.resume(out, accept_changes=True)


@pytest.mark.parametrize("place", ["../toys.py", "sources/../../toys.py", "/etc/passwd", 3])
def test_a_copy_lies_in_its_folder(recipe, home, tmp_path, place):
    run(recipe, home / "run", workers=0, generations=0)
    out = moved(home, tmp_path)
    path = out / "provenance.json"
    told = unsealed(path)
    told["fitness"][0]["kept"] = place
    path.write_text(json.dumps(told), encoding="utf-8")
    with pytest.raises(RunError, match="as the source of a measure"):
        Search.resume(out)


@pytest.mark.skipif(sys.platform == "win32", reason="links need rights there")
@pytest.mark.parametrize("linked", ["fitness", "fitness/toys.py"])
def test_links_in_place_of_copies_are_refused(recipe, home, tmp_path, linked):
    run(recipe, home / "run", workers=0, generations=0)
    out = moved(home, tmp_path)
    (out / linked).rename(tmp_path / "outside")
    (out / linked).symlink_to(tmp_path / "outside")
    with pytest.raises(RunError, match="is a link"):
        Search.resume(out)


def test_measures_of_two_folders_keep_apart(recipe, home, tmp_path):
    (home / "more").mkdir()
    for name in ("toys.py", "helper.py", "levels.csv"):
        text = (home / name).read_text().replace("3.0", "5.0")
        for old in ("spread", "roof", "far"):
            text = text.replace(f"def {old}(", f"def {old}_more(")
        (home / "more" / name).write_text(text)
    recipe.write_text(recipe.read_text() + '[[fitness]]\nfile = "more/toys.py"\n')
    run(recipe, home / "whole", workers=0)
    run(recipe, home / "run", workers=0, generations=1)
    out = moved(home, tmp_path)
    shutil.rmtree(home / "more")
    assert (out / "fitness" / "from-2" / "toys.py").is_file()
    with Search.resume(out, generations=3, workers=0) as search:
        list(search)
    assert rows(out) == rows(home / "whole")


def test_a_run_of_old_gets_its_copies_when_it_is_taken_up(recipe, home, tmp_path):
    run(recipe, home / "whole", workers=0)
    run(recipe, home / "run", workers=0, generations=1)
    shutil.rmtree(home / "run" / "fitness")
    path = home / "run" / "provenance.json"
    told = unsealed(path)
    told["recipe"]["folder"] = str(home)
    for one in told["fitness"]:
        one["file"] = str(home / one["file"]) if "kept" in one else "/site/" + one["file"]
        one.pop("kept", None)
        if "beside" in one:
            one["beside"] = [str(home / name) for name in one["beside"]]
    path.write_text(json.dumps(told), encoding="utf-8")
    with pytest.raises(RunError, match="not started on this machine"):
        Search.resume(home / "run", workers=0, generations=1)
    Search.resume(home / "run", workers=0, generations=1, trust=True).close()
    out = moved(home, tmp_path)
    with Search.resume(out, generations=3, workers=0) as search:
        list(search)
    assert rows(out) == rows(home / "whole")
