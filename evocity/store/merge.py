"""Merging the files of single generations into segments, and clearing what a crash left."""

import contextlib
import json

import pyarrow.parquet as pq

from evocity.files import whole_file
from evocity.store.layout import BIRTHS, MEMBERSHIP, SEGMENT, Folder, Piece
from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN

#: How every Parquet file of a run is written.
COMPRESSION = {"compression": "zstd", "compression_level": 3, "use_dictionary": True}


def write_single(table, path) -> None:
    """Write one generation as one row group; the file appears whole or not at all."""
    with whole_file(path) as temporary:
        pq.write_table(table, temporary, row_group_size=max(len(table), 1), **COMPRESSION)


def merge(folder: Folder) -> None:
    """Merge every full block of `SEGMENT` generations, then delete the merged files.

    Streams one generation at a time, so that memory does not grow with the segment. A crash
    at any point is harmless: readers prefer segments, and the next call deletes the leftovers.
    """
    for kind in (BIRTHS, MEMBERSHIP):
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
    """Delete what lies beyond the last whole generation, and files never finished."""
    for kind in (BIRTHS, MEMBERSHIP):
        for piece in folder.files(kind):
            if piece.first > last:
                _remove(piece.path)
    for place in (folder.root, folder.root / BIRTHS, folder.root / MEMBERSHIP):
        for path in place.glob(".*-????????.*"):
            _remove(path)


def _write_segment(block: list[Piece], target) -> None:
    summaries: dict = {}
    with whole_file(target) as temporary:
        writer = None
        try:
            for piece in block:
                with pq.ParquetFile(piece.path) as file:
                    table = file.read()
                metadata = table.schema.metadata
                summaries |= json.loads(metadata.get(ABOUT_GENERATIONS, "{}"))
                if writer is None:
                    shared = table.schema.with_metadata({ABOUT_RUN: metadata[ABOUT_RUN]})
                    writer = pq.ParquetWriter(temporary, shared, **COMPRESSION)
                writer.write_table(table, row_group_size=max(len(table), 1))
            if summaries:
                writer.add_key_value_metadata({ABOUT_GENERATIONS: json.dumps(summaries)})
        finally:
            if writer is not None:
                writer.close()


def _remove(path) -> None:
    # A reader on Windows may hold the file open; a later merge deletes it.
    with contextlib.suppress(PermissionError):
        path.unlink(missing_ok=True)
