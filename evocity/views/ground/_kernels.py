"""Compiled loops over open ground."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def squared_distances(built, squares, nearest):
    """squares[y, x] = squared distance in px to the centre of the nearest built pixel, exact;
    nearest[:, y, x] = row and column of that pixel. Both −1 everywhere if nothing is built.

    The lower envelope of Meijster, Roerdink & Hesselink 2000, §2. Nothing beyond the next built
    pixel of a row can be nearer, so each gap between two of them is a problem of its own.
    """
    rows, columns = built.shape
    none = np.int32(rows)
    high = np.empty((rows, columns), np.int32)  # to the nearest built pixel of the column
    for x in range(columns):
        high[0, x] = 0 if built[0, x] else none
    for y in range(1, rows):
        for x in range(columns):
            high[y, x] = 0 if built[y, x] else min(high[y - 1, x] + 1, none)
    for y in range(rows - 2, -1, -1):
        for x in range(columns):
            high[y, x] = min(high[y, x], high[y + 1, x] + 1)
    site, begins = np.empty(columns, np.int64), np.empty(columns, np.int64)
    for y in range(rows):
        first, last = 0, 0  # of the gap; both are built, or ends of the row
        while True:
            last = first + 1
            while last < columns and high[y, np.uintp(last)] > 0:
                last += 1
            last = min(last, columns - 1)
            count = 0
            for u in range(first, last + 1):
                rise = np.int64(high[y, np.uintp(u)])
                if rise == none:
                    continue
                start = first
                while count > 0:
                    i = site[np.uintp(count - 1)]
                    other = np.int64(high[y, np.uintp(i)])
                    # u is nearer than i from here on; exact, all this is far below 2⁵³
                    meet = (u * u - i * i + rise * rise - other * other) / (2.0 * (u - i))
                    start = np.int64(np.floor(meet)) + 1
                    if start > begins[np.uintp(count - 1)]:
                        break
                    count -= 1
                    start = first
                if start <= last:
                    site[np.uintp(count)], begins[np.uintp(count)] = u, start
                    count += 1
            end = last
            for k in range(count - 1, -1, -1):
                i = site[np.uintp(k)]
                rise = np.int64(high[y, np.uintp(i)])
                row = y - rise if y >= rise and built[np.uintp(y - rise), np.uintp(i)] else y + rise
                for x in range(begins[np.uintp(k)], end + 1):
                    squares[y, np.uintp(x)] = (x - i) * (x - i) + rise * rise
                    nearest[0, y, np.uintp(x)] = row
                    nearest[1, y, np.uintp(x)] = i
                end = begins[np.uintp(k)] - 1
            if count == 0:
                squares[y] = -1
                nearest[:, y] = -1
            if last == columns - 1:
                break
            first = last


@kernel
def nest(grounds, buildings, pixels, enclosed_by, enclosed):
    """Who lies within whom, for ground and built components labelled 1…n.

    Sets the ``pixels`` of each ground component, the built one (from 0) that encloses it, −1 if
    it reaches the border, and the pixels within each built component that are not its own.

    Above the first pixel of a component, in the order of rows, lies what surrounds it; and what
    surrounds comes before what it surrounds.
    """
    rows, columns = grounds.shape
    many = pixels.size
    total = np.zeros(many + enclosed.size, np.int64)  # ground components, then built ones
    around = np.full(total.size, -1, np.int64)
    open_ended = np.zeros(total.size, np.bool_)
    order = np.empty(total.size, np.int64)
    met = 0
    for y in range(rows):
        for x in range(columns):
            ground = np.int64(grounds[y, x])
            one = ground - 1 if ground > 0 else many + np.int64(buildings[y, x]) - 1
            if total[np.uintp(one)] == 0:
                order[met] = one
                met += 1
                if y > 0:
                    above = np.int64(grounds[y - 1, x])
                    above = above - 1 if above > 0 else many + np.int64(buildings[y - 1, x]) - 1
                    around[one] = above
            total[np.uintp(one)] += 1
            if y == 0 or x == 0 or y == rows - 1 or x == columns - 1:
                open_ended[np.uintp(one)] = True
    for one in range(many):
        pixels[one] = total[one]
    for one in range(enclosed.size):
        enclosed[one] = -total[many + one]
    for k in range(met - 1, -1, -1):
        one = order[k]
        if one >= many:
            enclosed[one - many] += total[one]
        if not open_ended[one]:
            total[around[one]] += total[one]
        if one < many:
            enclosed_by[one] = -1 if open_ended[one] else around[one] - many


@kernel
def _opposed(built, squares, nearest, y, x):
    """Whether walls stand on two sides of ground pixel (y, x): its nearest wall and that of a
    neighbour lie in directions 120° apart or more, or two opposite neighbours are built."""
    if (built[y - 1, x] and built[y + 1, x]) or (built[y, x - 1] and built[y, x + 1]):
        return True
    down = y - np.int64(nearest[0, y, x])
    along = x - np.int64(nearest[1, y, x])
    for v in range(y - 1, y + 2):
        for u in range(x - 1, x + 2):
            product = down * (v - nearest[0, v, u]) + along * (u - nearest[1, v, u])
            if product < 0 and 4 * product * product >= squares[y, x] * squares[v, u]:
                return True
    return False


@kernel
def _simple(lines, y, x):
    """(whether taking (y, x) away neither parts nor joins anything, how many neighbours it has):
    ground hangs together by 8 neighbours (Yokoi, Toriwaki & Fukumura 1975)."""
    n, s, w, e = lines[y - 1, x], lines[y + 1, x], lines[y, x - 1], lines[y, x + 1]
    nw, ne = lines[y - 1, x - 1], lines[y - 1, x + 1]
    sw, se = lines[y + 1, x - 1], lines[y + 1, x + 1]
    crossings = 0
    crossings += (not e) and (ne or n)
    crossings += (not n) and (nw or w)
    crossings += (not w) and (sw or s)
    crossings += (not s) and (se or e)
    count = 0
    for one in (n, s, w, e, nw, ne, sw, se):
        count += one
    return crossings == 1, count


@kernel
def _thin_further(lines, order, between, left):
    """Take ``order[:left]`` away again and again, whatever is simple and no end of a line;
    returns how many are left, moved to the front."""
    columns = lines.shape[1]
    before = left + 1
    while left < before:
        before, left = left, 0
        for k in range(before):
            y, x = order[k] // columns, order[k] % columns
            if not lines[y, x]:
                continue
            simple, neighbours = _simple(lines, y, x)
            if simple and (neighbours > 1 or not between[k]):
                lines[y, x] = False
            else:
                order[left], between[left] = order[k], between[k]
                left += 1
    return left


@kernel
def _prune(lines, squares, solid, order, left, depth):
    """Take branches away whose end's disc stands out of that of their beginning, where three
    lines meet or ground is solid, by no more than ``depth`` px; returns how many."""
    columns = lines.shape[1]
    taken = 0
    for k in range(left):
        y, x = order[k] // columns, order[k] % columns
        if not lines[y, x] or _simple(lines, y, x)[1] != 1:
            continue
        v, u, back_v, back_u = y, x, y, x
        length, neighbours = 0, 1
        while True:
            next_v, next_u = v, u
            for i in range(v - 1, v + 2):
                for j in range(u - 1, u + 2):
                    here, came = i == v and j == u, i == back_v and j == back_u
                    if lines[i, j] and not here and not came:
                        next_v, next_u = i, j
            back_v, back_u, v, u = v, u, next_v, next_u
            length += 1
            if solid[v, u]:
                break
            neighbours = _simple(lines, v, u)[1]
            if neighbours != 2:
                break
        if not solid[v, u] and neighbours == 1:  # a line of its own
            continue
        stands_out = np.hypot(v - y, u - x) + np.sqrt(squares[y, x]) - np.sqrt(squares[v, u])
        if stands_out > depth:
            continue
        taken += 1
        v, u = y, x
        for _ in range(length):
            lines[v, u] = False
            next_v, next_u = v, u
            for i in range(v - 1, v + 2):
                for j in range(u - 1, u + 2):
                    if lines[i, j]:
                        next_v, next_u = i, j
            v, u = next_v, next_u
    return taken


@kernel
def thin(built, squares, nearest, solid, depth, lines):
    """Thin ``lines``, at first all ground, to lines one pixel wide, but for ``solid`` pixels.

    Pixels go in the order of their distance from walls, so that lines end up in the middle; and
    only where that leaves the topology as it is. First all go but those that have walls on two
    sides, then these where they lie side by side; at last branches into dents no deeper than
    ``depth`` px.
    """
    rows, columns = built.shape
    farthest = 0
    for y in range(rows):
        for x in range(columns):
            if lines[y, x] and not solid[y, x]:
                farthest = max(farthest, squares[y, x])
    starts = np.zeros(farthest + 2, np.int64)
    for y in range(rows):
        for x in range(columns):
            if lines[y, x] and not solid[y, x]:
                starts[squares[y, x] + 1] += 1
    for k in range(farthest + 1):
        starts[k + 1] += starts[k]
    order = np.empty(starts[farthest + 1], np.int64)
    for y in range(rows):
        for x in range(columns):
            if lines[y, x] and not solid[y, x]:
                order[starts[squares[y, x]]] = y * columns + x
                starts[squares[y, x]] += 1
    between = np.zeros(order.size, np.bool_)
    left = 0
    for p in order:
        y, x = p // columns, p % columns
        opposed = _opposed(built, squares, nearest, y, x)
        if not opposed and _simple(lines, y, x)[0]:
            lines[y, x] = False
        else:
            order[left], between[left] = p, opposed
            left += 1
    left = _thin_further(lines, order, between, left)
    while _prune(lines, squares, solid, order, left, depth) > 0:
        left = _thin_further(lines, order, between, left)


@kernel
def widths_across(squares, lines, widths):
    """widths[y, x] = width in px of the ground at the pixels of ``lines``, 0 elsewhere: of
    neighbours across, along rows or columns, the sum of the distances to walls, and 1. Lines
    keep off the border, here and below."""
    rows, columns = squares.shape
    for y in range(rows):
        for x in range(columns):
            width = 0.0
            if lines[y, x]:
                down = np.sqrt(squares[y - 1, x]) + np.sqrt(squares[y + 1, x])
                along = np.sqrt(squares[y, x - 1]) + np.sqrt(squares[y, x + 1])
                width = min(down, along) + 1.0
            widths[y, x] = width


@kernel
def link_lengths(lines, lengths):
    """lengths[k] = half the length in px of the links of the k-th pixel of ``lines``, row by row.
    Two that touch at a corner are linked unless a third joins them by sides."""
    rows, columns = lines.shape
    k = 0
    for y in range(rows):
        for x in range(columns):
            if not lines[y, x]:
                continue
            straight = 0
            diagonal = 0
            for step in (-1, 1):
                straight += lines[y + step, x]
                straight += lines[y, x + step]
                for side in (-1, 1):
                    joined = lines[y + step, x] or lines[y, x + side]
                    diagonal += lines[y + step, x + side] and not joined
            lengths[k] = 0.5 * straight + np.sqrt(0.5) * diagonal
            k += 1
