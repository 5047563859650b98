"""Rows of a run's Parquet files, once these are what the run writes."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.columns import array_of
from evocity.store.bounds import check_bounds, read_bounded
from evocity.store.layout import BIRTHS, MEMBERSHIP, Piece
from evocity.store.membership import membership_schema
from evocity.store.schema import (
    ABOUT_RUN,
    Header,
    births_schema,
    check_rows,
)
from evocity.store.seals import check_seal, opened


class Tables:
    """Reads the files of the run with a ``header``. All methods raise OSError, and what damage ends
    in.

    schemas : the columns of births and of membership, by the kind of file.
    """

    def __init__(self, header: Header):
        self._header = header
        self.schemas = {BIRTHS: births_schema(header), MEMBERSHIP: membership_schema(header)}
        self._known: set[bytes] = set()  # headers of files, of which hundreds tell the same

    def rows(
        self,
        kind: str,
        piece: Piece,
        wanted: range,
        columns: Sequence[str] | None,
        ids: Sequence[int] | None = None,
    ) -> pa.Table:
        """Generations ``wanted`` of a file, once its header and columns are those of the run; all
        ``columns`` if None. ``ids``: of the births these alone."""
        with opened(piece.path) as file:
            schema = file.schema_arrow
            groups = [g - piece.first for g in wanted]
            if piece.first == piece.last:  # without rows it has no row group
                groups = range(file.num_row_groups)
            check_bounds(file.metadata, self._header, groups, columns)
            told = schema.metadata[ABOUT_RUN]
            if told not in self._known:
                if Header.from_json(told, piece.path) != self._header:
                    raise ValueError("it belongs to another run")
                self._known.add(told)
            if not schema.equals(self.schemas[kind]):
                raise ValueError(f"its columns are not those of {kind}")
            places = None if ids is None else _places(file, groups, ids)
            table = read_bounded(piece.path, file, kind, groups, columns, places)
            check_rows(table, self._header, kind != BIRTHS)
            return table


def _places(file: pq.ParquetFile, groups: Sequence[int], ids: Sequence[int]) -> np.ndarray:
    """Which rows of some row groups are the births with these ``ids``."""
    known = array_of(file.read_row_groups(groups, columns=["id"])["id"])
    return np.flatnonzero(np.isin(known, np.array(ids, np.int64)))


def spans_of(piece: Piece, whole: range) -> list[tuple[int, int, int]]:
    """(generation, least and largest id) of each ``whole`` generation of a file that has births."""
    check_seal(piece.path)
    about, spans = pq.read_metadata(piece.path), []
    at = about.schema.to_arrow_schema().names.index("id")
    # a row group a generation; without rows there is none
    for group in range(about.num_row_groups):
        column = about.row_group(group).column(at)
        if piece.first + group in whole and column.statistics is not None:
            least, largest = column.statistics.min, column.statistics.max
            spans.append((piece.first + group, int(least), int(largest)))
    return spans


__all__ = ["Tables", "spans_of"]
