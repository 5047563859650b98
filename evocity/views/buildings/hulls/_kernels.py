"""Compiled loops over convex hulls. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


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
