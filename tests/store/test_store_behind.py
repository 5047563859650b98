"""Writing behind the search, and merging of segments, whatever the moment of a crash."""

import errno
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from test_store_log import HEADER, generation_of, writer  # noqa: F401

from evocity.errors import RunError
from evocity.store import BackgroundWriter, RunLog, RunWriter, layout, merge


@pytest.fixture
def short(monkeypatch):
    """Segments of 4 generations, and of 4 of these."""
    for module in (layout, merge):
        monkeypatch.setattr(module, "SPANS", (4, 16))
    monkeypatch.setattr("evocity.store.writer.SEGMENT", 4)


def names(path, kind="births"):
    return sorted(one.name for one in (path / kind).iterdir())


def test_a_generation_is_written_while_the_next_is_bred(writer, monkeypatch):  # noqa: F811
    behind, gate, write = BackgroundWriter(writer), threading.Event(), RunWriter.write_generation

    def slowly(self, *generation):
        gate.wait(20)
        write(self, *generation)

    monkeypatch.setattr(RunWriter, "write_generation", slowly)
    behind.write_generation(*generation_of(0))
    behind.event("weights", generation=1)
    assert len(RunLog(writer.path).generations) == 0
    assert RunLog(writer.path).events() == []  # in order: what follows is told after it
    gate.set()
    behind.flush()
    assert len(RunLog(writer.path).generations) == 1
    assert [one["event"] for one in RunLog(writer.path).events()] == ["weights"]
    behind.write_generation(*generation_of(1))
    behind.close()
    behind.close()
    assert len(RunLog(writer.path).generations) == 2
    RunWriter.reopen(writer.path).close()


def test_what_fails_behind_is_raised_by_the_next_call(writer, monkeypatch):  # noqa: F811
    behind = BackgroundWriter(writer)
    behind.write_generation(*generation_of(0))
    behind.flush()

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patched:
        patched.setattr("evocity.store.writer.write_single", full)
        behind.write_generation(*generation_of(1))
        with pytest.raises(RunError, match=r"No space left.*generations 0…0 stay readable"):
            behind.write_generation(*generation_of(2))
    behind.event("stop", reason="full")
    behind.close()
    run = RunLog(writer.path)
    assert len(run.generations) == 1
    assert [one["event"] for one in run.events()] == ["stop"]


def test_without_a_thread_the_caller_writes(writer, monkeypatch):  # noqa: F811
    behind = BackgroundWriter(writer)

    def refused(self):
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    for number in range(2):
        behind.write_generation(*generation_of(number))
        assert len(RunLog(writer.path).generations) == number + 1
    monkeypatch.undo()
    behind.write_generation(*generation_of(2))
    behind.close()
    assert len(RunLog(writer.path).generations) == 3
    RunWriter.reopen(writer.path).close()


def test_what_fails_last_is_raised_by_close_and_the_run_is_released(
    writer,  # noqa: F811
    monkeypatch,
):
    behind = BackgroundWriter(writer)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("evocity.store.writer.write_single", full)
    behind.write_generation(*generation_of(0))
    with pytest.raises(RunError, match="No space left"):
        behind.close()
    monkeypatch.undo()
    RunWriter.reopen(writer.path).close()


def test_segments_are_merged_once_more(writer, short):  # noqa: F811
    for number in range(37):
        writer.write_generation(*generation_of(number))
        assert RunLog(writer.path).generations == range(number + 1)
    expected = [
        "generation-00000036.parquet",
        "segment-00000000-00000015.parquet",
        "segment-00000016-00000031.parquet",
        "segment-00000032-00000035.parquet",
    ]
    assert names(writer.path) == names(writer.path, "membership") == expected
    run = RunLog(writer.path)
    assert run.births()["generation"].to_pylist() == [g for g in range(37) for _ in range(2)]
    assert run.births(17)["id"].to_pylist() == [102, 103]
    assert [one["births"] for one in run.history()] == [2 * g + 2 for g in range(37)]
    assert run.individuals([102])[0].genome.digest == run.births(17)["genome"][0].as_py()


def test_segments_of_many_bytes_stay_as_they_are(writer, short, monkeypatch):  # noqa: F811
    monkeypatch.setattr(merge, "MOST_BYTES", 100)
    for number in range(16):
        writer.write_generation(*generation_of(number))
    assert len(names(writer.path)) == 4
    assert len(RunLog(writer.path).births()) == 32


def test_ten_thousand_generations_are_two_hundred_files():
    most = 0
    for done in range(1, 10_001):
        count, left = 0, done
        for span in reversed((1, *layout.SPANS)):
            whole, left = divmod(left, span)
            count += whole
        most = max(most, count)
    assert 2 * most <= 180


CHILD = """
import sys
sys.path[:0] = {path!r}
from test_store_log import generation_of
from evocity.store import BackgroundWriter, RunWriter, layout, merge, writer, RunLog
for module in (layout, merge):
    module.SPANS = (4, 16)
writer.SEGMENT = 4
behind = BackgroundWriter(RunWriter.reopen({run!r}))
for number in range(len(RunLog({run!r}).generations), 200):
    behind.write_generation(*generation_of(number))
    print(number, flush=True)
behind.close()
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL")
def test_a_kill_at_any_moment_leaves_whole_generations(writer, short):  # noqa: F811
    """Most of the time goes into writing and merging: that is where it is killed."""
    writer.close()
    drawn, reached = np.random.default_rng(4), [0]
    code = CHILD.format(path=sys.path, run=str(writer.path))
    for _ in range(4):
        child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE)
        for _ in range(drawn.integers(3, 10)):
            assert child.stdout.readline().strip()
        time.sleep(drawn.uniform(0, 0.05))
        child.kill()
        child.communicate()
        run = RunLog(writer.path)
        whole = len(run.generations)
        assert whole > reached[-1]
        reached.append(whole)
        assert not run.damaged
        if whole:
            assert run.births()["generation"].to_pylist() == sorted([*range(whole)] * 2)
    RunWriter.reopen(writer.path).close()
    again = RunLog(writer.path)
    assert len(again.generations) == reached[-1]
    assert len(names(writer.path)) <= 4 + 4 + reached[-1] // 16
