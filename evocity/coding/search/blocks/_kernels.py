"""Compiled loops over blocks one by one: coordinates, norms of their parts, and which are alike.
Arrays in, arrays out. The tests hold what they come to against slow twins in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel

#: Blocks handled side by side, so that loops over them become vector code.
TOGETHER = 128


@kernel
def coordinates(lines, y, down, across, slots, weights, mixed, folded, mean):
    """folded[:, x] = D4 coordinates, the mean removed, of the block of pixels
    lines[y + down·i, x + across·j]; see evocity.coding.search.domains for their order.

    ``slots`` (B, B) is the table of that name there, ``weights`` (B²,) the coordinates of the
    block of ones. The others are room to work in, of the type of ``lines``, as wide as it is (B
    rows of ``mixed``) or as ``folded``. Each step takes two lines apart into √½ (sum, difference).
    """
    block, width, columns = slots.shape[0], np.uintp(mixed.shape[1]), np.uintp(mean.size)
    half = mean.dtype.type(np.sqrt(0.5))
    evens = (block + 1) // 2
    for i in range(evens):
        near, far = lines[y + down * i], lines[y + down * (block - 1 - i)]
        even, odd = mixed[i], mixed[(evens + i) % block]
        if 2 * i == block - 1:
            even[:] = near
            continue
        for x in range(width):
            even[x], odd[x] = half * (near[x] + far[x]), half * (near[x] - far[x])
    for a in range(block):
        line = mixed[a]
        for j in range(evens):
            p, q = np.uintp(across * j), np.uintp(across * (block - 1 - j))
            even, odd = folded[slots[a, j]], folded[slots[a, (evens + j) % block]]
            if 2 * j == block - 1:
                even[:] = line[p : p + columns]
                continue
            for x in range(columns):
                one, two = line[x + p], line[x + q]
                even[x], odd[x] = half * (one + two), half * (one - two)
    for a in range(block):
        for b in range(a + 1, evens if a < evens else block):
            even, odd = folded[slots[a, b]], folded[slots[b, a]]
            for x in range(columns):
                one, two = even[x], odd[x]
                even[x], odd[x] = half * (one + two), half * (one - two)
    mean[:] = 0
    for k in range(weights.size):
        if weights[k] != 0:
            line, weight = folded[k], weights[k] / weights.size
            for x in range(columns):
                mean[x] += weight * line[x]
    for k in range(weights.size):
        if weights[k] != 0:
            line = folded[k]
            for x in range(columns):
                line[x] -= weights[k] * mean[x]


@kernel
def fold(shrunk, step, slots, weights, least, planes, norms):
    """planes[y, :, x], norms[y, x] = D4 coordinates, of unit norm, and norm, the mean removed, of
    the block of pixels shrunk[y + step·i, x + step·j]. Both are 0 where the energy (squared norm)
    is no more than ``least``.

    ``slots`` and ``weights`` are those of `coordinates`. Columns beyond those where a block fits
    are left as they are. Sums are of the type of ``shrunk``.
    """
    block, width = slots.shape[0], shrunk.shape[1]
    columns = width - step * (block - 1)
    mixed = np.empty((block, width), shrunk.dtype)
    folded = np.empty((block * block, columns), shrunk.dtype)
    mean = np.empty(columns, shrunk.dtype)
    energy = np.empty(columns, np.float32)
    for y in range(planes.shape[0]):
        coordinates(shrunk, y, step, step, slots, weights, mixed, folded, mean)
        energy[:] = 0
        for k in range(block * block):
            line = folded[k]
            for x in range(columns):
                value = np.float32(line[x])
                energy[x] += value * value
        for x in range(columns):
            norm = np.sqrt(energy[x]) if energy[x] > least else np.float32(0)
            norms[y, x] = norm
            energy[x] = np.float32(1) / norm if norm > 0 else np.float32(0)
        for k in range(block * block):
            line, plane = folded[k], planes[y, k]
            for x in range(columns):
                plane[x] = np.float32(line[x]) * energy[x]


@kernel
def part_norms(lines, sizes, lowest, used, shares, energy):
    """shares[used[2p], n], shares[used[2p + 1], n] = norm of block n, of D4 coordinates
    lines[:, n], within part p along the part's ``lowest`` vector and across it; u and w count as
    one part. Where ``used`` is negative the norm is not wanted. energy[n] = squared norm of all.

    The rest is found by subtraction: rounding is made up for upwards.
    """
    columns = energy.size
    along, across, other = np.empty(columns), np.empty(columns), np.empty(columns)
    energy[:] = 0
    start = 0
    for part in range(sizes.size):
        along[:] = 0
        across[:] = 0
        other[:] = 0
        for k in range(start, start + sizes[part]):
            line, weight = lines[k], np.float64(lowest[k])
            for x in range(columns):
                value = np.float64(line[x])
                along[x] += weight * value
                across[x] += value * value
            if part == sizes.size - 1:
                line = lines[k + sizes[part]]
                for x in range(columns):
                    value = np.float64(line[x])
                    other[x] += weight * value
                    across[x] += value * value
        for x in range(columns):
            energy[x] += across[x]
            along[x] = along[x] * along[x] + other[x] * other[x]
        if used[2 * part] >= 0:
            share = shares[used[2 * part]]
            for x in range(columns):
                share[x] = np.sqrt(np.float32(along[x]))
        if used[2 * part + 1] >= 0:
            share = shares[used[2 * part + 1]]
            for x in range(columns):
                rest = max(across[x] - along[x], 0.0) + 1e-6 * across[x]
                share[x] = np.sqrt(np.float32(rest))
        start += sizes[part]


@kernel
def relief_keys(shrunk, step, block, top, weights, least, keys):
    """keys[y, x] = a number that blocks of pixels shrunk[top + y + step·i, x + step·j] have in
    common where they differ by a level alone, to the bit; 0 where the energy is surely no more
    than ``least``: the sum of the pixels' heights above the first, weighted."""
    rows, columns = keys.shape
    energy = np.empty(columns)
    for y in range(rows):
        key, base = keys[y], shrunk[top + y]
        key[:] = 0
        energy[:] = 0
        for i in range(block):
            line = shrunk[top + y + step * i]
            for j in range(i == 0, block):  # the first is its own base
                weight, shift = weights[block * i + j], np.uintp(step * j)
                for x in range(np.uintp(columns)):
                    value = line[x + shift] - base[x]
                    key[x] += weight * value
                    energy[x] += value * value
        for x in range(columns):
            if not energy[x] > least:
                key[x] = 0
            elif key[x] == 0:
                key[x] = 1


@kernel
def kinds(keys, shrunk, step, block, top, table, down, across):
    """(down[n], across[n]) = where on the map the first block of the n-th kind begins, in order
    of place; returns how many kinds there are.

    Blocks of pixels shrunk[top + y + step·i, x + step·j] that differ by a level alone, to the
    bit, are of one kind; where keys[y, x] (see `relief_keys`) is 0 there is none. ``table``, of
    zeros and a power of two long, has room for twice as many kinds as there are blocks.
    """
    rows, columns = keys.shape
    width, pixels = shrunk.shape[1], shrunk.ravel()
    offsets = block_offsets(width, step, block)
    known, corners = np.empty(down.size), np.empty(down.size, np.uint64)
    last = np.uint64(table.size - 1)
    count = 0
    for y in range(rows):
        bits = keys[y].view(np.uint64)
        for x in range(columns):
            key = keys[y, x]
            if key == 0:
                continue
            corner = np.uintp((top + y) * width + x)
            mixed = bits[x] * np.uint64(0x9E3779B97F4A7C15)
            slot = (mixed ^ (mixed >> np.uint64(32))) & last
            while True:
                seen = table[slot] - 1
                if seen < 0:
                    down[count], across[count] = top + y, x
                    corners[count], known[count] = corner, key
                    count += 1
                    table[slot] = count
                    break
                if known[seen] == key and same_relief(pixels, offsets, corner, corners[seen]):
                    break
                slot = (slot + np.uint64(1)) & last
    return count


@kernel
def block_offsets(width, step, block):
    """How far in memory a block's pixels lie from its first, in a raster of such ``width``."""
    offsets = np.empty(block * block, np.uintp)
    for k in range(block * block):
        offsets[k] = step * (k // block * width + k % block)
    return offsets


@kernel
def same_relief(pixels, offsets, corner, other):
    """Whether the blocks at two corners differ by a level alone, to the bit."""
    one, two = pixels[corner], pixels[other]
    different = 0
    for offset in offsets:
        different += pixels[corner + offset] - one != pixels[other + offset] - two
    return different == 0


@kernel
def fold_at(shrunk, step, y, x, slots, weights, least, sizes, lowest, used, codes, norms, shares):
    """codes[n], norms[n] = D4 coordinates, of unit norm, and norm, the mean removed, of the block
    whose first pixel is shrunk[y[n], x[n]]; shares[:, n] = norms of its parts over its own
    (see `part_norms`). All are 0 where its energy is no more than ``least``."""
    block, pixels = slots.shape[0], shrunk.ravel()
    offsets = block_offsets(shrunk.shape[1], step, block)
    at, bases = np.empty(TOGETHER, np.uintp), np.empty(TOGETHER)
    stones = np.zeros((block, block, TOGETHER), np.float32)
    lines = stones.reshape(block, block * TOGETHER)
    mixed, mean = np.empty_like(lines), np.empty(TOGETHER, np.float32)
    folded = np.empty((block * block, TOGETHER), np.float32)
    parts, energy = np.empty((shares.shape[0], TOGETHER), np.float32), np.empty(TOGETHER)
    units = np.empty(TOGETHER, np.float32)
    for start in range(0, y.size, TOGETHER):
        most = min(TOGETHER, y.size - start)
        for n in range(TOGETHER):
            place = start + min(n, most - 1)
            at[n] = np.int64(y[place]) * shrunk.shape[1] + x[place]
            bases[n] = pixels[at[n]]
        for k in range(block * block):
            stone, offset = stones[k // block, k % block], offsets[k]
            for n in range(TOGETHER):  # less the first: heights may be far above their differences
                stone[n] = pixels[at[n] + offset] - bases[n]
        coordinates(lines, 0, 1, TOGETHER, slots, weights, mixed, folded, mean)
        part_norms(folded, sizes, lowest, used, parts, energy)
        for n in range(most):
            flat = not np.float32(energy[n]) > least
            norm = np.float32(0) if flat else np.sqrt(np.float32(energy[n]))
            norms[start + n], units[n] = norm, np.float32(0) if flat else np.float32(1) / norm
        for n in range(most):
            unit, code = units[n], codes[start + n]
            for k in range(block * block):
                code[k] = unit * folded[k, n]
        for f in range(parts.shape[0]):
            part, share = parts[f], shares[f, start : start + most]
            for n in range(most):
                share[n] = units[n] * part[n]


@kernel
def z_order(values, low, scale, bits, counts, order):
    """order = of the columns of ``values`` (K, n) along a Z-order curve, of ``bits`` bits a row:
    the cell of values[k, n] is (values[k, n] − low[k]) · scale[k], less than 2^bits.

    A counting sort: ``counts`` holds 2^(K · bits) + 1 zeros.
    """
    rows, columns = values.shape
    keys = np.zeros(columns, np.uint32)
    for k in range(rows):
        line, least, factor = values[k], low[k], scale[k]
        for bit in range(bits):
            source, target = np.uint32(bit), np.uint32(bit * rows + rows - 1 - k)
            for n in range(columns):
                cell = np.uint32(np.int32((line[n] - least) * factor))
                keys[n] |= (cell >> source & np.uint32(1)) << target
    for n in range(columns):
        counts[keys[n] + 1] += 1
    for key in range(1, counts.size):
        counts[key] += counts[key - 1]
    for n in range(columns):
        order[counts[keys[n]]] = n
        counts[keys[n]] += 1


@kernel
def canonical(blocks, sources, weights, shapes, keys):
    """shapes[i] = block i with its lowest (or, turned upside down, its highest) pixel at 0, under
    that one of the 16 combinations of sign and isometry whose sum weighted by ``weights`` (B²,),
    keys[i], is least.

    Sums of the same numbers in the same order, so equal bits give equal keys; float32 heights
    have exact float64 differences.
    """
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
            keys[start + n] = least[n]
            sign, k = divmod(where[n], sources.shape[0])
            for t in range(pixels):
                shapes[start + n, t] = sides[sign, sources[k, t], n]
