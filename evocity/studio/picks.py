"""Births that a user picked, with a note each: kept beside the births, never among them."""

import contextlib
import hashlib
import os
import threading
from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from evocity.errors import RunError
from evocity.files import whole_file
from evocity.search.trust import state_folder
from evocity.store.parts import read_bytes
from evocity.studio.asked import Body

#: Picks of a run, letters of a note, steps that can be undone; at most.
MOST_PICKS, MOST_LETTERS, MOST_STEPS = 1000, 2000, 50
NAME = "picks.json"

Id = Annotated[int, Field(ge=0, lt=2**63)]


class Picked(Body):
    """A birth, and what is noted of it."""

    id: Id
    note: Annotated[str, Field(max_length=MOST_LETTERS)] = ""


class Change(Body):
    """What the page asks for: to ``pick`` births after those that are, to ``drop`` some, to
    ``note`` something of one, to ``undo`` the last of these."""

    change: Literal["pick", "drop", "note", "undo"]
    ids: Annotated[tuple[Id, ...], Field(max_length=MOST_PICKS)] = ()
    note: Annotated[str, Field(max_length=MOST_LETTERS)] = ""


_Listed = Annotated[tuple[Picked, ...], Field(max_length=MOST_PICKS)]


class Kept(Body):
    """The file: who is picked, in order, and who was before each of the last changes."""

    version: Literal[1] = 1
    picks: _Listed = ()
    before: Annotated[tuple[_Listed, ...], Field(max_length=MOST_STEPS)] = ()


class Picks:
    """Those of the run in ``folder``; ``is_own`` unless this user may not write there: then they
    are kept in the user's own folder. Every change is on the disk when it is told."""

    def __init__(self, folder: Path):
        self._lock = threading.Lock()
        self.is_own = _is_own(folder)
        named = hashlib.blake2b(os.fsencode(folder.resolve()), digest_size=16).hexdigest()
        own = folder / NAME
        #: Where they are kept.
        self.path = own if self.is_own else state_folder() / "picks" / f"{named}.json"

    def told(self) -> dict:
        """Plain values for the page. Raises `RunError` if the file is damaged."""
        kept = self._read()
        return {
            "picks": [one.model_dump() for one in kept.picks],
            "undo": len(kept.before),
            "place": str(self.path),
        }

    def change(self, asked: Change, known: Collection[int]) -> dict:
        """Do what is ``asked`` with births among those ``known``, and tell what is now. Raises
        `RunError` for others, for too many, and where it cannot be written."""
        with self._lock:
            kept = self._read()
            if asked.change == "undo":
                if kept.before:
                    last = kept.before[-1]
                    self._write(Kept(picks=last, before=kept.before[:-1]))
                return self.told()
            strange = [one for one in asked.ids if one not in known]
            if strange and asked.change != "drop":  # who is gone may be dropped
                raise RunError(f"no birth {strange[0]}", "births of the run", "pick others")
            picks = tuple(_changed(list(kept.picks), asked))
            if len(picks) > MOST_PICKS:
                raise RunError(f"{len(picks)} picks", f"{MOST_PICKS} at most", "drop some first")
            if picks != kept.picks:
                before = (*kept.before, kept.picks)[-MOST_STEPS:]
                self._write(Kept(picks=picks, before=before))
            return self.told()

    def _read(self) -> Kept:
        if not os.path.lexists(self.path):
            return Kept()
        try:
            return Kept.model_validate_json(read_bytes(self.path))
        except (OSError, ValidationError, RecursionError) as error:
            raise RunError(
                f"{self.path} tells no picks ({type(error).__name__})",
                "a file as studio writes it",
                "move it elsewhere, or bring it back from a copy",
            ) from None

    def _write(self, kept: Kept) -> None:
        try:
            if not self.is_own:
                self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with whole_file(self.path) as temporary:
                temporary.write_text(kept.model_dump_json(indent=1) + "\n", encoding="utf-8")
        except OSError as error:
            raise RunError(
                f"{self.path} cannot be written: {error.strerror or error}",
                "a folder that this user may write to, with room left",
                "check its owner, and the space left",
            ) from error


def _changed(picks: list[Picked], asked: Change) -> list[Picked]:
    here = {one.id: place for place, one in enumerate(picks)}
    if asked.change == "pick":
        return picks + [Picked(id=n) for n in dict.fromkeys(asked.ids) if n not in here]
    if asked.change == "drop":
        return [one for one in picks if one.id not in asked.ids]
    for one in asked.ids:  # what is noted of one picks it
        noted = Picked(id=one, note=asked.note)
        if one in here:
            picks[here[one]] = noted
        else:
            picks.append(noted)
    return picks


def _is_own(folder: Path) -> bool:
    with contextlib.suppress(OSError):
        mine = not hasattr(os, "geteuid") or folder.stat().st_uid == os.geteuid()
        return mine and os.access(folder, os.W_OK | os.X_OK)
    return False


__all__ = ["Change", "Picked", "Picks"]
