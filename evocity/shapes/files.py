"""Shapes and curves in files: JSON or Parquet that says what it is, bounded, nothing executed."""

import os
from dataclasses import dataclass

import numpy as np

from evocity.errors import shown
from evocity.shapes.curve import Curve
from evocity.shapes.detail import Detailed
from evocity.shapes.documents import read_document, write_document
from evocity.shapes.languages import Language, ShapeError
from evocity.shapes.primitives import PRIMITIVES, Primitive, primitive_of
from evocity.shapes.shape import Shape

_VERSION = 1


@dataclass(frozen=True, eq=False)
class StoredCurve:
    """A curve with what a file tells besides: in which reference system it lies (``crs``, a code
    or a PROJ string; None for nowhere on Earth), and what its source's licence asks for."""

    detailed: Detailed
    crs: str | None = None
    attribution: str = ""


def write_shape(shape: Shape, path: str | os.PathLike) -> None:
    """Write a shape, as Parquet if the name ends in .parquet, else as JSON; the file appears whole
    or not at all.

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
    write_document(document, path)


def read_shape(path: str | os.PathLike) -> Shape:
    """The shape of a file that `write_shape` wrote, or that has the same keys.

    Raises `ShapeError` for what is none, and whatever is wrong with it by its key.
    """
    return _read(path, "shape", _shape_of)


def write_curve(
    one: Detailed, path: str | os.PathLike, crs: str | None = None, attribution: str = ""
) -> None:
    """Write a curve with its details, as Parquet if the name ends in .parquet, else as JSON.

    Keys: ``evocity`` ("curve"), ``version``, ``maps``, ``shared``, ``depth``, ``kept``, ``points``,
    ``crs``, ``attribution``. ``points`` are those of all polygons at level ``kept``, below which
    there are no details: so a curve of which k levels are dropped takes N**-k of the room.
    """
    write_document(
        {
            "evocity": "curve",
            "version": _VERSION,
            "maps": one.curve.maps.tolist(),
            "shared": one.shared,
            "depth": one.depth,
            "kept": one.kept,
            "points": one.points(one.kept).tolist(),
            "crs": crs,
            "attribution": attribution,
        },
        path,
    )


def read_curve(path: str | os.PathLike) -> StoredCurve:
    """The curve of a file that `write_curve` wrote, or that has the same keys. Raises `ShapeError`
    for what is none."""
    return _read(path, "curve", _curve_of)


def _read(path: str | os.PathLike, kind: str, made):
    document = read_document(path)
    if document.get("evocity") != kind:
        raise ShapeError(f"{path}: no {kind}", f'"evocity": "{kind}"', f"write it by write_{kind}")
    if document.get("version") != _VERSION:
        raise ShapeError(
            f"{path}: version {shown(document.get('version'))}", f"{_VERSION}", "update evocity"
        )
    try:
        return made(document)
    except ShapeError as error:
        raise ShapeError(f"{path}: {error.found}", error.expected, error.remedy) from None
    except (TypeError, ValueError, OverflowError, KeyError, AttributeError):
        raise ShapeError(
            f"{path}: numbers that are none",
            f"lists of numbers, as write_{kind} tells",
            "correct it",
        ) from None


def _curve_of(document: dict) -> StoredCurve:
    maps, points = (np.array(document[name], np.float64) for name in ("maps", "points"))
    depth, kept, shared = (document[name] for name in ("depth", "kept", "shared"))
    whole = all(isinstance(one, int) and not isinstance(one, bool) for one in (depth, kept))
    crs, attribution = document.get("crs"), document.get("attribution", "")
    if not whole or not isinstance(shared, bool) or not 0 <= kept <= depth <= 64:
        raise ShapeError(
            "depth, kept or shared that are none", "whole numbers, kept ≤ depth; true or false",
            "correct them",
        )  # fmt: skip
    if not isinstance(crs, str | None) or not isinstance(attribution, str):
        raise ShapeError("crs or attribution that is no text", "text, or null", "correct it")
    if maps.ndim != 3:
        Curve(np.zeros((2, 2)), maps)  # which says what maps are
    return StoredCurve(Detailed.drawn(points, maps, shared, kept, depth), crs, attribution)


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


__all__ = ["StoredCurve", "read_curve", "read_shape", "write_curve", "write_shape"]
