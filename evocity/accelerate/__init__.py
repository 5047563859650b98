"""The one place where numba is configured: every kernel of the package is compiled by `kernel`.

No fast-math: the same genome must decode to the same bits in every process. (Vector code may fuse
a·b + c, see `evocity.accelerate.vectors`: what depends on it is settled in float64.)
Kernels release the interpreter lock, so threads may run them side by side, and are cached on disk,
where several processes may compile at once (`evocity.accelerate.caching`).
A kernel made by a function may take from it nothing but plain numbers: numba knows a cached kernel
by a pickle of what it takes, and another kernel is pickled under a new name in each process.
"""

import contextlib
import platform
from collections.abc import Callable, Iterator
from pathlib import Path

import llvmlite.binding
import numba
from numba import njit
from numba.core import event

from evocity.accelerate.caching import count_apart, share_cache

count_apart()


def kernel(function=None, **options):
    """Compile ``function`` with the flags common to all kernels of evocity.

    Further ``options`` go to `numba.njit` (for example ``error_model``).
    """
    settings = {"cache": True, "nogil": True, "boundscheck": False, "error_model": "numpy"}
    settings.update(options)
    if function is None:
        return lambda function: kernel(function, **options)
    compiled = njit(**settings)(function)
    if settings["cache"] and hasattr(compiled, "_cache"):  # a plain function if numba is disabled
        share_cache(compiled)
    return compiled


@kernel
def _nothing():
    return 0


def cache_folder() -> Path | None:
    """Where compiled kernels of this module are kept, and so a place for notes on the others'; None
    if kernels are not compiled, or not kept."""
    folder = getattr(getattr(_nothing, "_cache", None), "cache_path", None)
    return None if folder is None or not hasattr(_nothing, "py_func") else Path(folder)


def stamp() -> tuple:
    """What tells whether a compiled kernel found on disk is still right: Python, numba, the
    processor, and all files of kernels."""
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
