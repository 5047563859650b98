"""Compiled D4 coordinates of blocks (see evocity.coding.matching.d4), by rows of a map and at any
place. Arrays in, arrays out. Slow twins stand in tests/naive.py."""

from functools import cache

import numpy as np

from evocity.accelerate import kernel
from evocity.accelerate.vectors import WIDTH, vector_code
from evocity.coding.matching.d4 import (
    d4_mark,
    d4_ones,
    d4_slots,
    lowest,
    part_sizes,
    used_parts,
)

#: Larger blocks are folded in loops: written out, they would take the compiler minutes.
UNROLLED = 16


@kernel
def coordinates(lines, y, down, across, slots, weights, mixed, folded, mean):
    """folded[:, x] = D4 coordinates, without the mean, of the block of pixels lines[y + down·i, x +
    across·j]. ``slots`` (B, B) is `d4_slots`, ``weights`` (B²,) are the coordinates of the block of
    ones. The others are working arrays, of the type of ``lines``, as wide as it is (B rows of
    ``mixed``) or as ``folded``. Each step splits two lines into √½ (sum, difference)."""
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
    """planes[y, :, x], norms[y, x] = D4 coordinates, of unit norm, and norm, without the mean, of
    the block of pixels shrunk[y + step·i, x + step·j]. Both are 0 where the energy (squared norm)
    is at most ``least``. ``slots`` and ``weights`` are those of `coordinates`. Columns where no
    block fits stay. Sums have the type of ``shrunk``."""
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


def _folded(v, block, stones):
    """Fold `WIDTH` adjacent blocks, of pixels ``stones`` (B², WIDTH): returns a function that gives
    the pointer to their k-th coordinate, without the mean."""
    written_out, even = block <= UNROLLED, (block + 1) // 2
    half, each = v.constant(np.sqrt(0.5)), lambda count: v.each(count, written_out)
    # registers hold what fits
    grid, source = v.room(block * block) if written_out else stones.start, stones.start

    def place(pointer, k):
        return v.after(pointer, v.times(k, v.width))

    def halves(one, two):
        return v.mul(half, v.add(one, two)), v.mul(half, v.sub(one, two))

    def split(line):
        """Multiply it by the even functions, then by the odd."""
        pairs = [halves(line[i], line[block - 1 - i]) for i in range(block // 2)]
        middle = line[even - 1 : even] if block % 2 else []
        return [one for one, _ in pairs] + middle + [two for _, two in pairs]

    for j in each(block):
        column = [v.plus(i * block, j) for i in range(block)]
        split_line = split([v.load(place(source, k)) for k in column])
        for k, one in zip(column, split_line, strict=True):
            v.store(one, place(grid, k))
    for i in each(block):
        row = [v.plus(v.times(i, block), j) for j in range(block)]
        split_line = split([v.load(place(grid, k)) for k in row])
        for k, one in zip(row, split_line, strict=True):
            v.store(one, place(grid, k))
    pairs = [
        (a * block + b, b * block + a)
        for a in range(block)
        for b in range(a + 1, even if a < even else block)
    ]
    upper, lower = np.array(pairs, np.int64).reshape(-1, 2).T
    for n in each(len(pairs)):
        one, two = (place(grid, v.pick(column, n)) for column in (upper, lower))
        for pointer, value in zip((one, two), halves(v.load(one), v.load(two)), strict=True):
            v.store(value, pointer)
    places = np.argsort(d4_slots(block).ravel())

    def coordinate(k):
        return place(grid, v.pick(places, k))

    ones, count = d4_ones(block), part_sizes(block)[0]
    mean = v.variable(v.zero)
    for k in each(count):
        share = v.pick(ones / block**2, k)
        v.builder.store(v.plus_product(v.builder.load(mean), share, v.load(coordinate(k))), mean)
    mean = v.builder.load(mean)
    for k in each(count):
        left = v.plus_product(v.load(coordinate(k)), v.pick(-ones, k), mean)
        v.store(left, coordinate(k))
    return coordinate


def _part_energies(v, block, coordinate):
    """Compute squared norms of `WIDTH` blocks after `_folded`: of the whole, and of each part along
    its lowest frequency and across it, as `used_parts` lists; u and w count as one part. The rest
    is a difference, rounded up, since rounding grows with the block."""
    sizes, used, start = part_sizes(block), used_parts(block), 0
    everything, parts = v.zero, []
    margin = 1e-6 if block <= UNROLLED else 4e-6 * (block / UNROLLED) ** 2

    def summed(first, size, across):
        along = v.variable(v.zero)
        for n in v.each(size, block <= UNROLLED):
            value = v.load(coordinate(v.plus(first, n)))
            weight = v.pick(lowest(block)[start : start + size], n)
            for total, other in ((along, weight), (across, value)):
                v.builder.store(v.plus_product(v.builder.load(total), other, value), total)
        return v.mul(v.builder.load(along), v.builder.load(along))

    for part, size in enumerate(sizes):
        across = v.variable(v.zero)
        along = summed(start, size, across)
        if part == len(sizes) - 1:
            along = v.add(along, summed(start + size, size, across))
        across = v.builder.load(across)
        everything = v.add(everything, across)
        rest = v.larger(v.sub(across, along), v.zero)
        rest = v.plus_product(rest, v.constant(margin), across)
        parts += [one for k, one in ((0, along), (1, rest)) if 2 * part + k in used]
        start += size
    return everything, parts


@vector_code("none", known=2)
def measure(v, block, _mark, stones, least, n, norms, shares):
    """norms[n : n + WIDTH] = ‖d̃‖ of the blocks of pixels ``stones`` (B², WIDTH), and
    shares[:, n : n + WIDTH] = norms of their parts over that; 0 where ‖d̃‖² is at most ``least``.
    The compiler knows ``block`` and the mark of its tables."""
    energy, parts = _part_energies(v, block, _folded(v, block, stones))
    unit = _over_energy(v, energy, least)
    v.store(v.mul(energy, v.root(unit)), norms.at(n))
    for f, part in enumerate(parts):
        v.store(v.root(v.mul(part, unit)), shares.at(v.number(f), n))


@vector_code("none", known=2)
def lay(v, block, _mark, stones, least, cap, t, lane, planes, ceilings, shares, tops, peaks):
    """Lay the blocks of pixels ``stones`` (B², WIDTH) into tile t from ``lane`` on, see
    `lay_tiles`. The compiler knows ``block`` and the mark of its tables."""
    coordinate = _folded(v, block, stones)
    energy, parts = _part_energies(v, block, coordinate)
    squared = _over_energy(v, energy, least)
    unit = v.root(squared)
    line, step = v.after(planes.at(t), lane), planes.steps[1]
    for k in v.each(block * block, block <= UNROLLED):
        v.store(v.mul(unit, v.load(coordinate(k))), v.after(line, v.times(step, k)))
    ceiling = v.mul(v.spread(cap), v.mul(energy, unit))
    v.store(ceiling, v.after(ceilings.at(t), lane))
    v.raise_to(tops.at(t), ceiling)
    for f, part in enumerate(parts):
        share = v.root(v.mul(part, squared))
        v.store(share, v.after(shares.at(t, v.number(f)), lane))
        v.raise_to(v.after(peaks.at(t), f), share)


def _over_energy(v, energy, least):
    """1 / energy, 0 where that is at most ``least``."""
    busy = v.exceeds(energy, v.spread(least))
    return v.where(busy, v.over(v.constant(1), energy), v.zero)


@kernel
def _gather(pixels, offsets, at, start, stones):
    """stones[:, n] = the pixels of block ``start`` + n above its first, since heights may far
    exceed their differences. Beyond the last block the ground is level."""
    left = min(at.size - start, WIDTH)
    for n in range(left):
        first = np.uintp(at[start + n])
        base = pixels[first]
        for k in range(offsets.size):
            stones[k, n] = pixels[first + offsets[k]] - base
    if left < WIDTH:
        stones[:, left:] = 0


@cache
def fold_kernels(block):
    """Make the kernels that fold blocks of side ``block`` at any place: measure_blocks, lay_tiles.
    The n-th block's first pixel is pixels[at[n]], others are ``offsets`` (B²,) further."""
    mark = d4_mark(block)

    @kernel
    def measure_blocks(pixels, offsets, at, least, norms, shares):
        """norms[n] = ‖d̃‖ of block n, and shares[:, n] = norms of its parts over that (see
        evocity.coding.matching.d4); 0 where ‖d̃‖² is at most ``least``. Both have the length of
        whole vectors."""
        stones = np.empty((block * block, WIDTH), np.float32)
        for n in range(0, at.size, WIDTH):
            _gather(pixels, offsets, at, n, stones)
            measure(block, mark, stones, least, n, norms, shares)

    @kernel
    def lay_tiles(pixels, offsets, at, least, cap, planes, ceilings, shares, tops, peaks):
        """Lay blocks in tiles, in the order of ``at``, see evocity.coding.matching.tiles. Empty
        lanes become 0; ``tops`` and ``peaks`` are 0 before."""
        stones = np.empty((block * block, WIDTH), np.float32)
        lanes = ceilings.shape[1]
        for n in range(0, ceilings.size, WIDTH):
            if n < at.size:
                _gather(pixels, offsets, at, n, stones)
            else:
                stones[:] = 0
            t, lane = n // lanes, n % lanes
            lay(block, mark, stones, least, cap, t, lane, planes, ceilings, shares, tops, peaks)

    return measure_blocks, lay_tiles
