"""Telling the user: commands of ``[notify]``, when a search gets better and when it ends.

They run beside the search, without a shell, one at a time, each in a process group of its own that
ends with it. Whatever becomes of them is an event of the run.
"""

import contextlib
import math
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evocity.errors import RunError, cut_short, plain_text
from evocity.search.commands import DONE
from evocity.search.evaluation.processes import kill_group
from evocity.search.generation import Generation
from evocity.search.observers import Observer, Observers
from evocity.search.overnight import NotifySection, words_of
from evocity.search.recipe import Recipe
from evocity.search.stopping import progress_of
from evocity.store import open_run

#: The event of a command that has ended.
NOTIFIED = "notify"

_MOST_OUTPUT = 4096  # bytes that are kept of what a command prints
_MOST_TOLD = 1000  # bytes of it in an event
_PATIENCE = 5.0  # seconds that a command has left when the search ends


@dataclass(frozen=True)
class Ended:
    """How a command ended: ``key`` of ``[notify]``, its exit ``code``, None where it never began or
    was ended, with the ``reason``; ``seconds``, and the first of what it printed."""

    key: str
    generation: int
    code: int | None
    seconds: float
    output: str = ""
    reason: str = ""

    @property
    def details(self) -> dict:
        """What the event tells."""
        about = {"generation": self.generation, "on": self.key, "code": self.code}
        about |= {"seconds": round(self.seconds, 3), "output": self.output}
        return about | ({"reason": self.reason} if self.reason else {})


@dataclass(frozen=True)
class Errand:
    """A command to be carried out: its ``words``, in a ``folder``."""

    key: str
    generation: int
    words: Sequence[str]
    folder: Path


class Runner:
    """Carries out one errand at a time beside the search, each in at most ``timeout`` seconds. Of
    those that come meanwhile, the last one alone follows."""

    def __init__(self, timeout: float):
        self._timeout = timeout
        self._lock = threading.Lock()
        self._waiting: Errand | None = None
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen | None = None
        self._given_up = False
        self._ended: list[Ended] = []

    def ask(self, errand: Errand) -> None:
        """Carry out the ``errand``, now or next."""
        with self._lock:
            self._waiting = errand
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, daemon=True)
                self._thread.start()

    def ended(self) -> list[Ended]:
        """Those that ended since this was last asked."""
        with self._lock:
            ended, self._ended = self._ended, []
        return ended

    def close(self, seconds: float) -> None:
        """Wait so long for the errand that is carried out, or else ended; none follows it."""
        with self._lock:
            thread = self._thread
            if self._process is not None:
                self._waiting = None
        if thread is None:
            return
        try:
            thread.join(seconds)
        finally:
            with self._lock:
                self._given_up, self._waiting, process = True, None, self._process
            if process is not None:
                _end(process)
            thread.join(_PATIENCE)

    def _work(self) -> None:
        while True:
            with self._lock:
                errand, self._waiting = self._waiting, None
                if errand is None:
                    self._thread = None
                    return
            found = self._carried_out(errand)
            with self._lock:
                self._process = None
                self._ended.append(found)

    def _carried_out(self, errand: Errand) -> Ended:
        begun = time.monotonic()
        group = (
            {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
            if os.name == "nt"
            else {"start_new_session": True}
        )
        try:
            process = subprocess.Popen(
                _found(errand),
                cwd=errand.folder if errand.folder.is_dir() else None,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                **group,
            )
        except (OSError, ValueError) as error:
            reason = plain_text(getattr(error, "strerror", None) or str(error))
            return Ended(errand.key, errand.generation, None, 0.0, reason=reason)
        with self._lock:
            self._process = process
        printed = bytearray()
        reader = threading.Thread(target=_read, args=(process, printed), daemon=True)
        reader.start()
        code, reason = None, ""
        try:
            code = process.wait(self._timeout)
            if self._given_up:
                code, reason = None, "the search had ended"
        except subprocess.TimeoutExpired:
            reason = f"it took more than {self._timeout:g} s"
        _end(process)
        reader.join(1.0)
        seconds = time.monotonic() - begun
        output = cut_short(plain_text(bytes(printed).decode(errors="replace")).strip(), _MOST_TOLD)
        return Ended(errand.key, errand.generation, code, seconds, output, reason)


def _end(process: subprocess.Popen) -> None:
    """End a command with all of its group, what it left behind too."""
    if os.name == "nt":
        process.kill()
    else:
        kill_group(process.pid)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(_PATIENCE)


def _read(process: subprocess.Popen, printed: bytearray) -> None:
    """Keep the first of what a command prints, and take the rest, so that it never waits."""
    with contextlib.suppress(OSError, ValueError), process.stdout as stream:
        while chunk := stream.read1(65536):
            printed += chunk[: max(0, _MOST_OUTPUT - len(printed))]


def _found(errand: Errand) -> list[str]:
    """The words of an ``errand``; a program that is named by a path is looked for from its
    folder."""
    program, *others = errand.words
    path = errand.folder / Path(program).expanduser()
    named = os.path.dirname(program) and path.is_file()
    return [str(path) if named else program, *others]


def missing(section: NotifySection, folder: Path) -> list[str]:
    """In words, which commands name a program that is not here."""
    notes = []
    for key, command in section.commands.items():
        (program, *_) = _found(Errand(key, 0, words_of(command, {}), folder))
        if "{" not in program and shutil.which(program) is None:
            notes.append(f"notify.{key}: no program {program} is found; nobody will be told by it")
    return notes


class Notifier(Observer):
    """Tells of a search by the commands of a ``section``, whose paths are relative to ``folder``.

    ``run``: where the run is kept, None if it is not; ``log`` is told how each command ended, as
    an event; ``best``: what a run that is taken up has reached, see `progress_of`, and ``state``:
    where it is, as `Run.status` has it; ``written`` returns once the folder holds what is told of.
    """

    def __init__(
        self,
        section: NotifySection,
        folder: Path,
        run: str | os.PathLike | None,
        log: Callable[..., None],
        best: float | None = None,
        state: Mapping[str, Any] | None = None,
        written: Callable[[], None] = lambda: None,
    ):
        self._commands, self._timeout = section.commands, section.timeout
        self._folder, self._log, self._best = folder, log, best
        self._written = written
        self._runner = Runner(section.timeout)
        self._told = {
            "run": "" if run is None else os.path.abspath(run),
            "generation": "",
            "births": "0",
            "hypervolume": "",
            "best": "",
        }
        self._number = -1
        if state is not None and state["generation"] is not None:
            self._is_at(state)

    def generation(self, generation: Generation, births, members) -> None:
        self._note(self._runner)
        told = {key: getattr(generation, key) for key in ("births", "hypervolume", "best")}
        self._is_at(told | {"generation": generation.number})
        now, before = progress_of(generation.hypervolume, generation.algorithm), self._best
        if math.isnan(now):  # nothing is known of this generation
            return
        self._best = now if before is None else max(before, now)
        if before is not None and now > before:
            reason = f"{now:.6g} reached, before {before:.6g}"
            self._ask("on_improvement", event="improvement", reason=reason)

    def event(self, event: str, details: dict) -> None:
        if event == DONE and details.get("command") == "reweight":
            self._best = None  # what was before cannot be compared
        if event not in ("stop", "finish"):
            return
        self._runner.close(_PATIENCE)
        last, self._runner = self._runner, Runner(self._timeout)
        reason = details.get("reason", "all generations are done")
        self._ask("on_end", event=event, reason=" ".join(plain_text(str(reason)).split()))
        self._runner.close(self._timeout + _PATIENCE)
        with contextlib.suppress(RunError):  # the folder itself may be what failed
            self._note(last)
            self._note(self._runner)

    def _is_at(self, state: Mapping[str, Any]) -> None:
        volume, best = state["hypervolume"], state["best"].items()
        self._number = state["generation"]
        self._told |= {
            "generation": str(state["generation"]),
            "births": str(state["births"]),
            "hypervolume": "" if volume is None or math.isnan(volume) else f"{volume:.6g}",
            "best": ", ".join(f"{name} {value:.4g}" for name, value in best),
        }

    def _ask(self, key: str, **told: str) -> None:
        if key in self._commands:
            words = words_of(self._commands[key], self._told | told)
            self._written()
            self._runner.ask(Errand(key, self._number, words, self._folder))

    def _note(self, runner: Runner) -> None:
        for one in runner.ended():
            self._log(NOTIFIED, **one.details)


def told_to(
    recipe: Recipe, run: str | os.PathLike | None, observers: Observers, best: float | None = None
) -> list[str]:
    """Have the commands of a ``recipe``, if it has any, tell of a search from now on, as one of its
    ``observers``. Returns what is `missing` for that."""
    section, folder = recipe.notify, recipe.folder
    if section.commands:
        state = open_run(run).status() if run is not None and os.path.isdir(run) else None
        observers.add(Notifier(section, folder, run, observers.event, best, state, observers.wait))
    return missing(section, folder)


__all__ = ["NOTIFIED", "Ended", "Errand", "Notifier", "Runner", "missing", "told_to"]
