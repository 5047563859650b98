"""Compiled loops of the exact search: arrays in, arrays out. Slow twins stand in tests/naive.py."""

from functools import cache

import numpy as np

from evocity.accelerate import kernel

#: Domain positions are compared in groups of so many; pools are padded by one group.
LANES = 32
#: Tiles of `LANES` domain blocks that stand side by side in a row.
ABREAST = 8
#: Tiles times B² that stay in the cache together.
SPAN = 2048


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
def tiled(planes, norms, places, shares, cap, tiles, ceilings, tile_shares, tops, peaks, y, x):
    """Lay the blocks at ``places`` (y · columns + x) side by side, `LANES` to a tile and `ABREAST`
    tiles to a row: see evocity.coding.search.tiles. ``shares`` (F, n) go with them."""
    width, columns = ABREAST * LANES, norms.shape[1]
    for n in range(places.size):
        y[n], x[n] = places[n] // columns, places[n] % columns
        ceilings[n // width, n % width] = cap * norms[y[n], x[n]]
        t = n // LANES
        tops[t] = max(tops[t], ceilings[n // width, n % width])
        for f in range(shares.shape[0]):
            tile_shares[t, f, n % LANES] = shares[f, n]
            peaks[f, t] = max(peaks[f, t], shares[f, n])
    for k in range(tiles.shape[1]):  # outside: so a plane stays in the cache
        for n in range(places.size):
            tiles[n // width, k, n % width] = planes[y[n], k, x[n]]


@kernel
def tile_bounds(peaks, tops, shares, norms, bounds):
    """bounds[i, t] = no less than the energy of range i that any block of tile t explains;
    infinite ``norms`` leave the range's own energy out of account.

    ``shares`` (n, F) and ``norms`` (n,) are the ranges', ``peaks`` (F, T) and ``tops`` (T,) the
    tiles'.
    """
    total = np.empty(tops.size, np.float32)
    for i in range(norms.size):
        total[:] = 0
        for f in range(shares.shape[1]):
            share = shares[i, f]
            for t in range(tops.size):
                total[t] += share * peaks[f, t]
        for t in range(tops.size):
            p = min(total[t], norms[i])
            s = min(p, tops[t])
            bounds[i, t] = s * (p + p - s)


@kernel
def most_likely(likings, rows):
    """rows[i] = the columns of the highest values of likings[i], which are lowered to −1."""
    for i in range(rows.shape[0]):
        for k in range(rows.shape[1]):
            best = np.argmax(likings[i])
            rows[i, k] = best
            likings[i, best] = -1


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


@cache
def row_kernel(block):
    """The inner loop of every search, for range blocks of side ``block``.

    The block's side must be known to the compiler: only then are the sums over a block's
    coordinates unrolled and the loop over domain positions turned into vector code.
    """
    even, odd = (block + 1) // 2, block // 2
    n1 = even * (even + 1) // 2
    n2 = n1 + even * (even - 1) // 2
    n3 = n2 + odd * (odd + 1) // 2
    n4 = n3 + odd * (odd - 1) // 2
    nu = even * odd
    n5 = n4 + nu

    # "contract" (a·b + c in one rounding) keeps each position's result independent of the
    # others, so of threads and chunks; what depends on rounding is settled in float64.
    @kernel(fastmath={"contract"})
    def row_gains(planes, norms, code, top, bottom, first, count, cap, gains):
        """gains[j] = max(itself, the energy of range block ``code`` explained by the unit domain
        block at position first + j of any row from ``top`` to before ``bottom``, of norm
        ``norms``, under the best of the 8 isometries, |σ| ≤ cap). In D4 coordinates (see
        evocity.coding.search.domains) all eight inner products come from 1.5 B² multiplications.
        """
        for y in range(top, bottom):
            row, norm = planes[y], norms[y]
            for j in range(count):
                q = np.uintp(first + j)  # unsigned: no test for negative indices, so vector code
                s1 = s2 = s3 = s4 = a = b = c = d = np.float32(0)
                for k in range(n1):
                    s1 += code[k] * row[k, q]
                for k in range(n1, n2):
                    s2 += code[k] * row[k, q]
                for k in range(n2, n3):
                    s3 += code[k] * row[k, q]
                for k in range(n3, n4):
                    s4 += code[k] * row[k, q]
                for k in range(nu):
                    u, w = row[n4 + k, q], row[n5 + k, q]
                    a += code[n4 + k] * u
                    b += code[n5 + k] * w
                    c += code[n4 + k] * w
                    d += code[n5 + k] * u
                p, m = s1 + s2 + (s3 + s4), s1 + s2 - (s3 + s4)
                t, v = s1 - s2 + (s3 - s4), s1 - s2 - (s3 - s4)
                p = max(
                    max(abs(p) + abs(a + b), abs(m) + abs(a - b)),
                    max(abs(t) + abs(c + d), abs(v) + abs(c - d)),
                )
                s = min(p, cap * norm[q])
                gains[j] = max(gains[j], s * (p + p - s))

    return row_gains


@cache
def tile_kernels(block, parts):
    """The kernels of the search of a whole map: reach_tiles, list_tiles; see
    evocity.coding.search.tiles. ``parts`` is how many norms the bounds sum up."""
    row_gains = row_kernel(block)
    one = np.float32(1)
    span = max(1, SPAN // block**2)

    # order of a maximum or of a sum of bounds is free: `slack` covers their rounding
    @kernel(fastmath={"contract", "nnan", "nsz"})
    def hopeful(shares, ceilings, which, count, range_shares, norm, near):
        """Of the tiles ``which[:count]``, move those to the front of which some block may explain
        ``near`` of a range block; returns how many."""
        left = 0
        for n in range(count):
            share, found = shares[which[n]], np.int32(0)
            ceiling = ceilings[which[n] // ABREAST, which[n] % ABREAST * LANES :]
            for j in range(LANES):
                q, total = np.uintp(j), np.float32(0)
                for f in range(parts):
                    total += range_shares[f] * share[f, q]
                p = min(total, norm)
                s = min(p, ceiling[q])
                found += np.int32(s * (p + p - s) >= near)
            which[left] = which[n]
            left += found > 0
        return left

    @kernel(fastmath={"nnan", "nsz"})
    def explain(planes, ceilings, which, count, code, reached, gains):
        """reached[t] = the largest gain in tile t, for the tiles ``which[:count]``; returns the
        largest of all. Neighbours are compared in one go."""
        most, n = np.float32(0), 0
        while n < count:
            first, end = which[n], which[n] + 1
            row = first // ABREAST
            while n + end - first < count and which[n + end - first] == end and end % ABREAST:
                end += 1
            lanes = (end - first) * LANES
            gains[:lanes] = 0
            start = first % ABREAST * LANES
            row_gains(planes, ceilings, code, row, row + 1, start, lanes, one, gains)
            for t in range(first, end):
                largest = np.float32(0)
                for j in range(LANES):
                    largest = max(largest, gains[np.uintp((t - first) * LANES + j)])
                reached[t] = largest
                most = max(most, largest)
            n += end - first
        return most

    @kernel
    def reach_tiles(
        planes, ceilings, shares, codes, range_shares, norms, slack, seeds, reached, best
    ):
        """best[i] = largest gain of range i in any tile; reached[i, t], a bound before, becomes
        the largest gain within tile t, or −1 where that is sure to fall slack[i] short of best[i].

        The rows of tiles seeds[i] come first: the better the start, the more is left out.
        """
        count = shares.shape[0]
        which = np.empty(span + ABREAST, np.int64)
        gains = np.empty(ABREAST * LANES, np.float32)
        aside = np.empty(count, np.float32)
        for i in range(best.size):
            for row in seeds[i]:
                for t in range(ABREAST):
                    which[t] = ABREAST * row + t
                most = explain(planes, ceilings, which, ABREAST, codes[i], aside, gains)
                best[i] = max(best[i], most)
        for start in range(0, count, span):  # tiles outside: so they stay in the cache
            end = min(start + span, count)
            for i in range(best.size):
                near, found = best[i] - slack[i], 0
                for t in range(start, end):
                    which[found] = t
                    found += reached[i, t] >= near
                reached[i, start:end] = -1
                found = hopeful(shares, ceilings, which, found, range_shares[i], norms[i], near)
                most = explain(planes, ceilings, which, found, codes[i], reached[i], gains)
                best[i] = max(best[i], most)

    @kernel
    def list_tiles(planes, ceilings, y, x, codes, reached, near, which, down, across):
        """The domain blocks whose gain is at least near[i], in the tiles that reached as much:
        block down[n], across[n] of the pool for range which[n], as far as there is room.
        Returns how many there are."""
        lanes = np.empty(LANES, np.float32)
        count = 0
        for i in range(codes.shape[0]):
            for t in range(reached.shape[1]):
                if reached[i, t] < near[i]:
                    continue
                lanes[:] = 0
                row, first = t // ABREAST, t % ABREAST * LANES
                row_gains(planes, ceilings, codes[i], row, row + 1, first, LANES, one, lanes)
                for j in range(LANES):
                    if lanes[j] >= near[i]:
                        if count < which.size:
                            which[count] = i
                            down[count], across[count] = y[t * LANES + j], x[t * LANES + j]
                        count += 1
        return count

    return reach_tiles, list_tiles


@cache
def window_kernels(block):
    """The kernels of the search within reach: lane_maxima, list_windows."""
    row_gains = row_kernel(block)

    @kernel
    def lane_maxima(planes, norms, codes, window, step, cap, first_row, band, lanes, best):
        """best[i] = max(itself, the largest gain of range i); lanes[s, i, j], 0 before, becomes
        the largest over the domains in column window.left + j, in the s-th ``band`` of rows from
        ``first_row`` on.

        ``window`` holds (top, bottom, left, right) of each range's domain positions; columns are
        compared ``step`` at a time, those beyond the window set back to 0.
        """
        for i in range(codes.shape[0]):
            width = window[i, 3] - window[i, 2]
            whole = -(-width // step) * step
            for strip in range(lanes.shape[0]):
                start, line = first_row + strip * band, lanes[strip, i]
                top, bottom = max(start, window[i, 0]), min(start + band, window[i, 1])
                row_gains(planes, norms, codes[i], top, bottom, window[i, 2], whole, cap, line)
                line[max(width, 0) :] = 0
                most = best[i]
                for j in range(width):
                    if line[j] > most:
                        most = line[j]
                best[i] = most

    @kernel
    def list_windows(
        planes, norms, codes, window, cap, best, first_row, band, near, group, which, down, across
    ):
        """The domains whose gain is at least near[i]: block down[n], across[n] of the pool for
        range which[n], as far as there is room. Returns how many there are.

        ``best`` (bands, n, lanes) holds maxima over ``band`` rows from ``first_row`` on: only
        where these reach near[i] are positions looked at again, in groups of ``group``; the
        arrays are padded by one.
        """
        lanes = np.empty(best.shape[2] + group, np.float32)
        runs = np.empty((best.shape[2] // group + 1, 2), np.int64)
        count = 0
        for i in range(codes.shape[0]):
            left, right = window[i, 2], window[i, 3]
            for strip in range(best.shape[0]):
                line, found, x = best[strip, i], 0, left
                while x < right:
                    if line[x - left] < near[i]:
                        x += 1
                        continue
                    # whole groups of lanes cost vector code less than single ones
                    if found and runs[found - 1, 1] >= x:
                        runs[found - 1, 1] += group
                    else:
                        runs[found, 0], runs[found, 1] = x, x + group
                        found += 1
                    x = runs[found - 1, 1]
                if found == 0:
                    continue
                start = first_row + strip * band
                for y in range(max(start, window[i, 0]), min(start + band, window[i, 1])):
                    for run in range(found):
                        x, length = runs[run, 0], runs[run, 1] - runs[run, 0]
                        lanes[:length] = 0
                        row_gains(planes, norms, codes[i], y, y + 1, x, length, cap, lanes)
                        for j in range(min(length, right - x)):
                            if lanes[j] < near[i]:
                                continue
                            if count < which.size:
                                which[count] = i
                                down[count], across[count] = y, x + j
                            count += 1
        return count

    return lane_maxima, list_windows


@cache
def scoring_kernels(block):
    """The kernels that decide near-ties in float64: settle, rank, resolve."""
    pixels = block * block

    @kernel
    def turned(range_block, sources, images):
        """images[u, k] = the pixel of the range block that meets pixel u of a domain block
        under isometry k: so ⟨r, iso_k d⟩ = Σ_u images[u, k] d[u], all eight side by side."""
        for k in range(8):
            for t in range(pixels):
                images[sources[k, t], k] = range_block[t]

    @kernel
    def exact_gains(shrunk, step, y, x, images, cap, domain, gains, slopes):
        """gains[k], slopes[k]: energy explained and σ with isometry k, in float64; returns the
        domain's mean."""
        mean = 0.0
        for i in range(block):
            line = shrunk[y + step * i]
            for j in range(block):
                value = line[np.uintp(x + step * j)]
                domain[block * i + j] = value
                mean += value
        mean /= pixels
        energy = 0.0
        p0 = p1 = p2 = p3 = p4 = p5 = p6 = p7 = 0.0  # in registers, not in an array
        for t in range(pixels):
            value = domain[t] - mean
            image = images[t]
            energy += value * value
            p0 += image[0] * value
            p1 += image[1] * value
            p2 += image[2] * value
            p3 += image[3] * value
            p4 += image[4] * value
            p5 += image[5] * value
            p6 += image[6] * value
            p7 += image[7] * value
        slopes[0], slopes[1], slopes[2], slopes[3] = p0, p1, p2, p3
        slopes[4], slopes[5], slopes[6], slopes[7] = p4, p5, p6, p7
        for k in range(8):
            p = slopes[k]
            s = min(abs(p) / energy, cap) if energy > 0 else 0.0
            gains[k] = s * (2 * abs(p) - s * energy)
            slopes[k] = s if p >= 0 else -s
        return mean

    @kernel
    def keep(gain, place, slack, records, places, count):
        """Note a domain at ``place`` unless one before it explains as much; forget those after
        it that explain no more, and those more than ``slack`` below the best. Returns how many
        of ``records`` and ``places`` are in use."""
        most = gain
        for k in range(count):
            if records[k] >= gain and places[k] < place:
                return count
            most = max(most, records[k])
        kept = 0
        for k in range(count):
            if records[k] >= most - slack and not (gain >= records[k] and place < places[k]):
                records[kept], places[kept] = records[k], places[k]
                kept += 1
        if gain < most - slack:
            return kept
        if kept == records.size:  # the least goes: it wins only if all others are forgotten
            kept -= 1
            least = np.argmin(records)
            records[least], places[least] = records[kept], places[kept]
        records[kept], places[kept] = gain, place
        return kept + 1

    @kernel
    def settle(which, y, x, shrunk, step, blocks, sources, cap, slack, records, places, count):
        """Score for range which[n], ascending, the domain at (y[n], x[n]) in float64 and `keep`
        it where it may be the best. Once one explains everything, none behind it can win."""
        domain = np.empty(pixels)
        gains, slopes = np.empty(8), np.empty(8)
        images = np.empty((pixels, 8))
        before = -1
        for n in range(which.size):
            i = which[n]
            if i != before:
                turned(blocks[i], sources, images)
                energy = 0.0
                for t in range(pixels):
                    energy += blocks[i, t] * blocks[i, t]
                before = i
            place = (np.int64(step) << 42) | (np.int64(y[n]) << 21) | np.int64(x[n])
            beaten = False
            for k in range(count[i]):
                beaten |= places[i, k] < place and records[i, k] >= energy - slack[i] / 2
            if beaten:
                continue
            exact_gains(shrunk, step, y[n], x[n], images, cap, domain, gains, slopes)
            count[i] = keep(gains.max(), place, slack[i], records[i], places[i], count[i])

    @kernel
    def rank(which, y, x, shrunk, step, blocks, sources, cap, gains, slopes, levels):
        """gains[n, k], slopes[n, k]: energy explained and σ of range which[n], ascending, by the
        domain at (y[n], x[n]) under isometry k; levels[n]: the domain's mean. In float64."""
        domain = np.empty(pixels)
        images = np.empty((pixels, 8))
        before = -1
        for n in range(which.size):
            i = which[n]
            if i != before:
                turned(blocks[i], sources, images)
                before = i
            levels[n] = exact_gains(
                shrunk, step, y[n], x[n], images, cap, domain, gains[n], slopes[n]
            )

    @kernel
    def resolve(shrunk, step, y, x, blocks, sources, cap, least, iso, slope, level):
        """For each block and the domain at (y, x): the lowest isometry that explains at least
        least[i], its σ, and the domain's mean."""
        domain = np.empty(pixels)
        gains, slopes = np.empty(8), np.empty(8)
        images = np.empty((pixels, 8))
        for i in range(blocks.shape[0]):
            turned(blocks[i], sources, images)
            level[i] = exact_gains(shrunk, step, y[i], x[i], images, cap, domain, gains, slopes)
            enough = min(least[i], gains.max())
            for k in range(8):
                if gains[k] >= enough:
                    iso[i], slope[i] = k, slopes[k]
                    break

    return settle, rank, resolve
