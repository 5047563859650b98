"""Compiled parts of walls: what is seen, traced and laid. All lengths in pixels, x to the east,
y to the south, from the map's north-west corner."""

import numpy as np

from evocity.accelerate import kernel
from evocity.views.walls.fitting._kernels import _crossing, _douglas_peucker, farthest, rounded

#: What lies beyond the map, or beyond its site.
BEYOND = -1

# East, north, west, south: the step of each direction in rows and columns.
_ROWS = np.array([0, -1, 0, 1])
_COLUMNS = np.array([1, 0, -1, 0])


@kernel
def untouch(labels, rounds):
    """Change ``labels`` int32 (H + 2, W + 2), framed by `BEYOND`, until none meets itself at a
    pixel's corner alone.

    Ground at such a corner is filled. Where there is none, a neighbour's pixel is taken in the
    first ``rounds``, and later the label's own given up, which comes to an end: each leaves less
    that is built. Returns how many pixels changed.
    """
    height, width = labels.shape
    changed = 0
    turn = 0
    found = True
    while found:
        found = False
        for row in range(1, height - 2):
            for column in range(1, width - 2):
                for way in range(2):
                    own = labels[row, column + way]
                    if own <= 0 or labels[row + 1, column + 1 - way] != own:
                        continue
                    first = labels[row, column + 1 - way]
                    second = labels[row + 1, column + way]
                    if first == own or second == own:
                        continue
                    found = True
                    changed += 1
                    if turn < rounds and first == 0:
                        labels[row, column + 1 - way] = own
                    elif turn < rounds and second == 0:
                        labels[row + 1, column + way] = own
                    elif turn < rounds and first > 0:
                        labels[row, column + 1 - way] = own
                    elif turn < rounds and second > 0:
                        labels[row + 1, column + way] = own
                    else:
                        labels[row, column + way] = 0
        turn += 1
    return changed


@kernel
def _sides(labels, row, column, way):
    """Labels to the left and to the right of the edge that leaves vertex (row, column)."""
    if way == 0:
        return labels[row, column + 1], labels[row + 1, column + 1]
    if way == 1:
        return labels[row, column], labels[row, column + 1]
    if way == 2:
        return labels[row + 1, column], labels[row, column]
    return labels[row + 1, column + 1], labels[row + 1, column]


@kernel
def _is_edge(labels, row, column, way):
    left, right = _sides(labels, row, column, way)
    return left != right and (left > 0 or right > 0)


@kernel
def mark_nodes(labels, nodes):
    """Number the vertices where three labels meet in ``nodes`` int32 (H + 1, W + 1), −1 elsewhere,
    corners of what lies beyond among them; returns how many, and the number of edges."""
    count, edges = 0, 0
    for row in range(nodes.shape[0]):
        for column in range(nodes.shape[1]):
            nodes[row, column] = -1
            a, b = labels[row, column], labels[row, column + 1]
            c, d = labels[row + 1, column], labels[row + 1, column + 1]
            if a == b and b == c and c == d:
                continue
            if _is_edge(labels, row, column, 0):
                edges += 1
            if _is_edge(labels, row, column, 3):
                edges += 1
            if max(a, b, c, d) <= 0:
                continue
            kinds = 1 + (b != a) + (c != a and c != b) + (d != a and d != b and d != c)
            turns = a == BEYOND or b == BEYOND or c == BEYOND or d == BEYOND
            turns = turns and (a == d or b == c) and (a != b or c != d)
            if kinds >= 3 or (
                turns and kinds == 2 and not ((a == b and c == d) or (a == c and b == d))
            ):
                nodes[row, column] = count
                count += 1
    return count, edges


@kernel
def trace(labels, nodes, vertices, starts, left, right, ends):
    """Trace each wall once, from node to node, or about where it meets none.

    labels, nodes : of `untouch` and `mark_nodes`.
    vertices : int32 (at least 2 × edges, 2), filled with (x, y) of the arcs' vertices, an arc's
        first and last ones included; of a closed arc they are the same.
    starts : int64 (edges + 1,), filled with where each arc begins in ``vertices``.
    left, right : int32 (edges,), filled with the labels beside it.
    ends : int32 (edges, 2), filled with its nodes, −1 for a closed arc.
    Returns how many arcs.
    """
    height, width = nodes.shape
    seen = np.zeros((height, width), np.uint8)
    arcs, place = 0, 0
    for turn in range(2):  # from nodes, then what is closed
        for row in range(height):
            for column in range(width):
                if turn == 0 and nodes[row, column] < 0:
                    continue
                for way in range(4 if turn == 0 else 1):
                    if seen[row, column] >> way & 1 or not _is_edge(labels, row, column, way):
                        continue
                    starts[arcs] = place
                    left[arcs], right[arcs] = _sides(labels, row, column, way)
                    ends[arcs, 0] = nodes[row, column]
                    r, c, w = row, column, way
                    vertices[place, 0], vertices[place, 1] = c, r
                    place += 1
                    while True:
                        seen[r, c] |= 1 << w
                        r, c = r + _ROWS[w], c + _COLUMNS[w]
                        back = (w + 2) % 4
                        seen[r, c] |= 1 << back
                        vertices[place, 0], vertices[place, 1] = c, r
                        place += 1
                        if nodes[r, c] >= 0 or (r == row and c == column):
                            break
                        for other in range(4):
                            if other != back and _is_edge(labels, r, c, other):
                                w = other
                                break
                    ends[arcs, 1] = nodes[r, c]
                    arcs += 1
    starts[arcs] = place
    return arcs


# -- the points of a wall ------------------------------------------------------------------------


@kernel
def _stairs(vertices, first, last, nodes, ends, points, place):
    """The vertices of an arc where it turns, its nodes at its ends, into ``points`` from ``place``;
    returns where they end."""
    for k in range(first, last):
        if first < k < last - 1:
            straight = (
                vertices[k + 1, 0] - vertices[k, 0] == vertices[k, 0] - vertices[k - 1, 0]
                and vertices[k + 1, 1] - vertices[k, 1] == vertices[k, 1] - vertices[k - 1, 1]
            )
            if straight:
                continue
        points[place, 0], points[place, 1] = vertices[k, 0], vertices[k, 1]
        if k == first and ends[0] >= 0:
            points[place] = nodes[ends[0]]
        if k == last - 1 and ends[1] >= 0:
            points[place] = nodes[ends[1]]
        place += 1
    return place


@kernel
def _simplified(vertices, first, last, nodes, ends, tolerance, points, place):
    """The same of what Douglas and Peucker leave of the vertices."""
    count = last - first
    own = vertices[first:last].astype(np.float64)
    keep = np.zeros(count, np.bool_)
    stack = np.empty((count + 2, 2), np.int64)
    if ends[0] < 0:  # about: from where it begins to what is farthest from there, and back
        far = farthest(own, own[0, 0], own[0, 1])
        _douglas_peucker(own[: far + 1], tolerance, keep[: far + 1], stack)
        _douglas_peucker(own[far:], tolerance, keep[far:], stack)
    else:
        _douglas_peucker(own, tolerance, keep, stack)
    for k in range(count):
        if keep[k]:
            points[place] = own[k]
            if k == 0 and ends[0] >= 0:
                points[place] = nodes[ends[0]]
            if k == count - 1 and ends[1] >= 0:
                points[place] = nodes[ends[1]]
            place += 1
    return place


@kernel
def _corners(vertices, runs, first, last, ends, nodes, lines, line, most, points, place):
    """The corners of an arc of runs first…last − 1, as `lay_arcs` says."""
    closed = ends[0] < 0
    begin = place
    if not closed:
        points[place] = nodes[ends[0]]
        place += 1
    for run in range(first, last if closed else last - 1):
        after = first if run == last - 1 else run + 1
        one, other = lines[line[run]], lines[line[after]]
        # the middle of what lies between them
        px = 0.5 * (vertices[runs[run, 1], 0] + vertices[runs[after, 0], 0])
        py = 0.5 * (vertices[runs[run, 1], 1] + vertices[runs[after, 0], 1])
        gap = np.hypot(vertices[runs[run, 1], 0] - px, vertices[runs[run, 1], 1] - py)
        ax, ay, bx, by = one[0] - px, one[1] - py, other[0] - px, other[1] - py
        x, y, sine = _crossing(ax, ay, one[2], one[3], bx, by, other[2], other[3])
        if sine > 0.1 and np.hypot(x, y) <= most + gap:
            points[place, 0], points[place, 1] = px + rounded(x), py + rounded(y)
            place += 1
            continue
        for at in (one, other):
            along = (px - at[0]) * at[2] + (py - at[1]) * at[3]
            points[place, 0] = px + rounded(at[0] - px + along * at[2])
            points[place, 1] = py + rounded(at[1] - py + along * at[3])
            place += 1
        step = points[place - 1] - points[place - 2]
        if np.hypot(step[0], step[1]) < 0.35:
            points[place - 2] += 0.5 * step
            place -= 1
    points[place] = points[begin] if closed else nodes[ends[1]]
    return place + 1


@kernel
def lay_arcs(
    vertices,
    starts,
    ends,
    nodes,
    levels,
    runs,
    begins,
    lines,
    line,
    most,
    tolerance,
    box_of,
    boxes,
    points,
    at,
):
    """The points of each arc, from node to node; of a closed one the first again at the end.

    levels : uint8 (arcs,): 0 its box, or the corners in which the lines of its runs cross, 1 what
        Douglas and Peucker leave with a ``tolerance``, 2 the pixels' edges.
    nodes : float64 (n, 2). lines : float64 (k, 4), a point and a direction; line : int64 (runs,).
    most : a crossing farther than this from where two runs part is none; a step joins them then.
    points : float64 (at least 2 × vertices, 2), filled. at : int64 (arcs + 1,), filled with where
        each arc begins there.
    """
    place = 0
    for arc in range(levels.size):
        at[arc] = place
        first, last = starts[arc], starts[arc + 1]
        if levels[arc] == 0 and box_of[arc] >= 0:
            points[place : place + 5] = boxes[box_of[arc]]
            place += 5
        elif levels[arc] == 0:
            place = _corners(
                vertices,
                runs,
                begins[arc],
                begins[arc + 1],
                ends[arc],
                nodes,
                lines,
                line,
                most,
                points,
                place,
            )
        elif levels[arc] == 1:
            place = _simplified(vertices, first, last, nodes, ends[arc], tolerance, points, place)
        else:
            place = _stairs(vertices, first, last, nodes, ends[arc], points, place)
    at[levels.size] = place


# -- rings ----------------------------------------------------------------------------------------


@kernel
def follow(after, label, ring_of, order):
    """Rings of half arcs: ``after`` int64 (h,) tells which follows each, ``label`` whose they are;
    those without label 1 and more are none's. ``ring_of`` (h,) is filled with −1 or the ring's
    number, ``order`` (h,) with the halves of each ring in turn. Returns how many rings."""
    rings, place = 0, 0
    ring_of[:] = -1
    for half in range(after.size):
        if label[half] <= 0 or ring_of[half] >= 0:
            continue
        one = half
        while ring_of[one] < 0:
            ring_of[one] = rings
            order[place] = one
            place += 1
            one = after[one]
        rings += 1
    return rings


@kernel
def lay_rings(order, count, ring_of, points, starts, out, ring_at):
    """The points of the rings, each closed: of half arc 2a as arc a has them, of 2a + 1 backwards.
    ``out`` (points, 2) and ``ring_at`` (points,) are filled; returns how many."""
    place, k = 0, 0
    while k < count:
        ring = ring_of[order[k]]
        begin = place
        while k < count and ring_of[order[k]] == ring:
            arc, back = order[k] // 2, order[k] % 2
            first, last = starts[arc], starts[arc + 1]
            for at in range(last - first - 1):
                out[place] = points[last - 1 - at] if back else points[first + at]
                ring_at[place] = ring
                place += 1
            k += 1
        out[place] = out[begin]
        ring_at[place] = ring
        place += 1
    return place
