"""Paths of a run folder, and the generations that each file holds."""

import contextlib
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evocity.store.safe_open import plain_file, plain_folder

#: Single generations that are merged into a segment.
SEGMENT = 64
#: Generations of a short and of a long segment: 10 000 generations are 89 files at most.
SPANS = (SEGMENT, 8 * SEGMENT)

BIRTHS, MEMBERSHIP = "births", "membership"
#: Prefix of the folder of a rewritten log; the hash of a recipe follows.
REWRITTEN = ".measures-"

_HASH = re.compile(r"[0-9a-f]{32}", re.ASCII)

_NAME = re.compile(r"(?:generation-(\d{8})|segment-(\d{8})-(\d{8}))\.parquet", re.ASCII)

# The temporary names that `evocity.files.whole_file` gives to the parts of a run.
_UNFINISHED = re.compile(
    r"\.(?:(?:generation-\d{8}|segment-\d{8}-\d{8})-[0-9a-f]{8}\.parquet"
    r"|recipe(?:-\d+)?-[0-9a-f]{8}\.toml|provenance-[0-9a-f]{8}\.json|report-[0-9a-f]{8}\.html"
    r"|picks-[0-9a-f]{8}\.json)",
    re.ASCII,
)


def is_unfinished(path: Path) -> bool:
    """Return whether ``path`` has the temporary name of a part of a run."""
    return _UNFINISHED.fullmatch(path.name) is not None


@dataclass(frozen=True, order=True)
class Piece:
    """A Parquet file with the generations ``first`` to ``last``, one row group each."""

    first: int
    last: int
    path: Path


class Folder:
    """Paths of the run folder ``root``. ``recipe_hash``: of the births' header, for which the log
    may have been rewritten, see `evocity.store.rewrite`."""

    def __init__(self, root, recipe_hash: str | None = None):
        self.root = Path(root)
        known = recipe_hash is not None and _HASH.fullmatch(recipe_hash)
        self.rewritten = self.root / f"{REWRITTEN}{recipe_hash}" if known else None
        self.recipe = self.root / "recipe.toml"
        self.provenance = self.root / "provenance.json"
        self.sources = self.root / "sources"
        self.locked = self.sources / "locked.npy"
        self.references = self.root / "references"
        self.within = self.root / "within"
        self.events = self.root / "events.jsonl"
        self.commands = self.root / "commands.jsonl"
        self.lock = self.root / "lock"
        self.damaged = self.root / "damaged"

    def place(self, kind: str) -> Path:
        """Return the folder of the files of a ``kind``: that of the rewritten log, until they are
        moved from there. Raises `RunError` if that is a link."""
        if self.rewritten is not None and os.path.lexists(self.rewritten):
            with contextlib.suppress(FileNotFoundError):  # moved in this moment
                if os.path.lexists(plain_folder(self.rewritten) / kind):
                    return self.rewritten / kind
        return self.root / kind

    def single(self, kind: str, generation: int) -> Path:
        """Return the path of a single generation."""
        return self.place(kind) / f"generation-{generation:08d}.parquet"

    def segment(self, kind: str, first: int, last: int) -> Path:
        """Return the path of several generations."""
        return self.place(kind) / f"segment-{first:08d}-{last:08d}.parquet"

    def files(self, kind: str) -> list[Piece]:
        """Return all whole Parquet files of ``kind``, overlapping ones too. Raises `RunError` for a
        link, and other files that are not plain."""
        pieces = []
        with os.scandir(plain_folder(self.place(kind))) as entries:
            for entry in entries:
                match = _NAME.fullmatch(entry.name)
                if not match:
                    continue
                if not entry.is_file(follow_symlinks=False):
                    with contextlib.suppress(FileNotFoundError):  # merged in this moment
                        plain_file(Path(entry.path))
                    continue
                single, first, last = match.groups()
                piece = Piece(int(single or first), int(single or last), Path(entry.path))
                span = piece.last - piece.first + 1
                if single or (span in SPANS and piece.first % span == 0):
                    pieces.append(piece)
        return sorted(pieces)

    def unfinished(self) -> list[Path]:
        """Return the files that a crash left before they were whole."""
        places = (self.root, *(plain_folder(self.place(kind)) for kind in (BIRTHS, MEMBERSHIP)))
        return [
            path
            for place in places
            for path in place.iterdir()  # a run itself may be reached through a link
            if is_unfinished(path)
        ]

    def pieces(self, kind: str) -> list[Piece]:
        """Return the files that together hold each generation once, in order.

        A segment goes before the files it was merged from, which a crash may have left.
        """
        chosen: list[Piece] = []
        for piece in sorted(self.files(kind), key=lambda p: (p.first, -p.last)):
            if not chosen or piece.first > chosen[-1].last:
                chosen.append(piece)
        return chosen

    def last_generation(self, kind: str) -> int:
        """Return the highest g such that ``kind`` holds 0…g without a gap; -1 if none."""
        return last_whole(self.pieces(kind))


def last_whole(pieces: Sequence[Piece]) -> int:
    """Return the highest g such that ``pieces``, in order, hold 0…g without a gap; -1 if none."""
    last = -1
    for piece in pieces:
        if piece.first != last + 1:
            break
        last = piece.last
    return last
