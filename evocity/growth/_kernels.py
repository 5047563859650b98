"""Compiled loops of growth, in one file, since those that lay call all others. Slow twins stand in
tests/naive.py.

Fabric and originals consist of square *cells* of ``cell`` px. A fabric is an array of *stones*,
int32, one for each cell: 8·index + isometry of the original's cell laid there, −1 where the cell is
bare. Indices run through the cells of all originals, row by row, original after original; so do
their heights, ``brought``. A *place* is a rectangle of cells, a *candidate* a rectangle of an
original's cells of that size under an isometry: (original, isometry, row, column of its north-west
cell). ``sides``, int64 ``(originals, 3)``, holds rows, columns and first cell of each original;
``lays`` is `evocity.isometries.AFFINE`.
"""

import numpy as np

from evocity.accelerate import kernel

#: Side of the windows that must not be identical, pixels.
WINDOW = 64
#: The tables note windows `ANCHORED` px wide at every eighth pixel: at any place, each window of
#: `WINDOW` contains one of them.
APART = 8
ANCHORED = WINDOW - APART + 1

#: Anchors in a row, for their numbers row by row.
ACROSS = 1 << 31


# Entries of the table of windows: free, forgotten, at several anchors.
FREE, GONE, MANY = -1, -2, -3

_ROW, _COLUMN = np.uint64(0x9E3779B97F4A7C15), np.uint64(0xD1342543DE82EF95)
_MIX = np.uint64(0xBF58476D1CE4E5B9)
_HALF, _LESS = np.uint64(32), np.uint64(29)

# Units of flow per metre, whole numbers; an edge costs one more, so that the shortest of equal
# cuts wins.
_UNITS = 1024
_NEVER = 1 << 40

# Penalty that puts candidates after all others, metres.
_AKIN = 1e12


@kernel
def origin(stone, sides):
    """Find the source of a stone, as the candidate of a single cell."""
    index, one = stone >> 3, 0
    while one + 1 < sides.shape[0] and index >= sides[one + 1, 2]:
        one += 1
    row, column = divmod(index - sides[one, 2], sides[one, 1])
    return one, stone & 7, row, column


@kernel
def fabric_window(stones, brought, sides, lays, cell, top, left, out):
    """out = the fabric's heights from pixel (top, left) on; −1 on bare cells."""
    high, wide = out.shape
    for row in range(top // cell, (top + high + cell - 1) // cell):
        y, i0 = row * cell - top, max(top - row * cell, 0)
        i1 = min(cell, high - y)
        for column in range(left // cell, (left + wide + cell - 1) // cell):
            x, j0 = column * cell - left, max(left - column * cell, 0)
            j1 = min(cell, wide - x)
            stone = stones[row, column]
            if stone < 0:
                out[y + i0 : y + i1, x + j0 : x + j1] = -1
                continue
            first, down, along = strides(origin(stone, sides), 1, 1, cell, sides, lays)
            for i in range(i0, i1):
                for j in range(j0, j1):
                    out[y + i, x + j] = brought[first + i * down + j * along]


@kernel
def candidate(draw, one, isos, tall, wide, sides, lays):
    """Decode a random whole ``draw``: a candidate of original ``one`` for a place of tall × wide
    cells."""
    iso = isos[(draw & 7) % isos.size]
    if lays[iso, 2] == 0:  # it lays rows of the original as columns
        tall, wide = wide, tall
    across = sides[one, 1] - wide + 1
    row, column = divmod((draw >> 3) % ((sides[one, 0] - tall + 1) * across), across)
    return one, iso, row, column


@kernel
def strides(chosen, tall, wide, cell, sides, lays):
    """Compute the strides of a candidate's pixel (y, x) in ``brought``: first + y·down + x·along.
    With ``cell`` 1, the same for its cells."""
    one, iso, row, column = chosen
    lay = lays[iso]
    if lay[2] == 0:
        tall, wide = wide, tall
    width = sides[one, 1] * cell
    first = (row * cell + lay[0] * (tall * cell - 1)) * width
    first += column * cell + lay[1] * (wide * cell - 1) + sides[one, 2] * cell * cell
    return first, lay[2] * width + lay[3], lay[4] * width + lay[5]


@kernel
def overlap_cost(stand, standing, brought, at, cell, limit):
    """Sum |brought − stand| over the pixels of the cells ``standing``; stops above ``limit``.

    at : `strides` of the candidate."""
    first, down, along = at
    total = 0.0
    for i in range(standing.shape[0]):
        for j in range(standing.shape[1]):
            if standing[i, j]:
                for y in range(i * cell, (i + 1) * cell):
                    line = 0.0  # a separate sum, so that lines do not wait for each other
                    for x in range(j * cell, (j + 1) * cell):
                        line += abs(brought[first + y * down + x * along] - stand[y, x])
                    total += line
        if total > limit:
            break
    return total


@kernel
def edge_steps(stand, standing, brought, at, cell):
    """Sum |brought − stand| along the north, south, west and east edge of each cell
    ``standing``."""
    first, down, along = at
    tall, wide = standing.shape
    steps = np.zeros((tall, wide, 4))
    last = cell - 1
    for i in range(tall):
        for j in range(wide):
            if not standing[i, j]:
                continue
            y, x = i * cell, j * cell
            for k in range(cell):
                north_west = first + y * down + x * along
                edge = north_west + k * along
                steps[i, j, 0] += abs(brought[edge] - stand[y, x + k])
                steps[i, j, 1] += abs(brought[edge + last * down] - stand[y + last, x + k])
                edge = north_west + k * down
                steps[i, j, 2] += abs(brought[edge] - stand[y + k, x])
                steps[i, j, 3] += abs(brought[edge + last * along] - stand[y + k, x + last])
    return steps


@kernel
def between(steps, standing, i, j, p, q, side):
    """Compute the step across the edge ``side`` of cell (i, j), which cell (p, q) shares: the mean
    of the known steps of both."""
    total = steps[i, j, side] + steps[p, q, side ^ 1]  # 0 for bare cells
    return total / 2 if standing[i, j] and standing[p, q] else total


@kernel
def least_cut(costs, rims, must, never, laid):
    """Cut a place in cells that are laid and cells that stay, at the least cost: ``costs`` (i, j,
    s) along the south (s = 0) or east (s = 1) edge of a cell, ``rims`` (i, j) next to cells
    outside. Cells ``must`` be laid, or ``never``; ``laid`` gets those to lay, as many as equal cost
    allows.

    The least cut is the largest flow from cells that stay to cells that are laid (Ford & Fulkerson
    1956), in whole units: a search finds shortest paths to all ends at once, and fills each.
    """
    tall, wide = must.shape
    count = tall * wide
    room = np.zeros((count, 4), np.int64)  # to the cell in the south, north, east, west
    step = np.array([wide, -wide, 1, -1])
    inward, outward = np.zeros(count, np.int64), np.zeros(count, np.int64)
    for i in range(tall):
        for j in range(wide):
            k = i * wide + j
            if i + 1 < tall:
                room[k, 0] = room[k + wide, 1] = 1 + np.int64(costs[i, j, 0] * _UNITS)
            if j + 1 < wide:
                room[k, 2] = room[k + 1, 3] = 1 + np.int64(costs[i, j, 1] * _UNITS)
            inward[k] = _NEVER if never[i, j] else np.int64(rims[i, j] * _UNITS)
            outward[k] = _NEVER if must[i, j] else 0
    came, queue = np.empty(count, np.int64), np.empty(count, np.int64)
    filled = True
    while filled:
        filled = False
        came[:] = -2  # not reached; −1: from outside, else the step that leads here
        head, tail = 0, 0
        for k in range(count):
            if inward[k] > 0:
                came[k], queue[tail] = -1, k
                tail += 1
        while head < tail:
            k = queue[head]
            head += 1
            if outward[k] > 0:
                continue
            for d in range(4):
                if room[k, d] > 0 and came[k + step[d]] == -2:
                    came[k + step[d]], queue[tail] = d, k + step[d]
                    tail += 1
        for end in queue[:tail]:
            if outward[end] == 0:
                continue
            flow, k = outward[end], end
            while came[k] >= 0:
                d = came[k]
                k -= step[d]
                flow = min(flow, room[k, d])
            flow = min(flow, inward[k])
            if flow == 0:  # an earlier path filled a part of this one
                continue
            filled = True
            inward[k] -= flow
            outward[end] -= flow
            k = end
            while came[k] >= 0:
                d = came[k]
                room[k, d ^ 1] += flow
                k -= step[d]
                room[k, d] -= flow
    for k in range(count):
        laid[k // wide, k % wide] = came[k] == -2


@kernel
def outline(stones, place, standing, never, steps, cell, laid):
    """Choose the cells of a group to lay, by the least cut, and return the mean step along its
    outline, metres per pixel; 0 without an outline. ``steps`` come from `edge_steps`; fills
    ``laid``."""
    top, left, tall, wide = place
    costs, rims = np.zeros((tall, wide, 2)), np.zeros((tall, wide))
    touching = np.zeros((tall, wide), np.int64)
    for i in range(tall):
        for j in range(wide):
            if i + 1 < tall:
                costs[i, j, 0] = between(steps, standing, i, j, i + 1, j, 1)
            if j + 1 < wide:
                costs[i, j, 1] = between(steps, standing, i, j, i, j + 1, 3)
            for d in range(4):  # the place's rim, where cells beyond are not bare
                p, q = i + (d == 1) - (d == 0), j + (d == 3) - (d == 2)
                if 0 <= p < tall and 0 <= q < wide:
                    continue
                p, q = top + p, left + q
                if 0 <= p < stones.shape[0] and 0 <= q < stones.shape[1] and stones[p, q] >= 0:
                    rims[i, j] += steps[i, j, d]
                    touching[i, j] += 1
    least_cut(costs, rims, ~standing, never, laid)
    total, edges = 0.0, 0
    for i in range(tall):
        for j in range(wide):
            if i + 1 < tall and laid[i, j] != laid[i + 1, j]:
                total += costs[i, j, 0]
                edges += 1
            if j + 1 < wide and laid[i, j] != laid[i, j + 1]:
                total += costs[i, j, 1]
                edges += 1
            if laid[i, j]:
                total += rims[i, j]
                edges += touching[i, j]
    return total / (edges * cell) if edges else 0.0


# -- windows that must not repeat -------------------------------------------------------------


@kernel
def window_keys(values, side):
    """Compute the key of every side × side window of float32 ``values``, 0 where a pixel is −1.
    Equal windows have equal keys; unequal ones agree once in 2⁶⁴."""
    high, wide = values.shape
    rows, columns = high - side + 1, wide - side + 1
    keys = np.zeros((max(rows, 0), max(columns, 0)), np.uint64)
    if rows < 1 or columns < 1:
        return keys
    far_row, far_column = np.uint64(1), np.uint64(1)
    for _ in range(side):
        far_row, far_column = far_row * _ROW, far_column * _COLUMN
    bits = values.view(np.uint32)
    lines, bare = np.zeros((high, columns), np.uint64), np.zeros((high, columns), np.int64)
    for y in range(high):
        rolled, empty = np.uint64(0), 0
        for x in range(wide):
            rolled = rolled * _COLUMN + mixed(bits[y, x])
            empty += values[y, x] < 0
            if x >= side:
                rolled -= far_column * mixed(bits[y, x - side])
                empty -= values[y, x - side] < 0
            if x >= side - 1:
                lines[y, x - side + 1], bare[y, x - side + 1] = rolled, empty
    for x in range(columns):
        rolled, empty = np.uint64(0), 0
        for y in range(high):
            rolled = rolled * _ROW + lines[y, x]
            empty += bare[y, x]
            if y >= side:
                rolled -= far_row * lines[y - side, x]
                empty -= bare[y - side, x]
            if y >= side - 1 and empty == 0:
                keys[y - side + 1, x] = max(rolled, np.uint64(1))
    return keys


@kernel
def mixed(bits):
    """Spread 32 bits to 64 that look random."""
    value = (np.uint64(bits) + _ROW) * _MIX
    value = (value ^ (value >> _HALF)) * _COLUMN
    return value ^ (value >> _LESS)


@kernel
def slot_of(keys, key):
    """Find the slot of ``key`` in the table, or its free slot."""
    mask = keys.size - 1
    slot = np.int64(key >> np.uint64(20)) & mask
    while keys[slot] != 0 and keys[slot] != key:
        slot = (slot + 1) & mask
    return slot


@kernel
def remember(keys, anchors, key, anchor):
    """Note the window of ``key`` at ``anchor``; returns 1 if the table grew."""
    slot = slot_of(keys, key)
    new = keys[slot] == 0
    if new or anchors[slot] == GONE:
        keys[slot], anchors[slot] = key, anchor
    elif anchors[slot] != anchor:
        anchors[slot] = MANY
    return int(new)


@kernel
def remember_all(keys, anchors, found, top, left, apart, across):
    """Note the windows ``found``, `window_keys` from pixel (top, left) on, at the anchors: pixels
    whose row and column are multiples of ``apart``, ``across`` in a row of the fabric. Returns the
    number of new entries."""
    grown = 0
    for y in range(-top % apart, found.shape[0], apart):
        for x in range(-left % apart, found.shape[1], apart):
            if found[y, x]:
                anchor = (top + y) // apart * across + (left + x) // apart
                grown += remember(keys, anchors, found[y, x], anchor)
    return grown


@kernel
def forget(keys, anchors, found, now, top, left, apart, across):
    """Forget the windows ``found`` at anchors where another stands ``now``."""
    for y in range(-top % apart, found.shape[0], apart):
        for x in range(-left % apart, found.shape[1], apart):
            if found[y, x] and found[y, x] != now[y, x]:
                slot = slot_of(keys, found[y, x])
                if anchors[slot] == (top + y) // apart * across + (left + x) // apart:
                    anchors[slot] = GONE


@kernel
def rehashed(keys, anchors, size):
    """Rebuild the table with ``size`` slots, a power of two, without forgotten entries; returns
    also the number of entries."""
    larger, places = np.zeros(size, np.uint64), np.full(size, FREE, anchors.dtype)
    kept = 0
    for old in range(keys.size):
        if keys[old] != 0 and anchors[old] != GONE:
            slot = slot_of(larger, keys[old])
            larger[slot], places[slot] = keys[old], anchors[old]
            kept += 1
    return larger, places, kept


@kernel
def stands_elsewhere(keys, anchors, key, anchor):
    """Tell whether the table has the window of ``key`` at another anchor than ``anchor``."""
    slot = slot_of(keys, key)
    return keys[slot] != 0 and anchors[slot] != GONE and anchors[slot] != anchor


@kernel
def is_among(some, key):
    """Tell whether ``key`` is among the sorted keys ``some``."""
    at = np.searchsorted(some, key)
    return at < some.size and some[at] == key


@kernel
def comes_twice(keys, anchors, found, exempt, side, top, left, apart, across, box):
    """Tell whether any of the windows ``found`` that touch ``box`` (top, left, bottom, right,
    pixels) repeats, in the table or among themselves, and is not among the sorted keys ``exempt``.
    ``found`` are `window_keys` of that ``side`` from pixel (top, left) on, with the candidate
    laid."""
    count = np.count_nonzero(found[-top % apart :: apart, -left % apart :: apart])
    if count == 0:
        return False
    size = 64
    while size < 4 * count:
        size *= 2
    near_keys, near_anchors = np.zeros(size, np.uint64), np.full(size, FREE, np.int64)
    remember_all(near_keys, near_anchors, found, top, left, apart, across)
    for y in range(max(box[0] - top - side + 1, 0), min(box[2] - top, found.shape[0])):
        for x in range(max(box[1] - left - side + 1, 0), min(box[3] - left, found.shape[1])):
            if found[y, x] == 0:
                continue
            own = -9
            if (top + y) % apart == 0 and (left + x) % apart == 0:
                own = (top + y) // apart * across + (left + x) // apart
            if (
                stands_elsewhere(keys, anchors, found[y, x], own)
                or stands_elsewhere(near_keys, near_anchors, found[y, x], own)
            ) and not is_among(exempt, found[y, x]):
                return True
    return False


@kernel
def common_windows(values, found, common, allowed):
    """Compute `window_keys` of side `WINDOW` of ``values``, 0 for ``allowed`` windows and for those
    without a ``common`` window of side `ANCHORED`; ``found`` are the keys of all of that side."""
    if common.size == 0:
        return np.zeros((0, 0), np.uint64)
    rows, columns = max(found.shape[0] - APART + 1, 0), max(found.shape[1] - APART + 1, 0)
    holds, some = np.zeros((rows, columns), np.bool_), False
    for y in range(found.shape[0]):
        for x in range(found.shape[1]):
            if found[y, x] and is_among(common, found[y, x]):
                holds[max(0, y - APART + 1) : y + 1, max(0, x - APART + 1) : x + 1] = True
                some = True
    if not some:
        return np.zeros((rows, columns), np.uint64)
    keys = window_keys(values, WINDOW)
    for y in range(rows):
        for x in range(columns):
            if keys[y, x] and not (holds[y, x] and not is_among(allowed, keys[y, x])):
                keys[y, x] = 0
    return keys


# -- laying -----------------------------------------------------------------------------------


@kernel
def lay_groups(
    stones, original, brought, sides, lays, isos, cell, places, owners, draws, tolerance, kept,
    uses, surplus, common, allowed, coarse, fine, corner, steps, twice,
):  # fmt: skip
    """Lay one group at each place (top, left, tall, wide, in cells), in this order, from candidates
    that ``draws`` (places, n) decode (`candidate`) in the original of ``owners`` (places,).

    original : (top, left, bottom, right), cells that stay; they may lie outside.
    kept : candidates whose outlines are cut in one go, the best by their overlap first.
    uses, surplus : uses of each cell of the originals, and excess of its built share over its
        original's. Laying keeps the sum of the surplus over ``stones`` small.
    common, allowed : sorted keys of the windows that the originals repeat, of side `ANCHORED` and
        of side `WINDOW`.
    coarse, fine : keys and anchors of the windows of side `ANCHORED` at every `APART` pixels, and
        of those of side `WINDOW` with a common one, at every pixel. They must have room.
    corner : (row, column) of the north-west pixel of ``stones``, multiples of `APART`.
    steps, twice : become the mean step along each outline, NaN where nothing was bare; and whether
        the group repeats a window.

    Only allowed windows repeat: of two other equal windows, the first contains a window of side
    `ANCHORED` at an anchor. ``stones``, ``uses`` and the tables change in place. Returns the
    numbers of new entries of the tables.
    """
    grown, fine_grown = 0, 0
    owed = 0.0
    for stone in stones.flat:
        if stone >= 0:
            owed += surplus[stone >> 3]
    for n in range(places.shape[0]):
        top, left, tall, wide = places[n]
        standing = stones[top : top + tall, left : left + wide] >= 0
        steps[n], twice[n] = np.nan, False
        if standing.all():
            continue
        never = np.zeros((tall, wide), np.bool_)
        never[
            max(original[0] - top, 0) : max(original[2] - top, 0),
            max(original[1] - left, 0) : max(original[3] - left, 0),
        ] = True
        stand = np.empty((tall * cell, wide * cell), np.float32)
        fabric_window(stones, brought, sides, lays, cell, top * cell, left * cell, stand)

        one = owners[n]
        order = by_overlap(
            stones, places[n], stand, standing, brought, one, draws[n], isos, cell, sides, lays
        )
        # the surroundings: windows that touch the place reach so far
        box = (top * cell, left * cell, (top + tall) * cell, (left + wide) * cell)
        y0, x0 = max(box[0] - WINDOW + 1, 0), max(box[1] - WINDOW + 1, 0)
        y1 = min(box[2] + WINDOW - 1, stones.shape[0] * cell)
        x1 = min(box[3] + WINDOW - 1, stones.shape[1] * cell)
        around = np.empty((y1 - y0, x1 - x0), np.float32)
        fabric_window(stones, brought, sides, lays, cell, y0, x0, around)
        inner = around[box[0] - y0 : box[2] - y0, box[1] - x0 : box[3] - x0]
        before = window_keys(around, ANCHORED)
        fine_before = common_windows(around, before, common, allowed)
        now, fine_now = before, fine_before
        y0, x0 = y0 + corner[0], x0 + corner[1]
        box = (box[0] + corner[0], box[1] + corner[1], box[2] + corner[0], box[3] + corner[1])

        count = sides[one, 0] * sides[one, 1]
        mean_use = uses[sides[one, 2] : sides[one, 2] + count].sum() / count
        cuts = np.zeros((order.size, tall, wide), np.bool_)
        outlines, scores = np.empty(order.size), np.empty(order.size)
        changes = np.empty(order.size)
        found, tried, unseamed = -1, 0, False
        while found < 0:
            if tried < order.size:  # the next few, the best of the admissible first
                first, last = tried, min(tried + kept, order.size)
                for c in range(first, last):
                    chosen = candidate(draws[n, order[c]], one, isos, tall, wide, sides, lays)
                    at = strides(chosen, tall, wide, cell, sides, lays)
                    at_edges = edge_steps(stand, standing, brought, at, cell)
                    outlines[c] = outline(
                        stones, places[n], standing, never, at_edges, cell, cuts[c]
                    )
                    use, changes[c] = laid_use(
                        stones, places[n], uses, surplus, cuts[c], chosen, sides, lays
                    )
                    uneven = use / mean_use / 6 + abs(owed + changes[c]) / (2 * cuts[c].sum())
                    scores[c] = outlines[c] + tolerance * uneven
                    if outlines[c] > tolerance:
                        scores[c] = np.inf
                trial = first + np.argsort(scores[first:last], kind="mergesort")
                tried = last
            elif not unseamed:  # no admissible candidate may be laid: the least step that may
                trial = np.argsort(outlines, kind="mergesort")
                scores[:], unseamed = outlines, True
            else:  # every candidate repeats a window
                found, twice[n] = np.argmin(outlines), True
                trial = np.full(1, found)
            for c in trial:
                if scores[c] == np.inf:
                    break
                chosen = candidate(draws[n, order[c]], one, isos, tall, wide, sides, lays)
                at = strides(chosen, tall, wide, cell, sides, lays)
                lay_pixels(inner, stand, cuts[c], brought, at, cell)
                now = window_keys(around, ANCHORED)
                fine_now = common_windows(around, now, common, allowed)
                if twice[n] or not (
                    comes_twice(*coarse, now, common, ANCHORED, y0, x0, APART, ACROSS, box)
                    or comes_twice(*fine, fine_now, allowed, WINDOW, y0, x0, 1, ACROSS, box)
                ):
                    found = c
                    break
        chosen = candidate(draws[n, order[found]], one, isos, tall, wide, sides, lays)
        owed += changes[found]
        lay_stones(stones, uses, top, left, cuts[found], chosen, sides, lays)
        forget(*coarse, before, now, y0, x0, APART, ACROSS)
        forget(*fine, fine_before, fine_now, y0, x0, 1, ACROSS)
        grown += remember_all(*coarse, now, y0, x0, APART, ACROSS)
        fine_grown += remember_all(*fine, fine_now, y0, x0, 1, ACROSS)
        steps[n] = outlines[found]
    return grown, fine_grown


@kernel
def by_overlap(stones, place, stand, standing, brought, one, draws, isos, cell, sides, lays):
    """Sort the candidates (indices) by their total difference to the standing cells. Those akin to
    a stone of the place come after the others, those that continue its source last."""
    tall, wide = place[2:]
    costs, least = np.empty(draws.size), np.inf
    for k in range(draws.size):
        chosen = candidate(draws[k], one, isos, tall, wide, sides, lays)
        kin = kinship(stones, place, chosen, sides, lays)
        at = strides(chosen, tall, wide, cell, sides, lays)
        costs[k] = overlap_cost(stand, standing, brought, at, cell, 2 * least)
        if kin:
            costs[k] += kin * _AKIN
        else:
            least = min(least, costs[k])
    return np.argsort(costs, kind="mergesort")


@kernel
def kinship(stones, place, chosen, sides, lays):
    """Return 2 if a candidate continues the source of a stone of the place, with the same stone at
    its place; 1 if it brings a stone of the place mirrored or moved; else 0."""
    top, left, tall, wide = place
    first, down, along = strides(chosen, tall, wide, 1, sides, lays)
    one, iso, row, column = chosen
    deep, broad = (wide, tall) if lays[iso, 2] == 0 else (tall, wide)
    start, columns = sides[one, 2], sides[one, 1]
    end = start + sides[one, 0] * columns
    kin = 0
    for i in range(tall):
        for j in range(wide):
            stone = stones[top + i, left + j]
            if stone < 0:
                continue
            if stone == 8 * (first + i * down + j * along) + iso:
                return 2
            index = stone >> 3
            if start <= index < end:
                y, x = (index - start) // columns - row, (index - start) % columns - column
                if 0 <= y < deep and 0 <= x < broad:
                    kin = 1
    return kin


@kernel
def laid_use(stones, place, uses, surplus, laid, chosen, sides, lays):
    """Compute the mean number of uses of the cells that a candidate would lay; and the change of
    the sum of ``surplus``."""
    first, down, along = strides(chosen, laid.shape[0], laid.shape[1], 1, sides, lays)
    total, count, change = 0, 0, 0.0
    for i in range(laid.shape[0]):
        for j in range(laid.shape[1]):
            if laid[i, j]:
                index = first + i * down + j * along
                total += uses[index]
                count += 1
                change += surplus[index]
                stone = stones[place[0] + i, place[1] + j]
                if stone >= 0:
                    change -= surplus[stone >> 3]
    return total / count, change


@kernel
def lay_pixels(target, stand, laid, brought, at, cell):
    """target = ``brought`` where ``laid``, else ``stand``."""
    first, down, along = at
    for y in range(target.shape[0]):
        for x in range(target.shape[1]):
            if laid[y // cell, x // cell]:
                target[y, x] = brought[first + y * down + x * along]
            else:
                target[y, x] = stand[y, x]


@kernel
def lay_stones(stones, uses, top, left, laid, chosen, sides, lays):
    """Lay a candidate's cells, and count them."""
    first, down, along = strides(chosen, laid.shape[0], laid.shape[1], 1, sides, lays)
    for i in range(laid.shape[0]):
        for j in range(laid.shape[1]):
            if laid[i, j]:
                index = first + i * down + j * along
                if stones[top + i, left + j] >= 0:
                    uses[stones[top + i, left + j] >> 3] -= 1
                uses[index] += 1
                stones[top + i, left + j] = 8 * index + chosen[1]
