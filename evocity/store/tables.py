"""Rows of a run's Parquet files, with checked header and columns."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.columns import array_of
from evocity.store.checksums import open_sealed
from evocity.store.layout import BIRTHS, MEMBERSHIP, Piece
from evocity.store.membership import membership_schema
from evocity.store.read_limits import ERROR, check_bounds, read_bounded
from evocity.store.schema import ABOUT_RUN, Header, births_schema, check_rows


class Tables:
    """Reads the files of the run with a ``header``. All methods raise OSError, and the errors of
    damage.

    schemas : the columns of births and of membership, by the kind of file.
    """

    def __init__(self, header: Header):
        self._header = header
        self.schemas = {BIRTHS: births_schema(header), MEMBERSHIP: membership_schema(header)}
        self._known: set[bytes] = set()  # checked headers: hundreds of files have the same

    @contextmanager
    def open(self, kind: str, piece: Piece) -> "Iterator[Part]":
        """Open a file and check its header and columns."""
        folded = [ERROR] if kind == BIRTHS else []
        with open_sealed(piece.path, read_dictionary=folded) as file:
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
        # a row group a generation; without rows there is none
        for group in range(about.num_row_groups):
            ids = about.row_group(group).column(at).statistics
            if self.piece.first + group in whole and ids is not None:
                yield self.piece.first + group, int(ids.min), int(ids.max)


def _places(file: pq.ParquetFile, groups: Sequence[int], ids: Sequence[int]) -> np.ndarray:
    """The rows of the births with these ``ids`` in some row groups."""
    known = array_of(file.read_row_groups(groups, columns=["id"])["id"])
    return np.flatnonzero(np.isin(known, np.array(ids, np.int64)))
