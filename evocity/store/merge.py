"""Merging the files of single generations into segments, and clearing what a crash left."""

import contextlib
import json

import pyarrow as pa

from evocity.errors import RunError
from evocity.files import whole_file
from evocity.store.layout import BIRTHS, MEMBERSHIP, SEGMENT, Folder, Piece
from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN
from evocity.store.seals import opened, sealed

KINDS = (BIRTHS, MEMBERSHIP)


def write_single(table, path) -> None:
    """Write one generation as one row group; the file appears whole or not at all."""
    with whole_file(path) as temporary, sealed(temporary, table.schema) as writer:
        writer.write_table(table, row_group_size=max(len(table), 1))


def merge(folder: Folder) -> None:
    """Merge every full block of `SEGMENT` generations, then delete the merged files.

    Streams one generation at a time, so that memory does not grow with the segment. A crash
    at any point is harmless: readers prefer segments, and the next call deletes the leftovers.
    """
    for kind in KINDS:
        singles = {p.first: p for p in folder.files(kind) if p.path.name.startswith("generation-")}
        for first in sorted({g - g % SEGMENT for g in singles}):
            block = [singles.get(g) for g in range(first, first + SEGMENT)]
            target = folder.segment(kind, first, first + SEGMENT - 1)
            if all(block) and not target.exists():
                _write_segment(block, target)
            if target.exists():
                for piece in filter(None, block):
                    _remove(piece.path)


def drop_leftovers(folder: Folder, last: int) -> None:
    """Delete the generation a crash cut short after ``last``, the last whole one, and files
    never finished.

    A crash leaves one such generation at most. Raises `RunError`, and deletes nothing, if more
    follows: then a file was lost, and what is behind it is worth keeping.
    """
    beyond = {kind: [p for p in folder.files(kind) if p.last > last] for kind in KINDS}
    after = max((piece.last for pieces in beyond.values() for piece in pieces), default=last)
    if after > last + 1:
        lost = [
            folder.single(kind, last + 1).relative_to(folder.root)
            for kind in KINDS
            if folder.last_generation(kind) == last
        ]
        raise RunError(
            f"{folder.root}: {' and '.join(map(str, lost))} is missing, but generations up to "
            f"{after} follow",
            "the births and the membership of every generation, without a gap",
            "bring the file back from a copy; to breed those generations again instead, take "
            "the later files out of births/ and membership/",
        )
    for pieces in beyond.values():
        for piece in pieces:
            if piece.first > last:
                _remove(piece.path)
    for path in folder.unfinished():
        _remove(path)


def _write_segment(block: list[Piece], target) -> None:
    summaries: dict = {}
    schema = _read(block[0]).schema
    shared = schema.with_metadata({ABOUT_RUN: schema.metadata[ABOUT_RUN]})
    with whole_file(target) as temporary, sealed(temporary, shared) as writer:
        for piece in block:
            table = _read(piece)
            summaries |= json.loads(table.schema.metadata.get(ABOUT_GENERATIONS, "{}"))
            writer.write_table(table, row_group_size=max(len(table), 1))
        if summaries:
            writer.add_key_value_metadata({ABOUT_GENERATIONS: json.dumps(summaries)})


def _read(piece: Piece) -> pa.Table:
    """A file that is to be merged. Raises `RunError` if it is damaged: nothing is merged then."""
    try:
        with opened(piece.path) as file:
            return file.read()
    except (ValueError, pa.ArrowException) as error:
        raise damaged(piece.path, error) from error


def damaged(path, error: Exception) -> RunError:
    """What is told of a file of births or membership that is not what was written."""
    reason = "; ".join(map(str.strip, str(error).splitlines()[:3]))
    return RunError(
        f"{path} is damaged or not part of a run ({type(error).__name__}: {reason})",
        "a run folder as `evocity run` writes it",
        "bring the file back from a copy; or put it aside, and what follows it, and breed that "
        f"again: evocity resume {path.parent.parent} --set-aside",
    )


def _remove(path) -> None:
    # A reader on Windows may hold the file open; a later merge deletes it.
    with contextlib.suppress(PermissionError):
        path.unlink(missing_ok=True)
