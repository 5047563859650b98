"""Blocks as a search compares them: domain blocks of a pool, range blocks with norms of parts."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity.coding.matching.d4 import lowest, part_sizes, project, used_parts
from evocity.coding.matching.domains import DomainPool
from evocity.coding.matching.equivalence._kernels import kind_kernels
from evocity.coding.matching.shapes import key_weights


@dataclass(frozen=True, eq=False)
class Blocks:
    """n blocks of pixels, in the order of place.

    raster : float64 ``(H, W)``, heights in m, with all their pixels.
    offsets : uint64 ``(B²,)``, the distance in memory of each pixel from a block's first.
    at : int64 ``(n,)``, the distance in memory of each block's first pixel from the raster's.
    least : blocks of no more energy, m², count as flat.
    """

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
    """n range blocks for the search of a whole map; F parts of their norm.

    codes : float32 ``(n, B²)``, D4 coordinates, m.
    shares : float32 ``(n, F)``, norms of the parts (`used_parts`), m.
    norms : float32 ``(n,)``, no less than ‖r̃‖, m.
    """

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
