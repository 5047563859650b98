"""The one place where numba is configured: every kernel of the package is compiled by `kernel`.

No fast-math: the same genome must decode to the same bits in every process. (Vector code may fuse
a·b + c, see `evocity.accelerate.vectors`: what depends on it is settled in float64.)
Kernels release the interpreter lock, so threads may run them side by side, and are cached on disk,
where several processes may compile at once (`evocity.accelerate.caching`).
A kernel made by a function may take from it nothing but plain numbers: numba knows a cached kernel
by a pickle of what it takes, and another kernel is pickled under a new name in each process.
"""

import contextlib
import functools
import platform
from collections.abc import Callable, Iterator
from pathlib import Path


class Kernel:
    """A function that is compiled when it is first called, or another kernel that calls it is.

    Until then numba is not loaded: whoever imports a room and calls no kernel of it does not wait.
    """

    def __init__(self, function: Callable, options: dict):
        functools.update_wrapper(self, function)
        self.py_func, self._options = function, options

    def __call__(self, *arguments):
        return self.compiled(*arguments)

    @property
    def compiled(self):
        """What numba makes of it: a dispatcher, which compiles it for each types of arguments; the
        plain function where numba is disabled."""
        known = self.__dict__
        if "_compiled" not in known:
            known.setdefault("_compiled", self._made())  # threads may meet: all take the same one
        return known["_compiled"]

    def _made(self):
        from numba import njit

        from evocity.accelerate.caching import share_cache

        settings = {"cache": True, "nogil": True, "boundscheck": False, "error_model": "numpy"}
        settings.update(self._options)
        made = njit(**settings)(self.py_func)
        if settings["cache"] and hasattr(made, "_cache"):
            share_cache(made)
        return made

    @property
    def _numba_type_(self):
        """As what numba calls it from another kernel."""
        return self.compiled._numba_type_


def kernel(function=None, **options):
    """Compile ``function``, once it is called, with the flags common to all kernels of evocity.

    Further ``options`` go to `numba.njit` (for example ``error_model``).
    """
    if function is None:
        return lambda function: kernel(function, **options)
    return Kernel(function, options)


@kernel
def _nothing():
    return 0


def cache_folder() -> Path | None:
    """Where compiled kernels of this module are kept, and so a place for notes on the others'; None
    if kernels are not compiled, or not kept."""
    folder = getattr(getattr(_nothing.compiled, "_cache", None), "cache_path", None)
    return None if folder is None else Path(folder)


def stamp() -> tuple:
    """What tells whether a compiled kernel found on disk is still right: Python, numba, the
    processor, and all files of kernels."""
    import llvmlite.binding
    import numba

    package = Path(__file__).parent.parent
    files = [*package.rglob("_kernels.py"), *Path(__file__).parent.glob("*.py")]
    states = [(one.relative_to(package).as_posix(), one.stat()) for one in sorted(files)]
    return (
        platform.python_version(),
        numba.__version__,
        llvmlite.__version__,
        llvmlite.binding.get_host_cpu_name(),
        tuple((name, state.st_mtime_ns, state.st_size) for name, state in states),
    )


def on_compiled(told: Callable[[], None]) -> None:
    """Call ``told`` from now on whenever this process has compiled a kernel of evocity, for one
    set of types; what of numba's own is compiled into it does not count."""
    from numba.core import event

    class _Ear(event.Listener):
        def on_start(self, event) -> None:
            pass

        def on_end(self, event) -> None:
            if _is_ours(event):
                told()

    event.register("numba:compile", _Ear())


@contextlib.contextmanager
def on_compiling(told: Callable[[], None]) -> Iterator[None]:
    """Within, call ``told`` whenever this process begins to compile a kernel of evocity; what it
    finds in the cache is not compiled."""
    from numba.core import event

    class _Ear(event.Listener):
        def on_start(self, event) -> None:
            if _is_ours(event):
                told()

        def on_end(self, event) -> None:
            pass

    with event.install_listener("numba:compile", _Ear()):
        yield


def _is_ours(event) -> bool:
    """Whether a kernel of evocity is compiled, and not one of numba's own."""
    return event.data["dispatcher"].py_func.__module__.startswith("evocity.")
