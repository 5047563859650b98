"""Widths of streets from façade to façade, at several places of each edge."""

from dataclasses import dataclass

import numpy as np

from evocity.views.streets.facades._kernels import distances_along

#: Distance between two places of an edge where the street is measured, metres.
EVERY = 2.0
#: The direction of a street at a place: from so far before it to so far after it, metres.
BESIDE = 6.0
#: Farthest façade from the middle line, metres; what is farther away is not a street's other side.
FARTHEST = 100.0
#: A width of more than so many times that between the nearest walls, or the edge's median, is a gap
#: between houses, or leads into another street.
GAP = 1.5


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
    ground: np.ndarray,
    across: np.ndarray,
    square: np.ndarray,
    pixel: float,
) -> FacadeWidths:
    """Measure the width of streets across their middle lines.

    points : float64 ``(k, 2)``, row and column of the points of all edges, about a pixel apart.
    starts : int64 ``(m + 1,)``: edge e has ``points[starts[e] : starts[e + 1]]``. ground : uint8
    ``(H, W)``, 0 open, 1 wall, 2 beyond the map. across : ``(k,)``, width between the nearest walls
    at each point, px. square : bool ``(m,)``, whether an edge runs along a square, where the other
    side of the square is the next façade. pixel : side of a pixel, metres.

    A ray leaves the line to each side, square to it, every `EVERY` metres. A place counts if both
    rays meet a wall within `FARTHEST`, and its width is not a gap (`GAP`). About 1 ms at 256².
    """
    count = len(starts) - 1
    at, edge = _places(starts, across, EVERY / pixel)
    reach = max(round(BESIDE / pixel), 1)
    before = np.maximum(at - reach, starts[edge])
    after = np.minimum(at + reach, starts[edge + 1] - 1)
    way = points[after] - points[before]
    size = np.hypot(*way.T)
    at, edge, way = at[size > 0], edge[size > 0], way[size > 0] / size[size > 0, None]
    aside = np.column_stack([-way[:, 1], way[:, 0]])
    sides = np.empty((2, len(at)))
    for side, sign in enumerate((1.0, -1.0)):
        distances_along(ground, points[at], sign * aside, FARTHEST / pixel, sides[side])
    both = (sides >= 0).all(axis=0)
    edge, width, near = edge[both], sides.sum(axis=0)[both], across[at[both]]
    street = square[edge] | (width <= GAP * near + 1)
    edge, width = edge[street], width[street] * pixel
    usual = _of_edges(edge, width, count, np.median)
    kept = width <= GAP * usual[edge]
    edge, width = edge[kept], width[kept]
    median, low, high = (_of_edges(edge, width, count, f) for f in (np.median, np.min, np.max))
    return FacadeWidths(median, low, high, np.bincount(edge, minlength=count).astype(np.int32))


def _places(starts: np.ndarray, across: np.ndarray, every: float) -> tuple[np.ndarray, np.ndarray]:
    """List the points to measure at, and their edges: one each ``every`` px, in the middle of equal
    parts of the edge without its ends in crossings, half of its width each."""
    places, edges = [], []
    for edge in range(len(starts) - 1):
        begin, end = int(starts[edge]), int(starts[edge + 1]) - 1
        cut = min(0.5 * float(np.median(across[begin : end + 1])), 0.3 * (end - begin))
        first, last = begin + cut, end - cut
        parts = max(int((last - first) / every), 1)
        own = first + (np.arange(parts) + 0.5) * (last - first) / parts
        places.append(np.floor(own + 0.5).astype(np.int64))
        edges.append(np.full(parts, edge))
    if not places:
        return np.empty(0, np.int64), np.empty(0, np.int64)
    return np.concatenate(places), np.concatenate(edges)


def _of_edges(edge: np.ndarray, values: np.ndarray, count: int, reduce) -> np.ndarray:
    """Reduce the ``values`` of each edge, in the order of edges: float64 ``(count,)``, NaN for
    none."""
    results = np.full(count, np.nan)
    own, first = np.unique(edge, return_index=True)
    ends = np.append(first[1:], len(values))
    for k, begin, end in zip(own.tolist(), first.tolist(), ends[: len(own)].tolist(), strict=True):
        results[k] = reduce(values[begin:end])
    return results
