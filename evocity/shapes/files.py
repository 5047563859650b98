"""Files of shapes and curves: JSON, or Parquet of one row, with a type, a version and bounds."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from evocity.columns import array_of
from evocity.errors import is_whole, reason_of, spell
from evocity.files import whole_file
from evocity.sealed_parquet import ChangedFileError, open_table, write_table
from evocity.shapes.curve import Curve
from evocity.shapes.detail import Detailed
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.primitives import PRIMITIVES, Primitive, primitive_of
from evocity.shapes.shape import Shape

#: The largest file to read, bytes, and the most numbers in a Parquet file.
MOST_BYTES, MOST_NUMBERS = 64_000_000, 4_000_000
_ABOUT = b"evocity.document"
_VERSION = 1


@dataclass(frozen=True, eq=False)
class StoredCurve:
    """A curve that was read from a file, with the reference system and the attribution in the file.

    detailed : the curve with its details.
    crs : reference system of the curve's points, as a code or a PROJ string; None for a curve
        without a place on Earth.
    attribution : credit line that the licence of the curve's source requires.
    """

    detailed: Detailed
    crs: str | None = None
    attribution: str = ""


def write_shape(shape: Shape, path: str | os.PathLike) -> None:
    """Write a ``shape`` to a file: Parquet if the name ends in ``.parquet``, else JSON. If writing
    fails, no partial file remains.

    The keys of the file are ``evocity`` ("shape"), ``version``, ``maps``, ``primitive``,
    ``language``, ``colours`` and ``mix``. The key ``primitive`` holds a name, or points, lines and
    faces; null means the box around the attractor. The key ``language`` holds a table and its
    accepting states; null means all words.
    """
    write_document(shape_document(shape), path)


def shape_document(shape: Shape) -> dict:
    """Return the document that `write_shape` writes."""
    primitive = shape.primitive
    written: object = None
    if primitive is not None:
        names = [name for name in PRIMITIVES if _equal_primitives(primitive_of(name), primitive)]
        written = names[0] if names else {
            "points": primitive.points.tolist(),
            "lines": primitive.lines.tolist(),
            "faces": primitive.faces.tolist(),
        }  # fmt: skip
    language: object = None
    if shape.language != Language.every(len(shape)):
        least = shape.language.minimal
        language = {"table": least.table.tolist(), "accepting": least.accepting.tolist()}
    return {
        "evocity": "shape",
        "version": _VERSION,
        "maps": shape.maps.tolist(),
        "primitive": written,
        "language": language,
        "colours": None if shape.colours is None else shape.colours.tolist(),
        "mix": shape.mix,
    }


def read_shape(path: str | os.PathLike) -> Shape:
    """Read a shape from a file with the keys that `write_shape` writes.

    Raises `ShapeError` for a file without the keys of `write_shape`; the message names the wrong
    key.
    """
    return _read(path, "shape", _shape_of)


def write_curve(
    detailed: Detailed, path: str | os.PathLike, crs: str | None = None, attribution: str = ""
) -> None:
    """Write a curve with its details to a file: Parquet if the name ends in .parquet, else JSON.

    The keys of the file are ``evocity`` ("curve"), ``version``, ``maps``, ``shared``, ``depth``,
    ``kept``, ``points``, ``crs`` and ``attribution``. The key ``points`` holds the points of all
    polygons at the level ``kept``, because levels finer than ``kept`` have no details. A curve file
    is smaller by the factor ``1 / N^k`` if the k finest levels of a curve of N maps have no
    details.
    """
    write_document(curve_document(StoredCurve(detailed, crs, attribution)), path)


def curve_document(stored: StoredCurve) -> dict:
    """Return the document that `write_curve` writes."""
    detailed = stored.detailed
    return {
        "evocity": "curve",
        "version": _VERSION,
        "maps": detailed.curve.maps.tolist(),
        "shared": detailed.shared,
        "depth": detailed.depth,
        "kept": detailed.kept,
        "points": detailed.points(detailed.kept).tolist(),
        "crs": stored.crs,
        "attribution": stored.attribution,
    }


def read_curve(path: str | os.PathLike) -> StoredCurve:
    """Read a curve from a file with the keys that `write_curve` writes. Raises `ShapeError` for a
    file without the keys of `write_curve`."""
    return _read(path, "curve", _curve_of)


def _read(path: str | os.PathLike, kind: str, made):
    return parse_document(read_document(path), os.fspath(path), kind, made)


def parse_shape(document: dict, name: str) -> Shape:
    """Make a shape from a ``document`` of `write_shape`; ``name`` is its name in messages."""
    return parse_document(document, name, "shape", _shape_of)


def parse_curve(document: dict, name: str) -> StoredCurve:
    """Make a curve from a ``document`` of `write_curve`; ``name`` is its name in messages."""
    return parse_document(document, name, "curve", _curve_of)


def parse_document(document: dict, path: str, kind: str, made):
    """Make an object from a ``document`` by the function ``made``; raises `ShapeError` unless it is
    of the ``kind``."""
    if document.get("evocity") != kind:
        raise ShapeError(
            f"the document in {path} is not a {kind}",
            f'a file with the entry "evocity": "{kind}"',
            f"write the file with write_{kind}",
        )
    if document.get("version") != _VERSION:
        raise ShapeError(
            f"{path} has the unknown file version {spell(document.get('version'))}",
            f"a file of version {_VERSION}",
            "update evocity, or write the file again",
        )
    try:
        return made(document)
    except ShapeError as error:
        raise ShapeError(f"{path}: {error.found}", error.expected, error.remedy) from None
    except (TypeError, ValueError, OverflowError, KeyError, AttributeError):
        raise ShapeError(
            f"{path}: keys are missing, or values are not numbers",
            f"the keys and lists of numbers that write_{kind} writes",
            f"write the file again with write_{kind}",
        ) from None


def _curve_of(document: dict) -> StoredCurve:
    maps, points = (np.array(document[name], np.float64) for name in ("maps", "points"))
    depth, kept, shared = (document[name] for name in ("depth", "kept", "shared"))
    crs, attribution = document.get("crs"), document.get("attribution", "")
    whole = is_whole(depth) and is_whole(kept)
    if not whole or not isinstance(shared, bool) or not 0 <= kept <= depth <= 64:
        raise ShapeError(
            "one of the keys 'depth', 'kept' and 'shared' has an invalid value",
            "whole numbers with 'kept' ≤ 'depth' ≤ 64, and true or false for 'shared'",
            "correct the values of 'depth', 'kept' and 'shared'",
        )
    if not isinstance(crs, str | None) or not isinstance(attribution, str):
        raise ShapeError(
            "the value of the key 'crs' or 'attribution' is not a text",
            "a text for 'attribution', and a text or null for 'crs'",
            "correct the values of 'crs' and 'attribution'",
        )
    if maps.ndim != 3:
        Curve(np.zeros((2, 2)), maps)  # raises for their shape
    return StoredCurve(Detailed.drawn(points, maps, shared, kept, depth), crs, attribution)


def _shape_of(document: dict) -> Shape:
    primitive = document.get("primitive")
    if isinstance(primitive, dict):
        primitive = Primitive.of(
            primitive["points"], primitive.get("lines", ()), primitive.get("faces", ())
        )
    elif primitive is not None and not isinstance(primitive, str):
        raise ShapeError(
            "the value of the key 'primitive' is invalid",
            "the name of a primitive, or its points, lines and faces",
            "correct the value of the key 'primitive'",
        )
    language = document.get("language")
    if language is not None:
        language = Language(
            np.array(language["table"]), np.array(language["accepting"], dtype=object).astype(bool)
        )
    return Shape(
        document["maps"], primitive, language, document.get("colours"), document.get("mix", 0.5)
    )


def _equal_primitives(first: Primitive, second: Primitive) -> bool:
    names = ("points", "lines", "faces")
    return all(np.array_equal(getattr(first, name), getattr(second, name)) for name in names)


def write_document(document: dict, path: str | os.PathLike) -> None:
    """Write a JSON document; as Parquet if the name ends in .parquet: lists of numbers as columns,
    the rest in the schema's metadata."""
    try:
        with whole_file(path) as temporary:
            if Path(path).suffix.lower() == ".parquet":
                columns: dict[str, np.ndarray] = {}
                rest = _without_arrays(document, columns, "")
                table = pa.table({name: [array.ravel()] for name, array in columns.items()})
                about = {_ABOUT: json.dumps(rest, allow_nan=False)}
                write_table(table.replace_schema_metadata(about), temporary)
            else:
                temporary.write_text(json.dumps(document, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise ShapeError(
            f"{os.fspath(path)} cannot be written: {reason_of(error)}",
            "a file name in an existing folder",
            "choose another folder or file name",
        ) from None


def read_document(path: str | os.PathLike) -> dict:
    """Read the document of a file; {} for other content. Raises `ShapeError` for a file that is too
    large, or cannot be read."""
    path = Path(path)
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        found = f"{path} cannot be read: {reason_of(error)}"
        raise ShapeError(found, "the file of a shape or a curve", "check the path") from None
    if len(content) > MOST_BYTES:
        raise ShapeError(
            f"{path} exceeds {MOST_BYTES} bytes",
            f"a file of at most {MOST_BYTES} bytes",
            "simplify the shape or the curve",
        )
    try:
        if content[:4] == b"PAR1":
            return _of_parquet(path)
        document = json.loads(content.decode())
    except ChangedFileError as error:
        raise ShapeError(
            f"{path} is damaged: {error}",
            "the file as evocity wrote it",
            "restore the file from a copy, or write it again",
        ) from None
    except (ValueError, RecursionError, OSError, KeyError, TypeError, pa.ArrowException):
        document = None
    return document if isinstance(document, dict) else {}


def _of_parquet(path: Path) -> dict:
    file = open_table(path, (_ABOUT,), MOST_NUMBERS)
    about = file.metadata
    groups = [about.row_group(k) for k in range(about.num_row_groups)]
    numbers = sum(each.column(k).num_values for each in groups for k in range(each.num_columns))
    if about.num_rows != 1 or numbers > MOST_NUMBERS:
        raise ValueError(f"{about.num_rows} rows, {numbers} numbers")
    document = json.loads((file.schema_arrow.metadata or {})[_ABOUT])
    columns = file.read()
    for name, holder, key in list(_places(document, "")):
        shape = holder[key]["array"]
        holder[key] = array_of(columns[name].combine_chunks().flatten()).reshape(shape).tolist()
    return document if isinstance(document, dict) else {}


def _without_arrays(node: object, columns: dict[str, np.ndarray], name: str) -> object:
    """Replace lists of numbers in ``node`` by their shapes, and put the numbers into
    ``columns``."""
    if isinstance(node, dict):
        return {
            key: _without_arrays(value, columns, f"{name}.{key}".lstrip("."))
            for key, value in node.items()
        }
    if isinstance(node, list):
        array = np.array(node)
        if array.size and array.dtype.kind in "bif":
            columns[name] = array
            return {"array": list(array.shape)}
    return node


def _places(node: object, name: str) -> Iterator[tuple[str, dict, str]]:
    for key, value in node.items() if isinstance(node, dict) else ():
        below = f"{name}.{key}".lstrip(".")
        if isinstance(value, dict) and set(value) == {"array"}:
            yield below, node, key
        else:
            yield from _places(value, below)
