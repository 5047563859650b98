"""Documents with arrays as bytes of a known layout: reading them executes nothing.

A message is ``EVO1``, the length of a JSON document, the document, and the bytes of the arrays, one
after the other. The document's last key, ``arrays``, lists their types and shapes.
"""

import json
import math
import struct
from collections.abc import Sequence

import numpy as np

from evocity.store.schema import plain

_MAGIC = b"EVO1"
_HEAD = struct.Struct("<4sQ")
#: The longest document, bytes; the most arrays, and the most axes of one.
MOST_TEXT, MOST_ARRAYS, _MOST_AXES = 1 << 26, 1 << 16, 4
#: The types of arrays in a message.
_TYPES = {
    np.dtype(name).str: np.dtype(name)
    for name in ("?", "u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8", "c16")
}


def write_message(document: dict, arrays: Sequence[np.ndarray]) -> bytes:
    """Return the bytes of a ``document`` with ``arrays``. Raises TypeError or ValueError for what
    JSON cannot hold."""
    arrays = [np.ascontiguousarray(one) for one in arrays]
    table = [(one.dtype.str, one.shape) for one in arrays]
    text = json.dumps(document | {"arrays": table}, default=plain).encode()
    head = _HEAD.pack(_MAGIC, len(text))
    return b"".join([head, text, *(one.tobytes() for one in arrays)])


def read_message(message: bytes | memoryview) -> tuple[dict, list[np.ndarray]]:
    """Return the document and the arrays, read-only, of a message. Raises ValueError for any
    other bytes."""
    try:
        return _read(memoryview(message))
    except (struct.error, TypeError, LookupError, RecursionError, OverflowError) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None


def _read(message: memoryview) -> tuple[dict, list[np.ndarray]]:
    magic, length = _HEAD.unpack_from(message)
    start = _HEAD.size + length
    if magic != _MAGIC or length > MOST_TEXT or start > len(message):
        raise ValueError("bytes of another layout")
    document = json.loads(bytes(message[_HEAD.size : start]))
    if not isinstance(document, dict):
        raise ValueError("a document that is not an object")
    table = document.pop("arrays")
    if not isinstance(table, list) or len(table) > MOST_ARRAYS:
        raise ValueError("no table of arrays")
    arrays = []
    for name, shape in table:
        dtype = _TYPES[name]
        if len(shape) > _MOST_AXES or not all(type(one) is int and one >= 0 for one in shape):
            raise ValueError(f"an array of the shape {shape}")
        count = math.prod(shape)
        end = start + count * dtype.itemsize
        if end > len(message):
            raise ValueError("an array that ends after the message")
        arrays.append(np.frombuffer(message[start:end], dtype).reshape(shape))
        start = end
    if start != len(message):
        raise ValueError(f"{len(message) - start} bytes after the last array")
    return document, arrays
