"""Numba's cache on disk, made safe for processes that compile at once.

Numba names a compiled kernel in an index, by number, and writes the two files one after the other.
Two processes that compile two versions of one kernel (for two types, or for two block sizes) may
both take the same number: then the index leads to the wrong code, in every later process. So one
process writes at a time, and none reads meanwhile.

Numba also counts the functions it compiles, from 1 in each process, and finds what belongs to one,
in all that is loaded from the cache, by a name with that number. Where two processes give one
kernel one number, once as another kernel calls it and once by itself, its code may take the other's
constants. So each process counts from a number of its own.

And numba loads all that it would compile with, scipy's linear algebra too, before it looks whether
a kernel is in the cache: a third of a second, and a command takes one. Here it looks first. It
tells whoever listens of each call of LLVM, hundreds as a kernel is loaded, which is a fifth of the
time of that. Here nobody listens.
"""

import contextlib
import itertools
import os
from collections.abc import Iterator

from llvmlite.binding import ffi
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None
    import msvcrt


class SharedCacheFile(IndexDataCacheFile):
    """Index and compiled code of one kernel, behind a lock beside them."""

    def flush(self):
        with _locked(self._index_path):
            super().flush()

    def save(self, key, data):
        with _locked(self._index_path):
            super().save(key, data)

    def load(self, key):
        if not os.path.exists(self._index_path):
            return None
        with _locked(self._index_path):
            return super().load(key)


class SharedCache(FunctionCache):
    """One kernel, found on disk without what compiles; a miss loads that, as it compiles."""

    def load_overload(self, sig, target_context):
        rtsys.initialize(target_context)  # the arrays that a kernel makes are counted there
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def share_cache(dispatcher) -> None:
    """Let the kernel's cache on disk be written by several processes at once, and read soon."""
    dispatcher._cache.__class__ = SharedCache
    dispatcher._cache._cache_file.__class__ = SharedCacheFile


def count_apart() -> None:
    """Have this process, and those forked from it, number what they compile as no other does."""
    _begin_anywhere()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_begin_anywhere)


def _begin_anywhere() -> None:
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6), "big"))


def call_untold() -> None:
    """Have numba tell nobody when LLVM is called."""
    for callbacks in list(getattr(getattr(ffi.lib, "_lock", None), "_cblist", ())):
        ffi.unregister_lock_callback(*callbacks)


@contextlib.contextmanager
def _locked(index: str) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        # where the folder is read-only, or its file system has no locks, go on without one
        with contextlib.suppress(OSError):
            file = stack.enter_context(open(index + ".lock", "ab"))
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_EX)  # given up when the file is closed
            else:
                file.seek(0)
                msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
        yield


count_apart()
call_untold()
