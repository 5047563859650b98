"""Taking a run up again: what changed is told before anything is executed or lost."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from codes import uniformly
from test_search_run import run
from towns import draw_town
from toy_runs import unsealed, without_digests

import evocity
from evocity import fitness, read_map, store
from evocity.errors import RecipeError, RunError
from evocity.evaluation.evaluator import MOST_LETTERS, Outcome
from evocity.io import write_map
from evocity.recipe.values import free_name
from evocity.report import contact_sheet, write_report
from evocity.search import Search, read_recipe
from evocity.search.preparation.provenance import file_hash
from evocity.selection.fronts import Hypervolume, crowding_of, ranks_of
from evocity.store import RunLog

AT_2_M = {"metres_per_pixel": 2.0}


def test_a_changed_measure_is_not_executed_before_it_is_confirmed(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=0)
    trace = tmp_path / "executed"
    with open(tmp_path / "toys.py", "a") as file:
        file.write(f"\nopen({str(trace)!r}, 'w').close()\n")
    with pytest.raises(RunError, match="source of the measure spread; the source of the measure"):
        Search.resume(out)
    assert not trace.exists()
    Search.resume(out, workers=0, accept_changes=True).close()
    assert trace.exists()


@pytest.mark.slow
def test_a_file_that_a_measure_imports_is_watched(toy, tmp_path):
    helper = tmp_path / "helper.py"
    helper.write_text("FACTOR = 2.0\n")
    body = """
from helper import FACTOR

@evocity.fitness(goal="max")
def scaled(city):
    return FACTOR * float(city.heights.std())
"""
    out = tmp_path / "run"
    first = run(toy(body), out, workers=2, generations=1)
    assert all(one.values["scaled"] == 2 * one.values["spread"] for one in first[-1].population)
    assert [path.name for path in tmp_path.glob("__pycache__")] == []
    with Search.resume(out, workers=1, generations=2) as search:
        (last,) = search
    assert {one.values["scaled"] / one.values["spread"] for one in last.population} == {2}
    helper.write_text("FACTOR = 3.0\n")
    with pytest.raises(RunError, match=r"measure scaled \(toys.py, or what it imports: helper.py"):
        Search.resume(out)
    helper.unlink()
    with pytest.raises(RunError, match=r"scaled, .*helper\.py, which is missing"):
        Search.resume(out)
    helper.write_text("FACTOR = 2.0\n")
    Search.resume(out, workers=0).close()


def test_a_measure_the_provenance_does_not_know_is_not_executed(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=0)
    path = out / "provenance.json"
    text = path.read_text().replace("toys.py", "others.py")
    path.write_text(text.replace('"seal"', '"other"'))
    with pytest.raises(RunError, match=r"the measures of .*toys\.py"):
        Search.resume(out)


def test_the_city_to_be_like_is_watched(toy, tmp_path):
    recipe = toy()
    np.save(tmp_path / "model.npy", np.load(tmp_path / "left.npy"))
    recipe.write_text(recipe.read_text() + '[[fitness]]\nname = "gsi"\nlike = "model.npy"\n')
    out = tmp_path / "run"
    run(recipe, out, workers=0, generations=0)
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy"))
    with pytest.raises(RunError, match=r"the map model\.npy, which cities shall be like"):
        Search.resume(out)


def test_a_parent_to_be_like_goes_by_its_name(toy, tmp_path):
    recipe = toy()
    text = recipe.read_text().replace('map = "left.npy"', 'map = "left.npy"\nname = "west"')
    recipe.write_text(text + '[[fitness]]\nname = "gsi"\nlike = "west"\n')
    out = tmp_path / "run"
    run(recipe, out, workers=0, generations=0)
    noted = RunLog(out).provenance["fitness"][-1]
    west = read_map(tmp_path / "left.npy", metres_per_pixel=2.0)
    assert noted["target"] == fitness.get("gsi")(west)
    Search.resume(out, workers=0, generations=1).close()  # nothing has changed
    recipe.write_text(text + '[[fitness]]\nname = "gsi"\nlike = "wst"\n')
    with pytest.raises(
        RecipeError, match=r"'wst' is neither a file(.|\n)*parent's name: west, right"
    ):
        read_recipe(recipe)
    twice = text.replace('map = "right.npy"', 'map = "right.npy"\nname = "west"')
    recipe.write_text(twice + '[[fitness]]\nname = "gsi"\nlike = "west"\n')
    with pytest.raises(RecipeError, match="'west' is the name of 2 parents"):
        read_recipe(recipe)
    hidden = text.replace('"west"', '"lyon-1er"')
    recipe.write_text(hidden + '[[fitness]]\nname = "gsi"\nlike = "lyon-1er"\n')
    with pytest.raises(RecipeError, match="is the name of a parent, but another map"):
        read_recipe(recipe)


def test_a_parent_to_be_like_goes_by_its_maps_name(toy, tmp_path):
    recipe = toy()
    write_map(read_map(tmp_path / "right.npy", **AT_2_M, name="harbour"), tmp_path / "h.tif")
    text = recipe.read_text().replace('map = "right.npy"', 'map = "h.tif"')
    for name, file in (("left", "left.npy"), ("harbour", "h.tif")):
        recipe.write_text(text + f'[[fitness]]\nname = "gsi"\nlike = "{name}"\n')
        run(recipe, tmp_path / name, workers=0, generations=0)
        log = RunLog(tmp_path / name)
        noted = log.provenance["fitness"][-1]
        assert name in [source.name for source in log.sources()]
        assert noted["target"] == fitness.get("gsi")(read_map(tmp_path / file, **AT_2_M))
        assert noted["like"] == file
        Search.resume(tmp_path / name, workers=0, generations=1).close()  # nothing has changed
    recipe.write_text(text + '[[fitness]]\nname = "gsi"\nlike = "harbor"\n')
    with pytest.raises(RecipeError, match=r"did you mean harbour(.|\n)*name: left, harbour"):
        read_recipe(recipe)
    recipe.write_text(text + '[[fitness]]\nname = "gsi"\nlike = "lyon-1er"\n')
    assert read_recipe(recipe).parent_named("lyon-1er") is None  # a map is a map


def test_two_parents_of_one_map_are_called_as_in_the_run(toy, tmp_path):
    recipe = toy()
    text = recipe.read_text().replace('map = "right.npy"', 'map = "left.npy"\nheight_scale = 2.0')
    recipe.write_text(text + '[[fitness]]\nname = "fsi"\nlike = "left-2"\n')
    run(recipe, tmp_path / "run", workers=0, generations=0)
    log = RunLog(tmp_path / "run")
    second = log.sources()[1]
    assert second.name == "left-2"
    assert log.provenance["fitness"][-1]["target"] == fitness.get("fsi")(second.city)


def test_parents_are_fitted_if_the_recipe_says_so(toy, tmp_path):
    run(toy(genome="block = 4\nfit = true"), tmp_path / "run", workers=0, generations=0)
    for source in RunLog(tmp_path / "run").sources():
        fitted = uniformly(source.city, reach=24, fit=True).genome
        assert np.array_equal(source.genome.beta, fitted.beta)
        assert not np.array_equal(source.genome.beta, uniformly(source.city, reach=24).genome.beta)


def notes_of(out):
    with Search.resume(out, workers=0) as search:
        return search.notes


@pytest.mark.slow
def test_a_recipe_edited_since_is_told_and_not_followed(toy, tmp_path):
    recipe = toy()
    out = tmp_path / "run"
    run(recipe, out, workers=0, generations=0)
    recipe.write_text(recipe.read_text().replace("mutation = 2", "mutation = 9"))
    for _ in range(2):  # the second time as the first
        with Search.resume(out, workers=0) as search:
            (told,) = search.notes
            assert f"{recipe} differs from the run's own copy" in told
            assert f"(operators.mutation); to go on by it: --recipe {recipe}" in told
            assert search.recipe.operators["mutation"].weight == 2
    from click.testing import CliRunner

    from evocity.cli import main

    found = CliRunner().invoke(main, ["resume", str(out), "--workers", "0"])
    assert found.exit_code == 0
    assert f"Note: {told}" in found.stderr
    recipe.write_text("# a word more\n" + RunLog(out).recipe_text)
    assert notes_of(out) == []
    recipe.write_text("[run")
    assert "it is not valid TOML" in notes_of(out)[0]
    recipe.unlink()
    assert notes_of(out) == []
    os.mkfifo(recipe)
    assert notes_of(out) == []


def test_the_runs_own_copies_of_the_maps_are_checked(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=0)
    (own,) = (out / "sources").glob("00-*.npy")
    np.save(own, np.load(own) + 1)
    with pytest.raises(RunError, match="is not the file that was written"):
        Search.resume(out, accept_changes=True)
    without_digests(out)
    with pytest.raises(RunError, match="another map or genome of left"):
        Search.resume(out, accept_changes=True)


def test_what_needs_no_confirmation_is_noted(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=1)
    path = out / "provenance.json"
    now = store.environment()["versions"]["numba"]
    text = path.read_text().replace(f'"numba": "{now}"', '"numba": "0.1"')
    path.write_text(text.replace('"seal"', '"other"'))
    Search.resume(out, generations=2, workers=0).close()
    (noted,) = [e for e in RunLog(out).events() if e["event"] == "resume"]
    assert noted["changes"] == [
        "run.generations was 1 and is now 2",
        f"numba was 0.1 and is now {now}",
    ]


def test_fewer_generations_than_are_done_are_refused(toy, tmp_path):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=2)
    before = (out / "provenance.json").read_bytes(), (out / "events.jsonl").read_bytes()
    with pytest.raises(RunError, match="generations = 1, but the run already has 2"):
        Search.resume(out, generations=1)
    assert before == ((out / "provenance.json").read_bytes(), (out / "events.jsonl").read_bytes())


def test_a_run_whose_last_generation_fails_is_not_finished(toy, tmp_path):
    recipe = toy("@evocity.fitness(goal='max')\ndef broken(city):\n    raise OSError('a\\nb')\n")
    with pytest.raises(RunError, match="of generation 0 failed"):
        run(recipe, tmp_path / "run", workers=0, generations=0)
    log = RunLog(tmp_path / "run")
    assert log.events()[-1]["event"] == "stop"
    assert not log.status()["finished"]
    assert {text.count("\n") for text in log.births()["error"].to_pylist()} == {0}


def test_a_shapefile_is_more_than_one_file(tmp_path):
    parts = [tmp_path / f"town.{suffix}" for suffix in ("shp", "dbf", "shx", "prj")]
    for path in parts:
        path.write_text(path.name)
    seen = {file_hash(tmp_path, "town.shp")}
    for path in parts:
        path.write_text("changed")
        seen.add(file_hash(tmp_path, "town.shp"))
    assert len(seen) == 5
    (tmp_path / "town.shp.xml").write_text("no part of the map")
    assert file_hash(tmp_path, "town.shp") in seen


def test_names_of_parents_are_all_different():
    names: list[str] = []
    for name in ("a", "a-3", "a", "a", "a-3"):
        names.append(free_name(name, names))
    assert names == ["a", "a-3", "a-2", "a-4", "a-3-2"]


def test_a_runs_name_fits_a_folder(toy):
    recipe = toy()
    recipe.write_text(recipe.read_text().replace('name = "toy"', f'name = "{"x" * 101}"'))
    with pytest.raises(RecipeError, match=r"run\.name"):
        read_recipe(recipe)


@pytest.mark.parametrize("text", ["one\n  two\r\nthree", "\ud800", "long " * 1000])
def test_an_error_is_one_line_that_can_be_written(text):
    told = Outcome("error", text).error
    assert len(told.encode().splitlines()) == 1
    assert len(told) <= MOST_LETTERS


HUGE = """
@evocity.fitness(goal="max")
def huge(city):
    return 1e308 if number(city) % 2 else -1e308

@evocity.fitness(goal="max")
def sudden(city):
    return 1e-300 * (number(city) % 5) if number(city) % 7 else 1e308
"""


@pytest.mark.slow
def test_huge_values_do_not_end_a_run(toy, tmp_path):
    out = tmp_path / "run"
    numbers = [one.number for one in run(toy(HUGE, population=12), out, workers=0)]
    assert numbers == [0, 1, 2, 3]
    state = RunLog(out).status()
    assert state["finished"]
    assert state["best"]["huge"] == 1e308
    assert write_report(out).is_file()
    assert contact_sheet(evocity.open_run(out)).size[0] > 0
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "Infinity" not in text.partition('<script type="module">')[0]


def test_huge_losses_are_ranked_and_measured():
    losses = np.array([[1e308, -1e308], [0.0, 0.0], [-1e308, 1e308], [1e308, 1e308]])
    ranks = ranks_of(losses)
    assert ranks.tolist() == [0, 0, 0, 1]
    assert not np.isnan(crowding_of(losses, ranks)).any()
    assert Hypervolume(losses)(losses) == pytest.approx(Hypervolume(losses / 1e308)(losses / 1e308))


@pytest.mark.slow
def test_a_worker_that_ends_by_itself_is_told_with_its_own_code(toy, tmp_path):
    recipe = toy(
        "@evocity.fitness(goal='max')\n"
        "def leaving(city):\n"
        "    if number(city) % 3 == 0:\n        os._exit(0)\n"
        "    return 1.0\n",
        population=12,
        generations=0,
        max_failures=1.0,
    )
    run(recipe, tmp_path / "run", workers=1)
    errors = {e for e in RunLog(tmp_path / "run").births()["error"].to_pylist() if e}
    assert errors == {"the worker ended with exit code 0"}


@pytest.mark.long
def test_the_deadline_is_not_spent_on_loading_kernels(toy, tmp_path):
    recipe = toy(population=8, generations=1, timeout=0.5, genome="block = 8\nfit = false")
    run(recipe, tmp_path / "run", workers=4)
    assert set(RunLog(tmp_path / "run").births()["status"].to_pylist()) == {"ok"}


@pytest.mark.long
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("delay", [0.0, 0.5, 2.0])
def test_ctrl_c_while_workers_start_is_one_line(toy, tmp_path, delay):
    out = tmp_path / "run"
    words = [sys.executable, "-m", "evocity", "run", toy(generations=1000, workers=2), "--out", out]
    process = subprocess.Popen(words, stderr=subprocess.PIPE, text=True, start_new_session=True)
    while not out.exists():
        assert process.poll() is None
        time.sleep(0.01)
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    told = process.communicate(timeout=60)[1]
    assert process.returncode == 130
    assert "Traceback" not in told
    assert told.splitlines()[-1].startswith("Stopped.")
    shutil.rmtree(out)


@pytest.mark.parametrize("noted", [{"mutation": {"weight": 2.0, "sigma": 0.3}}, None])
def test_a_run_keeps_the_mixture_it_began_with(tmp_path, noted):
    """Where the recipe says nothing of operators: what was noted, or what older releases took."""
    for seed in (41, 42):
        np.save(tmp_path / f"{seed}.npy", draw_town(seed, side=64, buildings=12).heights)
    recipe = tmp_path / "plain.toml"
    recipe.write_text("""
    run = { seed = 5, population = 8, generations = 3 }
    map = { pixels = 64, metres_per_pixel = 2.0 }
    genome = { block = 4, fit = false }
    parents = [{ map = "41.npy" }, { map = "42.npy" }]
    fitness = [{ name = "gsi", target = 0.4 }, { name = "crumbs" }]
    """)
    out = tmp_path / "run"
    with Search(read_recipe(recipe), out=out, workers=0) as search:
        next(iter(search))
    about = unsealed(out / "provenance.json")
    assert about["recipe"]["operators"]["quarter_fusion"]["fill"] == {"from": 0.05, "to": 0.6}
    if noted is None:
        del about["recipe"]["operators"]
    else:
        about["recipe"]["operators"] = noted
    (out / "provenance.json").write_text(json.dumps(about))
    with Search.resume(out, workers=0) as search:
        for _ in search:
            pass
        taken = search.recipe.operators
    older = {"pavement_fusion", "region_fusion", "lambda_crossover", "relocation", "mutation"}
    assert set(taken) == (older if noted is None else {"mutation"})
    births = RunLog(out).births(columns=["generation", "operator"]).to_pylist()
    bred = {one["operator"] for one in births if one["generation"] > 1}
    assert bred <= set(taken)
