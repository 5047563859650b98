"""Blocks as a search compares them: domain blocks of a pool, range blocks with norms of parts, and
shapes, which range blocks equal up to level, sign and isometry share."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity import isometries
from evocity.coding.matching.d4 import lowest, part_sizes, project, used_parts
from evocity.coding.matching.domains import DomainPool
from evocity.coding.matching.equivalence._kernels import canonical, grouped, kind_kernels, uneven


@dataclass(frozen=True, eq=False)
class Blocks:
    """n blocks of pixels of a float64 ``raster`` ``(H, W)``, m, in the order of place: the first
    pixel of each lies ``at`` (n,) from the raster's first in memory, the others ``offsets`` (B²,)
    from there. Blocks of at most the energy ``least``, m², count as flat."""

    raster: np.ndarray
    offsets: np.ndarray
    at: np.ndarray
    least: np.float32


def domain_blocks(pool: DomainPool, doubles: bool = False) -> Blocks:
    """Collect the domain blocks of ``pool`` without flat ones. Of those that differ only by a level
    few besides the first stay, as no other can win; with ``doubles`` all stay."""
    block, step, (rows, columns) = pool.block, pool.multiple, pool.shape
    first_of_kinds, not_flat = kind_kernels(block)
    at = np.empty(rows * columns + 1, np.int64)
    where = (pool.shrunk, step, pool.top, rows, key_weights(block), pool.least)
    if doubles:
        count = not_flat(*where, at)
    else:
        count = first_of_kinds(*where, np.zeros(1 << at.size.bit_length(), np.int32), at)
    down, across = np.divmod(np.arange(block * block), block)
    offsets = step * (down * pool.shrunk.shape[1] + across)
    return Blocks(pool.shrunk, offsets.astype(np.uint64), at[:count], pool.least)


@dataclass(frozen=True, eq=False)
class RangeCodes:
    """n range blocks for the search of a whole map: their D4 ``codes``, float32 ``(n, B²)``, m;
    norms of their F parts (`used_parts`), ``shares``, ``(n, F)``, m; and ``norms`` of no less than
    ‖r̃‖, ``(n,)``, m."""

    codes: np.ndarray
    shares: np.ndarray
    norms: np.ndarray

    @classmethod
    def of(cls, codes: np.ndarray) -> "RangeCodes":
        block = int(np.sqrt(codes.shape[1]))
        waves, members = _parts(block)
        exact = codes.astype(np.float64)
        low, every = project(waves, exact) ** 2, project(members, exact**2)
        low[:, -2] += low[:, -1]  # u and w count as one part
        low = low[:, :-1]
        rest = np.maximum(every - low, 0) + 1e-6 * every  # a difference, so rounded up
        parts = np.stack([low, rest], axis=2).reshape(len(codes), 2 * low.shape[1])
        shares = np.ascontiguousarray(np.sqrt(parts[:, used_parts(block)]), np.float32)
        return cls(codes, shares, np.sqrt(every.sum(axis=1) * (1 + 2e-6)).astype(np.float32))

    def __getitem__(self, part: slice) -> "RangeCodes":
        return RangeCodes(self.codes[part], self.shares[part], self.norms[part])


@cache
def _parts(block: int) -> tuple[np.ndarray, np.ndarray]:
    """Arrange the `lowest` vectors of s1, s2, s3, s4, u and w as columns ``(B², 6)``; and masks of
    the coordinates of s1, s2, s3, s4 and (u, w) as columns ``(B², 5)``."""
    sizes = part_sizes(block)
    sizes += sizes[-1:]
    part = np.repeat(np.arange(6), sizes)
    vectors = np.concatenate([lowest(block), lowest(block)[-sizes[-1] :]])
    own = part[:, None] == np.arange(6)
    members = own[:, :5].astype(float)
    members[:, 4] += own[:, 5]
    return own * vectors[:, None].astype(float), members


@dataclass(frozen=True, eq=False)
class Shapes:
    """n blocks, each one of S shapes under a sign, an isometry and a level.

    pixels, first : the shapes, float64 ``(S, B²)``, m above some level; the first block of each.
    of : int64 ``(n,)``, the shape of each block.
    iso, sign : isometry 0…7 and ±1, ``(n,)``, that turn the shape into the block, up to the level.
    """

    pixels: np.ndarray
    first: np.ndarray
    of: np.ndarray
    iso: np.ndarray
    sign: np.ndarray

    @classmethod
    def of_blocks(cls, blocks: np.ndarray) -> "Shapes":
        """Find the shapes of ``(n, B, B)`` blocks. Differences must agree in every bit, so a search
        for the shape is exact for all its blocks."""
        count, size = blocks.shape[0], blocks.shape[-1]
        flat = np.ascontiguousarray(blocks.reshape(count, size * size), np.float64)
        shapes, keys, turned = np.empty_like(flat), np.empty(count), np.empty(count, np.uint8)
        canonical(flat, isometries.sources(size), key_weights(size), shapes, keys, turned)
        of, first = np.empty((2, count), np.int64)
        slots = np.zeros(2 << count.bit_length(), np.int32)
        first = first[: grouped(shapes, keys, slots, of, first)]
        return cls(
            pixels=shapes[first],
            first=first,
            of=of,
            iso=isometries.INVERSE[turned % isometries.COUNT],
            sign=np.where(turned < isometries.COUNT, 1.0, -1.0),
        )

    @classmethod
    def one_each(cls, blocks: np.ndarray) -> "Shapes":
        """Take each of ``(n, B, B)`` blocks as a shape."""
        count, size = blocks.shape[0], blocks.shape[-1]
        every, iso, sign = np.arange(count), np.zeros(count, np.uint8), np.ones(count)
        return cls(blocks.reshape(count, size * size).astype(np.float64), every, every, iso, sign)


def uneven_blocks(blocks: np.ndarray) -> np.ndarray:
    """Tell which of ``(n, B, B)`` blocks have more than one height: bool ``(n,)``."""
    count, size = blocks.shape[0], blocks.shape[-1]
    mask = np.empty(count, bool)
    uneven(blocks.reshape(count, size * size), mask)
    return mask


@cache
def key_weights(block: int) -> np.ndarray:
    """Draw weights of a block's pixels, ``(B²,)``: weighted sums of unlike blocks hardly agree."""
    weights = np.random.default_rng(block).random(block * block)
    weights.setflags(write=False)
    return weights
