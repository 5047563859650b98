"""Processes of studio: jobs of the desk, within limits of time and memory; runs that begin, stop
and resume by evocity's own commands, and outlive studio."""

import contextlib
import hashlib
import json
import os
import subprocess
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from evocity.child_process import python_command
from evocity.errors import EvocityError, RunError, format_bytes, plain_text, reason_of
from evocity.evaluation import linux_processes
from evocity.search.preparation.trust import is_trusted, refuse_untrusted, state_folder
from evocity.search.record import commands
from evocity.search.record.complete_run import CompleteRun
from evocity.store.lock import is_held
from evocity.store.run_directory import RunDirectory
from evocity.studio.output_files import write_error
from evocity.studio.request_fields import Body, whole_field

# Seconds between two looks at a job, and that it has to end; bytes of a line of its results.
_BETWEEN, _PATIENCE, _LONGEST = 0.1, 5.0, 1 << 22
#: Bytes of the end of a log that the page receives.
TAIL = 4000


class DeskJob:
    """A job of `evocity.studio.desk_jobs` in a process of its own, within ``memory`` (bytes) and
    ``seconds``. For errors: ``name``, the job in words, and ``expected``, a job within limits."""

    def __init__(
        self,
        memory: int,
        seconds: float | None,
        name: str,
        expected: str = "a map of a single district",
    ):
        self._memory, self._seconds, self._name = memory, seconds, name
        self._expected = expected
        self._error: EvocityError | None = None
        self.stopped = False
        self._process: subprocess.Popen | None = None

    def run(self, job: Mapping, receive: Callable[[dict], None]) -> None:
        """Run the ``job``; ``receive`` gets each line of its results. Raises its `EvocityError`."""
        if self.stopped:
            return
        process = self._process = self._start()
        self._exchange(process, job, receive)
        self._check(process)

    @staticmethod
    def _start() -> subprocess.Popen:
        return subprocess.Popen(
            python_command("from evocity.studio.desk_jobs import main; main()", tied=True),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def _exchange(
        self, process: subprocess.Popen, job: Mapping, receive: Callable[[dict], None]
    ) -> bool:
        """Send the ``job`` and pass its results on; return whether the process waits for another
        job. The process is closed after an error."""
        if self.stopped:  # while the process started
            self._kill(process)
        ended = threading.Event()
        watch = threading.Thread(target=self._watch, args=(process, ended), daemon=True)
        watch.start()
        try:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.write(json.dumps(job).encode() + b"\n")
                process.stdin.flush()
            while line := process.stdout.readline(_LONGEST):
                result = json.loads(line)
                if "waits" in result:
                    return True
                if "error" in result and "map" not in result:
                    raise EvocityError(*result["error"])
                receive(result)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_PATIENCE)
        except ValueError:  # an incomplete line
            self._kill(process)
            process.wait()
        except BaseException:
            self._close(process)
            raise
        finally:
            ended.set()
            watch.join()
        return False

    def _check(self, process: subprocess.Popen) -> None:
        """Close a process that sends no more results. Raise the error of its job, if it has one; a
        process that is slow to end has none."""
        code = process.poll()
        self._close(process)
        if self._error is not None:
            raise self._error
        if code and not self.stopped:
            raise EvocityError(
                f"{self._name}: the process ended ({linux_processes.describe_exit_code(code)})",
                self._expected,
                f"try again, or choose {self._expected}",
            )

    def stop(self) -> None:
        self.stopped = True
        if self._process is not None:
            self._kill(self._process)

    def _watch(self, process: subprocess.Popen, ended: threading.Event) -> None:
        end = None if self._seconds is None else time.monotonic() + self._seconds
        while not ended.is_set() and process.poll() is None:
            if end is not None and time.monotonic() > end:
                self._end(process, f"more than {self._seconds:.0f} seconds")
            elif linux_processes.added_memory(process.pid, 0, self._memory) > self._memory:
                self._end(process, f"more than {format_bytes(self._memory)} of memory")
            ended.wait(_BETWEEN)

    def _close(self, process: subprocess.Popen) -> None:
        """End a process."""
        self._kill(process)
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()
        process.stdout.close()
        process.wait()

    def _end(self, process: subprocess.Popen, what: str) -> None:
        self._error = EvocityError(
            f"a background process of studio ({self._name}) needs {what}",
            self._expected,
            f"choose {self._expected}",
        )
        self._kill(process)

    @staticmethod
    def _kill(process: subprocess.Popen) -> None:
        if process.poll() is None and os.name == "posix":
            linux_processes.kill_group(process.pid)
        with contextlib.suppress(OSError):
            process.kill()


class LastingJob(DeskJob):
    """Jobs one after another in one process, which keeps the files that it reads; it ends after
    some minutes without a job, and the next job then starts another. ``seconds`` are for each of
    the maps of a job. One thread runs all jobs."""

    def __init__(self, memory: int, seconds: float, name: str):
        super().__init__(memory, seconds, name)
        self._seconds_each = seconds

    def run(self, job: Mapping, receive: Callable[[dict], None]) -> None:
        if self.stopped:
            return
        self._error, self._seconds = None, self._seconds_each * len(job["maps"])
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._process = self._start()
        process = self._process
        if not self._exchange(process, {**job, "lasts": True}, receive):
            self._check(process)

    def close(self) -> None:
        """End the process."""
        if self._process is not None:
            self._close(self._process)


class RunProcesses:
    """The runs that processes of this studio carry out, by their folders; they outlive studio."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._of: dict[Path, tuple[subprocess.Popen, Path]] = {}

    def begin(self, run: Path, words: Sequence[str], log: Path) -> None:
        """Run the command `evocity` with ``words`` for a ``run``; its output goes to ``log``."""
        program = (
            "sys.argv[:1] = ['evocity']; from evocity.cli import main; main(prog_name='evocity')"
        )
        with self._lock:
            if self.is_busy(run):
                raise RunError(
                    f"a process is already running for the run {run}",
                    "at most one process per run",
                    "wait until that process ends, or stop that process",
                )
            try:
                log.parent.mkdir(parents=True, exist_ok=True)
                file = RunDirectory(log.parent).append(log.name)
            except OSError as error:
                raise write_error(log, error) from error
            with file:
                try:
                    process = subprocess.Popen(
                        [*python_command(program), *words],
                        stdin=subprocess.DEVNULL,
                        stdout=file,
                        stderr=file,
                        start_new_session=True,
                    )
                except OSError as error:
                    if not file.tell():
                        log.unlink(missing_ok=True)
                    raise RunError(
                        f"studio cannot start a process: {reason_of(error)}",
                        "enough free memory for another process",
                        "close other programs to free memory, then try again",
                    ) from error
            self._of[run] = process, log
        threading.Thread(target=process.wait, daemon=True).start()  # leaves no zombie

    def is_busy(self, run: Path) -> bool:
        """Whether a process of this studio works on a run."""
        return run in self._of and self._of[run][0].poll() is None

    def end(self, run: Path) -> None:
        """End the process of a run that has no folder yet, as Ctrl-C does."""
        if self.is_busy(run):
            self._of[run][0].terminate()

    def state(self, run: Path) -> dict[str, Any] | None:
        """Return whether a process works on a run (``at``), its exit ``code``, and the end of its
        output (``said``); None for a run that this studio did not begin or resume."""
        if run not in self._of:
            return None
        process, log = self._of[run]
        code = process.poll()
        return {"at": code is None, "code": code, "said": _tail(log)}


def _tail(log: Path) -> str:
    """Return the last lines of a log, each as plain text."""
    with contextlib.suppress(OSError), open(log, "rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - TAIL))
        text = file.read(TAIL).decode(errors="replace")
        lines = text.splitlines()[size > TAIL :]
        return "\n".join(map(plain_text, lines))
    return ""


# -- a run that stops and resumes -----------------------------------------------------------------


class ResumeRequest(Body):
    """A request to resume a run; ``generations`` of the whole run, None for those of its recipe."""

    generations: Annotated[int | None, whole_field("to generation", 1, 99_999_999)] = None


def log_of(run: Path) -> Path:
    """Return the log of a ``run``: beside a recipe of the desk, or in the state folder of the
    user."""
    beside = run.with_name(f"{run.name}-recipe")
    has_recipe = not beside.is_symlink() and (beside / "recipe.toml").is_file()
    if has_recipe and (not run.exists() or is_trusted(CompleteRun(run))):
        return beside / "run.log"
    name = hashlib.blake2b(str(run).encode(errors="replace"), digest_size=8).hexdigest()
    return state_folder() / "logs" / f"{name}.log"


def stop_run(run: Path) -> None:
    """End a run after its current generation. Raises `RunError` where no process breeds it."""
    commands.send(run, commands.Stop())


def resume_run(run: Path, processes: RunProcesses, request: ResumeRequest) -> None:
    """Resume a run by `evocity resume`; a run that began elsewhere may execute nothing."""
    opened = CompleteRun(run)
    if is_held(run / "lock"):
        raise RunError(
            f"a process is still running for the run {run}",
            "a run that has ended",
            "stop the run first",
        )
    try:
        refuse_untrusted(opened)
    except RunError as error:
        remedy = f"read these files; then, in a terminal: evocity resume {run} --trust"
        raise RunError(error.found, error.expected, remedy) from None
    count = request.generations
    more = [] if count is None else ["--generations", str(count)]
    processes.begin(run, ["resume", str(run), *more], log_of(run))
