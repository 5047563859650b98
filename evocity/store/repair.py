"""Repair of a run's log: damaged files are set aside, and generations before them kept."""

import json
from pathlib import Path

from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder, Piece
from evocity.store.log import LastGeneration
from evocity.store.merge import generations_in, write_single
from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN


def move_damaged(folder: Folder) -> list[Path]:
    """Move the damaged files of births and membership, and all of later generations, into the
    folder ``damaged``; return their former names, below the run folder.

    A whole file that also holds generations before the damage is split, and keeps those. Raises
    OSError, and `RunError` for files that are not part of a run.
    """
    moved: list[Path] = []
    while True:
        last, damaged = LastGeneration(folder).sound(thorough=True)
        if not damaged:
            return moved
        for kind in (BIRTHS, MEMBERSHIP):
            for piece in folder.files(kind):
                if piece.last <= last:
                    continue
                if piece.first <= last:
                    _split(folder, kind, piece, last)
                name = piece.path.relative_to(folder.root)
                set_file_aside(folder, piece.path, f"{name.parent.name}-{name.name}")
                moved.append(name)


def set_file_aside(folder: Folder, path: Path, name: str) -> Path:
    """Move the file at ``path`` into the folder ``damaged`` under a ``name``, with a number if a
    file has that name; return its new path. Raises OSError, `RunError`."""
    directory, target, number = folder.directory, folder.damaged / name, 1
    directory.make_folder(folder.damaged, exist_ok=True)
    while directory.exists(target):
        number += 1
        target = target.with_name(f"{Path(name).stem}-{number}{target.suffix}")
    directory.rename(path, target)
    return target


def _split(folder: Folder, kind: str, piece: Piece, last: int) -> None:
    """Write the generations of a segment up to the ``last`` into single files."""
    directory = folder.directory
    for number, (table, summaries) in enumerate(generations_in(directory, piece), piece.first):
        if number > last:
            return
        path = folder.single(kind, number)
        if directory.exists(path):
            continue
        about = {ABOUT_RUN: table.schema.metadata[ABOUT_RUN]}
        if kind == MEMBERSHIP:
            about[ABOUT_GENERATIONS] = json.dumps({str(number): summaries[str(number)]})
        write_single(directory, table.replace_schema_metadata(about), path)
