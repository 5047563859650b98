"""Small pictures of births, kept in the user's cache: a run that is looked at is only read."""

import contextlib
import os
import secrets
import shutil
import struct
from pathlib import Path

import numpy as np

from evocity import __version__
from evocity.analysis.scoring import cache_folder
from evocity.analysis.viewed import Viewed
from evocity.viewer.sheet import Sheet

#: Bytes that the pictures of all runs may take; those of runs that nobody looked at for longest
#: go first.
MOST_KEPT = 500_000_000
# Before the bytes of a picture: its height and width, px. numpy's header takes longer to read than
# the picture.
_SHAPE = struct.Struct("<HH")
# How files of this release end.
_KIND = f"-{__version__}.rgb"


class Tiles:
    """Small pictures of the run ``called`` so, whatever happens to be known of it now."""

    def __init__(self, called: str):
        below = cache_folder()
        self._folder = None if below is None else below.parent / "tiles" / called
        with contextlib.suppress(OSError):
            if self._folder is not None:
                self._folder.mkdir(parents=True, exist_ok=True)
                os.utime(self._folder)
                _remove_older(self._folder)
                _make_room(self._folder)

    def sheet(self, viewed: Viewed, ids: list[int], side: int) -> Sheet:
        """Those of the births ``ids``, each among them that is ``viewed``, in their order."""
        ids = viewed.table.among(ids)
        found = {one: self._kept(one, side) for one in ids}
        missing = [one for one, picture in found.items() if picture is None]
        made, lacking = viewed.thumbnails.of(missing, side) if missing else ({}, {})
        for one, picture in made.items():
            self._keep(one, side, picture)
        found |= made
        return Sheet.of(
            {n: one for n, one in found.items() if one is not None}, lacking, packed=False
        )

    def _file(self, one: int, side: int) -> Path | None:
        return None if self._folder is None else self._folder / f"{one}-{side}{_KIND}"

    def _kept(self, one: int, side: int) -> np.ndarray | None:
        file = self._file(one, side)
        if file is None:
            return None
        try:
            told = file.read_bytes()
            height, width = _SHAPE.unpack_from(told)
            found = np.frombuffer(told, np.uint8, offset=_SHAPE.size).reshape(height, width, 3)
        except (OSError, ValueError, struct.error):  # it is not there, or not whole
            return None
        return found if 0 < max(height, width) <= side and found.size else None

    def _keep(self, one: int, side: int, picture: np.ndarray) -> None:
        """Nothing is lost but time where that cannot be."""
        file = self._file(one, side)
        if file is None:
            return
        temporary = file.with_name(f".{secrets.token_hex(6)}.rgb")
        with contextlib.suppress(OSError):
            try:
                temporary.write_bytes(_SHAPE.pack(*picture.shape[:2]) + picture.tobytes())
                os.replace(temporary, file)
            finally:
                temporary.unlink(missing_ok=True)


def _remove_older(folder: Path) -> None:
    """Remove the pictures that other releases kept."""
    with os.scandir(folder) as listed:
        for one in listed:
            if not one.name.startswith(".") and not one.name.endswith(_KIND):
                os.unlink(one.path)


def _make_room(own: Path) -> None:
    """Remove the pictures of other runs than ``own``, the oldest first, until those that are left
    take no more than they may."""
    with os.scandir(own.parent) as listed:
        folders = [one for one in listed if one.is_dir(follow_symlinks=False)]
    newest = sorted(folders, key=lambda one: -one.stat().st_mtime)
    room = MOST_KEPT
    for folder in newest:
        with os.scandir(folder) as listed:
            room -= sum(one.stat(follow_symlinks=False).st_size for one in listed)
        if room < 0 and folder.name != own.name:
            shutil.rmtree(folder.path, ignore_errors=True)


__all__ = ["MOST_KEPT", "Tiles"]
