"""What the benchmarks share: a line about the machine, and timing."""

import os
import platform
import time
from collections.abc import Callable
from statistics import median

import numba
import numpy as np


def description() -> str:
    """Processor, cores, Python, numpy and numba, in one line."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo") as lines:
            name = next(line.split(":")[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        pass
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return (
        f"{name}, {cores} cores; Python {platform.python_version()}, "
        f"numpy {np.__version__}, numba {numba.__version__}"
    )


def timed(call: Callable[[], object], repeats: int = 10) -> tuple[float, float]:
    """(fastest, median) of ``repeats`` calls, milliseconds, after one that is not counted."""
    call()
    spent = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        spent.append(1e3 * (time.perf_counter() - start))
    return min(spent), median(spent)


def seconds(call: Callable[[], object]) -> float:
    """Of the processor, the least of three calls."""
    found = []
    for _ in range(3):
        began = time.process_time()
        call()
        found.append(time.process_time() - began)
    return min(found)


def sgemm(repeats: int = 5) -> float:
    """GFLOP/s of numpy's float32 matrix product in its one thread now: by it, times of machines
    that are shared or slower compare."""
    matrix = np.random.default_rng(0).random((2000, 2000), np.float32)
    return 16e3 / timed(lambda: matrix @ matrix, repeats)[0]
