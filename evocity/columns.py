"""Conversion between numpy arrays and columns of Arrow, without copies where possible.

`pyarrow.array` loads pandas, where it is installed, to test for its series: that takes longer than
reading a genome. Loading `pyarrow.compute` takes as long as loading the rest of Arrow. So this
module uses buffers for numbers, booleans and dictionary-coded words.
"""

import numpy as np
import pyarrow as pa


def column_of(values: np.ndarray) -> pa.Array:
    """Convert numbers or booleans ``(n,)`` to a column that shares memory with numbers."""
    values = np.ascontiguousarray(values)
    items = np.packbits(values, bitorder="little") if values.dtype == bool else values
    kind = pa.from_numpy_dtype(values.dtype)
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(items)])


def array_of(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Convert a ``column`` of numbers or booleans to a read-only array ``(n,)``. Nulls of floats
    become NaN; raises ValueError for other nulls, and for other types."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    values = _items(array)
    if array.null_count:
        if not pa.types.is_floating(array.type):
            raise ValueError(f"a column of {array.type} with nulls")
        values = np.where(_is_valid(array), values, np.nan)
    values.setflags(write=False)
    return values


def _items(array: pa.Array) -> np.ndarray:
    """Return the values of an ``array``; arbitrary ones where it is null."""
    kind = array.type
    if not (kind == pa.bool_() or pa.types.is_integer(kind) or pa.types.is_floating(kind)):
        raise ValueError(f"a column of {kind}, not of numbers")
    start, stop = array.offset, array.offset + len(array)
    _, items = array.buffers()
    if kind == pa.bool_():
        return _truths(items)[start:stop]
    return np.frombuffer(items or b"", kind.to_pandas_dtype())[start:stop]


def lists_of(column: pa.ListArray | pa.ChunkedArray) -> tuple[np.ndarray, np.ndarray]:
    """Return the lengths of a ``column`` of lists of numbers, int64 ``(n,)``, 0 for null, and their
    values one after the other. Raises ValueError for a null among whole numbers."""
    chunks = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
    lengths = [np.empty(0, np.int64)]
    values = [np.empty(0, column.type.value_type.to_pandas_dtype())]
    for chunk in chunks:
        offsets = array_of(chunk.offsets)
        within = np.diff(offsets)
        lengths.append(np.where(_is_valid(chunk), within, 0))
        if lengths[-1].sum() < within.sum():  # null lists may have values, which do not count
            values.append(array_of(chunk.flatten()))
        elif len(chunk):
            values.append(array_of(chunk.values)[offsets[0] : offsets[-1]])
    return np.concatenate(lengths), np.concatenate(values)


def known_of(column: pa.ChunkedArray) -> np.ndarray:
    """Mark the rows of a ``column`` with a value, bool ``(n,)``."""
    return np.concatenate([np.empty(0, bool), *map(_is_valid, column.chunks)])


def _is_valid(array: pa.Array) -> np.ndarray:
    if not array.null_count:
        return np.ones(len(array), bool)
    return _truths(array.buffers()[0])[array.offset : array.offset + len(array)]


def words_of(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Convert a ``column`` of texts, of any type of Arrow, to ``(n,)``; None for null."""
    if not pa.types.is_dictionary(column.type):
        column = column.cast("string").dictionary_encode()
    coded = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    words = np.array([*coded.dictionary.to_pylist(), None], object)
    return words[np.where(_is_valid(coded.indices), _items(coded.indices), -1)]


def _truths(bits: pa.Buffer | None) -> np.ndarray:
    return np.unpackbits(np.frombuffer(bits or b"", np.uint8), bitorder="little").view(bool)
