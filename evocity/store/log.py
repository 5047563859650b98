"""Births and membership of a run, over all its files; a merge may replace files meanwhile."""

import os
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from numbers import Integral
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.columns import array_of
from evocity.errors import EvocityError, RunError
from evocity.store.checksums import open_sealed
from evocity.store.label import check_label
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder, Piece, last_whole
from evocity.store.membership import membership_schema, summaries_of
from evocity.store.merge import KINDS, changed_error, damage_error
from evocity.store.read_limits import ERROR, check_bounds, read_bounded, read_through
from evocity.store.run_directory import RunDirectory
from evocity.store.schema import ABOUT_RUN, Header, births_schema, check_rows

# Bytes of a table up to which its columns are one chunk each: the limit of Arrow's lists.
_WHOLE = 2**31
# Attempts: a merge may replace a file after it is listed, and a rewritten log may move into place.
_ATTEMPTS = 5
# How deep a file is checked: its label, also its last generation, or all of it.
_LABEL, _END, _WHOLE_FILE = range(3)


class LastGeneration:
    """Finds the last generation of the run in a ``folder``, and checks each file once. Raises
    OSError, and `RunError` for files that are not part of a run."""

    def __init__(self, folder: Folder):
        self._folder = folder
        self._known: dict[tuple, bool] = {}

    def take_over(self, earlier: "LastGeneration") -> None:
        """Take over the checks of an ``earlier`` look at the same run."""
        self._known = earlier._known

    @property
    def written(self) -> int:
        """The last generation without a gap before it, damaged or not; -1 if there is none."""
        return min(map(last_whole, self._pieces()))

    def _pieces(self) -> list[list[Piece]]:
        return [self._folder.pieces(kind) for kind in (BIRTHS, MEMBERSHIP)]

    @property
    def missing(self) -> tuple[Path, ...]:
        """The files of the generation after `written` that are missing, though later generations
        are there."""
        kinds = {kind: self._folder.pieces(kind) for kind in (BIRTHS, MEMBERSHIP)}
        last = min(map(last_whole, kinds.values()))
        after = max((piece.last for pieces in kinds.values() for piece in pieces), default=last)
        return tuple(
            self._folder.single(kind, last + 1)
            for kind, pieces in kinds.items()
            if after > last + 1 and last_whole(pieces) == last
        )

    def sound(self, thorough: bool = False) -> tuple[int, tuple[Path, ...]]:
        """Return the last generation before any damage, and the files from there on. Only the last
        generations are read, and all labels; if ``thorough``, all files, and files after a missing
        one are damage too."""
        kinds = self._pieces()
        pieces = [piece for kind in kinds for piece in kind]
        folders = {piece.path.parent for piece in pieces}
        states = {folder: self._folder.directory.states(folder) for folder in folders}
        end = last = min(map(last_whole, kinds))
        checked: Sequence[Piece] = pieces
        while True:
            at_end = [p for p in pieces if p.first <= last <= p.last]
            depths = dict.fromkeys(checked, _LABEL) | dict.fromkeys(at_end, _END)
            broken = [
                one.first
                for one, depth in depths.items()
                if not self._is_sound(
                    one, _WHOLE_FILE if thorough else depth, states[one.path.parent]
                )
            ]
            lower = min([one - 1 for one in broken if one <= last], default=last)
            if lower == last:
                break
            last, checked = lower, ()
        if last == end and not (thorough and self.missing):
            return last, ()
        return last, tuple(piece.path for piece in pieces if piece.last > last)

    def chain(self) -> str | None:
        """Return the checksum of the last event before the last generation; None if the file of
        that has none. Raises ValueError."""
        last, _ = self.sound()
        for piece in self._folder.pieces(MEMBERSHIP):
            if piece.first <= last <= piece.last:
                with self._folder.directory.open(piece.path) as file:
                    label = check_label(file, piece)
                return None if label is None else label.chain
        return None

    def _is_sound(self, piece: Piece, depth: int, states: Mapping[str, os.stat_result]) -> bool:
        about = states.get(piece.path.name)
        if about is None:  # merged in this moment
            return True
        try:
            key = (piece.path, about.st_size, about.st_mtime_ns, depth)
            if key not in self._known:
                self._known[key] = _reads(self._folder.directory, piece, depth)
            return self._known[key]
        except FileNotFoundError:  # merged in this moment
            return True


def _reads(directory: RunDirectory, piece: Piece, depth: int) -> bool:
    try:
        with directory.open(piece.path) as file:
            check_label(file, piece)
            if depth == _LABEL:
                return True
            with open_sealed(file) as opened:
                groups = range(opened.num_row_groups)
                for group in groups if depth == _WHOLE_FILE else groups[-1:]:
                    read_through(opened, group)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        return False
    return True


class Tables:
    """Reads the files of the run in a ``directory`` with a ``header``. All methods raise OSError,
    and the errors of damage. ``schemas``: the columns of births and of membership, by the kind of
    file."""

    def __init__(self, directory: RunDirectory, header: Header):
        self._directory, self._header = directory, header
        self.schemas = {BIRTHS: births_schema(header), MEMBERSHIP: membership_schema(header)}
        self._known: set[bytes] = set()  # checked headers: hundreds of files have the same

    @contextmanager
    def open(self, kind: str, piece: Piece) -> "Iterator[Part]":
        """Open a file and check its header and columns."""
        folded = [ERROR] if kind == BIRTHS else []
        with (
            self._directory.open(piece.path) as opened,
            open_sealed(opened, read_dictionary=folded) as file,
        ):
            check_label(opened, piece)
            schema = file.schema_arrow
            about = schema.metadata[ABOUT_RUN]
            if about not in self._known:
                if Header.from_json(about, piece.path) != self._header:
                    raise ValueError("it belongs to another run")
                self._known.add(about)
            for name in folded:
                at = schema.get_field_index(name)
                schema = schema.set(at, schema.field(at).with_type(pa.string()))
            if not schema.equals(self.schemas[kind]):
                raise ValueError(f"its columns are not those of {kind}")
            yield Part(self._header, kind, piece, file)


@dataclass(frozen=True)
class Part:
    """An open ``file`` of the run with a ``header``."""

    header: Header
    kind: str
    piece: Piece
    file: pq.ParquetFile

    def rows(
        self, generations: range, columns: Sequence[str] | None, ids: Sequence[int] | None = None
    ) -> pa.Table:
        """Return the rows of ``generations``, of ``ids`` if given; all ``columns`` if None."""
        groups: Sequence[int] = [g - self.piece.first for g in generations]
        if self.piece.first == self.piece.last:  # without rows it has no row group
            groups = range(self.file.num_row_groups)
        check_bounds(self.file.metadata, self.header, groups, columns)
        places = None if ids is None else _places(self.file, groups, ids)
        table = read_bounded(self.file, self.kind, groups, columns, places)
        check_rows(table, self.header, self.kind != BIRTHS)
        return table

    def spans(self, whole: range) -> Iterator[tuple[int, int, int]]:
        """Return (generation, least and largest id) of each ``whole`` generation with births."""
        about = self.file.metadata
        at = self.file.schema_arrow.names.index("id")
        # each generation has one row group; a generation without rows has no row group
        for group in range(about.num_row_groups):
            ids = about.row_group(group).column(at).statistics
            if self.piece.first + group in whole and ids is not None:
                yield self.piece.first + group, int(ids.min), int(ids.max)


def _places(file: pq.ParquetFile, groups: Sequence[int], ids: Sequence[int]) -> np.ndarray:
    known = array_of(file.read_row_groups(groups, columns=["id"])["id"])
    return np.flatnonzero(np.isin(known, np.array(ids, np.int64)))


class LogFiles:
    """Births and membership of the run in a ``folder``. All methods raise `RunError` on damage."""

    def __init__(self, folder: Folder, header: Header, provenance: Mapping):
        self._folder, self._path = folder, folder.root
        self._population, self._provenance = header.population, provenance
        self._ending, self._tables = LastGeneration(folder), Tables(folder.directory, header)

    def take_over(self, earlier: "LogFiles") -> None:
        """Take over which files an ``earlier`` look at the same run has checked."""
        self._ending.take_over(earlier._ending)

    @property
    def columns(self) -> list[str]:
        return self._tables.schemas[BIRTHS].names

    @property
    def written(self) -> range:
        return range(self._with_pieces(lambda: self._ending.written) + 1)

    @property
    def generations(self) -> range:
        return range(self._with_pieces(self._ending.sound)[0] + 1)

    @property
    def damaged(self) -> tuple[Path, ...]:
        return self._with_pieces(self._ending.sound)[1]

    @property
    def missing(self) -> tuple[Path, ...]:
        return self._with_pieces(lambda: self._ending.missing)

    @property
    def chain(self) -> str | None:
        """The checksum of the last event before the last generation, if its file has it."""
        return self._with_pieces(self._ending.chain)

    def table(self, kind: str, generation: int | None, columns: Sequence[str] | None) -> pa.Table:
        """Return the rows of a ``kind`` in one generation, or in all; all ``columns`` if None."""
        whole = self.generations
        if generation is not None and generation not in whole:
            raise RunError(
                f"{self._path} has no generation {generation}",
                f"a generation from 0 to {len(whole) - 1}"
                if whole
                else "a run with a complete generation",
                f"list the generations with `evocity status {self._path}`",
            )
        whole = whole if generation is None else range(generation, generation + 1)

        def read() -> list[pa.Table]:
            tables = []
            for piece in self._folder.pieces(kind) if whole else ():
                here = range(max(piece.first, whole[0]), min(piece.last, whole[-1]) + 1)
                if here:
                    with (
                        self._readable(piece.path, gone_is_damage=False),
                        self._tables.open(kind, piece) as part,
                    ):
                        tables.append(part.rows(here, columns))
            return tables

        tables = self._with_pieces(read)
        if not tables:
            raise RunError(
                f"{self._path} has no complete generation yet",
                "a run with at least one complete generation",
                "wait until the first generation ends",
            )
        with self._readable(self._path):
            plain = [table.replace_schema_metadata(None) for table in tables]
            joined = pa.concat_tables(plain) if len(plain) > 1 else plain[0]
            if columns is not None and joined.nbytes < _WHOLE:
                joined = joined.combine_chunks()  # thousands of chunks are slow to work on
            return joined.replace_schema_metadata(tables[-1].schema.metadata)

    def rows_of(self, ids: Sequence[int], columns: Sequence[str]) -> Iterator[pa.Table]:
        """Return the rows of births with these ``ids``, one generation at a time."""
        missing, largest = dict.fromkeys(ids), -1
        # their place if each generation has as many births; then everywhere
        for near in ({one // self._population for one in ids}, None):
            if missing:
                for table, last in self._rows_near(near, missing, columns):
                    largest = max(largest, last)
                    if table is not None:
                        yield table
        if missing:
            raise RunError(
                f"{self._path} has no individual {next(iter(missing))}",
                f"an id from 0 to {largest}"
                if largest >= 0
                else "a run with a complete generation",
                self.where_ids_are,
            )

    def _rows_near(
        self, near: Collection[int] | None, missing: dict[int, None], columns: Sequence[str]
    ) -> Iterator[tuple[pa.Table | None, int]]:
        """For each generation in the files ``near``, or in all: the rows of ``missing`` births, or
        None, and its largest id. Births that it yields are no longer ``missing``."""
        for attempt in range(_ATTEMPTS):
            try:
                with self._readable(self._path, gone_is_damage=attempt == _ATTEMPTS - 1):
                    whole = self.generations
                    for piece in self._folder.pieces(BIRTHS):
                        here = near is None or any(piece.first <= g <= piece.last for g in near)
                        if here and missing:
                            with self._readable(piece.path, gone_is_damage=False):
                                yield from self._rows_in(piece, whole, missing, columns)
                return
            except FileNotFoundError:  # merged in this moment
                continue

    def _rows_in(
        self, piece: Piece, whole: range, missing: dict[int, None], columns: Sequence[str]
    ) -> Iterator[tuple[pa.Table | None, int]]:
        ids = sorted(missing)
        with self._tables.open(BIRTHS, piece) as part:
            for generation, first, last in part.spans(whole):
                table, here = None, ids[bisect_left(ids, first) : bisect_right(ids, last)]
                if here:
                    table = part.rows(range(generation, generation + 1), columns, here)
                    for one in array_of(table["id"]).tolist():
                        missing.pop(one, None)
                yield table, last

    def check_ids(self, ids: Sequence[int]) -> None:
        """Raise `RunError` unless all ``ids`` are whole numbers."""
        for identifier in ids:
            if not isinstance(identifier, Integral) or isinstance(identifier, bool):
                raise RunError(
                    f"{self._path} has no individual {identifier!r}",
                    "the id of a birth, which is a whole number",
                    self.where_ids_are,
                )

    def summaries(self, generation: int | None = None) -> dict[int, dict]:
        """Return the summary of each whole generation, or of one."""

        def read() -> dict[int, dict]:
            whole = self.generations if generation is None else [generation]
            files = [
                self._summaries(piece)
                for piece in self._folder.pieces(MEMBERSHIP)
                if whole and piece.first <= whole[-1] and whole[0] <= piece.last
            ]
            together = {g: about for summaries in files for g, about in summaries.items()}
            return {g: together[g] for g in whole if g in together}

        return self._with_pieces(read)

    @property
    def where_ids_are(self) -> str:
        """The remedy for a wrong id."""
        status = f"`evocity status {self._path}`"
        return f"take an id from {status}, from the report, or from the births' column `id`"

    def _summaries(self, piece: Piece) -> dict[int, dict]:
        with (
            self._readable(piece.path, gone_is_damage=False),
            self._folder.directory.open(piece.path) as file,
            open_sealed(file) as opened,
        ):
            check_label(file, piece)
            return summaries_of(opened.metadata.metadata)

    def _with_pieces(self, read: Callable):
        for attempt in range(_ATTEMPTS):
            try:
                with self._readable(self._path, gone_is_damage=attempt == _ATTEMPTS - 1):
                    return read()
            except FileNotFoundError:
                continue

    def _readable(self, what: Path, gone_is_damage: bool = True):
        return readable(what, self._provenance, gone_is_damage)


@contextmanager
def readable(
    what: Path, provenance: Mapping | None = None, gone_is_damage: bool = True
) -> Iterator[None]:
    """Raise errors of damage in ``what``, a part of a run, as `RunError`; ``provenance`` names the
    release that wrote a file of the log."""
    try:
        yield
    except RunError:
        raise
    except Exception as error:
        if isinstance(error, FileNotFoundError) and not gone_is_damage:
            raise
        expected = (OSError, pa.ArrowException, EvocityError)
        damage = (LookupError, ValueError, TypeError, AttributeError, StopIteration)
        damage += (ArithmeticError, RecursionError, MemoryError)
        if not isinstance(error, expected + damage):
            raise
        if what.parent.name in KINDS:
            raise changed_error(what, provenance or {}, error) from error
        remedy = "restore the folder from a backup, or start the run again"
        raise damage_error(what, error, remedy) from error
