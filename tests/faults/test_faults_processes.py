"""What a process of evocity starts ends with it, also what is still loading its libraries."""

import os
import signal
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import pytest

from evocity.child_process import python_command, tie_to_parent
from evocity.evaluation import compilation, kernel_warmup, linux_processes, worker_start
from evocity.evaluation.evaluator import Setup
from evocity.evaluation.worker_pool import Cancelled, Workers
from evocity.kinds import KINDS as CHROMOSOMES

if not linux_processes.LINUX:
    pytest.skip("what Linux gives", allow_module_level=True)


def alive(pid: int) -> bool:
    """Whether a process is there and has not ended."""
    return linux_processes._stat(pid)[:1] not in ([], [b"Z"])


def gone(pid: int, seconds: float = 60.0) -> bool:
    """Whether a process ends within so many seconds."""
    until = time.monotonic() + seconds
    while alive(pid):
        if time.monotonic() > until:
            linux_processes.kill(pid)
            return False
        time.sleep(0.01)
    return True


@pytest.fixture
def cold(tmp_path, monkeypatch):
    """Nothing is compiled, so that a nursery warms up for minutes; it is the only one."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(worker_start, "_the_nursery", None)


@pytest.fixture
def setup():
    header = SimpleNamespace(chromosome=CHROMOSOMES["fabric"], measures=(), recorded=())
    return Setup(header, (), sides=4, parts=(kernel_warmup.SEARCH, kernel_warmup.DECODE))


def child_of_killed(start) -> int:
    """The id that ``start`` gives in a forked process, which is then killed."""
    read, write = os.pipe()
    parent = os.fork()
    if parent == 0:
        try:
            os.write(write, b"%d" % start())
            time.sleep(600)
        finally:
            os._exit(1)
    os.close(write)
    with open(read, "rb") as told:
        pid = int(os.read(told.fileno(), 20))
    os.kill(parent, signal.SIGKILL)
    os.waitpid(parent, 0)
    return pid


def test_a_tied_program_ends_with_the_process_that_starts_it():
    def start() -> int:
        program = tie_to_parent("import time; time.sleep(600)")
        return subprocess.Popen([sys.executable, "-I", "-S", "-c", program]).pid

    assert gone(child_of_killed(start))


def test_a_job_of_the_desk_ends_with_a_killed_studio():
    def start() -> int:
        return subprocess.Popen(python_command("import time; time.sleep(600)", tied=True)).pid

    assert gone(child_of_killed(start))


def test_a_tied_program_whose_parent_is_gone_already_imports_nothing():
    program = tie_to_parent("print('imports')")  # of this process
    words = [sys.executable, "-I", "-S", "-c", program]
    between = f"import subprocess, sys; sys.exit(subprocess.call({words!r}))"
    done = subprocess.run([sys.executable, "-I", "-S", "-c", between], capture_output=True)
    assert (done.returncode, done.stdout) == (1, b"")


@pytest.mark.parametrize("seconds", [0.0, pytest.param(4.0, marks=pytest.mark.slow)])
def test_a_nursery_that_warms_up_ends_with_a_killed_parent(cold, setup, seconds):
    def start() -> int:
        pid = worker_start._Nursery(setup).pid
        time.sleep(seconds)
        return pid

    assert gone(child_of_killed(start))


def test_what_compiles_ends_with_a_killed_parent(cold):
    def start() -> int:
        helper = compilation._start(4)
        helper.stdin.write(f"{kernel_warmup.SEARCH}\n")
        helper.stdin.flush()
        return helper.pid

    assert gone(child_of_killed(start))


def test_a_nursery_outlives_the_thread_that_asked_for_it(cold, setup):
    made = []
    thread = threading.Thread(target=lambda: made.append(worker_start._Nursery(setup)))
    thread.start()
    thread.join()
    (nursery,) = made
    time.sleep(0.7)
    assert nursery.is_running()
    began = time.monotonic()
    nursery.end()
    assert time.monotonic() - began < 8  # and not as long as one that is warm would have
    assert not alive(nursery.pid)


@pytest.mark.parametrize("how", ["cancel", "close"])
def test_an_end_waits_for_no_nursery_that_warms_up(cold, setup, how):
    workers, raised = Workers(setup, 2, 30.0), []

    def work() -> None:
        try:
            workers.run("evaluate", [(None,)])
        except Cancelled as error:
            raised.append(error)

    if how == "cancel":
        thread = threading.Thread(target=work)
        thread.start()
        while workers._starter is None or not workers._seats:
            time.sleep(0.01)
        nursery, end = workers._starter._nursery, workers.cancel
    else:
        workers._fill_seats()
        nursery, end = workers._starter._nursery, workers.close
    assert alive(nursery.pid)
    began = time.monotonic()
    end()
    if how == "cancel":
        thread.join(60)
        assert raised
    assert time.monotonic() - began < 8
    assert not alive(nursery.pid)
    workers.close()


def test_a_pool_that_closes_spares_a_nursery_for_which_another_waits(cold, setup):
    first, second = worker_start.NurseryStarter(setup), worker_start.NurseryStarter(setup)
    nursery = first._nursery
    assert second._nursery is nursery
    first.close()
    assert nursery.is_running()
    second.close()
    assert not nursery.is_running()


PAGES = """
import resource
import numpy as np
from evocity.evaluation import linux_processes

def new_pages():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(4):
        arrays = [np.ones(1 << 20) for _ in range(4)]
        del arrays
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before

linux_processes.keep_freed_memory(1 << 20)
print(new_pages(), new_pages())
linux_processes.keep_freed_memory()
print(new_pages(), new_pages())
"""


@pytest.mark.skipif(not hasattr(linux_processes._libc(), "mallopt"), reason="only glibc keeps it")
def test_a_process_keeps_freed_memory_for_its_next_arrays():
    found = subprocess.run(
        [sys.executable, "-c", PAGES], capture_output=True, text=True, check=True
    )
    _, little, _, much = map(int, found.stdout.split())
    assert little > 1000
    assert much < little / 10
