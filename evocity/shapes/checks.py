"""Checks of arrays and numbers, of maps and colours of shapes, and errors of shapes."""

from collections.abc import Callable

import numpy as np

from evocity.errors import check_number, spell
from evocity.shapes.languages import ShapeError

#: The most maps of a shape.
MOST_MAPS = 256


def array_like(
    given: object, what: str, allowed: str, fits: Callable[[tuple[int, ...]], bool]
) -> np.ndarray:
    """Convert to a read-only array of finite floats whose shape ``fits``; raises `ShapeError`.

    what, allowed : the plural of the values, and the allowed shapes, for messages.
    """
    try:
        array = np.array(given, np.float64)
    except (TypeError, ValueError):
        array = np.zeros(0)
    if not fits(array.shape):
        raise ShapeError(
            f"the {what} have the shape {array.shape}",
            f"an array of the shape {allowed}",
            f"give the {what} in this shape",
        )
    if not np.isfinite(array).all():
        at = int(np.argwhere(~np.isfinite(array))[0, 0])
        raise ShapeError(
            f"entry {at} of the {what} is not finite",
            "finite numbers in all entries; the first entry has the number 0",
            f"correct entry {at} of the {what}",
        )
    array.setflags(write=False)
    return array


def check_range(name: str, value: float, low: float, high: float, whole: bool = False) -> None:
    """Raise `ShapeError` unless a parameter is a number, or a ``whole`` one, of low…high."""
    expected = f"a {'whole ' * whole}number of {low}…{high}"
    check_number(name, value, low, high, expected, ShapeError, f"choose another {name}", whole)


def maps_of(given: object) -> np.ndarray:
    """Convert to maps, float ``(N, m, m + 1)``, read-only; raises `ShapeError`."""
    allowed = "(N, 2, 3) in the plane, or (N, 3, 4) in space"
    maps = array_like(given, "maps", allowed, lambda shape: shape[1:] in ((2, 3), (3, 4)))
    if not 1 <= len(maps) <= MOST_MAPS:
        raise ShapeError(
            f"a shape cannot have {len(maps)} affine maps",
            f"1 to {MOST_MAPS} affine maps",
            "remove some maps, or add a map",
        )
    return maps


def colours_of(given: object, count: int) -> np.ndarray | None:
    """Convert to colours, float ``(count, 3)``, read-only, or None; raises `ShapeError`."""
    if given is None:
        return None
    colours = np.array(given, np.float64)
    if colours.shape != (count, 3) or not (colours >= 0).all() or not (colours <= 1).all():
        raise ShapeError(
            f"the colours {spell(colours.tolist())} are invalid",
            f"three numbers from 0 to 1 (red, green and blue) for each of {count} affine maps",
            "correct the colours",
        )
    colours.setflags(write=False)
    return colours


def check_same_space(first, second) -> None:
    """Raise `ShapeError` if one of two shapes lies in the plane and the other in space."""
    if first.size != second.size:
        raise ShapeError(
            "one shape is two-dimensional, and the other shape is three-dimensional",
            "two shapes with the same number of coordinates",
            "choose two shapes that are both two-dimensional or both three-dimensional",
        )


def corners(box: np.ndarray) -> np.ndarray:
    """List the corners of a ``box`` ``(2, m)``."""
    return np.stack(np.meshgrid(*box.T, indexing="ij"), -1).reshape(-1, box.shape[1])


def finite_language_error(remedy: str = "draw the shape to a depth=") -> ShapeError:
    """Make the error for a shape whose words end."""
    found = "the language of the shape has only finitely many words"
    return ShapeError(found, "a language with words of any length", remedy)


def piece_count_error(count: int, most: int, more: str = "") -> ShapeError:
    """Make the error for too many pieces."""
    return ShapeError(
        f"the shape would have {count} pieces{more}",
        f"at most {most} pieces",
        "choose a smaller depth or larger pixels, or raise the limit with the parameter 'most'",
    )


def read_only(array: np.ndarray) -> np.ndarray:
    """View an ``array`` in C order so that nobody writes: numba compiles a kernel once more for
    arrays that can be written."""
    view = np.ascontiguousarray(array).view()
    view.flags.writeable = False
    return view
