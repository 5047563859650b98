"""Compiled loops of pairing: arrays in, arrays out. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel

#: Sizes of a group of range blocks and of a chunk of pixels: the compiler must know both to make
#: vector code.
LANES, CHUNK = 32, 16


@kernel
def block_traits(blocks, traits):
    """traits[i] = B · mean of blocks[i] (B² pixels), and the norm of the zero-mean block."""
    count, pixels = blocks.shape
    for i in range(count):
        mean = energy = 0.0
        for k in range(pixels):
            mean += blocks[i, k]
        mean /= pixels
        for k in range(pixels):
            energy += (blocks[i, k] - mean) ** 2
        traits[i, 0], traits[i, 1] = mean * np.sqrt(pixels), np.sqrt(energy)


@kernel
def block_gaps(image, group, gaps):
    """gaps[t] = Σ (group[k · LANES + t] − image[k])², squared distances of ``image`` to the blocks
    of a ``group`` (pixels · LANES,); pixels are a multiple of CHUNK."""
    for t in range(LANES):
        gaps[t] = 0
    for start in range(0, image.size, CHUNK):
        for t in range(LANES):
            total = gaps[t]
            for k in range(CHUNK):
                gap = group[np.uintp((start + k) * LANES + t)] - image[np.uintp(start + k)]
                total += gap * gap
            gaps[t] = total


@kernel
def least_gap(images, group, gaps, least):
    """Find the least of the `block_gaps` of all ``images``; overwrites ``gaps`` and ``least``."""
    block_gaps(images[0], group, least)
    for s in range(1, images.shape[0]):
        block_gaps(images[s], group, gaps)
        for t in range(LANES):
            least[t] = gaps[t] if gaps[t] < least[t] else least[t]
    for t in range(16):  # by halves: vector code
        least[t] = least[t] if least[t] < least[t + 16] else least[t + 16]
    for t in range(8):
        least[t] = least[t] if least[t] < least[t + 8] else least[t + 8]
    a, b = min(least[0], least[4]), min(least[1], least[5])
    c, d = min(least[2], least[6]), min(least[3], least[7])
    return min(min(a, b), min(c, d))


@kernel
def alike_blocks(
    blocks, here, traits, flat, flat_here, groups, members, corners, sources, slack, keys, count
):
    """keys[i, : count[i]] = the blocks, under one of the isometries ``sources``, whose distance
    to blocks[i] exceeds the least by at most ``slack``: 8 · index + isometry of each, −8 +
    isometry of the block at the same place, of index here[i]. Beyond the room, the lowest keys
    stay; in no order.

    count[i] = 0 where flat[i], the squared distance to the closest flat block, is below all
    others; if it equals the least, flat_here[i] decides. Arguments ``groups``, ``members`` and
    ``corners`` are as from `_group_blocks`: no block of a group is closer than its rectangle of
    traits.
    """
    images = np.zeros((sources.shape[0], groups.shape[1] // LANES), np.float32)
    gaps, least_of = np.empty(LANES, np.float32), np.empty(LANES, np.float32)
    bounds, near = np.empty((2, groups.shape[0]), np.float32)
    todo = np.empty(groups.shape[0], np.int64)
    for i in range(blocks.shape[0]):
        count[i] = 0
        if flat[i] == 0 and flat_here[i]:  # no other block can be closer
            continue
        for s in range(sources.shape[0]):
            for k in range(sources.shape[1]):
                images[s, sources[s, k]] = blocks[i, k]
        u, v = traits[i]
        for g in range(np.uintp(bounds.size)):
            du = max(corners[0, g] - u, u - corners[1, g], np.float32(0))
            dv = max(corners[2, g] - v, v - corners[3, g], np.float32(0))
            bounds[g] = du * du + dv * dv
        g, left = np.argmin(bounds), 0
        if bounds[g] > flat[i]:
            continue
        least = bounds[g] = least_gap(images, groups[g], gaps, least_of)
        for h in range(bounds.size):
            todo[left], near[left] = h, bounds[h]
            left += h != g and bounds[h] <= min(least, flat[i])
        while left > 0:  # the likeliest group first, until no other can contain a closer block
            k = 0
            for m in range(1, left):
                k = m if near[m] < near[k] else k
            if near[k] > min(least, flat[i]):
                break
            g = todo[k]
            bounds[g] = least_gap(images, groups[g], gaps, least_of)
            least = min(least, bounds[g])
            left -= 1
            todo[k], near[k] = todo[left], near[left]
        if flat[i] < least or (flat[i] == least and flat_here[i]):
            continue
        limit, last = max(least, (np.sqrt(least) + slack) ** 2), 0
        for g in range(bounds.size):
            if bounds[g] > limit:
                continue
            for s in range(images.shape[0]):
                block_gaps(images[s], groups[g], gaps)
                for t in range(LANES):
                    if gaps[t] > limit or members[g, t] < 0:
                        continue
                    key = 8 * (members[g, t] if members[g, t] != here[i] else -1) + s
                    if count[i] < keys.shape[1]:
                        keys[i, count[i]] = key
                        count[i] += 1
                    elif key < keys[i, last]:
                        keys[i, last] = key
                    else:
                        continue
                    last = np.argmax(keys[i, : count[i]])


@kernel
def square_costs(phases, patch, weight, costs):
    """costs[i, j] += Σ weight · (map − patch)² for squares of a map that begin at cell (i, j).

    phases[y, x, i, j] = map[i · cell + y, j · cell + x]; ``patch`` and ``weight`` (S, S) are as
    large as a square, S a multiple of the cell's side.
    """
    cell = phases.shape[0]
    for y in range(patch.shape[0]):
        for x in range(patch.shape[1]):
            w, height = weight[y, x], patch[y, x]
            if w == 0:
                continue
            plane, down, right = phases[y % cell, x % cell], y // cell, x // cell
            for i in range(costs.shape[0]):
                for j in range(costs.shape[1]):
                    gap = plane[i + down, j + right] - height
                    costs[i, j] += w * (gap * gap)
