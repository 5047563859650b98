"""Compiled parts of walls: straight runs, and the lines fitted to them. All lengths in pixels, x to
the east, y to the south, from the map's north-west corner."""

import numpy as np

from evocity.accelerate import kernel

#: Parts of a pixel to which the points of lines and corners are rounded. So a wall is the same, bit
#: for bit, wherever its building lies on the map.
PARTS = float(1 << 20)


@kernel
def rounded(length):
    """Round a ``length``, px, to `PARTS` of a pixel."""
    return np.floor(length * PARTS + 0.5) / PARTS


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
def _folds(corners, first, last, detail):
    """Whether edges first…last − 1 go back on themselves by more than about a ``detail``: both
    sides of a wing a pixel wide are within half a pixel of one line, and are two walls."""
    x, y = corners[last] - corners[first]
    return last - first - np.sqrt(2.0) * np.hypot(x, y) > 1.5 * max(detail, 1.0)


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
            fits = _worst(points, first, last, x, y, dx, dy) <= merged
            if fits and not _folds(corners, first, last, detail):
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
                one = one and not _folds(corners, runs[before, 0], runs[after, 1], detail)
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
            one = one and not _folds(corners, first, last, detail)
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
def farthest(points, x, y):
    """The first of ``points`` (n, 2) that none is farther from (x, y) than."""
    found, most = 0, -1.0
    for k in range(len(points)):
        away = (points[k, 0] - x) ** 2 + (points[k, 1] - y) ** 2
        if away > most:
            found, most = k, away
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
            size = last - 1 - first
            x, y = 0.0, 0.0
            own = np.empty((size, 2))
            for k in range(size):  # whole numbers, so that equal distances stay equal
                own[k, 0] = size * (around[k, 0] - around[0, 0])
                own[k, 1] = size * (around[k, 1] - around[0, 1])
                x += around[k, 0] - around[0, 0]
                y += around[k, 1] - around[0, 1]
            at = farthest(own, x, y)
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
            boxes[count, k, 0] = x0 + rounded(x + along * cos - across * sin)
            boxes[count, k, 1] = y0 + rounded(y + along * sin + across * cos)
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
        lines[k, 0], lines[k, 1] = rounded(x) + sums[k, 6], rounded(y) + sums[k, 7]


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
def pool(sums, nodes, meeting, begins, group, turn, length, spread):
    """Make one line of runs that go on straight over a node.

    sums : float64 (runs, 8) of `moments`; of a group, those of its root become all its members'.
    nodes : int32 (n, 2), x and y.
    meeting, begins : the runs that end at node k are ``meeting[begins[k] : begins[k + 1]]``.
    group : int64 (runs,), filled with the root of each.
    turn, length : lines may differ by ``turn`` + ``length`` / the shorter's length, radians.
    spread : root mean square distance of a group's points from its line, at most.
    """
    both = np.empty(8)
    middles = np.empty((group.size, 2))
    for run in range(group.size):
        group[run] = run
        middles[run, 0] = sums[run, 6] + rounded(sums[run, 1] / sums[run, 0])
        middles[run, 1] = sums[run, 7] + rounded(sums[run, 2] / sums[run, 0])
    for node in range(begins.size - 1):
        for i in range(begins[node], begins[node + 1]):
            for j in range(i + 1, begins[node + 1]):
                one, other = _root(group, meeting[i]), _root(group, meeting[j])
                if one == other:
                    continue
                ahead = (middles[meeting[i]] - nodes[node]) * (middles[meeting[j]] - nodes[node])
                if ahead[0] + ahead[1] > 0:  # side by side they leave it, a pixel apart
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
            aside = False
            for j in range(begins[node], begins[node + 1]):
                ox, oy, odx, ody = lines[line[meeting[j]]]
                near = abs((ox - x0) * ody - (oy - y0) * odx) < 0.5 and abs(off) > 0.75
                aside = aside or (near and abs(odx * dy - ody * dx) < 0.2)
            if aside:  # beside a wall that ends here: it goes about the end of a wing
                continue
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
        nodes[node, 0], nodes[node, 1] = x0 + rounded(x), y0 + rounded(y)


# -- what the pixels allow ----------------------------------------------------------------------


@kernel
def _between(left, right, count, slope):
    """The room for a line of this ``slope``: from the highest of the middles of pixels on its
    ``right`` to the lowest on its ``left``, (n, 2) along and across; none parts them if the second
    is less."""
    low, high = -np.inf, np.inf
    for k in range(count):
        low = max(low, right[k, 1] - slope * right[k, 0])
        high = min(high, left[k, 1] - slope * left[k, 0])
    return low, high


@kernel
def _gathered(vertices, runs, members, line, trim, left, right):
    """Middles of the pixels beside the runs ``members``, along and across their ``line``, into
    ``left`` and ``right``, ``trim`` edges left out at each end of a run; returns how many."""
    x0, y0, dx, dy = line
    count = 0
    for run in members:
        first, last = runs[run]
        step = vertices[last] - vertices[first]
        sign = 1.0 if step[0] * dx + step[1] * dy >= 0 else -1.0
        spare = min(trim, (last - first - 1) // 2)
        for k in range(first + spare, last - spare):
            ex, ey = vertices[k + 1, 0] - vertices[k, 0], vertices[k + 1, 1] - vertices[k, 1]
            mx, my = vertices[k, 0] + 0.5 * ex - x0, vertices[k, 1] + 0.5 * ey - y0
            for side in (-1.0, 1.0):  # of the line as it is directed: right, left
                px, py = mx + sign * side * 0.5 * ey, my - sign * side * 0.5 * ex
                along, across = px * dx + py * dy, px * dy - py * dx
                if side > 0:
                    left[count, 0], left[count, 1] = along, across
                else:
                    right[count, 0], right[count, 1] = along, across
            count += 1
    return count


@kernel
def _free(left, right, count, reach):
    """Slopes from ``-reach`` to ``reach`` of lines that part ``left`` from ``right``, the least and
    the greatest; and the most room for one, which is 0 or less if there are none."""
    golden = 0.5 * (np.sqrt(5.0) - 1)
    low, high = -reach, reach
    one, other = high - golden * (high - low), low + golden * (high - low)
    a, b = _between(left, right, count, one)
    c, d = _between(left, right, count, other)
    for _ in range(26):  # the room is concave in the slope
        if b - a < d - c:
            low, one, a, b = one, other, c, d
            other = low + golden * (high - low)
            c, d = _between(left, right, count, other)
        else:
            high, other, c, d = other, one, a, b
            one = high - golden * (high - low)
            a, b = _between(left, right, count, one)
    best = 0.5 * (low + high)
    a, b = _between(left, right, count, best)
    room = b - a
    ends = (best, best)
    if room > 0:
        ends = (-reach, reach)
        for side in range(2):
            inside, outside = best, ends[side]
            for _ in range(12):
                middle = 0.5 * (inside + outside)
                a, b = _between(left, right, count, middle)
                if b > a:
                    inside = middle
                else:
                    outside = middle
            ends = (inside, ends[1]) if side == 0 else (ends[0], inside)
    return ends[0], ends[1], room


@kernel
def settle(vertices, runs, members, begins, lines, ranges):
    """Move ``lines`` float64 (k, 4) to the mean of those that part the same pixels.

    A map is burnt by the middles of its pixels: a wall leaves those of one label on one side, those
    of the other on the other. Where lines do, theirs is the mean, each as probable as any other;
    elsewhere, where a wall is no straight line, it stays.

    members, begins : line k is of runs ``members[begins[k] : begins[k + 1]]``.
    ranges : float64 (k, 3), filled with the directions of the steepest of these lines, radians,
        the first less, and how many edges were left out at each end; −1 if there are none.
    """
    left, right = np.empty((2, vertices.shape[0], 2))
    for k in range(lines.shape[0]):
        own = members[begins[k] : begins[k + 1]]
        angle = np.arctan2(lines[k, 3], lines[k, 2])
        ranges[k, 0], ranges[k, 1], ranges[k, 2] = angle, angle, -1
        least, greatest, room, count = 0.0, 0.0, 0.0, 0
        for trim in range(2):  # runs may part from others a pixel aside
            if trim and count < 8:
                break
            count = _gathered(vertices, runs, own, lines[k], trim, left, right)
            if count < 2:
                break
            long = 0.0
            for n in range(count):
                long = max(long, abs(left[n, 0]), abs(right[n, 0]))
            least, greatest, room = _free(left, right, count, min(1.25 / long, 0.8))
            if room > 0:
                ranges[k, 2] = trim
                break
        if room <= 0:
            continue
        weight, mean, reach = 0.0, 0.0, greatest - least
        for i in range(12):
            slope = least + reach * (i + 0.5) / 12
            low, high = _between(left, right, count, slope)
            weight += high - low
            mean += (high - low) * slope
        ranges[k, 0], ranges[k, 1] = angle - np.arctan(greatest), angle - np.arctan(least)
        _set(lines[k], left, right, count, mean / weight)


@kernel
def _set(line, left, right, count, slope):
    """Turn a ``line`` to a ``slope`` from what it was, half way between ``left`` and ``right``."""
    low, high = _between(left, right, count, slope)
    middle = 0.5 * (low + high)
    dx, dy = line[2], line[3]
    line[0] += rounded(middle * dy)
    line[1] -= rounded(middle * dx)
    length = np.sqrt(1 + slope * slope)
    line[2], line[3] = (dx + slope * dy) / length, (dy - slope * dx) / length


@kernel
def turn_within(vertices, runs, members, begins, ranges, directions, lines):
    """Turn ``lines`` to one of the ``directions``, or square to it, where these part the same
    pixels still.

    ranges : of `settle`; the rest as there.
    directions : float64 (k, d), radians, NaN for none. The least turn is taken.
    """
    left, right = np.empty((2, vertices.shape[0], 2))
    quarter = np.pi / 2
    for k in range(lines.shape[0]):
        if ranges[k, 2] < 0:
            continue
        angle = np.arctan2(lines[k, 3], lines[k, 2])
        best = np.inf
        for direction in directions[k]:
            turn = (direction - angle + quarter / 2) % quarter - quarter / 2
            low, high = ranges[k, 0] - angle, ranges[k, 1] - angle
            if low < turn < high and abs(turn) < abs(best):
                best = turn
        if best == np.inf:
            continue
        own = members[begins[k] : begins[k + 1]]
        some = _gathered(vertices, runs, own, lines[k], int(ranges[k, 2]), left, right)
        _set(lines[k], left, right, some, -np.tan(best))
