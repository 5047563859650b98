"""The parts of a run folder, opened safely: plain files and folders alone, never through a link.

A stranger's folder may hold links to files outside, pipes that never answer, devices without
an end. All functions raise `RunError` for those, FileNotFoundError for what is not there.
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
    """``path``, if a plain file is there."""
    return _plain(path, stat.S_ISREG, "file")


def plain_folder(path: Path) -> Path:
    """``path``, if a plain folder is there."""
    return _plain(path, stat.S_ISDIR, "folder")


def open_to_append(path: Path) -> BinaryIO:
    """A plain file opened to read and append; made if nothing is there."""
    if os.path.lexists(path):
        plain_file(path)
    handle = os.open(path, os.O_RDWR | os.O_CREAT | os.O_APPEND | _SAFELY, 0o666)
    return os.fdopen(handle, "ab+")


def open_to_read(path: Path) -> BinaryIO:
    """A plain file opened to read."""
    plain_file(path)
    return os.fdopen(os.open(path, os.O_RDONLY | _SAFELY), "rb")


def read_bytes(path: Path) -> bytes:
    """All bytes of a plain file of `MOST_BYTES` or fewer."""
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
    """The JSON document in a plain file. Raises ValueError, for one nested too deep as well."""
    return from_json(read_bytes(path))


def _plain(path: Path, is_kind, kind: str) -> Path:
    mode = os.lstat(path).st_mode
    if not is_kind(mode):
        found = "a link" if stat.S_ISLNK(mode) else f"no plain {kind}"
        raise RunError(
            f"{path} is {found}",
            "plain files and folders alone inside a run folder: what lies outside is not touched",
            "do not trust a stranger's folder with links in it; in your own, put a copy in the "
            "place of the link",
        )
    return path
