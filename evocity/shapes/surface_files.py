"""Files of surfaces: JSON, or Parquet of one row, as the files of curves."""

import os
from dataclasses import dataclass

import numpy as np

from evocity.errors import is_whole
from evocity.shapes.files import parse_document, read_document, write_document
from evocity.shapes.languages import ShapeError
from evocity.shapes.surface_detail import DetailedSurface


@dataclass(frozen=True, eq=False)
class StoredSurface:
    """A surface with its place on Earth and its attribution.

    surface : the surface with its details.
    crs : reference system as a code or a PROJ string; None for a surface without a place.
    corner : (x, y) of the first height, which is the north-west one, metres.
    attribution : credit line that the licence of the surface's source requires.
    """

    surface: DetailedSurface
    crs: str | None = None
    corner: tuple[float, float] = (0.0, 0.0)
    attribution: str = ""


def write_surface(stored: StoredSurface, path: str | os.PathLike) -> None:
    """Write a surface with its details to a file: Parquet if the name ends in .parquet, else JSON.

    The keys of the file are ``evocity`` ("surface"), ``version``, ``rows``, ``columns``, ``depth``,
    ``kept``, ``heights``, ``spacing``, ``crs``, ``corner`` and ``attribution``. The key ``heights``
    holds the heights of the level ``kept``, because finer levels have no details.
    """
    surface = stored.surface
    document = {
        "evocity": "surface",
        "version": 1,
        "rows": surface.rows.tolist(),
        "columns": surface.columns.tolist(),
        "depth": surface.depth,
        "kept": surface.kept,
        "heights": surface.heights(surface.kept).tolist(),
        "spacing": list(surface.spacing),
        "crs": stored.crs,
        "corner": list(stored.corner),
        "attribution": stored.attribution,
    }
    write_document(document, path)


def read_surface(path: str | os.PathLike) -> StoredSurface:
    """Read a surface from a file with the keys that `write_surface` writes. Raises `ShapeError` for
    a file without these keys."""
    return parse_document(read_document(path), os.fspath(path), "surface", _surface_of)


def _surface_of(document: dict) -> StoredSurface:
    depth, kept = document["depth"], document["kept"]
    if not (is_whole(depth) and is_whole(kept) and 0 <= kept <= depth <= 64):
        raise ShapeError(
            "one of the keys 'depth' and 'kept' has an invalid value",
            "whole numbers with 'kept' ≤ 'depth' ≤ 64",
            "correct the values of 'depth' and 'kept'",
        )
    crs, attribution = document["crs"], document["attribution"]
    corner = tuple(float(value) for value in document["corner"])
    if not isinstance(crs, str | None) or not isinstance(attribution, str) or len(corner) != 2:
        raise ShapeError(
            "the value of the key 'crs', 'corner' or 'attribution' is invalid",
            "a text for 'attribution', a text or null for 'crs', and two numbers for 'corner'",
            "correct these values",
        )
    rows, columns = (np.array(document[name], np.float64) for name in ("rows", "columns"))
    down, across = (float(side) for side in document["spacing"])
    spacing = down, across
    own = DetailedSurface.drawn(document["heights"], rows, columns, kept, depth, spacing)
    return StoredSurface(own, crs, corner, attribution)
