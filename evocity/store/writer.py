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
from evocity.store.checksums import digests_of
from evocity.store.event_chain import EventLog
from evocity.store.events import COMMANDS, EVENTS, commands_of, count_commands
from evocity.store.layout import BIRTHS, MEMBERSHIP, RECIPE, SEGMENT, Folder, is_unfinished
from evocity.store.lock import Lock
from evocity.store.log import LastGeneration
from evocity.store.membership import Member, membership_table
from evocity.store.merge import drop_leftovers, merge, write_single
from evocity.store.provenance import sealed_json
from evocity.store.repair import move_damaged, set_file_aside
from evocity.store.rewrite import LogRewrite, drop, finish
from evocity.store.run_directory import RunDirectory
from evocity.store.run_log import RunLog
from evocity.store.schema import Birth, Header, births_table
from evocity.store.sources import (
    MEASURES_FOLDER,
    SOURCES,
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
            "a folder that does not exist yet",
            "choose another folder with --out, or continue the run in this folder: evocity "
            f"resume {path}",
        )


class RunWriter:
    """The only writer of a run folder; holds its lock from creation to `close`.

    Made by `create` or `reopen`. All methods raise `RunError` if the disk is full, the folder is
    gone, or the writer was closed; earlier generations stay readable.
    """

    def __init__(self, folder: Folder, header: Header, lock: Lock):
        self.folder, self.header, self._lock = folder, header, lock
        self._events = EventLog(folder.directory, EVENTS)
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
        directory, lock, writer = RunDirectory(hidden), None, None
        try:
            hidden.mkdir(parents=True)
            directory.hold()
            lock = Lock(directory)
            for place in (BIRTHS, MEMBERSHIP):
                directory.make_folder(place)
            directory.write_bytes(RECIPE, recipe_text.encode())
            write_sources(directory, sources)
            if references:
                write_maps(directory, "references", references)
            if parts:
                write_masks(directory, "within", parts)
            if condensation is not None:
                write_condensation(directory, condensation)
            write_measures(directory, own or {})
            files = digests_of(directory, SOURCES, "references", "within")
            _write_provenance(Folder(directory), {**provenance, "files": files}, header)
            directory.append(EVENTS).close()
            refuse_existing(path)
            if os.name == "nt":  # Windows cannot rename a folder with an open file
                lock.release()
            hidden.rename(path)
            directory.root = path
            if os.name == "nt":
                lock = Lock(directory)
            writer, lock = cls(Folder(directory), header, lock), None
            return writer
        except OSError as error:
            raise RunError(
                f"the run folder {path} cannot be written: {reason_of(error)}",
                "a folder that you may write to, on a disk with free space",
                "free some space, or choose another folder with --out",
            ) from error
        finally:
            if lock is not None:
                lock.release()
            if writer is None:
                directory.release()
            shutil.rmtree(hidden, ignore_errors=True)

    @classmethod
    def reopen(cls, path: str | os.PathLike) -> "RunWriter":
        """Take up the run in ``path`` after its last whole generation; delete what a crash left of
        the next.

        Raises `RunError` if it is not a run, is damaged, lacks a generation in the middle, or
        another process writes it.
        """
        run = RunLog(path)
        writer = cls._take(run)
        folder = writer.folder
        try:
            run.events()  # changed ones are refused before anything is written
            with writer._explained():
                finish(folder)
            whole = run.written
            if broken := run.damaged:
                names = ", ".join(str(one.relative_to(run.path)) for one in broken[:4])
                more = f" and {len(broken) - 4} more" if len(broken) > 4 else ""
                raise RunError(
                    f"{run.path}: these files are damaged, or follow a damaged file: {names}{more}",
                    "files that are unchanged since the run wrote them",
                    "restore these files from a backup; or set these files aside and breed the "
                    f"lost generations again: evocity resume {run.path} --set-aside",
                )
            with writer._explained():
                drop_leftovers(folder, len(whole) - 1)
                merge(folder)
        except BaseException:
            writer.close()
            raise
        return writer

    @classmethod
    def _take(cls, run: RunLog) -> "RunWriter":
        """Take up a ``run`` whose folder has no links, and hold its lock."""
        directory = RunDirectory(run.path.absolute())
        try:
            directory.hold()
            folder = Folder(directory, run.header.recipe_hash)
            folder.check_parts()
            return cls(folder, run.header, Lock(directory))
        except OSError as error:
            directory.release()
            raise _unwritable(directory.root, error, "none is whole") from error
        except BaseException:
            directory.release()
            raise

    def write_generation(
        self, generation: int, births: Sequence[Birth], members: Sequence[Member], summary: Mapping
    ) -> None:
        """Write births, then membership: the membership file makes the generation whole.

        ``summary`` (plain JSON values; `RunLog.status` reads them) travels with the membership.
        """
        with self._explained():
            directory, header = self.folder.directory, self.header
            born = births_table(births, header)
            living = membership_table(generation, members, summary, header)
            write_single(directory, born, self.folder.single(BIRTHS, generation))
            place = self.folder.single(MEMBERSHIP, generation)
            write_single(directory, living, place, self._events.chain)
            if (generation + 1) % SEGMENT == 0:
                merge(self.folder)

    def update_provenance(self, provenance: Mapping, header: Header | None = None) -> None:
        """Replace provenance after a confirmed change, and the ``header`` with a rewritten log."""
        with self._explained():
            header = header or self.header
            _write_provenance(self.folder, provenance, header)
            self.header = header
            self.folder = Folder(self.folder.directory, header.recipe_hash)
            finish(self.folder)

    def rewrite(self, run: RunLog, header: Header, about: Mapping) -> LogRewrite:
        """Begin to rewrite the log of this ``run`` under another ``header``, see `LogRewrite`."""
        return LogRewrite(
            run, header, about, self.folder.directory, self._explained, self._events.chain
        )

    def drop_rewrites(self, but: str | None = None) -> None:
        """Delete unfinished rewritten logs, see `evocity.store.rewrite.drop`."""
        with self._explained():
            drop(self.folder, but)

    def replace_recipe(self, text: str, kept: str | None = None) -> None:
        """Replace the recipe; keep the former one as ``kept``, such as "recipe-1.toml"."""
        with self._explained():
            directory = self.folder.directory
            if kept is not None:
                directory.write_bytes(kept, directory.read(RECIPE))
            directory.write_bytes(RECIPE, text.encode())

    def keep(self, own: Mapping[str, bytes]) -> None:
        """Keep files of the user's own measures: place in the run folder, such as
        "fitness/my_measure.py", to content."""
        with self._explained():
            write_measures(self.folder.directory, own)

    def event(self, event: str, **details) -> None:
        """Append a line to ``events.jsonl``; after the lock was lost, only while no other process
        holds the run."""
        with self._explained(locked=False), self._may_append():
            self._events.append({"event": event, **details})

    def commands(self, first: int) -> tuple[list[tuple[int, dict | None]], bool]:
        """Return the commands from line ``first`` of ``commands.jsonl`` on, and whether the file
        has more than is read, see `commands_of`."""
        with self._explained():
            return commands_of(self.folder.directory, first)

    def count_commands(self) -> int:
        """Return the number of lines of ``commands.jsonl``, see `count_commands`."""
        with self._explained():
            return count_commands(self.folder.directory)

    def set_commands_aside(self) -> str:
        """Move ``commands.jsonl`` into the folder ``damaged``; return its new place in the run."""
        with self._explained():
            target = set_file_aside(self.folder, self.folder.commands, COMMANDS)
            return target.relative_to(self.folder.root).as_posix()

    def close(self) -> None:
        """Release the run, for other writers."""
        self._closed = True
        self._lock.release()
        self.folder.directory.release()

    @contextmanager
    def _may_append(self) -> Iterator[None]:
        if not self._lock.is_lost:
            yield
            return
        self.folder.directory.check_in_place()
        again = Lock(self.folder.directory)
        try:
            yield
        finally:
            again.release()

    @contextmanager
    def _explained(self, locked: bool = True) -> Iterator[None]:
        if self._closed:
            raise RunError(
                f"{self.path}: this writer was closed",
                "an open writer, which holds the lock of the run",
                "open the run again: RunWriter.reopen(path)",
            )
        try:
            if locked:
                self._lock.check()
            yield
        except OSError as error:
            try:
                whole = Folder(self.path).last_generation(MEMBERSHIP)
                readable = f"generations 0…{whole} stay readable" if whole >= 0 else "none is whole"
            except (OSError, RunError):
                readable = "the folder is gone"
            raise _unwritable(self.path, error, readable) from error


def _unwritable(path: Path, error: OSError, readable: str) -> RunError:
    return RunError(
        f"{path} cannot be written: {reason_of(error)} ({readable})",
        "the run folder at this path, on a disk with free space",
        f"free some space, or put the folder back; then run evocity resume {path}",
    )


def set_aside(path: str | os.PathLike) -> list[Path]:
    """Move the damaged files of births and membership of the run in ``path``, and all that follow
    these or missing ones, into its folder ``damaged``; the run breeds those generations again when
    it goes on. Return the names of the moved files, below ``path``.

    Raises `RunError` if it is not a run, another process writes it, nothing can be moved, or an
    earlier recipe bred one of those generations.
    """
    run = RunLog(path)
    run.events()
    writer = RunWriter._take(run)
    try:
        with writer._explained():
            finish(writer.folder)
            last = LastGeneration(writer.folder).sound(thorough=True)[0]
            _refuse_earlier_recipes(run, last)
            moved = move_damaged(writer.folder)
            if moved:
                writer.event("set aside", files=[one.as_posix() for one in moved])
        return moved
    finally:
        writer.close()


def _refuse_earlier_recipes(run: RunLog, last: int) -> None:
    """Raise `RunError` if a generation after the ``last`` was bred by an earlier recipe."""
    for note in run.provenance.get("recipe", {}).get("before", []):
        if note["generations"] > last + 1:
            raise RunError(
                f"{run.path}: a file of generation {last + 1} is damaged or missing, and the "
                f"earlier recipe {note['file']} bred that generation",
                "undamaged files of this generation, because evocity can breed lost "
                "generations again only with the present recipe",
                "restore the file from a backup",
            )


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
                    Lock(RunDirectory(hidden)).release()
                    shutil.rmtree(hidden)


def _write_provenance(folder: Folder, provenance: Mapping, header: Header) -> None:
    about = {
        "schema_version": header.schema_version,
        "header": json.loads(header.to_json()),
        **{k: v for k, v in provenance.items() if k not in ("schema_version", "header", "seal")},
    }
    folder.directory.write_bytes(folder.provenance, sealed_json(about))
