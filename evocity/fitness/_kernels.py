"""Compiled loops over whole maps: horizons, counts in boxes, sums under windows."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def sky_seen(heights, y, x, starts, down, along, slopes, highest, seen):
    """seen[i] = mean cos² of the horizon angle at pixel (y[i], x[i]), over all directions.

    Direction d passes the pixels ``down``, ``along`` of starts[d] : starts[d + 1], relative to
    where it starts; a height there times ``slopes`` is the tangent it is seen under. What lies
    beyond the map does not rise. No roof is above ``highest``.
    """
    rows, columns = np.uintp(heights.shape[0]), np.uintp(heights.shape[1])
    directions = starts.size - 1
    for i in range(y.size):
        own = heights[y[i], x[i]]
        most = highest - own
        total = 0.0
        for d in range(directions):
            steepest = np.float32(0)
            for k in range(starts[d], starts[d + 1]):
                slope = slopes[np.uintp(k)]
                if most * slope <= steepest:  # nothing farther off can be seen above
                    break
                v = np.uintp(y[i] + down[np.uintp(k)])  # past the border on any side: huge
                u = np.uintp(x[i] + along[np.uintp(k)])
                if v >= rows or u >= columns:
                    break
                steepest = max(steepest, (heights[v, u] - own) * slope)
            tangent = np.float64(steepest)
            total += 1.0 / (1.0 + tangent * tangent)
        seen[i] = total / directions


@kernel
def sum_corner(mask, sums):
    """sums[y, x] = pixels of ``mask`` in rows before y and columns before x."""
    rows, columns = mask.shape
    sums[0] = 0
    for y in range(rows):
        sums[y + 1, 0] = 0
        line = 0
        for x in range(columns):
            line += mask[y, x]
            sums[y + 1, x + 1] = sums[y, x + 1] + line


@kernel
def count_boxes(sums, size, top, left):
    """Boxes of ``size`` px that hold a pixel of the mask of ``sums``, of a grid of which one box
    begins in row ``top``, column ``left``, each in 1 − size … 0."""
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    count = 0
    for y in range(top, rows, size):
        a, b = max(y, 0), min(y + size, rows)
        for x in range(left, columns, size):
            c, d = max(x, 0), min(x + size, columns)
            if sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c] > 0:
                count += 1
    return count


@kernel
def count_around(sums, reach):
    """(pixels of the mask of ``sums``, pixels at all) within ``reach`` rows and columns of each
    pixel of the mask, on the map, in all."""
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    within, room = 0, 0
    for y in range(rows):
        a, b = np.uintp(max(y - reach, 0)), np.uintp(min(y + reach + 1, rows))
        tall = np.int64(b) - np.int64(a)
        for x in range(columns):
            east = np.uintp(x + 1)
            if sums[y + 1, east] - sums[y, east] == sums[y + 1, x] - sums[y, x]:
                continue
            c, d = np.uintp(max(x - reach, 0)), np.uintp(min(x + reach + 1, columns))
            within += sums[b, d] - sums[a, d] - sums[b, c] + sums[a, c]
            room += tall * (np.int64(d) - np.int64(c))
    return within, room


@kernel
def gliding_moments(sums, size):
    """(ΣM, ΣM²) over all places of a box of ``size`` px on the map, M the pixels of the mask of
    ``sums`` in it."""
    rows, columns = sums.shape[0] - 1, sums.shape[1] - 1
    first, second = 0, 0.0  # the squares of large boxes are too many for whole numbers
    for y in range(rows - size + 1):
        for x in range(columns - size + 1):
            mass = (sums[y + size, x + size] - sums[y, x + size]) - (sums[y + size, x] - sums[y, x])
            first += mass
            second += np.float64(mass) * np.float64(mass)
    return first, second


@kernel
def pool_rows(fields, window, pooled):
    """pooled[f, i] += Σ window[i, y] · fields[f, y]: rows under windows, zeros of these left out.

    ``fields`` is (n, H, W), ``window`` (samples, H), ``pooled`` (n, samples, W). BLAS would do the
    same, but in threads of its own, which wait for each other on a busy machine.
    """
    count, rows, columns = fields.shape
    for f in range(count):
        for i in range(window.shape[0]):
            for y in range(rows):
                weight = window[i, y]
                if weight != 0:
                    for x in range(columns):
                        pooled[f, i, x] += weight * fields[f, y, x]


@kernel
def mark_whole(starts, members, labels, stones, columns, order, first, last, laid, width, whole):
    """whole[p, t] = True where pixel t of range block p of a child belongs to a building of a
    parent that came whole.

    Building b stands on the parent's lifs members[starts[b] : starts[b + 1]], and its pixels are
    those of ``labels`` (n, B²) that are b + 1. ``stones`` (n,) are the parent's, ``laid`` the
    child's, whose rows are ``columns`` and ``width`` range blocks wide; order[first[b] : last[b]]
    are the places in the child where the stone of its first lifs lies.
    """
    for b in range(starts.size - 1):
        origin = members[starts[b]]
        for k in range(first[b], last[b]):
            down = order[k] // width - origin // columns
            across = order[k] % width - origin % columns
            complete = True
            for m in members[starts[b] : starts[b + 1]]:
                i, j = m // columns + down, m % columns + across
                inside = 0 <= j < width and 0 <= i * width + j < laid.size
                if not inside or laid[i * width + j] != stones[m]:
                    complete = False
                    break
            if not complete:
                continue
            for m in members[starts[b] : starts[b + 1]]:
                place = (m // columns + down) * width + m % columns + across
                for t in range(labels.shape[1]):
                    whole[place, t] |= labels[m, t] == b + 1
