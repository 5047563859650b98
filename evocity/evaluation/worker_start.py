"""Starters of workers: `NurseryStarter` on Linux, `SpawnStarter` elsewhere.

Both have the same methods. `start` gives a worker its ends of the connection and of the pipe for
its output; `news` returns what happened to the workers, by their tokens. They raise
`StarterFailure` when they cannot start or end workers any more.
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
from queue import SimpleQueue
from typing import Any

from evocity.child_process import tie_to_parent
from evocity.errors import describe_error
from evocity.evaluation import linux_processes
from evocity.evaluation.evaluator import Setup
from evocity.evaluation.fork_server import LONGEST
from evocity.evaluation.frames import write_frame
from evocity.evaluation.kernel_warmup import VARIABLE, write_sides

#: Workers have one thread each: their number, not BLAS, decides how many cores work.
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
#: The most seconds for the nursery to end a pool's workers; to end itself while it warms up.
_CLOSING, _COLD = 10.0, 0.5


class StarterFailure(Exception):
    """The process that starts and ends workers is gone, or does not answer."""


@dataclass(frozen=True)
class News:
    """News of the worker ``token``: it "started" as process ``pid``, or "ended" with exit ``code``,
    None if it could not be started."""

    token: int
    event: str
    pid: int = 0
    code: int | None = None


class NurseryStarter:
    """Starts workers in the nursery, and starts the nursery if there is none."""

    #: Whether workers inherit the main process's environment and folder.
    inherits = False

    def __init__(self, setup: Setup):
        self._nursery = _nursery_for(setup)
        self._socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        try:
            with _starter_failure(OSError):
                socket.send_fds(self._nursery.socket, [b"pool"], [theirs.fileno()])
        finally:
            theirs.close()
        self._nursery.pools += 1
        self.answered = False

    @property
    def handle(self) -> socket.socket | None:
        """The connection that becomes readable when there is news."""
        return self._socket

    def start(self, token: int, connection: socket.socket, output: int) -> None:
        """Start the worker ``token``, with its ends of the connection and of the pipe."""
        with _starter_failure(OSError):
            message = json.dumps({"start": token}).encode()
            socket.send_fds(self._socket, [message], [connection.fileno(), output])

    def end(self, token: int) -> None:
        """Kill a worker with all its descendants; `news` reports its end."""
        with _starter_failure(OSError):
            self._socket.send(json.dumps({"end": token}).encode(), socket.MSG_DONTWAIT)

    def news(self) -> list[News]:
        """Return the news since the last call."""
        news = []
        while True:
            try:
                received = self._socket.recv(LONGEST, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return news
            except OSError as error:
                raise StarterFailure(describe_error(error)) from None
            if not received:
                raise StarterFailure("the process that starts the workers ended")
            message = json.loads(received)
            self.answered = True
            if "hello" in message:
                self._nursery.warm, self._nursery.folder = True, message["folder"]
            elif "started" in message:
                news.append(News(message["started"], "started", message["pid"]))
            elif "ended" in message:
                news.append(News(message["ended"], "ended", code=message["code"]))
            elif "failed" in message:
                news.append(News(message["failed"], "ended"))

    def close(self) -> None:
        """End all workers, and wait until they are gone. A nursery that still warms up has none: it
        ends too, unless another pool waits for it."""
        with contextlib.suppress(StarterFailure):
            self.news()
        self._nursery.pools -= 1
        if not self._nursery.warm:
            if not self._nursery.pools:
                self._nursery.end()
            self._socket.close()
            return
        with contextlib.suppress(OSError):
            self._socket.shutdown(socket.SHUT_WR)
            end = time.monotonic() + _CLOSING
            while (left := end - time.monotonic()) > 0:
                ready = select.select([self._socket], [], [], left)[0]
                if ready and not self._socket.recv(LONGEST):
                    break
            else:
                self._nursery.kill()
        self._socket.close()

    def abandon(self, pids: list[int]) -> None:
        """Kill the nursery and its workers ``pids``, with their process groups."""
        self._nursery.kill()
        for pid in pids:
            linux_processes.kill_group(pid)
        self._socket.close()


class _Nursery:
    """The nursery as the main process sees it."""

    def __init__(self, setup: Setup):
        self.owner = os.getpid()
        spawn.get_preparation_data("worker")  # raises in a script without `if __name__ == …`
        resource_tracker.ensure_running()
        tracker = resource_tracker.getfd()
        self.socket, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        program = (
            f"import sys; sys.path[:] = {sys.path!r}; "
            "from evocity.evaluation.fork_server import main; "
            f"main({theirs.fileno()}, {self.owner}, {tracker})"
        )
        flags = util._args_from_interpreter_flags()
        command = [spawn.get_executable(), *flags, "-c", tie_to_parent(program)]
        parts = ",".join([write_sides(setup.sides), *setup.parts])
        files, self._ended = [theirs.fileno(), tracker], threading.Event()
        with block_ctrl_c(), set_environment(ONE_THREAD | {VARIABLE: parts}):
            self.pid = _start_tied(command, files, self._ended)
        theirs.close()
        self.alive = True
        self.warm = False  # whether it said hello
        self.pools = 0
        self.folder: str | None = None  # the workers' temporary folders, once it said hello

    def is_running(self) -> bool:
        if self.alive and self.owner == os.getpid():
            try:
                self.alive = os.waitpid(self.pid, os.WNOHANG)[0] == 0
            except ChildProcessError:  # other code reaped it
                self.alive = False
            if not self.alive:
                self._clean_up()
        return self.alive and self.owner == os.getpid()

    def _clean_up(self) -> None:
        self.alive = False
        self._ended.set()
        self.socket.close()
        if self.folder is not None:  # a killed nursery does not remove it
            shutil.rmtree(self.folder, ignore_errors=True)

    def end(self) -> None:
        """Close the connection, so that the nursery ends its workers and itself. Waits for it, but
        not for one that warms up."""
        if not self.is_running():
            return
        self.socket.close()
        end = time.monotonic() + (_CLOSING if self.warm else _COLD)
        if not self.warm:
            with contextlib.suppress(OSError):
                os.kill(self.pid, signal.SIGTERM)
        while self.is_running():
            if time.monotonic() > end:
                self.kill()
            time.sleep(0.005)

    def kill(self) -> None:
        """Kill the nursery and its descendants; workers that it has lost end by themselves."""
        if not self.is_running():
            return
        for pid in (self.pid, *linux_processes.descendants(self.pid)):
            linux_processes.kill(pid)
        with contextlib.suppress(ChildProcessError):
            os.waitpid(self.pid, 0)
        self._clean_up()


def _start_tied(command: list[str], files: list[int], ended: threading.Event) -> int:
    """Start a ``command`` that inherits ``files``, and return its process id. It dies with the
    thread that starts it, so this is a thread of its own, which stays until it has ``ended``."""
    results: SimpleQueue = SimpleQueue()

    def start() -> None:
        try:
            results.put(util.spawnv_passfds(command[0], command, files))
        except Exception as error:
            results.put(error)
        else:
            ended.wait()

    threading.Thread(target=start, name="nursery", daemon=True).start()
    result = results.get()
    if isinstance(result, Exception):
        raise result
    return result


_the_nursery: _Nursery | None = None
_starting = threading.Lock()


def _nursery_for(setup: Setup) -> _Nursery:
    """Return the nursery of this process; a new one loads the kernels of ``setup``."""
    global _the_nursery
    with _starting:
        if _the_nursery is None or not _the_nursery.is_running():
            _the_nursery = _Nursery(setup)
            # before multiprocessing and others wait for children
            util.Finalize(_the_nursery, _the_nursery.end, exitpriority=100)
        return _the_nursery


class SpawnStarter:
    """Starts workers in the main process, by multiprocessing; its methods are those of
    `NurseryStarter`."""

    inherits = True
    handle = None
    answered = True

    def __init__(self, setup: Setup):
        self._context = multiprocessing.get_context("spawn")
        self._processes: dict[int, Any] = {}
        self._news: list[News] = []
        self._environment = contextlib.ExitStack()
        self._environment.enter_context(set_environment(ONE_THREAD))
        # before multiprocessing waits for children
        self._finalizer = util.Finalize(self, self._kill_all, exitpriority=100)

    def start(self, token: int, connection: socket.socket, output: int | None) -> None:
        from evocity.evaluation import worker

        process = self._context.Process(target=worker.run_spawned, args=(connection,))
        with _starter_failure(OSError, EOFError), block_ctrl_c():
            process.start()
        self._processes[token] = process
        self._news.append(News(token, "started", process.pid))

    def end(self, token: int) -> None:
        if token in self._processes:
            self._kill(self._processes[token])

    def news(self) -> list[News]:
        news, self._news = self._news, []
        for token, process in list(self._processes.items()):
            code = process.exitcode
            if code is not None:
                self._kill(process)  # its descendants
                del self._processes[token]
                news.append(News(token, "ended", code=code))
        return news

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
            linux_processes.kill_group(process.pid)
        process.kill()


def first_messages(inherits: bool, setup: Any, memory: int | None, main: bool) -> bytes:
    """Make the first messages to a worker: the state of this process, unless it ``inherits`` that;
    then its ``setup`` and its ``memory``."""
    state = (None, None) if inherits else (_preparation(main), dict(os.environ) | ONE_THREAD)
    return write_frame(state) + write_frame((setup, memory))


def _preparation(main: bool) -> dict:
    """Collect the path, the arguments and, if ``main``, the main module of this process."""
    data = spawn.get_preparation_data("worker")
    if not main:
        data = {key: value for key, value in data.items() if not key.startswith("init_main")}
    return data | {"authkey": bytes(data["authkey"])}  # pickled only over a private connection


@contextlib.contextmanager
def _starter_failure(*kinds: type[Exception]) -> Iterator[None]:
    """Turn errors of these ``kinds`` into a `StarterFailure`."""
    try:
        yield
    except kinds as error:
        raise StarterFailure(describe_error(error)) from None


@contextlib.contextmanager
def block_ctrl_c() -> Iterator[None]:
    """Keep the terminal's SIGINT from processes that start within: the main process ends them.

    Otherwise they would print a traceback of their imports. On Windows nothing is inherited.
    """
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # its start would unblock the signal
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def set_environment(variables: Mapping[str, str]) -> Iterator[None]:
    """Set environment ``variables`` for processes that start within."""
    before = {name: os.environ.get(name) for name in variables}
    os.environ.update(variables)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
