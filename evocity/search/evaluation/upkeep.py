"""A worker as it was before a birth: what a measure changed of its process is put back after it.

So a measure that changes the folder, the environment or a signal handler and does not undo it
changes no other birth, whichever worker that has.
"""

import contextlib
import faulthandler
import gc
import os
import signal
import sys
import warnings

import numpy as np

from evocity.search.evaluation import processes

try:
    import resource
except ImportError:  # Windows
    resource = None

#: Limits of these are put back.
_LIMITS = ("NOFILE", "FSIZE", "DATA", "AS", "STACK", "CPU", "NPROC")
#: Handlers of these are put back.
_SIGNALS = ("SIGTERM", "SIGINT", "SIGALRM", "SIGCHLD", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGPIPE")
_MASKS = hasattr(signal, "pthread_sigmask")
#: Where a worker's own files lie: measures that close the first ones miss them.
HIGH = 200


def raised(descriptor: int) -> int:
    """The same file under a high number, closed in programs that are started; the old is closed."""
    try:
        import fcntl
    except ImportError:  # Windows
        return descriptor
    high = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, HIGH)
    os.close(descriptor)
    return high


class Upkeep:
    """The process as it is now. `restore` puts back what differs, and ends the processes that were
    begun since."""

    def __init__(self):
        self._folder = os.getcwd()
        self._environment = dict(os.environ)
        self._coded = dict(_coded_environment())
        self._mask = os.umask(0o077)
        os.umask(self._mask)
        self._handlers = {
            number: handler
            for number in (getattr(signal, name, None) for name in _SIGNALS)
            if number is not None and (handler := signal.getsignal(number)) is not None
        }
        self._streams = sys.stdin, sys.stdout, sys.stderr
        self._path, self._modules = list(sys.path), dict(sys.modules)
        self._count = len(self._modules)
        self._filters, self._errors = list(warnings.filters), np.geterr()
        self._depth = sys.getrecursionlimit()
        self._tracing = sys.gettrace(), sys.getprofile()
        self._blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ()) if _MASKS else ()
        self._spared = frozenset(processes.children(os.getpid()))
        self._limits = {number: resource.getrlimit(number) for number in _limited()}
        self._files = []
        if os.name == "posix":
            self._files = [(low, raised(os.dup(low)), _place(low)) for low in range(3)]

    def restore(self) -> bool:
        """Whether all could be put back; else the worker should take no other birth."""
        for number, limits in self._limits.items():
            if resource.getrlimit(number) != limits:
                try:
                    resource.setrlimit(number, limits)
                except (OSError, ValueError):  # a hard limit never rises again
                    return False
        if self._spared or processes.has_children():
            self._end_processes()
        self._restore_files()
        self._restore_interpreter()
        self._restore_signals()
        with contextlib.suppress(OSError):
            if _folder() != self._folder:
                os.chdir(self._folder)
        if _coded_environment() != self._coded:
            os.environ.clear()
            os.environ.update(self._environment)
        os.umask(self._mask)
        return True

    def _end_processes(self) -> None:
        if processes.LINUX:
            processes.sweep(self._spared)
            return
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass

    def _restore_files(self) -> None:
        for low, kept, place in self._files:
            if _place(low) != place:
                with contextlib.suppress(OSError):
                    os.dup2(kept, low)

    def _restore_interpreter(self) -> None:
        sys.stdin, sys.stdout, sys.stderr = self._streams
        if len(sys.modules) != self._count:
            if not self._modules.keys() <= sys.modules.keys():
                sys.modules.update(self._modules)
            self._count = len(sys.modules)
        if sys.path != self._path:
            sys.path[:] = self._path
        if warnings.filters != self._filters:
            warnings.filters[:] = self._filters
            getattr(warnings, "_filters_mutated", lambda: None)()  # they are kept in caches
        if np.geterr() != self._errors:
            np.seterr(**self._errors)
        if sys.getrecursionlimit() != self._depth:
            sys.setrecursionlimit(self._depth)
        if not gc.isenabled():
            gc.enable()
        if (sys.gettrace(), sys.getprofile()) != self._tracing:
            sys.settrace(self._tracing[0])
            sys.setprofile(self._tracing[1])
        faulthandler.cancel_dump_traceback_later()

    def _restore_signals(self) -> None:
        if hasattr(signal, "setitimer"):
            for timer in (signal.ITIMER_REAL, signal.ITIMER_VIRTUAL, signal.ITIMER_PROF):
                signal.setitimer(timer, 0)
        for number, handler in self._handlers.items():
            if signal.getsignal(number) is not handler:
                with contextlib.suppress(OSError, ValueError, TypeError):
                    signal.signal(number, handler)
        if _MASKS:
            signal.pthread_sigmask(signal.SIG_SETMASK, self._blocked)


def _limited() -> list[int]:
    found = [getattr(resource, f"RLIMIT_{name}", None) for name in _LIMITS]
    return [number for number in found if number is not None]


def _coded_environment() -> dict:
    """The environment, compared a hundred times faster than by its decoded names."""
    return getattr(os.environ, "_data", None) or dict(os.environ)


def _folder() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # it was removed
        return None


def _place(descriptor: int) -> tuple[int, int] | None:
    try:
        told = os.fstat(descriptor)
    except OSError:
        return None
    return told.st_dev, told.st_ino
