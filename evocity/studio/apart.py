"""Processes beside the server: errands that it waits for, under bounds; runs that outlive it."""

import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from evocity.errors import EvocityError, RunError, plain_text, told_bytes
from evocity.search.evaluation import processes
from evocity.store.parts import open_to_append

#: Seconds between two looks at what an errand takes, and that it has to end; bytes of a line that
#: it tells.
_BETWEEN, _PATIENCE, _LONGEST = 0.1, 5.0, 1 << 22
#: Bytes of what a run said that are told, its last ones.
TAIL = 4000


class Errand:
    """One errand of `evocity.studio.errands` in a process of its own, which may take so many bytes
    of ``memory`` and so many ``seconds``, None for any. ``done`` is in words what fails then."""

    def __init__(self, memory: int, seconds: float | None, done: str):
        self._memory, self._seconds, self._done = memory, seconds, done
        self._ended: EvocityError | None = None
        self.stopped = False
        self._process: subprocess.Popen | None = None

    def run(self, errand: Mapping, told: Callable[[dict], None]) -> None:
        """Returns once it has ended; ``told`` is given each line that it tells. Raises
        `EvocityError` where that says so, the process takes more than it may, or dies."""
        if self.stopped:
            return
        with subprocess.Popen(
            _command("from evocity.studio.errands import main; main()"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as process:
            self._process = process
            if self.stopped:  # meanwhile
                self._kill(process)
            watch = threading.Thread(target=self._watch, args=(process,), daemon=True)
            watch.start()
            try:
                with contextlib.suppress(BrokenPipeError):
                    process.stdin.write(json.dumps(errand).encode() + b"\n")
                    process.stdin.flush()
                while line := process.stdout.readline(_LONGEST):
                    said = json.loads(line)
                    if "error" in said and "map" not in said:
                        raise EvocityError(*said["error"])
                    told(said)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    process.wait(_PATIENCE)
            except ValueError:  # it was cut off
                pass
            finally:
                self._kill(process)
                code = process.wait()
                watch.join()
                with contextlib.suppress(BrokenPipeError):
                    process.stdin.close()
        if self._ended is not None:
            raise self._ended
        if code and not self.stopped:
            raise EvocityError(
                f"{self._done}: the process that does it ended ({processes.code_told(code)})",
                "a map that it can read",
                "try again, or choose another",
            )

    def stop(self) -> None:
        """End it now."""
        self.stopped = True
        if self._process is not None:
            self._kill(self._process)

    def _watch(self, process: subprocess.Popen) -> None:
        """End what takes more than it may."""
        end = None if self._seconds is None else time.monotonic() + self._seconds
        while process.poll() is None:
            if end is not None and time.monotonic() > end:
                self._end(process, f"more than {self._seconds:.0f} seconds")
            elif processes.taken(process.pid, 0, self._memory) > self._memory:
                self._end(process, f"more than {told_bytes(self._memory)} of memory")
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_BETWEEN)

    def _end(self, process: subprocess.Popen, what: str) -> None:
        self._ended = EvocityError(
            f"{self._done} takes {what}", "a map of a district", "cut a part out of it"
        )
        self._kill(process)

    @staticmethod
    def _kill(process: subprocess.Popen) -> None:
        if process.poll() is None and os.name == "posix":
            processes.kill_group(process.pid)
        with contextlib.suppress(OSError):
            process.kill()


class Carried:
    """Runs that processes of this studio carry out, by their folders. They go on when it ends."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: dict[Path, tuple[subprocess.Popen, Path]] = {}

    def begin(self, run: Path, words: Sequence[str], log: Path) -> None:
        """Have `evocity` do what ``words`` say, at the ``run``; what it says goes to the file
        ``log``. Raises `RunError` while another does, where the log cannot be written, and where
        no process can be started."""
        program = (
            "sys.argv[:1] = ['evocity']; from evocity.cli import main; main(prog_name='evocity')"
        )
        with self._lock:
            if self.is_at(run):
                raise RunError(f"{run}: a process is at it", "one a run", "wait for it, or stop it")
            try:
                log.parent.mkdir(parents=True, exist_ok=True)
                file = open_to_append(log)
            except OSError as error:
                raise RunError(
                    f"{log} cannot be written: {error.strerror or error}",
                    "a folder that this user may write to, with room left",
                    "check its owner, and the space left",
                ) from error
            with file:
                try:
                    process = subprocess.Popen(
                        [*_command(program), *words],
                        stdin=subprocess.DEVNULL,
                        stdout=file,
                        stderr=file,
                        start_new_session=True,
                    )
                except OSError as error:
                    if not file.tell():
                        log.unlink(missing_ok=True)
                    raise RunError(
                        f"no process can be started: {error.strerror or error}",
                        "room for one more",
                        "end others, or free memory, then try again",
                    ) from error
            self._of[run] = process, log
        threading.Thread(target=process.wait, daemon=True).start()  # it leaves nothing behind

    def is_at(self, run: Path) -> bool:
        """Whether a process of this studio is at a run."""
        return run in self._of and self._of[run][0].poll() is None

    def end(self, run: Path) -> None:
        """As Ctrl-C does, a run that has no folder yet."""
        if self.is_at(run):
            self._of[run][0].terminate()

    def told(self, run: Path) -> dict[str, Any] | None:
        """Whether a process is ``at`` a run, its exit ``code``, None while it is, and what it
        ``said`` last; None for a run that this studio did not begin or resume."""
        if run not in self._of:
            return None
        process, log = self._of[run]
        code = process.poll()
        return {"at": code is None, "code": code, "said": _tail(log)}


def _command(program: str) -> list[str]:
    """What starts this Python with a ``program``, which finds what this process would."""
    path = [one for one in sys.path if one]
    return [sys.executable, "-c", f"import sys; sys.path[:] = {path!r}; {program}"]


def _tail(log: Path) -> str:
    """The last lines of a log, each as plain text."""
    with contextlib.suppress(OSError), open(log, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - TAIL))
        text = file.read(TAIL).decode(errors="replace")
        lines = text.splitlines()[size > TAIL :]
        return "\n".join(map(plain_text, lines))
    return ""


__all__ = ["Carried", "Errand"]
