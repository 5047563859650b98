"""Where things lie in a run folder, and which file holds which generation."""

import re
from dataclasses import dataclass
from pathlib import Path

#: Generations of single files that are merged into one segment.
SEGMENT = 64

BIRTHS, MEMBERSHIP = "births", "membership"

_NAME = re.compile(r"(?:generation-(\d{8})|segment-(\d{8})-(\d{8}))\.parquet")


@dataclass(frozen=True, order=True)
class Piece:
    """A Parquet file with the generations ``first`` to ``last``, one row group each."""

    first: int
    last: int
    path: Path


class Folder:
    """Paths of the parts of the run folder ``root``."""

    def __init__(self, root):
        self.root = Path(root)
        self.recipe = self.root / "recipe.toml"
        self.provenance = self.root / "provenance.json"
        self.sources = self.root / "sources"
        self.events = self.root / "events.jsonl"
        self.lock = self.root / "lock"

    def single(self, kind: str, generation: int) -> Path:
        return self.root / kind / f"generation-{generation:08d}.parquet"

    def segment(self, kind: str, first: int, last: int) -> Path:
        return self.root / kind / f"segment-{first:08d}-{last:08d}.parquet"

    def files(self, kind: str) -> list[Piece]:
        """All whole Parquet files of ``kind``, overlapping ones too."""
        found = []
        for path in (self.root / kind).iterdir():
            if match := _NAME.fullmatch(path.name):
                single, first, last = match.groups()
                found.append(Piece(int(single or first or 0), int(single or last or 0), path))
        return sorted(found)

    def pieces(self, kind: str) -> list[Piece]:
        """Files that together hold each generation once, in order.

        A segment goes before the single files it was merged from, which a crash may have left.
        """
        chosen: list[Piece] = []
        for piece in sorted(self.files(kind), key=lambda p: (p.first, -p.last)):
            if not chosen or piece.first > chosen[-1].last:
                chosen.append(piece)
        return chosen

    def last_generation(self, kind: str) -> int:
        """Highest generation g such that ``kind`` holds 0…g without a gap; -1 if none."""
        last = -1
        for piece in self.pieces(kind):
            if piece.first != last + 1:
                break
            last = piece.last
        return last
