"""Shapes in files: JSON that says what it is, bounded, and nothing in it executed."""

import json
import os
from pathlib import Path

import numpy as np

from evocity.errors import shown
from evocity.files import whole_file
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.primitives import PRIMITIVES, Primitive, primitive_of
from evocity.shapes.shape import Shape

#: The largest file that is read, bytes.
MOST_BYTES = 16_000_000
_VERSION = 1


def write_shape(shape: Shape, path: str | os.PathLike) -> None:
    """Write a shape as JSON; the file appears whole or not at all.

    Keys: ``evocity`` ("shape"), ``version``, ``maps``, ``primitive`` (a name, or points, lines,
    faces; null for the box of the attractor), ``language`` (table, accepting; null for all words),
    ``colours`` (null for none), ``mix``.
    """
    primitive = shape.primitive
    told: object = None
    if primitive is not None:
        names = [
            name for name in PRIMITIVES
            if _same(primitive_of(name), primitive)
        ]  # fmt: skip
        told = names[0] if names else {
            "points": primitive.points.tolist(),
            "lines": primitive.lines.tolist(),
            "faces": primitive.faces.tolist(),
        }  # fmt: skip
    language: object = None
    if shape.language != Language.every(len(shape)):
        least = shape.language.minimal
        language = {"table": least.table.tolist(), "accepting": least.accepting.tolist()}
    document = {
        "evocity": "shape",
        "version": _VERSION,
        "maps": shape.maps.tolist(),
        "primitive": told,
        "language": language,
        "colours": None if shape.colours is None else shape.colours.tolist(),
        "mix": shape.mix,
    }
    with whole_file(path) as temporary:
        temporary.write_text(json.dumps(document) + "\n", encoding="utf-8")


def read_shape(path: str | os.PathLike) -> Shape:
    """The shape of a file that `write_shape` wrote, or that has the same keys.

    Raises `ShapeError` for what is none, and whatever is wrong with it by its key.
    """
    path = Path(path)
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise ShapeError(
            f"{path}: {error.strerror}", "a file of a shape", "check the path, or name a known one"
        ) from None
    if len(content) > MOST_BYTES:
        raise ShapeError(f"{path}: more than {MOST_BYTES} bytes", "less", "simplify it")
    try:
        document = json.loads(content.decode())
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict) or document.get("evocity") != "shape":
        raise ShapeError(
            f"{path}: no shape", 'JSON with "evocity": "shape"', "write it by write_shape"
        )
    if document.get("version") != _VERSION:
        raise ShapeError(
            f"{path}: version {shown(document.get('version'))}", f"{_VERSION}", "update evocity"
        )
    try:
        return _shape_of(document)
    except ShapeError as error:
        raise ShapeError(f"{path}: {error.found}", error.expected, error.remedy) from None
    except (TypeError, ValueError, OverflowError, KeyError):
        raise ShapeError(
            f"{path}: numbers that are none", "lists of numbers, as write_shape tells", "correct it"
        ) from None


def _shape_of(document: dict) -> Shape:
    primitive = document.get("primitive")
    if isinstance(primitive, dict):
        primitive = Primitive.of(
            primitive["points"], primitive.get("lines", ()), primitive.get("faces", ())
        )
    elif primitive is not None and not isinstance(primitive, str):
        raise ShapeError(
            "a primitive that is none", "a name, or points, lines, faces", "correct it"
        )
    language = document.get("language")
    if language is not None:
        language = Language(
            np.array(language["table"]), np.array(language["accepting"], dtype=object).astype(bool)
        )
    return Shape(
        document["maps"], primitive, language, document.get("colours"), document.get("mix", 0.5)
    )


def _same(one: Primitive, other: Primitive) -> bool:
    pairs = ((one.points, other.points), (one.lines, other.lines), (one.faces, other.faces))
    return all(np.array_equal(a, b) for a, b in pairs)


__all__ = ["MOST_BYTES", "read_shape", "write_shape"]
