"""What ends a search before its last generation: ``[stop]`` of its recipe, looked at after each.

It changes no birth: a run that goes on later has those of one that was never stopped.
"""

import contextlib
import math
import os
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path

from evocity.errors import RecipeError, told_bytes
from evocity.fitness import Aims, Objective
from evocity.search.commands import REVISED
from evocity.search.generation import Generation
from evocity.search.individual import Individual
from evocity.search.overnight import StopSection, moment_of
from evocity.search.signals import Signalled
from evocity.store import Run

#: Tells the time, with its zone.
Clock = Callable[[], datetime]

#: What holds still when a run is taken up, unless more generations are asked for.
_LASTING = ("target", "stagnation")


def now() -> datetime:
    """The time of this machine, with its zone."""
    return datetime.now().astimezone()


@dataclass(frozen=True)
class Reason:
    """Why a search stops: ``by`` which key of ``[stop]``, and in ``words``."""

    by: str
    words: str

    @property
    def still(self) -> str:
        """What is told where it holds still when a run is taken up."""
        return f"{self.words} still; to go on, ask for {self.remedy}"

    @property
    def remedy(self) -> str:
        """What to change, if it shall go on."""
        if self.by == "disk":
            return "another [stop] disk (--recipe)"
        if self.by == "until":
            return "another time (--until, or --recipe), or --until none"
        return "more generations (--generations), or another [stop] (--recipe)"


def refuse_passed(section: StopSection, clock: Clock) -> None:
    """Raise `RecipeError` for an ``until`` that has passed before the search begins."""
    until = None if section.until is None else moment_of(section.until, clock())
    if until is not None and until <= clock():
        raise RecipeError(
            f"stop.until: {section.until!r} has passed",
            "a moment to come, or a time of the day, which is the next such",
            "write a later one, or leave it out",
        )


def progress_of(hypervolume: float | None, figures: Mapping[str, float]) -> float:
    """What stagnation is told by: the QD-score of algorithms that tell one, else the hypervolume,
    which of one goal, or one sum, grows when that gets better."""
    found = figures.get("qd_score", hypervolume)
    return math.inf if found is None else found  # a log has no infinity; NaN tells nothing


@dataclass
class Stagnation:
    """How long nothing got better: ``best`` so far, and the generation it is of. Generations in
    which nobody keeps the constraints do not count, nor those whose progress is NaN, nor do those
    before ``since``."""

    best: float = 0.0
    at: int | None = None
    since: int = 0
    _no_better: list[int] = field(default_factory=list)  # generations after the best, in order

    def see(self, generation: int, progress: float) -> None:
        if progress > self.best:
            self.best, self.at, self._no_better = progress, generation, []
        elif self.at is not None and not math.isnan(progress):
            self._no_better.append(generation)

    @property
    def without(self) -> int:
        """Generations without progress, of those that were seen."""
        return len(self._no_better) - bisect_right(self._no_better, self.since)


class Stopping:
    """Looks after each generation whether a search shall stop; ``reason``: why, None while it goes
    on.

    Parameters
    ----------
    section : ``[stop]`` of the recipe.
    aims : what is wanted of the measures in its ``target``.
    folder : where the run is kept, None if it is not.
    clock : tells the time.
    written : returns once the folder holds what was bred.

    ``held`` are the keys that no longer count, as more generations were asked for in spite of them.
    """

    def __init__(
        self,
        section: StopSection,
        aims: Aims,
        folder: str | os.PathLike | None = None,
        clock: Clock = now,
        written: Callable[[], None] = lambda: None,
    ):
        self.section, self.folder, self.clock = section, folder, clock
        self._written = written
        self.reason: Reason | None = None
        self.held: tuple[str, ...] = ()
        self._wanted = {one.measure.name: one.objective for one in aims.wanted}
        self._until = None if section.until is None else moment_of(section.until, clock())
        self._stagnation, self._size = Stagnation(), self._measured()

    def look(self, generation: Generation) -> None:
        """After a ``generation``."""
        progress = progress_of(generation.hypervolume, generation.algorithm)
        self._stagnation.see(generation.number, progress)
        before, self._size = self._size, self._measured()
        grown = max(0, self._size - before)
        self.reason = self._why(generation.number, generation.population, grown)

    @property
    def best(self) -> float | None:
        """The most progress so far, None before there is any."""
        return None if self._stagnation.at is None else self._stagnation.best

    def judge_anew(self) -> None:
        """Goals are weighed otherwise from now on: what was before cannot be compared."""
        self._stagnation = Stagnation(since=self._stagnation.since)

    def take_up(self, run: Run, living: Sequence[Individual], insisted: bool) -> dict:
        """Go on where the ``run`` was left. ``insisted``: more generations were asked for, in spite
        of a target that is reached, and of a stagnation, which counts from here then. Returns what
        the event of it must tell."""
        if not run.generations:
            return {}
        judged = 0
        for event in run.events():
            since = event.get("generation")
            if not isinstance(since, int):
                continue
            if event.get("command") == "reweight" or event.get("event") == REVISED:
                judged = since
            if event.get("event") == REVISED:
                self.held, self._stagnation.since = (), 0
            for key in event.get("held", ()) if event.get("event") == "resume" else ():
                self._hold(str(key), since - 1)
        for one in run.history():
            if one["generation"] >= judged:
                told = one.get("hypervolume", math.nan), one.get("algorithm", {})
                self._stagnation.see(one["generation"], progress_of(*told))
        last = run.generations[-1]
        self.reason = self._why(last, living, 0)
        while insisted and self.reason is not None and self.reason.by in _LASTING:
            self._hold(self.reason.by, last)
            self.reason = self._why(last, living, 0)
        return {"held": list(self.held)} if self.held else {}

    def _hold(self, key: str, generation: int) -> None:
        self.held = tuple(dict.fromkeys((*self.held, key)))
        if key == "stagnation":
            self._stagnation.since = generation

    def _why(self, generation: int, living: Sequence[Individual], grown: int) -> Reason | None:
        """``grown``: bytes of the last generation; another such must fit."""
        return self._reached(living) or self._stagnated() or self._filled(grown) or self._passed()

    def _reached(self, living: Sequence[Individual]) -> Reason | None:
        wanted = self.section.target
        if not wanted or "target" in self.held:
            return None
        reached = [
            one.id
            for one in living
            if not one.violation
            and all(_reaches(self._wanted[n], one.values[n], wanted[n]) for n in wanted)
        ]
        return Reason("target", f"target reached by {min(reached)}") if reached else None

    def _stagnated(self) -> Reason | None:
        count = self._stagnation.without
        if self.section.stagnation is None or count < self.section.stagnation:
            return None
        best = f"the best is of generation {self._stagnation.at}"
        return Reason("stagnation", f"{count} generations without progress, {best}")

    def _filled(self, grown: int) -> Reason | None:
        limit = self.section.disk_bytes
        if limit is None or self.folder is None or self._size + grown <= limit:
            return None
        size, allowed = told_bytes(self._size), told_bytes(limit)
        return Reason("disk", f"the run folder has {size} of the {allowed} that it may have")

    def _passed(self) -> Reason | None:
        if self._until is None or self.clock() < self._until:
            return None
        return Reason("until", f"it is past {self._until:%Y-%m-%d %H:%M}")

    def _measured(self) -> int:
        limited = self.folder is not None and self.section.disk_bytes is not None
        if not limited:
            return 0
        self._written()
        return size_of(self.folder)


def end_of(
    error: BaseException | None, finished: bool, asked: bool, by: Reason | None
) -> tuple[str, dict]:
    """The event of a search's end and its details: by an ``error``, or none; ``asked`` to by a
    command, or ``by`` its recipe."""
    if error is not None and not isinstance(error, GeneratorExit):
        told = f"{type(error).__name__}: {error}"
        if isinstance(error, KeyboardInterrupt):
            told = str(error) if isinstance(error, Signalled) else "interrupted"
        return "stop", {"reason": told}
    if finished:
        return "finish", {}
    if by is not None:
        return "stop", {"reason": by.words, "by": by.by}
    return "stop", {"reason": "asked to" if asked else "left"}


def _reaches(objective: Objective, value: float, wanted: float) -> bool:
    """Of a goal max or min as much, or as little, as ``wanted``; of a target as near."""
    if objective.goal == "max":
        return value >= wanted
    return value <= wanted if objective.goal == "min" else objective.loss(value) <= wanted


def size_of(folder: str | os.PathLike) -> int:
    """Bytes of all files in a ``folder``; links are not followed, what vanishes does not count."""
    total, further = 0, [Path(folder)]
    while further:
        with contextlib.suppress(OSError), os.scandir(further.pop()) as entries:
            for entry in entries:
                with contextlib.suppress(FileNotFoundError):  # merged in this moment
                    if entry.is_dir(follow_symlinks=False):
                        further.append(Path(entry.path))
                    else:
                        total += entry.stat(follow_symlinks=False).st_size
    return total


__all__ = [
    "Clock",
    "Reason",
    "Stopping",
    "end_of",
    "now",
    "progress_of",
    "refuse_passed",
    "size_of",
]
