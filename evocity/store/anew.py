"""The log of a run written anew under another header, to take the place of the old one.

It grows beside the old one, in a hidden folder of the run that is named by the new header's recipe,
``.measures-<hash>``. Which of the two a run has, ``provenance.json`` decides: readers look into the
folder of the recipe that its header names, if there is one, and into ``births`` and ``membership``
if not (`Folder.place`). So the run is the old one until provenance is written, and the new one from
then on, wherever a process is killed.

`Anew` writes it. `finish` moves the new folders to where the old ones lie; every writer does that
when it takes a run up. `drop` deletes those that provenance does not tell of; a search that goes on
with a run does so, unless it goes on with the same change.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from copy import copy
from pathlib import Path

import pyarrow as pa

from evocity.files import flush_folder, whole_file
from evocity.store.layout import ANEW, BIRTHS, MEMBERSHIP, SEGMENT, Folder
from evocity.store.logged import Logged
from evocity.store.membership import Member, membership_table
from evocity.store.merge import KINDS, drop_leftovers, merge, write_single
from evocity.store.parts import plain_folder, read_json
from evocity.store.run import Run
from evocity.store.schema import Header, births_schema

#: What a log is written anew for, in its folder.
_ABOUT = "about.json"
#: How old folders are called in it, until they are deleted.
_OLD = "old-"


class Anew:
    """The log of a ``run`` under another ``header``, beside the old one; generation by generation.

    ``about``: plain JSON values that tell all that its numbers depend on. What was written before a
    kill is kept if it was written for the same. ``explained``: within it OSErrors are told.

    run : as far as it is written anew.
    """

    def __init__(
        self,
        run: Run,
        header: Header,
        about: Mapping,
        explained: Callable[[], AbstractContextManager],
    ):
        self.header, self._explained = header, explained
        self._folder = Folder(Path(run.path).absolute(), header.recipe_hash)
        with explained():
            self._begin(json.loads(json.dumps({"header": header.to_json(), **about})))
        self.run = _read_by(run, header)
        with explained():
            drop_leftovers(self._folder, len(self.run.generations) - 1)

    def _begin(self, told: Mapping) -> None:
        room = self._folder.anew
        if os.path.lexists(room) and not _is_for(room, told):
            _delete(room)
        if not os.path.lexists(room):
            room.mkdir()
            with whole_file(room / _ABOUT) as temporary:
                temporary.write_text(json.dumps(told), encoding="utf-8")
        for kind in KINDS:
            (room / kind).mkdir(exist_ok=True)
        flush_folder(room)

    def write(
        self, generation: int, births: pa.Table, members: Iterable[Member], summary: Mapping
    ) -> None:
        """The next ``generation``; ``births`` with the columns of the header in any order."""
        schema = births_schema(self.header)
        table = births.select(schema.names).cast(schema).replace_schema_metadata(schema.metadata)
        living = membership_table(generation, members, summary, self.header)
        with self._explained():
            write_single(table, self._folder.single(BIRTHS, generation))
            write_single(living, self._folder.single(MEMBERSHIP, generation))
            if (generation + 1) % SEGMENT == 0:
                merge(self._folder)


def _read_by(run: Run, header: Header) -> Run:
    """The ``run`` as far as its log is written anew under a ``header``."""
    found = copy(run)
    found.header, found._folder = header, Folder(run.path, header.recipe_hash)
    found._log = Logged(found._folder, header, run.provenance)
    return found


def finish(folder: Folder) -> None:
    """Move the log that was written anew to where the old one lies, and delete that."""
    room = folder.anew
    if room is None or not os.path.lexists(room):
        return
    plain_folder(room)
    with contextlib.suppress(PermissionError):  # a reader on Windows: a later one finishes
        for kind in KINDS:
            if os.path.lexists(room / kind):
                if os.path.lexists(folder.root / kind):
                    plain_folder(folder.root / kind).rename(room / f"{_OLD}{kind}")
                (room / kind).rename(folder.root / kind)
        flush_folder(folder.root)
        _delete(room)


def drop(folder: Folder, but: str | None = None) -> None:
    """Delete the logs that were begun to be written anew and that provenance does not tell of,
    ``but`` that of the recipe with this hash."""
    for room in folder.root.iterdir():
        told = Folder(folder.root, room.name.removeprefix(ANEW)).anew
        if told == room and room != folder.anew and room.name != f"{ANEW}{but}":
            _delete(room)


def _is_for(room: Path, told: Mapping) -> bool:
    try:
        return read_json(plain_folder(room) / _ABOUT) == told
    except (OSError, ValueError):
        return False


def _delete(room: Path) -> None:
    """What tells what it is goes first: no half of it is taken for the whole."""
    (plain_folder(room) / _ABOUT).unlink(missing_ok=True)
    shutil.rmtree(room)


__all__ = ["Anew", "drop", "finish"]
