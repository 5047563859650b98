"""Compiled decisions in float64: arrays in, arrays out. Tests compare the results with an
exhaustive search in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def turned(range_block, sources, images):
    """images[u, k] = the pixel of the range block that meets pixel u of a domain block
    under isometry k, so ⟨r, iso_k d⟩ = Σ_u images[u, k] d[u], all eight in one pass."""
    for k in range(8):
        for t in range(range_block.size):
            images[np.uintp(sources[k, t]), k] = range_block[t]


@kernel
def exact_gains(shrunk, step, y, x, block, images, cap, domain, gains, slopes):
    """gains[k], slopes[k]: energy explained and σ with isometry k, in float64; returns the
    domain's mean."""
    mean = 0.0
    for i in range(block):
        line = shrunk[np.uintp(y + step * i)]
        for j in range(block):
            value = line[np.uintp(x + step * j)]
            domain[np.uintp(block * i + j)] = value
            mean += value
    mean /= domain.size
    energy = 0.0
    p0 = p1 = p2 = p3 = p4 = p5 = p6 = p7 = 0.0  # in registers, not in an array
    for t in range(domain.size):
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
def closest(records, places):
    """Find the entry of ``records``, which rise with their ``places``, that exceeds the entry
    before it by least; never the highest, which decides what is near enough."""
    best, found, least = 0, -1, np.inf
    for k in range(1, records.size):
        if records[k] > records[best]:
            best = k
    for k in range(records.size):
        before = -np.inf
        for other in range(records.size):
            if places[other] < places[k]:
                before = max(before, records[other])
        if k != best and records[k] - before < least:
            found, least = k, records[k] - before
    return found


@kernel
def keep(gain, place, slack, records, places, count):
    """Note a domain block at ``place`` unless an earlier one explains as much; drop later ones
    that explain no more, and those more than ``slack`` below the best. Returns the number of used
    ``records`` and ``places``."""
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
    if kept == records.size:  # drop an entry that hardly differs from the one before it
        kept -= 1
        gone = closest(records, places)
        records[gone], places[gone] = records[kept], places[kept]
    records[kept], places[kept] = gain, place
    return kept + 1


@kernel
def settle(which, y, x, shrunk, step, block, blocks, sources, cap, slack, records, places, count):
    """Score for range which[n], ascending, the domain at (y[n], x[n]) in float64 and `keep` it
    where it may be the best. After one that explains everything, no later one can win."""
    pixels = block * block
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
        exact_gains(shrunk, step, y[n], x[n], block, images, cap, domain, gains, slopes)
        gain = gains[0]
        for k in range(1, 8):
            gain = max(gain, gains[k])
        count[i] = keep(gain, place, slack[i], records[i], places[i], count[i])


@kernel
def rank(which, y, x, shrunk, step, block, blocks, sources, cap, gains, slopes, levels):
    """gains[n, k], slopes[n, k]: energy explained and σ of range which[n], ascending, by the
    domain at (y[n], x[n]) under isometry k; levels[n]: the domain's mean. In float64."""
    pixels = block * block
    domain = np.empty(pixels)
    images = np.empty((pixels, 8))
    before = -1
    for n in range(which.size):
        i = which[n]
        if i != before:
            turned(blocks[i], sources, images)
            before = i
        levels[n] = exact_gains(
            shrunk, step, y[n], x[n], block, images, cap, domain, gains[n], slopes[n]
        )


@kernel
def conclude(
    records, places, count, energy, tie, shrunk, step, block, blocks, sources, cap, means, of,
    turns, sign, lowest, composition, inverse, multiple, tops, lefts, isos, sigma, beta, gain,
):  # fmt: skip
    """Conclude a search in a single pool, for shapes and the blocks that they stand for.

    records, places, count, energy : as of `Search`, with the share ``tie`` of the energy. blocks :
    the shapes, zero-mean. means, of, turns, sign : of each block its mean, its shape, and the
    isometry and sign that turn the shape into it. lowest, composition, inverse : tables of
    `evocity.isometries`. The other arrays get the fields of `Matches`, but the energy.
    """
    pixels, number = block * block, energy.size
    domain, images = np.empty(pixels), np.empty((pixels, 8))
    gains, slopes, levels = np.zeros((number, 8)), np.zeros((number, 8)), np.zeros(number)
    enough, found = np.zeros(number, np.int64), np.zeros(number, np.int64)
    for i in range(number):
        most = 0.0
        for k in range(count[i]):
            most = max(most, records[i, k])
        slack = tie * energy[i]
        least = most - slack
        place = np.int64(-1)
        for k in range(count[i]):
            if records[i, k] >= max(least, slack) and (place < 0 or places[i, k] < place):
                place = places[i, k]
        found[i] = place
        if place >= 0:
            y, x = place >> 21 & 0x1FFFFF, place & 0x1FFFFF
            turned(blocks[i], sources, images)
            levels[i] = exact_gains(
                shrunk, step, y, x, block, images, cap, domain, gains[i], slopes[i]
            )
        highest = gains[i].max()
        for k in range(8):
            enough[i] |= np.int64(gains[i, k] >= min(least, highest)) << k
    for b in range(of.size):
        i = of[b]
        # of equal isometries, the lowest after turning the shape to the block
        iso = lowest[turns[b], enough[i]]
        own = composition[inverse[turns[b]], iso]
        matched = found[i] >= 0
        place = found[i] if matched else 0
        multiple[b], tops[b], lefts[b] = place >> 42, place >> 21 & 0x1FFFFF, place & 0x1FFFFF
        isos[b] = iso
        sigma[b] = sign[b] * slopes[i, own] if matched else 0.0
        gain[b] = gains[i, own] if matched else 0.0
        beta[b] = means[b] - sigma[b] * levels[i]
