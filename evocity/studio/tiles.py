"""Small pictures of births, in the user's cache: the run folder stays as it is."""

import contextlib
import os
import secrets
import shutil
import struct
from pathlib import Path

import numpy as np

from evocity import __version__
from evocity.analysis.page import Page
from evocity.analysis.scores import cache_folder
from evocity.viewer.sheet import Sheet

#: Bytes of the pictures of all runs, at most; the runs that were unused longest go first.
MOST_KEPT = 500_000_000
# The head of a file: height and width, px. The head of a NumPy file takes longer to read than the
# picture.
_SHAPE = struct.Struct("<HH")
# The end of the name of each file of this release.
_SUFFIX = f"-{__version__}.rgb"


class Tiles:
    def __init__(self, fingerprint: str):
        below = cache_folder()
        self._folder = None if below is None else below.parent / "tiles" / fingerprint
        with contextlib.suppress(OSError):
            if self._folder is not None:
                self._folder.mkdir(parents=True, exist_ok=True)
                os.utime(self._folder)
                _remove_older(self._folder)
                _make_room(self._folder)

    def sheet(self, page: Page, ids: list[int], side: int) -> Sheet:
        """Return the pictures of those ``ids`` that are births of ``page``, in their order."""
        ids = page.table.known_ids(ids)
        if self._folder is None:
            return Sheet.of(*page.thumbnails.of(ids, side), kind="bmp")
        kept = {n: self._read(n, side) for n in ids}
        missing = [n for n, picture in kept.items() if picture is None]
        made, lacking = page.thumbnails.of(missing, side) if missing else ({}, {})
        for n, picture in made.items():
            self._write(n, side, picture)
        kept |= made
        pictures = {n: picture for n, picture in kept.items() if picture is not None}
        return Sheet.of(pictures, lacking, kind="bmp")

    def _file(self, identifier: int, side: int) -> Path:
        return self._folder / f"{identifier}-{side}{_SUFFIX}"

    def _read(self, identifier: int, side: int) -> np.ndarray | None:
        try:
            content = self._file(identifier, side).read_bytes()
            height, width = _SHAPE.unpack_from(content)
            pixels = np.frombuffer(content, np.uint8, offset=_SHAPE.size)
            picture = pixels.reshape(height, width, 3)
        except (OSError, ValueError, struct.error):  # the file is missing, or incomplete
            return None
        return picture if 0 < max(height, width) <= side and picture.size else None

    def _write(self, identifier: int, side: int, picture: np.ndarray) -> None:
        """Keep a picture; where it cannot be written, it is computed again later."""
        file = self._file(identifier, side)
        temporary = file.with_name(f".{secrets.token_hex(6)}.rgb")
        with contextlib.suppress(OSError):
            try:
                temporary.write_bytes(_SHAPE.pack(*picture.shape[:2]) + picture.tobytes())
                os.replace(temporary, file)
            finally:
                temporary.unlink(missing_ok=True)


def _remove_older(folder: Path) -> None:
    with os.scandir(folder) as entries:
        for entry in entries:
            if not entry.name.startswith(".") and not entry.name.endswith(_SUFFIX):
                os.unlink(entry.path)


def _make_room(kept: Path) -> None:
    """Remove pictures of other runs than ``kept``, the oldest first, beyond `MOST_KEPT` bytes."""
    with os.scandir(kept.parent) as entries:
        folders = [entry for entry in entries if entry.is_dir(follow_symlinks=False)]
    room = MOST_KEPT
    for folder in sorted(folders, key=lambda entry: -entry.stat().st_mtime):
        with os.scandir(folder) as entries:
            room -= sum(entry.stat(follow_symlinks=False).st_size for entry in entries)
        if room < 0 and folder.name != kept.name:
            shutil.rmtree(folder.path, ignore_errors=True)
