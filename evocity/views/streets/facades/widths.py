"""Widths of streets from façade to façade, at several places of each edge."""

from dataclasses import dataclass

import numpy as np

from evocity.views.streets.facades._kernels import distances_along

#: Distance between two places of an edge where the street is measured, metres.
EVERY = 1.0
#: The direction of a street at a place: from so far before it to so far after it, metres.
BESIDE = 6.0
#: Farthest façade from the middle line, metres; what is farther away is not a street's other side.
FARTHEST = 100.0
#: A width of more than so many times that between the nearest walls is a gap between houses.
GAP = 1.5
#: Greatest share of an edge that is cut off at each of its crossings.
MOST_CUT = 0.3


@dataclass(frozen=True, eq=False)
class FacadeWidths:
    """Widths of m edges from façade to façade, metres.

    median, low, high : float64 ``(m,)``, the median, the least and the greatest width of the places
    that have façades on both sides. places : int32 ``(m,)``, the number of these places; where an
    edge has no such place, the widths are NaN.
    """

    median: np.ndarray
    low: np.ndarray
    high: np.ndarray
    places: np.ndarray


def measure_facades(
    points: np.ndarray,
    starts: np.ndarray,
    path: np.ndarray,
    ground: np.ndarray,
    across: np.ndarray,
    square: np.ndarray,
    frame: np.ndarray,
    pixel: float,
) -> FacadeWidths:
    """Measure the width of streets across their middle lines.

    points : float64 ``(k, 2)``, row and column of the points of all edges, about a pixel apart.
    starts : int64 ``(m + 1,)``: edge e has ``points[starts[e] : starts[e + 1]]``. path : int64
    ``(k,)``, the pixel of each point. ground : uint8 ``(H, W)``, 0 open, 1 wall, 2 beyond the map.
    across : ``(k,)``, width between the nearest walls at each point, px. square : bool ``(m,)``,
    whether an edge runs along a square, where the other side of the square is the next façade.
    frame : bool ``(m, 2)``, whether the first and the last end of an edge lie on the map's border.
    pixel : side of a pixel, metres.

    A ray leaves the line to each side, square to it, every `EVERY` metres, except near crossings.
    A place counts if both rays meet a wall within `FARTHEST`, neither ray crosses the line of
    another street, and the width is not a gap (`GAP`). About 1 ms at 256².
    """
    count = len(starts) - 1
    at, edge = _places(points, starts, across, frame, EVERY / pixel)
    reach = max(round(BESIDE / pixel), 1)
    before = np.maximum(at - reach, starts[edge])
    after = np.minimum(at + reach, starts[edge + 1] - 1)
    way = points[after] - points[before]
    size = np.hypot(*way.T)
    at, edge, way = at[size > 0], edge[size > 0], way[size > 0] / size[size > 0, None]
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    number = np.where(square, 1, np.arange(2, count + 2)).astype(np.int32)
    lines, own = _number_lines(path, starts, number, ground.shape), number[edge]
    sides = np.empty((2, len(at)))
    for side, sign in enumerate((1.0, -1.0)):
        rays = points[at], sign * aside, own
        distances_along(ground, lines, *rays, FARTHEST / pixel, sides[side])
    both = (sides >= 0).all(axis=0)
    edge, width, near = edge[both], sides.sum(axis=0)[both], across[at[both]]
    street = square[edge] | (width <= GAP * near + 1)
    edge, width = edge[street], width[street] * pixel
    places = np.bincount(edge, minlength=count).astype(np.int32)
    return FacadeWidths(*_ranges(edge, width, count), places)


def _number_lines(
    path: np.ndarray, starts: np.ndarray, number: np.ndarray, shape: tuple[int, int]
) -> np.ndarray:
    """Write the ``number`` of each edge on its pixels: int32 ``(H, W)``, 0 elsewhere, and on the
    nodes, which are common to edges."""
    lines = np.zeros(shape, np.int32)
    lines.ravel()[path] = np.repeat(number, np.diff(starts))
    lines.ravel()[path[starts[:-1]]] = lines.ravel()[path[starts[1:] - 1]] = 0
    return lines


def _places(
    points: np.ndarray, starts: np.ndarray, across: np.ndarray, frame: np.ndarray, every: float
) -> tuple[np.ndarray, np.ndarray]:
    """List the points to measure at, and their edges: one each ``every`` px. An edge's middle
    always counts; each end in a crossing is left out, half a width and at most `MOST_CUT`."""
    count = len(starts) - 1
    edge = np.repeat(np.arange(count), np.diff(starts))
    along = np.cumsum(np.hypot(*np.diff(points, axis=0, prepend=points[:1]).T))
    along -= along[starts[:-1]][edge]
    length = along[starts[1:] - 1]
    half = 0.5 * _ranges(edge, across, count)[0]
    cut = np.where(frame, 0, np.minimum(half, MOST_CUT * length)[:, None])
    number = np.floor((along - cut[edge, 0]) / every)
    chosen = np.diff(number, prepend=-1) != 0
    chosen &= (along >= cut[edge, 0]) & (along <= (length - cut[:, 1])[edge])
    chosen[(starts[:-1] + starts[1:] - 1) // 2] = True
    at = np.flatnonzero(chosen)
    return at, edge[at]


def _ranges(
    edge: np.ndarray, values: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Find the median, the least and the greatest of the ``values`` of each edge: float64
    ``(count,)``, NaN for none."""
    ordered = values[np.lexsort([values, edge])].astype(float)
    times = np.bincount(edge, minlength=count)
    first, has = np.cumsum(times) - times, times > 0
    median, low, high = np.full((3, count), np.nan)
    first, times = first[has], times[has]
    median[has] = (ordered[first + (times - 1) // 2] + ordered[first + times // 2]) / 2
    low[has], high[has] = ordered[first], ordered[first + times - 1]
    return median, low, high
