"""A bad measure costs its own births alone, and leaves no process and no file."""

import os
import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest
from codes import uniformly
from faults_kinds import CHANGING, FEW, KINDS, SOURCE

from evocity import fitness
from evocity.coding import decode
from evocity.errors import RecipeError
from evocity.evaluation import Workers, linux_processes, worker_pool, worker_start
from evocity.evaluation.evaluator import Setup
from evocity.evaluation.kernel_warmup import DECODE
from evocity.evaluation.output import MOST_PRINTED
from evocity.kinds import KINDS as CHROMOSOMES
from evocity.recipe.search_section import bytes_of
from evocity.search import read_recipe

linux = pytest.mark.skipif(not linux_processes.LINUX, reason="what Linux gives")
pytestmark = pytest.mark.usefixtures("own_temporary")

MEASURE = """
import ctypes, os, random, signal, sys, time
import evocity

@evocity.fitness(goal="max")
def bad(city, genome):
    told = genome.cities[0]
    {body}
    return float(city.heights.mean()) + len(told)
"""


def alive(pid: int) -> bool:
    """Whether a process is there and has not ended."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            return file.read().rpartition(b")")[2].split()[0] != b"Z"
    except OSError:
        return False


def within(condition, seconds: float = 60.0) -> bool:
    """Whether a ``condition`` comes true in so many seconds."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def gone(pids) -> bool:
    """Whether all processes end."""
    return within(lambda: not any(map(alive, pids)))


def ended_nursery() -> None:
    nursery, worker_start._the_nursery = worker_start._the_nursery, None
    if nursery is not None:
        nursery.end()


@pytest.fixture(scope="session")
def genome(town):
    return uniformly(town).genome


@pytest.fixture
def told():
    """What a pool told of jobs that it did again."""
    return []


@pytest.fixture
def pool(tmp_path, told):
    """Function that makes a pool of workers for the measure ``bad`` of a source text."""
    pools = []

    def make(source: str, count: int = 2, timeout: float = 30.0, **others) -> Workers:
        path = tmp_path / "bad.py"
        path.write_text(source)
        fitness.load_file(path)
        header = SimpleNamespace(chromosome=CHROMOSOMES["fabric"], measures=("bad",), recorded=())
        # as searches do: else each worker would load the kernels by itself, within a birth's time
        setup = Setup(header, (("bad", str(path)),), sides=4, parts=(DECODE,))
        pools.append(Workers(setup, count, timeout, told.append, **others))
        return pools[-1]

    yield make
    for one in pools:
        one.close()


@pytest.fixture(scope="module")
def own_temporary(tmp_path_factory):
    """A temporary folder for the workers of these tests alone, with a nursery of its own."""
    folder = tmp_path_factory.mktemp("temporary")
    ended_nursery()
    before = os.environ.get("TMPDIR")
    os.environ["TMPDIR"] = str(folder)
    yield folder
    ended_nursery()
    if before is None:
        del os.environ["TMPDIR"]
    else:
        os.environ["TMPDIR"] = before


def named(genome, *names):
    """Jobs: to measure the genome under these names, which the measure reads."""
    return [(genome.replace(cities=(name,)),) for name in names]


def noted(folder, what="") -> list[int]:
    return [int(one.name.rpartition("-")[2]) for one in folder.glob(f"{what}*-*")]


@pytest.mark.slow
@linux
@pytest.mark.parametrize(
    "kinds", [FEW, pytest.param(list(KINDS), marks=pytest.mark.long)], ids=["few", "all"]
)
def test_ninety_kinds_of_bad_measure_cost_their_own_births(
    pool, genome, tmp_path, own_temporary, capfd, told, kinds
):
    notes = tmp_path / "notes"
    notes.mkdir()
    source, limits = SOURCE.replace("NOTES_FOLDER", repr(str(notes))), {"memory": 400 * 10**6}
    bad = pool(source, timeout=3.0, **limits)
    # many calm births, so that each worker has some after each bad one
    names = [one for i, kind in enumerate(kinds) for one in (kind, *[f"calm-{i}"] * 3)]
    outcomes = bad.run("evaluate", named(genome, *names))
    nursery = bad._starter._nursery.pid
    assert within(lambda: len(linux_processes.descendants(nursery)) <= 2)
    bad.close()
    # on a loaded machine 3 s may be too few for who does not hang: with 20 times as many he ends
    hung = [at for at, one in enumerate(outcomes) if one.status == "timeout"]
    if late := [at for at in hung if KINDS.get(names[at]) != "timeout"]:
        patient = pool(source, timeout=60.0, **limits)
        again = patient.run("evaluate", named(genome, *(names[at] for at in late)))
        for at, one in zip(late, again, strict=True):
            outcomes[at] = one
        patient.close()
    calm = genome_value(genome)
    wrong = {}
    for name, one in zip(names, outcomes, strict=True):
        wanted = KINDS.get(name, "ok")
        value = calm + (int(name[5:]) if name.startswith("calm") else 0)
        right = one.status == wanted and (wanted != "ok" or one.values == {"bad": value})
        if not right or (one.error or "x").splitlines() != [one.error or "x"]:
            wrong[name] = one
    assert wrong == {}
    errors = dict(zip(names, (one.error or "" for one in outcomes), strict=True))
    assert all(len(text) <= 2000 for text in errors.values())
    assert "SIGSEGV" in errors["crashes"]
    assert "30.0 GB" in errors["allocates"] or "27.9 GiB" in errors["allocates"]
    assert all("allowed: 400 MB" in errors[k] for k in kinds if KINDS[k] == "memory")
    # the births that killed and that stopped themselves were tried twice
    assert 2 <= sum("its birth is done again" in text for text in told) <= 2 + len(late)
    # the canary named each birth that changed its worker, and nothing of a worker was executed
    changed = [kind for kind in kinds if kind in CHANGING]
    assert all("leaves its worker so changed" in errors[kind] for kind in changed)
    assert sum("a birth left its worker changed" in text for text in told) == len(changed)
    assert noted(notes, "unpickled") == []
    # of 1 GB that was printed, a little is shown, and nothing that moves a cursor
    shown = capfd.readouterr().err
    assert len(shown) < len(names) * (MOST_PRINTED + 100)
    assert "a calm birth" in shown
    assert "in C" in shown
    assert "\x1b" not in shown
    # nothing stays
    assert gone(noted(notes))
    assert within(lambda: linux_processes.descendants(nursery) == [])
    folder = next(own_temporary.glob("evocity-workers-*"))
    assert within(lambda: os.listdir(folder) == [])
    ended_nursery()
    assert os.listdir(own_temporary) == []


def genome_value(genome) -> float:
    return float(decode(genome).city.heights.mean())


@pytest.mark.slow
@linux
@pytest.mark.parametrize("deed", ["os.killpg(os.getpgid(os.getppid()), 9)"])
def test_a_measure_that_kills_what_starts_workers_is_found(pool, genome, deed, told):
    body = f"if told == 'bad': {deed}; time.sleep(60)\n    time.sleep(0.2)"
    bad = pool(MEASURE.format(body=body), count=2)
    names = ["calm", "bad", "calm-2", "calm-3"]
    outcomes = bad.run("evaluate", named(genome, *names))
    assert [one.status for one in outcomes] == ["ok", "died", "ok", "ok"]
    assert "starts the workers" in outcomes[1].error
    assert told


@linux
@pytest.mark.long
def test_a_nursery_that_does_not_answer_is_replaced(pool, genome, monkeypatch, told):
    monkeypatch.setattr(worker_pool, "_ANSWER", 2.0)
    body = "if told == 'bad': os.kill(os.getppid(), signal.SIGSTOP); os._exit(1)"
    bad = pool(MEASURE.format(body=body), count=1)
    assert [one.status for one in bad.run("evaluate", named(genome, "calm"))] == ["ok"]
    first = bad._starter._nursery.pid
    outcomes = bad.run("evaluate", named(genome, "calm", "bad", "calm"))
    assert [one.status for one in outcomes] == ["ok", "died", "ok"]
    assert not alive(first)


@pytest.mark.slow
@linux
def test_a_worker_or_the_nursery_killed_from_outside_costs_nothing(pool, genome, told, tmp_path):
    """Each time while all workers are at a birth: births end once the file ``go`` is there."""
    go, notes = tmp_path / "go", tmp_path / "notes"
    notes.mkdir()
    go.touch()
    body = f"open(f'{notes}/birth-{{os.getpid()}}', 'w').close()\n"
    body += f"    while not os.path.exists({str(go)!r}): time.sleep(0.01)"
    good = pool(MEASURE.format(body=body), count=2, timeout=120.0)
    jobs = named(genome, *(f"calm-{i}" for i in range(8)))
    expected = [one.values for one in good.run("evaluate", jobs)]
    for victim in ("worker", "all", "nursery"):
        go.unlink()
        for one in notes.iterdir():
            one.unlink()
        before = len(told)

        def kill(victim=victim, before=before):
            while not go.exists():
                seats = [seat.pid for seat in list(good._seats.values())]
                if len(at_work := set(seats) & set(noted(notes))) == 2:
                    nursery = good._starter._nursery.pid
                    chosen = {"worker": seats[:1], "all": at_work, "nursery": [nursery]}[victim]
                    for pid in chosen:
                        os.kill(pid, signal.SIGKILL)
                    within(lambda: len(told) > before, 120)
                    go.touch()
                time.sleep(0.01)

        killer = threading.Thread(target=kill)
        killer.start()
        outcomes = good.run("evaluate", jobs)
        go.touch()
        killer.join()
        assert [one.values for one in outcomes] == expected, victim
        assert len(told) > before, victim


# -- deadlines ---------------------------------------------------------------------------


@pytest.mark.parametrize("step", [3600.0, -3600.0])
def test_a_stepped_clock_ends_no_innocent_and_spares_no_hang(pool, genome, step, monkeypatch):
    body = "time.sleep(1e6 if told == 'bad' else 0.3)"
    bad = pool(MEASURE.format(body=body), count=2, timeout=5.0)
    bad.run("evaluate", named(genome, "calm"))
    real, start = time.time, time.monotonic()
    monkeypatch.setattr(time, "time", lambda: real() + step * (time.monotonic() - start > 0.1))
    outcomes = bad.run("evaluate", named(genome, "calm", "bad", "calm"))
    assert [one.status for one in outcomes] == ["ok", "timeout", "ok"]
    assert time.monotonic() - start < 120


def test_deadlines_follow_the_pools_own_clock(pool, genome):
    body = "time.sleep(1e6 if told == 'bad' else 0)"
    bad = pool(MEASURE.format(body=body), count=1, timeout=3000.0, memory=10**9)
    assert [one.status for one in bad.run("evaluate", named(genome, "calm"))] == ["ok"]
    began, at_work = time.monotonic(), False

    def clock():
        nonlocal at_work
        now = time.monotonic() + 3600.0 * at_work
        at_work = at_work or any(seat.state == "busy" for seat in bad._seats.values())
        return now

    bad._clock = clock
    assert [one.status for one in bad.run("evaluate", named(genome, "bad"))] == ["timeout"]
    assert time.monotonic() - began < 120


# -- the end of the main process ---------------------------------------------------------

MAIN = """
import os, sys, signal
from types import SimpleNamespace
sys.path[:0] = TESTS
from codes import uniformly
from towns import draw_town
from evocity.kinds import KINDS
from evocity.evaluation import Workers
from evocity.evaluation.evaluator import Setup
if __name__ == "__main__":
    genome = uniformly(draw_town(1)).genome
    header = SimpleNamespace(chromosome=KINDS["fabric"], measures=("bad",), recorded=())
    pool = Workers(Setup(header, (("bad", sys.argv[1]),), sides=4), 2, 600.0)
    jobs = [(genome.replace(cities=(name,)),) for name in sys.argv[2:]]
    pool.run("evaluate", jobs)
"""


@linux
def test_all_end_with_the_main_process_and_no_file_stays(tmp_path):
    notes, temporary = tmp_path / "notes", tmp_path / "temporary"
    notes.mkdir()
    temporary.mkdir()
    (tmp_path / "bad.py").write_text(SOURCE.replace("NOTES_FOLDER", repr(str(notes))))
    script = tmp_path / "main.py"
    tests = os.path.dirname(os.path.dirname(__file__))
    script.write_text(MAIN.replace("TESTS", repr([tests])))
    process = subprocess.Popen(
        [sys.executable, script, tmp_path / "bad.py", "hangs_in_c", "leader_and_hangs"],
        env=os.environ | {"TMPDIR": str(temporary)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    end = time.monotonic() + 240
    while len(noted(notes, "leader")) < 1 or len(noted(notes, "worker")) < 2:
        assert time.monotonic() < end
        assert process.poll() is None, process.stdout.read()
        time.sleep(0.05)
    family = linux_processes.descendants(process.pid)
    assert len(family) >= 5  # tracker, nursery, two workers, and what one began
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert gone([*family, *noted(notes)])
    assert within(lambda: os.listdir(temporary) == [])


@linux
def test_the_folders_of_killed_nurseries_are_removed_by_the_next(pool, genome, own_temporary):
    good = pool(MEASURE.format(body="pass"), count=1)
    good.run("evaluate", named(genome, "calm"))
    nursery = good._starter._nursery
    (own,) = own_temporary.glob("evocity-workers-*")
    old, other = (own_temporary / f"evocity-workers-1-{name}" for name in ("old", "other"))
    for folder in (old, other):  # of main processes that were killed too; one is just being made
        folder.mkdir()
    os.utime(old, (1, 1))
    os.utime(other, (time.time() + 600,) * 2)  # on a busy machine it would be old soon
    family = linux_processes.descendants(nursery.pid)
    os.kill(nursery.pid, signal.SIGKILL)
    assert gone(family)  # the system ends the workers with it
    good.run("evaluate", named(genome, "calm"))
    assert not own.exists()
    assert not old.exists()
    other.rmdir()
    assert len(list(own_temporary.glob("evocity-workers-*"))) == 1


# -- memory ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "size"),
    [("4 GB", 4 * 10**9), ("512MB", 512 * 10**6), ("1.5 GiB", 3 << 29), ("none", None)],
)
def test_memory_in_words(text, size):
    assert bytes_of(text) == size


@pytest.mark.parametrize("value", ['"4"', '"four GB"', '"-1 GB"', '"0 GB"', "4", '""'])
def test_memory_that_is_none_is_a_fault_of_the_recipe(tmp_path, value):
    path = tmp_path / "r.toml"
    path.write_text(
        '[[parents]]\nmap = "lyon-1er"\n[[fitness]]\nname = "gsi"\n'
        f"[evaluation]\nmemory = {value}\n"
    )
    with pytest.raises(RecipeError, match=r"evaluation\.memory"):
        read_recipe(path)


@pytest.mark.slow
@linux
def test_what_the_worker_has_does_not_count_and_what_births_leave_is_given_back(pool, genome):
    body = "import numpy as np; ones = np.ones(10**6 * int(told)); globals()[told] = ones"
    good = pool(MEASURE.format(body=body), count=1, memory=200 * 10**6)
    outcomes = good.run("evaluate", named(genome, "1", "5", "10", "13", "15", "3", "14", "40", "2"))
    assert [one.status for one in outcomes] == ["ok"] * 7 + ["memory", "ok"]
    assert "allowed: 200 MB" in outcomes[-2].error
    assert "320" in outcomes[-2].error or "305" in outcomes[-2].error


# -- elsewhere ---------------------------------------------------------------------------


def test_what_a_worker_runs_is_loaded_first_where_processes_are_spawned():
    """As on Windows and macOS: nothing of the package is loaded before it."""
    module = "evocity.evaluation.worker"
    code = f"import {module}, sys; sys.exit('{module}' not in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)


@pytest.mark.long
def test_workers_of_other_systems(pool, genome, monkeypatch):
    monkeypatch.setattr(worker_pool.linux_processes, "LINUX", False)
    body = (
        "if told == 'hang': time.sleep(1e6)\n"
        "    if told == 'end': os._exit(0)\n"
        "    if told == 'raise': raise ValueError('a bad mood')"
    )
    pool = pool(MEASURE.format(body=body), count=2, timeout=5.0)
    names = ["calm", "hang", "end", "raise", "calm-2", "calm-3"]
    outcomes = pool.run("evaluate", named(genome, *names))
    assert isinstance(pool._starter, worker_start.SpawnStarter)
    pids = [seat.pid for seat in pool._seats.values()]
    pool.close()
    ends = ["ok", "timeout", "died", "error", "ok", "ok"]
    assert [one.status for one in outcomes] == ends
    assert gone(pids)
