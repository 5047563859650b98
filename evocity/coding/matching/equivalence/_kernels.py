"""Compiled equivalence of blocks: kinds, shapes, an order. Arrays in, arrays out. Slow twins stand
in tests/naive.py."""

from functools import cache

import numpy as np

from evocity.accelerate import kernel

#: Blocks handled side by side, so that loops over them become vector code.
TOGETHER = 128
#: Rows that an order goes by, and bits of each.
KEYS, BITS = 5, 3


@kernel(inline="always")
def _relief_keys(shrunk, step, block, y, weights, least, keys, energy):
    """keys[x] = a common key of blocks of pixels shrunk[y + step·i, x + step·j] that differ only by
    a level, to the bit: the weighted sum of heights above the first pixel. 0 where the energy is
    surely at most ``least``."""
    base = shrunk[y]
    keys[:] = 0
    energy[:] = 0
    for i in range(block):
        line, heavy = shrunk[y + step * i], weights[block * i : block * (i + 1)]
        for x in range(np.uintp(keys.size)):
            key, squares = keys[x], energy[x]
            for j in range(block):
                value = line[x + np.uintp(step * j)] - base[x]
                key += heavy[j] * value
                squares += value * value
            keys[x], energy[x] = key, squares
    for x in range(keys.size):
        if not energy[x] > least:
            keys[x] = 0
        elif keys[x] == 0:
            keys[x] = 1


@kernel(inline="always")
def _same_relief(pixels, step, block, width, one, two):
    """Tell whether the blocks with first pixels ``one`` and ``two`` differ only by a level, to the
    bit."""
    first, second = pixels[one], pixels[two]
    different = 0
    for _ in range(block):
        for j in range(block):
            shift = np.uintp(step * j)
            different += pixels[one + shift] - first != pixels[two + shift] - second
        one += np.uintp(step * width)
        two += np.uintp(step * width)
    return different == 0


@cache
def kind_kernels(block):
    """Make the kernels that list blocks of side ``block``: first_of_kinds, not_flat."""

    @kernel
    def first_of_kinds(shrunk, step, top, rows, weights, least, table, at):
        """at[n] = the place in memory of the first block of the n-th kind, among blocks that begin
        in ``rows`` rows from ``top`` on and are not flat; returns their number. There is room for
        another.

        Blocks of pixels shrunk[y + step·i, x + step·j] that differ only by a level, to the bit, are
        of one kind. ``table``, of zeros and a power of two long, keeps the last kind in each slot:
        a longer table leaves fewer doubles. ``weights`` are those of `_relief_keys`.
        """
        width, pixels = shrunk.shape[1], shrunk.ravel()
        columns = width - step * (block - 1)
        keys, energy, known = np.empty(columns), np.empty(columns), np.empty(at.size, np.uint64)
        bits, again = keys.view(np.uint64), np.empty((2, columns + 1), np.int64)
        shift = np.uint64(64 - np.int64(np.log2(table.size)))
        known[0], count = 0, 0
        for y in range(top, top + rows):
            _relief_keys(shrunk, step, block, y, weights, least, keys, energy)
            doubles = 0
            for x in range(columns):  # no branches, as the next block is unpredictable
                key, corner = bits[x], np.int64(y * width + x)
                place = key * np.uint64(0x9E3779B97F4A7C15) >> shift
                seen = np.int64(table[place])
                busy, same = key != 0, known[seen] == key
                again[0, doubles], again[1, doubles] = corner, at[seen]
                doubles += busy & same
                at[count], known[count] = corner, key
                new = busy & (not same)
                table[place] = count if new else seen
                count += new
            for n in range(doubles):  # equal keys of unequal blocks, a rarity, keep both
                one, other = np.uintp(again[0, n]), np.uintp(again[1, n])
                if not _same_relief(pixels, step, block, width, one, other):
                    at[count], known[count] = one, 0
                    count += 1
        return count

    @kernel
    def not_flat(shrunk, step, top, rows, weights, least, at):
        """at[n] = the place in memory of the n-th block that is not flat; returns their number.
        The rest is as in `first_of_kinds`."""
        width, count = shrunk.shape[1], 0
        columns = width - step * (block - 1)
        keys, energy = np.empty(columns), np.empty(columns)
        for y in range(top, top + rows):
            _relief_keys(shrunk, step, block, y, weights, least, keys, energy)
            for x in range(columns):
                at[count] = y * width + x
                count += keys[x] != 0
        return count

    return first_of_kinds, not_flat


@kernel
def z_order(values, order):
    """order = that of the columns of ``values`` (F, n) along a Z-order curve through the `KEYS`
    rows that vary most, `BITS` bits each: a counting sort. A sample of columns decides which rows
    vary most, and their range; values beyond it fall in the outermost cells."""
    columns = order.size
    if not columns:
        return
    sampled = values[:, :: max(1, columns >> 10)]
    spread = np.empty(len(values))
    for k in range(len(values)):
        spread[k] = -np.std(sampled[k])
    most = np.argsort(spread, kind="mergesort")[:KEYS]
    keys, cells = np.zeros(columns, np.uint32), 1 << BITS
    for k in range(most.size):
        line, low = values[most[k]], np.float32(sampled[most[k]].min())
        span = max(np.float32(sampled[most[k]].max()) - low, np.float32(1e-6))
        scale = np.float32(cells - 0.01) / span
        place, highest = np.uint32(most.size - 1 - k), np.float32(cells - 0.01)
        for n in range(columns):
            inside = min(max((line[n] - low) * scale, np.float32(0)), highest)
            cell, key = np.uint32(np.int32(inside)), keys[n]
            for bit in range(BITS):
                one = cell >> np.uint32(bit) & np.uint32(1)
                key |= one << (place + np.uint32(bit * most.size))
            keys[n] = key
    counts = np.zeros((1 << most.size * BITS) + 1, np.int32)
    for n in range(columns):
        counts[keys[n] + 1] += 1
    for key in range(1, counts.size):
        counts[key] += counts[key - 1]
    for n in range(columns):
        order[counts[keys[n]]] = n
        counts[keys[n]] += 1


@kernel
def uneven(blocks, found):
    """found[i] = whether block i of (n, B²) has more than one height."""
    for i in range(found.size):
        block, different = blocks[i], 0
        for t in range(1, block.size):
            different += block[t] != block[0]
        found[i] = different > 0


@kernel
def canonical(blocks, sources, weights, shapes, keys, turned):
    """shapes[i] = block i with its lowest (or, upside down, its highest) pixel at 0, under the
    combination of sign and isometry, of 16, with the least sum keys[i], weighted by ``weights``
    (B²,): turned[i], isometries 0…7, then the same upside down. Equal bits give equal keys, and
    float32 heights have exact float64 differences."""
    count, pixels = blocks.shape
    sides = np.empty((2, pixels, TOGETHER))
    low, high = np.empty(TOGETHER), np.empty(TOGETHER)
    least, total = np.empty(TOGETHER), np.empty(TOGETHER)
    where = np.empty(TOGETHER, np.int64)
    for start in range(0, count, TOGETHER):
        most = min(TOGETHER, count - start)
        for n in range(TOGETHER):
            block = blocks[start + min(n, most - 1)]
            for t in range(pixels):
                sides[0, t, n] = block[t]
        low[:] = np.inf
        high[:] = -np.inf
        for t in range(pixels):
            side = sides[0, t]
            for n in range(TOGETHER):
                low[n], high[n] = min(low[n], side[n]), max(high[n], side[n])
        for t in range(pixels):
            side, other = sides[0, t], sides[1, t]
            for n in range(TOGETHER):
                value = side[n]
                side[n], other[n] = value - low[n], high[n] - value
        least[:] = np.inf
        where[:] = 0
        for sign in range(2):
            for k in range(sources.shape[0]):
                total[:] = 0
                for t in range(pixels):
                    side, weight = sides[sign, sources[k, t]], weights[t]
                    for n in range(TOGETHER):
                        total[n] += weight * side[n]
                for n in range(TOGETHER):
                    lower = total[n] < least[n]
                    least[n] = total[n] if lower else least[n]
                    where[n] = sign * sources.shape[0] + k if lower else where[n]
        for n in range(most):
            keys[start + n], turned[start + n] = least[n], where[n]
            sign, k = divmod(where[n], sources.shape[0])
            for t in range(pixels):
                shapes[start + n, t] = sides[sign, sources[k, t], n]


@kernel
def grouped(shapes, keys, table, of, first):
    """of[i] = the group of shape i, first[g] = the first shape of group g; returns the number of
    groups. Shapes (n, B²) of one group, and their ``keys``, are equal to the bit. ``table``, of
    zeros and a power of two long, has room for twice as many shapes."""
    last, bits, count = np.uint64(table.size - 1), keys.view(np.uint64), 0
    shift = np.uint64(64 - np.int64(np.log2(table.size)))
    for i in range(keys.size):
        slot = bits[i] * np.uint64(0x9E3779B97F4A7C15) >> shift
        while table[slot]:
            same, one, other = True, shapes[i], shapes[first[table[slot] - 1]]
            for t in range(one.size):
                same &= one[t] == other[t]
            if same:
                break
            slot = (slot + np.uint64(1)) & last
        else:
            first[count] = i
            count += 1
            table[slot] = count
        of[i] = table[slot] - 1
    return count
