"""Line fitting: straight runs of pixels' edges, and the lines fitted to them."""

from dataclasses import dataclass

import numpy as np

from evocity.views.walls.arcs import Arcs
from evocity.views.walls.fitting import _kernels

#: Tolerance of Douglas and Peucker on the middles of pixels' edges: pixels, or a share of a detail,
#: whichever is more. The middles of a straight wall are within .5 px of it; the fit ignores noise
#: of a pixel's width.
TOLERANCE = 0.9, 0.7
#: Distance of the middles of two runs from a common line up to which they unite: pixels, or a
#: share of a detail.
ONE_LINE = 0.6, 0.5
#: Lines on both sides of a node unite if their points lie within this of a common line, px (root
#: mean square), and they differ by no more than these angles: in all, and per shorter length.
SPREAD, TURN, TURN_LENGTH = 0.45, 0.1, 1.0
#: Most edges, px, of a courtyard, or of a building of fewer than four lines, that may become a
#: rectangle; greatest ratio of the rectangle of its second moments to its area.
SMALL, RECTANGLE = 28, 1.2
#: Greatest turn of a line to a common angle, radians, and greatest move of its ends, px.
STEEP, ENDS = 0.45, 1.25
#: Second direction of a building: least share of its walls, and least angle from the first.
SECOND, APART = 0.25, np.radians(10.0)


@dataclass(frozen=True, eq=False)
class Lines:
    """Lines fitted to `Arcs`, in pixels.

    runs : int64 ``(r, 2)``: first and last vertex of each straight run, arc by arc.
    begins : int64 ``(n + 1,)``: arc a has runs ``begins[a]`` to ``begins[a + 1] − 1``.
    line : int64 ``(r,)``: the line of each run; runs that go on straight over a node share one.
    lines : float64 ``(k, 4)``: x, y of a point on each, and its direction.
    box_of : int64 ``(n,)``: the number in ``boxes`` of a small closed arc's rectangle, or −1.
    boxes : float64 ``(b, 5, 2)``, corners of rectangles, the first again at the end.
    """

    runs: np.ndarray
    begins: np.ndarray
    line: np.ndarray
    lines: np.ndarray
    box_of: np.ndarray
    boxes: np.ndarray


def fit_lines(arcs: Arcs, details: np.ndarray, squared: bool, directions: np.ndarray) -> Lines:
    """Fit lines to the walls.

    Parameters
    ----------
    arcs : the function rotates their vertices: a closed arc then begins at a corner.
    details : float64 ``(n,)``: shortest run of each arc, px.
    squared : whether lines turn to the one or two directions of their buildings even where other
        pixels then change sides.
    directions : float64 ``(labels,)``: of the walls of each building, radians from east to south,
        NaN where unknown. Rectangles of buildings too small for lines have this direction.
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
    _kernels.pool(sums, arcs.nodes, *node_runs(arcs, begins), group, TURN, TURN_LENGTH, SPREAD)
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
    inner = np.append(directions, [np.nan, np.nan])  # ground, and beyond, have no direction
    of_arc = inner[np.where(arcs.left > 0, arcs.left, 0) - 1]
    of_arc = np.where(np.isnan(of_arc), inner[np.where(arcs.right > 0, arcs.right, 0) - 1], of_arc)
    box_of, boxes = np.empty(len(arcs), np.int64), np.empty((int(arcs.closed.sum()), 5, 2))
    able = arcs.closed & ((arcs.right == 0) | (np.diff(begins) < 4))  # the inside is on the right
    _kernels.box_small(arcs.vertices, arcs.starts, able, of_arc, SMALL, RECTANGLE, box_of, boxes)
    return Lines(runs, begins, line, lines, box_of, boxes)


def node_runs(arcs: Arcs, begins: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """List the runs that end at each node, ``(m,)``, and where those of each node begin."""
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
    """Find the one or two directions of the buildings on each side of each of the ``lines``.

    Returns float64 ``(k, 4)``, radians, NaN for none.
    ``length``, float64 ``(k,)``, is that of the lines, px.
    """
    arc = np.repeat(np.arange(len(arcs)), np.diff(begins))
    # one row for each run and building beside it
    beside = np.concatenate([arcs.left[arc], arcs.right[arc]])
    which = np.concatenate([line, line])
    which, beside = which[beside > 0], beside[beside > 0]
    angle = np.arctan2(lines[:, 3], lines[:, 2])
    weight = length[which] ** 2  # the longer, the better its angle is known
    count = int(beside.max(initial=0)) + 1
    first = _direction(beside, angle[which], weight, count)
    others = np.abs(_quarter_difference(angle[which], first[beside])) > APART
    second = _direction(beside[others], angle[which[others]], weight[others], count)
    walls = np.bincount(beside, weight, count)
    near = np.abs(_quarter_difference(angle[which], second[beside])) <= APART
    enough = np.bincount(beside[near], weight[near], count) >= SECOND * walls
    second[~enough] = np.nan
    common = np.full((len(lines), 4), np.nan)
    for column, side in ((0, arcs.left[arc]), (2, arcs.right[arc])):
        here = side > 0
        common[line[here], column] = first[side[here]]
        common[line[here], column + 1] = second[side[here]]
    return common


def _square(common: np.ndarray, length: np.ndarray, lines: np.ndarray) -> None:
    """Turn ``lines`` of ``length`` px to the nearest direction in ``common``, if it is near."""
    angle = np.arctan2(lines[:, 3], lines[:, 2])
    by = _quarter_difference(common, angle[:, None])
    by[np.isnan(by)] = np.inf
    turn = by[np.arange(len(lines)), np.abs(by).argmin(axis=1)]
    turn[np.abs(turn) > np.minimum(STEEP, 2 * ENDS / length)] = 0
    lines[:, 2], lines[:, 3] = np.cos(angle + turn), np.sin(angle + turn)


def _direction(building, angle, weight, count: int) -> np.ndarray:
    """Find the main direction of each building's walls, with walls square to each other as one;
    radians, NaN for a building without walls."""
    bins = 45
    quarter = np.pi / 2
    at = np.floor(angle % quarter / quarter * bins).astype(np.int64) % bins
    table = np.bincount(building * bins + at, weight, count * bins).reshape(count, bins)
    around = table + np.roll(table, 1, axis=1) + np.roll(table, -1, axis=1)
    mode = (around.argmax(axis=1) + 0.5) * quarter / bins
    near = np.abs(_quarter_difference(angle, mode[building])) <= 1.5 * quarter / bins
    fourfold = np.exp(4j * angle[near]) * weight[near]
    real = np.bincount(building[near], fourfold.real, count)
    imaginary = np.bincount(building[near], fourfold.imag, count)
    direction = np.arctan2(imaginary, real) / 4
    return np.where(around.max(axis=1) > 0, direction, np.nan)


def _quarter_difference(angle: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Subtract ``other`` from ``angle``, to the nearest quarter turn, radians."""
    quarter = np.pi / 2
    return (angle - other + quarter / 2) % quarter - quarter / 2
