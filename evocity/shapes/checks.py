"""Checks of maps, colours and primitives of shapes, and their errors."""

import warnings
from dataclasses import replace

import numpy as np

from evocity.errors import spell
from evocity.shapes.contraction import Contraction
from evocity.shapes.languages import ShapeError
from evocity.shapes.primitives import Primitive

#: The most maps of a shape.
MOST_MAPS = 256


def maps_of(given: object) -> np.ndarray:
    """Convert to maps, float ``(N, m, m + 1)``, read-only; raises `ShapeError`."""
    try:
        maps = np.array(given, np.float64)
    except (TypeError, ValueError):
        maps = np.zeros(0)
    if maps.ndim != 3 or maps.shape[1] not in (2, 3) or maps.shape[2] != maps.shape[1] + 1:
        raise ShapeError(
            f"the maps have the shape {maps.shape}",
            "(N, 2, 3) or (N, 3, 4)",
            "give a matrix for each map",
        )
    if not 1 <= len(maps) <= MOST_MAPS:
        raise ShapeError(
            f"a shape cannot have {len(maps)} maps",
            f"1 to {MOST_MAPS} maps",
            "give another number of maps",
        )
    if not np.isfinite(maps).all():
        at = int(np.argwhere(~np.isfinite(maps))[0, 0])
        raise ShapeError(f"map {at} is not finite", "finite numbers", "correct this map")
    maps.setflags(write=False)
    return maps


def colours_of(given: object, count: int) -> np.ndarray | None:
    """Convert to colours, float ``(count, 3)``, read-only, or None; raises `ShapeError`."""
    if given is None:
        return None
    colours = np.array(given, np.float64)
    if colours.shape != (count, 3) or not (colours >= 0).all() or not (colours <= 1).all():
        raise ShapeError(
            f"invalid colours {spell(colours.tolist())}",
            f"{count} times red, green, blue, each 0…1",
            "correct the colours",
        )
    colours.setflags(write=False)
    return colours


def in_space(primitive: Primitive, size: int) -> Primitive:
    """Lay a primitive of the plane into space if ``size`` is 3."""
    if primitive.size == size:
        return primitive
    if primitive.size > size:
        raise ShapeError(
            "the primitive lies in space, but the maps in the plane",
            "a primitive of the plane",
            "choose another primitive",
        )
    points = np.column_stack([primitive.points, np.zeros(len(primitive.points))])
    return replace(primitive, points=points)


def corners(box: np.ndarray) -> np.ndarray:
    """List the corners of a ``box`` ``(2, m)``."""
    return np.stack(np.meshgrid(*box.T, indexing="ij"), -1).reshape(-1, box.shape[1])


def finite_language_error(remedy: str = "draw it to a depth=") -> ShapeError:
    """Make the error for a shape whose words end."""
    return ShapeError("a language of finitely many words", "endless words", remedy)


def piece_count_error(count: int, most: int, more: str = "") -> ShapeError:
    """Make the error for too many pieces."""
    return ShapeError(
        f"the shape would have {count} pieces{more}",
        f"at most {most} pieces",
        "lower the depth, draw coarser, or raise most=",
    )


def check_contraction(bounds: Contraction) -> None:
    """Raise `ShapeError`, which names them, for maps that do not contract; warn if it is
    unknown."""
    if bounds.refuted:
        named = " ".join(map(str, bounds.word))
        raise ShapeError(
            f"map {named}, whose spectral radius is {bounds.lower:.4g}"
            if len(bounds.word) == 1
            else f"maps {named} one after another, whose spectral radius is "
            f"{bounds.lower ** len(bounds.word):.4g}",
            "maps whose long products contract: a spectral radius below 1",
            "shrink these maps, or leave their word out of the language",
        )
    if not bounds.proved:
        warnings.warn(
            f"maps that may not contract: their joint spectral radius lies between "
            f"{bounds.lower:.4g} and {bounds.upper:.4g}",
            stacklevel=4,
        )
