"""What is compiled once is there for every later process: the kernels come from numba's cache."""

import inspect
import os
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from evocity.accelerate import Kernel, kernel

ROOT = Path(__file__).parent.parent
MODULES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts)
    for path in sorted((ROOT / "evocity").rglob("_kernels.py"))
]
# Compiles and runs a kernel that calls two others, then tells how often the cache had it.
RANKING = """
import numpy as np
from evocity.coding.matching.exact_scores._kernels import rank

which, y, x = np.zeros((3, 1), np.int64)
blocks, sources = np.arange(4.0)[None], np.tile(np.arange(4), (8, 1))
found = np.empty((1, 8)), np.empty((1, 8)), np.empty(1)
rank(which, y, x, np.eye(4), 1, 2, blocks, sources, 1.0, *found)
print(sum(rank.compiled.stats.cache_hits.values()), sum(rank.compiled.stats.cache_misses.values()))
"""
# Compiles version K of a kernel while another process compiles another version of it, both slow to
# write: each is past reading the index before the other has written it.
RACING = """
import sys, time
from pathlib import Path
from numba.core.caching import IndexDataCacheFile as CacheFile

k, others, slow = int(sys.argv[1]), sys.argv[2].split(","), (float(s) for s in sys.argv[3:])

def delayed(write, seconds):
    return lambda *given: (time.sleep(seconds), write(*given))

CacheFile._save_index = delayed(CacheFile._save_index, next(slow))
CacheFile._save_data = delayed(CacheFile._save_data, next(slow))

from versions import version_of

Path(f"{k}.ready").touch()
while not all(Path(f"{other}.ready").exists() for other in others):
    time.sleep(0.01)
print(version_of(k)(1))
"""
VERSIONS = """
from evocity.accelerate import kernel

def version_of(k):
    @kernel
    def version(x):
        return x * k
    return version
"""


def kernels(module):
    """The kernels of a module, those too that are made for one size of block."""
    for thing in vars(module).values():
        if hasattr(thing, "cache_parameters"):  # of functools: it makes kernels, once a size
            thing = thing(*[4] * len(inspect.signature(thing).parameters))
        things = thing if isinstance(thing, tuple) else (thing,)
        yield from (one for one in things if isinstance(one, Kernel))


def held(function):
    """What a kernel takes from the function that made it: numba pickles it to know the kernel."""
    return [cell.cell_contents for cell in function.py_func.__closure__ or ()]


def is_plain(value):
    if isinstance(value, tuple):
        return all(map(is_plain, value))
    return isinstance(value, int | float | str | np.generic)


@pytest.mark.parametrize("name", MODULES)
def test_kernels_hold_plain_numbers_only(name):
    # another kernel, or an intrinsic, is pickled under a name drawn anew in each process
    found = list(kernels(import_module(name)))
    assert found
    faults = {one.py_func.__qualname__ for one in found if not all(map(is_plain, held(one)))}
    assert not faults


def test_a_kernel_that_holds_another_is_told():
    size = 3

    @kernel
    def inner(value):
        return value + size

    @kernel
    def outer(value):
        return inner(value)

    assert [held(inner), is_plain(size), is_plain((1, 2.0, np.float32(1)))] == [[3], True, True]
    assert held(outer) == [inner]
    assert not is_plain(inner)
    assert not is_plain((1, inner))


@pytest.mark.slow
def test_a_second_process_compiles_nothing(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    told = [
        subprocess.run(
            [sys.executable, "-c", RANKING],
            env=environment, cwd=ROOT, capture_output=True, text=True, check=True,
        ).stdout
        for _ in range(2)
    ]  # fmt: skip
    assert told == ["0 1\n", "1 0\n"]


@pytest.mark.slow
def test_processes_that_compile_at_once_spoil_nothing(tmp_path):
    (tmp_path / "versions.py").write_text(VERSIONS)
    environment = os.environ | {
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"
    }  # fmt: skip

    def begin(script, *words):
        return subprocess.Popen(
            [sys.executable, "-c", script, *words],
            env=environment, cwd=tmp_path, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip

    def told(process):
        out, _ = process.communicate(timeout=240)
        assert process.returncode == 0
        return out

    # the first to write the index is the last to write its code, were there no lock
    racing = [begin(RACING, "3", "5", "0.4", "2"), begin(RACING, "5", "3", "1", "0")]
    assert [told(process) for process in racing] == ["3\n", "5\n"]
    later = "from versions import version_of\nprint(version_of(3)(1), version_of(5)(1))"
    assert told(begin(later)) == "3 5\n"


RENAMED = """
import sys
from collections import namedtuple
from pathlib import Path

import numpy as np
from evocity.accelerate import kernel

sys.modules["areas"] = areas = type(sys)("areas")
areas.Area = namedtuple("Area", "wide high")
areas.Area.__module__ = "areas"

@kernel
def extent(area):
    return area.wide * area.high

print(extent(areas.Area(2, 3)))
"""


def test_an_index_that_names_a_module_of_another_version_is_written_again(tmp_path):
    for module in ("areas", "regions"):
        text = RENAMED.replace("areas", module)
        (tmp_path / "measured.py").write_text(text, encoding="utf-8")
        os.utime(tmp_path / "measured.py", (1, 1))
        env = os.environ | {"PYTHONPATH": str(ROOT)}
        command = [sys.executable, "measured.py"]
        shown = subprocess.run(
            command, cwd=tmp_path, env=env, check=True, capture_output=True, text=True
        )
        assert shown.stdout == "6\n"


@pytest.mark.slow
def test_processes_number_what_they_compile_apart():
    program = (
        "import os\n"
        "from evocity.accelerate import cache_folder\n"
        "cache_folder()\n"
        "from numba.core.bytecode import FunctionIdentity\n"
        "def told():\n"
        "    print(next(FunctionIdentity._unique_ids), flush=True)\n"
        "told()\n"
        "if hasattr(os, 'fork'):\n"
        "    child = os.fork()\n"
        "    told()\n"
        "    os.waitpid(child, 0) if child else os._exit(0)\n"
    )
    words = [sys.executable, "-c", program]
    told = [subprocess.run(words, capture_output=True, text=True, check=True) for _ in range(3)]
    numbers = [int(line) for one in told for line in one.stdout.split()]
    assert len(set(numbers)) == len(numbers) >= 3


@kernel
def copied_twice(numbers):
    return numbers.copy(), numbers.copy()


class Stopped(KeyboardInterrupt):
    """Ctrl-C, or another signal that ends a run."""


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="signals of POSIX")
def test_a_signal_in_a_kernel_is_raised_as_it_is():
    """Numba returns the result of the kernel with the exception of the signal's handler set, of
    which Python makes a SystemError."""

    def stop(*_):
        raise Stopped

    numbers = np.zeros(1000)
    copied_twice(numbers)

    def work(seconds: float):
        signal.setitimer(signal.ITIMER_REAL, seconds)
        while True:
            copied_twice(numbers)

    before, found = signal.signal(signal.SIGALRM, stop), []
    left = signal.setitimer(signal.ITIMER_REAL, 0.0)[0]  # of pytest-timeout
    try:
        for number in range(200):
            with pytest.raises(BaseException) as caught:
                work(2e-4 + 4e-6 * number)
            found.append(caught.type)
    finally:
        signal.signal(signal.SIGALRM, before)
        signal.setitimer(signal.ITIMER_REAL, left)
    assert set(found) == {Stopped}


def test_nobody_is_told_when_llvm_is_called():
    from llvmlite.binding import ffi
    from numba.core import event

    calls = event.RecordingListener()
    event.register("numba:llvm_lock", calls)
    try:
        assert kernel(lambda x: x + 1, cache=False)(1) == 2
    finally:
        event.unregister("numba:llvm_lock", calls)
    assert calls.buffer == []
    assert ffi.lib._lock._cblist == []
