"""The one place where numba is configured: every kernel of the package is compiled by `kernel`.

No fast-math: the same genome must decode to the same bits in every process. (Vector code may fuse
a·b + c, see `evocity.accelerate.vectors`: what depends on it is settled in float64.)
Kernels release the interpreter lock, so threads may run them side by side, and are cached on disk.
A kernel made by a function may take from it nothing but plain numbers: numba knows a cached kernel
by a pickle of what it takes, and another kernel is pickled under a new name in each process.
"""

from numba import njit


def kernel(function=None, **options):
    """Compile ``function`` with the flags common to all kernels of evocity.

    Further ``options`` go to `numba.njit` (for example ``error_model``).
    """
    settings = {"cache": True, "nogil": True, "boundscheck": False, "error_model": "numpy"}
    settings.update(options)
    return njit(**settings) if function is None else njit(**settings)(function)
