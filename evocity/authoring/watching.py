"""One call of a measure, watched: what it gave and took, what it printed, where it hung."""

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
from dataclasses import dataclass, replace
from types import FrameType

from evocity.citymap import CityMap
from evocity.fitness.measure import Measure, line_in
from evocity.fitness.reference import Reference
from evocity.genome import Genome


@dataclass(frozen=True)
class Case:
    """A map to measure; for measures that ask for them ``genome``, the code it was decoded from,
    ``parents``, what that was bred from, ``reference``, what to compare it with, and ``sources``,
    the maps of the cities it is made of. ``code_of``: the name of the map, among those tried with
    it, that its genome codes."""

    city: CityMap
    genome: Genome | None = None
    parents: Sequence[Genome] | None = None
    code_of: str | None = None
    reference: Reference | None = None
    sources: Sequence[CityMap] | None = None

    def serves(self, measure: Measure) -> bool:
        """Whether it has what the ``measure`` asks for."""
        return all(getattr(self, need) is not None for need in measure.needs)

    def measured(self, measure: Measure) -> float:
        """What the ``measure`` says of it. Raises `FitnessError` as the measure does."""
        return measure(
            self.city,
            genome=self.genome,
            parents=self.parents,
            reference=self.reference,
            sources=self.sources,
        )

    def fresh(self) -> "Case":
        """The same with a map that has no views yet."""
        return replace(self, city=self.city.replace(self.city.heights))


@dataclass(frozen=True)
class Call:
    """What one call came to.

    value : the number, or None if there is none: see ``error``.
    seconds : it took; up to where it was given up.
    error : what it raised; TimeoutError if it was given up.
    line : in the measure's file, where it raised, was given up, or returned no number, or NaN
        without a reason.
    printed, warned : the first line of what it printed on standard output, the first warning of
        arithmetic, each with its line in the measure's file; None if there is none.
    peak : bytes it held at most, if asked for.
    """

    value: float | None
    seconds: float
    error: BaseException | None = None
    line: int | None = None
    printed: tuple[int | None, str] | None = None
    warned: tuple[int | None, str] | None = None
    peak: int | None = None


def watched(measure: Measure, case: Case, timeout: float, *, memory: bool = False) -> Call:
    """Call ``measure`` on ``case`` in a thread of its own; give it up after ``timeout`` seconds.

    ``memory`` asks for ``peak``, which makes the call slower. What the measure prints is kept
    from standard output. Never raises for what the measure does.
    """
    found: dict = {}
    thread = threading.Thread(target=_call, args=(measure, case, found), daemon=True)
    ear, standard = _Ear(measure.file), sys.stdout
    with warnings.catch_warnings(), _memory(memory) as peak, _staying():
        warnings.simplefilter("ignore")
        warnings.simplefilter("always", RuntimeWarning)
        warnings.showwarning = ear.warn
        sys.stdout = ear
        try:
            thread.start()
            thread.join(timeout)
            hanging = thread.is_alive() and "seconds" not in found
            line = _ended(thread, measure) if thread.is_alive() else found.get("line")
        finally:
            sys.stdout = standard
    return Call(
        value=found.get("value"),
        seconds=found.get("seconds", timeout),
        error=TimeoutError() if hanging else found.get("error"),
        line=line,
        printed=ear.printed,
        warned=ear.warned,
        peak=peak[0],
    )


@contextlib.contextmanager
def _staying() -> Iterator[None]:
    """Within, whoever would end the process at once gets an exception, and so is told of."""

    def refuse(code: int = 0):
        raise SystemExit(f"os._exit({code}), which ends the process")

    standard, os._exit = os._exit, refuse
    try:
        yield
    finally:
        os._exit = standard


@contextlib.contextmanager
def _memory(wanted: bool) -> Iterator[list[int | None]]:
    """The list's one entry becomes the bytes that were held at most within, if ``wanted``."""
    peak: list[int | None] = [None]
    if not wanted:
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


def _call(measure: Measure, case: Case, found: dict) -> None:
    start = time.perf_counter()
    with contextlib.suppress(_GivenUp):
        try:
            found["value"] = value = case.measured(measure)
            found["seconds"] = time.perf_counter() - start
            if math.isnan(value) and not hasattr(value, "reason"):
                found["line"] = _line_of_return(measure, case)
        except _GivenUp:
            raise
        except BaseException as error:
            found["error"], found["seconds"] = error, time.perf_counter() - start
            found["line"] = line_in(measure.file, error.__cause__ or error) or _line_of_return(
                measure, case
            )


def _line_of_return(measure: Measure, case: Case) -> int | None:
    """The line of the ``return`` that the function leaves by: it is called once more."""
    lines = [measure.line]

    def look(frame: FrameType, event: str, argument) -> None:
        if event == "return" and frame.f_code is measure.function.__code__:
            lines.append(frame.f_lineno)

    sys.setprofile(look)  # of this thread alone
    try:
        with contextlib.suppress(Exception):
            case.fresh().measured(measure)
    finally:
        sys.setprofile(None)
    return lines[-1]


class _GivenUp(BaseException):
    """Ends a call that nobody waits for any more."""


def _ended(thread: threading.Thread, measure: Measure) -> int:
    """The line at which the call in ``thread`` is; it is ended if it keeps a core busy."""
    line = _line_in(measure.file, sys._current_frames().get(thread.ident)) or measure.line
    # An endless loop would go on at the expense of all that is timed after it. What waits costs
    # nothing, and must not be left with an exception that it does not get to: that can stop the
    # profiling of other threads.
    if _is_busy(thread):
        ident, ending = ctypes.c_ulong(thread.ident), ctypes.py_object(_GivenUp)
        ctypes.pythonapi.PyThreadState_SetAsyncExc(ident, ending)
        thread.join(1.0)
    return line


def _is_busy(thread: threading.Thread) -> bool:
    """Whether the ``thread`` computes; False where the system does not tell."""
    if not hasattr(time, "pthread_getcpuclockid"):
        return False
    clock = time.pthread_getcpuclockid(thread.ident)
    before = time.clock_gettime(clock)
    thread.join(0.05)
    return thread.is_alive() and time.clock_gettime(clock) - before > 0.01


def _line_in(file: str, frame: FrameType | None) -> int | None:
    """The innermost line of ``file`` among ``frame`` and those that called it."""
    while frame is not None:
        if frame.f_code.co_filename == file:
            return frame.f_lineno
        frame = frame.f_back
    return None


class _Ear(io.TextIOBase):
    """Stands in for standard output, and remembers who spoke first."""

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


def same(first: float, second: float) -> bool:
    """Whether two values are the same number, or both NaN."""
    return first == second or (math.isnan(first) and math.isnan(second))
