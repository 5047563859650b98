"""Compiled loops of coding: arrays in, arrays out. Slow twins stand in tests/naive.py."""

from functools import cache

import numpy as np

from evocity.accelerate import kernel


@kernel
def box_means(heights, tall, wide, means):
    """means[y, x] = mean of heights[y : y + tall, x : x + wide], wherever that fits."""
    rows, columns = heights.shape
    scale = heights.dtype.type(1.0 / (tall * wide))
    sums = np.empty(columns, heights.dtype)
    for y in range(rows - tall + 1):
        for x in range(columns):
            sums[x] = heights[y, x]
        for i in range(1, tall):
            for x in range(columns):
                sums[x] += heights[y + i, x]
        fits = columns - wide + 1
        for x in range(fits):
            means[y, x] = sums[x]
        for j in range(1, wide):
            for x in range(fits):
                means[y, x] += sums[x + j]
        for x in range(fits):
            means[y, x] *= scale


@kernel
def gather_table(top, left, y, x, tall, wide, layer, iso, sources, size, table):
    """table[py, px] = flat index, into the stack of box-mean layers, of the value that pixel
    (py, px) is made from; -1 where its lifs has no domain (layer < 0).

    ``size`` is the range block's side, ``tall`` and ``wide`` the pixels averaged into one.
    """
    rows, columns = table.shape
    for i in range(top.size):
        for t in range(size * size):
            py, px = top[i] + t // size, left[i] + t % size
            if layer[i] < 0:
                table[py, px] = -1
            else:
                s = sources[iso[i], t]
                sy, sx = y[i] + tall[i] * (s // size), x[i] + wide[i] * (s % size)
                table[py, px] = (layer[i] * rows + sy) * columns + sx


@kernel
def gather(layers, table, sigma, beta, target):
    """One step of the collage map W: every pixel from its place in the flat ``layers``."""
    for p in range(table.size):
        target[p] = sigma[p] * layers[max(table[p], 0)] + beta[p]


@kernel
def scatter(values, table, sigma, layers):
    """Adjoint of `gather` without β: each pixel's share of the flat ``values`` goes back to the
    place in the flat ``layers``, which are overwritten, that the pixel was made from."""
    layers[:] = 0
    for p in range(table.size):
        if table[p] >= 0:
            layers[table[p]] += sigma[p] * values[p]


@kernel
def spread_means(means, tall, wide, heights):
    """Adjoint of `box_means`: heights[y : y + tall, x : x + wide] += means[y, x] / (tall · wide),
    wherever that fits."""
    rows, columns = heights.shape
    scale = heights.dtype.type(1.0 / (tall * wide))
    line = np.empty(columns, heights.dtype)
    fits = columns - wide + 1
    for y in range(rows - tall + 1):
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
    """Lay each domain block at (y, x), shrunk to ``size`` × ``size`` by means of ``tall`` ×
    ``wide`` pixels, at its range block's place (top, left) in ``layer``."""
    for k in range(top.size):
        scale = heights.dtype.type(1.0 / (tall[k] * wide[k]))
        for i in range(size):
            for j in range(size):
                total = heights.dtype.type(0)
                for v in range(y[k] + i * tall[k], y[k] + (i + 1) * tall[k]):
                    for u in range(x[k] + j * wide[k], x[k] + (j + 1) * wide[k]):
                        total += heights[v, u]
                layer[top[k] + i, left[k] + j] = scale * total


@kernel
def spread_blocks(layer, top, left, y, x, tall, wide, size, heights):
    """Adjoint of `shrink_blocks`: adds to ``heights``."""
    for k in range(top.size):
        scale = heights.dtype.type(1.0 / (tall[k] * wide[k]))
        for i in range(size):
            for j in range(size):
                value = scale * layer[top[k] + i, left[k] + j]
                for v in range(y[k] + i * tall[k], y[k] + (i + 1) * tall[k]):
                    for u in range(x[k] + j * wide[k], x[k] + (j + 1) * wide[k]):
                        heights[v, u] += value


@kernel
def mirrored(lines, near, far, even, combined):
    """combined[x] = √½ (near ± far) of two shifted lines, + for even; the line itself if both
    are one (the middle line of an odd block)."""
    half = np.float32(np.sqrt(0.5))
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
def fold(shrunk, step, block, weights, planes, energy):
    """planes[y, :, x], energy[y, x] = D4 coordinates and energy, the mean removed, of the block
    of pixels shrunk[y + step·i, x + step·j]; see evocity.coding.domains for their order.

    ``weights`` (B²,) holds the coordinates of the block of ones. Columns beyond those where a
    block fits are left as they are.
    """
    rows, count = planes.shape[0], planes.shape[1]
    width = shrunk.shape[1]
    columns = width - step * (block - 1)
    evens = (block + 1) // 2
    down = np.empty((block, width), np.float32)
    full = np.empty((block, block, columns), np.float32)
    mean = np.empty(columns, np.float32)
    half = np.float32(np.sqrt(0.5))
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
                        planes[y, k, :columns] = full[a, a]
                        k += 1
                    for b in range(a + 1, last):
                        one, two = full[a, b], full[b, a]
                        for x in range(columns):
                            planes[y, k, x] = half * (one[x] + sign * two[x])
                        k += 1
        for swap in (False, True):
            for a in range(evens):
                for b in range(evens, block):
                    planes[y, k, :columns] = full[b, a] if swap else full[a, b]
                    k += 1
        mean[:] = 0
        for k in range(count):
            if weights[k] != 0:
                for x in range(columns):
                    mean[x] += weights[k] * planes[y, k, x]
        scale = np.float32(1.0 / count)
        energy[y, :columns] = 0
        for k in range(count):
            line = planes[y, k]
            shift = weights[k] * scale
            for x in range(columns):
                line[x] -= shift * mean[x]
                energy[y, x] += line[x] * line[x]


@cache
def correlators(block):
    """The kernels of the search for range blocks of side ``block``: lane_maxima, and the pair
    (settle, resolve) that decides near-ties.

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
    pixels = block * block

    # "contract" (a·b + c in one rounding) keeps each position's result independent of the
    # others, so of threads and chunks; what depends on rounding is settled in float64 below.
    @kernel(fastmath={"contract"})
    def row_gains(planes, energy, inverse, code, first, count, cap, gains):
        """gains[j] = max(itself, the energy of block ``code`` explained by the domain at position
        first + j of one row under the best of the 8 isometries, |σ| ≤ cap). In D4 coordinates
        (see evocity.coding.domains) all eight inner products come from 1.5 B² multiplications.
        """
        for j in range(count):
            q = np.uintp(first + j)  # unsigned: no test for negative indices, so vector code
            s1 = s2 = s3 = s4 = a = b = c = d = np.float32(0)
            for k in range(n1):
                s1 += code[k] * planes[k, q]
            for k in range(n1, n2):
                s2 += code[k] * planes[k, q]
            for k in range(n2, n3):
                s3 += code[k] * planes[k, q]
            for k in range(n3, n4):
                s4 += code[k] * planes[k, q]
            for k in range(nu):
                u, w = planes[n4 + k, q], planes[n5 + k, q]
                a += code[n4 + k] * u
                b += code[n5 + k] * w
                c += code[n4 + k] * w
                d += code[n5 + k] * u
            p = max(
                max(abs(s1 + s2 + (s3 + s4)) + abs(a + b), abs(s1 + s2 - (s3 + s4)) + abs(a - b)),
                max(abs(s1 - s2 + (s3 - s4)) + abs(c + d), abs(s1 - s2 - (s3 - s4)) + abs(c - d)),
            )
            s = min(p * inverse[q], cap)
            gains[j] = max(gains[j], s * (p + p - s * energy[q]))

    @kernel
    def lane_maxima(planes, energy, inverse, codes, window, cap, best):
        """best[i, j] = largest gain of range i over the domains in column window.left + j.

        ``window`` holds (top, bottom, left, right) of each range's domain positions. Rows of
        domains are walked outside, ranges inside, so that a row stays in the cache.
        """
        top, bottom = window[:, 0].min(), window[:, 1].max()
        for y in range(top, bottom):
            for i in range(codes.shape[0]):
                if window[i, 0] <= y < window[i, 1]:
                    left, right = window[i, 2], window[i, 3]
                    row_gains(
                        planes[y], energy[y], inverse[y], codes[i], left, right - left, cap, best[i]
                    )

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
    def settle(
        planes, energy, inverse, codes, window, cap, best, first_row, band, near,
        shrunk, step, blocks, sources, top, records, places, count, slack, group,
    ):  # fmt: skip
        """Re-score in float64, in order of (y, x), the domains whose float32 gain is at least
        near[i], and keep those that explain more than all before them.

        ``best`` (bands, n, lanes) holds maxima over ``band`` rows from ``first_row`` on: only
        where these reach near[i] are positions looked at again. records[i, :count[i]] are the
        gains kept, places[i] their (multiple, y, x); ``top`` is the map row of planes[0]. A
        full list drops what lies more than slack[i] below its last, which cannot win. Positions
        are looked at in groups of ``group``; the arrays are padded by one.
        """
        domain = np.empty(pixels)
        gains, slopes = np.empty(8), np.empty(8)
        lanes = np.empty(best.shape[2] + group, np.float32)
        runs = np.empty((best.shape[2] // group + 1, 2), np.int64)
        images = np.empty((pixels, 8))
        room = records.shape[1]
        for i in range(codes.shape[0]):
            turned(blocks[i], sources, images)
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
                        row_gains(planes[y], energy[y], inverse[y], codes[i], x, length, cap, lanes)
                        for j in range(min(length, right - x)):
                            if lanes[j] < near[i]:
                                continue
                            exact_gains(
                                shrunk, step, top + y, x + j, images, cap, domain, gains, slopes
                            )
                            gain = gains.max()
                            n = count[i]
                            if n > 0 and gain <= records[i, n - 1]:
                                continue
                            if n == room:
                                n = 0
                                for k in range(room):
                                    if records[i, k] >= gain - slack[i]:
                                        records[i, n] = records[i, k]
                                        places[i, n] = places[i, k]
                                        n += 1
                                n = min(n, room - 1)
                            records[i, n] = gain
                            places[i, n, 0] = step
                            places[i, n, 1], places[i, n, 2] = top + y, x + j
                            count[i] = n + 1

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
            for k in range(8):
                if gains[k] >= least[i]:
                    iso[i], slope[i] = k, slopes[k]
                    break

    return lane_maxima, (settle, resolve)
