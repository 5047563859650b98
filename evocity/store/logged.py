"""What a run's log holds, whichever files it stands in: a merge may replace them meanwhile."""

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Integral
from pathlib import Path

import pyarrow as pa

from evocity.columns import array_of
from evocity.errors import EvocityError, RunError
from evocity.store.ending import Ending
from evocity.store.layout import BIRTHS, MEMBERSHIP, Folder, Piece
from evocity.store.membership import summaries_of
from evocity.store.merge import KINDS, unlike
from evocity.store.schema import Header
from evocity.store.seals import opened
from evocity.store.tables import Tables

# Bytes of a table up to which its columns are one chunk each: what Arrow's lists may hold.
_WHOLE = 2**31
#: A merge may replace a file between the listing and the opening of it; a log that was written anew
#: may be moved into place meanwhile.
_ATTEMPTS = 5


class Logged:
    """Births and membership of the run in a ``folder``, whose header and provenance are known. All
    methods raise `RunError` on damage."""

    def __init__(self, folder: Folder, header: Header, provenance: Mapping):
        self._folder, self._path = folder, folder.root
        self._population, self._provenance = header.population, provenance
        self._ending, self._tables = Ending(folder), Tables(header)

    @property
    def columns(self) -> list[str]:
        """Names of the columns of births."""
        return self._tables.schemas[BIRTHS].names

    @property
    def written(self) -> range:
        """See `Run.written`."""
        return range(self._with_pieces(lambda: self._ending.written) + 1)

    @property
    def generations(self) -> range:
        """See `Run.generations`."""
        return range(self._with_pieces(self._ending.found)[0] + 1)

    @property
    def damaged(self) -> tuple[Path, ...]:
        """See `Run.damaged`."""
        return self._with_pieces(self._ending.found)[1]

    def table(
        self,
        kind: str,
        generation: int | None,
        columns: Sequence[str] | None,
    ) -> pa.Table:
        """Rows of a ``kind`` in one generation, or in all; all ``columns`` if None."""
        whole = self.generations
        if generation is not None and generation not in whole:
            raise RunError(
                f"{self._path}: no generation {generation}",
                f"one of 0…{len(whole) - 1}" if whole else "a run with a whole generation",
                "see `evocity status`",
            )
        return self._joined(kind, whole if generation is None else [generation], columns)

    def _joined(self, kind: str, whole: Sequence[int], columns: Sequence[str] | None) -> pa.Table:
        """`table` of ``whole`` generations that follow each other."""

        def read() -> list[pa.Table]:
            tables = []
            for piece in self._folder.pieces(kind) if whole else ():
                wanted = range(max(piece.first, whole[0]), min(piece.last, whole[-1]) + 1)
                if wanted:
                    with (
                        self._readable(piece.path, gone_is_damage=False),
                        self._tables.opened(kind, piece) as part,
                    ):
                        tables.append(part.rows(wanted, columns))
            return tables

        tables = self._with_pieces(read)
        if not tables:
            raise RunError(
                f"{self._path} has no whole generation yet",
                "at least one",
                "wait for the first generation to end",
            )
        with self._readable(self._path):
            plain = [table.replace_schema_metadata(None) for table in tables]
            joined = pa.concat_tables(plain) if len(plain) > 1 else plain[0]
            if columns is not None and joined.nbytes < _WHOLE:
                joined = joined.combine_chunks()  # thousands of chunks are slow to work on
            return joined.replace_schema_metadata(tables[-1].schema.metadata)

    def rows_of(self, ids: Sequence[int], columns: Sequence[str]) -> Iterator[pa.Table]:
        """The rows of births with these ``ids``, of a generation at a time."""
        missing, largest = dict.fromkeys(ids), -1
        # where they are if as many are born in each generation; then everywhere
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
        """Of each generation in the files of those ``near``, or in all files, the rows of births
        that are ``missing``, which then are not any more; None without any; and its largest id. A
        file of hundreds of generations is opened once."""
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
        with self._tables.opened(BIRTHS, piece) as part:
            for generation, first, last in part.spans(whole):
                table, wanted = None, ids[bisect_left(ids, first) : bisect_right(ids, last)]
                if wanted:
                    table = part.rows(range(generation, generation + 1), columns, wanted)
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
        """What is told of each whole generation, or of one."""

        def read() -> dict[int, dict]:
            whole = self.generations if generation is None else [generation]
            files = [
                self._summaries(piece.path)
                for piece in self._folder.pieces(MEMBERSHIP)
                if whole and piece.first <= whole[-1] and whole[0] <= piece.last
            ]
            together = {g: about for found in files for g, about in found.items()}
            return {g: together[g] for g in whole if g in together}

        return self._with_pieces(read)

    @property
    def where_ids_are(self) -> str:
        """What to do for the id of a birth."""
        status = f"`evocity status {self._path}`"
        return f"take one from {status}, the report, or the births' `id` column"

    def _summaries(self, path: Path) -> dict[int, dict]:
        with self._readable(path, gone_is_damage=False), opened(path) as file:
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
    """What damage of ``what``, a part of a run, ends in is told as a `RunError`; ``provenance``
    tells of a file of the log which release wrote it."""
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
            raise unlike(what, provenance or {}, error) from error
        reason = "; ".join(map(str.strip, str(error).splitlines()[:3]))
        raise RunError(
            f"{what} is damaged or not part of a run ({type(error).__name__}: {reason})",
            "a run folder as `evocity run` writes it",
            "bring the folder back from a copy, or start the run again",
        ) from error


__all__ = ["Logged", "readable"]
