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
    """The two search kernels for range blocks of side ``block``.

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
        """gains[j] = energy explained by the domain at position first + j under the best of
        the 8 isometries, |σ| ≤ cap. In D4 coordinates (see evocity.coding.domains) all eight
        inner products come from 1.5 B² multiplications."""
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
    def exact_gains(shrunk, step, y, x, range_block, sources, cap, domain, gains, slopes):
        """gains[k], slopes[k]: energy explained and σ with isometry k, in float64; returns the
        domain's mean."""
        mean = 0.0
        for t in range(pixels):
            domain[t] = shrunk[y + step * (t // block), x + step * (t % block)]
            mean += domain[t]
        mean /= pixels
        energy = 0.0
        for t in range(pixels):
            domain[t] -= mean
            energy += domain[t] * domain[t]
        for k in range(8):
            p = 0.0
            for t in range(pixels):
                p += range_block[t] * domain[sources[k, t]]
            s = min(abs(p) / energy, cap) if energy > 0 else 0.0
            gains[k] = s * (2 * abs(p) - s * energy)
            slopes[k] = s if p >= 0 else -s
        return mean

    @kernel
    def settle(
        planes, energy, inverse, codes, window, cap, best, near,
        shrunk, step, blocks, sources, least, first, found, slope, level,
    ):  # fmt: skip
        """Re-score in float64 all domains whose float32 gain is at least near[i].

        With ``first`` false: raise least[i] to the largest exact gain. With it true: write to
        found[i] the lowest (y, x, iso) whose exact gain is at least least[i], and its σ and
        the domain's mean; a range with found[i, 0] ≥ 0 already is left alone.
        """
        domain = np.empty(pixels)
        gains, slopes = np.empty(8), np.empty(8)
        lanes = np.empty(best.shape[1], np.float32)
        for i in range(codes.shape[0]):
            if first and found[i, 0] >= 0:
                continue
            top, bottom, left, right = window[i]
            for y in range(top, bottom):
                start = left
                while start < right:
                    if best[i, start - left] < near[i]:
                        start += 1
                        continue
                    stop = start
                    while stop < right and best[i, stop - left] >= near[i]:
                        stop += 1
                    lanes[: stop - start] = 0
                    row_gains(
                        planes[y], energy[y], inverse[y], codes[i], start, stop - start, cap, lanes
                    )
                    for j in range(stop - start):
                        if lanes[j] < near[i]:
                            continue
                        mean = exact_gains(
                            shrunk,
                            step,
                            y,
                            start + j,
                            blocks[i],
                            sources,
                            cap,
                            domain,
                            gains,
                            slopes,
                        )
                        for k in range(8):
                            if not first:
                                least[i] = max(least[i], gains[k])
                            elif gains[k] >= least[i]:
                                found[i, 0], found[i, 1], found[i, 2] = y, start + j, k
                                slope[i], level[i] = slopes[k], mean
                                break
                        if first and found[i, 0] >= 0:
                            break
                    start = stop
                    if first and found[i, 0] >= 0:
                        break
                if first and found[i, 0] >= 0:
                    break

    return lane_maxima, settle
