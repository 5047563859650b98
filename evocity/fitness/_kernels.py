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
def fourfold(structure, fields):
    """``fields`` (3, H, W) get w cos 4θ, w sin 4θ and w of a ``structure`` (2, H, W), w cos 2θ and
    w sin 2θ: w e^{4iθ} = (w e^{2iθ})² / w. Returns the largest w."""
    _, rows, columns = structure.shape
    none, most, two = np.float32(0), np.float32(0), np.float32(2)
    for y in range(rows):
        for x in range(columns):
            real, imaginary = structure[0, y, x], structure[1, y, x]
            w = np.sqrt(real * real + imaginary * imaginary)
            turned = two * real / w if w > none else none
            fields[0, y, x] = real * turned - w
            fields[1, y, x] = imaginary * turned
            fields[2, y, x] = w
            most = max(most, w)
    return most


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
def trace_copies(top, left, side, row, column, turn, affine, labels, first, table, copies, shown):
    """Which copy of which building each pixel of a map shows that is laid of stones of a city.

    The squares of ``side`` px at (top, left) of the map show those at (row, column) of the city
    under the isometries ``turn``; ``affine`` is `isometries.AFFINE`. ``labels`` (H, W) are the
    city's buildings, 0 where there is none. Pixels that show one building under one isometry and
    one translation are a copy of it: ``copies`` (5, room) gets of each the isometry, the
    translation (rows, columns), the building, and how many pixels show it; ``shown``, of the map's
    size, at each of these pixels, the copy's number and ``first``, numbers from 1.

    ``table`` finds copies again: zeros, a power of two of them, more than room. Returns how many
    copies there are, or -1 if there is no room for them.
    """
    room, mask = copies.shape[1], np.int64(table.size - 1)
    count = 0
    for k in range(side.size):
        a, s = affine[turn[k]], side[k]
        # pixel (i, j) of the map shows (down + a[2] i + a[4] j, across + a[3] i + a[5] j)
        down = row[k] + a[0] * (s - 1) - a[2] * top[k] - a[4] * left[k]
        across = column[k] + a[1] * (s - 1) - a[3] * top[k] - a[5] * left[k]
        building, copy = 0, 0
        for i in range(top[k], top[k] + s):
            for j in range(left[k], left[k] + s):
                b = labels[down + a[2] * i + a[4] * j, across + a[3] * i + a[5] * j]
                if b == 0:
                    continue
                if b != building:
                    mixed = ((down * 65_599 + across) * 8 + turn[k]) * 1_000_003 + b
                    at = (mixed * -7_046_029_254_386_353_131 >> 32) & mask  # 2⁶⁴ / golden ratio
                    while table[at] != 0:
                        c = table[at] - 1
                        if (
                            copies[3, c] == b
                            and copies[1, c] == down
                            and copies[2, c] == across
                            and copies[0, c] == turn[k]
                        ):
                            break
                        at = (at + 1) & mask
                    if table[at] == 0:
                        if count == room:
                            return -1
                        copies[0, count], copies[1, count] = turn[k], down
                        copies[2, count], copies[3, count] = across, b
                        copies[4, count] = 0
                        count += 1
                        table[at] = count
                    building, copy = b, table[at]
                copies[4, copy - 1] += 1
                shown[i, j] = first + copy
    return count


@kernel
def distances(x, y, ends, same, sums):
    """Sums over all pairs of a column of ``x`` (F, n) and one of ``y`` (F, m) of the Euclidean
    distance: sums[0] counts rows 0 : ends[0], sums[k] those and ends[k − 1] : ends[k].

    If they are the ``same``, each pair of different columns counts once. In float32.
    """
    near, far = np.empty(y.shape[1], np.float32), np.empty(y.shape[1], np.float32)
    totals = np.zeros((ends.size, y.shape[1]), np.float32)
    for i in range(x.shape[1]):
        count = np.uintp(i if same else y.shape[1])
        near[:] = np.float32(0)
        for row in range(ends[0]):
            here, there = x[row, i], y[row]
            for j in range(count):
                near[j] += (here - there[j]) ** 2
        total = totals[0]
        for j in range(count):
            total[j] += np.sqrt(near[j])
        for k in range(1, ends.size):
            far[:] = near
            for row in range(ends[k - 1], ends[k]):
                here, there = x[row, i], y[row]
                for j in range(count):
                    far[j] += (here - there[j]) ** 2
            total = totals[k]
            for j in range(count):
                total[j] += np.sqrt(far[j])
    for k in range(ends.size):
        sums[k] = 0.0
        for j in range(np.uintp(y.shape[1])):
            sums[k] += totals[k, j]


@kernel
def off_squared(labels, heights, means, squares):
    """squares[i] += Σ (h − means[i])² over the pixels of building i + 1."""
    for y in range(np.uintp(labels.shape[0])):
        for x in range(np.uintp(labels.shape[1])):
            i = np.uintp(labels[y, x] - 1)
            if labels[y, x]:
                squares[i] += (heights[y, x] - means[i]) ** 2


@kernel
def nearest(y, x, distances, which):
    """``distances`` and ``which`` (n, k) get how far the k points are that are nearest to each of
    n, itself among them, and their numbers, rising. Returns whether any two of the k + 1 nearest
    are equally far: then others may stand in another order."""
    count, most = distances.shape
    squares, numbers = np.empty(most + 1), np.empty(most + 1, np.int64)
    tied = False
    for i in range(count):
        kept = 0
        for j in range(count):
            down, across = y[j] - y[i], x[j] - x[i]
            square = down * down + across * across
            if kept <= most:
                kept += 1
            elif square >= squares[most]:
                continue
            k = kept - 1
            while k > 0 and squares[k - 1] > square:
                squares[k], numbers[k] = squares[k - 1], numbers[k - 1]
                k -= 1
            squares[k], numbers[k] = square, j
        for k in range(1, kept):
            tied |= squares[k] == squares[k - 1]
        for k in range(most):
            distances[i, k], which[i, k] = np.sqrt(squares[k]), numbers[k]
    return tied
