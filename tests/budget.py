"""The budget of processor time of a case of tests.

A case of more than `DEAR` seconds needs the mark ``slow``; the summary lists those without it. A
case without a mark that takes more than `MOST` seconds fails. Child processes count. Loading and
compiling for the first time do not: the first case of a process would bear them for all others.
"""

import contextlib
import functools
import os
import sys
import threading
import time
from collections.abc import Iterator
from importlib import machinery
from pathlib import Path

import pytest

#: Seconds of processor above which a case needs the mark ``slow``.
DEAR = 1.5
#: Seconds of processor above which a case without a mark fails.
MOST = 5.0
#: Marks of cases that may take longer.
MARKS = ("slow", "long")
#: Seconds of processor that `_paced` takes on the machine where cases were marked.
USUAL = 0.02
#: What a report of a case says of its seconds.
COST = "processor_seconds"
#: The module of numba that says when it compiles.
NUMBA = "numba.core.event"


class _Loading(threading.local):
    """Seconds of processor that a thread spent on loading modules and compiling kernels."""

    spent = 0.0  # of all threads

    def __init__(self) -> None:
        self._depth, self._start = 0, 0.0

    def __enter__(self) -> None:
        if not self._depth:
            self._start = time.thread_time()
        self._depth += 1

    def __exit__(self, *_: object) -> None:
        self._depth -= 1
        if not self._depth:
            _Loading.spent += time.thread_time() - self._start


_loading = _Loading()


def _time_loading() -> None:
    """Have `_loading` time modules of Python and, once numba is loaded, its compiler."""
    execute = machinery.SourceFileLoader.exec_module

    @functools.wraps(execute)
    def timed(self, module):
        with _loading:
            execute(self, module)
        if module.__name__ == NUMBA:
            _time_compiling(module)

    machinery.SourceFileLoader.exec_module = timed
    if NUMBA in sys.modules:
        _time_compiling(sys.modules[NUMBA])


def _time_compiling(events) -> None:
    """Have `_loading` time what numba compiles or finds compiled, by its ``events``."""

    class Listener(events.Listener):
        def on_start(self, event) -> None:
            _loading.__enter__()

        def on_end(self, event) -> None:
            _loading.__exit__()

    events.register("numba:compiler_lock", Listener())


def seconds() -> float:
    """Seconds of processor of this process and all its descendants until now, without loading."""
    if not Path("/proc/self/task").is_dir():  # descendants count once they have ended
        return sum(os.times()[:4]) - _Loading.spent
    ticks, left = 0, [str(os.getpid())]
    while left:
        process = Path("/proc", left.pop())
        with contextlib.suppress(OSError):  # it ended just now: its parent has its ticks
            fields = (process / "stat").read_text().rpartition(")")[2].split()
            ticks += sum(map(int, fields[11:15]))
            left.extend(_children(process))
    return ticks / os.sysconf("SC_CLK_TCK") - _Loading.spent


def _children(process: Path) -> Iterator[str]:
    for task in (process / "task").iterdir():
        with contextlib.suppress(OSError):
            yield from (task / "children").read_text().split()


def _paced() -> float:
    """Seconds of processor that the same work takes here and now."""
    start = time.process_time()
    text = ""
    for number in range(100_000):
        text = f"{hash(text)}{number}"
    return time.process_time() - start


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_call(item):
    start = seconds()
    try:
        result = yield
    finally:
        spent = seconds() - start
        item.user_properties.append((COST, round(spent, 2)))
    if spent > MOST and not any(map(item.get_closest_marker, MARKS)):
        # on a slower or busier machine all takes longer, and not each moment alike
        pace = max(1.0, max(_paced() for _ in range(5)) / USUAL)
        if spent > MOST * pace:
            pytest.fail(
                f"the case took {spent:.1f} s of processor, its child processes included; "
                f"{MOST * pace:.1f} s are the most for a case without a mark. Make it cheaper, or "
                "mark it `slow`: `make test` leaves it out.",
                pytrace=False,
            )
    return result


def pytest_terminal_summary(terminalreporter):
    costs = [
        (dict(report.user_properties).get(COST, 0.0), report.nodeid)
        for report in terminalreporter.stats.get("passed", [])
        if report.when == "call" and not any(mark in report.keywords for mark in MARKS)
    ]
    dear = sorted((one for one in costs if one[0] > DEAR), reverse=True)
    if dear:
        terminalreporter.section(f"cases of more than {DEAR} s of processor without a mark")
        for spent, name in dear:
            terminalreporter.write_line(f"{spent:6.2f} s  {name}")


_time_loading()
