"""One process writes a run: a lock that the operating system frees when its holder dies."""

import contextlib
import os
from pathlib import Path

from evocity.errors import RunError
from evocity.store.parts import open_to_append

if os.name == "nt":
    import msvcrt

    def _take(file) -> None:
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)

else:
    import fcntl

    def _take(file) -> None:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


class Lock:
    """Holds ``path`` locked until `release`, or until the process ends, however it ends.

    Raises `RunError` if another process holds it.
    """

    def __init__(self, path: Path):
        self._file = open_to_append(path)
        try:
            _take(self._file)
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
