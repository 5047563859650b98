"""What a night's run promises: same bits, a log that is the checkpoint, failures that cost one."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from evocity.errors import RunError
from evocity.search import Search, read_recipe
from evocity.search.breeding.births import outcome_of
from evocity.store import RunLog


def rows(path) -> list[dict]:
    """All births and members of a run but for their seconds."""
    run = RunLog(path)
    births = run.births().drop_columns(["seconds"]).to_pylist()
    return [*births, *run.members().to_pylist()]


def run(recipe, out, workers=None, **overrides):
    with Search(read_recipe(recipe, **overrides), out=out, workers=workers) as search:
        return list(search)


SCRIPT = """
import sys
from evocity.search import Search, read_recipe
with Search(read_recipe(sys.argv[1]), out=sys.argv[2]) as search:
    for generation in search:
        print(generation.number, flush=True)
"""


def started(recipe, out):
    """The search in a process of its own."""
    return subprocess.Popen(
        [sys.executable, "-c", SCRIPT, recipe, out], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


@pytest.mark.slow
def test_workers_do_not_matter(toy, tmp_path, finished_runs):
    recipe = toy()
    for count in (1, 2, 4):
        run(recipe, tmp_path / f"run-{count}", workers=count)
    expected = rows(finished_runs.copy("plain", tmp_path))
    assert len(expected) == 4 * 8 * 2
    assert {row["status"] for row in expected if "status" in row} == {"ok"}
    for count in (1, 2, 4):
        assert rows(tmp_path / f"run-{count}") == expected


def test_another_seed_is_another_run(toy, tmp_path):
    run(toy(), tmp_path / "one", workers=0, generations=1)
    run(toy(), tmp_path / "two", workers=0, generations=1, seed=4)
    one, two = (RunLog(tmp_path / name).births(1)["genome"] for name in ("one", "two"))
    assert one != two


@pytest.mark.slow
@pytest.mark.parametrize(
    "points",
    [[(1, 0.15)], pytest.param([(0, 0.0), (1, 0.3), (2, 0.2)], marks=pytest.mark.long)],
)
def test_a_killed_run_resumes_to_the_same_rows(toy, tmp_path, points):
    # births of the last generation wait as long as the file is there: a kill comes before the end
    wait = tmp_path / "wait"
    recipe = toy(
        "CALLS = []\n@evocity.fitness(goal='max')\ndef slow(city):\n"
        f"    CALLS.append(1)\n    while len(CALLS) > 4 * 8 and os.path.exists({str(wait)!r}):\n"
        "        time.sleep(0.01)\n    time.sleep(0.02)\n    return 1.0\n",
        generations=4,
    )
    run(recipe, tmp_path / "whole", workers=0)
    expected = rows(tmp_path / "whole")
    for index, (generation, delay) in enumerate(points):
        out = tmp_path / f"killed-{index}"
        wait.touch()
        process = started(recipe, out)
        while process.stdout.readline().strip() != str(generation).encode():
            assert process.poll() is None, process.stderr.read().decode()
        time.sleep(delay)
        process.kill()
        process.communicate()
        wait.unlink()
        assert len(RunLog(out).generations) < 5
        assert not RunLog(out).status()["finished"]
        with Search.resume(out, workers=index) as search:
            numbers = [one.number for one in search]
        assert numbers[-1] == 4
        assert rows(out) == expected
        assert RunLog(out).status()["finished"]
        told = [e["event"] for e in RunLog(out).events()]
        assert told == ["start", "stop", "resume", "finish"]  # that it was killed is noted
    for summary, other in zip(
        RunLog(tmp_path / "whole").history(), RunLog(out).history(), strict=True
    ):
        for volatile in ("evaluations_per_second",):
            del summary[volatile], other[volatile]
        assert summary == other


def test_a_run_killed_before_its_first_generation_begins_again(toy, tmp_path, finished_runs):
    recipe = toy()
    search = Search(read_recipe(recipe), out=tmp_path / "killed", workers=0)
    search.ask()
    search.close()
    with Search.resume(tmp_path / "killed", workers=0) as resumed:
        list(resumed)
    assert rows(tmp_path / "killed") == rows(finished_runs.copy("plain", tmp_path))


def test_more_generations_continue_a_finished_run(toy, tmp_path):
    run(toy(), tmp_path / "long", workers=0, generations=5)
    run(toy(), tmp_path / "short", workers=0, generations=2)
    with Search.resume(tmp_path / "short", generations=5, workers=0) as search:
        assert [one.number for one in search] == [3, 4, 5]
    assert rows(tmp_path / "short") == rows(tmp_path / "long")
    with Search.resume(tmp_path / "short", workers=0) as search:
        assert list(search) == []


def test_changes_since_are_named_and_must_be_confirmed(toy, tmp_path):
    out = tmp_path / "run"
    recipe = toy()
    run(recipe, out, workers=0, generations=1)
    measures = tmp_path / "toys.py"
    measures.write_text(measures.read_text() + "\n# changed\n")
    np.save(tmp_path / "left.npy", np.zeros((64, 64), np.float32))
    inside = out / "recipe.toml"
    inside.write_text(inside.read_text().replace("mutation = 2", "mutation = 3"))
    before = rows(out)
    with pytest.raises(RunError) as caught:
        Search.resume(out, generations=2)
    for changed in ("the recipe", "the map left.npy", "measure spread", "measure roof"):
        assert changed in caught.value.found
    assert "accept" in caught.value.remedy
    assert rows(out) == before
    with Search.resume(out, generations=2, workers=0, accept_changes=True) as search:
        assert [one.number for one in search] == [2]
    assert RunLog(out).events()[-2]["changes"]
    Search.resume(out, generations=2, workers=0).close()  # confirmed once and for all


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("population = 8", "population = 9", "run.population"),
        ("seed = 3", "seed = 4", "run.seed"),
        ('file = "toys.py"', 'file = "toys.py"\nname = "roof"', "fitness"),
        ('map = "right.npy"', 'map = "left.npy"', "parents"),
    ],
)
def test_some_changes_make_another_run(toy, tmp_path, old, new, named):
    out = tmp_path / "run"
    run(toy(), out, workers=0, generations=0)
    inside = out / "recipe.toml"
    inside.write_text(inside.read_text().replace(old, new))
    with pytest.raises(RunError, match=f"{named} was"):
        Search.resume(out, accept_changes=True)


FAILING = """
@evocity.fitness(goal="max")
def moody(city):
    n = number(city)
    if n % 10 == 1:
        raise ValueError("in a bad mood")
    if n % 12 == 2:
        time.sleep(1e6)
    if n % 14 == 3:
        os._exit(n % 2)
    if n % 10 == 4:
        return float("nan")
    if n % 30 == 5:
        return "text"
    return float(n % 1000)
"""


@pytest.mark.slow
def test_a_failing_measure_costs_its_own_births_alone(toy, tmp_path, capfd):
    recipe = toy(FAILING, population=24, generations=2, timeout=1.0, max_failures=0.9, workers=2)
    generations = run(recipe, tmp_path / "run")
    table = RunLog(tmp_path / "run").births().to_pylist()
    assert len(table) == 3 * 24
    told = {}
    for row in table:
        told.setdefault(row["status"], []).append(row["error"] or "")
        assert row["feasible"] == (row["status"] == "ok")
    assert set(told) == {"ok", "error", "timeout", "died", "invalid"}
    assert all("in a bad mood" in text and "toys.py" in text for text in told["error"])
    assert all("no result after 1 s" in text for text in told["timeout"])
    assert all("exit code" in text for text in told["died"])
    assert any("nan" in text for text in told["invalid"])
    failed = {row["id"] for row in table if row["status"] != "ok"}
    assert generations[-1].failures == len(failed)
    for generation in generations:
        assert not failed & {one.id for one in generation.population}
        assert generation.best["moody"] == max(one.values["moody"] for one in generation.population)
    assert not failed & {parent for row in table[24:] for parent in row["parents"]}
    assert "noise" not in capfd.readouterr().out


def test_too_many_failures_stop_the_run_and_keep_the_log(toy, tmp_path):
    recipe = toy("@evocity.fitness(goal='max')\ndef broken(city):\n    raise OSError('no disk')\n")
    with pytest.raises(RunError, match=r"8 of 8 births of generation 0 failed.*no disk"):
        run(recipe, tmp_path / "run")
    log = RunLog(tmp_path / "run")
    assert log.births()["status"].to_pylist() == ["error"] * 8
    assert log.events()[-1]["event"] == "stop"
    with pytest.raises(RunError, match="no individual is alive"):
        Search.resume(tmp_path / "run")


def test_nothing_lives_twice_and_the_best_are_kept(toy):
    generations = run(toy(generations=5), None, workers=0)
    spreads = [generation.best["spread"] for generation in generations]
    assert spreads == sorted(spreads)
    assert spreads[0] < spreads[-1]
    roofs = [generation.best["roof"] for generation in generations]
    assert roofs == sorted(roofs, reverse=True)
    assert generations[-1].hypervolume > generations[0].hypervolume
    for generation in generations:
        digests = [one.genome.digest for one in generation.population]
        assert len(set(digests)) == len(digests)
        assert [one.rank for one in generation.population] == sorted(
            one.rank for one in generation.population
        )


def test_ask_and_tell_elsewhere(toy, tmp_path):
    recipe = read_recipe(toy())
    values = [{"spread": float(i), "roof": float(-i)} for i in range(8)]
    with Search(recipe, workers=0) as search:
        with pytest.raises(RunError, match=r"tell\(\) was called before ask\(\)"):
            search.tell([])
        genomes = search.ask()
        assert len(genomes) == 8
        with pytest.raises(RunError, match=r"call tell\(\) with the results of these"):
            search.ask()
        with pytest.raises(RunError, match="7 results for 8 genomes"):
            search.tell(values[:7])
        with pytest.raises(RunError, match="a value of each measure: spread, roof"):
            search.tell([{"spread": 1.0}] * 8)
        values[3]["roof"] = float("nan")
        values[4] = ValueError("elsewhere")
        generation = search.tell(values)
        assert generation.failures == 2
        assert not {3, 4} & {one.id for one in generation.population}
        assert generation.best == {"spread": 7.0, "roof": -7.0}
        assert len(search.ask()) == 8


def files_of(path):
    return {file: file.read_bytes() for file in path.rglob("*") if file.is_file()}


def test_a_closed_search_writes_nothing_more(toy, tmp_path):
    values = [{"spread": float(i), "roof": float(-i)} for i in range(8)]
    search = Search(read_recipe(toy(generations=0)), out=tmp_path / "run", workers=0)
    assert len(search.ask()) == 8
    search.close()
    with Search.resume(tmp_path / "run", workers=0) as other:  # holds the lock from here on
        before = files_of(tmp_path / "run")
        for call in (search.ask, lambda: search.tell(values)):
            with pytest.raises(RunError, match=r"\(\) was called after the search was closed"):
                call()
        assert files_of(tmp_path / "run") == before
        list(other)
        before = files_of(tmp_path / "run")
        assert list(other) == []  # finished and closed: no second end is noted
        assert files_of(tmp_path / "run") == before


def test_an_existing_folder_is_refused_before_any_work(toy, tmp_path):
    (tmp_path / "run").mkdir()
    with pytest.raises(RunError, match="exists already"):
        Search(read_recipe(toy()), out=tmp_path / "run")
    assert list((tmp_path / "run").iterdir()) == []


def test_an_interrupt_is_noted_and_drops_the_generation(toy, tmp_path):
    search = Search(read_recipe(toy()), out=tmp_path / "run", workers=0)

    def interrupted():
        with search:
            for _ in search:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    log = RunLog(tmp_path / "run")
    assert log.status()["generation"] == 0
    last = log.events()[-1]
    assert (last["event"], last["reason"]) == ("stop", "interrupted")
    assert [event["event"] for event in log.events()] == ["start", "stop"]
    assert json.dumps(log.status())


@pytest.mark.long
@pytest.mark.skipif(not os.path.isdir("/proc"), reason="looks workers up in /proc")
def test_workers_end_with_their_main_process_even_when_hung(toy, tmp_path):
    recipe = toy(
        "@evocity.fitness(goal='max')\n"
        "def hung(city):\n"
        f"    open({str(tmp_path)!r} + f'/pid-{{os.getpid()}}', 'w').close()\n"
        "    time.sleep(1e6)\n",
        timeout=600.0,
        workers=2,
    )
    process = started(recipe, tmp_path / "run")
    deadline = time.monotonic() + 60
    while len(pids := [p.name[4:] for p in tmp_path.glob("pid-*")]) < 2:
        assert time.monotonic() < deadline
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.communicate()
    while any(os.path.exists(f"/proc/{pid}") for pid in pids):
        assert time.monotonic() < deadline
        time.sleep(0.05)


@pytest.mark.long
def test_a_script_without_main_guard_is_told_what_to_do(toy, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    ended = subprocess.run(
        [sys.executable, script, toy(workers=2), tmp_path / "run"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 1
    assert "__main__" in ended.stderr


@pytest.mark.parametrize("value", [10**400, -(10**400), 10**5000], ids=["high", "low", "long"])
def test_a_number_beyond_all_floats_is_invalid(value):
    told = outcome_of({"gsi": value, "fsi": 1}, ["gsi", "fsi"])
    assert told.status == "invalid"
    assert "gsi is" in told.error
    assert "fsi" not in told.error
