"""Shapes of range blocks: range blocks equal up to level, sign and isometry share a search."""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity import isometries
from evocity.coding.matching.equivalence._kernels import canonical, grouped, uneven


@dataclass(frozen=True, eq=False)
class Shapes:
    """n blocks, each one of S shapes under a sign, an isometry and a level.

    pixels : float64 ``(S, B²)``, the shapes, m above some level.
    first : int64 ``(S,)``, the first block of each.
    of : int64 ``(n,)``, the shape of each block.
    iso, sign : uint8 and float64 ``(n,)``, the isometry 0…7, and +1 or −1, that turn the shape
        into the block, up to the level.
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
