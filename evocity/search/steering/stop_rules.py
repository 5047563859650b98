"""Stop rules: what ends a search before its last generation, ``[stop]`` of its recipe.

SIGTERM and SIGHUP, from `kill`, a shutdown or a closed terminal, end it as Ctrl-C does. Stop rules
change no birth: a resumed run has the births of one that never stopped.
"""

import contextlib
import math
import os
import signal
import threading
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from evocity.errors import RecipeError, format_bytes
from evocity.fitness import Aims, Objective
from evocity.recipe.stop_and_notify import StopSection, moment_of
from evocity.search.record.commands import REVISED
from evocity.search.steering.generation import Generation
from evocity.selection.individual import Individual
from evocity.store import RunLog

_SIGNALS = ("SIGTERM", "SIGHUP")

#: Returns the time, with its zone.
Clock = Callable[[], datetime]

#: Keys that a user overrides by asking for more generations.
_OVERRIDABLE = ("target", "stagnation")


def current_time() -> datetime:
    """Return the time of this machine, with its zone."""
    return datetime.now().astimezone()


@dataclass(frozen=True)
class Reason:
    """Why a search stops: ``by`` which key of ``[stop]``, and in ``words``."""

    by: str
    words: str

    @property
    def note(self) -> str:
        """The note for a user who resumes a run while the reason still holds."""
        return f"{self.words} still; to go on, ask for {self.remedy}"

    @property
    def remedy(self) -> str:
        """The change after which the search goes on."""
        if self.by == "disk":
            return "another [stop] disk (--recipe)"
        if self.by == "until":
            return "another time (--until, or --recipe), or --until none"
        return "more generations (--generations), or another [stop] (--recipe)"


def refuse_past_time(section: StopSection, clock: Clock) -> None:
    """Raise `RecipeError` for an ``until`` that has passed before the search begins."""
    until = None if section.until is None else moment_of(section.until, clock())
    if until is not None and until <= clock():
        raise RecipeError(
            f"stop.until: {section.until!r} has passed",
            "a date with a time in the future, or a time of the day such as 07:00",
            "write a later date, or remove the key 'until' from [stop]",
        )


def progress_of(hypervolume: float | None, figures: Mapping[str, float]) -> float:
    """Return the number that grows while a search gets better: the QD-score of algorithms that
    report one, else the hypervolume. The log has None for infinity; NaN means unknown."""
    progress = figures.get("qd_score", hypervolume)
    return math.inf if progress is None else progress


@dataclass
class Stagnation:
    """How long nothing has got better: the ``best`` progress, and its ``generation``. Generations
    before ``since`` do not count, nor those whose progress is NaN, or 0 before anybody is feasible.
    """

    best: float = 0.0
    generation: int | None = None
    since: int = 0
    _no_better: list[int] = field(default_factory=list)  # generations after the best, in order

    def add(self, generation: int, progress: float) -> None:
        """Take in the ``progress`` of a ``generation``."""
        if progress > self.best:
            self.best, self.generation, self._no_better = progress, generation, []
        elif self.generation is not None and not math.isnan(progress):
            self._no_better.append(generation)

    @property
    def count(self) -> int:
        """How many generations made no progress since."""
        return len(self._no_better) - bisect_right(self._no_better, self.since)


class Stopping:
    """Checks after each generation whether a search stops; ``reason``: why, or None.

    aims : the measures in the target of the ``section`` ``[stop]``.
    folder : of the run; None if it is not kept.
    written : returns once the folder holds all births.

    ``overridden`` are the keys that no longer count, as a user asked for more generations.
    """

    def __init__(
        self,
        section: StopSection,
        aims: Aims,
        folder: str | os.PathLike | None = None,
        clock: Clock = current_time,
        written: Callable[[], None] = lambda: None,
    ):
        self.section, self.folder, self.clock = section, folder, clock
        self._written = written
        self.reason: Reason | None = None
        self.overridden: tuple[str, ...] = ()
        self._objectives = {one.measure.name: one.objective for one in aims.wanted}
        self._until = None if section.until is None else moment_of(section.until, clock())
        self._stagnation, self._size = Stagnation(), self._folder_size()

    def check(self, generation: Generation) -> None:
        """Update ``reason`` after a ``generation``."""
        progress = progress_of(generation.hypervolume, generation.algorithm)
        self._stagnation.add(generation.number, progress)
        before, self._size = self._size, self._folder_size()
        self.reason = self._find_reason(generation.population, max(0, self._size - before))

    @property
    def best(self) -> float | None:
        """The most progress so far; None before there is any."""
        return None if self._stagnation.generation is None else self._stagnation.best

    def reset_progress(self) -> None:
        """Forget the progress so far: goals with other weights are not comparable."""
        self._stagnation = Stagnation(since=self._stagnation.since)

    def resume(self, run: RunLog, living: Sequence[Individual], more: bool) -> dict:
        """Go on from the log of a ``run``; return what the event of the resume adds to the log.
        With ``more`` generations, a target that is reached does not count, and stagnation counts
        from here."""
        if not run.generations:
            return {}
        comparable = 0
        for event in run.events():
            since = event.get("generation")
            if not isinstance(since, int) or since > len(run.generations):
                continue  # of a generation that was set aside
            if event.get("command") == "reweight" or event.get("event") == REVISED:
                comparable = since
            if event.get("event") == REVISED:
                self.overridden, self._stagnation.since = (), 0
            for key in event.get("held", ()) if event.get("event") == "resume" else ():
                self._override(str(key), since - 1)
        for summary in run.history():
            if summary["generation"] >= comparable:
                figures = summary.get("hypervolume", math.nan), summary.get("algorithm", {})
                self._stagnation.add(summary["generation"], progress_of(*figures))
        self.reason = self._find_reason(living)
        while more and self.reason is not None and self.reason.by in _OVERRIDABLE:
            self._override(self.reason.by, run.generations[-1])
            self.reason = self._find_reason(living)
        return {"held": list(self.overridden)} if self.overridden else {}

    def _override(self, key: str, generation: int) -> None:
        self.overridden = tuple(dict.fromkeys((*self.overridden, key)))
        if key == "stagnation":
            self._stagnation.since = generation

    def _find_reason(self, living: Sequence[Individual], grown: int = 0) -> Reason | None:
        """``grown``: bytes of the last generation; the next must fit too."""
        return (
            self._check_target(living)
            or self._check_stagnation()
            or self._check_disk(grown)
            or self._check_time()
        )

    def _check_target(self, living: Sequence[Individual]) -> Reason | None:
        target = self.section.target
        if not target or "target" in self.overridden:
            return None
        reached = [
            one.id
            for one in living
            if not one.violation
            and all(_reaches(self._objectives[n], one.values[n], target[n]) for n in target)
        ]
        return Reason("target", f"target reached by {min(reached)}") if reached else None

    def _check_stagnation(self) -> Reason | None:
        count = self._stagnation.count
        if self.section.stagnation is None or count < self.section.stagnation:
            return None
        best = f"the best is of generation {self._stagnation.generation}"
        return Reason("stagnation", f"{count} generations without progress, {best}")

    def _check_disk(self, grown: int) -> Reason | None:
        limit = self.section.disk_bytes
        if limit is None or self.folder is None or self._size + grown <= limit:
            return None
        size, allowed = format_bytes(self._size), format_bytes(limit)
        return Reason("disk", f"the run folder has {size} of the {allowed} that it may have")

    def _check_time(self) -> Reason | None:
        if self._until is None or self.clock() < self._until:
            return None
        return Reason("until", f"it is past {self._until:%Y-%m-%d %H:%M}")

    def _folder_size(self) -> int:
        if self.folder is None or self.section.disk_bytes is None:
            return 0
        self._written()
        return size_of(self.folder)


def end_event(
    error: BaseException | None, finished: bool, commanded: bool, by: Reason | None
) -> tuple[str, dict]:
    """Return the event of a search's end and its details: by an ``error``, by the last generation,
    by its recipe, or ``commanded``."""
    if error is not None and not isinstance(error, GeneratorExit):
        reason = f"{type(error).__name__}: {error}"
        if isinstance(error, KeyboardInterrupt):
            reason = str(error) if isinstance(error, Signalled) else "interrupted"
        return "stop", {"reason": reason}
    if finished:
        return "finish", {}
    if by is not None:
        return "stop", {"reason": by.words, "by": by.by}
    return "stop", {"reason": "asked to" if commanded else "left"}


def _reaches(objective: Objective, value: float, target: float) -> bool:
    """Whether a ``value`` is as good as the ``target``, or as near to the measure's own target."""
    if objective.goal == "max":
        return value >= target
    return value <= target if objective.goal == "min" else objective.loss(value) <= target


def size_of(folder: str | os.PathLike) -> int:
    """Return the bytes of all files in ``folder``, without links and files that vanish
    meanwhile."""
    total, further = 0, [Path(folder)]
    while further:
        with contextlib.suppress(OSError), os.scandir(further.pop()) as entries:
            for entry in entries:
                with contextlib.suppress(FileNotFoundError):  # a merge removed it
                    if entry.is_dir(follow_symlinks=False):
                        further.append(Path(entry.path))
                    else:
                        total += entry.stat(follow_symlinks=False).st_size
    return total


class Signalled(KeyboardInterrupt):
    """A signal arrived that ends the program; ``number``: which. The text is the signal's name."""

    def __init__(self, number: int):
        super().__init__(signal.Signals(number).name)
        self.number = number

    @property
    def exit_code(self) -> int:
        """The exit code that a shell expects: 128 and the signal's number, 143 or 129."""
        return 128 + self.number


@contextlib.contextmanager
def signals_raise() -> Iterator[None]:
    """Raise `Signalled` in the main thread at the first SIGTERM or SIGHUP within the block. An
    ignored signal stays ignored, as SIGHUP under `nohup`; in other threads nothing changes."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    numbers = [getattr(signal, name) for name in _SIGNALS if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    before = {number: how for number, how in before.items() if how is signal.SIG_DFL}

    def interrupt(number: int, _) -> None:
        for other in before:  # the second does not cut short what the first began
            signal.signal(other, signal.SIG_IGN)
        raise Signalled(number)

    for number in before:
        signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, how in before.items():
            signal.signal(number, how)
