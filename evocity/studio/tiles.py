"""Small pictures of births, kept in the user's cache: a run that is looked at is only read."""

import contextlib
import io
import os
import secrets
import shutil
from pathlib import Path

import numpy as np

from evocity import __version__
from evocity.analysis.scoring import cache_folder
from evocity.analysis.viewed import Viewed
from evocity.viewer.sheet import Sheet

#: Bytes that the pictures of all runs may take; those of runs that nobody looked at for longest
#: go first.
MOST_KEPT = 500_000_000


class Tiles:
    """Small pictures of the run ``called`` so, whatever happens to be known of it now."""

    def __init__(self, called: str):
        below = cache_folder()
        self._folder = None if below is None else below.parent / "tiles" / called
        with contextlib.suppress(OSError):
            if self._folder is not None:
                self._folder.mkdir(parents=True, exist_ok=True)
                os.utime(self._folder)
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
        return Sheet.of({n: one for n, one in found.items() if one is not None}, lacking, packed=0)

    def _file(self, one: int, side: int) -> Path | None:
        return None if self._folder is None else self._folder / f"{one}-{side}-{__version__}.npy"

    def _kept(self, one: int, side: int) -> np.ndarray | None:
        file = self._file(one, side)
        if file is None:
            return None
        try:
            found = np.load(io.BytesIO(file.read_bytes()), allow_pickle=False)
        except (OSError, ValueError, EOFError, SyntaxError):  # it is not there, or not whole
            return None
        right = found.dtype == np.uint8 and found.ndim == 3 and found.shape[2] == 3
        return found if right and found.size and max(found.shape[:2]) <= side else None

    def _keep(self, one: int, side: int, picture: np.ndarray) -> None:
        """Nothing is lost but time where that cannot be."""
        file = self._file(one, side)
        if file is None:
            return
        temporary = file.with_name(f".{secrets.token_hex(6)}.npy")
        with contextlib.suppress(OSError):
            try:
                np.save(temporary, picture)
                os.replace(temporary, file)
            finally:
                temporary.unlink(missing_ok=True)


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
