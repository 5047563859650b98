"""Notification: the user's commands, run when a search gets better and when it ends.

They run beside the search, without a shell, one at a time, each in its own session, which ends
with it. How each ended is an event of the run.
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

from evocity.errors import RunError, cut_short, plain_text, reason_of
from evocity.evaluation.linux_processes import kill_session
from evocity.recipe.recipe import Recipe
from evocity.recipe.stop_and_notify import NotifySection, words_of
from evocity.search.record.commands import DONE
from evocity.search.steering.generation import Generation
from evocity.search.steering.observers import Observer, Observers
from evocity.search.steering.stop_rules import progress_of
from evocity.store import RunLog

#: The event of a command that has ended.
NOTIFIED = "notify"

_MOST_OUTPUT = 4096  # bytes of a command's output that are read
_MOST_LOGGED = 1000  # bytes of it in an event
_PATIENCE = 5.0  # seconds that a command has left when the search ends


@dataclass(frozen=True)
class Notification:
    """A command to be run: its ``words``, in a ``folder``."""

    key: str
    generation: int
    words: Sequence[str]
    folder: Path

    @property
    def command_line(self) -> list[str]:
        """The words; a program with a path is looked up from the folder."""
        program, *others = self.words
        path = self.folder / Path(program).expanduser()
        in_folder = os.path.dirname(program) and path.is_file()
        return [str(path) if in_folder else program, *others]


class CommandRunner:
    """Runs one notification at a time beside the search, each for at most ``timeout`` seconds. Only
    the last of those that arrive meanwhile follows."""

    def __init__(self, timeout: float):
        self._timeout = timeout
        self._lock = threading.Lock()
        self._waiting: Notification | None = None
        self._thread: threading.Thread | None = None
        self._process: subprocess.Popen | None = None
        self._given_up = False
        self._results: list[dict] = []

    def start(self, notification: Notification) -> None:
        """Run the ``notification`` now or next."""
        with self._lock:
            self._waiting = notification
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, daemon=True)
                self._thread.start()

    def take_results(self) -> list[dict]:
        """Return the results since the last call, as details of events: each command's exit
        ``code`` and ``output``; without a code, the ``reason``."""
        with self._lock:
            results, self._results = self._results, []
        return results

    def close(self, seconds: float) -> None:
        """Wait at most ``seconds`` for the command that runs, then kill it; no other follows."""
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
                _kill(process)
            thread.join(_PATIENCE)

    def _work(self) -> None:
        while True:
            with self._lock:
                notification, self._waiting = self._waiting, None
                if notification is None:
                    self._thread = None
                    return
            result = self._run(notification)
            with self._lock:
                self._process = None
                self._results.append(result)

    def _run(self, notification: Notification) -> dict:
        began = time.monotonic()
        result = {"generation": notification.generation, "on": notification.key}
        group: dict[str, Any] = {"start_new_session": True}
        if os.name == "nt":
            group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}
        try:
            process = subprocess.Popen(
                notification.command_line,
                cwd=notification.folder if notification.folder.is_dir() else None,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                **group,
            )
        except (OSError, ValueError) as error:
            reason = plain_text(reason_of(error))
            return result | {"code": None, "seconds": 0.0, "output": "", "reason": reason}
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
        _kill(process)
        reader.join(1.0)
        output = plain_text(bytes(printed).decode(errors="replace")).strip()
        result |= {"code": code, "seconds": round(time.monotonic() - began, 3)}
        result |= {"output": cut_short(output, _MOST_LOGGED)}
        return result | ({"reason": reason} if reason else {})


def _kill(process: subprocess.Popen) -> None:
    """Kill a command with its whole session, even if it has ended itself."""
    if os.name == "nt":
        process.kill()
    else:
        kill_session(process.pid)
    with contextlib.suppress(subprocess.TimeoutExpired):
        process.wait(_PATIENCE)


def _read(process: subprocess.Popen, printed: bytearray) -> None:
    """Keep the first of a command's output, and take the rest, so that the command never waits."""
    with contextlib.suppress(OSError, ValueError), process.stdout as stream:
        while chunk := stream.read1(65536):
            printed += chunk[: max(0, _MOST_OUTPUT - len(printed))]


def missing_programs(section: NotifySection, folder: Path) -> list[str]:
    """Describe the commands whose program is not on this machine."""
    notes = []
    for key, command in section.commands.items():
        (program, *_) = Notification(key, 0, words_of(command, {}), folder).command_line
        if "{" not in program and shutil.which(program) is None:
            notes.append(f"notify.{key}: no program {program} is found; it notifies nobody")
    return notes


class Notifier(Observer):
    """Runs the commands of a ``section``, whose paths are relative to ``folder``.

    run : the run's folder; None if it is not kept.
    log : is called with the event of each result.
    best : the progress of a resumed run so far, see `progress_of`.
    state : of a resumed run, as `Run.status` has it.
    written : returns once the folder holds all births.
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
        self._runner = CommandRunner(section.timeout)
        self._placeholders = dict.fromkeys(("generation", "hypervolume", "best"), "")
        self._placeholders |= {"births": "0", "run": "" if run is None else os.path.abspath(run)}
        self._number = -1
        if state is not None and state["generation"] is not None:
            self._set_state(state)

    def generation(self, generation: Generation, births, members) -> None:
        self._log_results(self._runner)
        state = {key: getattr(generation, key) for key in ("births", "hypervolume", "best")}
        self._set_state(state | {"generation": generation.number})
        now, before = progress_of(generation.hypervolume, generation.algorithm), self._best
        if math.isnan(now):  # this generation's progress is unknown
            return
        self._best = now if before is None else max(before, now)
        if before is not None and now > before:
            reason = f"{now:.6g} reached, before {before:.6g}"
            self._notify("on_improvement", event="improvement", reason=reason)

    def event(self, event: str, details: dict) -> None:
        if event == DONE and details.get("command") == "reweight":
            self._best = None  # earlier progress is not comparable
        if event not in ("stop", "finish"):
            return
        self._runner.close(_PATIENCE)
        last, self._runner = self._runner, CommandRunner(self._timeout)
        reason = details.get("reason", "all generations are done")
        self._notify("on_end", event=event, reason=" ".join(plain_text(str(reason)).split()))
        self._runner.close(self._timeout + _PATIENCE)
        with contextlib.suppress(RunError):  # the folder itself may be what failed
            self._log_results(last)
            self._log_results(self._runner)

    def _set_state(self, state: Mapping[str, Any]) -> None:
        volume, best = state["hypervolume"], state["best"].items()
        self._number = state["generation"]
        self._placeholders |= {
            "generation": str(state["generation"]),
            "births": str(state["births"]),
            "hypervolume": "" if volume is None or math.isnan(volume) else f"{volume:.6g}",
            "best": ", ".join(f"{name} {value:.4g}" for name, value in best),
        }

    def _notify(self, key: str, **placeholders: str) -> None:
        if key in self._commands:
            words = words_of(self._commands[key], self._placeholders | placeholders)
            self._written()
            self._runner.start(Notification(key, self._number, words, self._folder))

    def _log_results(self, runner: CommandRunner) -> None:
        for result in runner.take_results():
            self._log(NOTIFIED, **result)


def add_notifier(
    recipe: Recipe, run: str | os.PathLike | None, observers: Observers, best: float | None = None
) -> list[str]:
    """Add a `Notifier` for the commands of a ``recipe``, if it has any, to the ``observers`` of a
    search. Return its `missing_programs`."""
    section, folder = recipe.notify, recipe.folder
    if section.commands:
        state = RunLog(run).status() if run is not None and os.path.isdir(run) else None
        observers.add(Notifier(section, folder, run, observers.event, best, state, observers.wait))
    return missing_programs(section, folder)
