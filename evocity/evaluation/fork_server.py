"""The nursery: on Linux, the process that forks workers and ends them with their descendants.

The nursery has imported everything and loaded every kernel, so a forked worker is ready at once. It
never runs the user's code, so it can always end the workers. Each worker leads its own session and
adopts the orphans among its descendants. When a worker ends, the nursery adopts the remaining ones
and kills them. When the main process ends, the connection closes, and the nursery ends the workers
and itself. If the nursery is killed, the system kills the workers.

A pool sends ``{"start": token}`` with two files, the worker's connection and the pipe for its
output, or ``{"end": token}``. The nursery sends ``hello``, ``started``, ``failed`` and ``ended``,
each with the token. If a pool closes its connection, the nursery ends its workers.

While the nursery loads kernels, it has no workers, and the system kills it with its parent.
"""

import contextlib
import json
import os
import selectors
import shutil
import signal
import socket
import sys
import tempfile
import traceback
from dataclasses import dataclass

from evocity.evaluation import linux_processes
from evocity.evaluation.process_state import move_descriptor
from evocity.files import ProcessFolder

#: The most bytes of a pool's message, and the most files with it.
LONGEST, _MOST_FILES = 4096, 2
#: The beginning of the names of nurseries' folders; the next nursery removes those of a killed one.
_FOLDERS = "evocity-workers-"
# Seconds between two checks of the main process.
_LOOK = 1.0


@dataclass
class _Worker:
    token: int
    pool: socket.socket
    folder: str | None


class Nursery:
    """Serves the pools of one main process, until that ends."""

    def __init__(self, main: socket.socket, parent: int):
        self._main, self._parent = main, parent
        self._workers: dict[int, _Worker] = {}
        self._count = 0
        # the temporary folders of the workers; None if it cannot be made
        self._folder: ProcessFolder | None = None
        self._selector = selectors.DefaultSelector()
        self._selector.register(main, selectors.EVENT_READ)
        self._wake, self._woken = os.pipe()
        for end in (self._wake, self._woken):
            os.set_blocking(end, False)
        self._selector.register(self._wake, selectors.EVENT_READ)
        signal.signal(signal.SIGCHLD, lambda *_: None)
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
        signal.set_wakeup_fd(self._woken)

    def serve(self) -> None:
        """Serve until the main process ends."""
        try:
            with contextlib.suppress(OSError):
                self._folder = ProcessFolder(_FOLDERS)
            while os.getppid() == self._parent and self._step():
                pass
        finally:
            self._end_all()

    def _step(self) -> bool:
        for key, _ in self._selector.select(_LOOK):
            if key.fileobj is self._main:
                if not self._take_pool():
                    return False
            elif key.fd == self._wake:
                with contextlib.suppress(BlockingIOError):
                    os.read(self._wake, 1 << 16)
            else:
                self._take_request(key.fileobj)
        self._reap()
        return True

    def _take_pool(self) -> bool:
        message, files = _receive(self._main)
        if message:
            pool = socket.socket(fileno=files[0])
            self._selector.register(pool, selectors.EVENT_READ)
            _send(pool, hello=os.getpid(), folder=self._folder and str(self._folder.path))
        return bool(message)

    def _take_request(self, pool: socket.socket) -> None:
        message, files = _receive(pool)
        if not message:
            self._end_pool(pool)
            return
        request = json.loads(message)
        if "start" in request:
            self._start(request["start"], pool, *files)
        for pid, worker in self._workers.items():
            if worker.pool is pool and worker.token == request.get("end"):
                linux_processes.kill(pid)

    def _start(self, token: int, pool: socket.socket, connection: int, output: int) -> None:
        folder = None
        try:
            if self._folder is not None:
                self._count += 1
                folder = os.path.join(self._folder.path, str(self._count))
                os.mkdir(folder, 0o700)
            nursery = os.getpid()
            pid = os.fork()
        except OSError as error:
            _send(pool, failed=token, why=str(error))
        else:
            if pid == 0:
                self._become_worker(nursery, connection, output, folder)
            self._workers[pid] = _Worker(token, pool, folder)
            _send(pool, started=token, pid=pid)
        finally:
            os.close(connection)
            os.close(output)

    def _become_worker(self, nursery: int, connection: int, output: int, folder) -> None:
        """Run a worker in this forked process. It never returns."""
        try:
            linux_processes.die_with_parent(nursery)
            os.setsid()
            linux_processes.adopt_orphans()
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            for key in list(self._selector.get_map().values()):
                os.close(key.fd)
            os.close(self._woken)
            self._selector.close()
            if self._folder is not None:
                self._folder.release()
            if folder is not None:
                os.environ["TMPDIR"] = tempfile.tempdir = folder
            from evocity.evaluation import worker

            worker.run_forked(connection, output)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)

    def _reap(self) -> None:
        """Kill the descendants of each worker that ended, then report its end to its pool."""
        for pid in list(self._workers):
            how = os.WEXITED | os.WNOHANG | os.WNOWAIT  # its id stays reserved until it is reaped
            if os.waitid(os.P_PID, pid, how) is None:
                continue
            linux_processes.kill_group(pid)
            linux_processes.sweep(self._workers)
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            worker = self._workers.pop(pid)
            if worker.folder is not None:
                shutil.rmtree(worker.folder, ignore_errors=True)
            _send(worker.pool, ended=worker.token, code=code)

    def _end_pool(self, pool: socket.socket) -> None:
        self._selector.unregister(pool)
        self._end([pid for pid, worker in self._workers.items() if worker.pool is pool])
        pool.close()  # so the pool knows that all its workers ended

    def _end_all(self) -> None:
        self._end(list(self._workers))
        if self._folder is not None:
            self._folder.remove()

    def _end(self, pids: list[int]) -> None:
        for pid in pids:
            linux_processes.kill(pid)
        for pid in pids:
            os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        self._reap()


def _receive(connection: socket.socket) -> tuple[bytes, list[int]]:
    """Receive a message and its files; an empty message when the other side is gone."""
    with contextlib.suppress(ConnectionError):
        return socket.recv_fds(connection, LONGEST, _MOST_FILES)[:2]
    return b"", []


def _send(pool: socket.socket, **message) -> None:
    with contextlib.suppress(OSError):  # the pool is gone, or does not listen
        pool.send(json.dumps(message).encode(), socket.MSG_DONTWAIT)


def main(connection: int, parent: int, tracker: int) -> None:
    """Run the nursery, given the descriptors of its connection and of the resource ``tracker``."""
    from multiprocessing import resource_tracker, util

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.setsid()
    linux_processes.adopt_orphans()
    os.dup2(2, 1)  # standard output is for the main process's results
    util._close_stdin()
    resource_tracker._resource_tracker._fd = move_descriptor(tracker)
    served = socket.socket(fileno=connection)
    from evocity.evaluation import kernel_warmup  # it loads the parts that its variable names

    os.environ.pop(kernel_warmup.VARIABLE, None)
    nursery = Nursery(served, parent)  # from here on, SIGTERM ends it with its workers
    linux_processes.outlive_parent()  # it sees the end of the parent itself, to end the workers
    try:
        nursery.serve()
    finally:
        os._exit(0)  # Python would free all libraries, which takes long
