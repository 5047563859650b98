"""Merging of files into segments, and removal of files that a crash left."""

import contextlib
import json
from collections.abc import Iterator, Mapping
from itertools import pairwise

import pyarrow as pa

from evocity.errors import RunError
from evocity.files import whole_file
from evocity.store.checksums import open_sealed, write_sealed
from evocity.store.layout import BIRTHS, MEMBERSHIP, SPANS, Folder, Piece
from evocity.store.safe_open import read_json
from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN

KINDS = (BIRTHS, MEMBERSHIP)
#: Bytes of segments that are merged again, at most: copying more would hold the run up.
MOST_BYTES = 1 << 28


def write_single(table, path) -> None:
    """Write one generation as one row group; the file appears whole or not at all."""
    with whole_file(path) as temporary, write_sealed(temporary, table.schema) as writer:
        writer.write_table(table, row_group_size=max(len(table), 1))


def merge(folder: Folder) -> None:
    """Merge every full block of single files, then of segments, into a segment of the next of
    `SPANS` generations, and delete the merged files. A block of more than `MOST_BYTES` of segments
    stays.

    Memory holds one generation at a time. A crash at any point is harmless: readers prefer the
    longest segment, and the next call deletes the leftovers.
    """
    for kind in KINDS:
        for below, span in pairwise((1, *SPANS)):
            files = folder.files(kind)
            parts = {p.first: p for p in files if p.last - p.first + 1 == below}
            for first in sorted({part - part % span for part in parts}):
                block = [parts.get(g) for g in range(first, first + span, below)]
                target = folder.segment(kind, first, first + span - 1)
                if all(block) and not target.exists() and _fit(block):
                    _write_segment(block, target)
        whole = folder.pieces(kind)
        for piece in folder.files(kind):
            if piece not in whole:
                _remove(piece.path)


def _fit(block: list[Piece]) -> bool:
    if block[0].first == block[0].last:
        return True
    return sum(piece.path.stat().st_size for piece in block) <= MOST_BYTES


def drop_leftovers(folder: Folder, last: int) -> None:
    """Delete the generation that a crash cut short after ``last``, the last whole one, and
    unfinished files. If more generations follow, a file was lost: raises `RunError`, and deletes
    nothing."""
    beyond = {kind: [p for p in folder.files(kind) if p.last > last] for kind in KINDS}
    after = max((piece.last for pieces in beyond.values() for piece in pieces), default=last)
    if after > last + 1:
        lost = [
            folder.single(kind, last + 1).relative_to(folder.root)
            for kind in KINDS
            if folder.last_generation(kind) == last
        ]
        raise RunError(
            f"{folder.root}: {' and '.join(map(str, lost))} is missing, but later generations "
            f"up to {after} are there",
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
    with _damage_raised(block[0]), open_sealed(block[0].path) as file:
        schema = file.schema_arrow
    shared = schema.with_metadata({ABOUT_RUN: schema.metadata[ABOUT_RUN]})
    with whole_file(target) as temporary, write_sealed(temporary, shared) as writer:
        for piece in block:
            for table, about in _generations(piece):
                summaries |= about
                writer.write_table(table, row_group_size=max(len(table), 1))
        if summaries:
            writer.add_key_value_metadata({ABOUT_GENERATIONS: json.dumps(summaries)})


def _generations(piece: Piece) -> Iterator[tuple[pa.Table, dict]]:
    """The row groups of a file to be merged, with its summaries. Raises `RunError` if it is
    damaged: then nothing is merged."""
    with _damage_raised(piece), open_sealed(piece.path) as file:
        about = json.loads(file.metadata.metadata.get(ABOUT_GENERATIONS, b"{}"))
        if piece.first == piece.last:  # without rows it has no row group
            yield file.read(), about
            return
        if file.num_row_groups != piece.last - piece.first + 1:
            raise ValueError(f"{file.num_row_groups} generations")
        for group in range(file.num_row_groups):
            yield file.read_row_group(group), about


@contextlib.contextmanager
def _damage_raised(piece: Piece) -> Iterator[None]:
    try:
        yield
    except (ValueError, pa.ArrowException) as error:
        raise damage_error(piece.path, error) from error


def damage_error(path, error: Exception, remedy: str | None = None) -> RunError:
    """Make the error for a part of a run that was changed."""
    reason = "; ".join(map(str.strip, str(error).splitlines()[:3]))
    return RunError(
        f"{path} is damaged or not part of a run ({type(error).__name__}: {reason})",
        "a run folder as `evocity run` writes it",
        remedy
        or "bring the file back from a copy; or put it and the files after it aside, and breed "
        f"those generations again: evocity resume {path.parent.parent} --set-aside",
    )


def changed_error(path, provenance: Mapping, error: Exception) -> RunError:
    """Make the same error for a run that was opened with a ``provenance``; another one if the log
    was rewritten since then, which is no damage."""
    root = path.parent.parent
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RunError):
        if read_json(Folder(root).provenance)["header"] != provenance["header"]:
            return RunError(
                f"{root} has other measures than when it was opened",
                "a run that was opened after its log was rewritten",
                "open the run again: evocity.open_run(path)",
            )
    return damage_error(path, error)


def _remove(path) -> None:
    # A reader on Windows may hold the file open; a later merge deletes it.
    with contextlib.suppress(PermissionError):
        path.unlink(missing_ok=True)
