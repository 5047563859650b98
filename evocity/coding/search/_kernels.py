"""Compiled loops that compare range blocks with domain blocks, in tiles and in windows: arrays in,
arrays out. Slow twins stand in tests/naive.py."""

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
