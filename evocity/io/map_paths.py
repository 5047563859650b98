"""Paths of maps: files, folders that are maps, and addresses on the network."""

import os
import re
from pathlib import Path

#: Suffixes of maps that are folders.
FOLDERS = (".gdb",)

# An address; `Path` leaves one slash of the two.
_ADDRESS = re.compile(r"([A-Za-z][A-Za-z0-9+.-]{1,20}:)/{1,2}|/vsi[a-z0-9_]+/")


def network_address(text: str) -> str | None:
    """Return the address on the network that a ``text`` or path names; None for other texts."""
    if _ADDRESS.match(text) is None:
        return None
    return _ADDRESS.sub(lambda match: f"{match[1]}//" if match[1] else match[0], text, count=1)


def is_map_path(path: str | os.PathLike) -> bool:
    """Tell whether a ``path`` leads to a file, or to a folder that is a map."""
    path = Path(path)
    return path.is_file() or (path.is_dir() and path.suffix.lower() in FOLDERS)
