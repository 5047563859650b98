"""Compiled walks through the products of a shape's maps; tests/naive.py has slow versions."""

import numpy as np

from evocity.accelerate import kernel

#: The greatest length of a word.
DEEPEST = 63


@kernel
def walked(
    maps, table, ending, corners, depth, fine, base, mix, found, lengths, colours, grid, most
):
    """Count the pieces of a shape, in lexicographic order of their words, and write those that fit.

    It writes their products into ``found`` ``(room, m, m + 1)``, the lengths of their words into
    ``lengths`` and their colours into ``colours`` ``(room, C)``. If ``grid`` has cells, each piece
    marks the cell of its middle instead, and later ones cover earlier ones: ``grid`` is (marks
    uint8 ``(side**m,)``, paint ``(side**m, C)``, middle ``(m,)``, scale, offset ``(m,)``, side).

    ``maps`` ``(N, m, m + 1)``; ``table`` ``(S, N)`` the automaton, −1 for none; ``ending``
    ``(S,)``: the states in which a branch may end; ``corners`` ``(n, m)``: it ends where their box
    is smaller than ``fine`` on every side, or at ``depth`` ≤ `DEEPEST`. It stops beyond ``most``
    pieces. ``base`` ``(N, C)``: colours of the letters; each letter counts ``mix`` times as much as
    the letter before.
    """
    marks, paint, middle, scale, offset, side = grid
    letters, size = maps.shape[0], maps.shape[1]
    products = np.empty((depth + 1, size, size + 1))
    products[0] = np.eye(size, size + 1)
    states = np.zeros(depth + 1, np.int64)
    letter = np.zeros(depth + 1, np.int64)
    level, count = 0, 0
    arrived = True
    while level >= 0:
        product = products[level]
        if arrived:
            letter[level] = 0
            if level == depth or _small(product, corners, fine):
                if ending[states[level]]:
                    if marks.size:
                        cell = _cell(product, middle, scale, offset, side)
                        marks[cell] = 1
                        _colour(letter, level, base, mix, paint[cell])
                    elif count < found.shape[0]:
                        found[count] = product
                        lengths[count] = level
                        _colour(letter, level, base, mix, colours[count])
                    count += 1
                    if count > most:
                        return count
                letter[level] = letters  # nothing below
        while letter[level] < letters and table[states[level], letter[level]] < 0:
            letter[level] += 1
        if letter[level] >= letters:
            level -= 1
            arrived = False
            if level >= 0:
                letter[level] += 1
            continue
        one, below = maps[letter[level]], products[level + 1]
        for i in range(size):
            for j in range(size + 1):
                total = product[i, size] if j == size else 0.0
                for k in range(size):
                    total += product[i, k] * one[k, j]
                below[i, j] = total
        states[level + 1] = table[states[level], letter[level]]
        level += 1
        arrived = True
    return count


@kernel
def _colour(letter, level, base, mix, colour):
    """Mix the colour of a word of ``level`` letters: each counts ``mix`` times as much as the
    letter before."""
    for c in range(base.shape[1]):
        total, share, shares = 0.0, 1.0, 0.0
        for k in range(level):
            total += share * base[letter[k], c]
            shares += share
            share *= mix
        colour[c] = total / shares if level else base[0, c]


@kernel
def _cell(product, middle, scale, offset, side):
    """Number the cell of a piece's middle: rows from the north, then columns, then layers."""
    size = product.shape[0]
    cell = 0
    for axis in range(size):
        i = 1 - axis if axis < 2 else axis
        value = product[i, size]
        for k in range(size):
            value += product[i, k] * middle[k]
        at = min(max(int(np.floor(value * scale + offset[i])), 0), side - 1)
        cell = cell * side + (side - 1 - at if i == 1 else at)
    return cell


@kernel
def _small(product, corners, fine):
    """Tell whether the box of a piece is smaller than ``fine`` on every side."""
    size = product.shape[0]
    for i in range(size):
        low, high = np.inf, -np.inf
        for n in range(corners.shape[0]):
            value = 0.0
            for k in range(size):
                value += product[i, k] * corners[n, k]
            low, high = min(low, value), max(high, value)
        if high - low >= fine:
            return False
    return True


@kernel
def farthest(maps, table, points, centre, radius, direction, slack):
    """Compute how far the attractor reaches in a ``direction``, up to ``slack`` too little. It
    takes the greatest dot product with ``points`` ``(S, m)``, one of each state's attractor,
    under all products for which a ball about ``centre`` with ``radius`` could reach farther.
    ``table`` has no dead ends."""
    letters, size = maps.shape[0], maps.shape[1]
    # of each product: the direction in its own frame, and its origin's distance along the direction
    rows = np.empty((DEEPEST + 1, size))
    rows[0] = direction
    along = np.zeros(DEEPEST + 1)
    states = np.zeros(DEEPEST + 1, np.int64)
    letter = np.zeros(DEEPEST + 1, np.int64)
    best, level = -np.inf, 0
    while level >= 0:
        if letter[level] == 0:
            value, middle, length = along[level], along[level], 0.0
            for k in range(size):
                value += rows[level, k] * points[states[level], k]
                middle += rows[level, k] * centre[k]
                length += rows[level, k] ** 2
            best = max(best, value)
            if level == DEEPEST or middle + np.sqrt(length) * radius <= best + slack:
                letter[level] = letters
        if letter[level] >= letters:
            level -= 1
            continue
        one = letter[level]
        letter[level] += 1
        to = table[states[level], one]
        if to < 0:
            continue
        below = level + 1
        along[below] = along[level]
        for k in range(size):
            along[below] += rows[level, k] * maps[one, k, size]
            total = 0.0
            for j in range(size):
                total += rows[level, j] * maps[one, j, k]
            rows[below, k] = total
        states[below], letter[below] = to, 0
        level = below
    return best


@kernel
def played(maps, backwards, edges, chances, latest, draws, found):
    """Play the chaos game of a shape's language backwards: the newest letter is the outermost.

    ``backwards`` ``(S + 1,)``: starts of the edges into each state in ``edges`` ``(E, 2)``: (state
    from which, letter); ``chances`` ``(E,)`` cumulative within a state; ``latest`` ``(S, m)``, the
    last point of each state, kept for the next call; ``draws`` uniform in 0…1. If no edge leads to
    a state, the game continues from a drawn state. It writes a point into ``found``
    ``(len(draws), m)`` whenever it comes to state 0, and returns the number of points.
    """
    size, states = maps.shape[1], len(backwards) - 1
    state, count = 0, 0
    for draw in draws:
        if backwards[state] == backwards[state + 1]:
            state = min(int(draw * states), states - 1)
            continue
        at = backwards[state]
        while at < backwards[state + 1] - 1 and chances[at] < draw:
            at += 1
        one, to = maps[edges[at, 1]], edges[at, 0]
        moved = np.empty(size)
        for i in range(size):
            moved[i] = one[i, size]
            for k in range(size):
                moved[i] += one[i, k] * latest[state, k]
        latest[to] = moved
        state = to
        if state == 0:
            found[count] = moved
            count += 1
    return count


@kernel
def fill_faces(points, faces, colours, pixels):
    """Fill ``pixels`` (side, side, 3) with the ``faces`` (f, 3) of pieces, later over earlier.

    ``points`` (n, k, 2) are in px, x to the right, y down; ``colours`` (n, 3) uint8. A triangle
    fills the pixels whose middles lie in it or on its edges. A piece that fills none marks the
    pixels along the edges of its faces.
    """
    side = pixels.shape[0]
    for n in range(points.shape[0]):
        filled = False
        for f in range(faces.shape[0]):
            ax, ay = points[n, faces[f, 0]]
            bx, by = points[n, faces[f, 1]]
            cx, cy = points[n, faces[f, 2]]
            if (bx - ax) * (cy - ay) == (by - ay) * (cx - ax):
                continue  # flat
            top = max(int(np.ceil(min(ay, by, cy) - 0.5)), 0)
            bottom = min(int(np.floor(max(ay, by, cy) - 0.5)), side - 1)
            left = max(int(np.ceil(min(ax, bx, cx) - 0.5)), 0)
            right = min(int(np.floor(max(ax, bx, cx) - 0.5)), side - 1)
            for i in range(top, bottom + 1):
                for j in range(left, right + 1):
                    y, x = i + 0.5, j + 0.5
                    u = (bx - ax) * (y - ay) - (by - ay) * (x - ax)
                    v = (cx - bx) * (y - by) - (cy - by) * (x - bx)
                    w = (ax - cx) * (y - cy) - (ay - cy) * (x - cx)
                    if (u >= 0 and v >= 0 and w >= 0) or (u <= 0 and v <= 0 and w <= 0):
                        filled = True
                        for c in range(3):
                            pixels[i, j, c] = colours[n, c]
        if filled:
            continue
        for f in range(faces.shape[0]):
            for k in range(3):
                ax, ay = points[n, faces[f, k]]
                bx, by = points[n, faces[f, (k + 1) % 3]]
                steps = int(2 * max(abs(bx - ax), abs(by - ay))) + 1
                for step in range(steps + 1):
                    j = int(np.floor(ax + (bx - ax) * step / steps))
                    i = int(np.floor(ay + (by - ay) * step / steps))
                    if 0 <= i < side and 0 <= j < side:
                        for c in range(3):
                            pixels[i, j, c] = colours[n, c]
