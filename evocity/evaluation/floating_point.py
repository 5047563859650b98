"""The floating-point environment of a thread: rounding mode, flush-to-zero, exception masks."""

import ctypes
import sys
from functools import cache

#: At least the bytes of C's ``fenv_t``; on no known system it has more than 64.
_BYTES = 512


@cache
def _library() -> ctypes.CDLL | None:
    """Return the library that has ``fegetenv``; None if no library has it."""
    names: list[str | None] = [None, "libm.so.6"]
    if sys.platform == "win32":
        names = ["ucrtbase"]
    for name in names:
        try:
            library = ctypes.CDLL(name)
            library.fegetenv.argtypes = library.fesetenv.argtypes = [ctypes.c_void_p]
        except (OSError, AttributeError, TypeError):
            continue
        return library
    return None


class FloatingPoint:
    """The floating-point environment of the calling thread now; `restore` puts it back. Where the
    system offers no way, it does nothing."""

    def __init__(self):
        self._saved = ctypes.create_string_buffer(_BYTES)
        self._library = _library()
        if self._library is not None and self._library.fegetenv(self._saved):
            self._library = None

    def restore(self) -> None:
        """Put the environment back."""
        if self._library is not None:
            self._library.fesetenv(self._saved)
