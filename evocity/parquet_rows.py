"""Rows of a stranger's Parquet file: the description of the file, and the rows that meet a box.

`evocity.parquet_child` calls these functions within limits of memory and time. Its parent gets the
description as JSON, and the rows as an Arrow stream.
"""

import json
from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

#: The error for rows that take more bytes than the caller allows.
TOO_LARGE = "the rows take too many bytes"

_BATCH = 16_384


def describe(path: str) -> bytes:
    """Describe the Parquet file at ``path``: its number of rows, the texts of its metadata for
    GeoParquet and for evocity, its columns with their kinds, and the paths of its leaves."""
    with pq.ParquetFile(path, pre_buffer=False) as file:
        schema, leaves = file.schema_arrow, file.schema
        metadata = schema.metadata or {}
        about = {
            "rows": file.metadata.num_rows,
            "geo": metadata.get(b"geo", b"").decode(errors="replace"),
            "tags": metadata.get(b"evocity", b"").decode(errors="replace"),
            "columns": [(field.name, kind_of(field.type)) for field in schema],
            "leaves": [leaves.column(i).path for i in range(len(leaves))],
        }
    return json.dumps(about).encode()


def kind_of(kind: pa.DataType) -> str:
    """Tell the kind of a column: "binary", "text", "scalar", or the name of another type."""
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    if pa.types.is_binary(kind) or pa.types.is_large_binary(kind):
        return "binary"
    if pa.types.is_string(kind) or pa.types.is_large_string(kind):
        return "text"
    is_number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
    is_number = is_number or pa.types.is_decimal(kind)
    return "scalar" if is_number or pa.types.is_boolean(kind) else f"{kind}"[:80]


def select(
    path: str,
    geometry: str,
    columns: Sequence[str],
    texts: Sequence[str],
    covering: Sequence[str] | None,
    box: Sequence[float] | None,
    most: int,
) -> bytes:
    """Return ``columns`` and the WKB in ``geometry`` of the rows that may meet ``box``, by default
    all, as an Arrow stream of at most ``most`` bytes. ``covering`` names the bounds of each row;
    without it, the outlines themselves give the bounds. Raises ValueError for more bytes."""
    try:
        # strings stay dictionaries: a file of a few bytes may repeat a text without end
        with pq.ParquetFile(path, read_dictionary=[*texts, geometry], pre_buffer=False) as file:
            groups = list(range(file.num_row_groups))
            names = [geometry, *columns]
            if covering and box:
                groups = [group for group in groups if _group_meets(file, group, covering, box)]
                names += covering
            target, writer = pa.BufferOutputStream(), None
            for batch in file.iter_batches(_BATCH, groups, names, use_threads=False):
                chosen = _chosen(batch, geometry, columns, covering, box)
                most -= _size_of(chosen, geometry)
                if most < 0 or target.tell() > most:
                    raise ValueError(TOO_LARGE)
                if writer is None:
                    writer = pa.ipc.new_stream(target, chosen.schema)
                if chosen.num_rows:
                    writer.write_batch(chosen)
            if writer is None:
                return b""
            writer.close()
            return target.getvalue().to_pybytes()
    except MemoryError as error:  # of Arrow too
        raise ValueError(TOO_LARGE) from error


def _chosen(
    batch: pa.RecordBatch,
    geometry: str,
    columns: Sequence[str],
    covering: Sequence[str] | None,
    box: Sequence[float] | None,
) -> pa.RecordBatch:
    """Return the rows of a ``batch`` that may meet ``box``, with dictionaries of their values."""
    rows = np.arange(batch.num_rows)
    if box is not None:
        bounds = _bounds(batch, covering) if covering else _bounds_of_wkb(batch.column(geometry))
        with np.errstate(invalid="ignore"):
            outside = (bounds[:, :2] > box[2:]) | (bounds[:, 2:] < box[:2])
        rows = np.flatnonzero(~outside.any(axis=1))
    arrays = [_compact(batch.column(name), rows) for name in (geometry, *columns)]
    return pa.RecordBatch.from_arrays(arrays, [geometry, *columns])


def _compact(column: pa.Array, rows: np.ndarray) -> pa.Array:
    """Take ``rows`` of a column; a dictionary keeps only their values."""
    column = column.take(pa.array(rows))
    if not isinstance(column, pa.DictionaryArray):
        return column
    indices = np.asarray(pc.fill_null(column.indices, -1).to_numpy(zero_copy_only=False))
    used, places = np.unique(indices[indices >= 0], return_inverse=True)
    whole = np.zeros(len(indices), np.int32)
    whole[indices >= 0] = places.ravel()
    return pa.DictionaryArray.from_arrays(
        pa.array(whole, mask=indices < 0), column.dictionary.take(pa.array(used, pa.int64()))
    )


def _size_of(batch: pa.RecordBatch, geometry: str) -> int:
    """Return the bytes of a batch, with each outline written out."""
    column = batch.column(geometry)
    if isinstance(column, pa.DictionaryArray):
        sizes = pc.fill_null(pc.binary_length(column.dictionary), 0)
        lengths = np.append(np.asarray(sizes, dtype=np.int64), 0)
        size = int(lengths[np.asarray(pc.fill_null(column.indices, -1))].sum())
    else:
        size = int(pc.sum(pc.binary_length(column)).as_py() or 0)
    return size + batch.nbytes + 100 * batch.num_rows * batch.num_columns


def _group_meets(
    file: pq.ParquetFile, group: int, covering: Sequence[str], box: Sequence[float]
) -> bool:
    """Whether the statistics of a row group allow that a row meets ``box``."""
    found = file.metadata.row_group(group)
    index = {file.schema.column(i).path: i for i in range(len(file.schema))}
    edges = []
    for place, path in enumerate(covering):
        statistics = found.column(index[path]).statistics
        if statistics is None or not statistics.has_min_max:
            return True
        edges.append(float(statistics.min if place < 2 else statistics.max))
    west, south, east, north = edges
    outside = west > box[2] or east < box[0] or south > box[3] or north < box[1]
    return not (np.isfinite(edges).all() and outside)


def _bounds(batch: pa.RecordBatch, covering: Sequence[str]) -> np.ndarray:
    """The bounds of each row, float ``(n, 4)``."""
    edges = []
    for path in covering:
        first, *rest = path.split(".")
        column = batch.column(first)
        for name in rest:
            column = pc.struct_field(column, name)
        edges.append(np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64))
    return np.stack(edges, axis=1)


def _bounds_of_wkb(column: pa.Array) -> np.ndarray:
    """The bounds of outlines, float ``(n, 4)``; NaN for those that GEOS cannot read."""
    import shapely

    if isinstance(column, pa.DictionaryArray):
        known = shapely.bounds(_parsed(column.dictionary))
        known = np.concatenate([known, np.full((1, 4), np.nan)])
        return known[np.asarray(pc.fill_null(column.indices, -1))]
    return shapely.bounds(_parsed(column))


def _parsed(column: pa.Array) -> np.ndarray:
    import shapely

    shapes = np.array([*column.to_pylist(), None], dtype=object)[:-1]
    try:
        return shapely.from_wkb(shapes, on_invalid="ignore")
    except NotImplementedError:  # arcs, whose rows the reader reports
        known = [_parsed_alone(shape) for shape in shapes]
        return np.array([*known, None], dtype=object)[:-1]


def _parsed_alone(shape: bytes | None):
    import shapely

    try:
        return shapely.from_wkb(shape, on_invalid="ignore")
    except NotImplementedError:
        return None
