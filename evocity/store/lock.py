"""The lock of a run folder: one process writes it. The system frees the lock when its holder
dies."""

import contextlib
import os
import time
from pathlib import Path

from evocity.errors import RunError, reason_of
from evocity.store.run_directory import RunDirectory

#: The name of the file that a writer of a run locks.
LOCK = "lock"
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
    """Holds the run folder ``directory`` locked until `release`, or until the process ends. Raises
    `RunError` if another process holds it, or if the folder is not writable."""

    def __init__(self, directory: RunDirectory):
        self._directory = directory
        try:
            self._file = directory.append(LOCK)
        except OSError as error:
            raise RunError(
                f"{directory.root} cannot be written: {reason_of(error)}",
                "a run folder that you may write to",
                "make the folder writable, or copy the folder to a place where you may write",
            ) from error
        try:
            _retry(_take, self._file)
        except (BlockingIOError, PermissionError):
            self._file.close()
            raise RunError(
                f"{directory.root} is being written by another process",
                "a run that no other process writes",
                "wait until the other process ends, or stop the other process",
            ) from None
        except BaseException:
            self._file.close()
            raise

    @property
    def is_lost(self) -> bool:
        """Whether another file stands at the path of the locked one, or none: another process may
        hold that file. Raises OSError if the run folder is gone."""
        folder = RunDirectory(self._directory.root)
        try:
            there = folder.stat(LOCK)
        except FileNotFoundError:
            os.stat(folder.root)
            return True
        return not os.path.samestat(os.fstat(self._file.fileno()), there)

    def check(self) -> None:
        """Raise `RunError` if the lock is lost, OSError if the run folder is gone."""
        if self.is_lost:
            raise RunError(
                f"{self._directory.root / LOCK} was removed or replaced while this process wrote "
                "the run",
                "the file that this process locked, so that no other process writes the run",
                "do not delete the file 'lock'; if no process writes the run now, continue the "
                f"run: evocity resume {self._directory.root}",
            )

    def release(self) -> None:
        with contextlib.suppress(OSError):
            self._file.close()


def is_held(path: Path) -> bool:
    """Return whether a process holds ``path`` locked; False where nothing can be read, or where the
    file system has no locks. Raises `RunError` for a file that is not plain."""
    try:
        file = RunDirectory(path.parent).open(path.name)
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
