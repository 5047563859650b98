"""One process writes a run: a lock that the operating system frees when its holder dies."""

import contextlib
import os
import time
from pathlib import Path

from evocity.errors import RunError
from evocity.store.parts import open_to_append, open_to_read

#: Who only looks holds a lock for a moment: tries to take it, and seconds between them.
_TRIES, _BETWEEN_TRIES = 5, 0.01

if os.name == "nt":
    import msvcrt

    def _take(file) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

    _share = _take

else:
    import fcntl

    def _take(file) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def _share(file) -> None:
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)


class Lock:
    """Holds ``path`` locked until `release`, or until the process ends, however it ends.

    Raises `RunError` if another process holds it, or if nothing can be written there.
    """

    def __init__(self, path: Path):
        try:
            self._file = open_to_append(path)
        except OSError as error:
            raise RunError(
                f"{path.parent} cannot be written: {error.strerror or error}",
                "a run folder that this user may write to",
                "make it writable, or copy it to where it is; reading needs no more than that",
            ) from error
        try:
            _patiently(_take, self._file)
        except (BlockingIOError, PermissionError):
            self._file.close()
            raise RunError(
                f"{path.parent} is being written by another process",
                "one process a run",
                "wait for it or stop it; `evocity status` may be used meanwhile",
            ) from None
        except BaseException:
            self._file.close()
            raise

    def release(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()


def is_held(path: Path) -> bool:
    """Whether a process holds ``path`` locked now; nothing is made or changed, nobody kept out.

    False where nothing can be read, or where the file system knows no locks. Raises `RunError` for
    a link, or what else is no plain file.
    """
    try:
        file = open_to_read(path)
    except OSError:
        return False
    with file:
        try:
            _patiently(_share, file)
        except (BlockingIOError, PermissionError):
            return True
        except OSError:
            return False
    return False


def _patiently(take, file) -> None:
    """``take(file)``, again if it fails: another may just be looking."""
    for _ in range(_TRIES - 1):
        with contextlib.suppress(BlockingIOError, PermissionError):
            return take(file)
        time.sleep(_BETWEEN_TRIES)
    take(file)
