"""The nursery: on Linux, the process that starts workers and ends them, with all they began.

It has everything imported and every kernel loaded, so that a forked worker is ready at once. It
never runs what a user wrote, so nothing keeps it from ending the others. Each worker leads a
session of its own and adopts its descendants' orphans; when it ends, those that are left come to
the nursery, which kills them. The nursery ends, and all of these before, when the main process
does, of which it learns by the end of their connection. Should the nursery itself be killed, the
system kills the workers.

A pool sends ``{"start": token}`` with two files, the worker's connection and what it prints into,
or ``{"end": token}``; it is sent ``hello``, ``started``, ``failed`` and ``ended``, each with the
token. A pool that closes its connection has its workers ended.
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

from evocity.files import OwnFolder
from evocity.search.evaluation import processes
from evocity.search.evaluation.upkeep import raised

#: Bytes of the longest message of a pool, and files with it at most.
LONGEST, MOST_FILES = 4096, 2
#: Folders of nurseries begin so; of those that were killed they are removed by the next.
FOLDERS = "evocity-workers-"
# Seconds between two looks at whether the main process is still there.
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
        # for what measures leave in the temporary folder; none where there is no room for it
        self._own: OwnFolder | None = None
        with contextlib.suppress(OSError):
            self._own = OwnFolder(FOLDERS)
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
        """Until the main process ends."""
        try:
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
        with contextlib.suppress(ConnectionError):
            told, files, _, _ = socket.recv_fds(self._main, LONGEST, MOST_FILES)
            if told:
                pool = socket.socket(fileno=files[0])
                self._selector.register(pool, selectors.EVENT_READ)
                _tell(pool, hello=os.getpid(), folder=self._own and str(self._own.path))
                return True
        return False

    def _take_request(self, pool: socket.socket) -> None:
        told, files = b"", []
        with contextlib.suppress(ConnectionError):
            told, files, _, _ = socket.recv_fds(pool, LONGEST, MOST_FILES)
        if not told:
            self._end_pool(pool)
            return
        request = json.loads(told)
        if "start" in request:
            self._start(request["start"], pool, *files)
        for pid, one in self._workers.items():
            if one.pool is pool and one.token == request.get("end"):
                processes.kill(pid)

    def _start(self, token: int, pool: socket.socket, connection: int, printed: int) -> None:
        folder = None
        try:
            if self._own is not None:
                self._count += 1
                folder = os.path.join(self._own.path, str(self._count))
                os.mkdir(folder, 0o700)
            nursery = os.getpid()
            pid = os.fork()
        except OSError as error:
            _tell(pool, failed=token, why=str(error))
        else:
            if pid == 0:
                self._become_worker(nursery, connection, printed, folder)
            self._workers[pid] = _Worker(token, pool, folder)
            _tell(pool, started=token, pid=pid)
        finally:
            os.close(connection)
            os.close(printed)

    def _become_worker(self, nursery: int, connection: int, printed: int, folder) -> None:
        """Never returns."""
        try:
            processes.die_with_parent(nursery)
            os.setsid()
            processes.adopt_orphans()
            signal.set_wakeup_fd(-1)
            signal.signal(signal.SIGCHLD, signal.SIG_DFL)
            signal.signal(signal.SIGTERM, signal.SIG_DFL)
            for key in list(self._selector.get_map().values()):
                os.close(key.fd)
            os.close(self._woken)
            self._selector.close()
            if self._own is not None:
                self._own.let_go()
            if folder is not None:
                os.environ["TMPDIR"] = tempfile.tempdir = folder
            from evocity.search import worker

            worker.begin(connection, printed)
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(1)

    def _reap(self) -> None:
        """Of each worker that ended: end what it left, then tell its pool."""
        for pid in list(self._workers):
            how = os.WEXITED | os.WNOHANG | os.WNOWAIT  # its id is no other's until it is reaped
            if os.waitid(os.P_PID, pid, how) is None:
                continue
            processes.kill_group(pid)
            processes.sweep(self._workers)
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            one = self._workers.pop(pid)
            if one.folder is not None:
                shutil.rmtree(one.folder, ignore_errors=True)
            _tell(one.pool, ended=one.token, code=code)

    def _end_pool(self, pool: socket.socket) -> None:
        self._selector.unregister(pool)
        self._end([pid for pid, one in self._workers.items() if one.pool is pool])
        pool.close()  # by which the pool knows that all is done

    def _end_all(self) -> None:
        self._end(list(self._workers))
        if self._own is not None:
            self._own.remove()

    def _end(self, pids: list[int]) -> None:
        for pid in pids:
            processes.kill(pid)
        for pid in pids:
            os.waitid(os.P_PID, pid, os.WEXITED | os.WNOWAIT)
        self._reap()


def _tell(pool: socket.socket, **message) -> None:
    with contextlib.suppress(OSError):  # it is gone, or does not listen
        pool.send(json.dumps(message).encode(), socket.MSG_DONTWAIT)


def main(connection: int, parent: int, tracker: int) -> None:
    """In the nursery's process: ``connection`` to the main process, whose id is ``parent``;
    ``tracker``: of multiprocessing's resources, the main process's."""
    from multiprocessing import resource_tracker, util

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.setsid()
    processes.adopt_orphans()
    os.dup2(2, 1)  # standard output is for the main process's results
    util._close_stdin()
    resource_tracker._resource_tracker._fd = raised(tracker)
    served = socket.socket(fileno=connection)
    from evocity.search import warm  # loads what its variable names

    os.environ.pop(warm.VARIABLE, None)
    Nursery(served, parent).serve()
