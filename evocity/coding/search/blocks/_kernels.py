"""Compiled loops over blocks one by one: coordinates, norms of their parts, and which are alike.
Arrays in, arrays out. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def mirrored(lines, near, far, even, combined):
    """combined[x] = √½ (near ± far) of two shifted lines, + for even; the line itself if both
    are one (the middle line of an odd block)."""
    half = combined.dtype.type(np.sqrt(0.5))
    (i, p), (j, q) = near, far
    p, q = np.uintp(p), np.uintp(q)
    if i == j and p == q:
        for x in range(np.uintp(combined.size)):
            combined[x] = lines[i, x + p]
    elif even:
        for x in range(np.uintp(combined.size)):
            combined[x] = half * (lines[i, x + p] + lines[j, x + q])
    else:
        for x in range(np.uintp(combined.size)):
            combined[x] = half * (lines[i, x + p] - lines[j, x + q])


@kernel
def fold(shrunk, step, block, weights, least, planes, norms):
    """planes[y, :, x], norms[y, x] = D4 coordinates, of unit norm, and norm, the mean removed, of
    the block of pixels shrunk[y + step·i, x + step·j]; see evocity.coding.search.domains for
    their order. Both are 0 where the energy (squared norm) is no more than ``least``.

    ``weights`` (B²,) holds the coordinates of the block of ones. Columns beyond those where a
    block fits are left as they are. Sums are of the type of ``shrunk``.
    """
    rows, count = planes.shape[0], planes.shape[1]
    width = shrunk.shape[1]
    columns = width - step * (block - 1)
    evens = (block + 1) // 2
    down = np.empty((block, width), shrunk.dtype)
    full = np.empty((block, block, columns), shrunk.dtype)
    folded = np.empty((count, columns), shrunk.dtype)
    mean = np.empty(columns, shrunk.dtype)
    energy = np.empty(columns, np.float32)
    half = shrunk.dtype.type(np.sqrt(0.5))
    for y in range(rows):
        for a in range(block):
            i = a if a < evens else a - evens
            near, far = y + step * i, y + step * (block - 1 - i)
            mirrored(shrunk, (near, 0), (far, 0), a < evens, down[a])
        for a in range(block):
            for b in range(block):
                j = b if b < evens else b - evens
                near, far = step * j, step * (block - 1 - j)
                mirrored(down, (a, near), (a, far), b < evens, full[a, b])
        k = 0
        for first, last in ((0, evens), (evens, block)):
            for sign in (1, -1):
                for a in range(first, last):
                    if sign > 0:
                        folded[k] = full[a, a]
                        k += 1
                    for b in range(a + 1, last):
                        one, two = full[a, b], full[b, a]
                        for x in range(columns):
                            folded[k, x] = half * (one[x] + sign * two[x])
                        k += 1
        for swap in (False, True):
            for a in range(evens):
                for b in range(evens, block):
                    folded[k] = full[b, a] if swap else full[a, b]
                    k += 1
        mean[:] = 0
        for k in range(count):
            if weights[k] != 0:
                for x in range(columns):
                    mean[x] += weights[k] * folded[k, x]
        scale = shrunk.dtype.type(1.0 / count)
        energy[:] = 0
        for k in range(count):
            line = planes[y, k]
            shift = weights[k] * scale
            for x in range(columns):
                value = np.float32(folded[k, x] - shift * mean[x])
                line[x] = value
                energy[x] += value * value
        for x in range(columns):
            norm = np.sqrt(energy[x]) if energy[x] > least else np.float32(0)
            norms[y, x] = norm
            energy[x] = np.float32(1) / norm if norm > 0 else np.float32(0)
        for k in range(count):
            line = planes[y, k]
            for x in range(columns):
                line[x] *= energy[x]


@kernel
def part_norms(planes, places, sizes, lowest, shares):
    """shares[2p, n], shares[2p + 1, n] = norm of the block at places[n] = y · columns + x within
    part p, along the part's ``lowest`` vector and across it; u and w count as one part.

    ``places`` ascend. The rest is found by subtraction: rounding is made up for upwards.
    """
    rows, _, columns = planes.shape
    parts = sizes.size
    lines = np.zeros((2 * parts, columns), np.float32)
    along, across, other = np.empty(columns), np.empty(columns), np.empty(columns)
    n = 0
    for y in range(rows):
        start = 0
        for part in range(parts):
            along[:] = 0
            across[:] = 0
            other[:] = 0
            for k in range(start, start + sizes[part]):
                line, weight = planes[y, k], np.float64(lowest[k])
                for x in range(columns):
                    value = np.float64(line[x])
                    along[x] += weight * value
                    across[x] += value * value
                if part == parts - 1:
                    line = planes[y, k + sizes[part]]
                    for x in range(columns):
                        value = np.float64(line[x])
                        other[x] += weight * value
                        across[x] += value * value
            for x in range(columns):
                low = along[x] * along[x] + other[x] * other[x]
                lines[2 * part, x] = np.sqrt(low)
                rest = max(across[x] - low, 0.0) + 1e-6 * across[x]
                lines[2 * part + 1, x] = np.sqrt(rest)
            start += sizes[part]
        while n < places.size and places[n] < (y + 1) * columns:
            for f in range(2 * parts):
                shares[f, n] = lines[f, places[n] - y * columns]
            n += 1


@kernel
def kinds(planes, norms, shrunk, step, block, top, table, firsts):
    """firsts[n] = row-major place in ``norms`` (y · columns + x) of the n-th kind of domain block,
    in order of place; returns how many there are.

    Blocks of pixels shrunk[top + y + step·i, x + step·j] that differ by a level alone, to the
    bit, are of one kind; where the norm is 0 there is none. Blocks are told apart by the bits of
    ``planes`` first: where rounding hides that two are of one kind, both are kept. ``table``, of
    zeros and a power of two long, has room for twice as many kinds as there are blocks.
    """
    rows, columns = norms.shape
    keys = np.empty(columns, np.uint32)
    count = 0
    for y in range(rows):
        keys[:] = 0
        for k in range(planes.shape[1]):
            bits = planes[y, k].view(np.uint32)
            odd = np.uint32((2 * k + 1) * 0x9E3779B9 & 0xFFFFFFFF)
            for x in range(columns):
                mixed = bits[x] * odd
                keys[x] += mixed ^ (mixed >> np.uint32(15))
        for x in range(columns):
            if norms[y, x] == 0:
                continue
            slot = (keys[x] ^ (keys[x] >> np.uint32(16))) & np.uint32(table.size - 1)
            while True:
                seen = table[slot] - 1
                if seen < 0:
                    firsts[count] = y * columns + x
                    count += 1
                    table[slot] = count
                    break
                v, u = firsts[seen] // columns, firsts[seen] % columns
                if same_relief(shrunk, step, block, top + y, x, top + v, u):
                    break
                slot = (slot + np.uint32(1)) & np.uint32(table.size - 1)
    return count


@kernel
def same_relief(shrunk, step, block, y, x, v, u):
    """Whether the blocks at (y, x) and (v, u) differ by a level alone, to the bit."""
    for i in range(block):
        for j in range(block):
            one = shrunk[y + step * i, x + step * j] - shrunk[y, x]
            if one != shrunk[v + step * i, u + step * j] - shrunk[v, u]:
                return False
    return True


@kernel
def canonical(blocks, sources, shapes, keys):
    """shapes[i] = block i with its lowest (or, turned upside down, its highest) pixel at 0, under
    that one of the 16 combinations of sign and isometry whose hash, keys[i], is least.

    Whole-number arithmetic, so equal bits give equal hashes; float32 heights have exact float64
    differences.
    """
    count, pixels = blocks.shape
    bits = np.empty((2, pixels), np.uint64)
    odd = np.empty(pixels, np.uint64)
    for t in range(pixels):
        odd[t] = np.uint64(2 * t + 1) * np.uint64(0x9E3779B97F4A7C15)
    sides = np.empty((2, pixels))
    for i in range(count):
        low, high = blocks[i].min(), blocks[i].max()
        for t in range(pixels):
            sides[0, t] = blocks[i, t] - low + 0.0  # −0 becomes 0
            sides[1, t] = high - blocks[i, t] + 0.0
        for sign in range(2):
            bits[sign] = sides[sign].view(np.uint64)
            for t in range(pixels):
                bits[sign, t] ^= bits[sign, t] >> np.uint64(29)
        least, where = np.uint64(0), -1
        for sign in range(2):
            for k in range(sources.shape[0]):
                key = np.uint64(0)
                for t in range(pixels):
                    mixed = bits[sign, sources[k, t]] * odd[t]
                    key += mixed ^ (mixed >> np.uint64(32))
                if where < 0 or key < least:
                    least, where = key, sign * sources.shape[0] + k
        keys[i] = least
        source = sources[where % sources.shape[0]]
        for t in range(pixels):
            shapes[i, t] = sides[where // sources.shape[0], source[t]]
