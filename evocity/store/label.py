"""Labels of files of births and membership: the kind and the generations that a file holds.

The label stands in the file's footer, and readers compare it with the file's name. The label of a
membership file also has the checksum of the last event before its last generation, see
`evocity.store.event_chain`. Files of older releases have no label.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from evocity.store.checksums import footer_value
from evocity.store.layout import Piece, piece_at

#: The key of a label in a footer.
LABEL = "evocity.label"


@dataclass(frozen=True)
class Label:
    """What a file of this ``kind`` states: its ``first`` and ``last`` generation. ``chain``: the
    checksum of an event, None without."""

    kind: str
    first: int
    last: int
    chain: str | None = None

    def __str__(self) -> str:
        chain = "" if self.chain is None else f" {self.chain}"
        return f"{self.kind} {self.first} {self.last}{chain}"


def label_for(path: Path, chain: str | None = None) -> dict[str, str]:
    """Return the entry of a footer for the file at ``path``; nothing for another name."""
    piece = piece_at(path)
    if piece is None:
        return {}
    return {LABEL: str(Label(path.parent.name, piece.first, piece.last, chain))}


def read_label(file: BinaryIO) -> Label | None:
    """Return the label of an open ``file``; None without one. Raises ValueError for another."""
    text = footer_value(file, LABEL.encode())
    if text is None:
        return None
    words = text.decode("ascii").split(" ")
    if len(words) not in (3, 4):
        raise ValueError(f"its label is {text!r}")
    return Label(words[0], int(words[1]), int(words[2]), *words[3:])


def check_label(file: BinaryIO, piece: Piece) -> Label | None:
    """Return the label of an open ``file``. Raises ValueError if its name is that of another
    ``piece``."""
    label = read_label(file)
    if label is not None:
        stated, named = label.kind, piece.path.parent.name
        if (stated, label.first, label.last) != (named, piece.first, piece.last):
            raise ValueError(
                f"it holds {stated} of {_spell(label)}, and its name says {named} of "
                f"{_spell(piece)}"
            )
    return label


def _spell(one: Label | Piece) -> str:
    if one.first == one.last:
        return f"generation {one.first}"
    return f"generations {one.first} to {one.last}"
