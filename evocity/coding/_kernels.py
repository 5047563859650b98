"""Compiled loops of coding: arrays in, arrays out. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def box_means(heights, tall, wide, means):
    """means[y, x] = mean of heights[y : y + tall, x : x + wide], wherever that fits."""
    rows, columns = heights.shape
    scale = heights.dtype.type(1.0 / (tall * wide))
    sums = np.empty(columns, heights.dtype)
    fits = columns - wide + 1
    for y in range(rows - tall + 1):
        line = means[y]
        if tall == 2 and wide == 2:  # by far the most frequent, in one go
            upper, lower = heights[y], heights[y + 1]
            for x in range(fits):
                line[x] = ((upper[x] + lower[x]) + (upper[x + 1] + lower[x + 1])) * scale
            continue
        for x in range(columns):
            sums[x] = heights[y, x]
        for i in range(1, tall):
            for x in range(columns):
                sums[x] += heights[y + i, x]
        for x in range(fits):
            line[x] = sums[x]
        for j in range(1, wide):
            for x in range(fits):
                line[x] += sums[x + j]
        for x in range(fits):
            line[x] *= scale


@kernel
def shared_extents(dy, dx, side, least, tall, wide, layer):
    """tall[i] and wide[i] get the extent of lifs i's domain block, in range blocks; layer[i] the
    number of that extent among those of at least ``least`` lifs, or -1, also without a domain
    block. Returns these extents, int64 ``(n, 2)``, in order."""
    most = np.int64(0)
    for i in range(side.size):
        tall[i], wide[i] = dy[i] // side[i], dx[i] // side[i]
        most = max(most, tall[i], wide[i])
    counts = np.zeros((most + 1, most + 1), np.int64)
    for i in range(side.size):
        counts[tall[i], wide[i]] += 1
    counts[0, 0] = 0
    kinds, number = np.empty((counts.size, 2), np.int64), 0
    for t in range(most + 1):
        for w in range(most + 1):
            shared = counts[t, w] >= least
            counts[t, w] = number if shared else -1
            if shared:
                kinds[number, 0], kinds[number, 1] = t, w
                number += 1
    for i in range(side.size):
        layer[i] = counts[tall[i], wide[i]]
    return kinds[:number]


@kernel
def walks(which, top, left, side, y, x, tall, wide, layer, iso, affine, rows, columns, walk):
    """walk[k], (m, 5), gets the sources of the range block's pixels of lifs which[k], in the stack
    of box-mean layers, maps of ``rows`` × ``columns``: the flat index of the range block's first
    pixel, its ``side``, the flat index in the layers of the first pixel's source, and the steps
    there for a row down and for a column on. A source pixel averages ``tall`` × ``wide`` pixels;
    ``affine`` is `isometries.AFFINE`."""
    for k in range(which.size):
        i = which[k]
        t = affine[iso[i]]
        one, two = np.int64(tall[i]) * columns, np.int64(wide[i])
        first = (np.int64(layer[i]) * rows + y[i]) * columns + x[i]
        walk[k, 0], walk[k, 1] = np.int64(top[i]) * columns + left[i], side[i]
        walk[k, 2] = first + (one * t[0] + two * t[1]) * (side[i] - 1)
        walk[k, 3], walk[k, 4] = one * t[2] + two * t[3], one * t[4] + two * t[5]


@kernel
def _lay_four(layers, place, east, slope, offset, target, at):
    one, two = layers[np.uintp(place)], layers[np.uintp(place + east)]
    three, four = layers[np.uintp(place + 2 * east)], layers[np.uintp(place + 3 * east)]
    target[np.uintp(at)] = slope * one + offset
    target[np.uintp(at + 1)] = slope * two + offset
    target[np.uintp(at + 2)] = slope * three + offset
    target[np.uintp(at + 3)] = slope * four + offset


@kernel
def lay_blocks(layers, walk, sigma, beta, columns, target):
    """Lay one step of the collage map W: the range blocks of ``walk`` (see `walks`) on the flat
    ``target``, a map of ``columns``, from the flat ``layers``. Range blocks of one side should
    follow each other, since branch misses cost as much as loops over few pixels."""
    for i in range(sigma.size):
        at, side, place, south, east = walk[i, 0], walk[i, 1], walk[i, 2], walk[i, 3], walk[i, 4]
        slope, offset = sigma[i], beta[i]
        if side == 2:
            one, two = layers[np.uintp(place)], layers[np.uintp(place + east)]
            place += south
            three, four = layers[np.uintp(place)], layers[np.uintp(place + east)]
            target[np.uintp(at)] = slope * one + offset
            target[np.uintp(at + 1)] = slope * two + offset
            target[np.uintp(at + columns)] = slope * three + offset
            target[np.uintp(at + columns + 1)] = slope * four + offset
        elif side == 4:
            for a in range(4):
                _lay_four(layers, place + south * a, east, slope, offset, target, at + columns * a)
        elif side % 4 == 0:
            for a in range(side):
                for b in range(0, side, 4):
                    start, line = place + south * a + east * b, at + columns * a + b
                    _lay_four(layers, start, east, slope, offset, target, line)
        else:
            for a in range(side):
                start, line = place + south * a, at + columns * a
                for b in range(side):
                    target[np.uintp(line + b)] = slope * layers[np.uintp(start + east * b)] + offset


@kernel
def gather_table(walk, columns, table):
    """table[p] = flat index, into the stack of box-mean layers, of the source of pixel p, see
    `walks`; pixels of lifs without a domain block stay. Maps are flat."""
    for i in range(walk.shape[0]):
        at, side, first, south, east = walk[i, 0], walk[i, 1], walk[i, 2], walk[i, 3], walk[i, 4]
        for a in range(side):
            for b in range(side):
                table[np.uintp(at + columns * a + b)] = first + south * a + east * b


@kernel
def moved(before, after, tolerance, sky):
    """Count the pixels that changed by more than ``tolerance``, and those by ``sky`` or more; NaN
    counts as both. (Whole numbers, as a maximum makes no vector code.)"""
    some, most = np.int32(0), np.int32(0)
    for p in range(after.size):
        change = abs(after[p] - before[p])
        some += np.int32(not change <= tolerance)
        most += np.int32(not change < sky)
    return some, most


@kernel
def lay_bare(bare, top, left, side, beta, target):
    """Lay the range blocks of the lifs ``bare``, which have no domain block, on ``target`` (H, W)
    at their heights ``beta``."""
    for k in range(bare.size):
        i = bare[k]
        for a in range(top[i], top[i] + side[i]):
            for b in range(left[i], left[i] + side[i]):
                target[a, b] = beta[i]


@kernel
def iterate(
    before, values, kinds, rare, layers, walk, slopes, offsets, bare, top, left, side, beta,
    covered, kept, tolerance, sky, most,
):  # fmt: skip
    """Apply the collage map W again and again, from ``values`` on, until no pixel moves by more
    than ``tolerance``, one moves by ``sky`` or more, or ``most`` steps are made.

    ``values`` and ``before`` are maps (H, W), both overwritten. kinds : extents of the ``layers``.
    rare : int32 ``(7, r)``, arguments of `shrink_blocks` for the last layer. walk, slopes, offsets
    : as of `lay_blocks`. bare, top, left, side, beta : as of `lay_bare`. covered, kept : flat
    numbers of pixels that keep the heights ``kept``.

    Returns the number of steps, whether the last one converged and whether it diverged. After an
    odd number of steps ``before`` has the last map.
    """
    columns, steps = values.shape[1], 0
    flat = layers.ravel()
    some, wild = np.int32(values.size), np.int32(0)
    while some > 0 and wild == 0 and steps < most:
        before, values = values, before
        for k in range(kinds.shape[0]):
            box_means(before, kinds[k, 0], kinds[k, 1], layers[k])
        if rare.shape[1] > 0:
            shrink_blocks(
                before, rare[0], rare[1], rare[2], rare[3], rare[4], rare[5], rare[6],
                layers[layers.shape[0] - 1],
            )  # fmt: skip
        if steps < 2:
            lay_bare(bare, top, left, side, beta, values)
        target = values.ravel()
        lay_blocks(flat, walk, slopes, offsets, columns, target)
        for k in range(covered.size):
            target[covered[k]] = kept[k]
        steps += 1
        some, wild = moved(before.ravel(), target, tolerance, sky)
    return steps, some == 0, wild > 0


@kernel
def order_walks(
    dy, dx, y, x, iso, side, top, left, least, rows, columns, affine,
    tall, wide, layer, which, bare, rare, walk,
):  # fmt: skip
    """Prepare W of n lifs without a zoom. tall, wide and layer : as of `shared_extents`, for at
    least ``least`` lifs; the layer after all these has the domain blocks of rare extents, which are
    the columns of ``rare``, int32 ``(7, n)`` (see `shrink_blocks`). which : the lifs with a domain
    block, range blocks of one side behind one another, with their ``walk`` (see `walks`); bare :
    the others. Returns the extents, and the numbers of rare ones and of lifs with a domain
    block."""
    kinds = shared_extents(dy, dx, side, least, tall, wide, layer)
    last, few, flat = kinds.shape[0], 0, 0
    coarsest = np.int64(0)
    for i in range(side.size):
        coarsest = max(coarsest, np.int64(side[i]))
    starts = np.zeros(coarsest + 2, np.int64)
    for i in range(side.size):
        if dx[i] == 0:
            bare[flat] = i
            flat += 1
        else:
            starts[side[i] + 1] += 1
    for s in range(coarsest + 1):
        starts[s + 1] += starts[s]
    count = starts[coarsest + 1]
    for i in range(side.size):
        if dx[i] == 0:
            continue
        k = starts[side[i]]
        starts[side[i]] += 1
        which[k] = i
        t, number, down, along = affine[iso[i]], np.int64(layer[i]), np.int64(y[i]), np.int64(x[i])
        one, two = np.int64(tall[i]) * columns, np.int64(wide[i])
        if number < 0:  # a rare extent: its domain block shrinks to the range block's place
            rare[0, few], rare[1, few], rare[2, few], rare[3, few] = top[i], left[i], down, along
            rare[4, few], rare[5, few], rare[6, few] = tall[i], wide[i], side[i]
            few += 1
            number, down, along = last, np.int64(top[i]), np.int64(left[i])
            one, two = np.int64(columns), np.int64(1)
        first = (number * rows + down) * columns + along
        walk[k, 0], walk[k, 1] = np.int64(top[i]) * columns + left[i], side[i]
        walk[k, 2] = first + (one * t[0] + two * t[1]) * (side[i] - 1)
        walk[k, 3], walk[k, 4] = one * t[2] + two * t[3], one * t[4] + two * t[5]
    return kinds, few, count


@kernel
def scatter(values, pixels, places, sigma, layers):
    """Apply the adjoint of `lay_blocks` without β: add the flat ``values`` at the ``pixels``,
    rising, times σ, to the ``places`` of their sources in the flat ``layers``, which are
    overwritten."""
    layers[:] = 0
    for k in range(pixels.size):
        layers[np.uintp(places[k])] += sigma[k] * values[np.uintp(pixels[k])]


@kernel
def spread_means(means, tall, wide, heights):
    """Apply the adjoint of `box_means`: heights[y : y + tall, x : x + wide] += means[y, x] / (tall
    · wide), wherever that fits."""
    rows, columns = heights.shape
    scale = heights.dtype.type(1.0 / (tall * wide))
    line = np.empty(columns, heights.dtype)
    fits = columns - wide + 1
    for y in range(rows - tall + 1):
        if wide == 2 and fits > 0:  # nearly always, and in one sweep
            line[0], line[fits] = means[y, 0], means[y, fits - 1]
            for x in range(1, fits):
                line[x] = means[y, x] + means[y, x - 1]
        else:
            line[:] = 0
            for j in range(wide):
                for x in range(fits):
                    line[x + j] += means[y, x]
        for x in range(columns):
            line[x] *= scale
        for i in range(tall):
            for x in range(columns):
                heights[y + i, x] += line[x]


@kernel
def shrink_blocks(heights, top, left, y, x, tall, wide, size, layer):
    """Lay each domain block at (y, x), shrunk to its range block's ``size`` by means of ``tall``
    × ``wide`` pixels, at the range block's place (top, left) in ``layer``."""
    for k in range(top.size):
        scale = heights.dtype.type(1.0 / (tall[k] * wide[k]))
        for i in range(size[k]):
            for j in range(size[k]):
                total = heights.dtype.type(0)
                for v in range(y[k] + i * tall[k], y[k] + (i + 1) * tall[k]):
                    for u in range(x[k] + j * wide[k], x[k] + (j + 1) * wide[k]):
                        total += heights[v, u]
                layer[top[k] + i, left[k] + j] = scale * total


@kernel
def spread_blocks(layer, top, left, y, x, tall, wide, size, heights):
    """Apply the adjoint of `shrink_blocks`: add to ``heights``."""
    for k in range(top.size):
        scale = heights.dtype.type(1.0 / (tall[k] * wide[k]))
        for i in range(size[k]):
            for j in range(size[k]):
                value = scale * layer[top[k] + i, left[k] + j]
                for v in range(y[k] + i * tall[k], y[k] + (i + 1) * tall[k]):
                    for u in range(x[k] + j * wide[k], x[k] + (j + 1) * wide[k]):
                        heights[v, u] += value


@kernel
def grow_outlines(
    heights, layers, layer_of, top, left, block, starts, multiple, y, x, iso, sigma, beta,
    turns, rings, alike, unseen, chosen,
):  # fmt: skip
    """chosen[i] = the candidate of starts[i] : starts[i + 1] with the neighbourhood closest to that
    of range block i; the first of equals, -1 without candidates. layers[layer_of[m]] holds the
    means of m × m pixels, ``turns`` (8, 2, 3) the source of a pixel under an isometry. Errors are
    equal within the share ``alike`` or ``unseen`` per pixel. See evocity.coding.topology."""
    rows, columns = heights.shape
    most = 0
    for i in range(top.size):
        most = max(most, starts[i + 1] - starts[i])
    standing, error = np.empty(most, np.int64), np.empty(most)
    longest = 4 * (block + 2 * rings)
    down, across = np.empty(longest, np.int64), np.empty(longest, np.int64)
    level = np.empty(longest)
    for i in range(top.size):
        count = starts[i + 1] - starts[i]
        for k in range(count):
            standing[k], error[k] = starts[i] + k, 0.0
        compared = 0
        for ring in range(1, rings + 1):
            if count < 2:
                break
            length, last = 0, block - 1 + ring
            for a in range(-ring, last + 1):
                step = 1 if a == -ring or a == last else last + ring
                for b in range(-ring, last + 1, step):
                    if 0 <= top[i] + a < rows and 0 <= left[i] + b < columns:
                        down[length], across[length] = a, b
                        level[length] = heights[top[i] + a, left[i] + b]
                        length += 1
            compared += length
            least = np.inf
            for k in range(count):
                c = standing[k]
                m, slope, offset = np.int64(multiple[c]), sigma[c], beta[c]
                layer, turn = layers[layer_of[m]], turns[iso[c]]
                v0, va, vb = np.int64(y[c]) + m * turn[0, 0], m * turn[0, 1], m * turn[0, 2]
                u0, ua, ub = np.int64(x[c]) + m * turn[1, 0], m * turn[1, 1], m * turn[1, 2]
                bottom, right = layer.shape[0] - m, layer.shape[1] - m
                limit = least + alike * least + unseen * compared
                total, shared = 0.0, 0
                for t in range(length):
                    v = v0 + va * down[t] + vb * across[t]
                    u = u0 + ua * down[t] + ub * across[t]
                    if 0 <= v <= bottom and 0 <= u <= right:
                        gap = slope * layer[np.uintp(v), np.uintp(u)] + offset - level[t]
                        total += gap * gap
                        shared += 1
                        if error[k] + total > limit:  # it can only grow: this one is out
                            break
                error[k] += total * (length / shared) if shared > 0 else np.inf
                least = min(least, error[k])
            if least == np.inf:  # no outline is on the map any more
                break
            limit = least + alike * least + unseen * compared
            kept = 0
            for k in range(count):
                if error[k] <= limit:
                    standing[kept], error[kept] = standing[k], error[k]
                    kept += 1
            count = kept
        chosen[i] = standing[0] if count > 0 else -1
