"""Picks: births that a user picked, each with a note; kept beside the births in ``picks.json``."""

import contextlib
import hashlib
import os
import threading
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from evocity.errors import RunError
from evocity.search.preparation.trust import state_folder
from evocity.store.run_directory import RunDirectory
from evocity.studio.output_files import write_error
from evocity.studio.request_fields import Body, Id

#: Picks of a run, letters of a note, steps of undo; at most.
MOST_PICKS, MOST_LETTERS, MOST_STEPS = 1000, 2000, 50
NAME = "picks.json"

_Note = Annotated[str, Field(max_length=MOST_LETTERS)]


class Pick(Body):
    id: Id
    note: _Note = ""


class PickChange(Body):
    """A change that the page requests."""

    change: Literal["pick", "drop", "note", "undo"]
    ids: Annotated[tuple[Id, ...], Field(max_length=MOST_PICKS)] = ()
    note: _Note = ""


_Listed = Annotated[tuple[Pick, ...], Field(max_length=MOST_PICKS)]


class PicksFile(Body):
    """The file: the picks in order, and the picks before each of the last changes."""

    version: Literal[1] = 1
    picks: _Listed = ()
    before: Annotated[tuple[_Listed, ...], Field(max_length=MOST_STEPS)] = ()


class Picks:
    """The picks of the run in ``folder``; if the folder is not ``is_own``, the state folder of the
    user keeps them. Every change is on the disk before it is answered."""

    def __init__(self, folder: Path):
        self._lock = threading.Lock()
        self.is_own = _is_own(folder)
        name = hashlib.blake2b(os.fsencode(folder.resolve()), digest_size=16).hexdigest()
        #: The file.
        self.path = folder / NAME if self.is_own else state_folder() / "picks" / f"{name}.json"

    def state(self) -> dict:
        """Return plain values for the page. Raises `RunError` if the file is damaged."""
        kept = self._read()
        return {
            "picks": [pick.model_dump() for pick in kept.picks],
            "undo": len(kept.before),
            "place": str(self.path),
        }

    def change(self, request: PickChange, known: Collection[int]) -> dict:
        """Change the picks among the ``known`` births; return the new `state`."""
        with self._lock:
            kept = self._read()
            if request.change == "undo":
                if kept.before:
                    self._write(PicksFile(picks=kept.before[-1], before=kept.before[:-1]))
                return self.state()
            unknown = [n for n in request.ids if n not in known]
            if unknown and request.change != "drop":  # births that are gone may be dropped
                raise RunError(
                    f"the run has no birth {unknown[0]}",
                    "ids of births in this run",
                    "pick other births",
                )
            picks = tuple(_changed_picks(kept.picks, request))
            if len(picks) > MOST_PICKS:
                raise RunError(
                    f"{len(picks)} picked births are too many",
                    f"at most {MOST_PICKS} picked births",
                    "remove some of the picked births first",
                )
            if picks != kept.picks:
                before = (*kept.before, kept.picks)[-MOST_STEPS:]
                self._write(PicksFile(picks=picks, before=before))
            return self.state()

    def _read(self) -> PicksFile:
        if not os.path.lexists(self.path):
            return PicksFile()
        try:
            content = RunDirectory(self.path.parent).read(self.path.name)
            return PicksFile.model_validate_json(content)
        except (OSError, ValidationError, RecursionError) as error:
            raise RunError(
                f"studio cannot read the picked births in {self.path} ({type(error).__name__})",
                "a list of picked births that studio wrote",
                "move the file to another folder, or restore the file from a backup",
            ) from None

    def _write(self, kept: PicksFile) -> None:
        try:
            if not self.is_own:
                self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            text = kept.model_dump_json(indent=1) + "\n"
            RunDirectory(self.path.parent).write_bytes(self.path.name, text.encode())
        except OSError as error:
            raise write_error(self.path, error) from error


def _changed_picks(picks: Iterable[Pick], request: PickChange) -> Iterable[Pick]:
    changed = {pick.id: pick for pick in picks}
    for n in request.ids:
        if request.change == "drop":
            changed.pop(n, None)
        elif request.change == "note":  # a note picks its birth
            changed[n] = Pick(id=n, note=request.note)
        else:
            changed.setdefault(n, Pick(id=n))
    return changed.values()


def _is_own(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        mine = not hasattr(os, "geteuid") or folder.stat().st_uid == os.geteuid()
        return mine and os.access(folder, os.W_OK | os.X_OK)
    return False
