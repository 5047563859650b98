"""Compiled loops of breeding. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def outline_difference(current, brought, top, left, tall, wide):
    """Average |brought − current| over the rectangle's outline pixels, without sides on the map's
    border, which cut no fabric; 0 if all sides lie there."""
    rows, columns = current.shape
    bottom, right = top + tall - 1, left + wide - 1
    total, count = 0.0, 0
    for x in range(left, right + 1):
        if top > 0:
            total += abs(brought[top, x] - current[top, x])
            count += 1
        if bottom < rows - 1:
            total += abs(brought[bottom, x] - current[bottom, x])
            count += 1
    for y in range(top, bottom + 1):
        if left > 0:
            total += abs(brought[y, left] - current[y, left])
            count += 1
        if right < columns - 1:
            total += abs(brought[y, right] - current[y, right])
            count += 1
    return total / count if count else 0.0


@kernel
def inject(current, brought, owner, donor, size, block, rows, columns, tolerance, least, most):
    """Lay macro-blocks of ``size`` blocks from ``brought`` onto ``current``, in the order of the
    candidate corners (rows, columns, in blocks), where the outline differs by at most
    ``tolerance``, until ``donor`` owns ``least`` blocks; never beyond ``most``.

    Changes ``current`` (pixels) and ``owner`` (blocks) in place. Returns the owned blocks.
    """
    owned = np.count_nonzero(owner == donor)
    for k in range(rows.size):
        if owned >= least:
            break
        top, left = rows[k], columns[k]
        gained = 0
        for i in range(top, top + size):
            for j in range(left, left + size):
                if owner[i, j] != donor:
                    gained += 1
        if gained == 0 or owned + gained > most:
            continue
        y, x, side = top * block, left * block, size * block
        if outline_difference(current, brought, y, x, side, side) > tolerance:
            continue
        current[y : y + side, x : x + side] = brought[y : y + side, x : x + side]
        owner[top : top + size, left : left + size] = donor
        owned += gained
    return owned


@kernel
def outline_sides(group):
    """List the outer sides of a ``group`` of blocks ``(2, g)``, rows and columns, as ``(3, s)``:
    row, column, and direction: 0 north, 1 south, 2 west, 3 east."""
    count = group.shape[1]
    inside = np.zeros((group[0].max() + 3, group[1].max() + 3), np.bool_)
    for g in range(count):
        inside[group[0, g] + 1, group[1, g] + 1] = True
    sides = np.empty((3, 4 * count), np.int64)
    found = 0
    for g in range(count):
        i, j = group[0, g] + 1, group[1, g] + 1
        for facing in range(4):
            y = i + (facing == 1) - (facing == 0)
            x = j + (facing == 3) - (facing == 2)
            if not inside[y, x]:
                sides[0, found], sides[1, found], sides[2, found] = i - 1, j - 1, facing
                found += 1
    return sides[:, :found].copy()


@kernel
def outline_step(current, brought, columns, theirs, sides, start, end, most):
    """Average |brought − current| along the outline of a group of blocks laid from block ``start``
    at block ``end`` (row, column), metres; inf once it surely exceeds ``most``.

    Both maps are blocks ``(n, B, B)``, with ``columns`` of them in a row of ``current`` and
    ``theirs`` in a row of ``brought``; ``sides`` are those of `outline_sides`. Sides on the map's
    border at ``end`` do not count; 0 if all lie there.
    """
    block = current.shape[1]
    last_row, last_column = current.shape[0] // columns - 1, columns - 1
    surely = most * block * sides.shape[1]
    total, count = 0.0, 0
    for k in range(sides.shape[1]):
        i, j, facing = sides[0, k] + end[0], sides[1, k] + end[1], sides[2, k]
        y, x = i + (facing == 1) - (facing == 0), j + (facing == 3) - (facing == 2)
        if not (0 <= y <= last_row and 0 <= x <= last_column):
            continue
        here = i * columns + j
        there = (sides[0, k] + start[0]) * theirs + sides[1, k] + start[1]
        edge = 0 if facing % 2 == 0 else block - 1
        count += block
        for p in range(block):
            if facing < 2:
                total += abs(brought[there, edge, p] - current[here, edge, p])
            else:
                total += abs(brought[there, p, edge] - current[here, p, edge])
        if total > surely:
            return np.inf
    return total / count if count else 0.0


@kernel
def best_move(
    blocks, turned, columns, theirs, groups, sides, which, starts, ends, exchanged, tolerance,
    change, choice,
):  # fmt: skip
    """Find, among the first ``choice`` admissible moves of a group of ``blocks``, the move with the
    least step along its outline, of equals the first; −1 if no move is admissible.

    ``turned`` (K, n, B, B) are the map under K isometries, ``theirs`` (K,) their blocks in a row,
    ``groups`` (K, 2, g) and ``sides`` (K, 3, s) the group and its sides there. Move k is from
    ``starts[k]`` of the turned map ``which[k]`` to ``ends[k]`` of the map, ``(m, 2)`` each, blocks.

    Admissible moves step by at most ``tolerance`` metres and change the map by more than
    ``change`` metres on average. Of two ``exchanged`` places the worse counts, and what gives way
    turns back. Other arguments are as in `outline_step`.
    """
    block = blocks.shape[1]
    best, least = -1, np.inf
    for k in range(len(starts)):
        w, start, end = which[k], starts[k], ends[k]
        group, there, wide = groups[w], turned[w], theirs[w]
        step = outline_step(blocks, there, columns, wide, sides[w], start, end, tolerance)
        if exchanged and step <= tolerance:
            back = outline_step(there, blocks, wide, columns, sides[w], end, start, tolerance)
            step = max(step, back)
        if step > tolerance:
            continue
        total = 0.0
        for g in range(group.shape[1]):
            own = (group[0, g] + end[0]) * columns + group[1, g] + end[1]
            new = (group[0, g] + start[0]) * wide + group[1, g] + start[1]
            for i in range(block):
                for j in range(block):
                    total += abs(there[new, i, j] - blocks[own, i, j])
        if total <= change * group.shape[1] * block * block:
            continue
        if best < 0 or step < least:
            best, least = k, step
        choice -= 1
        if choice == 0:
            break
    return best


@kernel
def tallied(rows):
    """Count each label in each row of ``rows`` (labels from 0, −1 for no label): row r contains
    ``labels[k]`` ``counts[k]`` times for each k in ``starts[r] : starts[r + 1]``."""
    starts = np.zeros(rows.shape[0] + 1, np.int64)
    labels, counts = np.empty(rows.size, np.int64), np.empty(rows.size, np.int64)
    found = 0
    for r in range(rows.shape[0]):
        for p in range(rows.shape[1]):
            label = rows[r, p]
            if label < 0:
                continue
            k = starts[r]
            while k < found and labels[k] != label:
                k += 1
            if k == found:
                labels[k], counts[k] = label, 0
                found += 1
            counts[k] += 1
        starts[r + 1] = found
    return starts, labels[:found].copy(), counts[:found].copy()


@kernel
def fill_courts(region, count, inside, columns):
    """Add to ``region``, of which ``count`` blocks are set, the blocks it encloses: no path over
    block sides leads out from them. ``inside`` marks its blocks. Returns the new count."""
    rows = inside.size // columns
    top, bottom, left, right = rows, -1, columns, -1
    for k in range(count):
        i, j = divmod(region[k], columns)
        top, bottom, left, right = min(top, i), max(bottom, i), min(left, j), max(right, j)
    tall, wide = bottom - top + 3, right - left + 3
    out = np.zeros((tall, wide), np.bool_)
    stack = np.empty(tall * wide, np.int64)
    out[0, 0] = True
    stack[0], room = 0, 1
    while room:
        room -= 1
        i, j = divmod(stack[room], wide)
        for y, x in ((i - 1, j), (i + 1, j), (i, j - 1), (i, j + 1)):
            if not (0 <= y < tall and 0 <= x < wide) or out[y, x]:
                continue
            within = 0 < y < tall - 1 and 0 < x < wide - 1
            if within and inside[(y + top - 1) * columns + x + left - 1]:
                continue
            out[y, x] = True
            stack[room] = y * wide + x
            room += 1
    for i in range(1, tall - 1):
        for j in range(1, wide - 1):
            b = (i + top - 1) * columns + j + left - 1
            if not (out[i, j] or inside[b]):
                inside[b] = True
                region[count] = b
                count += 1
    return count


@kernel
def _room(blocks, components, buildings):
    """Allocate the working arrays of `_grown`: the region, marks of its blocks, marks of the
    components it brings, pixels hit of each building, and lists of these two."""
    region, inside = np.empty(blocks, np.int64), np.zeros(blocks, np.bool_)
    brought, hit = np.zeros(components, np.bool_), np.zeros(buildings, np.int64)
    struck, fetched = np.empty(buildings, np.int64), np.empty(components, np.int64)
    return region, inside, brought, hit, struck, fetched


@kernel
def _spread(
    seed, columns, owner, donor, components, buildings, standing, kept, cut, limit, room
):  # fmt: skip
    """`_grown` without clearing: returns the numbers of blocks of the region, of blocks in the
    room, and of used entries of both lists. The first exceeds ``limit`` for a refused region."""
    region, inside, brought, hit, struck, fetched = room
    count, done, touched, held = 0, 0, 0, 0
    for b in seed:
        if not inside[b]:
            inside[b] = True
            region[count] = b
            count += 1
    before = -1
    while before < count <= limit:
        while done < count <= limit:
            b = region[done]
            done += 1
            row = donor * owner.size + b
            for k in range(components.starts[row], components.starts[row + 1]):
                one = components.labels[k]
                if brought[one]:
                    continue
                brought[one] = True
                fetched[held] = one
                held += 1
                if components.spans[one + 1] - components.spans[one] > limit:
                    return limit + 1, count, held, touched
                for q in range(components.spans[one], components.spans[one + 1]):
                    if not inside[components.places[q]]:
                        inside[components.places[q]] = True
                        region[count] = components.places[q]
                        count += 1
            if owner[b] == donor:
                continue
            row = owner[b] * owner.size + b
            for k in range(buildings.starts[row], buildings.starts[row + 1]):
                one = buildings.labels[k]
                if hit[one] == 0:
                    struck[touched] = one
                    touched += 1
                hit[one] += buildings.pixels[k]
        before = count
        for t in range(touched):
            one = struck[t]
            whole = buildings.whole[one]
            gone = whole - standing[one] + hit[one]
            if hit[one] == standing[one] or not (kept[one] or gone > cut * whole):
                continue
            for q in range(buildings.spans[one], buildings.spans[one + 1]):
                b = buildings.places[q]
                if owner[b] == buildings.whose[one] and not inside[b]:
                    inside[b] = True
                    region[count] = b
                    count += 1
                if count > limit:
                    return count, count, held, touched
        if before == count <= limit:
            count = fill_courts(region, count, inside, columns)
    return count, count, held, touched


@kernel
def _grown(
    seed, columns, owner, donor, components, buildings, standing, kept, cut, limit, room
):  # fmt: skip
    """`grown` in a `_room`, which it clears afterwards."""
    region, inside, brought, hit, struck, fetched = room
    found, count, held, touched = _spread(
        seed, columns, owner, donor, components, buildings, standing, kept, cut, limit, room
    )
    inside[region[:count]] = False
    brought[fetched[:held]] = False
    hit[struck[:touched]] = 0
    return (region[:count], held) if found <= limit else (region[:0], 0)


@kernel
def grown(seed, columns, owner, donor, components, buildings, standing, kept, cut, limit):
    """Grow the blocks ``seed`` over every built component of ``donor`` that they touch, over every
    building on the map that would lose more than the share ``cut`` (or anything, if it is to be
    ``kept`` whole), and over the courts these enclose, until nothing is left to add.

    ``components`` and ``buildings`` are `evocity.operators.groups.Footings` of the same maps, with
    ``columns`` blocks in a row; ``owner`` is the present map of each block, ``standing`` the
    present number of pixels of each building. Returns the region's blocks, none beyond ``limit`` of
    them, and the number of ``donor``'s components in it.
    """
    room = _room(owner.size, components.whole.size, buildings.whole.size)
    return _grown(
        seed, columns, owner, donor, components, buildings, standing, kept, cut, limit, room
    )


@kernel
def inject_regions(
    current, brought, owner, donor, kin, size, corners, columns, components, buildings, standing,
    kept, tolerance, cut, limit, least, most,
):  # fmt: skip
    """Work like `inject`, but each macro-block is `grown` first and contains a component of the
    donor, if there is one. Maps are blocks ``(n, B, B)``, ``owner`` is ``(n,)``, candidate
    ``corners`` (row, column) are ``(m, 2)``, in blocks. Maps of one ``kin``, the turned maps of a
    parent, share their blocks. Changes ``current``, ``owner``, ``standing`` and ``kept`` in
    place. Returns the number of owned blocks."""
    starts, labels, pixels = buildings.starts, buildings.labels, buildings.pixels
    blocks = owner.size
    owned = np.count_nonzero(kin[owner] == kin[donor])
    bare = not (components.whose == donor).any()
    seed = np.empty(size * size, np.int64)
    room = _room(blocks, components.whole.size, buildings.whole.size)
    here = np.zeros(2, np.int64)
    for m in range(len(corners)):
        if owned >= least:
            break
        gained = 0
        for i in range(size):
            for j in range(size):
                b = (corners[m, 0] + i) * columns + corners[m, 1] + j
                seed[i * size + j] = b
                gained += kin[owner[b]] != kin[donor]
        if gained == 0 or owned + gained > most:
            continue
        region, held = _grown(
            seed, columns, owner, donor, components, buildings, standing, kept, cut, limit, room
        )
        gained = np.count_nonzero(kin[owner[region]] != kin[donor])
        if gained == 0 or owned + gained > most or (held == 0 and not bare):
            continue
        sides = outline_sides(np.stack((region // columns, region % columns)))
        step = outline_step(current, brought, columns, columns, sides, here, here, tolerance)
        if step > tolerance:
            continue
        for b in region:
            row = donor * blocks + b
            if owner[b] != donor:
                old = owner[b] * blocks + b
                for k in range(starts[old], starts[old + 1]):
                    standing[labels[k]] -= pixels[k]
                for k in range(starts[row], starts[row + 1]):
                    standing[labels[k]] += pixels[k]
            for k in range(starts[row], starts[row + 1]):
                kept[labels[k]] = True
            owner[b] = donor
            current[b] = brought[b]
        owned += gained
    return owned


@kernel
def give_back(current, maps, owner, buildings, standing):
    """Restore cut buildings where their lost blocks hold no building now, and no part of a lost
    building would come back with them.

    ``maps`` (m, n, B, B) are all parents' blocks; the rest is as in `inject_regions`. Changes
    ``current``, ``owner`` and ``standing`` in place. Returns the number of restored buildings."""
    starts, labels, pixels, spans, places, whose, whole = buildings
    blocks, mended = owner.size, 0
    for one in range(whole.size):
        if not 0 < standing[one] < whole[one]:
            continue
        mine, free = whose[one], True
        for q in range(spans[one], spans[one + 1]):
            b = places[q]
            row = owner[b] * blocks + b
            if owner[b] == mine:
                continue
            if starts[row] < starts[row + 1]:
                free = False
                break
            row = mine * blocks + b
            for k in range(starts[row], starts[row + 1]):
                if standing[labels[k]] == 0:
                    free = False
                    break
            if not free:
                break
        if not free:
            continue
        for q in range(spans[one], spans[one + 1]):
            b = places[q]
            if owner[b] != mine:
                owner[b] = mine
                current[b] = maps[mine, b]
                for k in range(starts[mine * blocks + b], starts[mine * blocks + b + 1]):
                    standing[labels[k]] += pixels[k]
        mended += 1
    return mended


@kernel
def _squares(heights, intended, top, left, side):
    """Sum the squared differences in a square, in float64, row by row."""
    total = 0.0
    for y in range(top, top + side):
        for x in range(left, left + side):
            apart = heights[y, x] - intended[y, x]
            total += apart * apart
    return total


@kernel
def find_strays(heights, intended, top, left, side, grain, limit, ignored, where):
    """Mark in ``where`` (H, W) the squares whose mean squared difference of ``heights`` from the
    ``intended`` ones is above ``limit``, but for ``ignored`` pixels; of squares larger than
    ``grain`` the parts of a grid of this side."""
    rows, columns = where.shape
    parts = np.zeros((rows // grain + 1, columns // grain + 1), np.int8)  # 0 is unknown
    for i in range(side.size):
        s = np.int64(side[i])
        if s <= grain:
            if _squares(heights, intended, top[i], left[i], s) > limit * (s * s):
                for y in range(top[i], top[i] + s):
                    for x in range(left[i], left[i] + s):
                        where[y, x] |= not ignored[y, x]
            continue
        for y in range(top[i], top[i] + s):
            for x in range(left[i], left[i] + s):
                a, b = y // grain, x // grain
                if parts[a, b] == 0:
                    total = _squares(heights, intended, a * grain, b * grain, grain)
                    parts[a, b] = 1 + (total > limit * (grain * grain))
                if parts[a, b] == 2:
                    where[y, x] |= not ignored[y, x]


@kernel
def block_moments(before, after, read, reads, free, top, left, side, moments):
    """Sum over the ``free`` pixels of each square, in float64, row by row: ``moments`` (7, n) gets
    the largest move, the number of pixels, and the sums of s, t, s², t² and s·t, with s = ``reads``
    and t = ``after``. A pixel's move is that from ``before`` to ``after`` and that from ``read`` to
    ``reads``."""
    for i in range(side.size):
        most = pixels = sum_s = sum_t = square_s = square_t = product = 0.0
        for y in range(top[i], top[i] + side[i]):
            for x in range(left[i], left[i] + side[i]):
                if not free[y, x]:
                    continue
                move = abs(after[y, x] - before[y, x]) + abs(reads[y, x] - read[y, x])
                most = max(most, np.float64(move))
                s, t = np.float64(reads[y, x]), np.float64(after[y, x])
                pixels += 1
                sum_s += s
                sum_t += t
                square_s += s * s
                square_t += t * t
                product += s * t
        moments[0, i], moments[1, i] = most, pixels
        moments[2, i], moments[3, i] = sum_s, sum_t
        moments[4, i], moments[5, i], moments[6, i] = square_s, square_t, product
