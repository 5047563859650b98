"""Compiled loops of street blocks. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel
from evocity.accelerate.vectors import WIDTH, vector_code

#: Distance of compared places along each axis, cells; then all places around the best compete.
STEP = 2
#: Spare items after the sums of each row.
SPARE = WIDTH


@kernel
def best_fit(
    sums, components, covered, stale, block, weights, density, least, spread, draws, affine, taken
):
    """Find the best place of a donor for a street block, without components partly outside:
    isometry (-1 if nothing fits), top, left and score.

    sums : result of `row_sums`, with at least `SPARE` items after each row.
    components, covered, stale : as in `StreetBlocks` and `row_sums`.
    block, weights, density : as in `Room`.
    least : the least number of built cells, without components partly outside.
    spread : places are drawn whose score is within this of the isometry's best.
    draws : float64 ``(8, k)``, 0…1: k draws of such places under each isometry.
    affine : `evocity.isometries.AFFINE`.
    taken : int64 ``(4,)``, top, left, bottom, right: places that overlap this are illegal.
    """
    rows, columns = components.shape
    counts = np.zeros(covered.size, np.int64)
    found, top, left, most = -1, 0, 0, np.float32(-np.inf)
    for iso in range(8):
        turned, worth = _turned(block, weights, affine[iso])
        size = turned.shape
        tops, lefts = rows - size[0] + 1, columns - size[1] + 1
        if tops < 1 or lefts < 1:
            continue
        runs = _runs(turned, worth)
        scores = _scores(sums, runs, density, (tops - 1) // STEP + 1, (lefts - 1) // STEP + 1)
        _forbid(scores, taken, size)
        best = scores.max()
        if best == -np.inf:
            continue
        among = np.flatnonzero(scores >= best - np.float32(spread))
        last = -1
        for draw in np.sort(draws[iso]):
            k = among[int(draw * among.size)]
            if k == last:
                continue
            last = k
            y, x = STEP * (k // scores.shape[1]), STEP * (k % scores.shape[1])
            y, x = _refined(sums, runs, density, tops, lefts, size, y, x, taken)
            score = _whole(
                components, covered, stale, counts, turned, worth, density, least, y, x, runs[2]
            )
            if score > most:
                found, top, left, most = iso, y, x, score
    return found, top, left, most


@kernel
def block_bounds(labels, bounds):
    """bounds[k] = top, left, bottom, right of the cells with the label k, int64 ``(n, 4)``; the
    last two exclusive, 0 without cells."""
    bounds[:, :2] = labels.size
    bounds[:, 2:] = 0
    for i in range(labels.shape[0]):
        for j in range(labels.shape[1]):
            one = bounds[labels[i, j]]
            one[0], one[1] = min(one[0], i), min(one[1], j)
            one[2], one[3] = max(one[2], i + 1), max(one[3], j + 1)


@kernel
def _add_where(kind, bit, worth, weights):
    """Add ``worth`` in all to the ``weights`` of the cells whose ``kind`` has a ``bit``."""
    count = 0
    for i in range(kind.shape[0]):
        for j in range(kind.shape[1]):
            count += (kind[i, j] & bit) != 0
    each = np.float32(worth / max(count, 1))
    for i in range(kind.shape[0]):
        for j in range(kind.shape[1]):
            if kind[i, j] & bit:
                weights[i, j] += each


@kernel
def weigh_block(labels, built, number, top, left, facades, block, weights):
    """Find the cells of the street block ``number``, bool ``block`` ``(r, c)`` from (top, left) on,
    and their ``weights``, float32 ``(r, c)``, see `evocity.operators.street_blocks.Room`. Returns
    the share of its cells that is ``built``."""
    tall, wide = block.shape
    rows, columns = labels.shape
    inside, outline, own, street, facing = 1, 2, 4, 8, 16
    kind = np.zeros((tall, wide), np.uint8)
    stack, size = np.empty((tall * wide, 2), np.int64), 0
    cells = standing = 0
    for i in range(tall):
        for j in range(wide):
            y, x = top + i, left + j
            block[i, j] = labels[y, x] == number
            weights[i, j] = 0
            if not block[i, j]:
                continue
            cells += 1
            edge = y > 0 and labels[y - 1, x] != number
            edge |= y < rows - 1 and labels[y + 1, x] != number
            edge |= x > 0 and labels[y, x - 1] != number
            edge |= x < columns - 1 and labels[y, x + 1] != number
            kind[i, j] = inside + outline * edge + own * built[y, x]
            standing += built[y, x]
            if edge and not built[y, x]:
                kind[i, j] |= street
                stack[size, 0], stack[size, 1] = i, j
                size += 1
    _add_where(kind, inside, 1.0, weights)
    _add_where(kind, outline, -2.0, weights)
    if facades != 0:
        while size > 0:  # the street reaches all open cells with a way to the outline
            size -= 1
            i, j = stack[size, 0], stack[size, 1]
            for down, along in ((-1, 0), (1, 0), (0, -1), (0, 1)):
                y, x = i + down, j + along
                if not (0 <= y < tall and 0 <= x < wide and kind[y, x] & inside):
                    continue
                if kind[y, x] & own:
                    kind[y, x] |= facing
                elif not kind[y, x] & street:
                    kind[y, x] |= street
                    stack[size, 0], stack[size, 1] = y, x
                    size += 1
        _add_where(kind, facing, facades, weights)
        _add_where(kind, street, -facades, weights)
    return standing / cells


@kernel
def stones_of_cells(index, top, left, side, turn, city, source_y, source_x, affine, cell, found):
    """Find the origin of each cell of a map: a square of a source city.

    index, top, left, side : the range block at each pixel, and its place, px.
    turn, city, source_y, source_x : isometry of a lifs' origin, number of its city, -1 for the
        void, and the origin's north-west corner there, px.
    affine, cell : `evocity.isometries.AFFINE`, and the side of cells, px.
    found : int32 ``(3, R, C)``, becomes city, row and column of each, in cells.
    """
    for i in range(found.shape[1]):
        for j in range(found.shape[2]):
            k = index[i * cell, j * cell]
            a, last = affine[turn[k]], side[k] - 1
            down, along = i * cell - top[k], j * cell - left[k]
            # place of the cell's first pixel in the source, and the distance to its last
            y = source_y[k] + a[0] * last + a[2] * down + a[4] * along
            x = source_x[k] + a[1] * last + a[3] * down + a[5] * along
            y += min((a[2] + a[4]) * (cell - 1), 0)
            x += min((a[3] + a[5]) * (cell - 1), 0)
            found[0, i, j], found[1, i, j], found[2, i, j] = city[k], y // cell, x // cell


@kernel
def stale_cells(built, stones, counts, worth, stale):
    """Compute the discount of ``built`` cells of a donor, bool ``(R, C)``: float32 ``stale``
    becomes ``worth`` where the cell's origin, its number in int64 ``stones``, 0 for none, has a
    positive number in ``counts``; 0 elsewhere."""
    for i in range(built.shape[0]):
        for j in range(built.shape[1]):
            stone = stones[i, j]
            stands = built[i, j] and stone > 0 and counts[stone] > 0
            stale[i, j] = worth if stands else np.float32(0)


@kernel
def row_sums(built, stale, sums):
    """Sum the ``built`` cells (bool ``(R, C)``) of each row, less ``stale``, left of each border:
    float32 ``sums (2, R, n)``, zeros before, of the even borders, then of the odd ones."""
    for i in range(built.shape[0]):
        total = np.float32(0)
        for j in range(built.shape[1]):
            if built[i, j]:
                total += np.float32(1) - stale[i, j]
            sums[(j + 1) & 1, i, (j + 1) >> 1] = total


@kernel
def lay_cells(heights, whose, row, column, iso, affine, cell, laid):
    """Lay cells of ``cell`` px of several maps, float32 ``heights`` ``(n, H, W)``, into ``laid``.

    Each cell of ``laid`` shows a cell at ``row`` and ``column`` of the map ``whose``, n for bare
    ground, under an isometry ``iso``; ``affine`` is `evocity.isometries.AFFINE`.
    """
    last = cell - 1
    for i in range(whose.shape[0]):
        for j in range(whose.shape[1]):
            top, left, one = i * cell, j * cell, whose[i, j]
            if one == heights.shape[0]:
                laid[top : top + cell, left : left + cell] = 0
                continue
            a, y, x = affine[iso[i, j]], row[i, j] * cell, column[i, j] * cell
            for u in range(cell):
                for v in range(cell):
                    laid[top + u, left + v] = heights[
                        one, y + a[0] * last + a[2] * u + a[4] * v,
                        x + a[1] * last + a[3] * u + a[5] * v,
                    ]  # fmt: skip


@kernel
def _turned(block, weights, a):
    """Turn a block and its weights to the donor's frame, by the isometry of affine row ``a``."""
    tall, wide = block.shape
    size = (tall, wide) if a[2] != 0 else (wide, tall)
    turned, worth = np.empty(size, np.bool_), np.empty(size, np.float32)
    for i in range(tall):
        for j in range(wide):
            y = a[0] * (size[0] - 1) + a[2] * i + a[4] * j
            x = a[1] * (size[1] - 1) + a[3] * i + a[5] * j
            turned[y, x], worth[y, x] = block[i, j], weights[i, j]
    return turned, worth


@kernel
def _runs(block, weights):
    """List runs of cells of equal weight within the rows of a block: int32 ``(3, n)``, their rows,
    begins and ends; their weights; and the number of the block's cells."""
    tall, wide = block.shape
    where, worth = np.empty((3, tall * wide), np.int32), np.empty(tall * wide, np.float32)
    count, area = 0, 0
    for i in range(tall):
        j = 0
        while j < wide:
            if not block[i, j]:
                j += 1
                continue
            first = j
            while j < wide and block[i, j] and weights[i, j] == weights[i, first]:
                j += 1
            where[0, count], where[1, count], where[2, count] = i, first, j
            worth[count] = weights[i, first]
            count += 1
            area += j - first
    return where[:, :count], worth[:count].copy(), area


@vector_code("none", 1)
def _add_runs(v, abreast, sums, start, before, after, worth, built, value):
    """Sum, for ``abreast`` vectors of adjacent places from item ``start`` on, the built cells and
    their scores. The compiler knows ``abreast``."""
    totals, gains = ([v.variable(v.zero) for _ in range(abreast)] for _ in range(2))
    with v.loop(worth.shape[0]) as k:
        first, last = (
            v.after(sums.start, v.plus(v.whole(end.at(k)), start)) for end in (before, after)
        )
        weight = v.spread(worth.at(k))
        for g, (total, gain) in enumerate(zip(totals, gains, strict=True)):
            ends = [v.load(v.after(one, g * WIDTH)) for one in (first, last)]
            found = v.sub(ends[1], ends[0])
            v.builder.store(v.add(v.builder.load(total), found), total)
            product = v.mul(weight, found)  # rounded alike on any machine
            v.builder.store(v.add(v.builder.load(gain), product), gain)
    for g in range(abreast):
        v.store(v.builder.load(totals[g]), v.after(built.start, g * WIDTH))
        v.store(v.builder.load(gains[g]), v.after(value.start, g * WIDTH))


@kernel
def _scores(sums, runs, density, tops, lefts):
    """Compute the score of each `STEP`th place: the weights of its built cells, less half the
    difference of the built share to the ``density``; float32 ``(tops, lefts)``."""
    where, worth, area = runs
    _, rows, borders = sums.shape
    # places of the sums of both ends, of the block at the first place
    before = ((where[1] % 2 * rows + where[0]) * borders + where[1] // 2).astype(np.int32)
    after = ((where[2] % 2 * rows + where[0]) * borders + where[2] // 2).astype(np.int32)
    built, value = np.empty(4 * WIDTH, np.float32), np.empty(4 * WIDTH, np.float32)
    scores = np.empty((tops, lefts), np.float32)
    share, half, wanted = np.float32(1 / max(area, 1)), np.float32(0.5), np.float32(density)
    for top in range(tops):
        left = 0
        while left < lefts:
            start = STEP * top * borders + left
            if lefts - left > 3 * WIDTH:  # sums of many places do not wait for each other
                _add_runs(4, sums, start, before, after, worth, built, value)
                many = min(4 * WIDTH, lefts - left)
            elif lefts - left > WIDTH:
                _add_runs(2, sums, start, before, after, worth, built, value)
                many = min(2 * WIDTH, lefts - left)
            else:
                _add_runs(1, sums, start, before, after, worth, built, value)
                many = lefts - left
            for lane in range(many):
                apart = abs(built[lane] * share - wanted)
                scores[top, left + lane] = value[lane] - half * apart
            left += many
    return scores


@kernel
def _overlaps(top, left, size, taken):
    before = top < taken[2] and left < taken[3]
    return before and top + size[0] > taken[0] and left + size[1] > taken[1]


@kernel
def _forbid(scores, taken, size):
    """Give places that overlap ``taken`` the worst score."""
    if taken[0] == taken[2]:
        return
    for y in range(scores.shape[0]):
        for x in range(scores.shape[1]):
            if _overlaps(STEP * y, STEP * x, size, taken):
                scores[y, x] = -np.inf


@kernel
def _refined(sums, runs, density, tops, lefts, size, top, left, taken):
    """Find the best place less than `STEP` cells from a place; of equals the first."""
    where, worth, area = runs
    best, found_y, found_x = np.float32(-np.inf), top, left
    for y in range(max(top - STEP + 1, 0), min(top + STEP, tops)):
        for x in range(max(left - STEP + 1, 0), min(left + STEP, lefts)):
            if _overlaps(y, x, size, taken):
                continue
            built, score = np.float32(0), np.float32(0)
            for k in range(worth.size):
                row, start, stop = y + where[0, k], x + where[1, k], x + where[2, k]
                found = sums[stop & 1, row, stop >> 1] - sums[start & 1, row, start >> 1]
                built += found
                score += worth[k] * found
            score -= np.float32(abs(built / max(area, 1) - density) / 2)
            if score > best:
                best, found_y, found_x = score, y, x
    return found_y, found_x


@kernel
def _whole(components, covered, stale, counts, block, weights, density, least, top, left, area):
    """Compute the score of a place without components partly outside; -inf if less than ``least``
    remains. ``counts`` are 0 before and after."""
    tall, wide = block.shape
    for i in range(tall):
        for j in range(wide):
            if block[i, j]:
                counts[components[top + i, left + j]] += 1
    counts[0] = 0  # ground
    built, score, share = 0, np.float32(0), np.float32(1 / area)
    for i in range(tall):
        for j in range(wide):
            number = components[top + i, left + j]
            if block[i, j] and number > 0 and counts[number] == covered[number]:
                built += 1
                score += weights[i, j] - stale[top + i, left + j] * share
    for i in range(tall):
        for j in range(wide):
            counts[components[top + i, left + j]] = 0
    if built < max(least, 1):
        return np.float32(-np.inf)
    return score - np.float32(abs(built / area - density) / 2)


@kernel
def _source(a, size, i, j):
    """Find the place in a window of ``size`` that cell (i, j) shows of it, by the isometry of
    affine row ``a``."""
    return (
        a[0] * (size[0] - 1) + a[2] * i + a[4] * j,
        a[1] * (size[1] - 1) + a[3] * i + a[5] * j,
    )


@kernel
def whole_cells(components, covered, block, a, top, left, kept):
    """Mark in ``kept`` (r, c) the cells of a ``block`` that show a donor's component of which no
    cell lies outside the block. The donor's window at (top, left) turns by affine row ``a``."""
    tall, wide = block.shape
    size = (tall, wide) if a[2] != 0 else (wide, tall)
    counts = np.zeros(covered.size, np.int64)
    for i in range(tall):
        for j in range(wide):
            if block[i, j]:
                y, x = _source(a, size, i, j)
                counts[components[top + y, left + x]] += 1
    for i in range(tall):
        for j in range(wide):
            y, x = _source(a, size, i, j)
            n = components[top + y, left + x]
            kept[i, j] = block[i, j] and n > 0 and counts[n] == covered[n]


@kernel
def lay_fit(
    block, ring, kept, down, along, donor, iso, top, left, affine, built, before, after,
    counts, owner, isos, sources, bare,
):  # fmt: skip
    """Lay a donor's window at (top, left), turned by ``iso``, in a room at (down, along): its cells
    ``kept`` in the ``block``, and bare ground in the ``ring`` and where ``built`` cells are
    omitted. ``before`` and ``after`` (R, C) are the origins of the present map's and the donor's
    cells, ``counts`` the number of each on the map. Changes the last five, see `Filling`."""
    a = affine[iso]
    size = block.shape if a[2] != 0 else (block.shape[1], block.shape[0])
    for i in range(block.shape[0]):
        for j in range(block.shape[1]):
            v, u = down + i, along + j
            if not (block[i, j] or ring[i, j]):
                continue
            counts[before[v, u]] -= 1
            owner[v, u] = donor
            if ring[i, j]:
                bare[v, u] = True
                continue
            y, x = _source(a, size, i, j)
            y, x = top + y, left + x
            sources[0, v, u], sources[1, v, u], isos[v, u] = y, x, iso
            if kept[i, j]:
                counts[after[y, x]] += 1
            elif built[y, x]:
                bare[v, u] = True
