"""Compiled parts of walls: what is seen, traced and fitted. All lengths in pixels, x to the east,
y to the south, from the map's north-west corner."""

import numpy as np

from evocity.accelerate import kernel

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


# -- runs of a wall, and their lines -----------------------------------------------------------


@kernel
def _sums(points, first, last, sums):
    """Moments of ``points`` first…last − 1 into ``sums``: n, x, y, xx, xy, yy."""
    sums[:] = 0
    for k in range(first, last):
        x, y = points[k, 0], points[k, 1]
        sums[0] += 1
        sums[1] += x
        sums[2] += y
        sums[3] += x * x
        sums[4] += x * y
        sums[5] += y * y


@kernel
def line_of(sums):
    """Total least squares of moments: centroid x, y, direction x, y, sum of squared distances."""
    n = sums[0]
    x, y = sums[1] / n, sums[2] / n
    xx, xy, yy = sums[3] / n - x * x, sums[4] / n - x * y, sums[5] / n - y * y
    half = 0.5 * (xx - yy)
    root = np.sqrt(half * half + xy * xy)
    angle = 0.5 * np.arctan2(2 * xy, xx - yy)
    least = max(0.5 * (xx + yy) - root, 0.0)
    return x, y, np.cos(angle), np.sin(angle), least * n


@kernel
def _error(total, first, last, sums):
    """Sum of squared distances of points first…last − 1 to their line, ``total`` their sums so
    far."""
    for k in range(6):
        sums[k] = total[last, k] - total[first, k]
    return line_of(sums)[4]


@kernel
def _worst(points, first, last, x, y, dx, dy):
    """Largest distance of points first…last − 1 from a line."""
    most = 0.0
    for k in range(first, last):
        away = abs((points[k, 0] - x) * dy - (points[k, 1] - y) * dx)
        most = max(most, away)
    return most


@kernel
def _douglas_peucker(points, tolerance, keep, stack):
    """Mark in ``keep`` which ``points`` (n, 2) stay."""
    count = points.shape[0]
    keep[:count] = False
    keep[0] = keep[count - 1] = True
    stack[0, 0], stack[0, 1] = 0, count - 1
    depth = 1
    while depth:
        depth -= 1
        first, last = stack[depth]
        x, y = points[first]
        dx, dy = points[last, 0] - x, points[last, 1] - y
        length = np.hypot(dx, dy)
        most, at = tolerance, -1
        for k in range(first + 1, last):
            px, py = points[k, 0] - x, points[k, 1] - y
            if length == 0:
                away = np.hypot(px, py)
            else:
                along = (px * dx + py * dy) / length
                if along < 0:
                    away = np.hypot(px, py)
                elif along > length:
                    away = np.hypot(points[k, 0] - points[last, 0], points[k, 1] - points[last, 1])
                else:
                    away = abs(px * dy - py * dx) / length
            if away > most:
                most, at = away, k
        if at > 0:
            keep[at] = True
            stack[depth, 0], stack[depth, 1] = first, at
            stack[depth + 1, 0], stack[depth + 1, 1] = at, last
            depth += 2


@kernel
def _crossing(ax, ay, adx, ady, bx, by, bdx, bdy):
    """Where two lines cross, and the sine of the angle between them; if it is 0, the first's own
    point."""
    sine = adx * bdy - ady * bdx
    if sine == 0:
        return ax, ay, 0.0
    along = ((bx - ax) * bdy - (by - ay) * bdx) / sine
    return ax + along * adx, ay + along * ady, abs(sine)


@kernel
def split_arc(corners, tolerance, merged, detail, closed, runs):
    """Part one arc into straight runs.

    corners : float64 (n + 1, 2), its vertices. ``closed``: whether it begins where it ends.
    tolerance : of Douglas and Peucker, on the middles of the edges.
    merged : neighbours become one run whose points are no farther than this from their line.
    detail : a shorter run is dropped where its neighbours' lines meet nearby, or are one.
    runs : int64 (at least n, 2), filled with first and last + 1 edge of each run.
    Returns how many runs.
    """
    count = corners.shape[0] - 1
    points = 0.5 * (corners[1:] + corners[:-1])
    points -= corners[0]
    total = np.zeros((count + 1, 6))
    for k in range(count):
        x, y = points[k, 0], points[k, 1]
        total[k + 1] = total[k]
        total[k + 1, 0] += 1
        total[k + 1, 1] += x
        total[k + 1, 2] += y
        total[k + 1, 3] += x * x
        total[k + 1, 4] += x * y
        total[k + 1, 5] += y * y
    keep = np.zeros(count, np.bool_)
    stack = np.empty((count + 2, 2), np.int64)
    if count < 3:
        runs[0, 0], runs[0, 1] = 0, count
        if count == 2:  # a corner, or a straight bit
            step = np.abs(corners[2] - corners[0])
            if step[0] > 0 and step[1] > 0 and detail < 1:
                runs[0, 1] = runs[1, 0] = 1
                runs[1, 1] = 2
                return 2
        return 1
    _douglas_peucker(points, tolerance, keep, stack)
    found = 0
    runs[0, 0] = 0
    for k in range(1, count - 1):
        if keep[k]:
            runs[found, 1] = k
            found += 1
            runs[found, 0] = k
    runs[found, 1] = count
    found += 1
    sums, other = np.empty(6), np.empty(6)
    for _ in range(2):  # each break where it leaves the least error
        for run in range(found - 1):
            first, last = runs[run, 0], runs[run + 1, 1]
            best, at = np.inf, runs[run, 1]
            for k in range(first + 1, last):
                error = _error(total, first, k, sums) + _error(total, k, last, other)
                if error < best - 1e-9:
                    best, at = error, k
            runs[run, 1] = runs[run + 1, 0] = at
        # neighbours that are one line
        run = 0
        while run < found - 1:
            first, last = runs[run, 0], runs[run + 1, 1]
            for k in range(6):
                sums[k] = total[last, k] - total[first, k]
            x, y, dx, dy, _e = line_of(sums)
            if _worst(points, first, last, x, y, dx, dy) <= merged:
                runs[run, 1] = last
                for k in range(run + 1, found - 1):
                    runs[k] = runs[k + 1]
                found -= 1
            else:
                run += 1
    while found > 1 + 2 * closed:  # the shortest that may go
        shortest, at = detail, -1
        for run in range(found):
            first, last = runs[run, 0], runs[run, 1]
            length = np.hypot(
                corners[last, 0] - corners[first, 0], corners[last, 1] - corners[first, 1]
            )
            if length >= shortest:
                continue
            if 0 < run < found - 1 or closed:
                before, after = (run - 1) % found, (run + 1) % found
                for k in range(6):
                    sums[k] = total[runs[before, 1], k] - total[runs[before, 0], k]
                    other[k] = total[runs[after, 1], k] - total[runs[after, 0], k]
                ax, ay, adx, ady, _e = line_of(sums)
                bx, by, bdx, bdy, _e = line_of(other)
                x, y, sine = _crossing(ax, ay, adx, ady, bx, by, bdx, bdy)
                middle = 0.5 * (corners[first] + corners[last]) - corners[0]
                near = sine > 0.2 and np.hypot(x - middle[0], y - middle[1]) <= 1.5 * detail
                for k in range(6):
                    sums[k] += other[k]
                x, y, dx, dy, _e = line_of(sums)
                one = before < after and max(
                    _worst(points, runs[before, 0], runs[before, 1], x, y, dx, dy),
                    _worst(points, runs[after, 0], runs[after, 1], x, y, dx, dy),
                ) <= max(merged, 0.5 * detail)
                if not (near or one):
                    continue
            shortest, at = length, run
        if at < 0:
            break
        one = False
        if 0 < at < found - 1:
            first, last = runs[at - 1, 0], runs[at + 1, 1]
            for k in range(6):
                sums[k] = total[runs[at - 1, 1], k] - total[first, k]
                sums[k] += total[last, k] - total[runs[at + 1, 0], k]
            x, y, dx, dy, _e = line_of(sums)
            one = max(
                _worst(points, first, runs[at - 1, 1], x, y, dx, dy),
                _worst(points, runs[at + 1, 0], last, x, y, dx, dy),
            ) <= max(merged, 0.5 * detail)
        if one:
            runs[at - 1, 1] = last
            for k in range(at, found - 2):
                runs[k] = runs[k + 2]
            found -= 2
        else:
            for k in range(at, found - 1):
                runs[k] = runs[k + 1]
            found -= 1
    return found


@kernel
def split_arcs(vertices, starts, ends, fixed, details, runs, begins):
    """`split_arc` for all arcs but those that are ``fixed``, bool (arcs,): these have no run.

    A closed arc is turned in ``vertices`` to begin where it is farthest from its middle.
    details : float64 (arcs, 3), the ``tolerance``, ``merged`` and ``detail`` of each.
    runs : int64 (vertices, 2), filled with indices into ``vertices``.
    begins : int64 (arcs + 1,), where each arc's begin.
    """
    place = 0
    for arc in range(starts.size - 1):
        begins[arc] = place
        if fixed[arc]:
            continue
        first, last = starts[arc], starts[arc + 1]
        closed = ends[arc, 0] < 0
        if closed:
            around = vertices[first : last - 1].copy()
            x, y = around[:, 0].mean(), around[:, 1].mean()
            at = np.argmax((around[:, 0] - x) ** 2 + (around[:, 1] - y) ** 2)
            size = last - 1 - first
            for k in range(size + 1):
                vertices[first + k] = around[(at + k) % size]
        corners = vertices[first:last].astype(np.float64)
        tolerance, merged, detail = details[arc]
        found = split_arc(corners, tolerance, merged, detail, closed, runs[place:])
        runs[place : place + found] += first
        place += found
    begins[starts.size - 1] = place


@kernel
def box_small(vertices, starts, able, directions, most, shape, box_of, boxes):
    """Lay rectangles for what goes about with ``most`` edges at most, and is as good as one.

    able : bool (arcs,), which may be one, closed arcs all.
    directions : float64 (arcs,), of the walls of each, radians from east to south; NaN for none.
    shape : a rectangle of the same second moments may be so many times as large; its corners then
        bound the same area.
    box_of : int64 (arcs,), filled with −1 or a row of ``boxes``, float64 (arcs, 5, 2), which is
        filled with corners in the order of the arc, the first again at the end.
    Returns how many.
    """
    count = 0
    for arc in range(able.size):
        box_of[arc] = -1
        first, last = starts[arc], starts[arc + 1]
        if not able[arc] or last - 1 - first > most or np.isnan(directions[arc]):
            continue
        x0, y0 = vertices[first]
        area, sx, sy, sxx, sxy, syy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(first, last - 1):
            x, y = vertices[k, 0] - x0, vertices[k, 1] - y0
            u, v = vertices[k + 1, 0] - x0, vertices[k + 1, 1] - y0
            cross = x * v - u * y
            area += cross / 2
            sx += (x + u) * cross / 6
            sy += (y + v) * cross / 6
            sxx += (x * x + x * u + u * u) * cross / 12
            syy += (y * y + y * v + v * v) * cross / 12
            sxy += (x * v + 2 * x * y + 2 * u * v + u * y) * cross / 24
        x, y = sx / area, sy / area
        xx, xy, yy = sxx / area - x * x, sxy / area - x * y, syy / area - y * y
        cos, sin = np.cos(directions[arc]), np.sin(directions[arc])
        long = np.sqrt(12 * (cos * cos * xx + 2 * cos * sin * xy + sin * sin * yy))
        wide = np.sqrt(12 * (sin * sin * xx - 2 * cos * sin * xy + cos * cos * yy))
        if long * wide > shape * abs(area):
            continue
        scale = np.sqrt(abs(area) / (long * wide)) / 2
        for k in range(5):
            turn = k % 4 if area > 0 else (4 - k) % 4
            along = long * scale * (1 if turn == 1 or turn == 2 else -1)
            across = wide * scale * (1 if turn >= 2 else -1)
            boxes[count, k, 0] = x0 + x + along * cos - across * sin
            boxes[count, k, 1] = y0 + y + along * sin + across * cos
        box_of[arc] = count
        count += 1
    return count


@kernel
def moments(vertices, runs, sums):
    """Of the middles of the edges of each run: n, x, y, xx, xy, yy about ``sums[:, 6:]``, the
    run's first vertex."""
    for run in range(runs.shape[0]):
        first, last = runs[run]
        x0, y0 = vertices[first]
        sums[run, :6] = 0
        sums[run, 6], sums[run, 7] = x0, y0
        for k in range(first, last):
            x = 0.5 * (vertices[k, 0] + vertices[k + 1, 0]) - x0
            y = 0.5 * (vertices[k, 1] + vertices[k + 1, 1]) - y0
            sums[run, 0] += 1
            sums[run, 1] += x
            sums[run, 2] += y
            sums[run, 3] += x * x
            sums[run, 4] += x * y
            sums[run, 5] += y * y


@kernel
def lines_of(sums, lines):
    """A point and the direction of the line of each row of `moments` into ``lines`` (k, 4)."""
    for k in range(sums.shape[0]):
        x, y, lines[k, 2], lines[k, 3], _ = line_of(sums[k])
        lines[k, 0], lines[k, 1] = x + sums[k, 6], y + sums[k, 7]


@kernel
def _added(one, other, into):
    """Moments of two together, about the first's place."""
    n, sx, sy = other[0], other[1], other[2]
    x, y = other[6] - one[6], other[7] - one[7]
    into[0] = one[0] + n
    into[1] = one[1] + sx + n * x
    into[2] = one[2] + sy + n * y
    into[3] = one[3] + other[3] + 2 * x * sx + n * x * x
    into[4] = one[4] + other[4] + x * sy + y * sx + n * x * y
    into[5] = one[5] + other[5] + 2 * y * sy + n * y * y
    into[6], into[7] = one[6], one[7]


@kernel
def _root(group, one):
    while group[one] != one:
        group[one] = group[group[one]]
        one = group[one]
    return one


@kernel
def pool(sums, meeting, begins, group, turn, length, spread):
    """Make one line of runs that go on straight over a node.

    sums : float64 (runs, 8) of `moments`; of a group, those of its root become all its members'.
    meeting, begins : the runs that end at node k are ``meeting[begins[k] : begins[k + 1]]``.
    group : int64 (runs,), filled with the root of each.
    turn, length : lines may differ by ``turn`` + ``length`` / the shorter's length, radians.
    spread : root mean square distance of a group's points from its line, at most.
    """
    both = np.empty(8)
    for run in range(group.size):
        group[run] = run
    for node in range(begins.size - 1):
        for i in range(begins[node], begins[node + 1]):
            for j in range(i + 1, begins[node + 1]):
                one, other = _root(group, meeting[i]), _root(group, meeting[j])
                if one == other:
                    continue
                ax, ay, adx, ady, _e = line_of(sums[one])
                bx, by, bdx, bdy, _e = line_of(sums[other])
                shorter = min(sums[one, 0], sums[other, 0])
                if shorter < 2 or abs(adx * bdy - ady * bdx) > turn + length / shorter:
                    continue
                _added(sums[one], sums[other], both)
                x, y, dx, dy, error = line_of(both)
                if error > spread * spread * both[0]:
                    continue
                ox, oy = sums[one, 6] - both[6], sums[one, 7] - both[7]
                away = abs((ax + ox - x) * dy - (ay + oy - y) * dx)
                ox, oy = sums[other, 6] - both[6], sums[other, 7] - both[7]
                away = max(away, abs((bx + ox - x) * dy - (by + oy - y) * dx))
                if away > spread:
                    continue
                sums[one] = both
                group[other] = one
    for run in range(group.size):
        group[run] = _root(group, run)


@kernel
def place_nodes(nodes, meeting, begins, lines, line, sides, most):
    """Move each node to where the lines that end there meet best.

    nodes : float64 (n, 2), x and y, changed. meeting, begins : as in `pool`.
    lines : float64 (k, 4): a point and the direction of each. line : int64 (runs,), which is whose.
    sides : int8 (n,): 0 free, 1 slides along x, 2 along y, 3 stays.
    most : a node that would move farther is drawn towards where it was.
    """
    for node in range(nodes.shape[0]):
        if sides[node] == 3 or begins[node] == begins[node + 1]:
            continue
        x0, y0 = nodes[node]
        # normal equations of the distances, and a little of staying
        xx, xy, yy, bx, by = 1e-6, 0.0, 1e-6, 0.0, 0.0
        for i in range(begins[node], begins[node + 1]):
            which = line[meeting[i]]
            twice = False
            for j in range(begins[node], i):
                twice = twice or line[meeting[j]] == which
            if twice:
                continue
            x, y, dx, dy = lines[which]
            nx, ny = -dy, dx
            off = nx * (x - x0) + ny * (y - y0)
            xx += nx * nx
            xy += nx * ny
            yy += ny * ny
            bx += nx * off
            by += ny * off
        if sides[node] == 1:
            x, y = bx / xx if xx > 0.05 else 0.0, 0.0
        elif sides[node] == 2:
            x, y = 0.0, by / yy if yy > 0.05 else 0.0
        else:
            if xx * yy - xy * xy < 0.03:  # nearly one direction: along it there is no saying
                xx += 0.3
                yy += 0.3
            determinant = xx * yy - xy * xy
            x = (yy * bx - xy * by) / determinant
            y = (xx * by - xy * bx) / determinant
        away = np.hypot(x, y)
        if away > most:
            x, y = x * most / away, y * most / away
        nodes[node, 0], nodes[node, 1] = x0 + x, y0 + y


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
        far = np.argmax((own[:, 0] - own[0, 0]) ** 2 + (own[:, 1] - own[0, 1]) ** 2)
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
        x, y, sine = _crossing(
            one[0], one[1], one[2], one[3], other[0], other[1], other[2], other[3]
        )
        if sine > 0.1 and np.hypot(x - px, y - py) <= most + gap:
            points[place, 0], points[place, 1] = x, y
            place += 1
            continue
        for at in (one, other):
            along = (px - at[0]) * at[2] + (py - at[1]) * at[3]
            points[place, 0], points[place, 1] = at[0] + along * at[2], at[1] + along * at[3]
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
