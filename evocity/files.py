"""Files that appear whole or not at all, and temporary folders of one process."""

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
except ImportError:  # Windows: what a killed process left stays there
    fcntl = None

# A folder that nobody holds is just being made unless it is older, in seconds.
_JUST_MADE = 10.0


@contextmanager
def whole_file(path: str | os.PathLike) -> Iterator[Path]:
    """Yield a temporary path beside ``path``; on success flush it and rename it into place.

    If the block raises, the temporary file is removed and ``path`` is as it was. The
    temporary name starts with a dot and keeps the suffix, so that writers which choose a
    format by it still do. A link is followed. Raises `FileExistsError` where ``path`` is a folder,
    a device or a pipe: to rename over one would put a file in its place.
    """
    path = Path(path).resolve()
    if path.exists() and not path.is_file():
        raise FileExistsError(errno.EEXIST, "there is something else than a file", str(path))
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
    """Make a rename in ``folder`` survive a power cut, where the system lets folders be flushed."""
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


class OwnFolder:
    """A temporary folder, called ``prefix`` and something more, that this process holds until it
    ends. Those of the same prefix that killed processes left are removed first.

    path : where it is. Raises OSError where none can be made.
    """

    def __init__(self, prefix: str):
        _remove_left(prefix)
        self.path = Path(tempfile.mkdtemp(prefix=prefix))
        self._held: int | None = None
        if fcntl:
            self._held = os.open(self.path, os.O_RDONLY)
            with contextlib.suppress(OSError):  # a file system without locks: nobody removes it
                fcntl.flock(self._held, fcntl.LOCK_EX | fcntl.LOCK_NB)

    def let_go(self) -> None:
        """Hold it no more: in a forked process, which shares what its parent holds."""
        if self._held is not None:
            os.close(self._held)
            self._held = None

    def remove(self) -> None:
        """Remove it, with all that is in it."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.let_go()


def _remove_left(prefix: str) -> None:
    if fcntl is None:
        return
    place = tempfile.gettempdir()
    for name in os.listdir(place):
        if not name.startswith(prefix):
            continue
        with contextlib.suppress(OSError):
            folder = os.path.join(place, name)
            held = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
            try:
                told = os.fstat(held)
                if told.st_uid == os.getuid() and time.time() - told.st_mtime > _JUST_MADE:
                    fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(held)
