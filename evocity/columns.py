"""Arrays as columns of Arrow, as they lie in memory.

`pyarrow.array` loads pandas, where it is installed, to see whether it was given one of its series:
that takes longer than reading a genome.
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
    there, items = array.buffers()
    start, stop = array.offset, array.offset + len(array)
    if array.type == pa.bool_():
        found = _truths(items)[start:stop]
    else:
        found = np.frombuffer(items or b"", array.type.to_pandas_dtype())[start:stop]
    if array.null_count:
        if not pa.types.is_floating(array.type):
            raise ValueError(f"a column of {array.type} with nulls")
        found = np.where(_truths(there)[start:stop], found, np.nan)
    found.setflags(write=False)
    return found


def words_of(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Texts of a ``column``, ``(n,)``, of any type that Arrow keeps words in; None for null."""
    words = column.cast("string")
    words = words.combine_chunks() if isinstance(words, pa.ChunkedArray) else words
    words = words.dictionary_encode(null_encoding="encode")
    return np.array(words.dictionary.to_pylist(), object)[array_of(words.indices)]


def _truths(bits: pa.Buffer | None) -> np.ndarray:
    return np.unpackbits(np.frombuffer(bits or b"", np.uint8), bitorder="little").view(bool)
