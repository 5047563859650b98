"""Safe access to the parts of a run folder: only plain files and folders, never through a link.

A stranger's folder may hold links to other places, pipes that never answer, endless devices. All
functions raise `RunError` for those, FileNotFoundError for a missing part.
"""

import os
import stat
from pathlib import Path
from typing import BinaryIO

from pydantic_core import from_json

from evocity.errors import RunError

#: Bytes of a text, JSON or event file of a run, at most.
MOST_BYTES = 64 * 2**20

_SAFELY = sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_CLOEXEC", "O_BINARY")
)


def plain_file(path: Path) -> Path:
    """Return ``path`` if it is a plain file."""
    return _plain(path, stat.S_ISREG, "file")


def plain_folder(path: Path) -> Path:
    """Return ``path`` if it is a plain folder."""
    return _plain(path, stat.S_ISDIR, "folder")


def open_to_append(path: Path) -> BinaryIO:
    """Open a plain file to read and append; create it if it is missing."""
    if os.path.lexists(path):
        plain_file(path)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | _SAFELY, 0o666)
    return os.fdopen(handle, "ab+")


def open_to_read(path: Path) -> BinaryIO:
    """Open a plain file to read."""
    plain_file(path)
    return os.fdopen(os.open(path, os.O_RDONLY | _SAFELY), "rb")


def read_bytes(path: Path) -> bytes:
    """Return all bytes of a plain file of at most `MOST_BYTES`."""
    with open_to_read(path) as file:
        content = file.read(MOST_BYTES + 1)
    if len(content) > MOST_BYTES:
        raise RunError(
            f"{path} has more than {MOST_BYTES // 2**20} MiB",
            "a run folder as `evocity run` writes it",
            "bring the file back from a copy",
        )
    return content


def read_json(path: Path):
    """Return the JSON document in a plain file. Raises ValueError, also for one nested too deep."""
    return from_json(read_bytes(path))


def _plain(path: Path, is_kind, kind: str) -> Path:
    mode = os.lstat(path).st_mode
    if not is_kind(mode):
        what = "a link" if stat.S_ISLNK(mode) else f"not a plain {kind}"
        raise RunError(
            f"{path} is {what}",
            "only plain files and folders: evocity touches nothing outside a run folder",
            "do not trust a stranger's folder with links; in your own, replace links by copies",
        )
    return path
