"""Which straight lines are the walls? Runs of pixels' edges, and the lines fitted to them."""

from dataclasses import dataclass

import numpy as np

from evocity.views.walls.arcs import Arcs
from evocity.views.walls.fitting import _kernels

#: Of Douglas and Peucker on the middles of pixels' edges: so many pixels, or shares of a detail, if
#: that is more. A straight wall's are within .5 px of it; noise of a pixel's width is not followed.
TOLERANCE = 0.9, 0.7
#: Two runs are one whose middles lie within this of their line: pixels, or shares of a detail.
ONE_LINE = 0.6, 0.5
#: Lines that go on over a node are one if their points lie within this of it, px (root mean
#: square), and they differ by no more than these angles: in all, and over the shorter's length.
SPREAD, TURN, TURN_LENGTH = 0.45, 0.1, 1.0
#: A courtyard, or a building to which no four lines were fitted, of no more edges, px, is a
#: rectangle if that of its second moments is no more than so many times as large.
SMALL, RECTANGLE = 28, 1.2
#: Lines are turned to common angles by this at most, radians, and no end moves farther, px.
STEEP, ENDS = 0.45, 1.25
#: The second direction of a building: at least this share of its walls, so far from the first.
SECOND, APART = 0.25, np.radians(10.0)


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines fitted to `Arcs`, in pixels.

    runs : int64 ``(r, 2)``: first and last vertex of each straight run, arc by arc.
    begins : int64 ``(n + 1,)``: arc a has runs ``begins[a]`` to ``begins[a + 1] − 1``.
    line : int64 ``(r,)``: which line is each run's; runs that go on straight over a node share one.
    lines : float64 ``(k, 4)``: x, y of a point on each, and its direction.
    box_of : int64 ``(n,)``: −1, or which of the ``boxes`` stands for an arc, small and closed.
    boxes : float64 ``(b, 5, 2)``, corners of rectangles, the first again at the end.
    """

    runs: np.ndarray
    begins: np.ndarray
    line: np.ndarray
    lines: np.ndarray
    box_of: np.ndarray
    boxes: np.ndarray


def fitted(arcs: Arcs, details: np.ndarray, squared: bool, directions: np.ndarray) -> Lines:
    """Lines of the walls.

    Parameters
    ----------
    arcs : their vertices are turned: a closed one begins at a corner from now on.
    details : float64 ``(n,)``: of each arc, how long a run must be to count, px.
    squared : whether lines are turned to the one or two directions of their buildings even where
        they part other pixels then.
    directions : float64 ``(labels,)``: of the walls of each building, radians from east to south,
        NaN where unknown: what is too small to fit lines to is a rectangle that lies so.
    """
    runs = np.empty((len(arcs.vertices), 2), np.int64)
    begins = np.empty(len(arcs) + 1, np.int64)
    within = [np.maximum(pixels, share * details) for pixels, share in (TOLERANCE, ONE_LINE)]
    table = np.stack([*within, details], axis=1)
    _kernels.split_arcs(arcs.vertices, arcs.starts, arcs.ends, arcs.beyond, table, runs, begins)
    runs = runs[: begins[-1]].copy()
    sums = np.empty((len(runs), 8))
    _kernels.moments(arcs.vertices, runs, sums)
    group = np.empty(len(runs), np.int64)
    _kernels.pool(sums, arcs.nodes, *meeting(arcs, begins), group, TURN, TURN_LENGTH, SPREAD)
    roots, line = np.unique(group, return_inverse=True)
    lines = np.empty((len(roots), 4))
    _kernels.lines_of(sums[roots], lines)
    members = np.argsort(line, kind="stable")
    at = np.concatenate([[0], np.cumsum(np.bincount(line, minlength=len(lines)))])
    pixels = arcs.vertices, runs, members, at
    ranges = np.empty((len(lines), 3))
    _kernels.settle(*pixels, lines, ranges)
    common = _common(arcs, begins, line, sums[roots, 0], lines)
    _kernels.turn_within(*pixels, ranges, common, lines)
    if squared:
        _square(common, sums[roots, 0], lines)
    inner = np.append(directions, [np.nan, np.nan])  # of ground, and beyond, none
    of_arc = inner[np.where(arcs.left > 0, arcs.left, 0) - 1]
    of_arc = np.where(np.isnan(of_arc), inner[np.where(arcs.right > 0, arcs.right, 0) - 1], of_arc)
    box_of, boxes = np.empty(len(arcs), np.int64), np.empty((int(arcs.closed.sum()), 5, 2))
    able = arcs.closed & ((arcs.right == 0) | (np.diff(begins) < 4))  # inside is right
    _kernels.box_small(arcs.vertices, arcs.starts, able, of_arc, SMALL, RECTANGLE, box_of, boxes)
    return Lines(runs, begins, line, lines, box_of, boxes)


def meeting(arcs: Arcs, begins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The runs that end at each node, ``(m,)``, and where each node's begin there."""
    has = begins[1:] > begins[:-1]
    first, last = begins[:-1][has], begins[1:][has] - 1
    node = np.concatenate([arcs.ends[has, 0], arcs.ends[has, 1]])
    run = np.concatenate([first, last])[node >= 0]
    node = node[node >= 0]
    order = np.argsort(node, kind="stable")
    counts = np.bincount(node, minlength=len(arcs.nodes))
    return run[order], np.concatenate([[0], np.cumsum(counts)])


def _common(
    arcs: Arcs, begins: np.ndarray, line: np.ndarray, length: np.ndarray, lines: np.ndarray
) -> np.ndarray:
    """Float64 ``(k, 4)``: the one or two directions of the buildings on each side of each of the
    ``lines``, radians, NaN for none; ``length`` float64 ``(k,)``, theirs, px."""
    arc = np.repeat(np.arange(len(arcs)), np.diff(begins))
    # one row a run and building beside it
    beside = np.concatenate([arcs.left[arc], arcs.right[arc]])
    which = np.concatenate([line, line])
    which, beside = which[beside > 0], beside[beside > 0]
    angle = np.arctan2(lines[:, 3], lines[:, 2])
    weight = length[which] ** 2  # the longer, the better its angle is known
    count = int(beside.max(initial=0)) + 1
    first = _direction(beside, angle[which], weight, count)
    others = np.abs(_away(angle[which], first[beside])) > APART
    second = _direction(beside[others], angle[which[others]], weight[others], count)
    walls = np.bincount(beside, weight, count)
    near = np.abs(_away(angle[which], second[beside])) <= APART
    enough = np.bincount(beside[near], weight[near], count) >= SECOND * walls
    second[~enough] = np.nan
    found = np.full((len(lines), 4), np.nan)
    for column, side in ((0, arcs.left[arc]), (2, arcs.right[arc])):
        here = side > 0
        found[line[here], column] = first[side[here]]
        found[line[here], column + 1] = second[side[here]]
    return found


def _square(common: np.ndarray, length: np.ndarray, lines: np.ndarray) -> None:
    """Turn ``lines``, of which each has a ``length``, to the nearest of the directions in
    ``common`` where it is near."""
    angle = np.arctan2(lines[:, 3], lines[:, 2])
    by = _away(common, angle[:, None])
    by[np.isnan(by)] = np.inf
    turn = by[np.arange(len(lines)), np.abs(by).argmin(axis=1)]
    turn[np.abs(turn) > np.minimum(STEEP, 2 * ENDS / length)] = 0
    lines[:, 2], lines[:, 3] = np.cos(angle + turn), np.sin(angle + turn)


def _direction(building, angle, weight, count: int) -> np.ndarray:
    """Of each building the direction that most of its walls have, walls square to each other as
    one; radians, NaN for one without any."""
    bins = 45
    quarter = np.pi / 2
    at = np.floor(angle % quarter / quarter * bins).astype(np.int64) % bins
    table = np.bincount(building * bins + at, weight, count * bins).reshape(count, bins)
    around = table + np.roll(table, 1, axis=1) + np.roll(table, -1, axis=1)
    mode = (around.argmax(axis=1) + 0.5) * quarter / bins
    near = np.abs(_away(angle, mode[building])) <= 1.5 * quarter / bins
    fourfold = np.exp(4j * angle[near]) * weight[near]
    real = np.bincount(building[near], fourfold.real, count)
    imaginary = np.bincount(building[near], fourfold.imag, count)
    direction = np.arctan2(imaginary, real) / 4
    return np.where(around.max(axis=1) > 0, direction, np.nan)


def _away(angle: np.ndarray, other: np.ndarray) -> np.ndarray:
    """``angle`` − ``other`` to the nearest quarter turn, radians."""
    quarter = np.pi / 2
    return (angle - other + quarter / 2) % quarter - quarter / 2
