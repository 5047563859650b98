"""How workers are started and ended: by a nursery on Linux, by the main process elsewhere.

Both have the same methods. `start` gives a worker its end of its connection and of the pipe it
prints into; `news` tells what became of the workers, by their tokens. They raise
`Broken` when no worker can be started or ended any more.
"""

import contextlib
import json
import multiprocessing
import os
import select
import shutil
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from multiprocessing import resource_tracker, spawn, util
from typing import Any

from evocity.search.evaluation import processes
from evocity.search.evaluation.frames import framed
from evocity.search.evaluation.nursery import LONGEST
from evocity.search.evaluator import Setup
from evocity.search.warm import VARIABLE, sides_told

#: Workers are single-threaded: their number, not BLAS, decides how many cores work.
ONE_THREAD = dict.fromkeys(
    (
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "BLIS_NUM_THREADS",
        "VECLIB_MAXIMUM_THREADS",
        "NUMEXPR_NUM_THREADS",
    ),
    "1",
)
#: Seconds that the nursery may take to end a pool's workers.
_CLOSING = 10.0


class Broken(Exception):
    """What starts and ends workers is gone, or does not answer."""


@dataclass(frozen=True)
class News:
    """Of the worker ``token``: it ``started`` as process ``pid``, or ``ended`` with exit ``code``,
    None if it could not be started."""

    token: int
    what: str
    pid: int = 0
    code: int | None = None


class Nursed:
    """Workers of the nursery, which is started if there is none."""

    #: Whether workers have the main process's environment and folder without being told.
    inherits = False

    def __init__(self, setup: Setup):
        self._nursery = _nursery_of(setup)
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            with _broken_if(OSError):
                socket.send_fds(self._nursery.socket, [b"pool"], [theirs.fileno()])
        finally:
            theirs.close()
        self.answered = False

    @property
    def handle(self) -> socket.socket | None:
        """What becomes readable when there are news."""
        return self._socket

    def start(self, token: int, connection: socket.socket, printed: int) -> None:
        with _broken_if(OSError):
            told = json.dumps({"start": token}).encode()
            socket.send_fds(self._socket, [told], [connection.fileno(), printed])

    def end(self, token: int) -> None:
        """Kill a worker, with all processes that it began; `news` tells when it is done."""
        with _broken_if(OSError):
            self._socket.send(json.dumps({"end": token}).encode(), socket.MSG_DONTWAIT)

    def news(self) -> list[News]:
        found = []
        while True:
            try:
                told = self._socket.recv(LONGEST, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return found
            except OSError as error:
                raise Broken(f"{type(error).__name__}: {error}") from None
            if not told:
                raise Broken("the process that starts the workers ended")
            message = json.loads(told)
            self.answered = True
            if "hello" in message:
                self._nursery.folder = message["folder"]
            elif "started" in message:
                found.append(News(message["started"], "started", message["pid"]))
            elif "ended" in message:
                found.append(News(message["ended"], "ended", code=message["code"]))
            elif "failed" in message:
                found.append(News(message["failed"], "ended"))

    def close(self) -> None:
        """End all workers; returns when they are gone."""
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
            end = time.monotonic() + _CLOSING
            while (left := end - time.monotonic()) > 0:
                if select.select([self._socket], [], [], left)[0] and not self._socket.recv(
                    LONGEST
                ):
                    break
            else:
                self._nursery.kill()
        self._socket.close()

    def abandon(self, pids: list[int]) -> None:
        """Give the nursery up, with all that is left of its workers ``pids``."""
        self._nursery.kill()
        for pid in pids:
            processes.kill_group(pid)
        self._socket.close()


class _Nursery:
    """The nursery as the main process sees it."""

    def __init__(self, setup: Setup):
        self.owner = os.getpid()
        spawn.get_preparation_data("worker")  # refuses in a script without `if __name__ == …`
        resource_tracker.ensure_running()
        tracker = resource_tracker.getfd()
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        program = (
            f"import sys; sys.path[:] = {sys.path!r}; "
            "from evocity.search.evaluation.nursery import main; "
            f"main({theirs.fileno()}, {self.owner}, {tracker})"
        )
        command = [spawn.get_executable(), *util._args_from_interpreter_flags(), "-c", program]
        parts = ",".join([sides_told(setup.sides), *setup.parts])
        with deaf_to_ctrl_c(), environment(ONE_THREAD | {VARIABLE: parts}):
            files = [theirs.fileno(), tracker]
            self.pid = util.spawnv_passfds(command[0], command, files)
        theirs.close()
        self.alive = True
        self.folder: str | None = None  # of what its workers leave, once it told

    def running(self) -> bool:
        if self.alive and self.owner == os.getpid():
            try:
                self.alive = os.waitpid(self.pid, os.WNOHANG)[0] == 0
            except ChildProcessError:  # somebody else waited for it
                self.alive = False
            if not self.alive:
                self._gone()
        return self.alive and self.owner == os.getpid()

    def _gone(self) -> None:
        self.alive = False
        self.socket.close()
        if self.folder is not None:  # it did not live to do so
            shutil.rmtree(self.folder, ignore_errors=True)

    def end(self) -> None:
        """When the main process ends: the nursery sees it, and ends its workers."""
        if not self.running():
            return
        self.socket.close()
        end = time.monotonic() + _CLOSING
        while self.running():
            if time.monotonic() > end:
                self.kill()
            time.sleep(0.005)

    def kill(self) -> None:
        """With all its descendants; those that it has no more are ended with their workers."""
        if not self.running():
            return
        for pid in (self.pid, *processes.descendants(self.pid)):
            processes.kill(pid)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, 0)
        self._gone()


_the_nursery: _Nursery | None = None
_starting = threading.Lock()


def _nursery_of(setup: Setup) -> _Nursery:
    """The one of this process; ``setup`` tells which kernels it loads if it is started."""
    global _the_nursery
    with _starting:
        if _the_nursery is None or not _the_nursery.running():
            _the_nursery = _Nursery(setup)
            # before multiprocessing, and what else, waits for children
            util.Finalize(_the_nursery, _the_nursery.end, exitpriority=100)
        return _the_nursery


class Spawned:
    """Workers that the main process starts, by multiprocessing's way of this system."""

    inherits = True
    handle = None
    answered = True

    def __init__(self, setup: Setup):
        self._context = multiprocessing.get_context("spawn")
        self._processes: dict[int, Any] = {}
        self._told: list[News] = []
        self._environment = contextlib.ExitStack()
        self._environment.enter_context(environment(ONE_THREAD))
        # before multiprocessing waits for children
        self._finalizer = util.Finalize(self, self._kill_all, exitpriority=100)

    def start(self, token: int, connection: socket.socket, printed: int | None) -> None:
        from evocity.search import worker

        process = self._context.Process(target=worker.begin_spawned, args=(connection,))
        try:
            with deaf_to_ctrl_c():
                process.start()
        except (OSError, EOFError) as error:
            raise Broken(f"{type(error).__name__}: {error}") from None
        self._processes[token] = process
        self._told.append(News(token, "started", process.pid))

    def end(self, token: int) -> None:
        if token in self._processes:
            self._kill(self._processes[token])

    def news(self) -> list[News]:
        found, self._told = self._told, []
        for token, process in list(self._processes.items()):
            code = process.exitcode
            if code is not None:
                self._kill(process)  # what it left
                del self._processes[token]
                found.append(News(token, "ended", code=code))
        return found

    def close(self) -> None:
        self._kill_all()
        self._environment.close()

    def abandon(self, pids: list[int]) -> None:
        self.close()

    def _kill_all(self) -> None:
        for process in self._processes.values():
            self._kill(process)
        for process in self._processes.values():
            process.join()
        self._processes.clear()

    def _kill(self, process) -> None:
        if os.name == "posix":
            processes.kill_group(process.pid)
        process.kill()


def first_words(inherits: bool, setup: Any, memory: int | None, main: bool) -> bytes:
    """What a worker is told first: what makes it like this process, unless it ``inherits`` that,
    then its ``setup`` and its ``memory``."""
    told = (None, None) if inherits else (_preparation(main), dict(os.environ) | ONE_THREAD)
    return framed(told) + framed((setup, memory))


def _preparation(main: bool) -> dict:
    """What makes another process like this one: its path, its arguments, and its ``main`` module
    if wanted."""
    found = spawn.get_preparation_data("worker")
    if not main:
        found = {key: value for key, value in found.items() if not key.startswith("init_main")}
    return found | {"authkey": bytes(found["authkey"])}  # the connection is this process's own


@contextlib.contextmanager
def _broken_if(kind: type[Exception]) -> Iterator[None]:
    try:
        yield
    except kind as error:
        raise Broken(f"{type(error).__name__}: {error}") from None


@contextlib.contextmanager
def deaf_to_ctrl_c() -> Iterator[None]:
    """What is started within never gets the terminal's SIGINT: the main process stops it.

    It would else tell, from the first moment on, where in its imports it was. On Windows there is
    nothing to inherit.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # it would let the signal in again when it starts
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def environment(wanted: Mapping[str, str]) -> Iterator[None]:
    """Environment that processes start in."""
    before = {name: os.environ.get(name) for name in wanted}
    os.environ.update(wanted)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
