"""Polylines of the plane: what may be one, the same with other points, where one crosses itself."""

import warnings

import numpy as np
import shapely
from numpy.typing import ArrayLike

from evocity.errors import setting
from evocity.shapes.languages import ShapeError

#: The most points of a line.
MOST_LINE = 2**20


def line_of(given: ArrayLike) -> np.ndarray:
    """A polyline as float ``(n, 2)``.

    Raises `ShapeError` for fewer than two points, points that follow each other at one place, and
    numbers that are not finite. The last point may be the first: then the line is closed.
    """
    try:
        line = np.array(given, np.float64)
    except (TypeError, ValueError):
        line = np.zeros(0)
    if line.ndim != 2 or line.shape[1] != 2:
        raise ShapeError(f"a line of shape {line.shape}", "(n, 2): x and y", "give a row a point")
    if not 2 <= len(line) <= MOST_LINE:
        raise ShapeError(
            f"a line of {len(line)} {'point' if len(line) == 1 else 'points'}",
            f"2…{MOST_LINE}",
            "give another",
        )
    if not np.isfinite(line).all():
        at = int(np.argwhere(~np.isfinite(line))[0, 0])
        raise ShapeError(f"point {at} that is not finite", "finite numbers", "correct it")
    same = np.flatnonzero((line[1:] == line[:-1]).all(axis=1))
    if len(same):
        raise ShapeError(
            f"points {same[0]} and {same[0] + 1} of a line at one place, {place_of(line[same[0]])}",
            "points that each lie elsewhere than the one before",
            "leave the second out",
        )
    return line


def lengths_of(line: np.ndarray) -> np.ndarray:
    """How far along a line ``(n, 2)`` each of its points lies, ``(n,)``, in its units."""
    steps = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def resampled(line: ArrayLike, count: int) -> np.ndarray:
    """``count`` points ``(count, 2)`` at equal steps along a line, its ends among them.

    Raises `ShapeError` as `line_of`, and for a count beyond 2…`MOST_LINE`.
    """
    line = line_of(line)
    if isinstance(count, bool) or not 2 <= count <= MOST_LINE:
        raise ShapeError(setting("count", count), f"2…{MOST_LINE}", "choose another")
    along = lengths_of(line)
    at = np.linspace(0, along[-1], count)
    found = np.column_stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)])
    found[0], found[-1] = line[0], line[-1]
    return found


def crossing_of(line: ArrayLike) -> np.ndarray | None:
    """A place ``(2,)`` where a line meets itself, None if it does nowhere. That the end is the
    beginning counts for nothing."""
    line = line_of(line)
    if shapely.is_simple(shapely.linestrings(line)):
        return None
    parts = shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1))
    first, second = shapely.STRtree(parts).query(parts, predicate="intersects")
    apart = second > first + 1
    if (line[0] == line[-1]).all():
        apart &= (first != 0) | (second != len(parts) - 1)
    pairs = np.column_stack([first, second])[apart]
    if not len(pairs):  # it turns back upon itself
        follows = parts[:-1], parts[1:]
        back = shapely.length(shapely.intersection(*follows)) > 0
        return line[1 + int(back.argmax())]
    one, other = pairs[np.lexsort(pairs.T[::-1])[0]]
    met = shapely.intersection(parts[one], parts[other])
    return shapely.get_coordinates(met)[0]


def tell_crossing(line: np.ndarray, name: str) -> bool:
    """Warn if a line meets itself, and where; whether it does."""
    place = crossing_of(line)
    if place is not None:
        warnings.warn(f"{name} crosses itself at {place_of(place)}", stacklevel=4)
    return place is not None


def place_of(point: np.ndarray) -> str:
    return f"({point[0]:.6g}, {point[1]:.6g})"


__all__ = [
    "MOST_LINE",
    "crossing_of",
    "lengths_of",
    "line_of",
    "place_of",
    "resampled",
    "tell_crossing",
]
