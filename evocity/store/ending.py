"""Where a run ends: its last generation whose files are what was written."""

import os
from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa

from evocity.store.bounds import read_through
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder, Piece, last_whole
from evocity.store.seals import opened


class Ending:
    """Tells where the run in a ``folder`` ends. Each file is looked at once, while it is the same.

    Raises OSError, and `RunError` for what is no part of a run.
    """

    def __init__(self, folder: Folder):
        self._folder = folder
        self._known: dict[tuple, bool] = {}

    @property
    def written(self) -> int:
        """The last generation that is written down without a gap before it, damaged or not; -1 if
        there is none."""
        return min(map(last_whole, self._pieces()))

    def _pieces(self) -> list[list[Piece]]:
        return [self._folder.pieces(kind) for kind in (BIRTHS, MEMBERSHIP)]

    def found(self, thorough: bool = False) -> tuple[int, tuple[Path, ...]]:
        """The last generation before any damage, and the files from there on. Looked at are the
        generations at the end; all, if ``thorough``."""
        kinds = self._pieces()
        pieces = [piece for kind in kinds for piece in kind]
        end = last = min(map(last_whole, kinds))
        looked: Sequence[Piece] = pieces if thorough else ()
        while True:
            at_end = [p for p in pieces if p.first <= last <= p.last]
            broken = [p.first for p in {*looked, *at_end} if not self._sound(p, thorough)]
            lower = min([one - 1 for one in broken if one <= last], default=last)
            if lower == last:
                break
            last, looked = lower, ()
        if last == end:
            return last, ()
        return last, tuple(piece.path for piece in pieces if piece.last > last)

    def _sound(self, piece: Piece, whole: bool) -> bool:
        """Whether a file, of several generations the last one, or the ``whole``, can be read."""
        try:
            about = os.stat(piece.path)
            key = (piece.path, about.st_size, about.st_mtime_ns, whole)
            if key not in self._known:
                self._known[key] = _reads(piece.path, whole)
            return self._known[key]
        except FileNotFoundError:  # merged in this moment
            return True


def _reads(path: Path, whole: bool) -> bool:
    try:
        with opened(path) as file:
            groups = range(file.num_row_groups)
            for group in groups if whole else groups[-1:]:
                read_through(file, group)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        return False
    return True


__all__ = ["Ending"]
