"""Births and membership of a run, over all its files; a merge may replace files meanwhile."""

import os
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path

import pyarrow as pa

from evocity.columns import array_of
from evocity.errors import EvocityError, RunError
from evocity.store.checksums import open_sealed
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder, Piece, last_whole
from evocity.store.membership import summaries_of
from evocity.store.merge import KINDS, changed_error, damage_error
from evocity.store.read_limits import read_through
from evocity.store.schema import Header
from evocity.store.tables import Tables

# Bytes of a table up to which its columns are one chunk each: the limit of Arrow's lists.
_WHOLE = 2**31
# Attempts: a merge may replace a file after it is listed, and a rewritten log may move into place.
_ATTEMPTS = 5


class LastGeneration:
    """Finds the last generation of the run in a ``folder``. Each file is checked once, while it
    stays the same.

    Raises OSError, and `RunError` for files that are not part of a run.
    """

    def __init__(self, folder: Folder):
        self._folder = folder
        self._known: dict[tuple, bool] = {}

    @property
    def written(self) -> int:
        """The last generation without a gap before it, damaged or not; -1 if there is none."""
        return min(map(last_whole, self._pieces()))

    def _pieces(self) -> list[list[Piece]]:
        return [self._folder.pieces(kind) for kind in (BIRTHS, MEMBERSHIP)]

    def sound(self, thorough: bool = False) -> tuple[int, tuple[Path, ...]]:
        """Return the last generation before any damage, and the files from there on. Only the last
        generations are checked; all, if ``thorough``."""
        kinds = self._pieces()
        pieces = [piece for kind in kinds for piece in kind]
        end = last = min(map(last_whole, kinds))
        checked: Sequence[Piece] = pieces if thorough else ()
        while True:
            at_end = [p for p in pieces if p.first <= last <= p.last]
            broken = [p.first for p in {*checked, *at_end} if not self._is_sound(p, thorough)]
            lower = min([one - 1 for one in broken if one <= last], default=last)
            if lower == last:
                break
            last, checked = lower, ()
        if last == end:
            return last, ()
        return last, tuple(piece.path for piece in pieces if piece.last > last)

    def _is_sound(self, piece: Piece, whole: bool) -> bool:
        """Whether the last generation of a file, or the ``whole`` file, can be read."""
        try:
            about = os.stat(piece.path)
            key = (piece.path, about.st_size, about.st_mtime_ns, whole)
            if key not in self._known:
                self._known[key] = _reads(piece.path, whole)
            return self._known[key]
        except FileNotFoundError:  # merged in this moment
            return True


def _reads(path: Path, whole: bool) -> bool:
    try:
        with open_sealed(path) as file:
            groups = range(file.num_row_groups)
            for group in groups if whole else groups[-1:]:
                read_through(file, group)
    except FileNotFoundError:
        raise
    except (OSError, ValueError, pa.ArrowException):
        return False
    return True


class LogFiles:
    """Births and membership of the run in a ``folder``. All methods raise `RunError` on damage."""

    def __init__(self, folder: Folder, header: Header, provenance: Mapping):
        self._folder, self._path = folder, folder.root
        self._population, self._provenance = header.population, provenance
        self._ending, self._tables = LastGeneration(folder), Tables(header)

    @property
    def columns(self) -> list[str]:
        """Names of the columns of births."""
        return self._tables.schemas[BIRTHS].names

    @property
    def written(self) -> range:
        """See `RunLog.written`."""
        return range(self._with_pieces(lambda: self._ending.written) + 1)

    @property
    def generations(self) -> range:
        """See `RunLog.generations`."""
        return range(self._with_pieces(self._ending.sound)[0] + 1)

    @property
    def damaged(self) -> tuple[Path, ...]:
        """See `RunLog.damaged`."""
        return self._with_pieces(self._ending.sound)[1]

    def table(self, kind: str, generation: int | None, columns: Sequence[str] | None) -> pa.Table:
        """Return the rows of a ``kind`` in one generation, or in all; all ``columns`` if None."""
        whole = self.generations
        if generation is not None and generation not in whole:
            raise RunError(
                f"{self._path}: no generation {generation}",
                f"one of 0…{len(whole) - 1}" if whole else "a run with a whole generation",
                "see `evocity status`",
            )
        return self._joined(kind, whole if generation is None else [generation], columns)

    def _joined(self, kind: str, whole: Sequence[int], columns: Sequence[str] | None) -> pa.Table:
        """`table` of consecutive generations."""

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
                f"{self._path} has no whole generation yet",
                "at least one whole generation",
                "wait for the first generation to end",
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
                f"{self._path}: no individual {next(iter(missing))}",
                f"an id from 0 to {largest}" if largest >= 0 else "a run with a whole generation",
                self.where_ids_are,
            )

    def _rows_near(
        self, near: Collection[int] | None, missing: dict[int, None], columns: Sequence[str]
    ) -> Iterator[tuple[pa.Table | None, int]]:
        """For each generation in the files ``near``, or in all files: the rows of ``missing``
        births, which it removes from there, or None, and its largest id. Each file is opened
        once."""
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
                    f"{self._path}: individual {identifier!r}",
                    "a whole number, the id of a birth",
                    self.where_ids_are,
                )

    def summaries(self, generation: int | None = None) -> dict[int, dict]:
        """Return the summary of each whole generation, or of one."""

        def read() -> dict[int, dict]:
            whole = self.generations if generation is None else [generation]
            files = [
                self._summaries(piece.path)
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
        return f"take one from {status}, the report, or the births' `id` column"

    def _summaries(self, path: Path) -> dict[int, dict]:
        with self._readable(path, gone_is_damage=False), open_sealed(path) as file:
            return summaries_of(file.metadata.metadata)

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
        remedy = "bring the folder back from a copy, or start the run again"
        raise damage_error(what, error, remedy) from error
