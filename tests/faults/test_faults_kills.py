"""A run that is killed, stopped or doubled at any moment goes on to the same births."""

import contextlib
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from toy_runs import write_toy

from evocity.errors import RunError
from evocity.evaluation import linux_processes
from evocity.fitness import registry
from evocity.search import Search, read_recipe
from evocity.store import RunLog

if not hasattr(os, "fork"):
    pytest.skip("runs are forked", allow_module_level=True)

linux = pytest.mark.skipif(not linux_processes.LINUX, reason="what Linux gives")

LONG = [pytest.mark.long, pytest.mark.timeout(3600)]

#: The user who may do least.
NOBODY = 65534

SLOW = """
@evocity.fitness(goal="max")
def slow(city):
    time.sleep(0.03)
    return float(number(city) % 1000)
"""

#: After some births it waits for a file.
WAITS = """
CALLS = []

@evocity.fitness(goal="max")
def waits(city):
    CALLS.append(1)
    while len(CALLS) > 20 and not os.path.exists({go!r}):
        time.sleep(0.01)
    return float(number(city) % 1000)
"""


def command_of(pid: int) -> str:
    """The command line of a process; empty if no such process exists."""
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/cmdline").read_bytes().replace(b"\0", b" ").decode()
    return ""


class Host:
    """`faults_host` in a process of its own."""

    def __init__(self, folder: Path):
        self._told, self._running = folder / "told", set()
        self._asked = self._answered = 0
        path = Path(__file__).with_name("faults_host.py")
        self._process = subprocess.Popen(
            [sys.executable, path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"TMPDIR": str(folder)},
        )
        assert self._process.stdout.readline() == "ready\n"

    def begin(self, out: Path, recipe=None, workers=0, die=None) -> int:
        """Begin or resume a run; the id of its process."""
        asked = {"recipe": recipe and str(recipe), "out": str(out), "workers": workers, "die": die}
        pid = self._ask(asked | {"told": str(self._told)})
        self._running.add(pid)
        return pid

    def ended(self, pid: int) -> int:
        """The exit code of a run, once it ended."""
        code = self._ask({"wait": pid})
        self._running.remove(pid)
        return code

    def left(self, seconds: float = 60.0) -> list[str]:
        """What of all runs that ended is still there after so many seconds: command lines."""
        until = time.monotonic() + seconds
        while True:
            staying = {self._process.pid, *self._running}
            found = [one for one in self._family() if one not in staying]
            if not found or time.monotonic() > until:
                return list(filter(None, map(command_of, found)))
            time.sleep(0.02)

    def nurseries(self, pid: int) -> list[int]:
        """What starts the workers of a run."""
        children = linux_processes.children(pid)
        return [one for one in children if "fork_server import main" in command_of(one)]

    def _family(self) -> list[int]:
        """All processes that this one started, at whatever remove: they have its folder."""
        if not linux_processes.LINUX:
            return []
        found, mark = [], f"TMPDIR={self._told.parent}\0".encode()
        for one in filter(str.isdigit, os.listdir("/proc")):
            with contextlib.suppress(OSError):
                if mark in Path(f"/proc/{one}/environ").read_bytes():
                    found.append(int(one))
        return found

    def told(self, pid: int) -> str:
        """What a run that ended with 3 told."""
        return Path(f"{self._told}-{pid}").read_text()

    def _ask(self, asked: dict) -> int:
        self._asked += 1
        self._process.stdin.write(json.dumps(asked) + "\n")
        self._process.stdin.flush()
        while True:  # a test that failed may have left an answer
            self._answered += 1
            answer = int(self._process.stdout.readline())
            if self._answered == self._asked:
                return answer

    def end_all(self) -> None:
        """Kill what a test that failed left behind."""
        for pid in self._running:
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        self._running.clear()

    def close(self) -> None:
        self._process.stdin.close()
        self._process.wait()
        self._process.stdout.close()


@pytest.fixture(scope="module")
def the_host(tmp_path_factory):
    host = Host(tmp_path_factory.mktemp("host"))
    yield host
    host.close()


@pytest.fixture
def host(the_host):
    """One for all tests here, for it loads everything first; each test's runs end with it."""
    yield the_host
    the_host.end_all()


def rows(path) -> list[dict]:
    """All births and members of a run but for their seconds."""
    run = RunLog(path)
    return [*run.births().drop_columns(["seconds"]).to_pylist(), *run.members().to_pylist()]


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory):
    """Function that gives the rows of a toy run of so many generations that nobody disturbed."""
    known = {}

    def of(generations: int, measures: str = "") -> list[dict]:
        if (generations, measures) not in known:
            folder = tmp_path_factory.mktemp("uninterrupted")
            recipe = write_toy(folder, measures, generations=generations, workers=0)
            with (
                patch.dict(registry._from_files),
                Search(read_recipe(recipe), out=folder / "run", workers=0) as search,
            ):
                list(search)
            known[generations, measures] = rows(folder / "run")
        return known[generations, measures]

    return of


def begun_or_resumed(host, recipe, out, **how) -> int:
    return host.begin(out, None if out.exists() else recipe, **how)


# -- SIGKILL of the main process -----------------------------------------------------------


def killed_at_random(host, folder, rng, kills: int, workers: int, generations: int) -> list[Path]:
    """The folders of runs that were killed so many times together: the last one is let through, and
    one that is finished before is followed by another. In turn a run is killed at a random moment,
    before a random deed on files, and after what starts its workers was killed."""
    recipe, outs = write_toy(folder, SLOW, generations=generations), [folder / "run-0"]
    done, longest = 0, 0.8 if workers == 0 else 4.0
    while True:
        die = int(rng.integers(1, 80)) if done % 3 == 1 and done < kills else None
        pid = begun_or_resumed(host, recipe, outs[-1], workers=workers, die=die)
        if done == kills:
            assert host.ended(pid) == 0, host.told(pid)
            assert host.left() == []
            return outs
        if die is None:
            if done % 3 == 2 and workers:
                time.sleep(float(rng.uniform(0.02, longest)))
                for one in host.nurseries(pid):
                    linux_processes.kill(one)
            time.sleep(float(rng.uniform(0.02, longest)))
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        code = host.ended(pid)
        assert code in (0, -signal.SIGKILL), host.told(pid)
        assert host.left() == []
        if code == 0:
            outs.append(folder / f"run-{len(outs)}")
            continue
        done += 1
        if outs[-1].exists():
            RunLog(outs[-1]).status()  # readable at once


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kills", "workers", "generations", "turn"),
    [
        (3, 0, 8, 0),
        pytest.param(6, 0, 12, 0, marks=LONG),
        pytest.param(3, 2, 20, 0, marks=[*LONG, linux]),
        *(pytest.param(30, 0, 60, turn, marks=LONG) for turn in range(5)),
        *(pytest.param(30, 2, 150, turn, marks=[*LONG, linux]) for turn in range(5)),
    ],
)
def test_killed_at_random_moments_it_goes_on_to_the_same_births(
    host, tmp_path, uninterrupted, kills, workers, generations, turn
):
    rng = np.random.default_rng([kills, workers, turn])
    outs = killed_at_random(host, tmp_path, rng, kills, workers, generations)
    print(f"{kills} kills, {workers} workers, {len(outs)} runs")
    for out in outs:
        assert rows(out) == uninterrupted(generations, SLOW)


def killed_before_each(host, folder, recipe, deeds) -> set[int]:
    """Runs that are killed before their ``deeds``-th deed on files, then resumed. Returns those
    deeds that came after the run's end, and were none."""
    beyond = set()
    for deed in deeds:
        place = folder / f"deed-{deed}"
        place.mkdir()
        out = place / "run"
        if host.ended(host.begin(out, recipe, die=int(deed))) == 0:
            beyond.add(deed)
            continue
        if out.exists():
            RunLog(out).status()
        pid = begun_or_resumed(host, recipe, out)
        assert host.ended(pid) == 0, host.told(pid)
        assert [one.name for one in place.iterdir()] == ["run"], f"left by deed {deed}"
    return beyond


@pytest.mark.slow
@pytest.mark.parametrize("share", [pytest.param(1, marks=LONG), 31])
def test_killed_before_any_deed_on_files_it_goes_on_to_the_same_births(
    host, tmp_path, uninterrupted, share
):
    """The moments between two openings, renames and removals of files; segments of two too."""
    recipe, deed = write_toy(tmp_path, generations=3), 0
    while not killed_before_each(host, tmp_path, recipe, [deed]):
        assert rows(tmp_path / f"deed-{deed}" / "run") == uninterrupted(3)
        deed += share
    assert deed > 60


# -- others that end, or stand still -------------------------------------------------------


@linux
@pytest.mark.long
def test_workers_killed_or_stopped_in_a_run_cost_no_birth(host, tmp_path, uninterrupted):
    """One, all and what starts them killed; then one stopped beyond its deadline, then all."""
    recipe, out = write_toy(tmp_path, SLOW, generations=22, timeout=1.0), tmp_path / "run"
    pid = host.begin(out, recipe, workers=2)

    def family() -> tuple[int, list[int]]:
        """The nursery and its workers."""
        until = time.monotonic() + 60
        while time.monotonic() < until:
            for one in linux_processes.children(pid):
                if len(workers := linux_processes.children(one)) >= 2:
                    return one, workers
            time.sleep(0.02)
        raise AssertionError("no workers")

    def generations() -> int:
        return len(RunLog(out).generations) if out.exists() else 0

    def until_more(count: int = 2) -> None:
        wanted = min(generations() + count, 23)
        until = time.monotonic() + 60
        while generations() < wanted:
            assert time.monotonic() < until
            time.sleep(0.02)

    until_more()
    for victims in (lambda: family()[1][:1], lambda: family()[1], lambda: [family()[0]]):
        for one in victims():
            os.kill(one, signal.SIGKILL)
        until_more()
    first, all_workers = (lambda: family()[1][:1]), (lambda: family()[1])
    for standing in (first, all_workers, lambda: [pid, *all_workers()]):
        stopped = standing()
        for one in stopped:
            os.kill(one, signal.SIGSTOP)
        if pid in stopped:
            time.sleep(1.5)
            for one in stopped:
                os.kill(one, signal.SIGCONT)
        until_more()
    assert host.ended(pid) == 0
    assert rows(out) == uninterrupted(22, SLOW)
    told = [one["reason"] for one in RunLog(out).events() if one["event"] == "retry"]
    assert any("killed" in reason for reason in told)
    assert any("stopped" in reason for reason in told)


@pytest.mark.slow
def test_of_four_that_resume_at_once_one_runs(host, tmp_path, uninterrupted):
    """No run ends before the file ``go`` is there: it waits for the kill, and for the others."""
    go = tmp_path / "go"
    waits = WAITS.format(go=str(go))
    recipe, out = write_toy(tmp_path, waits, generations=12), tmp_path / "run"
    pid = host.begin(out, recipe)
    until = time.monotonic() + 120
    while not out.exists() or len(RunLog(out).generations) < 2:
        assert time.monotonic() < until
        time.sleep(0.02)
    os.kill(pid, signal.SIGKILL)
    assert host.ended(pid) == -signal.SIGKILL
    four = [host.begin(out) for _ in range(4)]
    until = time.monotonic() + 120
    while sum(command_of(one) == "" for one in four) < 3:  # three have ended
        assert time.monotonic() < until
        time.sleep(0.02)
    go.touch()
    ends = {pid: host.ended(pid) for pid in four}
    assert sorted(ends.values()) == [0, 3, 3, 3]
    assert all(
        "is being written by another process" in host.told(pid)
        for pid, end in ends.items()
        if end == 3
    )
    assert rows(out) == uninterrupted(12, waits)


# -- the clock -----------------------------------------------------------------------------


@pytest.mark.slow_cases("2-3600.0", "2--3600.0")
@pytest.mark.parametrize("step", [3600.0, -3600.0])
@pytest.mark.parametrize("workers", [0, 2])
def test_a_clock_that_is_stepped_changes_no_birth(
    tmp_path, uninterrupted, monkeypatch, step, workers
):
    recipe = read_recipe(write_toy(tmp_path, generations=4, timeout=20.0))
    real, stepped = time.time, 0.0
    monkeypatch.setattr(time, "time", lambda: real() + stepped)
    with Search(recipe, out=tmp_path / "run", workers=workers) as search:
        for generation in search:
            stepped += step
            assert 0 <= generation.seconds_left < 600
    assert rows(tmp_path / "run") == uninterrupted(4)


# -- the folder and the disk ---------------------------------------------------------------


def disturbed(search, number: int, deed) -> None:
    """A search in which a ``deed`` is done after generation ``number``."""
    with search:
        for generation in search:
            if generation.number == number:
                search.flush()
                deed()


def to_the_end(search) -> None:
    disturbed(search, -1, None)


def test_a_folder_that_is_renamed_in_a_run_goes_on_where_it_is(tmp_path, uninterrupted):
    out = tmp_path / "run"
    search = Search(read_recipe(write_toy(tmp_path, generations=6)), out=out, workers=0)
    with pytest.raises(RunError, match="the folder is gone"):
        disturbed(search, 2, lambda: out.rename(tmp_path / "moved"))
    assert not out.exists()
    assert RunLog(tmp_path / "moved").status()["generation"] == 2
    to_the_end(Search.resume(tmp_path / "moved", workers=0))
    assert rows(tmp_path / "moved") == uninterrupted(6)


def test_a_folder_that_is_removed_is_told_and_not_made_again(tmp_path):
    out = tmp_path / "run"
    search = Search(read_recipe(write_toy(tmp_path, generations=6)), out=out, workers=0)
    with pytest.raises(RunError, match="the folder is gone"):
        disturbed(search, 2, lambda: shutil.rmtree(out))
    assert not out.exists()
    with pytest.raises(RunError, match=r"no run|not a run|does not exist"):
        Search.resume(out)


@pytest.fixture
def small_disk(tmp_path):
    """Function that mounts a disk of so many kB at a folder, or makes it as large."""
    place = tmp_path / "disk"
    place.mkdir()
    mounted = False

    def change(size: int) -> Path:
        nonlocal mounted
        option = f"remount,size={size}k" if mounted else f"size={size}k"
        words = ["mount", "-t", "tmpfs", "-o", option, "none", str(place)]
        if subprocess.run(words, capture_output=True, check=False).returncode:
            pytest.skip("this user may mount no disk")
        mounted = True
        return place

    yield change
    if mounted:
        subprocess.run(["umount", "-l", str(place)], check=True)


def size_of(folder: Path) -> int:
    return sum(one.stat().st_size for one in folder.rglob("*") if one.is_file())


@pytest.mark.slow
@linux
@pytest.mark.parametrize("count", [5, pytest.param(10, marks=LONG)])
def test_a_full_disk_at_many_sizes_loses_nothing_that_was_whole(
    tmp_path, small_disk, uninterrupted, count
):
    expected = uninterrupted(6)
    recipe = read_recipe(write_toy(tmp_path, generations=6))
    probe, sizes = tmp_path / "probe", []
    search = Search(recipe, out=probe, workers=0)
    disturbed(search, 0, lambda: sizes.append(size_of(probe) // 1024))
    sizes, reached = np.linspace(sizes[0] * 0.5, size_of(probe) // 1024, count), set()
    for number, size in enumerate(sizes.astype(int)):
        place = small_disk(int(size))
        out = place / f"run-{number}"
        with pytest.raises(RunError, match=r"[Nn]o space|requested and \d+ written"):
            to_the_end(Search(recipe, out=out, workers=0))
        small_disk(1 << 16)
        if out.exists():
            reached.add(RunLog(out).status()["generation"])
            to_the_end(Search.resume(out, workers=0))
        else:
            to_the_end(Search(recipe, out=out, workers=0))
        assert rows(out) == expected
        assert [one.name for one in place.iterdir()] == [out.name]
        for one in sorted(out.rglob("*"), reverse=True):
            one.rmdir() if one.is_dir() else one.unlink()
        out.rmdir()
    assert len(reached) > count / 3


def test_a_limit_of_file_size_is_told_and_gone_on_from(tmp_path, uninterrupted):
    resource = pytest.importorskip("resource")
    recipe = read_recipe(write_toy(tmp_path, generations=4))
    search = Search(recipe, out=tmp_path / "run", workers=0)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        limit = resource.RLIMIT_FSIZE
        with pytest.raises(RunError, match="cannot be written"):
            disturbed(search, 1, lambda: resource.setrlimit(limit, (4096, hard)))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert RunLog(tmp_path / "run").status()["generation"] == 1
    to_the_end(Search.resume(tmp_path / "run", workers=0))
    assert rows(tmp_path / "run") == uninterrupted(4)


@pytest.fixture
def own_folder(monkeypatch, uninterrupted):
    """A folder of a user who may not write everywhere, as whom the test goes on."""
    uninterrupted(4)  # bred in a folder that this user has no way to
    folder = Path(tempfile.mkdtemp())
    monkeypatch.setenv("XDG_STATE_HOME", str(folder / "state"))
    privileged = os.geteuid() == 0
    if privileged:
        os.chown(folder, NOBODY, NOBODY)
        os.seteuid(NOBODY)
    yield folder
    if privileged:
        os.seteuid(0)
    shutil.rmtree(folder)


def test_a_folder_made_read_only_in_a_run_is_told_and_gone_on_from(own_folder, uninterrupted):
    out = own_folder / "run"
    search = Search(read_recipe(write_toy(own_folder, generations=4)), out=out, workers=0)

    def change(mode: int) -> None:
        for one in (*out.rglob("*"), out):
            one.chmod(mode | 0o111 * one.is_dir())

    with pytest.raises(RunError, match=r"cannot be written: .*Permission denied"):
        disturbed(search, 1, lambda: change(0o444))
    assert RunLog(out).status()["generation"] == 1
    with pytest.raises(RunError, match="cannot be written"):
        Search.resume(out, workers=0)
    out.chmod(0o755)
    change(0o644)
    to_the_end(Search.resume(out, workers=0))
    assert rows(out) == uninterrupted(4)
