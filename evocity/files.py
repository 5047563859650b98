"""Atomic writing of files, and temporary folders of one process."""

import contextlib
import errno
import os
import secrets
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows: folders of killed processes stay
    fcntl = None

# An unlocked folder below this age, seconds, may still wait for its lock.
_NEW = 10.0


@contextmanager
def whole_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path in the folder of ``path``; on success flush and rename it to ``path``.

    After an error ``path`` is as before. The temporary name keeps the suffix, by which writers
    choose a format. Links are followed. Raises `FileExistsError` if ``path`` is a folder, a device
    or a pipe. Raises OSError for a loop of links, and for a name that is too long.
    """
    path = Path(os.path.realpath(path))
    with contextlib.suppress(FileNotFoundError):
        os.stat(path)
    if path.exists() and not path.is_file():
        raise FileExistsError(errno.EEXIST, "the path exists and is not a file", str(path))
    temporary = path.with_name(f".{path.stem}-{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        with open(temporary, "rb+") as file:
            os.fsync(file.fileno())
        os.replace(temporary, path)
        flush_folder(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def flush_folder(folder: Path) -> None:
    """Make a rename in ``folder`` survive a power cut, where the system can flush folders."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


class ProcessFolder:
    """A temporary folder whose name begins with ``prefix``, locked until this process ends.

    Before that, it removes folders with the same prefix that killed processes left. Raises OSError
    if no folder can be created.

    path : the folder.
    """

    def __init__(self, prefix: str):
        _remove_leftovers(prefix)
        self.path = Path(tempfile.mkdtemp(prefix=prefix))
        self._lock: int | None = None
        if fcntl:
            self._lock = os.open(self.path, os.O_RDONLY)
            with contextlib.suppress(OSError):  # a file system without locks: the folder stays
                fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def release(self) -> None:
        """Give up the lock, in a forked process that shares it with its parent."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None

    def remove(self) -> None:
        """Remove the folder with its contents."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.release()


def _remove_leftovers(prefix: str) -> None:
    if fcntl is None:
        return
    place = tempfile.gettempdir()
    for name in os.listdir(place):
        if not name.startswith(prefix):
            continue
        with contextlib.suppress(OSError):
            folder = os.path.join(place, name)
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                state = os.fstat(handle)
                if state.st_uid == os.getuid() and time.time() - state.st_mtime > _NEW:
                    fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(handle)
