"""A night in little: runs/night.toml with all that may befall it, and every promise kept.

It begins with two workers, is told whom to breed from while it goes on, is killed, is resumed until
a time, then on a Dask cluster, and is proved by replay. docs/nights.md tells the same as a story.
"""

import contextlib
import json
import os
import re
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from datetime import datetime, timedelta
from pathlib import Path
from unittest.mock import patch

import psutil
import pytest
from click.testing import CliRunner, Result

from evocity.cli import main
from evocity.evaluation import linux_processes
from evocity.fitness import registry
from evocity.search import Search, read_recipe
from evocity.search.record import commands
from evocity.search.record.commands import Pick
from evocity.store import RunLog
from evocity.store.events import KILLED

pytest.importorskip("distributed")

if not linux_processes.LINUX:
    pytest.skip("what Linux gives", allow_module_level=True)

RUNS = Path(__file__).parents[2] / "runs"

#: What besets the measure in a night: of so many maps one. The last two need worker processes.
#: Which, is chosen so that the sources are none of them: without these no grid has ranges.
RAISES = "if number % 9 == {}: raise ValueError('not of this one')"
WORSE = """
    if number % 61 == 5: os._exit(7)
    if number % 83 == 7: time.sleep(3600)
"""
MOOD = """
import hashlib, os, time

def mood(city):
    digest = hashlib.blake2b(city.heights.tobytes(), digest_size=4).digest()
    number = int.from_bytes(digest, "big")
    time.sleep(float(os.environ.get("PAUSE", 0)))
    {}
"""


def call(*words) -> Result:
    """The outcome of ``evocity WORDS`` in this process, which must end with exit code 0."""
    with patch.dict(registry._from_files):
        result = CliRunner().invoke(main, [str(word) for word in words], prog_name="evocity")
    assert result.exit_code == 0, (result.output, result.exception)
    return result


class Night:
    """The recipe of runs/night.toml and its measure in a ``folder``, made smaller, with a measure
    that fails by ``mood``, and commands of ``[notify]`` that write into the file ``told``."""

    def __init__(self, folder: Path, mood: str, generations: int, **smaller: object):
        self.folder, self.out, self.generations = folder, folder / "run", generations
        self.recipe, self.told = folder / "night.toml", folder / "told"
        self.temporary = folder / "temporary"
        self.temporary.mkdir()
        text = (RUNS / "night.toml").read_text(encoding="utf-8")
        for key, value in {"generations": generations, **smaller}.items():
            text, found = re.subn(rf"^{key} = \S+", f"{key} = {value}", text, flags=re.M)
            assert found == 1, key
        note = shlex.join(["sh", "-c", 'echo "$1" "$2" >> "$3"', "sh", "{event}", "{generation}"])
        told = json.dumps(f"{note} {shlex.quote(str(self.told))}")
        self.recipe.write_text(f"{text}\n[notify]\non_end = {told}\non_improvement = {told}\n")
        measure = (RUNS / "night_towers.py").read_text(encoding="utf-8")
        measure = measure.replace("    table = city", "    mood(city)\n    table = city")
        assert "mood(city)" in measure
        (folder / "night_towers.py").write_text(measure + MOOD.format(mood))

    def begun(self) -> subprocess.Popen:
        """`evocity run` with two workers, in a process of its own."""
        words = ["run", self.recipe, "--workers", "2", "--out", self.out]
        return subprocess.Popen(
            [sys.executable, "-m", "evocity", *words],
            stderr=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=os.environ | {"TMPDIR": str(self.temporary), "PAUSE": "0.3"},
        )

    def whole(self) -> int:
        """How many generations are written."""
        return len(RunLog(self.out).generations) if self.out.exists() else 0

    def status(self) -> dict:
        return json.loads(call("status", self.out, "--json").stdout)

    def undisturbed(self, asked: dict[int, list[int]], workers: int) -> Path:
        """The run without all that, but for the picks: generation that is the first to be bred so
        -> ids. Its folder."""
        out = self.folder / "undisturbed"
        recipe = read_recipe(self.recipe)
        with patch.dict(registry._from_files), Search(recipe, out=out, workers=workers) as search:
            for generation in search:
                if ids := asked.get(generation.number + 1):
                    search.flush()
                    commands.send(out, Pick(ids=tuple(ids), share=0.5))
        return out


def rows(path: Path) -> list[dict]:
    """All births and members of a run but for their seconds."""
    run = RunLog(path)
    return [*run.births().drop_columns(["seconds"]).to_pylist(), *run.members().to_pylist()]


def events(path: Path, kind: str) -> list[dict]:
    return [one for one in RunLog(path).events() if one["event"] == kind]


def until(condition, seconds: float = 600) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def alive(pid: int) -> bool:
    with contextlib.suppress(OSError), open(f"/proc/{pid}/stat", "rb") as file:
        return file.read().rpartition(b")")[2].split()[0] != b"Z"
    return False


def below() -> list[int]:
    """Processes below this one, but for two that stay as long as it: what Python has watch over
    its shared memory, and what starts workers."""
    found = linux_processes.descendants(os.getpid())
    staying = [
        one
        for one in linux_processes.children(os.getpid())
        if re.search("resource_tracker|fork_server import main", command_of(one))
    ]
    return [one for one in found if one not in staying]


def command_of(pid: int) -> str:
    with contextlib.suppress(OSError), open(f"/proc/{pid}/cmdline", "rb") as file:
        return file.read().replace(b"\0", b" ").decode()
    return ""


def listening(pids: list[int]) -> list[str]:
    """Addresses that this process and these listen at."""
    found = []
    for pid in [os.getpid(), *pids]:
        with contextlib.suppress(psutil.Error):
            made = psutil.Process(pid).net_connections(kind="inet")
            found += [one.laddr.ip for one in made if one.status == psutil.CONN_LISTEN]
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mood", "generations", "smaller", "workers", "cluster"),
    [
        pytest.param(
            RAISES.format(0),
            9,
            {"pixels": 64, "metres_per_pixel": 4.0, "population": 12, "every": 2, "timeout": 60},
            0,
            "local:1",
            id="in-little",
        ),
        pytest.param(
            RAISES.format(4) + WORSE,
            80,
            {"pixels": 128, "metres_per_pixel": 4.0, "population": 30, "timeout": 10},
            2,
            "local:2",
            id="of-an-hour",
            marks=[pytest.mark.long, pytest.mark.timeout(7200)],
        ),
    ],
)
def test_a_night_keeps_what_it_promises(
    request, tmp_path, monkeypatch, mood, generations, smaller, workers, cluster
):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    night = Night(tmp_path, mood, generations, **smaller)
    before = below()

    # in the evening
    run = night.begun()
    request.addfinalizer(run.kill)
    until(lambda: night.whole() > generations // 5 or run.poll() is not None)
    assert run.poll() is None, run.stderr.read()
    state, memory = night.status(), psutil.Process(run.pid).memory_info().rss
    assert (state["running"], state["finished"], state["stopped"]) == (True, False, None)
    assert state["seconds_left"] > 0
    family = linux_processes.descendants(run.pid)
    assert len(family) >= 3  # what starts workers, and these
    liked = state["front"][:2]
    call("pick", night.out, *liked)
    until(lambda: events(night.out, "command") or run.poll() is not None)
    (picked,) = events(night.out, "command")
    until(lambda: night.whole() > picked["generation"] or run.poll() is not None)
    assert run.poll() is None, run.stderr.read()
    assert psutil.Process(run.pid).memory_info().rss < 1.2 * memory + 30_000_000

    # somebody pulls the plug
    run.kill()
    _, lines = run.communicate()
    assert run.returncode == -signal.SIGKILL
    assert re.search(rf"^generation 0/{generations} · ", lines, re.M)
    assert re.search("^estimate: .* of the disk", lines, re.M)
    state, cut = night.status(), night.whole()
    assert (state["running"], state["finished"], state["stopped"]) == (False, False, KILLED)
    assert state["generation"] == cut - 1 < generations
    until(lambda: not any(map(alive, family)), 120)
    until(lambda: not list(night.temporary.iterdir()), 120)

    # gone on with, until seven o'clock
    monkeypatch.setenv("PAUSE", "0.05")
    seven = datetime.now() + timedelta(seconds=1 if workers == 0 else 60)
    stopped = call("resume", night.out, "--workers", workers, "--until", seven.isoformat())
    monkeypatch.delenv("PAUSE")
    assert "stopped: it is past" in stopped.stderr
    assert f"go on with: evocity resume {night.out}" in stopped.stderr
    state = night.status()
    assert (state["running"], state["finished"]) == (False, False)
    assert state["stopped"].startswith("it is past")
    assert cut <= night.whole() <= generations

    # and to its end on a cluster
    with (
        patch.dict(registry._from_files),
        Search.resume(night.out, cluster=cluster, until="none") as search,
    ):
        served = listening(linux_processes.descendants(os.getpid()))
        assert served
        assert set(served) <= {"127.0.0.1", "::1"}
        for _ in search:
            pass
    state = night.status()
    assert (state["finished"], state["generation"]) == (True, generations)
    assert state["evaluation"]["engine"] == "dask"

    # who is told, is told of each end but the kill
    killed, stop = events(night.out, "stop")
    assert (killed["generation"], killed["reason"]) == (cut - 1, KILLED)
    told = night.told.read_text().splitlines()
    ends = [one for one in told if not one.startswith("improvement ")]
    assert ends == [f"stop {stop['generation']}", f"finish {generations}"]
    assert len(told) > len(ends)

    # the same births as of a night in which nothing happened
    calm = night.undisturbed({picked["generation"]: liked}, workers)
    assert rows(night.out) == rows(calm)
    moves = [[one["moves"] for one in events(path, "migration")] for path in (night.out, calm)]
    assert moves[0] == moves[1] != []

    # each birth is what it is
    found = json.loads(
        call("replay", night.out, "--sample", 100, "--workers", workers, "--json").stdout
    )
    assert len(found) == min(100, smaller["population"] * (generations + 1))
    assert not [one for one in found if one["same"] is False]
    assert sum(one["same"] is True for one in found) >= 0.9 * len(found)

    # one bad evaluation costs one evaluation
    births = RunLog(night.out).births().to_pylist()
    failed = {one["id"] for one in births if one["status"] != "ok"}
    assert {one["status"] for one in births} >= {"ok", "error"}
    assert all(one["error"] for one in births if one["id"] in failed)
    assert not failed & {parent for one in births for parent in one["parents"]}
    assert not failed & {one["id"] for one in RunLog(night.out).members().to_pylist()}

    # each start and stop is told, nothing is left over
    kinds = [one["event"] for one in RunLog(night.out).events()]
    ends = [one for one in kinds if one in ("start", "stop", "resume", "finish")]
    assert ends == ["start", "stop", "resume", "stop", "resume", "finish"]
    until(lambda: not [one for one in below() if one not in before], 120)
    until(lambda: not list(night.temporary.iterdir()), 120)
    assert not list(night.out.rglob(".*"))
    assert len([*night.out.rglob("*")]) < 2 * (generations % 64 + generations // 64) + 40
