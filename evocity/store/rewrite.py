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
import os
import shutil
from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from copy import copy
from pathlib import Path

import pyarrow as pa

from evocity.files import flush_folder, whole_file
from evocity.store.layout import BIRTHS, MEMBERSHIP, REWRITTEN, SEGMENT, Folder
from evocity.store.log import LogFiles
from evocity.store.membership import Member, membership_table
from evocity.store.merge import KINDS, drop_leftovers, merge, write_single
from evocity.store.run_log import RunLog
from evocity.store.safe_open import plain_folder, read_json
from evocity.store.schema import Header, births_schema

# Describes a rewritten log, in its folder.
_ABOUT = "about.json"
# Prefix of the old folders in it, until they are deleted.
_OLD = "old-"


class LogRewrite:
    """The log of a ``run`` under another ``header``, written beside the old one, generation by
    generation.

    ``about``: plain JSON values on which its numbers depend. An unfinished log with the same values
    is continued. ``explained``: a context that explains OSErrors.

    run : the part that is rewritten already.
    """

    def __init__(
        self,
        run: RunLog,
        header: Header,
        about: Mapping,
        explained: Callable[[], AbstractContextManager],
    ):
        self.header, self._explained = header, explained
        self._folder = Folder(Path(run.path).absolute(), header.recipe_hash)
        with explained():
            self._begin(json.loads(json.dumps({"header": header.to_json(), **about})))
        self.run = copy(run)
        self.run.header, self.run._folder = header, Folder(run.path, header.recipe_hash)
        self.run._log = LogFiles(self.run._folder, header, run.provenance)
        with explained():
            drop_leftovers(self._folder, len(self.run.generations) - 1)

    def _begin(self, about: Mapping) -> None:
        room = self._folder.rewritten
        if os.path.lexists(room) and not _is_for(room, about):
            _delete(room)
        if not os.path.lexists(room):
            room.mkdir()
            with whole_file(room / _ABOUT) as temporary:
                temporary.write_text(json.dumps(about), encoding="utf-8")
        for kind in KINDS:
            (room / kind).mkdir(exist_ok=True)
        flush_folder(room)

    def write(
        self, generation: int, births: pa.Table, members: Iterable[Member], summary: Mapping
    ) -> None:
        """Write the next ``generation``; ``births`` have the columns of the header in any order."""
        schema = births_schema(self.header)
        table = births.select(schema.names).cast(schema).replace_schema_metadata(schema.metadata)
        living = membership_table(generation, members, summary, self.header)
        with self._explained():
            write_single(table, self._folder.single(BIRTHS, generation))
            write_single(living, self._folder.single(MEMBERSHIP, generation))
            if (generation + 1) % SEGMENT == 0:
                merge(self._folder)


def finish(folder: Folder) -> None:
    """Move the rewritten log to the place of the old one, and delete that."""
    room = folder.rewritten
    if room is None or not os.path.lexists(room):
        return
    plain_folder(room)
    with contextlib.suppress(PermissionError):  # a reader on Windows: a later call finishes
        for kind in KINDS:
            if os.path.lexists(room / kind):
                if os.path.lexists(folder.root / kind):
                    plain_folder(folder.root / kind).rename(room / f"{_OLD}{kind}")
                (room / kind).rename(folder.root / kind)
        flush_folder(folder.root)
        _delete(room)


def drop(folder: Folder, but: str | None = None) -> None:
    """Delete the unfinished logs that provenance does not name, ``but`` that of this recipe's
    hash."""
    for room in folder.root.iterdir():
        named = Folder(folder.root, room.name.removeprefix(REWRITTEN)).rewritten
        if named == room and room != folder.rewritten and room.name != f"{REWRITTEN}{but}":
            _delete(room)


def _is_for(room: Path, about: Mapping) -> bool:
    try:
        return read_json(plain_folder(room) / _ABOUT) == about
    except (OSError, ValueError):
        return False


def _delete(room: Path) -> None:
    """The description goes first, so that no half of a log is taken for the whole."""
    (plain_folder(room) / _ABOUT).unlink(missing_ok=True)
    shutil.rmtree(room)
