"""Compiled hashes of windows, and their table: arrays in, arrays out. Slow twins stand in
tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel

#: Odd multipliers of the two hashes, from the digits of √2 and √3.
ONE, TWO = np.uint64(0x6A09E667F3BCC909), np.uint64(0xBB67AE8584CAA73B)
#: Stands for blocks beyond the map.
BEYOND = np.uint64(0x3C6EF372FE94F82B)


@kernel
def _mixed(value, factor):
    """Mix the bits of a number: every bit of it changes half of the bits of the result."""
    value = (value ^ (value >> np.uint64(32))) * factor
    value = (value ^ (value >> np.uint64(29))) * factor
    return value ^ (value >> np.uint64(32))


@kernel
def hash_blocks(pixels, block, about, blocks):
    """blocks[i, j] gets two hashes of the bits of the ``pixels`` of a block, uint32, and of the
    numbers ``about`` them, uint64."""
    first, second = ONE, TWO
    for n in range(about.size):
        first, second = _mixed(first ^ about[n], ONE), _mixed(second ^ about[n], TWO)
    for i in range(blocks.shape[0]):
        for j in range(blocks.shape[1]):
            one, two = first, second
            for u in range(i * block, i * block + block):
                for v in range(j * block, j * block + block):
                    bits = np.uint64(pixels[u, v])
                    one, two = (one ^ bits) * ONE, (two ^ bits) * TWO
                    one, two = one ^ (one >> np.uint64(31)), two ^ (two >> np.uint64(29))
            blocks[i, j, 0], blocks[i, j, 1] = _mixed(one, ONE), _mixed(two, TWO)


@kernel
def _hash_lines(values, before, factors, turned):
    """turned[j, i] gets two hashes of values[i], from ``before`` places before j on: as many as
    there are ``factors``."""
    rows, columns = values.shape[:2]
    for i in range(rows):
        for j in range(columns):
            one, two = np.uint64(0), np.uint64(0)
            for n in range(len(factors)):
                v = j - before + n
                inside = 0 <= v < columns
                one += factors[n, 0] * (values[i, v, 0] if inside else BEYOND)
                two += factors[n, 1] * (values[i, v, 1] if inside else BEYOND)
            turned[j, i, 0], turned[j, i, 1] = _mixed(one, ONE), _mixed(two, TWO)


@kernel
def hash_windows(blocks, before, after, keys):
    """keys[i, j] gets two hashes of the ``blocks`` from ``before`` rows and columns before (i, j)
    to ``after`` rows and columns after it. Blocks beyond the map have one value."""
    rows, columns = blocks.shape[:2]
    count = before + after + 1
    factors = np.empty((2, count, 2), np.uint64)
    one, two = ONE, TWO
    for n in range(2 * count):
        one, two = _mixed(one + np.uint64(n), TWO), _mixed(two + np.uint64(n), ONE)
        factors[n // count, n % count, 0] = one | np.uint64(1)
        factors[n // count, n % count, 1] = two | np.uint64(1)
    lines = np.empty((columns, rows, 2), np.uint64)
    _hash_lines(blocks, before, factors[0], lines)
    _hash_lines(lines, before, factors[1], keys)


@kernel
def look_up(keys, kept, held, values, known):
    """values[n] = the value that ``held`` has for keys[n], if it is among the ``kept`` keys, and
    known[n] whether it is. A key lies at its last bits."""
    last = np.uint64(kept.shape[0] - 1)
    for n in range(keys.shape[0]):
        at = keys[n, 0] & last
        known[n] = kept[at, 0] == keys[n, 0] and kept[at, 1] == keys[n, 1]
        if known[n]:
            values[n] = held[at]


@kernel
def keep(keys, values, kept, held):
    """Put the keys and their values in the table of `look_up`."""
    last = np.uint64(kept.shape[0] - 1)
    for n in range(keys.shape[0]):
        at = keys[n, 0] & last
        kept[at, 0], kept[at, 1], held[at] = keys[n, 0], keys[n, 1], values[n]
