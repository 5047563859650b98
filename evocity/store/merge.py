"""Merging of files into segments, and removal of files that a crash left."""

import contextlib
import json
from collections.abc import Iterator, Mapping
from itertools import pairwise

import pyarrow as pa
import pyarrow.parquet as pq

from evocity.errors import RunError
from evocity.store.checksums import open_sealed, write_sealed
from evocity.store.label import Label, check_label, label_for
from evocity.store.layout import BIRTHS, MEMBERSHIP, SPANS, Folder, Piece
from evocity.store.run_directory import RunDirectory
from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN

KINDS = (BIRTHS, MEMBERSHIP)
#: Bytes of segments that are merged again, at most: copying more would hold the run up.
MOST_BYTES = 1 << 28


def write_single(directory: RunDirectory, table, path, chain: str | None = None) -> None:
    """Write one generation as one row group; the file appears whole or not at all. ``chain``: the
    checksum of the last event before it."""
    about = label_for(path, chain)
    with directory.write(path) as file, write_sealed(file, table.schema, about) as writer:
        writer.write_table(table, row_group_size=max(len(table), 1))


def merge(folder: Folder) -> None:
    """Merge every full block of single files, then of segments of at most `MOST_BYTES`, into a
    segment of the next of `SPANS` generations, and delete the merged files.

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
                if all(block) and not folder.directory.exists(target) and _fit(folder, block):
                    _write_segment(folder.directory, block, target)
        whole = folder.pieces(kind)
        for piece in folder.files(kind):
            if piece not in whole:
                _remove(folder, piece.path)


def _fit(folder: Folder, block: list[Piece]) -> bool:
    if block[0].first == block[0].last:
        return True
    return sum(folder.directory.stat(piece.path).st_size for piece in block) <= MOST_BYTES


def drop_leftovers(folder: Folder, last: int) -> None:
    """Delete unfinished files, and the generation that a crash cut short after ``last``, the last
    whole one. Raises `RunError`, and deletes nothing, if more generations follow."""
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
            f"up to {after} exist",
            "files with the births and the living individuals of every generation",
            "restore the missing file from a backup; or set the later files aside, and breed their "
            f"generations again: evocity resume {folder.root} --set-aside",
        )
    for pieces in beyond.values():
        for piece in pieces:
            if piece.first > last:
                _remove(folder, piece.path)
    for path in folder.unfinished():
        _remove(folder, path)


def _write_segment(directory: RunDirectory, block: list[Piece], target) -> None:
    summaries: dict = {}
    with _opened(directory, block[0]) as (file, _):
        schema = file.schema_arrow
    with _opened(directory, block[-1]) as (_, label):
        about = label_for(target, None if label is None else label.chain)
    shared = schema.with_metadata({ABOUT_RUN: schema.metadata[ABOUT_RUN]})
    with directory.write(target) as file, write_sealed(file, shared, about) as writer:
        for piece in block:
            for table, more in generations_in(directory, piece):
                summaries |= more
                writer.write_table(table, row_group_size=max(len(table), 1))
        if summaries:
            writer.add_key_value_metadata(
                {ABOUT_GENERATIONS: json.dumps(summaries, separators=(",", ":"))}
            )


def generations_in(directory: RunDirectory, piece: Piece) -> Iterator[tuple[pa.Table, dict]]:
    """Read the generations of a file in turn, each with all summaries of the file. Raises
    `RunError` if the file is damaged."""
    with _opened(directory, piece) as (file, _):
        about = json.loads(file.metadata.metadata.get(ABOUT_GENERATIONS, b"{}"))
        if piece.first == piece.last:  # without rows it has no row group
            yield file.read(), about
            return
        if file.num_row_groups != piece.last - piece.first + 1:
            raise ValueError(f"{file.num_row_groups} generations")
        for group in range(file.num_row_groups):
            yield file.read_row_group(group), about


@contextlib.contextmanager
def _opened(directory: RunDirectory, piece: Piece) -> Iterator[tuple[pq.ParquetFile, Label | None]]:
    try:
        with directory.open(piece.path) as file, open_sealed(file) as opened:
            yield opened, check_label(file, piece)
    except (ValueError, pa.ArrowException) as error:
        raise damage_error(piece.path, error) from error


def damage_error(path, error: Exception, remedy: str | None = None) -> RunError:
    """Make the error for a part of a run that was changed."""
    reason = "; ".join(map(str.strip, str(error).splitlines()[:3]))
    return RunError(
        f"{path} is damaged or not part of a run ({type(error).__name__}: {reason})",
        "a run folder as `evocity run` writes it",
        remedy
        or "restore the file from a backup; or set the damaged files aside, so that the run breeds "
        f"their generations again: evocity resume {path.parent.parent} --set-aside",
    )


def changed_error(path, provenance: Mapping, error: Exception) -> RunError:
    """Make the same error for a run that was opened with a ``provenance``; another one if the log
    was rewritten since then, which is no damage."""
    root = path.parent.parent
    with contextlib.suppress(OSError, ValueError, LookupError, TypeError, RunError):
        folder = Folder(root)
        if folder.directory.read_json(folder.provenance)["header"] != provenance["header"]:
            return RunError(
                f"the measures of {root} have changed since the run was opened",
                "a run that was opened after its last change",
                "open the run again: evocity.open_run(path)",
            )
    return damage_error(path, error)


def _remove(folder: Folder, path) -> None:
    # A reader on Windows may hold the file open; a later merge deletes it.
    with contextlib.suppress(PermissionError):
        folder.directory.remove(path)
