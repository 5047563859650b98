"""What of a run's Parquet file may be read: no more than a run writes.

A few kilobytes may stand for gigabytes: texts without end, a value told once for a billion rows.
What a file says of itself is looked at before any of it is unpacked.
"""

from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.citymap import MAX_PIXELS
from evocity.columns import column_of
from evocity.genome import MOST_PARENTS
from evocity.store.layout import BIRTHS
from evocity.store.schema import LONGEST_ERROR, Header

#: Rows of one generation, and bytes of one column of texts in it, at most.
MOST_ROWS, MOST_TEXT = 1 << 20, 1 << 26
#: Bytes of one column of bytes of one length, such as thumbnails, in one generation, at most.
MOST_FIXED = 1 << 30
#: Generations of one file, at most: a segment has 64.
MOST_GROUPS = 1 << 10
# Values of a column that are read at a time, where a few rows are wanted.
_AT_ONCE = 1 << 16

ERROR, PARENTS = "error", "parents"


def check_bounds(
    about: pq.FileMetaData, header: Header, groups: Sequence[int], columns: Sequence[str] | None
) -> None:
    """Raise ValueError where a file, by its metadata, holds more than a run's does in the row
    ``groups`` and ``columns``, all if None, that are to be read. The texts of errors, which older
    releases wrote at any length, are not looked at: see `read_bounded`."""
    if about.num_row_groups > MOST_GROUPS:
        raise ValueError(f"{about.num_row_groups} row groups")
    # one after the other thousands of times: what is the same for all groups is asked for once
    leaves = [(at, about.schema.column(at)) for at in range(about.num_columns)]
    names = [(at, leaf.path.partition(".")[0], leaf) for at, leaf in leaves]
    read = [
        (at, name, leaf.physical_type == "BYTE_ARRAY" and name != ERROR, leaf.length)
        for at, name, leaf in names
        if columns is None or name in columns
    ]
    most = max(header.height * header.width, 256)
    for group in map(about.row_group, groups):
        rows = group.num_rows
        if rows > MOST_ROWS:
            raise ValueError(f"{rows} rows in one generation")
        for at, name, text, length in read:
            column = group.column(at)
            if rows * length > MOST_FIXED:
                raise ValueError(f"{rows * length} bytes of {name} in one generation")
            each = MOST_PARENTS if name == PARENTS else most
            if column.num_values > max(rows, 1) * each:
                raise ValueError(f"{column.num_values} values of {name} in one generation")
            if text and column.total_uncompressed_size > MOST_TEXT:
                raise ValueError(f"{column.total_uncompressed_size} bytes of {name}")


def read_bounded(
    file: pq.ParquetFile,
    kind: str,
    groups: Sequence[int],
    columns: Sequence[str] | None,
    places: np.ndarray | None = None,
) -> pa.Table:
    """The ``columns``, all if None, of some row groups of a ``file``; of the rows at ``places``
    alone, ascending, if these are told. Texts of errors, which the file is opened to have in
    dictionaries, are cut to `LONGEST_ERROR` letters; of a generation with more than `MOST_TEXT`
    bytes of them it is told how many there are."""
    if kind != BIRTHS or (columns is not None and ERROR not in columns):
        return _read(file, groups, columns, places)
    others = [name for name in columns or file.schema_arrow.names if name != ERROR]
    table = _read(file, groups, others, places)
    errors = [one for group in groups for one in _errors(file, group)]
    at = (columns or file.schema_arrow.names).index(ERROR)
    told = pa.chunked_array(errors, pa.string())
    return table.add_column(at, ERROR, told if places is None else _taken(told, places))


def _read(file: pq.ParquetFile, groups, columns, places: np.ndarray | None) -> pa.Table:
    """Of ``places`` in batches that a processor's cache holds: what follows the last of them is not
    unpacked, and what lies between them is not kept."""
    if places is None or not places.size:
        return file.read_row_groups(groups if places is None else [], columns=columns)
    found, first = [], 0
    rows = _rows(file, groups, columns)
    batches = file.iter_batches(rows, groups, columns, use_threads=False)
    while first <= places[-1] and (batch := next(batches, None)) is not None:
        here = places[(places >= first) & (places < first + len(batch))]
        if here.size:
            found.append(_taken(batch, here - first))
        first += len(batch)
    return pa.Table.from_batches(found).combine_chunks()


def _taken(of: pa.RecordBatch | pa.ChunkedArray, rows: np.ndarray):
    """The ``rows``, ascending, of a batch or a column. Consecutive ones are sliced, which needs no
    `pyarrow.compute`."""
    if not len(rows) or rows[-1] - rows[0] == len(rows) - 1:
        return of.slice(int(rows[0]) if len(rows) else 0, len(rows))
    return of.take(column_of(rows))


def _rows(file: pq.ParquetFile, groups: Sequence[int], columns: Sequence[str] | None) -> int:
    """Rows of a batch of about `_AT_ONCE` values in the longest of the ``columns``; bytes of one
    length count in fours."""
    leaves = [(at, file.schema.column(at)) for at in range(file.metadata.num_columns)]
    wanted = {
        at: max(1, leaf.length // 4)
        for at, leaf in leaves
        if columns is None or leaf.path.partition(".")[0] in columns
    }
    values = rows = 1
    for group in map(file.metadata.row_group, groups):
        values += max(group.column(at).num_values * each for at, each in wanted.items())
        rows += group.num_rows
    return max(1, _AT_ONCE * rows // values)


def read_through(file: pq.ParquetFile, group: int) -> None:
    """Read a row group, one column after the other, and keep none: what is damaged raises. Texts of
    more than `MOST_TEXT` bytes are left out, and other bytes of more than `MOST_FIXED`. Raises
    ValueError for more than `MOST_ROWS`, and for more values in a column than births can have."""
    about = file.metadata.row_group(group)
    if about.num_rows > MOST_ROWS:
        raise ValueError(f"{about.num_rows} rows in one generation")
    for column in map(about.column, range(about.num_columns)):
        name = column.path_in_schema.partition(".")[0]
        each = MOST_PARENTS if name == PARENTS else MAX_PIXELS
        if column.num_values > max(about.num_rows, 1) * each:
            raise ValueError(f"{column.num_values} values of {name} in one generation")
    large = {
        column.path_in_schema
        for column in map(about.column, range(about.num_columns))
        if column.physical_type == "BYTE_ARRAY" and column.total_uncompressed_size > MOST_TEXT
    }
    large |= {
        leaf.path.partition(".")[0]
        for leaf in map(file.schema.column, range(about.num_columns))
        if about.num_rows * leaf.length > MOST_FIXED
    }
    for name in file.schema_arrow.names:
        if name not in large:
            file.read_row_group(group, columns=[name])


def _errors(file: pq.ParquetFile, group: int) -> Iterator[pa.Array]:
    """The errors of one row group, cut short."""
    about = file.metadata.row_group(group)
    column = next(c for c in map(about.column, range(about.num_columns)) if _is_error(c))
    if column.total_uncompressed_size > MOST_TEXT:
        text = f"({column.total_uncompressed_size / 2**20:.0f} MiB of error text left out)"
        yield pa.array([text] * about.num_rows, pa.string())
        return
    # as a dictionary, one text of many rows stands in memory once, until it is short
    for chunk in file.read_row_group(group, columns=[ERROR])[ERROR].chunks:
        if chunk.null_count == len(chunk):
            yield pa.nulls(len(chunk), pa.string())
            continue
        import pyarrow.compute as pc  # which most runs go without

        short = pc.utf8_slice_codeunits(chunk.dictionary, 0, LONGEST_ERROR)
        yield pa.DictionaryArray.from_arrays(chunk.indices, short).cast(pa.string())


def _is_error(column: pq.ColumnChunkMetaData) -> bool:
    return column.path_in_schema == ERROR
