"""Paths of a run folder, and the generations that each file holds."""

import contextlib
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evocity.store.run_directory import FILE, FOLDER, RunDirectory

#: Single generations that are merged into a segment.
SEGMENT = 64
#: Generations of a short and of a long segment: 10 000 generations are 89 files at most.
SPANS = (SEGMENT, 8 * SEGMENT)

BIRTHS, MEMBERSHIP = "births", "membership"
RECIPE = "recipe.toml"
#: Prefix of the folder of a rewritten log; the hash of a recipe follows.
REWRITTEN = ".measures-"

# What a run may have at its top; other files there are the user's own.
_FILES = re.compile(
    r"recipe(?:-\d+)?\.toml|provenance\.json|(?:events|commands)\.jsonl|lock|report\.html"
    r"|picks\.json",
    re.ASCII,
)
_FOLDERS = (BIRTHS, MEMBERSHIP, "sources", "references", "within", "fitness", "damaged")

_HASH = re.compile(r"[0-9a-f]{32}", re.ASCII)

_NAME = re.compile(r"(?:generation-(\d{8})|segment-(\d{8})-(\d{8}))\.parquet", re.ASCII)

# The temporary names that `RunDirectory.write` gives to the parts of a run.
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


def piece_at(path: Path) -> Piece | None:
    """Return the generations of the file at ``path`` by its name; None for another name."""
    match = _NAME.fullmatch(path.name)
    if match is None:
        return None
    single, first, last = match.groups()
    return Piece(int(single or first), int(single or last), path)


class Folder:
    """Paths of a run folder, and the ``directory`` that reads and writes them.

    ``root``: its path, or the `RunDirectory` itself. ``recipe_hash``: of the births' header, for
    which the log may have been rewritten, see `evocity.store.rewrite`.
    """

    def __init__(self, root, recipe_hash: str | None = None):
        self.directory = root if isinstance(root, RunDirectory) else RunDirectory(root)
        self.root = self.directory.root
        known = recipe_hash is not None and _HASH.fullmatch(recipe_hash)
        self.rewritten = self.root / f"{REWRITTEN}{recipe_hash}" if known else None
        self.recipe = self.root / RECIPE
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
        if self.rewritten is not None and self.directory.exists(self.rewritten / kind):
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
        pieces, place = [], self.place(kind)
        for name, what in self.directory.entries(place).items():
            piece = piece_at(place / name)
            if piece is None:
                continue
            if what != FILE:
                with contextlib.suppress(FileNotFoundError):  # merged in this moment
                    self.directory.check_file(place / name)
                continue
            span = piece.last - piece.first + 1
            if span == 1 or (span in SPANS and piece.first % span == 0):
                pieces.append(piece)
        return sorted(pieces)

    def unfinished(self) -> list[Path]:
        """Return the files that a crash left before they were whole."""
        places = (self.root, *(self.place(kind) for kind in (BIRTHS, MEMBERSHIP)))
        return [
            place / name
            for place in places
            for name in self.directory.entries(place)
            if is_unfinished(place / name)
        ]

    def check_parts(self) -> None:
        """Raise `RunError` if a part that a run may have is not a plain file or folder, or if the
        events or the lock have a second name: a writer refuses them before it writes anything."""
        directory = self.directory
        for name in directory.entries():
            if _FILES.fullmatch(name):
                directory.check_replaceable(name)
            elif name in _FOLDERS or name.startswith(REWRITTEN):
                self._check_folder(name)
        for path in (self.events, self.lock):
            directory.check_appendable(path)
        for kind in (BIRTHS, MEMBERSHIP):
            with contextlib.suppress(FileNotFoundError):
                self.files(kind)

    def _check_folder(self, name: str) -> None:
        """Check all that is in a folder; in births and membership only the folder."""
        self.directory.check_folder(name)
        for inner, kind in (
            {} if name in (BIRTHS, MEMBERSHIP) else self.directory.entries(name).items()
        ):
            if kind == FOLDER:
                self._check_folder(f"{name}/{inner}")
            else:
                self.directory.check_replaceable(f"{name}/{inner}")

    def pieces(self, kind: str) -> list[Piece]:
        """Return the files that together hold each generation once, in order. A segment goes before
        the files it was merged from, which a crash may have left."""
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
