"""Polylines of the plane: checks, resampling, and crossings."""

import warnings

import numpy as np
import shapely
from numpy.typing import ArrayLike

from evocity.shapes.checks import array_like, check_range
from evocity.shapes.languages import ShapeError

#: The most points of a line.
MOST_LINE = 2**20


def line_of(given: ArrayLike) -> np.ndarray:
    """Convert to a polyline, float ``(n, 2)``.

    Raises `ShapeError` for fewer than two points, points equal to the one before, and numbers that
    are not finite. In a closed line the last point equals the first.
    """
    line = array_like(
        given, "points of the line", "(n, 2)", lambda shape: len(shape) == 2 and shape[1] == 2
    )
    if not 2 <= len(line) <= MOST_LINE:
        raise ShapeError(
            f"the line has {len(line)} {'point' if len(line) == 1 else 'points'}",
            f"a line of 2 to {MOST_LINE} points",
            "give a line with more points" if len(line) < 2 else "simplify the line",
        )
    same = np.flatnonzero((line[1:] == line[:-1]).all(axis=1))
    if len(same):
        raise ShapeError(
            f"points {same[0]} and {same[0] + 1} of the line coincide at {place_of(line[same[0]])}",
            "points that each differ from the point before",
            f"leave point {same[0] + 1} out",
        )
    return line


def lengths_of(line: np.ndarray) -> np.ndarray:
    """Compute the distance of each point along a line ``(n, 2)``, ``(n,)``, in its units."""
    steps = np.sqrt((np.diff(line, axis=0) ** 2).sum(axis=1))
    return np.concatenate([[0.0], np.cumsum(steps)])


def resampled(line: ArrayLike, count: int) -> np.ndarray:
    """Resample a ``line`` at ``count`` points ``(count, 2)`` in equal steps; the two ends of the
    line stay.

    Raises `ShapeError` if the line is not a polyline of the plane, or if ``count`` is outside
    2…`MOST_LINE`.
    """
    line = line_of(line)
    check_range("count", count, 2, MOST_LINE)
    along = lengths_of(line)
    at = np.linspace(0, along[-1], count)
    points = np.column_stack([np.interp(at, along, line[:, axis]) for axis in (0, 1)])
    points[0], points[-1] = line[0], line[-1]
    return points


def crossing_of(line: ArrayLike) -> np.ndarray | None:
    """Find a place ``(2,)`` where a ``line`` crosses or touches itself; the result is None without
    a crossing. The common end point of a closed line does not count as a crossing."""
    line = line_of(line)
    if shapely.is_simple(shapely.linestrings(line)):
        return None
    parts = shapely.linestrings(np.stack([line[:-1], line[1:]], axis=1))
    first, second = shapely.STRtree(parts).query(parts, predicate="intersects")
    apart = second > first + 1
    if (line[0] == line[-1]).all():
        apart &= (first != 0) | (second != len(parts) - 1)
    pairs = np.column_stack([first, second])[apart]
    if not len(pairs):  # the line turns back on itself
        follows = parts[:-1], parts[1:]
        back = shapely.length(shapely.intersection(*follows)) > 0
        return line[1 + int(back.argmax())]
    first, second = pairs[np.lexsort(pairs.T[::-1])[0]]
    met = shapely.intersection(parts[first], parts[second])
    return shapely.get_coordinates(met)[0]


def warn_crossing(line: np.ndarray, name: str) -> bool:
    """Warn, with the place, if a line meets itself; return whether it does."""
    place = crossing_of(line)
    if place is not None:
        warnings.warn(f"{name} crosses itself at {place_of(place)}", stacklevel=4)
    return place is not None


def place_of(point: np.ndarray) -> str:
    """Format a point for messages."""
    return f"({point[0]:.6g}, {point[1]:.6g})"
