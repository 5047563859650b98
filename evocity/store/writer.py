"""`RunWriter`: writes a run folder, one whole generation at a time."""

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
from evocity.errors import RunError, reason_of
from evocity.files import whole_file
from evocity.store.checksums import digests_of
from evocity.store.events import append_event, read_commands
from evocity.store.layout import BIRTHS, MEMBERSHIP, SEGMENT, Folder, is_unfinished
from evocity.store.lock import Lock
from evocity.store.log import LastGeneration
from evocity.store.membership import Member, membership_table
from evocity.store.merge import drop_leftovers, merge, write_single
from evocity.store.rewrite import LogRewrite, drop, finish
from evocity.store.run_log import RunLog
from evocity.store.schema import Birth, Header, births_table
from evocity.store.sources import (
    MEASURES_FOLDER,
    Source,
    write_condensation,
    write_maps,
    write_masks,
    write_measures,
    write_sources,
)


def refuse_existing(path: str | os.PathLike) -> None:
    """Raise `RunError` if ``path`` exists: a run never writes into an existing folder."""
    if os.path.lexists(path):
        raise RunError(
            f"the output folder {path} exists already",
            "a new folder for a new run",
            f"choose another with --out, or go on with that run: evocity resume {path}",
        )


class RunWriter:
    """The only writer of a run folder; holds its lock from creation to `close`.

    Made by `create` or `reopen`. All methods raise `RunError` if the disk is full, the folder is
    gone, or the writer was closed; earlier generations stay readable.
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

        ``condensation``: the layer with the digest ``header.locked``; ``own``: files of the user's
        own measures, see `keep`; ``references``: cities, other than the ``sources``, that measures
        compare with; ``parts``: parts of the map that measures take, bool ``(H, W)`` each. Raises
        `RunError` if it exists or cannot be written.
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
            write_measures(hidden, own or {})
            files = digests_of(hidden, folder.sources, folder.references, folder.within)
            _write_provenance(folder, {**provenance, "files": files}, header)
            folder.events.touch()
            refuse_existing(path)
            if os.name == "nt":  # Windows cannot rename a folder with an open file
                lock.release()
            hidden.rename(path)
            folder = Folder(path)
            if os.name == "nt":
                lock = Lock(folder.lock)
            writer, lock = cls(folder, header, lock), None
            return writer
        except OSError as error:
            raise RunError(
                f"the run folder {path} cannot be written: {reason_of(error)}",
                "a folder that you may write to, with space left",
                "free space, or choose another folder with --out",
            ) from error
        finally:
            if lock is not None:
                lock.release()
            shutil.rmtree(hidden, ignore_errors=True)

    @classmethod
    def reopen(cls, path: str | os.PathLike) -> "RunWriter":
        """Take up the run in ``path`` after its last whole generation; delete what a crash left of
        the next.

        Raises `RunError` if it is not a run, is damaged, lacks a generation in the middle, or
        another process writes it.
        """
        run = RunLog(path)
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
                    f"{run.path}: {names}{more} cannot be read, or come after an unreadable file",
                    "files as they were written",
                    "bring the files back from a copy; or put them aside, and breed their "
                    f"generations again: evocity resume {run.path} --set-aside",
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

        ``summary`` (plain JSON values; `RunLog.status` reads them) travels with the membership.
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
        """Replace provenance after a confirmed change, and the ``header`` with a rewritten log."""
        with self._explained():
            header = header or self.header
            _write_provenance(self.folder, provenance, header)
            self.header, self.folder = header, Folder(self.path, header.recipe_hash)
            finish(self.folder)

    def rewrite(self, run: RunLog, header: Header, about: Mapping) -> LogRewrite:
        """Begin to rewrite the log of this ``run`` under another ``header``, see `LogRewrite`."""
        return LogRewrite(run, header, about, self._explained)

    def drop_rewrites(self, but: str | None = None) -> None:
        """Delete unfinished rewritten logs, see `evocity.store.rewrite.drop`."""
        with self._explained():
            drop(self.folder, but)

    def replace_recipe(self, text: str, kept: str | None = None) -> None:
        """Replace the recipe; keep the former one as ``kept``, such as "recipe-1.toml"."""
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
            write_measures(self.path, own)

    def event(self, event: str, **details) -> None:
        """Append a line to ``events.jsonl``."""
        with self._explained():
            append_event(self.folder.events, event, **details)

    def commands(self, first: int) -> list[tuple[int, dict | None]]:
        """Return the commands from line ``first`` of ``commands.jsonl`` on, see `read_commands`."""
        with self._explained():
            return read_commands(self.folder.commands, first)

    def close(self) -> None:
        """Release the run, for other writers."""
        self._closed = True
        self._lock.release()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        if self._closed:
            raise RunError(
                f"{self.path}: this writer is closed",
                "a writer that holds the run's lock; another process may hold it now",
                "open the run again: RunWriter.reopen(path)",
            )
        try:
            yield
        except OSError as error:
            try:
                whole = self.folder.last_generation(MEMBERSHIP)
                readable = f"generations 0…{whole} stay readable" if whole >= 0 else "none is whole"
            except OSError:
                readable = "the folder is gone"
            raise RunError(
                f"{self.path} cannot be written: {reason_of(error)} ({readable})",
                "a run folder that stays in place, on a disk with space",
                f"free some space or put the folder back, then: evocity resume {self.path}",
            ) from error


def set_aside(path: str | os.PathLike) -> list[Path]:
    """Move the damaged files of births and membership of the run in ``path``, and all that follow
    them, into its folder ``damaged``; the run breeds those generations again when it goes on.
    Return the names of the moved files, below ``path``.

    Raises `RunError` if it is not a run, another process writes it, or nothing can be moved.
    """
    run = RunLog(path)
    folder = Folder(Path(path).absolute(), run.header.recipe_hash)
    writer = RunWriter(folder, run.header, Lock(folder.lock))
    try:
        moved = []
        with writer._explained():
            finish(folder)
            for one in LastGeneration(folder).sound(thorough=True)[1]:
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
    """Delete the hidden folders that killed processes left while creating the run ``path``: those
    with a name of `RunWriter.create` and only parts of a run, that no process holds."""
    ours = re.compile(re.escape(f".{path.name}-") + "[0-9a-f]{8}")
    model = Folder(path)
    parts = {BIRTHS, MEMBERSHIP, model.sources.name, model.recipe.name, model.provenance.name}
    parts |= {model.references.name, model.within.name, model.events.name, model.lock.name}
    parts.add(MEASURES_FOLDER)
    with contextlib.suppress(OSError):
        for hidden in path.parent.iterdir():
            if not ours.fullmatch(hidden.name) or hidden.is_symlink():
                continue
            with contextlib.suppress(OSError, RunError):  # in use, or not a folder: leave it
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
