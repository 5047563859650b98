"""Compiled loops over lines of pixels and the graph they are.

Lines keep off the border of their array. Of two pixels side by side each is linked to the other,
and so are two that touch at a corner, unless a third joins them by sides; of four that fill a
square the upper two are not. So the links close a cycle about each hole of the lines, and no other.

A graph is four arrays: of its e edges the nodes ``first`` and ``last`` (e,), and the pixels from
one to the other, both included: ``path[starts[k] : starts[k + 1]]``, numbers row · columns +
column."""

import numpy as np

from evocity.accelerate import kernel

_DOWN = np.array([0, 1, 1, 1, 0, -1, -1, -1])
_ALONG = np.array([1, 1, 0, -1, -1, -1, 0, 1])


@kernel
def _linked(lines, y, x, way):
    """Whether the pixel (y, x) of the lines is linked to the next one that ``way``."""
    down, along = _DOWN[way], _ALONG[way]
    if not lines[y + down, x + along]:
        return False
    if down != 0 and along != 0:
        return not (lines[y + down, x] or lines[y, x + along])
    if along == 0:
        return True
    left = min(x, x + along)
    return not (lines[y + 1, left] and lines[y + 1, left + 1])


@kernel
def exits(frame, squares, out):
    """Of each piece of the frame, labelled from 1 in ``frame``, mark in ``out`` the pixel farthest
    from walls, the middle one of several."""
    rows, columns = frame.shape
    count = 0
    for y in range(rows):
        for x in range(columns):
            count = max(count, frame[y, x])
    best = np.full(count + 1, -1, np.int64)
    many = np.zeros(count + 1, np.int64)
    for y in range(rows):
        for x in range(columns):
            one = frame[y, x]
            if one > 0:
                if squares[y, x] > best[one]:
                    best[one], many[one] = squares[y, x], 0
                many[one] += squares[y, x] == best[one]
    for y in range(rows):
        for x in range(columns):
            one = frame[y, x]
            if one > 0 and squares[y, x] == best[one]:
                many[one] -= 2
                if many[one] == 0 or many[one] == -1:
                    out[y, x] = True


@kernel
def traced(lines, fixed):
    """The graph of ``lines``: nodes where not just two pixels are linked, or ``fixed`` ones, and
    one of each ring. Returns the nodes' pixels, and the graph."""
    rows, columns = lines.shape
    degree = np.zeros((rows, columns), np.int8)
    pixels = links = 0
    for y in range(rows):
        for x in range(columns):
            if lines[y, x]:
                pixels += 1
                for way in range(8):
                    degree[y, x] += _linked(lines, y, x, way)
                links += degree[y, x]
    number = np.full((rows, columns), np.int64(-1))
    gone = np.zeros((rows, columns), np.uint8)  # ways that are traced
    nodes = np.empty(pixels, np.int64)
    first, last = np.empty(links, np.int64), np.empty(links, np.int64)
    starts, path = np.zeros(links + 1, np.int64), np.empty(2 * links, np.int64)
    many = count = end = 0
    for y in range(rows):
        for x in range(columns):
            if lines[y, x] and (degree[y, x] != 2 or fixed[y, x]):
                number[y, x] = many
                nodes[many] = y * columns + x
                many += 1
    ready = many
    for rings in range(2):
        for k in range(ready if rings == 0 else rows * columns):
            p = nodes[k] if rings == 0 else k
            y, x = p // columns, p % columns
            if rings == 1:
                if not lines[y, x] or number[y, x] >= 0 or gone[y, x] != 0:
                    continue
                number[y, x] = many
                nodes[many] = p
                many += 1
            for way in range(8):
                if (gone[y, x] >> way) & 1 or not _linked(lines, y, x, way):
                    continue
                first[count] = number[y, x]
                path[end] = p
                end += 1
                v, u, onward = y, x, way
                while True:
                    gone[v, u] |= np.uint8(1 << onward)
                    v, u = v + _DOWN[onward], u + _ALONG[onward]
                    back = (onward + 4) % 8
                    gone[v, u] |= np.uint8(1 << back)
                    path[end] = v * columns + u
                    end += 1
                    if number[v, u] >= 0:
                        break
                    for other in range(8):
                        if other != back and _linked(lines, v, u, other):
                            onward = other
                            break
                last[count] = number[v, u]
                count += 1
                starts[count] = end
    return (
        nodes[:many].copy(),
        first[:count].copy(),
        last[:count].copy(),
        starts[: count + 1].copy(),
        path[:end].copy(),
    )


@kernel
def lengths_of(starts, path, columns):
    """Length of each edge from pixel to pixel, px."""
    lengths = np.zeros(starts.size - 1)
    for k in range(lengths.size):
        for i in range(starts[k] + 1, starts[k + 1]):
            step = abs(path[i] - path[i - 1])
            straight = step == 1 or step == columns
            lengths[k] += 1.0 if straight else np.sqrt(2.0)
    return lengths


@kernel
def _incident(first, last, alive, many):
    """Edges at each node: CSR of half-edges, 2 · edge + (0 at its first node, 1 at its last)."""
    begins = np.zeros(many + 1, np.int64)
    for k in range(first.size):
        if alive[k]:
            begins[first[k] + 1] += 1
            begins[last[k] + 1] += 1
    for k in range(many):
        begins[k + 1] += begins[k]
    halves, at = np.empty(begins[many], np.int64), begins.copy()
    for k in range(first.size):
        if alive[k]:
            halves[at[first[k]]] = 2 * k
            at[first[k]] += 1
            halves[at[last[k]]] = 2 * k + 1
            at[last[k]] += 1
    return begins, halves


@kernel
def _append(target, end, starts, path, half, skip):
    """Append the path of an edge, walked from the end that ``half`` names, without its first
    ``skip`` pixels; returns the new end."""
    k = half // 2
    size = starts[k + 1] - starts[k]
    for i in range(skip, size):
        target[end] = path[starts[k] + i] if half % 2 == 0 else path[starts[k + 1] - 1 - i]
        end += 1
    return end


@kernel
def _root(parent, node):
    while parent[node] != node:
        node = parent[node]
    return node


@kernel
def contracted(nodes, first, last, starts, path, lengths, radius, share):
    """One node for several whose discs overlap: edges no longer than a ``share`` of the larger
    ``radius`` (n,) of its two nodes, px, go, the shortest first, unless they would close a cycle;
    the node with the largest disc stays, and the edges of the others run on to it. Nodes stay
    within its disc. Returns of each node the one it became, and the graph without these edges."""
    many, count = nodes.size, first.size
    parent = np.arange(many)
    reach = np.zeros(many)  # how far the farthest of a node's own lies, px
    short = np.zeros(count, np.bool_)
    for k in np.argsort(lengths):
        one, other = _root(parent, first[k]), _root(parent, last[k])
        if one == other:
            continue
        if radius[one] < radius[other]:
            one, other = other, one
        far = reach[one] + lengths[k] + reach[other]
        if far > share * radius[one]:
            continue
        short[k] = True
        parent[other] = one
        reach[one] = far
    begins, halves = _incident(first, last, short, many)
    # from each root outward: by which short edge a node was reached
    inward = np.full(many, np.int64(-1))
    stack = np.empty(many, np.int64)
    for node in range(many):
        if parent[node] != node:
            continue
        stack[0] = node
        top = 1
        while top > 0:
            top -= 1
            here = stack[top]
            for i in range(begins[here], begins[here + 1]):
                half = halves[i]
                k = half // 2
                there = last[k] if half % 2 == 0 else first[k]
                if inward[here] // 2 == k and inward[here] >= 0:
                    continue
                inward[there] = half ^ 1  # walked from ``there``
                stack[top] = there
                top += 1
    total = 0
    kept = 0
    for k in range(count):
        if short[k]:
            continue
        kept += 1
        total += starts[k + 1] - starts[k]
        for node in (first[k], last[k]):
            while inward[node] >= 0:
                e = inward[node] // 2
                total += starts[e + 1] - starts[e] - 1
                node = last[e] if inward[node] % 2 == 0 else first[e]
    new_first, new_last = np.empty(kept, np.int64), np.empty(kept, np.int64)
    new_starts, new_path = np.zeros(kept + 1, np.int64), np.empty(total, np.int64)
    kept = end = 0
    for k in range(count):
        if short[k]:
            continue
        begin, node = end, first[k]
        while inward[node] >= 0:  # outward from the first node, then turned about
            e = inward[node] // 2
            end = _append(new_path, end, starts, path, inward[node], 1)
            node = last[e] if inward[node] % 2 == 0 else first[e]
        new_path[begin:end] = new_path[begin:end][::-1].copy()
        new_first[kept] = node
        end = _append(new_path, end, starts, path, 2 * k, 0)
        node = last[k]
        while inward[node] >= 0:
            e = inward[node] // 2
            end = _append(new_path, end, starts, path, inward[node], 1)
            node = last[e] if inward[node] % 2 == 0 else first[e]
        new_last[kept] = node
        kept += 1
        new_starts[kept] = end
    for node in range(many):
        parent[node] = _root(parent, node)
    return parent, new_first, new_last, new_starts, new_path


@kernel
def joined(many, first, last, starts, path, alive, fixed):
    """The graph of the ``alive`` edges alone, joined to one where two meet at a node that is not
    ``fixed``."""
    begins, halves = _incident(first, last, alive, many)
    count = 0
    total = 0
    for k in range(first.size):
        if alive[k]:
            count += 1
            total += starts[k + 1] - starts[k]
    new_first, new_last = np.empty(count, np.int64), np.empty(count, np.int64)
    new_starts, new_path = np.zeros(count + 1, np.int64), np.empty(total, np.int64)
    used = ~alive
    count = end = 0
    for rings in range(2):
        for node in range(many):
            stops = begins[node + 1] - begins[node] != 2 or fixed[node]
            if rings == 0 and not stops:
                continue
            for i in range(begins[node], begins[node + 1]):
                half = halves[i]
                if used[half // 2]:
                    continue
                new_first[count] = node
                skip = 0
                while True:
                    k = half // 2
                    used[k] = True
                    end = _append(new_path, end, starts, path, half, skip)
                    skip = 1
                    there = last[k] if half % 2 == 0 else first[k]
                    if there == node or begins[there + 1] - begins[there] != 2 or fixed[there]:
                        break
                    one, other = halves[begins[there]], halves[begins[there] + 1]
                    half = other if one == (half ^ 1) else one
                new_last[count] = there
                count += 1
                new_starts[count] = end
    return (
        new_first[:count].copy(),
        new_last[:count].copy(),
        new_starts[: count + 1].copy(),
        new_path[:end].copy(),
    )


@kernel
def without_spurs(first, last, lengths, bound, fixed, alive):
    """Take edges away that end nowhere, their length below the ``bound`` (n,) of the node they
    begin at, the shortest first; where only two are left, both stay. Returns how many went."""
    degree = np.zeros(fixed.size, np.int64)
    for k in range(first.size):
        if alive[k]:
            degree[first[k]] += 1
            degree[last[k]] += 1
    taken = 0
    for k in np.argsort(lengths):
        if not alive[k]:
            continue
        one, other = first[k], last[k]
        if degree[one] == 1:
            one, other = other, one
        if degree[other] != 1 or fixed[other] or degree[one] < 3 or lengths[k] >= bound[one]:
            continue
        alive[k] = False
        degree[one] -= 1
        degree[other] -= 1
        taken += 1
    return taken


@kernel
def middles_and_leasts(starts, path, values, middles, leasts):
    """Of each edge the median and the least of the ``values`` at its pixels."""
    flat = values.ravel()
    for k in range(middles.size):
        own = np.empty(starts[k + 1] - starts[k])
        for i in range(own.size):
            own[i] = flat[path[starts[k] + i]]
        own.sort()
        middles[k] = 0.5 * (own[(own.size - 1) // 2] + own[own.size // 2])
        leasts[k] = own[0]


@kernel
def _clear(squares, y, x):
    """How far a point may be moved off the middle of an open pixel, px, so that a line to that of
    the next pixel, moved so too, crosses no wall.

    With D px to the centre of the next wall's pixel no wall is within r = D − √½. Moved r / 2, the
    line to the next, √2 away at most, stays in one of the two discs if r² ≥ ½ + r² / 4; else a
    point must stay.
    """
    clear = np.sqrt(np.float64(squares[y, x])) - np.sqrt(0.5)
    return 0.5 * clear if 0.75 * clear * clear >= 0.5 else 0.0


@kernel
def _aside(squares, y, x):
    """How far the middle between walls lies down, and along, from that of pixel (y, x), px."""
    down = np.sqrt(np.float64(squares[y + 1, x])) - np.sqrt(np.float64(squares[y - 1, x]))
    along = np.sqrt(np.float64(squares[y, x + 1])) - np.sqrt(np.float64(squares[y, x - 1]))
    return min(max(0.5 * down, -0.5), 0.5), min(max(0.5 * along, -0.5), 0.5)


@kernel
def _held(down, along, most):
    """The same way, no longer than ``most``."""
    away = np.hypot(down, along)
    return (down, along) if away <= most else (down * most / away, along * most / away)


@kernel
def middles(pixels, squares, points):
    """points (n, 2) = row and column of the middle between walls next to each of the ``pixels``."""
    columns = squares.shape[1]
    for i in range(pixels.size):
        y, x = pixels[i] // columns, pixels[i] % columns
        down, along = _aside(squares, y, x)
        down, along = _held(down, along, _clear(squares, y, x))
        points[i, 0], points[i, 1] = y + down, x + along


@kernel
def smoothed(starts, path, squares, ends, rounds, points):
    """points (all pixels, 2) = row and column of the middle between walls next to each pixel of
    each edge, across the street along a row or a column; then, but for the two ``ends`` (edges, 2,
    2), ``rounds`` times the mean of itself and the two beside; never so far off its pixel that the
    line could cross a wall."""
    columns = squares.shape[1]
    for i in range(path.size):
        y, x = path[i] // columns, path[i] % columns
        down, along = _aside(squares, y, x)
        height = np.sqrt(np.float64(squares[y + 1, x])) + np.sqrt(np.float64(squares[y - 1, x]))
        width = np.sqrt(np.float64(squares[y, x + 1])) + np.sqrt(np.float64(squares[y, x - 1]))
        down, along = (0.0, along) if width < height else (down, 0.0)
        down, along = _held(down, along, _clear(squares, y, x))
        points[i, 0], points[i, 1] = y + down, x + along
    for k in range(starts.size - 1):
        points[starts[k]], points[starts[k + 1] - 1] = ends[k, 0], ends[k, 1]
    for k in range(starts.size - 1):
        begin, end = starts[k], starts[k + 1]
        for _ in range(rounds):
            y, x = points[begin, 0], points[begin, 1]
            for i in range(begin + 1, end - 1):
                here_y, here_x = points[i, 0], points[i, 1]
                row, column = path[i] // columns, path[i] % columns
                down = 0.25 * (y + 2 * here_y + points[i + 1, 0]) - row
                along = 0.25 * (x + 2 * here_x + points[i + 1, 1]) - column
                down, along = _held(down, along, _clear(squares, row, column))
                points[i, 0], points[i, 1] = row + down, column + along
                y, x = here_y, here_x


@kernel
def thickness(ground, squares, across, widest, spare, thick):
    """Raise thick[y, x] to the width, px, of the widest disc in the ``ground`` that covers (y, x):
    ``across`` at the disc's centre, as far as the next wall's pixel. Centres at which ``squares``
    is ``widest`` and more do not count: what they cover has its width already.

    spare : float32, px: by how much a pixel's own disc could grow and stay in one that counts; a
    disc half a pixel larger than that is passed over. Kept up.
    """
    rows, columns = ground.shape
    starts = np.zeros(widest + 1, np.int64)
    for y in range(1, rows - 1):
        for x in range(1, columns - 1):
            if ground[y, x] and squares[y, x] < widest:
                starts[widest - squares[y, x]] += 1
    for k in range(widest):
        starts[k + 1] += starts[k]
    order = np.empty(starts[widest], np.int64)
    for y in range(rows - 2, 0, -1):
        for x in range(columns - 2, 0, -1):
            if ground[y, x] and squares[y, x] < widest:
                k = widest - squares[y, x]
                starts[k] -= 1
                order[starts[k]] = y * columns + x
    for p in order:
        y, x = p // columns, p % columns
        own = np.sqrt(np.float64(squares[y, x]))
        if spare[y, x] >= own - 0.5:
            thick[y, x] = max(thick[y, x], across[y, x])
            continue
        reach = np.int64(own)
        for v in range(max(y - reach, 0), min(y + reach + 1, rows)):
            for u in range(max(x - reach, 0), min(x + reach + 1, columns)):
                away = (v - y) ** 2 + (u - x) ** 2
                if away < squares[y, x] and ground[v, u]:
                    thick[v, u] = max(thick[v, u], across[y, x])
                    spare[v, u] = max(spare[v, u], np.float32(own - np.sqrt(np.float64(away))))


@kernel
def straight_on(first, last, headings, least, street):
    """street[k] = the street that edge k is of, named by one of its edges: of the edges at a node
    two go on into each other where each turns least from the other, the straightest pair first, and
    by a cosine of ``least`` at least. headings : (edges, 2, 2), unit vectors (down, along) from the
    first node into the edge, and from the last."""
    many = 0
    for k in range(first.size):
        street[k] = k
        many = max(many, first[k] + 1, last[k] + 1)
    begins, halves = _incident(first, last, np.ones(first.size, np.bool_), many)
    for node in range(many):
        size = begins[node + 1] - begins[node]
        free = np.ones(size, np.bool_)
        while True:
            best, one, other = least, -1, -1
            for i in range(size):
                for j in range(i):
                    if not (free[i] and free[j]):
                        continue
                    a, b = halves[begins[node] + i], halves[begins[node] + j]
                    down = headings[a // 2, a % 2, 0] * headings[b // 2, b % 2, 0]
                    along = headings[a // 2, a % 2, 1] * headings[b // 2, b % 2, 1]
                    if -(down + along) > best:
                        best, one, other = -(down + along), i, j
            if one < 0:
                break
            free[one] = free[other] = False
            a = _root(street, halves[begins[node] + one] // 2)
            b = _root(street, halves[begins[node] + other] // 2)
            street[max(a, b)] = min(a, b)
    for k in range(first.size):
        street[k] = _root(street, k)
