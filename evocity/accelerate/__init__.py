"""Compilation of kernels by numba: `kernel` sets the flags of all kernels of the package.

There is no fast-math: the same genome must decode to the same bits in every process. (Vector code
may fuse a·b + c, see `evocity.accelerate.vectors`: float64 settles results that depend on it.)
Kernels release the interpreter lock. The disk caches them (`evocity.accelerate.cache`). A function
that makes a kernel may give it only plain numbers, since numba identifies a cached kernel by a
pickle of its closure.
"""

import contextlib
import functools
import platform
from collections.abc import Callable, Iterator
from pathlib import Path


class Kernel:
    """A function that is compiled at its first call, or at that of a kernel that calls it.

    Until then numba is not loaded: a room whose kernels are not called imports quickly.
    """

    def __init__(self, function: Callable, options: dict):
        functools.update_wrapper(self, function)
        self.py_func, self._options = function, options

    def __call__(self, *arguments, **named):
        try:
            return self.compiled(*arguments, **named)
        except SystemError as error:
            # a signal's handler raised an exception while numba made the result: Ctrl-C, mostly
            cause = error
            while isinstance(cause, SystemError) and cause.__cause__ is not None:
                cause = cause.__cause__
            raise cause from None

    @property
    def compiled(self):
        """Numba's dispatcher, which compiles the function for each types of arguments; the plain
        function if numba is disabled."""
        known = self.__dict__
        if "_compiled" not in known:
            known.setdefault("_compiled", self._compile())  # one for all threads
        return known["_compiled"]

    def _compile(self):
        from numba import njit

        from evocity.accelerate.cache import make_temporary_cache, share_cache

        settings = {"cache": True, "nogil": True, "boundscheck": False, "error_model": "numpy"}
        settings.update(self._options)
        try:
            made = njit(**settings)(self.py_func)
        except RuntimeError:  # numba has no folder for the compiled function
            settings["cache"] = settings["cache"] and make_temporary_cache()
            made = njit(**settings)(self.py_func)
        if settings["cache"] and hasattr(made, "_cache"):
            share_cache(made)
        return made

    @property
    def _numba_type_(self):
        """Numba's type of the kernel, for calls from other kernels."""
        return self.compiled._numba_type_


def kernel(function=None, **options):
    """Compile ``function`` at its first call, with the flags of all kernels of evocity.

    ``options`` go to `numba.njit` (for example ``error_model``).
    """
    if function is None:
        return lambda function: kernel(function, **options)
    return Kernel(function, options)


@kernel
def _nothing():
    return 0


def cache_folder() -> Path | None:
    """Return the folder of this module's compiled kernels, where notes on others may lie, too; None
    if kernels are not compiled, or not cached."""
    folder = getattr(getattr(_nothing.compiled, "_cache", None), "cache_path", None)
    return None if folder is None else Path(folder)


def stamp() -> tuple:
    """Identify what compiled kernels depend on: Python, numba, the processor, and all files of
    kernels. A cached kernel is valid while this stays the same."""
    import llvmlite.binding
    import numba

    package = Path(__file__).parent.parent
    files = [*package.rglob("_kernels.py"), *Path(__file__).parent.glob("*.py")]
    states = [(file.relative_to(package).as_posix(), file.stat()) for file in sorted(files)]
    return (
        platform.python_version(),
        numba.__version__,
        llvmlite.__version__,
        llvmlite.binding.get_host_cpu_name(),
        tuple((name, state.st_mtime_ns, state.st_size) for name, state in states),
    )


def watch_compiled(callback: Callable[[], None]) -> None:
    """Call ``callback`` whenever this process has compiled a kernel of evocity, for one set of
    types, from now on. Numba's own functions do not count."""
    from numba.core import event

    event.register("numba:compile", _listener(ended=callback))


@contextlib.contextmanager
def watch_compiling(callback: Callable[[], None]) -> Iterator[None]:
    """Call ``callback`` whenever this process begins to compile a kernel of evocity, within. A
    cached kernel is not compiled."""
    from numba.core import event

    with event.install_listener("numba:compile", _listener(started=callback)):
        yield


def _listener(started: Callable = lambda: None, ended: Callable = lambda: None):
    """Make a listener to the compilation of kernels of evocity; numba's own do not count."""
    from numba.core import event

    class _Listener(event.Listener):
        def on_start(self, event, call=started) -> None:
            if event.data["dispatcher"].py_func.__module__.startswith("evocity."):
                call()

        def on_end(self, event) -> None:
            self.on_start(event, ended)

    return _Listener()
