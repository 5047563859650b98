"""Compiled loops over buildings. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def _root(parent, a):
    while parent[np.uintp(a)] != a:
        parent[np.uintp(a)] = parent[np.uintp(parent[np.uintp(a)])]
        a = parent[np.uintp(a)]
    return a


@kernel
def _unite(parent, a, b):
    """The lower of the two roots becomes that of both, and is returned."""
    a, b = _root(parent, a), _root(parent, b)
    low, high = min(a, b), max(a, b)
    parent[np.uintp(high)] = low
    return low


@kernel
def _number(zones, parent, count):
    """Renumber ``zones`` by their roots, in the order of these; returns how many there are.

    ``zones`` bear numbers 0…count in the order in which they first appear, and a root is the
    lowest of its set: so the new numbers too are in raster order.
    """
    names = np.zeros(count + 1, np.int32)
    number = 0
    for a in range(1, count + 1):
        root = _root(parent, a)
        if root == a:
            number += 1
            names[a] = number
        else:
            names[a] = names[root]
    for y in range(np.uintp(zones.shape[0])):
        for x in range(np.uintp(zones.shape[1])):
            zones[y, x] = names[np.uintp(zones[y, x])]
    return number


@kernel
def flat_zones(heights, built, step, zones):
    """Quasi-flat zones: built pixels that touch by sides are in one zone where their heights
    differ by at most ``step``. ``zones`` is overwritten; returns how many there are."""
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    one = np.uintp(1)
    parent = np.empty(heights.size + 1, np.int32)
    count = 0
    for y in range(rows):
        for x in range(columns):
            if built[y, x] == 0:
                zones[y, x] = 0
                continue
            here, a = heights[y, x], np.int32(0)
            if x and built[y, x - one] and abs(here - heights[y, x - one]) <= step:
                a = zones[y, x - one]
            if y and built[y - one, x] and abs(here - heights[y - one, x]) <= step:
                above = zones[y - one, x]
                if a == 0:
                    a = above
                elif a != above:
                    a = np.int32(_unite(parent, a, above))
            if a == 0:
                count += 1
                a = np.int32(count)
                parent[np.uintp(count)] = a
            zones[y, x] = a
    return _number(zones, parent, count)


@kernel
def _facing(zones, pixels, least, sides):
    """Pairs of zones that face each other across a pixel side, one of them at least of fewer
    than ``least`` pixels, into ``sides`` (n, 2) where there is room; returns how many."""
    number, room = np.uintp(0), np.uintp(sides.shape[0])
    rows, columns, one = np.uintp(zones.shape[0]), np.uintp(zones.shape[1]), np.uintp(1)
    for y in range(rows):
        for x in range(columns):
            a = zones[y, x]
            if a == 0:
                continue
            east = zones[y, x + one] if x + one < columns else a
            south = zones[y + one, x] if y + one < rows else a
            for b in (east, south):
                if b != a and b and min(pixels[np.uintp(a)], pixels[np.uintp(b)]) < least:
                    if number < room:
                        sides[number, 0], sides[number, 1] = a, b
                    number += one
    return np.int64(number)


@kernel
def _neighbour(a, facing, pixels, means, shared):
    """Of the zones that zone ``a`` is ``facing``, once a pixel side, the one to give it to; 0 if
    it faces none. ``shared`` is 0 throughout, before and after."""
    for b in facing:
        shared[b] += 1
    best, chosen = (0, 0.0, 0, 0), 0
    for b in facing:
        if shared[b]:
            claim = (shared[b], -abs(means[b] - means[a]), pixels[b], -np.int64(b))
            if claim > best:
                best, chosen = claim, np.int64(b)
            shared[b] = 0
    return chosen


@kernel
def join_crumbs(heights, zones, count, least):
    """Give every zone of fewer than ``least`` pixels to the neighbour with which it shares most
    pixel sides; of equals, to that closest in mean height, then the largest, then the lowest
    number. All at once, and again until none is left that has a neighbour: so two zones that are
    large enough never become one. ``zones`` is renumbered; returns how many are left."""
    pixels, total = np.zeros(count + 1, np.int64), np.zeros(count + 1)
    for y in range(np.uintp(zones.shape[0])):
        for x in range(np.uintp(zones.shape[1])):
            a = np.uintp(zones[y, x])
            pixels[a] += 1
            total[a] += heights[y, x]
    sides = np.empty((0, 2), np.int32)
    sides = np.empty((_facing(zones, pixels, least, sides), 2), np.int32)
    _facing(zones, pixels, least, sides)
    parent = np.arange(count + 1).astype(np.int32)
    chosen, shared = np.zeros(count + 1, np.int64), np.zeros(count + 1, np.int64)
    starts, facing = np.empty(count + 2, np.int64), np.empty(2 * sides.shape[0], np.int32)
    while True:
        # facing[starts[a] : starts[a + 1]]: what the small zone a faces, once a pixel side
        starts[:] = 0
        kept = np.uintp(0)
        for k in range(np.uintp(sides.shape[0])):
            root, other = _root(parent, sides[k, 0]), _root(parent, sides[k, 1])
            a, b = np.uintp(root), np.uintp(other)
            if a != b and min(pixels[a], pixels[b]) < least:
                starts[a + np.uintp(1)] += pixels[a] < least
                starts[b + np.uintp(1)] += pixels[b] < least
                sides[kept, 0], sides[kept, 1] = root, other
                kept += np.uintp(1)
        sides = sides[:kept]
        for a in range(count + 1):
            starts[a + 1] += starts[a]
        ends = starts.copy()
        for k in range(np.uintp(sides.shape[0])):
            for i in range(np.uintp(2)):
                a, b = np.uintp(sides[k, i]), np.uintp(sides[k, np.uintp(1) - i])
                if pixels[a] < least:
                    facing[np.uintp(ends[a])] = b
                    ends[a] += 1
        means = total / np.maximum(pixels, 1)
        joined = False
        for a in range(1, count + 1):
            chosen[a] = _neighbour(a, facing[starts[a] : ends[a]], pixels, means, shared)
            joined |= chosen[a] > 0
        if not joined:
            return _number(zones, parent, count)
        for a in range(1, count + 1):
            b, c = _root(parent, a), _root(parent, chosen[a])
            if chosen[a] and b != c:
                low = _unite(parent, b, c)
                pixels[low], total[low] = pixels[b] + pixels[c], total[b] + total[c]


@kernel
def tally(labels, heights, counts, bounds, total, first):
    """What one pass over the pixels tells of each building a, in row a − 1 of the results.

    ``labels`` (H + 2, W + 2) have a border of 0. counts (n, 6): pixels, Σ y, Σ x; steps out of
    the building over the sides of its pixels, how many of them into another, and steps out over
    their corners. bounds (n, 4): first row, first column, and those after the last. total (n,):
    Σ heights. first (n,): flat index of its first pixel. ``counts`` and ``total`` come in as 0.
    """
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    one, two = np.uintp(1), np.uintp(2)
    for i in range(bounds.shape[0]):
        bounds[i, 0], bounds[i, 1], bounds[i, 2], bounds[i, 3] = rows, columns, 0, 0
    for y in range(rows):
        for x in range(columns):
            a = labels[y + one, x + one]
            if a == 0:
                continue
            i = np.uintp(a - 1)
            if counts[i, 0] == 0:
                first[i] = y * columns + x
            counts[i, 0] += 1
            counts[i, 1] += y
            counts[i, 2] += x
            total[i] += heights[y, x]
            straight = (
                labels[y, x + one],
                labels[y + one, x],
                labels[y + one, x + two],
                labels[y + two, x + one],
            )
            diagonal = (
                labels[y, x],
                labels[y, x + two],
                labels[y + two, x],
                labels[y + two, x + two],
            )
            for b in straight:
                counts[i, 3] += b != a
                counts[i, 4] += (b != a) & (b > 0)
            for b in diagonal:
                counts[i, 5] += b != a
            bounds[i, 0] = min(bounds[i, 0], y)
            bounds[i, 1] = min(bounds[i, 1], x)
            bounds[i, 2] = max(bounds[i, 2], y + one)
            bounds[i, 3] = max(bounds[i, 3], x + one)


#: Reach of the gradient of a building's mask, px: 2 of the smoothing, 1 of the difference.
REACH = 3


@kernel
def fourfold(labels, bounds, sums):
    """sums[i] = Σ |∇m| e^{4iθ} as (real, imaginary), m the mask of building i + 1 smoothed by
    the binomial (1, 4, 6, 4, 1) / 16 along both axes, θ its gradient's angle from east to south.

    ``labels`` (H + 6, W + 6): the edges repeated, so that the map's border is no wall.
    """
    rows, columns = labels.shape[0] - 2 * REACH, labels.shape[1] - 2 * REACH
    mask = np.empty((2 * REACH + 1, columns + 2 * REACH), np.int32)
    smooth, slope = np.empty(mask.shape[1], np.int32), np.empty(mask.shape[1], np.int32)
    along_x, along_y = np.empty(columns, np.int32), np.empty(columns, np.int32)
    for i in range(bounds.shape[0]):
        a = i + 1
        top, bottom = max(bounds[i, 0] - REACH, 0), min(bounds[i, 2] + REACH, rows)
        left, right = max(bounds[i, 1] - REACH, 0), min(bounds[i, 3] + REACH, columns)
        wide = np.uintp(right - left)
        real = imaginary = 0.0
        for y in range(top, bottom):
            # row y of the map is row y + 3 of labels; mask[k] is row y + k − 3
            first = 2 * REACH if y > top else 0
            for k in range(first, 2 * REACH + 1):
                source = labels[y + k, left : right + 2 * REACH]
                target = mask[(y + k) % (2 * REACH + 1)]
                for x in range(np.uintp(source.size)):
                    target[x] = source[x] == a
            m0, m1, m2 = mask[y % 7], mask[(y + 1) % 7], mask[(y + 2) % 7]
            m3, m4 = mask[(y + 3) % 7], mask[(y + 4) % 7]
            m5, m6 = mask[(y + 5) % 7], mask[(y + 6) % 7]
            for x in range(wide + np.uintp(2 * REACH)):
                smooth[x] = m1[x] + m5[x] + 4 * (m2[x] + m4[x]) + 6 * m3[x]
                slope[x] = m6[x] - m0[x] + 4 * (m5[x] - m1[x]) + 5 * (m4[x] - m2[x])
            for x in range(wide):
                x1, x2, x3 = x + np.uintp(1), x + np.uintp(2), x + np.uintp(3)
                x4, x5, x6 = x + np.uintp(4), x + np.uintp(5), x + np.uintp(6)
                along_y[x] = slope[x1] + slope[x5] + 4 * (slope[x2] + slope[x4]) + 6 * slope[x3]
                along_x[x] = (
                    smooth[x6]
                    - smooth[x]
                    + 4 * (smooth[x5] - smooth[x1])
                    + 5 * (smooth[x4] - smooth[x2])
                )
            for x in range(wide):
                dy, dx = along_y[x], along_x[x]
                if dx or dy:
                    # |g| e^{4iθ} = g⁴ / |g|³
                    re, im, square = dx * dx - dy * dy, 2 * dx * dy, dx * dx + dy * dy
                    re, im, square = np.float64(re), np.float64(im), np.float64(square)
                    scale = 1 / (square * np.sqrt(square))
                    real += (re * re - im * im) * scale
                    imaginary += 2 * re * im * scale
        sums[i, 0], sums[i, 1] = real, imaginary


@kernel
def _turns(points, number, y, x):
    """Whether the way over the last two of ``number`` points to (y, x) bends to the left, seen
    with y to the south: the hull's left chain, walked southwards, does so everywhere."""
    ay, ax = points[number - 2, 0], points[number - 2, 1]
    by, bx = points[number - 1, 0], points[number - 1, 1]
    return (bx - ax) * (y - ay) - (by - ay) * (x - ax) < 0


@kernel
def _hull(first, last, points):
    """Convex hull of the points (j, first[j]) and (j, last[j]), into ``points`` (y, x), down on
    the left and up on the right; returns how many."""
    number = 0
    for j in range(first.size):
        while number > 1 and not _turns(points, number, j, first[j]):
            number -= 1
        points[number, 0], points[number, 1] = j, first[j]
        number += 1
    left = number
    for j in range(first.size - 1, -1, -1):
        if j == first.size - 1 and first[j] == last[j]:
            continue
        while number > left and not _turns(points, number, j, last[j]):
            number -= 1
        if j == 0 and first[j] == last[j]:
            break
        points[number, 0], points[number, 1] = j, last[j]
        number += 1
    return number


@kernel
def hulls(labels, bounds, starts, inside, boxes, circles):
    """Smallest convex shapes about each building, in pixels.

    inside (n,): pixels whose centres lie in the convex hull of the building's own. boxes (n, 2):
    long and short side of the rectangle of least area about the centres, each with a lattice
    line's distance more. circles (n,): diameter of the smallest circle about all its pixels.
    ``starts`` (n + 1,): how many rows the buildings before have.
    """
    first, last = np.empty(starts[-1], np.int64), np.empty(starts[-1], np.int64)
    first[:] = labels.shape[1]
    last[:] = -1
    for y in range(labels.shape[0]):
        for x in range(labels.shape[1]):
            if labels[y, x]:
                i = labels[y, x] - 1
                row = np.uintp(starts[i] + y - bounds[i, 0])
                first[row], last[row] = min(first[row], x), max(last[row], x)
    tallest = 0
    for i in range(starts.size - 1):
        tallest = max(tallest, starts[i + 1] - starts[i])
    points = np.empty((2 * tallest + 4, 2), np.int64)
    west, east = np.empty(tallest + 1, np.int64), np.empty(tallest + 1, np.int64)
    for i in range(starts.size - 1):
        mine = slice(starts[i], starts[i + 1])
        number = _hull(first[mine], last[mine], points)
        inside[i] = _lattice_points(points[:number])
        boxes[i, 0], boxes[i, 1] = _box(points[:number])
        tall = starts[i + 1] - starts[i]
        for j in range(tall + 1):  # corners of pixels
            above, below = starts[i] + max(j - 1, 0), starts[i] + min(j, tall - 1)
            west[j] = min(first[above], first[below])
            east[j] = max(last[above], last[below]) + 1
        number = _hull(west[: tall + 1], east[: tall + 1], points)
        circles[i] = 2 * _radius(points[:number])


@kernel
def _divisor(a, b):
    a, b = abs(a), abs(b)
    while b:
        a, b = b, a % b
    return a


@kernel
def _lattice_points(hull):
    """How many lattice points a convex polygon of lattice corners holds, by Pick's theorem."""
    twice = border = 0
    for k in range(hull.shape[0]):
        n = (k + 1) % hull.shape[0]
        twice += hull[k, 0] * hull[n, 1] - hull[k, 1] * hull[n, 0]
        border += _divisor(hull[n, 0] - hull[k, 0], hull[n, 1] - hull[k, 1])
    return (abs(twice) + border) // 2 + 1


@kernel
def _box(hull):
    """Sides, long and short, of the rectangle of least area along an edge of ``hull``. A lattice
    line stands for a strip: each side has the distance between lattice lines that way more."""
    least, long, short = np.inf, 1.0, 1.0
    for k in range(hull.shape[0]):
        n = (k + 1) % hull.shape[0]
        dy, dx = hull[n, 0] - hull[k, 0], hull[n, 1] - hull[k, 1]
        square = dy * dy + dx * dx
        if square == 0:
            continue
        across = low = high = 0
        for j in range(hull.shape[0]):
            y, x = hull[j, 0] - hull[k, 0], hull[j, 1] - hull[k, 1]
            along = y * dy + x * dx
            low, high = min(low, along), max(high, along)
            across = max(across, abs(y * dx - x * dy))
        step = _divisor(dy, dx)
        a, b = high - low + step, across + step
        area, side = a * b / square, max(a, b) / np.sqrt(square)
        if area < least or (area == least and side > long):
            least, long, short = area, side, min(a, b) / np.sqrt(square)
    return long, short


@kernel
def _about(points, support, size):
    """The smallest circle (y, x, radius²) about the points of indices ``support[:size]``, at
    most 4, that has the last of them on its rim; and which of them hold it, moved to the front of
    ``support``, as (…, how many)."""
    p = points[support[size - 1]]
    best = (0.0, 0.0, np.inf)
    one, two = -1, -1
    for i in range(size - 1):
        for j in range(i, size - 1):
            q, r = points[support[i]], points[support[j]]
            if i == j:
                y, x = (p[0] + q[0]) / 2, (p[1] + q[1]) / 2
            else:
                ay, ax, by, bx = q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]
                twice = 2.0 * (ax * by - ay * bx)
                if twice == 0:
                    continue
                a, b = ay * ay + ax * ax, by * by + bx * bx
                x, y = p[1] + (by * a - ay * b) / twice, p[0] + (ax * b - bx * a) / twice
            square = (p[0] - y) ** 2 + (p[1] - x) ** 2
            if square >= best[2]:
                continue
            holds = True
            for k in range(size - 1):
                s = points[support[k]]
                holds &= (s[0] - y) ** 2 + (s[1] - x) ** 2 <= square * (1 + 1e-12)
            if holds:
                best = (y, x, square)
                one, two = support[i], support[j]
    support[0], support[1], support[2] = support[size - 1], one, two
    return best[0], best[1], best[2], 2 if one == two else 3


@kernel
def _radius(points):
    """Radius of the smallest circle about ``points``: the farthest one outside goes onto the
    rim, until none is."""
    support = np.zeros(4, np.int64)
    size = 1
    y, x, square = np.float64(points[0, 0]), np.float64(points[0, 1]), 0.0
    while True:
        farthest, most = 0, -1.0
        for k in range(points.shape[0]):
            distance = (points[k, 0] - y) ** 2 + (points[k, 1] - x) ** 2
            if distance > most:
                farthest, most = k, distance
        if most <= square * (1 + 1e-12):
            return np.sqrt(square)
        support[size] = farthest
        before = square
        y, x, square, size = _about(points, support, size + 1)
        if not before < square < np.inf:  # rounding: no further progress
            return np.sqrt(max(before, most))


@kernel
def enclosed(labels, bounds, ground):
    """ground[i]: pixels of open ground (label 0) from which every way to the rim of the map, over
    sides and corners of pixels, crosses building i + 1."""
    most = 0
    for i in range(bounds.shape[0]):
        most = max(most, (bounds[i, 2] - bounds[i, 0]) * (bounds[i, 3] - bounds[i, 1]))
    reached, stack = np.zeros(most, np.bool_), np.empty(most, np.int64)
    for i in range(bounds.shape[0]):
        a, top, left = i + 1, bounds[i, 0], bounds[i, 1]
        tall, wide = bounds[i, 2] - top, bounds[i, 3] - left
        reached[: tall * wide] = False
        size = 0
        for y in range(tall):
            step = 1 if y == 0 or y == tall - 1 else max(wide - 1, 1)
            for x in range(0, wide, step):
                if labels[top + y, left + x] != a and not reached[y * wide + x]:
                    reached[y * wide + x] = True
                    stack[size] = y * wide + x
                    size += 1
        while size:
            size -= 1
            y, x = stack[size] // wide, stack[size] % wide
            for v in range(max(y - 1, 0), min(y + 2, tall)):
                for u in range(max(x - 1, 0), min(x + 2, wide)):
                    if not reached[v * wide + u] and labels[top + v, left + u] != a:
                        reached[v * wide + u] = True
                        stack[size] = v * wide + u
                        size += 1
        count = 0
        for y in range(tall):
            for x in range(wide):
                count += labels[top + y, left + x] == 0 and not reached[y * wide + x]
        ground[i] = count
