"""Limits of reading a run's Parquet files: no more than a run writes.

A few kilobytes may unpack to gigabytes: endless texts, or one value repeated a billion times. A
file's metadata is checked before any of it is unpacked.
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
#: Bytes of a column of fixed length, such as thumbnails, in one generation, at most.
MOST_FIXED = 1 << 30
#: Generations of one file, at most: a segment has 64.
MOST_GROUPS = 1 << 10
# Values of a column that are read at a time, for a few rows.
_AT_ONCE = 1 << 16

ERROR, PARENTS = "error", "parents"


def check_bounds(
    about: pq.FileMetaData, header: Header, groups: Sequence[int], columns: Sequence[str] | None
) -> None:
    """Raise ValueError where a file's metadata states more than a run writes, in the row ``groups``
    and ``columns`` to be read, all if None; texts of errors are not checked."""
    if about.num_row_groups > MOST_GROUPS:
        raise ValueError(f"{about.num_row_groups} row groups")
    # thousands of groups: what is the same for all of them is read once
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
    """Read the ``columns``, all if None, of some row groups of a ``file``; only of the rows at
    ``places``, ascending, if given. Texts of errors are cut to `LONGEST_ERROR` letters; more than
    `MOST_TEXT` bytes of them are replaced by their size."""
    if kind != BIRTHS or (columns is not None and ERROR not in columns):
        return _read(file, groups, columns, places)
    others = [name for name in columns or file.schema_arrow.names if name != ERROR]
    table = _read(file, groups, others, places)
    errors = [one for group in groups for one in _errors(file, group)]
    at = (columns or file.schema_arrow.names).index(ERROR)
    texts = pa.chunked_array(errors, pa.string())
    return table.add_column(at, ERROR, texts if places is None else _taken(texts, places))


def _read(file: pq.ParquetFile, groups, columns, places: np.ndarray | None) -> pa.Table:
    """Rows at ``places`` in batches that fit a processor's cache: nothing after the last is
    unpacked, and nothing between them is kept."""
    if places is None or not places.size:
        return file.read_row_groups(groups if places is None else [], columns=columns)
    batches_kept, first = [], 0
    rows = _rows(file, groups, columns)
    batches = file.iter_batches(rows, groups, columns, use_threads=False)
    while first <= places[-1] and (batch := next(batches, None)) is not None:
        here = places[(places >= first) & (places < first + len(batch))]
        if here.size:
            batches_kept.append(_taken(batch, here - first))
        first += len(batch)
    return pa.Table.from_batches(batches_kept).combine_chunks()


def _taken(of: pa.RecordBatch | pa.ChunkedArray, rows: np.ndarray):
    """The ``rows``, ascending, of a batch or a column; consecutive ones without
    `pyarrow.compute`."""
    if not len(rows) or rows[-1] - rows[0] == len(rows) - 1:
        return of.slice(int(rows[0]) if len(rows) else 0, len(rows))
    return of.take(column_of(rows))


def _rows(file: pq.ParquetFile, groups: Sequence[int], columns: Sequence[str] | None) -> int:
    """Rows of a batch of about `_AT_ONCE` values in the longest of the ``columns``; bytes of fixed
    length count in fours."""
    leaves = [(at, file.schema.column(at)) for at in range(file.metadata.num_columns)]
    sizes = {
        at: max(1, leaf.length // 4)
        for at, leaf in leaves
        if columns is None or leaf.path.partition(".")[0] in columns
    }
    values = rows = 1
    for group in map(file.metadata.row_group, groups):
        values += max(group.column(at).num_values * each for at, each in sizes.items())
        rows += group.num_rows
    return max(1, _AT_ONCE * rows // values)


def read_through(file: pq.ParquetFile, group: int) -> None:
    """Read a row group, one column after the other, without those that are too large, and keep
    none: damage raises. Raises ValueError for more rows or values than births can have."""
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
    about = file.metadata.row_group(group)
    columns = map(about.column, range(about.num_columns))
    column = next(one for one in columns if one.path_in_schema == ERROR)
    if column.total_uncompressed_size > MOST_TEXT:
        text = f"({column.total_uncompressed_size / 2**20:.0f} MiB of error text left out)"
        yield pa.array([text] * about.num_rows, pa.string())
        return
    # as a dictionary, one text of many rows stands in memory once, until it is short
    for chunk in file.read_row_group(group, columns=[ERROR])[ERROR].chunks:
        if chunk.null_count == len(chunk):
            yield pa.nulls(len(chunk), pa.string())
            continue
        import pyarrow.compute as pc  # most runs need it not

        short = pc.utf8_slice_codeunits(chunk.dictionary, 0, LONGEST_ERROR)
        yield pa.DictionaryArray.from_arrays(chunk.indices, short).cast(pa.string())
