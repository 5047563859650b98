"""One observed call of a measure: result, time, output, warnings, and side effects on the map."""

import contextlib
import ctypes
import io
import math
import os
import sys
import threading
import time
import tracemalloc
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, is_dataclass, replace
from pathlib import Path
from types import FrameType

import numpy as np

from evocity.citymap import CityMap
from evocity.fitness.measure import Measure, line_in
from evocity.fitness.reference import Reference
from evocity.genome import Genome


@dataclass(frozen=True)
class Case:
    """A map to measure, with the further arguments of measures.

    city : the map. genome : the code it was decoded from. parents : the genomes that code was bred
    from. code_of : the name of the map, among those tried with it, that its genome encodes.
    reference : the cities to compare it with. sources : the maps of its source cities.
    """

    city: CityMap
    genome: Genome | None = None
    parents: Sequence[Genome] | None = None
    code_of: str | None = None
    reference: Reference | None = None
    sources: Sequence[CityMap] | None = None

    def serves(self, measure: Measure) -> bool:
        """Check whether the case has all that the ``measure`` needs."""
        return all(getattr(self, need) is not None for need in measure.needs)

    def measured(self, measure: Measure) -> float:
        """Call the ``measure`` on the case. Raises `FitnessError` as the measure does."""
        return measure(
            self.city,
            genome=self.genome,
            parents=self.parents,
            reference=self.reference,
            sources=self.sources,
        )

    def fresh(self) -> "Case":
        """Copy the case with a map that has no views yet."""
        return replace(self, city=self.city.replace(self.city.heights))


@dataclass(frozen=True)
class Call:
    """The outcome of one call.

    value : the number; None without one, see ``error``.
    seconds : the time of the call, or the time limit.
    error : the exception; TimeoutError at the time limit.
    line : the line in the measure's file where the call raised, hung, or returned no number, or
        NaN without a reason.
    printed, warned : the first line printed on standard output, and the first warning of
        arithmetic, each with its line in the measure's file; None for none.
    peak : most bytes that the call held, if requested.
    """

    value: float | None
    seconds: float
    error: BaseException | None = None
    line: int | None = None
    printed: tuple[int | None, str] | None = None
    warned: tuple[int | None, str] | None = None
    peak: int | None = None


def observe(measure: Measure, case: Case, timeout: float, *, memory: bool = False) -> Call:
    """Call ``measure`` on ``case`` in a thread; stop it after ``timeout`` seconds.

    ``memory`` requests ``peak``, which slows the call. Output of the measure does not reach
    standard output. The function raises nothing for errors of the measure.
    """
    outcome: dict = {}
    thread = threading.Thread(target=_call, args=(measure, case, outcome), daemon=True)
    recorder, standard = _Recorder(measure.file), sys.stdout
    with warnings.catch_warnings(), _memory(memory) as peak, _without_exit():
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", RuntimeWarning)
        warnings.showwarning = recorder.warn
        sys.stdout = recorder
        try:
            thread.start()
            thread.join(timeout)
            hanging = thread.is_alive() and "seconds" not in outcome
            line = _stop(thread, measure) if thread.is_alive() else outcome.get("line")
        finally:
            sys.stdout = standard
    return Call(
        value=outcome.get("value"),
        seconds=outcome.get("seconds", timeout),
        error=TimeoutError() if hanging else outcome.get("error"),
        line=line,
        printed=recorder.printed,
        warned=recorder.warned,
        peak=peak[0],
    )


@contextlib.contextmanager
def _without_exit() -> Iterator[None]:
    """Turn os._exit into an exception in the block, so that the report names it."""

    def refuse(code: int = 0):
        raise SystemExit(f"os._exit({code}), which ends the process")

    standard, os._exit = os._exit, refuse
    try:
        yield
    finally:
        os._exit = standard


@contextlib.contextmanager
def _memory(trace: bool) -> Iterator[list[int | None]]:
    """Set the list's one entry to the most bytes held in the block, if ``trace``."""
    peak: list[int | None] = [None]
    if not trace:
        yield peak
        return
    running = tracemalloc.is_tracing()
    if not running:
        tracemalloc.start()
    tracemalloc.reset_peak()
    before, _ = tracemalloc.get_traced_memory()
    try:
        yield peak
    finally:
        peak[0] = tracemalloc.get_traced_memory()[1] - before
        if not running:
            tracemalloc.stop()


def _call(measure: Measure, case: Case, outcome: dict) -> None:
    start = time.perf_counter()
    with contextlib.suppress(_Stop):
        try:
            outcome["value"] = value = case.measured(measure)
            outcome["seconds"] = time.perf_counter() - start
            if math.isnan(value) and not hasattr(value, "reason"):
                outcome["line"] = _line_of_return(measure, case)
        except _Stop:
            raise
        except BaseException as error:
            outcome["error"], outcome["seconds"] = error, time.perf_counter() - start
            outcome["line"] = line_in(measure.file, error.__cause__ or error) or _line_of_return(
                measure, case
            )


def _line_of_return(measure: Measure, case: Case) -> int | None:
    """Find the line of the ``return`` that ends the function, by one more call."""
    lines = [measure.line]

    def look(frame: FrameType, event: str, argument) -> None:
        if event == "return" and frame.f_code is measure.function.__code__:
            lines.append(frame.f_lineno)

    sys.setprofile(look)  # only in this thread
    try:
        with contextlib.suppress(Exception):
            case.fresh().measured(measure)
    finally:
        sys.setprofile(None)
    return lines[-1]


class _Stop(BaseException):
    """Ends a call after its time limit."""


def _stop(thread: threading.Thread, measure: Measure) -> int:
    """Find the current line of the call in ``thread``, and end the call if it keeps a core busy."""
    line = _line_in(measure.file, sys._current_frames().get(thread.ident)) or measure.line
    # An endless loop would slow all later measurements. A waiting call costs nothing, and must not
    # keep a pending exception: that can stop the profiling of other threads.
    if _is_busy(thread):
        ident, ending = ctypes.c_ulong(thread.ident), ctypes.py_object(_Stop)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ident, ending)
        thread.join(1.0)
    return line


def _is_busy(thread: threading.Thread) -> bool:
    """Check whether the ``thread`` computes, or would if it had a core; False where the system does
    not show it."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return False
    clock = time.pthread_getcpuclockid(thread.ident)
    before = time.clock_gettime(clock)
    thread.join(0.05)
    return thread.is_alive() and (
        time.clock_gettime(clock) - before > 0.01 or _is_runnable(thread.native_id)
    )


def _is_runnable(thread: int | None) -> bool:
    """Check whether Linux would run a ``thread`` now, which may wait for a core."""
    with contextlib.suppress(OSError):
        state = Path(f"/proc/self/task/{thread}/stat").read_text().rpartition(")")[2].split()
        return state[:1] == ["R"]
    return False


def _line_in(file: str, frame: FrameType | None) -> int | None:
    """Find the innermost line of ``file`` among ``frame`` and its callers."""
    while frame is not None:
        if frame.f_code.co_filename == file:
            return frame.f_lineno
        frame = frame.f_back
    return None


class _Recorder(io.TextIOBase):
    """A substitute for standard output that records the first line, and the first warning."""

    def __init__(self, file: str):
        self._file = file
        self._line: int | None = None
        self._text = ""
        self._whole = False
        self.warned: tuple[int | None, str] | None = None

    @property
    def printed(self) -> tuple[int | None, str] | None:
        return (self._line, self._text) if self._text.strip() else None

    def writable(self) -> bool:
        return True

    def write(self, text: str) -> int:
        if not self._whole:
            if not self._text.strip():
                self._text = ""
                self._line = _line_in(self._file, sys._getframe(1))
            head, newline, _ = text.partition("\n")
            self._text = (self._text + head)[:60]
            self._whole = bool(newline) and bool(self._text.strip())
        return len(text)

    def warn(self, message, category, filename, lineno, file=None, line=None) -> None:
        if self.warned is None:
            self.warned = _line_in(self._file, sys._getframe(1)), f"{category.__name__}: {message}"


def same_value(first: float, second: float) -> bool:
    """Check whether two values are the same number, or both NaN."""
    return first == second or (math.isnan(first) and math.isnan(second))


def list_writable(city: CityMap) -> list[str]:
    """List heights and views that are writable, by name: ``city.buildings.area``.

    Private fields of a view may be writable from the start, and do not count.
    """
    paths = {}
    for name, value in vars(city).items():
        for path, array, _ in _pairs(f"city.{name}", value, value, private=False):
            if isinstance(array, np.ndarray) and array.flags.writeable:
                paths[path] = True
    return list(paths)


def list_changes(city: CityMap, fresh: CityMap, *, views: bool) -> list[str]:
    """List the fields of ``city`` that differ in any bit from those of a ``fresh`` map with the
    original heights, by name.

    ``views`` also compares the views that ``city`` holds, which ``fresh`` computes again.
    """
    paths = {}
    for name in {**vars(fresh), **(vars(city) if views else {})}:
        held, right = vars(city).get(name), getattr(fresh, name, None)
        for path, value, other in _pairs(f"city.{name}", held, right):
            if not _equal(value, other):
                paths[path] = True
    return list(paths)


def _pairs(path: str, held, right, *, private: bool = True) -> Iterator[tuple[str, object, object]]:
    """Pair the values ``held`` with those of the ``right`` map, within tuples and tables such as
    `Buildings`, each with its path; ``private`` includes private fields."""
    if type(held) is type(right) and is_dataclass(held) and hasattr(held, "__dict__"):
        for name, value in vars(held).items():  # cached properties too
            hidden = name.startswith("_")
            if private or not hidden:
                inner = path if hidden else f"{path}.{name}"
                yield from _pairs(inner, value, getattr(right, name, None), private=private)
    elif isinstance(held, tuple) and isinstance(right, tuple) and len(held) == len(right):
        for value, other in zip(held, right, strict=True):
            yield from _pairs(path, value, other, private=private)
    else:
        yield path, held, right


def _equal(held, right) -> bool:
    if type(held) is not type(right):
        return False
    if isinstance(held, np.ndarray):
        same_kind = held.dtype == right.dtype and held.shape == right.shape
        return same_kind and held.tobytes() == right.tobytes()
    return held == right
