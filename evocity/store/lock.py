"""The lock of a run folder: one process writes it. The system frees the lock when its holder
dies."""

import contextlib
import os
import time
from pathlib import Path

from evocity.errors import RunError, reason_of
from evocity.store.safe_open import open_to_append, open_to_read

# A process that only looks holds a lock for a moment: tries to take it, and seconds between them.
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
    """Holds ``path`` locked until `release`, or until the process ends.

    Raises `RunError` if another process holds it, or if the folder is not writable.
    """

    def __init__(self, path: Path):
        try:
            self._file = open_to_append(path)
        except OSError as error:
            raise RunError(
                f"{path.parent} cannot be written: {reason_of(error)}",
                "a run folder that you may write to",
                "make the folder writable, or copy it to a writable place; reading needs neither",
            ) from error
        try:
            _retry(_take, self._file)
        except (BlockingIOError, PermissionError):
            self._file.close()
            raise RunError(
                f"{path.parent} is being written by another process",
                "one writing process per run",
                "wait for that process, or stop it; `evocity status` works meanwhile",
            ) from None
        except BaseException:
            self._file.close()
            raise

    def release(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()


def is_held(path: Path) -> bool:
    """Return whether a process holds ``path`` locked; changes nothing and keeps no process out.

    False where nothing can be read, or where the file system has no locks. Raises `RunError` for a
    link, and other files that are not plain.
    """
    try:
        file = open_to_read(path)
    except OSError:
        return False
    with file:
        try:
            _retry(_share, file)
        except (BlockingIOError, PermissionError):
            return True
        except OSError:
            return False
    return False


def _retry(take, file) -> None:
    """Call ``take(file)``, again if it fails: another process may only look."""
    for _ in range(_TRIES - 1):
        with contextlib.suppress(BlockingIOError, PermissionError):
            return take(file)
        time.sleep(_BETWEEN_TRIES)
    take(file)
