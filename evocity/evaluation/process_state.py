"""The state of a worker process before its first birth, and its restoration after each birth.

So a measure that changes the folder, the environment or a signal handler changes no other birth.
"""

import builtins
import contextlib
import faulthandler
import gc
import os
import signal
import sys
import tempfile
import warnings
from operator import is_

import numpy as np

from evocity.errors import RunError
from evocity.evaluation import linux_processes
from evocity.evaluation.floating_point import FloatingPoint

try:
    import resource
except ImportError:  # Windows
    resource = None

#: Resource limits to restore.
_LIMITS = ("NOFILE", "FSIZE", "DATA", "AS", "STACK", "CPU", "NPROC")
#: Signals whose handlers to restore.
_SIGNALS = ("SIGTERM", "SIGINT", "SIGALRM", "SIGCHLD", "SIGHUP", "SIGUSR1", "SIGUSR2", "SIGPIPE")
_MASKS = hasattr(signal, "pthread_sigmask")
# As they are before a measure may replace them.
_all, _map = all, map
#: The lowest descriptor of a worker's own files: measures that close the first ones spare them.
_HIGH = 200


#: Open files that a worker and the process that starts workers may need.
_FILES = _HIGH + 56


def require_open_files() -> None:
    """Raise this process's soft limit of open files where workers need more than it allows. Raises
    `RunError` if the hard limit is lower than that."""
    if resource is None:
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft == resource.RLIM_INFINITY or soft >= _FILES:
        return
    if hard != resource.RLIM_INFINITY and hard < _FILES:
        raise RunError(
            f"this process may open only {hard} files",
            f"at least {_FILES} open files, because worker processes need these files",
            f"raise the limit, for example with: ulimit -n {4 * _FILES}; or use no workers",
        )
    resource.setrlimit(resource.RLIMIT_NOFILE, (_FILES, hard))


def move_descriptor(descriptor: int) -> int:
    """Move a file to a high descriptor, which programs that this process starts do not inherit."""
    try:
        import fcntl
    except ImportError:  # Windows
        return descriptor
    high = fcntl.fcntl(descriptor, fcntl.F_DUPFD_CLOEXEC, _HIGH)
    os.close(descriptor)
    return high


class ProcessState:
    """The state of this process now; `restore` puts it back and ends newer processes."""

    def __init__(self):
        self._floating_point = FloatingPoint()
        self._builtins = dict(builtins.__dict__)
        self._folder = os.getcwd()
        self._temporary = tempfile.gettempdir()
        self._environment = dict(os.environ)
        self._encoded = dict(_encoded_environment())
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
        self._spared = frozenset(linux_processes.children(os.getpid()))
        numbers = (getattr(resource, f"RLIMIT_{name}", None) for name in _LIMITS)
        self._limits = {one: resource.getrlimit(one) for one in numbers if one is not None}
        self._files = []
        if os.name == "posix":
            self._files = [(low, move_descriptor(os.dup(low)), _file_id(low)) for low in range(3)]

    def restore(self) -> bool:
        """Restore the state. Returns whether all is restored; if not, the worker must end."""
        self._floating_point.restore()  # before anything computes
        self._restore_builtins()
        for number, limits in self._limits.items():
            if resource.getrlimit(number) != limits:
                try:
                    resource.setrlimit(number, limits)
                except (OSError, ValueError):  # a hard limit never rises again
                    return False
        if self._spared or linux_processes.has_children():
            self._end_processes()
        self._restore_files()
        self._restore_interpreter()
        self._restore_signals()
        with contextlib.suppress(OSError):
            if _working_folder() != self._folder:
                os.chdir(self._folder)
        if _encoded_environment() != self._encoded:
            os.environ.clear()
            os.environ.update(self._environment)
        os.umask(self._mask)
        if not os.path.isdir(self._temporary):
            with contextlib.suppress(OSError):
                os.mkdir(self._temporary, 0o700)
        return True

    def _end_processes(self) -> None:
        if linux_processes.LINUX:
            linux_processes.sweep(self._spared)
            return
        with contextlib.suppress(ChildProcessError):
            while os.waitpid(-1, os.WNOHANG)[0]:
                pass

    def _restore_files(self) -> None:
        for low, kept, file_id in self._files:
            if _file_id(low) != file_id:
                with contextlib.suppress(OSError):
                    os.dup2(kept, low)

    def _restore_builtins(self) -> None:
        """Undo changes of built-in functions; new ones stay, since a library may count on them."""
        names = builtins.__dict__
        if not _all(_map(is_, names.values(), self._builtins.values())):
            names.update(self._builtins)

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
            getattr(warnings, "_filters_mutated", lambda: None)()  # for the caches of filters
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


def _encoded_environment() -> dict:
    """Return the environment in bytes, which compare a hundred times faster than texts."""
    return getattr(os.environ, "_data", None) or dict(os.environ)


def _working_folder() -> str | None:
    try:
        return os.getcwd()
    except OSError:  # it was removed
        return None


def _file_id(descriptor: int) -> tuple[int, int] | None:
    try:
        status = os.fstat(descriptor)
    except OSError:
        return None
    return status.st_dev, status.st_ino
