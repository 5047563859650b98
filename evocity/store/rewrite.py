"""A run's log rewritten under another header, to replace the old log.

The new log grows in a hidden folder of the run, ``.measures-<hash>``, with the hash of the new
header's recipe. ``provenance.json`` decides which log is the run's: readers use the folder of the
recipe that its header names, if there is one, else ``births`` and ``membership`` (`Folder.place`).
So the run changes in the moment in which provenance is written, wherever a process is killed.

`LogRewrite` writes the new log. `finish` moves the new folders to the place of the old ones; every
writer calls it when it takes a run up. `drop` deletes new logs that provenance does not name; a
search that resumes a run calls it, unless it resumes the same change.
"""

import contextlib
import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from copy import copy
from pathlib import Path

import pyarrow as pa

from evocity.store.layout import BIRTHS, MEMBERSHIP, REWRITTEN, SEGMENT, Folder
from evocity.store.log import LogFiles
from evocity.store.membership import Member, membership_table
from evocity.store.merge import KINDS, drop_leftovers, merge, write_single
from evocity.store.run_directory import RunDirectory
from evocity.store.run_log import RunLog
from evocity.store.schema import Header, births_schema

# Describes a rewritten log, in its folder.
_ABOUT = "about.json"
# Prefix of the old folders in it, until they are deleted.
_OLD = "old-"


class LogRewrite:
    """The log of a ``run`` under another ``header``, written beside the old one, generation by
    generation.

    ``about``: plain JSON values on which its numbers depend. An unfinished log with the same values
    is continued. ``directory``: the run folder. ``explained``: a context that explains OSErrors.
    ``chain``: the checksum of the last event of the run.

    run : the part that is rewritten already.
    """

    def __init__(
        self,
        run: RunLog,
        header: Header,
        about: Mapping,
        directory: RunDirectory,
        explained: Callable[[], AbstractContextManager],
        chain: str,
    ):
        self.header, self._explained, self._chain = header, explained, chain
        self._folder = Folder(directory, header.recipe_hash)
        with explained():
            self._begin(json.loads(json.dumps({"header": header.to_json(), **about})))
        self.run = copy(run)
        self.run.header, self.run._folder = header, Folder(run.path, header.recipe_hash)
        self.run._log = LogFiles(self.run._folder, header, run.provenance)
        with explained():
            drop_leftovers(self._folder, len(self.run.generations) - 1)

    def _begin(self, about: Mapping) -> None:
        room, directory = self._folder.rewritten, self._folder.directory
        if directory.exists(room) and not _is_for(directory, room, about):
            _delete(directory, room)
        if not directory.exists(room):
            directory.make_folder(room)
            directory.write_bytes(room / _ABOUT, json.dumps(about).encode())
        for kind in KINDS:
            directory.make_folder(room / kind, exist_ok=True)
        directory.flush(room)

    def write(
        self, generation: int, births: pa.Table, members: Iterable[Member], summary: Mapping
    ) -> None:
        """Write the next ``generation``; ``births`` have the columns of the header in any order."""
        schema = births_schema(self.header)
        table = births.select(schema.names).cast(schema).replace_schema_metadata(schema.metadata)
        living = membership_table(generation, members, summary, self.header)
        with self._explained():
            directory = self._folder.directory
            write_single(directory, table, self._folder.single(BIRTHS, generation))
            place = self._folder.single(MEMBERSHIP, generation)
            write_single(directory, living, place, self._chain)
            if (generation + 1) % SEGMENT == 0:
                merge(self._folder)


def finish(folder: Folder) -> None:
    """Move the rewritten log to the place of the old one, and delete that."""
    room, directory = folder.rewritten, folder.directory
    if room is None or not directory.exists(room):
        return
    directory.check_folder(room)
    with contextlib.suppress(PermissionError):  # a reader on Windows: a later call finishes
        for kind in KINDS:
            if directory.exists(room / kind):
                if directory.exists(kind):
                    directory.rename(kind, room / f"{_OLD}{kind}")
                directory.rename(room / kind, kind)
        directory.flush()
        _delete(directory, room)


def drop(folder: Folder, but: str | None = None) -> None:
    """Delete the unfinished logs that provenance does not name, ``but`` that of this recipe's
    hash."""
    for name in folder.directory.entries():
        room = folder.root / name
        named = Folder(folder.root, room.name.removeprefix(REWRITTEN)).rewritten
        if named == room and room != folder.rewritten and room.name != f"{REWRITTEN}{but}":
            _delete(folder.directory, room)


def _is_for(directory: RunDirectory, room: Path, about: Mapping) -> bool:
    try:
        return directory.read_json(room / _ABOUT) == about
    except (OSError, ValueError):
        return False


def _delete(directory: RunDirectory, room: Path) -> None:
    """The description goes first, so that no half of a log is taken for the whole."""
    directory.remove(room / _ABOUT)
    directory.remove_folder(room)
