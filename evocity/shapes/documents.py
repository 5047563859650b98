"""Documents of numbers in files: JSON, or Parquet of one row; bounded, nothing in them executed."""

import json
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.columns import array_of
from evocity.files import whole_file
from evocity.shapes.languages import ShapeError

#: The largest file that is read, bytes, and the most numbers in one of Parquet.
MOST_BYTES, MOST_NUMBERS = 64_000_000, 4_000_000
_ABOUT = b"evocity.document"


def write_document(document: dict, path: str | os.PathLike) -> None:
    """Write what JSON can hold: as Parquet, lists of numbers as columns and the rest in the
    schema's metadata, if the name ends in .parquet; else as JSON."""
    try:
        with whole_file(path) as temporary:
            if Path(path).suffix.lower() == ".parquet":
                columns: dict[str, np.ndarray] = {}
                told = _without_arrays(document, columns, "")
                table = pa.table({name: [one.ravel()] for name, one in columns.items()})
                about = {_ABOUT: json.dumps(told, allow_nan=False)}
                pq.write_table(
                    table.replace_schema_metadata(about), temporary, compression="zstd",
                    write_page_checksum=True,
                )  # fmt: skip
            else:
                temporary.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise ShapeError(
            f"{os.fspath(path)} cannot be written: {error.strerror or error}",
            "a name in a folder that exists",
            "choose another",
        ) from None


def read_document(path: str | os.PathLike) -> dict:
    """The document of a file; {} if it is no object in JSON, nor such Parquet. Raises `ShapeError`
    for what is too large, and what cannot be read."""
    path = Path(path)
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ShapeError(
            f"{path}: {error.strerror}", "a file of a shape or a curve", "check the path"
        ) from None
    if len(content) > MOST_BYTES:
        raise ShapeError(f"{path}: more than {MOST_BYTES} bytes", "less", "simplify it")
    try:
        if content[:4] == b"PAR1":
            return _of_parquet(content)
        document = json.loads(content.decode())
    except (ValueError, RecursionError, OSError, KeyError, TypeError, pa.ArrowException):
        document = None
    return document if isinstance(document, dict) else {}


def _of_parquet(content: bytes) -> dict:
    file = pq.ParquetFile(pa.BufferReader(content), page_checksum_verification=True)
    about = file.metadata
    groups = [about.row_group(k) for k in range(about.num_row_groups)]
    numbers = sum(one.column(k).num_values for one in groups for k in range(one.num_columns))
    if about.num_rows != 1 or numbers > MOST_NUMBERS:
        raise ValueError(f"{about.num_rows} rows, {numbers} numbers")
    document = json.loads((file.schema_arrow.metadata or {})[_ABOUT])
    columns = file.read()
    for name, holder, key in list(_places(document, "")):
        shape = holder[key]["array"]
        holder[key] = array_of(columns[name].combine_chunks().flatten()).reshape(shape).tolist()
    return document if isinstance(document, dict) else {}


def _without_arrays(node: object, columns: dict[str, np.ndarray], name: str) -> object:
    """``node`` with lists of numbers replaced by their shapes; the numbers go into ``columns``."""
    if isinstance(node, dict):
        return {
            key: _without_arrays(one, columns, f"{name}.{key}".lstrip("."))
            for key, one in node.items()
        }
    if isinstance(node, list):
        array = np.array(node)
        if array.size and array.dtype.kind in "bif":
            columns[name] = array
            return {"array": list(array.shape)}
    return node


def _places(node: object, name: str) -> Iterator[tuple[str, dict, str]]:
    """Name, holder and key of each list that a column holds."""
    for key, one in node.items() if isinstance(node, dict) else ():
        below = f"{name}.{key}".lstrip(".")
        if isinstance(one, dict) and set(one) == {"array"}:
            yield below, node, key
        else:
            yield from _places(one, below)


__all__ = ["MOST_BYTES", "MOST_NUMBERS", "read_document", "write_document"]
