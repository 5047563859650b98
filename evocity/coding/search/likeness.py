"""Which domain blocks are alike: those that are one, the norms of a block's parts, and an order.

The isometries mix D4 coordinates only within the parts s1, s2, s3, s4 and (u, w) of a block (see
`evocity.coding.search.domains`). Each part is split once more, into its lowest frequency and the
rest; the norms of these are the same under every isometry.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity.coding.search.blocks import fold_at, kinds, part_norms, relief_keys
from evocity.coding.search.blocks import z_order as counted
from evocity.coding.search.domains import DomainPool, d4_basis, d4_slots, part_sizes
from evocity.coding.search.shapes import key_weights

#: Norms that the order of domain blocks goes by, and bits of each.
_KEYS, _BITS = 5, 3


@dataclass(frozen=True, eq=False)
class UnitBlocks:
    """n domain blocks of one pool, none flat, in the order of (y, x); F parts of their norm.

    codes : float32 ``(n, B²)``, D4 coordinates of the unit blocks d̃/‖d̃‖.
    norms : float32 ``(n,)``, ‖d̃‖, m.
    shares : float32 ``(F, n)``, norms of the parts of d̃/‖d̃‖, 0…1.
    y, x : int32 ``(n,)``, where on the map each block begins, px.
    """

    codes: np.ndarray
    norms: np.ndarray
    shares: np.ndarray
    y: np.ndarray
    x: np.ndarray


def unit_blocks(pool: DomainPool, doubles: bool = False) -> UnitBlocks:
    """The domain blocks of ``pool`` that are not flat. Of those that differ by a level alone only
    the first, as no other can win, but for ``doubles``."""
    block, (rows, columns) = pool.block, pool.shape
    keys = np.empty((rows, columns))
    below = (pool.shrunk, pool.multiple, block, pool.top)
    relief_keys(*below, key_weights(block), pool.least, keys)
    room = int(np.count_nonzero(keys))
    if doubles:
        y, x = (column.astype(np.int32) for column in np.nonzero(keys))
        y += np.int32(pool.top)
    else:
        y, x = np.empty((2, room), np.int32)
        count = kinds(keys, *below, np.zeros(2 << room.bit_length(), np.int32), y, x)
        y, x = y[:count], x[:count]
    codes, norms = np.empty((y.size, block * block), np.float32), np.empty(y.size, np.float32)
    shares = np.empty((len(used_parts(block)), y.size), np.float32)
    fold_at(
        pool.shrunk, pool.multiple, y, x, d4_slots(block), _ones(block), pool.least,
        np.array(part_sizes(block)), lowest(block), _slots(block), codes, norms, shares,
    )  # fmt: skip
    kept = norms > 0
    if kept.all():
        return UnitBlocks(codes, norms, shares, y, x)
    return UnitBlocks(codes[kept], norms[kept], shares[:, kept], y[kept], x[kept])


def range_shares(codes: np.ndarray) -> np.ndarray:
    """Norms of the parts of range blocks from their D4 coordinates ``(n, B²)``: ``(n, F)``."""
    return np.ascontiguousarray(shares_of(np.ascontiguousarray(codes.T)).T)


def shares_of(lines: np.ndarray) -> np.ndarray:
    """Norms of the parts of blocks from their D4 coordinates ``(B², n)``: ``(F, n)``."""
    pixels, count = lines.shape
    block = int(np.sqrt(pixels))
    sizes, slots = np.array(part_sizes(block)), _slots(block)
    shares = np.empty((len(used_parts(block)), count), np.float32)
    part_norms(lines, sizes, lowest(block), slots, shares, np.empty(count))
    return shares


@cache
def lowest(block: int) -> np.ndarray:
    """For each part the unit vector, in its own coordinates, of the block's lowest frequency
    (cosine transform) in that part: float32, the parts one after another; u and w share one."""
    wave = np.cos(np.pi * (np.arange(block) + 0.5)[None] * np.arange(block)[:, None] / block)
    first = {"s1": (0, 2, 1), "s2": (0, 2, -1), "s3": (1, 1, 1), "s4": (1, 3, -1), "u": (0, 1, 0)}
    basis, vectors, start = d4_basis(block), [], 0
    for size, (i, j, sign) in zip(part_sizes(block), first.values(), strict=True):
        vector = np.zeros(size)
        if max(i, j) < block:
            image = np.outer(wave[i], wave[j])
            image = image + sign * image.T
            vector = basis[start : start + size] @ image.ravel()
        norm = np.linalg.norm(vector)
        vectors.append(vector / norm if norm > 1e-9 else vector)
        start += size
    lowest = np.concatenate(vectors).astype(np.float32)
    lowest.setflags(write=False)
    return lowest


@cache
def used_parts(block: int) -> tuple[int, ...]:
    """Which of the norms (lowest, rest of each part) are not 0 for every block."""
    start, used = 0, []
    for part, size in enumerate(part_sizes(block)):
        low = bool(lowest(block)[start : start + size].any())
        # the mean is no variation: a part s1 holds one dimension less than coordinates
        room = size - (part == 0)
        used += [2 * part] * low + [2 * part + 1] * (room > low)
        start += size
    return tuple(used)


@cache
def _ones(block: int) -> np.ndarray:
    """D4 coordinates of the block of ones, float32."""
    ones = d4_basis(block).sum(axis=1).astype(np.float32)
    ones.setflags(write=False)
    return ones


@cache
def _slots(block: int) -> np.ndarray:
    """Place of each norm (lowest, rest of each part) among those used, −1 of the others."""
    slots = np.full(2 * len(part_sizes(block)), -1)
    slots[list(used_parts(block))] = np.arange(len(used_parts(block)))
    slots.setflags(write=False)
    return slots


def z_order(values: np.ndarray) -> np.ndarray:
    """Order of the columns of ``(F, n)`` along a Z-order curve through the rows that vary most."""
    count = values.shape[1]
    order = np.empty(count, np.int64)
    if not count:
        return order
    spread = values[:, :: max(1, count >> 10)].std(axis=1)
    most = values[np.argsort(-spread, kind="stable")[:_KEYS]]
    low = most.min(axis=1)
    span = np.maximum(most.max(axis=1) - low, np.float32(1e-6))
    scale = np.float32((1 << _BITS) - 0.01) / span
    counted(most, low, scale, _BITS, np.zeros((1 << len(most) * _BITS) + 1, np.int32), order)
    return order
