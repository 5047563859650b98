"""Numba's cache on disk, made safe for processes that compile at once, and quick to load.

Numba names a compiled kernel in an index, by number, and writes the two files one after the other.
Two processes that take the same number lead every later process to the wrong code. Here one process
writes at a time, and no process reads meanwhile.

Numba also numbers the functions it compiles, from 1 in each process. Code of two processes may then
take each other's constants. Here each process counts from a random number.

Numba loads its whole compiler before it looks for a kernel in the cache: a third of a second. Here
it looks first. Numba reports each call of LLVM to listeners, a fifth of the time of loading. Here
there are no listeners.
"""

import atexit
import contextlib
import itertools
import os
import warnings
from collections.abc import Iterator

from llvmlite.binding import ffi
from numba.core import config
from numba.core.bytecode import FunctionIdentity
from numba.core.caching import FunctionCache, IndexDataCacheFile
from numba.core.runtime import rtsys

from evocity.files import ProcessFolder

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

    def _load_index(self):
        try:
            return super()._load_index()
        except (ImportError, AttributeError):  # an index of another version, with its modules
            return {}

    def load(self, key):
        if not os.path.exists(self._index_path):
            return None
        with _locked(self._index_path):
            return super().load(key)


class SharedCache(FunctionCache):
    """One kernel, loaded from disk without the compiler; a miss loads it, to compile."""

    def load_overload(self, sig, target_context):
        rtsys.initialize(target_context)  # it counts the arrays that a kernel makes
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)


def share_cache(dispatcher) -> None:
    """Let several processes write the kernel's cache at once, and read it without the compiler."""
    dispatcher._cache.__class__ = SharedCache
    dispatcher._cache._cache_file.__class__ = SharedCacheFile


def make_temporary_cache() -> bool:
    """Keep compiled kernels in a temporary folder, for this process and those that it starts.

    For a package in a read-only place and a user without a writable home. It warns of that. The
    folder disappears when this process ends. Returns False if no folder can be made.
    """
    try:
        folder = ProcessFolder("evocity-kernels-")
    except OSError:
        return False
    owner = os.getpid()
    atexit.register(lambda: folder.remove() if os.getpid() == owner else None)
    config.CACHE_DIR = os.environ["NUMBA_CACHE_DIR"] = str(folder.path)
    warnings.warn(
        "compiled kernels cannot be kept: no folder for them is writable. Each command compiles "
        "them, for up to a minute. To keep them, set NUMBA_CACHE_DIR to a folder of your own",
        stacklevel=2,
    )
    return True


def separate_counters() -> None:
    """Number compiled functions from a random number, in this process and its forks."""
    _count_from_random()
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_count_from_random)


def _count_from_random() -> None:
    FunctionIdentity._unique_ids = itertools.count(int.from_bytes(os.urandom(6), "big"))


def silence_llvm() -> None:
    """Remove numba's listeners to calls of LLVM."""
    for callbacks in list(getattr(getattr(ffi.lib, "_lock", None), "_cblist", ())):
        ffi.unregister_lock_callback(*callbacks)


@contextlib.contextmanager
def _locked(index: str) -> Iterator[None]:
    with contextlib.ExitStack() as stack:
        # where the folder is read-only, or its file system has no locks, go on without one
        with contextlib.suppress(OSError):
            file = stack.enter_context(open(index + ".lock", "ab"))
            if fcntl:
                fcntl.flock(file, fcntl.LOCK_EX)  # closing the file gives it up
            else:
                file.seek(0)
                msvcrt.locking(file.fileno(), msvcrt.LK_LOCK, 1)
        yield


separate_counters()
silence_llvm()
