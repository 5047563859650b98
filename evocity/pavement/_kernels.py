"""Compiled loops over range blocks. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def tile(side, index, top, left):
    """Lay squares of the sides ``side`` (n,), each with its north-west corner at the first bare
    pixel, row by row.

    ``index`` (H, W) gets the number of each pixel's square, ``top`` and ``left`` (n,) the corners.
    Returns the number of laid squares: n if they tile the map, else the number of the first that
    reaches beyond the map or onto another, or -1 if pixels stay bare.
    """
    rows, columns = index.shape
    for y in range(rows):
        for x in range(columns):
            index[y, x] = -1
    y = x = 0
    for i in range(side.size):
        while y < rows and index[y, x] >= 0:
            x += 1
            if x == columns:
                y, x = y + 1, 0
        s = side[i]
        if y == rows or s < 1 or y + s > rows or x + s > columns:
            return i
        for u in range(x, x + s):  # all above is laid, so an obstacle lies in this row
            if index[y, u] >= 0:
                return i
        top[i], left[i] = y, x
        for v in range(y, y + s):
            for u in range(x, x + s):
                index[v, u] = i
    for v in range(y, rows):
        for u in range(columns):
            if index[v, u] < 0:
                return -1
    return side.size


@kernel
def lay_squares(top, left, side, index):
    """``index`` (H, W) gets the number of the square at each pixel; the squares tile the map."""
    for i in range(side.size):
        for y in range(top[i], top[i] + side[i]):
            for x in range(left[i], left[i] + side[i]):
                index[y, x] = i


@kernel
def _holds(where, top, left, side):
    for y in range(top, top + side):
        for x in range(left, left + side):
            if where[y, x]:
                return True
    return False


@kernel
def split_squares(where, known, top, left, side, least, squares, index):
    """Halve squares with a true pixel of ``where`` (H, W) until their sides are at most ``least``.

    ``known`` (H, W) holds the number of each pixel's square. ``squares`` (4, m) gets number, top,
    left and side of the parts, row by row, and ``index`` (H, W) the number of the part at each
    pixel. Returns the number of parts; or, if halving gives no whole number of pixels, 2 or more,
    the side that cannot be halved, below 0.
    """
    rows, columns = index.shape
    for y in range(rows):
        for x in range(columns):
            index[y, x] = -1
    count = 0
    for y in range(rows):
        x = 0
        while x < columns:
            if index[y, x] >= 0:
                x += squares[3, index[y, x]]
                continue
            i = known[y, x]
            v, u, s = np.int64(top[i]), np.int64(left[i]), np.int64(side[i])
            while s > least and _holds(where, v, u, s):
                if s % 2 or s < 4:
                    return -s
                s //= 2
                v += s * (y >= v + s)
                u += s * (x >= u + s)
            squares[0, count], squares[1, count], squares[2, count] = i, v, u
            squares[3, count] = s
            for a in range(v, v + s):
                for b in range(u, u + s):
                    index[a, b] = count
            count += 1
            x += s
    return count


@kernel
def cut_squares(raster, top, left, which, blocks):
    """``blocks`` (m, s, s) get the squares ``which`` (m,) of ``raster``, by their corners."""
    count, side, _ = blocks.shape
    for k in range(count):
        y, x = top[which[k]], left[which[k]]
        for i in range(side):
            for j in range(side):
                blocks[k, i, j] = raster[y + i, x + j]


@kernel
def spread(values, index, raster):
    """raster[i] = values[index[i]], each of them flat."""
    for i in range(index.size):
        raster[i] = values[index[i]]


@kernel
def touching(where, top, left, side, found):
    """found[i] = whether square i holds a true pixel of ``where`` (H, W)."""
    for i in range(side.size):
        found[i] = False
        for y in range(top[i], top[i] + side[i]):
            for x in range(left[i], left[i] + side[i]):
                if where[y, x]:
                    found[i] = True
                    break
            if found[i]:
                break


@kernel
def sum_squares(raster, top, left, side, sums):
    """sums[i] = the sum of ``raster`` over square i, in float64, row by row."""
    for i in range(side.size):
        total = 0.0
        for y in range(top[i], top[i] + side[i]):
            for x in range(left[i], left[i] + side[i]):
                total += raster[y, x]
        sums[i] = total
