"""Compiled loops over lifs and their range blocks. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def part_corner(a, whole, down, along, side):
    """Find the north-west pixel of a part's source in the source of its square of ``whole`` px; the
    part of ``side`` px lies at (down, along). ``a`` is a row of `isometries.AFFINE`."""
    y = a[0] * (whole - 1) + a[2] * down + a[4] * along + min(0, (a[2] + a[4]) * (side - 1))
    x = a[1] * (whole - 1) + a[3] * down + a[5] * along + min(0, (a[3] + a[5]) * (side - 1))
    return y, x


@kernel
def lay_pieces(whose, row, column, iso, cell, root, height, width, starts, index, top, left, side,
               affine, found):  # fmt: skip
    """Tile a map with the largest squares, from ``root`` px down by halves, that show a part of a
    single range block each.

    Each cell of ``cell`` px, of a grid ``(R, C)``, shows cell (row, column) of the genome
    ``whose`` under the isometry ``iso``. The range blocks of genome g are starts[g] : starts[g +
    1] of ``top``, ``left`` and ``side``, numbered by index[g] (H, W) from 0 in each.

    ``found`` (8, n) gets, for each square: its top, left and side; the genome; its range block; the
    square's place (down, along) in that; the isometry. Returns their number, which may exceed the
    room in ``found``, or -1 where no halving leads to a part of a single range block.
    """
    room = found.shape[1]
    count = 0
    stack = np.empty((4096, 3), np.int64)
    for y0 in range(0, height, root):
        for x0 in range(0, width, root):
            stack[0, 0], stack[0, 1], stack[0, 2] = y0, x0, root
            size = 1
            while size:
                size -= 1
                y, x, s = stack[size, 0], stack[size, 1], stack[size, 2]
                if y >= height or x >= width:
                    continue
                fits = y + s <= height and x + s <= width
                if fits:
                    i, j = y // cell, x // cell
                    g, turn = whose[i, j], iso[i, j]
                    a = affine[turn]
                    if s > cell:
                        # the cells under the square must lie as one square does
                        cells = s // cell
                        fits = cells * cell == s and y % cell == 0 and x % cell == 0
                        if fits:
                            for di in range(cells):
                                for dj in range(cells):
                                    u, v = i + di, j + dj
                                    if (
                                        whose[u, v] != g
                                        or iso[u, v] != turn
                                        or row[u, v] != row[i, j] + a[2] * di + a[4] * dj
                                        or column[u, v] != column[i, j] + a[3] * di + a[5] * dj
                                    ):
                                        fits = False
                                        break
                                if not fits:
                                    break
                            low = cells - 1
                            py = row[i, j] + min(0, (a[2] + a[4]) * low)
                            px = column[i, j] + min(0, (a[3] + a[5]) * low)
                            py, px = py * cell, px * cell
                    else:
                        down, along = y - i * cell, x - j * cell
                        fits = down + s <= cell and along + s <= cell
                        py, px = part_corner(a, cell, down, along, s)
                        py, px = py + row[i, j] * cell, px + column[i, j] * cell
                    if fits:
                        k = index[g, py, px]
                        b = starts[g] + k
                        if py + s <= top[b] + side[b] and px + s <= left[b] + side[b]:
                            if count < room:
                                found[0, count], found[1, count], found[2, count] = y, x, s
                                found[3, count], found[4, count] = g, k
                                found[5, count], found[6, count] = py - top[b], px - left[b]
                                found[7, count] = turn
                            count += 1
                            continue
                if s % 2 or s < 4:
                    return -1
                half = s // 2
                for q in range(4):
                    stack[size, 0] = y + (q // 2) * half
                    stack[size, 1] = x + (q % 2) * half
                    stack[size, 2] = half
                    size += 1
    return count


@kernel
def order_squares(found, ordered, index):
    """``ordered`` (8, n) gets the squares ``found`` (8, n) of `lay_pieces`, row by row; ``index``
    (H, W) the number of the square at each pixel."""
    rows, columns = index.shape
    for y in range(rows):
        for x in range(columns):
            index[y, x] = -1
    for k in range(ordered.shape[1]):
        index[found[0, k], found[1, k]] = -2 - k
    count = 0
    for y in range(rows):
        x = 0
        while x < columns:
            if index[y, x] >= 0:
                x += ordered[2, index[y, x]]
                continue
            k = -2 - index[y, x]
            for m in range(8):
                ordered[m, count] = found[m, k]
            s = ordered[2, count]
            for v in range(y, y + s):
                for u in range(x, x + s):
                    index[v, u] = count
            count += 1
            x += s


@kernel
def merge_siblings(
    top, left, side, index, most, sigma, beta, part, parent, other, x, y, dx, dy, iso, source, turn,
    affine, alive,
):  # fmt: skip
    """Merge four range blocks that form one of twice the side and continue each other, from the
    finest up, to the side ``most``: the north-west one becomes the whole, the others are no longer
    ``alive``. Returns the number of merges. ``sigma``, ``beta`` and ``part`` are bits; ``side``,
    ``x``, ``y``, ``dx``, ``dy`` and ``source`` change."""
    merges, s = 0, np.int64(most)
    for i in range(side.size):
        s = min(s, np.int64(side[i]))
    while 2 * s <= most:
        for i in range(side.size):
            if not alive[i] or side[i] != s or top[i] % (2 * s) or left[i] % (2 * s):
                continue
            if top[i] + 2 * s > index.shape[0] or left[i] + 2 * s > index.shape[1]:
                continue
            whole_x = whole_y = row = column = np.int64(0)
            ok = True
            wide, tall = np.int64(dx[i]), np.int64(dy[i])
            for q in range(4):
                a, b = q // 2, q % 2
                k = index[top[i] + a * s, left[i] + b * s]
                ok = alive[k] and side[k] == s
                ok &= top[k] == top[i] + a * s and left[k] == left[i] + b * s
                ok &= sigma[k] == sigma[i] and beta[k] == beta[i] and part[k] == part[i]
                ok &= parent[k] == parent[i] and other[k] == other[i]
                ok &= dx[k] == wide and dy[k] == tall
                if not ok or iso[k] != iso[i] or turn[k] != turn[i]:
                    ok = False
                    break
                # the north-west pixel of this quadrant in the whole's domain, and in its source
                v, u = part_corner(affine[iso[i]], 2 * s, a * s, b * s, s)
                at_x, at_y = np.int64(x[k]), np.int64(y[k])
                if wide > 0:
                    at_x -= wide // s * u
                    at_y -= tall // s * v
                v, u = part_corner(affine[turn[i]], 2 * s, a * s, b * s, s)
                from_row, from_column = np.int64(source[k] // 32768) - v, source[k] % 32768 - u
                if q == 0:
                    whole_x, whole_y, row, column = at_x, at_y, from_row, from_column
                elif at_x != whole_x or at_y != whole_y or from_row != row or from_column != column:
                    ok = False
                    break
            if not ok or row < 0 or column < 0:
                continue
            for q in range(1, 4):
                alive[index[top[i] + (q // 2) * s, left[i] + (q % 2) * s]] = False
            side[i] = 2 * s
            x[i], y[i], dx[i], dy[i] = whole_x, whole_y, 2 * wide, 2 * tall
            source[i] = row * 32768 + column
            merges += 1
        s *= 2
    return merges


@kernel
def part_places(
    lifs, down, along, side, whole, iso, turn, source, y, x, dy, dx, affine,
    sources, tops, lefts, talls, wides,
):  # fmt: skip
    """Compute the sources of squares of ``side`` px at (down, along) of the range blocks ``lifs``,
    of ``whole`` px each: the part of their domain blocks (``tops``, ``lefts``, ``talls``,
    ``wides``), and of their origins (``sources``). Arrays of lifs have a value for each lifs,
    arrays of squares a value for each square."""
    for k in range(lifs.size):
        i, s = lifs[k], np.int64(side[k])
        v, u = part_corner(affine[turn[i]], whole[i], down[k], along[k], s)
        sources[k] = source[i] + v * 32768 + u
        tall, wide = dy[i] // whole[i], dx[i] // whole[i]
        v, u = part_corner(affine[iso[i]], whole[i], down[k], along[k], s)
        tops[k], lefts[k] = y[i] + tall * v, x[i] + wide * u
        talls[k], wides[k] = tall * s, wide * s


@kernel
def in_bounds(
    height, width, side, steepest, cities, sigma, beta, x, y, dx, dy, iso, parent, source, turn,
    other, part,
):  # fmt: skip
    """Tell whether all nucleotides are within the bounds of `evocity.genome.NUCLEOTIDES`."""
    for i in range(side.size):
        if not (abs(sigma[i]) <= steepest and np.isfinite(beta[i])):
            return False
        if iso[i] > 7 or turn[i] > 7 or parent[i] >= cities or source[i] < 0:
            return False
        if other[i] >= cities or not 0 <= part[i] <= 1:
            return False
        tall, wide, s = np.int32(dy[i]), np.int32(dx[i]), side[i]
        if wide == 0:
            if sigma[i] != 0 or tall != 0 or x[i] != 0 or y[i] != 0 or iso[i] != 0:
                return False
            continue
        if tall <= s or wide <= s or tall % s != 0 or wide % s != 0:
            return False
        if x[i] < 0 or y[i] < 0 or x[i] + wide > width or y[i] + tall > height:
            return False
    return True
