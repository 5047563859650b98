"""`RunWriter`: a run folder being written, one whole generation at a time."""

import contextlib
import json
import os
import re
import secrets
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import RunError
from evocity.files import whole_file
from evocity.store.anew import Anew, drop, finish
from evocity.store.commands import read_commands
from evocity.store.ending import Ending
from evocity.store.events import append_event
from evocity.store.layout import BIRTHS, MEMBERSHIP, SEGMENT, Folder, is_unfinished
from evocity.store.lock import Lock
from evocity.store.membership import Member, membership_table
from evocity.store.merge import drop_leftovers, merge, write_single
from evocity.store.own import OWN, write_own
from evocity.store.run import Run, open_run
from evocity.store.schema import Birth, Header, births_table
from evocity.store.seals import digests_of
from evocity.store.sources import (
    Source,
    write_condensation,
    write_maps,
    write_masks,
    write_sources,
)


def refuse_existing(path: str | os.PathLike) -> None:
    """Raise `RunError` if ``path`` exists: a run never writes into what is there."""
    if os.path.lexists(path):
        raise RunError(
            f"the output folder {path} exists already",
            "a new folder for a new run",
            f"choose another with --out, or go on with that run: evocity resume {path}",
        )


class RunWriter:
    """The only writer of a run folder; holds its lock from creation to `close`.

    Made by `create` or `reopen`. All methods raise `RunError` if the disk is full, the folder
    has gone, or it was closed; the generations written before stay readable.
    """

    def __init__(self, folder: Folder, header: Header, lock: Lock):
        self.folder, self.header, self._lock = folder, header, lock
        self._closed = False

    @property
    def path(self) -> Path:
        return self.folder.root

    @classmethod
    def create(
        cls,
        path: str | os.PathLike,
        recipe_text: str,
        provenance: Mapping,
        header: Header,
        sources: Sequence[Source],
        condensation: Condensation | None = None,
        own: Mapping[str, bytes] | None = None,
        references: Sequence[CityMap] = (),
        parts: Sequence[np.ndarray] = (),
    ) -> "RunWriter":
        """Create the run folder ``path``; it appears with all its parts, or not at all.

        ``condensation`` is the one whose digest the ``header`` tells as ``locked``; ``own`` are the
        files of the user's own measures, see `keep`; ``references`` the cities, other than the
        ``sources``, that measures compare with; ``parts`` the parts of the map that they are taken
        of, bool ``(H, W)`` each.
        Raises `RunError` if it exists or cannot be written.
        """
        path = Path(path).absolute()
        refuse_existing(path)
        _clear_unfinished(path)
        hidden = path.with_name(f".{path.name}-{secrets.token_hex(4)}")
        folder = Folder(hidden)
        lock = None
        try:
            hidden.mkdir(parents=True)
            lock = Lock(folder.lock)
            for place in (hidden / BIRTHS, hidden / MEMBERSHIP, folder.sources):
                place.mkdir()
            with whole_file(folder.recipe) as temporary:
                temporary.write_bytes(recipe_text.encode())
            write_sources(folder.sources, sources)
            if references:
                folder.references.mkdir()
                write_maps(folder.references, references)
            if parts:
                folder.within.mkdir()
                write_masks(folder.within, parts)
            if condensation is not None:
                write_condensation(folder.locked, condensation)
            write_own(hidden, own or {})
            files = digests_of(hidden, folder.sources, folder.references, folder.within)
            _write_provenance(folder, {**provenance, "files": files}, header)
            folder.events.touch()
            refuse_existing(path)
            if os.name == "nt":  # there a folder with an open file in it cannot be renamed
                lock.release()
            hidden.rename(path)
            folder = Folder(path)
            if os.name == "nt":
                lock = Lock(folder.lock)
            writer, lock = cls(folder, header, lock), None
            return writer
        except OSError as error:
            raise RunError(
                f"the run folder {path} cannot be written: {error.strerror or error}",
                "a place with space, where files may be created",
                "free space, or choose another folder with --out",
            ) from error
        finally:
            if lock is not None:
                lock.release()
            shutil.rmtree(hidden, ignore_errors=True)

    @classmethod
    def reopen(cls, path: str | os.PathLike) -> "RunWriter":
        """Take up the run in ``path`` after its last whole generation; what a crash left of
        the next one is deleted.

        Raises `RunError` if it is no run, is damaged, lacks a generation in the middle, or
        another process writes it.
        """
        run = open_run(path)
        folder = Folder(Path(path).absolute(), run.header.recipe_hash)
        writer = cls(folder, run.header, Lock(folder.lock))
        try:
            with writer._explained():
                finish(folder)
            whole = run.written
            if broken := run.damaged:
                names = ", ".join(str(one.relative_to(run.path)) for one in broken[:4])
                more = f" and {len(broken) - 4} more" if len(broken) > 4 else ""
                raise RunError(
                    f"{run.path}: {names}{more} cannot be read, or follow what cannot",
                    "files as they were written",
                    "bring them back from a copy; or put them aside, and breed those generations "
                    f"again: evocity resume {run.path} --set-aside",
                )
            with writer._explained():
                drop_leftovers(folder, len(whole) - 1)
                merge(folder)
        except BaseException:
            writer.close()
            raise
        return writer

    def write_generation(
        self, generation: int, births: Sequence[Birth], members: Sequence[Member], summary: Mapping
    ) -> None:
        """Write births, then membership: the membership file makes the generation whole.

        ``summary`` (plain JSON values; `Run.status` reads them) travels with the membership.
        """
        with self._explained():
            write_single(births_table(births, self.header), self.folder.single(BIRTHS, generation))
            write_single(
                membership_table(generation, members, summary, self.header),
                self.folder.single(MEMBERSHIP, generation),
            )
            if (generation + 1) % SEGMENT == 0:
                merge(self.folder)

    def update_provenance(self, provenance: Mapping, header: Header | None = None) -> None:
        """Replace what provenance records, after a change was confirmed; the ``header`` too, if the
        log was written `anew` for it, which takes the place of the old one then."""
        with self._explained():
            header = header or self.header
            _write_provenance(self.folder, provenance, header)
            self.header, self.folder = header, Folder(self.path, header.recipe_hash)
            finish(self.folder)

    def anew(self, run: Run, header: Header, about: Mapping) -> Anew:
        """The log of the ``run``, this one, to be written anew under another ``header``, see
        `Anew`."""
        return Anew(run, header, about, self._explained)

    def drop_anew(self, but: str | None = None) -> None:
        """Delete what was written anew and is not the run's log, see `evocity.store.anew.drop`."""
        with self._explained():
            drop(self.folder, but)

    def replace_recipe(self, text: str, kept: str | None = None) -> None:
        """Replace the recipe; the one before is ``kept`` under that name, such as
        "recipe-1.toml"."""
        with self._explained():
            if kept is not None:
                with whole_file(self.path / kept) as temporary:
                    temporary.write_bytes(self.folder.recipe.read_bytes())
            with whole_file(self.folder.recipe) as temporary:
                temporary.write_bytes(text.encode())

    def keep(self, own: Mapping[str, bytes]) -> None:
        """Keep files of the user's own measures: place in the run folder, such as
        "fitness/my_measure.py", to content."""
        with self._explained():
            write_own(self.path, own)

    def event(self, event: str, **details) -> None:
        """Add a line to ``events.jsonl``."""
        with self._explained():
            append_event(self.folder.events, event, **details)

    def commands(self, first: int) -> list[tuple[int, dict | None]]:
        """What others ask of the run, from line ``first`` of ``commands.jsonl`` on, see
        `read_commands`."""
        with self._explained():
            return read_commands(self.folder.commands, first)

    def close(self) -> None:
        """Release the run; others may write it, and this writer no more."""
        self._closed = True
        self._lock.release()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        if self._closed:
            raise RunError(
                f"{self.path} is written by a writer that was closed",
                "a writer that holds the run's lock: another process may hold it now",
                "take the run up again: RunWriter.reopen(path)",
            )
        try:
            yield
        except OSError as error:
            try:
                whole = self.folder.last_generation(MEMBERSHIP)
                readable = f"generations 0…{whole} stay readable" if whole >= 0 else "none is whole"
            except OSError:
                readable = "the folder is not there any more"
            raise RunError(
                f"{self.path} cannot be written: {error.strerror or error} ({readable})",
                "a run folder that stays in place, on a disk with space",
                f"free space or bring it back, then: evocity resume {self.path}",
            ) from error


def set_aside(path: str | os.PathLike) -> list[Path]:
    """Move the damaged files of births and membership of the run in ``path``, and all that follow
    them, into its folder ``damaged``; their generations are bred again once the run goes on.
    Returns the names of what was moved, below ``path``.

    Raises `RunError` if it is no run, another process writes it, or nothing can be moved.
    """
    run = open_run(path)
    folder = Folder(Path(path).absolute(), run.header.recipe_hash)
    writer = RunWriter(folder, run.header, Lock(folder.lock))
    try:
        moved = []
        with writer._explained():
            finish(folder)
            for one in Ending(folder).found(thorough=True)[1]:
                name = one.relative_to(folder.root)
                target = folder.damaged / f"{name.parent.name}-{name.name}"
                folder.damaged.mkdir(exist_ok=True)
                number = 1
                while os.path.lexists(target):
                    number += 1
                    target = target.with_name(f"{name.parent.name}-{name.stem}-{number}.parquet")
                (folder.root / name).rename(target)
                moved.append(name)
            if moved:
                append_event(folder.events, "set aside", files=[one.as_posix() for one in moved])
        return moved
    finally:
        writer.close()


def _clear_unfinished(path: Path) -> None:
    """Delete the hidden folders that killed processes left when they created the run ``path``:
    those named as `RunWriter.create` does, with a run's parts alone, that nobody holds."""
    ours = re.compile(re.escape(f".{path.name}-") + "[0-9a-f]{8}")
    model = Folder(path)
    parts = {BIRTHS, MEMBERSHIP, model.sources.name, model.recipe.name, model.provenance.name}
    parts |= {model.references.name, model.within.name, model.events.name, model.lock.name}
    parts.add(OWN)
    with contextlib.suppress(OSError):
        for hidden in path.parent.iterdir():
            if not ours.fullmatch(hidden.name) or hidden.is_symlink():
                continue
            with contextlib.suppress(OSError, RunError):  # in use, or no folder: left alone
                left = {part.name for part in hidden.iterdir() if not is_unfinished(part)}
                if not left:
                    hidden.rmdir()
                elif model.lock.name in left <= parts:
                    Lock(hidden / model.lock.name).release()
                    shutil.rmtree(hidden)


def _write_provenance(folder: Folder, provenance: Mapping, header: Header) -> None:
    about = {
        "schema_version": header.schema_version,
        "header": json.loads(header.to_json()),
        **{k: v for k, v in provenance.items() if k not in ("schema_version", "header")},
    }
    with whole_file(folder.provenance) as temporary:
        temporary.write_text(json.dumps(about, indent=1, ensure_ascii=False), encoding="utf-8")
