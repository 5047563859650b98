"""What a shape may be made of."""

import warnings
from dataclasses import replace

import numpy as np

from evocity.errors import shown
from evocity.shapes.contraction import Contraction
from evocity.shapes.languages import ShapeError
from evocity.shapes.primitives import Primitive

#: The most maps of a shape.
MOST_MAPS = 256


def maps_of(given: object) -> np.ndarray:
    try:
        maps = np.array(given, np.float64)
    except (TypeError, ValueError):
        maps = np.zeros(0)
    if maps.ndim != 3 or maps.shape[1] not in (2, 3) or maps.shape[2] != maps.shape[1] + 1:
        raise ShapeError(
            f"maps of shape {maps.shape}", "(N, 2, 3) or (N, 3, 4)", "give a matrix a map"
        )
    if not 1 <= len(maps) <= MOST_MAPS:
        raise ShapeError(f"{len(maps)} maps", f"1…{MOST_MAPS}", "give others")
    if not np.isfinite(maps).all():
        at = int(np.argwhere(~np.isfinite(maps))[0, 0])
        raise ShapeError(f"map {at} with a number that is not finite", "finite ones", "correct it")
    maps.setflags(write=False)
    return maps


def colours_of(given: object, count: int) -> np.ndarray | None:
    if given is None:
        return None
    colours = np.array(given, np.float64)
    if colours.shape != (count, 3) or not (colours >= 0).all() or not (colours <= 1).all():
        raise ShapeError(
            f"colours {shown(colours.tolist())}", f"{count} times red, green, blue, each 0…1",
            "correct them",
        )  # fmt: skip
    colours.setflags(write=False)
    return colours


def in_space(primitive: Primitive, size: int) -> Primitive:
    """A primitive of the plane laid into space where that is needed."""
    if primitive.size == size:
        return primitive
    if primitive.size > size:
        raise ShapeError("a primitive of space for maps of the plane", "one of the plane", "choose")
    points = np.column_stack([primitive.points, np.zeros(len(primitive.points))])
    return replace(primitive, points=points)


def corners(box: np.ndarray) -> np.ndarray:
    return np.stack(np.meshgrid(*box.T, indexing="ij"), -1).reshape(-1, box.shape[1])


def no_long_words() -> ShapeError:
    return ShapeError(
        "a language without words of any length", "one whose words go on", "draw it to a depth="
    )


def too_many(count: int, most: int, more: str = "") -> ShapeError:
    return ShapeError(
        f"{count} pieces{more}", f"at most {most}", "draw it less deep, or coarser, or raise most="
    )


def refused_growth(found: Contraction) -> None:
    """Raise `ShapeError`, which names them, for maps that do not contract; warn where it is not
    known."""
    if found.refuted:
        named = " ".join(map(str, found.word))
        raise ShapeError(
            f"map {named}, whose spectral radius is {found.lower:.4g}"
            if len(found.word) == 1
            else f"maps {named} one after another, whose spectral radius is "
            f"{found.lower ** len(found.word):.4g}",
            "maps whose long products contract: a spectral radius below 1",
            "make these maps smaller, or leave their word out of the language",
        )
    if not found.proved:
        warnings.warn(
            f"maps of which it is not known whether they contract: the joint spectral radius "
            f"lies between {found.lower:.4g} and {found.upper:.4g}",
            stacklevel=4,
        )


__all__ = [
    "MOST_MAPS",
    "colours_of",
    "corners",
    "in_space",
    "maps_of",
    "no_long_words",
    "refused_growth",
    "too_many",
]
