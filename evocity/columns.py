"""Arrays as columns of Arrow, as they lie in memory.

`pyarrow.array` loads pandas, where it is installed, to see whether it was given one of its series:
that takes longer than reading a genome. Loading `pyarrow.compute` takes as long as loading the rest
of Arrow: nothing here needs it for numbers, truths and words that are coded as a dictionary.
"""

import numpy as np
import pyarrow as pa


def column_of(values: np.ndarray) -> pa.Array:
    """Numbers or truths ``(n,)`` as a column of the same type, without nulls. It shares memory
    with ``values``, which must not change, but for truths, which Arrow keeps in bits."""
    values = np.ascontiguousarray(values)
    items = np.packbits(values, bitorder="little") if values.dtype == bool else values
    kind = pa.from_numpy_dtype(values.dtype)
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(items)])


def array_of(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Numbers or truths of a ``column``, ``(n,)``, of its type; read-only. NaN for null, which only
    floats may have: ValueError otherwise."""
    array = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    found = _items(array)
    if array.null_count:
        if not pa.types.is_floating(array.type):
            raise ValueError(f"a column of {array.type} with nulls")
        found = np.where(_known(array), found, np.nan)
    found.setflags(write=False)
    return found


def _items(array: pa.Array) -> np.ndarray:
    """What stands in the rows of an ``array``; anything where it is null."""
    start, stop = array.offset, array.offset + len(array)
    _, items = array.buffers()
    if array.type == pa.bool_():
        return _truths(items)[start:stop]
    return np.frombuffer(items or b"", array.type.to_pandas_dtype())[start:stop]


def lists_of(column: pa.ListArray | pa.ChunkedArray) -> tuple[np.ndarray, np.ndarray]:
    """How long the lists of numbers of a ``column`` are, int64 ``(n,)``, 0 where there is none, and
    what stands in them, one after the other. ValueError for a null among whole numbers."""
    chunks = column.chunks if isinstance(column, pa.ChunkedArray) else [column]
    lengths = [np.empty(0, np.int64)]
    values = [np.empty(0, column.type.value_type.to_pandas_dtype())]
    for one in chunks:
        offsets = array_of(one.offsets)
        within = np.diff(offsets)
        lengths.append(np.where(_known(one), within, 0))
        if lengths[-1].sum() < within.sum():  # what stands where there is none is no value
            values.append(array_of(one.flatten()))
        elif len(one):
            values.append(array_of(one.values)[offsets[0] : offsets[-1]])
    return np.concatenate(lengths), np.concatenate(values)


def known_of(column: pa.ChunkedArray) -> np.ndarray:
    """Bool ``(n,)``: which rows of a ``column`` have a value."""
    return np.concatenate([np.empty(0, bool), *map(_known, column.chunks)])


def _known(array: pa.Array) -> np.ndarray:
    if not array.null_count:
        return np.ones(len(array), bool)
    return _truths(array.buffers()[0])[array.offset : array.offset + len(array)]


def words_of(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Texts of a ``column``, ``(n,)``, of any type that Arrow keeps words in; None for null."""
    if not pa.types.is_dictionary(column.type):
        column = column.cast("string").dictionary_encode()
    coded = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    words = np.array([*coded.dictionary.to_pylist(), None], object)
    return words[np.where(_known(coded.indices), _items(coded.indices), -1)]


def _truths(bits: pa.Buffer | None) -> np.ndarray:
    return np.unpackbits(np.frombuffer(bits or b"", np.uint8), bitorder="little").view(bool)
