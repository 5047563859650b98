"""Compiled comparison of range blocks with domain blocks, in tiles and in windows: arrays in,
arrays out. Tests compare the results with an exhaustive search in tests/naive.py.

The gain of one range block from many adjacent domain blocks takes most of the time, so it is vector
code. All callees of kernels stand in this file, since the disk cache notices its changes only.
"""

from functools import cache
from itertools import pairwise

import numpy as np

from evocity.accelerate import kernel
from evocity.accelerate.vectors import ABREAST, WIDTH, vector_code

#: Domain positions in a tile; also the padding of pools.
LANES = 32
#: Tiles in a row: a search begins with whole rows.
ROW = 8
#: Columns of a window compared in one go, at most `LANES`.
GROUP = 16
#: Range blocks handled together where their windows overlap.
NEIGHBOURS = 8
#: Rows of domain blocks after which a search looks whether it has found enough.
LOOKS = 3
#: Sums over the coordinates of larger blocks are loops of `RUN` products.
UNROLLED, RUN = 16, 8
#: Initial room for tiles, of all range blocks of a batch.
ROOM = 1 << 14


def _parts(block):
    """List begins and ends of the parts s1, s2, s3, s4, u, w of blocks of side ``block``."""
    even, odd = (block + 1) // 2, block // 2
    sizes = [half * (half + sign) // 2 for half in (even, odd) for sign in (1, -1)]
    ends = np.cumsum([0, *sizes, even * odd, even * odd]).tolist()
    return list(pairwise(ends))


def _gain(v, p, limit):
    """s(2p − s) with s = min(p, limit)."""
    s = v.smaller(p, limit)
    return v.mul(s, v.sub(v.add(p, p), s))


def _gains(v, block, abreast, code, planes, place, norms, cap=None):
    """Compute gains, see `raise_gains`, from ``abreast`` adjacent vectors of domain positions, from
    ``place`` on: a list of vectors. ``norms`` points at the norm of the first."""
    beside = range(abreast)
    *squares, (u, u_end), (w, _) = _parts(block)
    first, step = planes.at(*place), planes.steps[1]

    def add_products(sums, n, terms):
        """sums[total] += the range block's n-th coordinate from ``one`` on, times the domain
        block's from ``other`` on, for each (total, one, other)."""

        def at(start):
            return v.number(start + n) if isinstance(n, int) else v.plus(n, start)

        ours = {one: v.spread(v.after(code, at(one))) for _, one, _ in terms}
        theirs = {
            other: [v.load(v.after(line, g * v.width)) for g in beside]
            for other, line in {
                t[2]: v.after(first, v.times(step, at(t[2]))) for t in terms
            }.items()
        }
        for total, one, other in terms:
            for g in beside:
                sums[total][g] = v.plus_product(sums[total][g], ours[one], theirs[other][g])

    sums = [[None] * abreast for _ in range(8)]
    crossed = [(4, u, u), (5, w, w), (6, u, w), (7, w, u)]
    if block <= UNROLLED:
        for n in range(max(end - start for start, end in squares)):
            terms = [(k, start, start) for k, (start, end) in enumerate(squares) if start + n < end]
            add_products(sums, n, terms)  # alternates parts, so no sum waits for itself
        for n in range(u_end - u):
            add_products(sums, n, crossed)
    else:
        rows = [(end - start, [(k, start, start)]) for k, (start, end) in enumerate(squares)]
        for count, terms in [*rows, (u_end - u, crossed)]:
            _sum_in_runs(v, sums, count, terms, add_products)
    gains = []
    for g in beside:
        s1, s2, s3, s4, a, b, c, d = (v.zero if one[g] is None else one[g] for one in sums)
        x, y, z, t = v.add(s1, s2), v.add(s3, s4), v.sub(s1, s2), v.sub(s3, s4)
        p = [
            v.add(v.abs(mix(one, two)), v.abs(mix(three, four)))
            for one, two, three, four in ((x, y, a, b), (z, t, c, d))
            for mix in (v.add, v.sub)
        ]
        p = v.larger(v.larger(p[0], p[1]), v.larger(p[2], p[3]))
        limit = v.load(v.after(norms, g * v.width))
        gains.append(_gain(v, p, limit if cap is None else v.mul(v.spread(cap), limit)))
    return gains


def _sum_in_runs(v, sums, count, terms, add_products):
    """Sum ``terms`` over ``count`` coordinates, in runs of `RUN`: sums of a large block, fully
    written out, would take the compiler minutes. Runs also round less."""
    totals = [total for total, *_ in terms]
    abreast = len(sums[0])
    held = {total: [v.variable(v.zero) for _ in range(abreast)] for total in totals}

    def add_run(first, length):
        run = [[None] * abreast for _ in sums]
        for n in range(length):
            add_products(run, v.plus(first, n), terms)
        for total in totals:
            for place, part in zip(held[total], run[total], strict=True):
                v.builder.store(v.add(v.builder.load(place), part), place)

    with v.loop(v.number(count // RUN)) as row:
        add_run(v.times(row, v.number(RUN)), RUN)
    if count % RUN:
        add_run(v.number(count - count % RUN), count % RUN)
    for total in totals:
        sums[total] = [v.builder.load(place) for place in held[total]]


@vector_code("none", known=2)
def raise_gains(v, block, count, planes, y, x, norms, codes, i, cap, gains, line, j):
    """gains[line, j : j + count] = max(themselves, the energies of range block codes[i] explained
    by the unit domain blocks planes[y, :, x : x + count], of norms[y, x : x + count], under the
    best of the 8 isometries, |σ| ≤ cap). In D4 coordinates all eight inner products come from 1.5
    B² multiplications. The compiler knows ``block`` and ``count``, a multiple of `WIDTH`."""
    code, norm, target = codes.at(i), norms.at(y, x), gains.at(line, j)
    for start in range(0, count, ABREAST * WIDTH):
        abreast = min(ABREAST, (count - start) // WIDTH)
        place = (y, v.number(0), v.plus(x, start))
        found = _gains(v, block, abreast, code, planes, place, v.after(norm, start), cap)
        for g, one in enumerate(found):
            pointer = v.after(target, start + g * WIDTH)
            v.store(v.larger(v.load(pointer), one), pointer)


@vector_code("float32", known=1)
def most_gain(v, block, tiles, t, ceilings, codes, i):
    """Find the largest gain, see `raise_gains`, of range block codes[i] from tile t, of
    ``ceilings`` σ_max·‖d̃‖."""
    code, most = codes.at(i), v.zero
    for start in range(0, LANES, ABREAST * WIDTH):
        place = (t, v.number(0), v.number(start))
        limits = v.after(ceilings.at(t), start)
        for one in _gains(v, block, ABREAST, code, tiles, place, limits):
            most = v.larger(most, one)
    return v.largest(most)


@vector_code("int64", known=1)
def hopeful(v, parts, peaks, t, tops, range_shares, norms, near, which):
    """List in ``which`` the range blocks i of whose energy a block of tile t may explain near[i],
    by the bound Σ_f range_shares[i, f]·peaks[t, f], at most norms[i]; returns their number.
    ``range_shares`` (n / WIDTH, F, WIDTH) holds adjacent range blocks."""
    factors = [v.spread(v.after(peaks.at(t), f)) for f in range(parts)]
    top, used = v.spread(tops.at(t)), v.variable(v.number(0))
    with v.loop(range_shares.shape[0]) as row:
        line, total = range_shares.at(row), None
        for f, factor in enumerate(factors):
            total = v.plus_product(total, factor, v.load(v.after(line, f * WIDTH)))
        first = v.times(row, v.number(WIDTH))
        bound = _gain(v, v.smaller(total, v.load(norms.at(first))), top)
        count = v.builder.load(used)
        truths = v.reaches(bound, v.load(near.at(first)))
        more = v.list_lanes(truths, first, which.at(count))
        v.builder.store(v.plus(count, more), used)
    return v.builder.load(used)


@vector_code("int64", known=1)
def promises(v, parts, shares, t, ceilings, range_shares, norms, near, i):
    """Return 1 if a block of tile t may explain near[i] of the energy of range block i, by the
    bounds Σ_f range_shares[i, f]·shares[t, f], at most norms[i]; else 0."""
    ours, norm, enough = range_shares.at(i), v.spread(norms.at(i)), v.spread(near.at(i))
    some = None
    for start in range(0, LANES, WIDTH):
        total = None
        for f in range(parts):
            line = v.load(v.after(shares.at(t, v.number(f)), start))
            total = v.plus_product(total, v.spread(v.after(ours, f)), line)
        bound = _gain(v, v.smaller(total, norm), v.load(v.after(ceilings.at(t), start)))
        truths = v.reaches(bound, enough)
        some = truths if some is None else v.builder.or_(some, truths)
    return v.any(some)


@kernel
def products(blocks, vectors, out):
    """out[i, j] = Σ blocks[i, k] · vectors[k, j], of (n, K) and (K, J). Threads of BLAS would wait
    for each other on a busy machine, and its last bits depend on their number."""
    for i in range(blocks.shape[0]):
        for j in range(vectors.shape[1]):
            out[i, j] = 0
        for k in range(blocks.shape[1]):
            weight = blocks[i, k]
            for j in range(vectors.shape[1]):
                out[i, j] += weight * vectors[k, j]


@kernel
def most_likely(peaks, tops, shares, rows):
    """rows[:, i] = the columns of ``peaks`` (F, T) and ``tops`` (T,) with the largest bounds for
    range block i, of ``shares`` (n, F), whatever its energy."""
    likings = np.empty(tops.size, np.float32)
    for i in range(rows.shape[1]):
        likings[:] = 0
        for f in range(peaks.shape[0]):
            share = shares[i, f]
            for t in range(tops.size):
                likings[t] += share * peaks[f, t]
        for t in range(tops.size):
            p = likings[t]
            s = min(p, tops[t])
            likings[t] = s * (p + p - s)
        for k in range(rows.shape[0]):
            best = np.argmax(likings)
            rows[k, i] = best
            likings[best] = -1


@kernel
def forget(places, gains, used, near):
    """Keep, of the first ``used`` tiles, range blocks ``places`` (2, n) and ``gains`` (n,), those
    with a gain of at least near[range block], moved to the front; returns their number."""
    left = 0
    for n in range(used):
        places[0, left], places[1, left], gains[left] = places[0, n], places[1, n], gains[n]
        left += gains[n] >= near[places[1, n]]
    return left


@cache
def tile_kernels(block, parts):
    """Make the kernels of the search of a whole map, reach_tiles and list_tiles; see
    evocity.coding.matching.tiles. ``parts`` is the number of norms in the bounds."""

    # the outer loop is over tiles, so that a tile stays in the cache for all range blocks
    @kernel
    def reach_tiles(
        tiles, ceilings, shares, peaks, tops, codes, range_shares, norms, slack, first, best,
        start, used, places, gains,
    ):  # fmt: skip
        """best[i] = largest gain of range i in any tile.

        (places[0, n], places[1, n], gains[n]) = tile, range and the largest gain there, where it
        comes within slack[i] of best[i]. The first ``used`` come from the tiles before ``start``.
        Returns the tile where it stopped, without room or at the end, and the number of entries.
        ``first`` lists the rows of tiles to begin with for each range block: a good start excludes
        more.

        It returns no arrays, since Ctrl-C must not interrupt their conversion to Python.
        """
        count, ranges = tops.size, best.size
        beside = np.zeros((-(-ranges // WIDTH), parts, WIDTH), np.float32)
        most = np.zeros(beside.shape[0] * WIDTH, np.float32)
        near = np.full(most.size, np.float32(np.inf))
        which = np.empty(most.size, np.int32)
        for i in range(ranges):
            most[i] = norms[i]
            for f in range(parts):
                beside[i // WIDTH, f, i % WIDTH] = range_shares[i, f]
        order = np.argsort(first, kind="mergesort")  # first rows, sorted
        for n in order:
            i, row = n % ranges, first[n]
            for t in range(row * ROW, min(row * ROW + ROW, count)):
                best[i] = max(best[i], most_gain(block, tiles, t, ceilings, codes, i))
        for i in range(ranges):
            near[i] = best[i] - slack[i]
        for t in range(start, count):
            # lists, not branches, as the remaining range blocks are unpredictable
            found = hopeful(parts, peaks, t, tops, beside, most, near, which)
            left = 0
            for n in range(found):
                i = which[n]
                which[left] = i
                left += promises(parts, shares, t, ceilings, range_shares, norms, near, i)
            if used + left > gains.size:
                used = forget(places, gains, used, near)
                if used + left > gains.size:
                    return t, used
            for n in range(left):
                i = np.uintp(which[n])
                gain = most_gain(block, tiles, t, ceilings, codes, i)
                places[0, used], places[1, used], gains[used] = t, i, gain
                used += gain >= near[i]
                best[i] = max(best[i], gain)
                near[i] = best[i] - slack[i]
        return count, forget(places, gains, used, near)

    @kernel
    def list_tiles(tiles, ceilings, at, codes, tile, ranges, most, near, which, where):
        """List the domain blocks with a gain of at least near[i], in the tiles with such a gain for
        range i (see reach_tiles): where[n], an entry of ``at``, for range which[n], as far as there
        is room. Returns their number."""
        gains = np.empty((1, LANES), np.float32)
        one, count = np.float32(1), 0
        for n in range(most.size):
            t, i = tile[n], ranges[n]
            if most[n] < near[i]:
                continue
            gains[:] = 0
            raise_gains(block, LANES, tiles, t, 0, ceilings, codes, i, one, gains, 0, 0)
            for lane in range(LANES):
                if gains[0, lane] >= near[i]:
                    if count < which.size:
                        which[count], where[count] = i, at[t * LANES + lane]
                    count += 1
        return count

    return reach_tiles, list_tiles


@cache
def window_kernels(block):
    """Make the kernels of the search within reach: lane_maxima, list_windows, most_gains."""

    @kernel
    def lane_maxima(planes, norms, codes, window, cap, band, lanes, best):
        """best[i] = max(itself, the largest gain of range i); lanes[s, i, j], 0 before, becomes the
        largest over the domains in column window.left + j, in the s-th ``band`` of rows from
        window.top on. ``window`` holds (top, bottom, left, right) of each range's domain positions;
        lanes beyond it, which pad the last `GROUP`, become 0 again."""
        gains, count = lanes.reshape(-1, lanes.shape[2]), codes.shape[0]
        for start in range(0, count, NEIGHBOURS):
            end = min(start + NEIGHBOURS, count)
            first, last = window[start, 0], window[start, 1]
            for i in range(start, end):
                first, last = min(first, window[i, 0]), max(last, window[i, 1])
            # the outer loop is over rows, so that a row stays in the cache for neighbours
            for y in range(first, last):
                for i in range(start, end):
                    if y < window[i, 0] or y >= window[i, 1]:
                        continue
                    left, width, j = window[i, 2], window[i, 3] - window[i, 2], 0
                    line = (y - window[i, 0]) // band * count + i
                    while j < width - GROUP:
                        raise_gains(
                            block, LANES, planes, y, left + j,
                            norms, codes, i, cap, gains, line, j,
                        )  # fmt: skip
                        j += LANES
                    if j < width:
                        raise_gains(
                            block, GROUP, planes, y, left + j,
                            norms, codes, i, cap, gains, line, j,
                        )  # fmt: skip
            for i in range(start, end):
                width, most = max(window[i, 3] - window[i, 2], 0), best[i]
                for strip in range(lanes.shape[0]):
                    line = lanes[strip, i]
                    line[width:] = 0
                    for j in range(width):
                        if line[j] > most:
                            most = line[j]
                best[i] = most

    @kernel
    def list_windows(planes, norms, codes, window, cap, best, band, near, which, down, across):
        """List the domain blocks with a gain of at least near[i]: block down[n], across[n] of the
        pool for range which[n], as far as there is room. Returns their number. Only positions where
        ``best`` (bands, n, lanes), maxima over ``band`` rows from each window's top on, attains
        near[i] are compared again, in groups of `GROUP`."""
        gains = np.empty((1, GROUP), np.float32)
        count = 0
        for i in range(codes.shape[0]):
            left, right = window[i, 2], window[i, 3]
            for strip in range(best.shape[0]):
                line, start, x = best[strip, i], window[i, 0] + strip * band, left
                while x < right:
                    if line[x - left] < near[i]:
                        x += 1
                        continue
                    for y in range(start, min(start + band, window[i, 1])):
                        gains[:] = 0
                        raise_gains(block, GROUP, planes, y, x, norms, codes, i, cap, gains, 0, 0)
                        for j in range(min(GROUP, right - x)):
                            if gains[0, j] < near[i]:
                                continue
                            if count < which.size:
                                which[count] = i
                                down[count], across[count] = y, x + j
                            count += 1
                    x += GROUP
        return count

    @kernel
    def most_gains(planes, norms, codes, window, cap, enough, best):
        """best[i] = max(itself, the largest gain of range i in its ``window``, see lane_maxima), or
        some gain of at least enough[i], which ends the search for range i. Rows near the middle
        come first: there lies the continuation of a wall."""
        count, wide = codes.shape[0], 0
        for i in range(count):
            wide = max(wide, window[i, 3] - window[i, 2])
        gains = np.empty((NEIGHBOURS, -(-wide // LANES) * LANES), np.float32)
        for start in range(0, count, NEIGHBOURS):
            end = min(start + NEIGHBOURS, count)
            first, last = window[start, 0], window[start, 1]
            for i in range(start, end):
                first, last = min(first, window[i, 0]), max(last, window[i, 1])
            gains[:] = 0
            steps = 2 * max(last - first, 0)
            for step in range(1, steps + 1):
                y = (first + last) // 2 + (step // 2 if step % 2 else -(step // 2))
                for i in range(start, end):
                    if best[i] >= enough[i] or y < window[i, 0] or y >= window[i, 1]:
                        continue
                    for j in range(0, window[i, 3] - window[i, 2], LANES):
                        raise_gains(
                            block, LANES, planes, y, window[i, 2] + j,
                            norms, codes, i, cap, gains, i - start, j,
                        )  # fmt: skip
                if step % LOOKS and step < steps:
                    continue
                for i in range(start, end):
                    for j in range(window[i, 3] - window[i, 2]):
                        best[i] = max(best[i], gains[i - start, j])

    return lane_maxima, list_windows, most_gains
