"""Range blocks alike but for level, sign and isometry: each shape need be searched but once."""

from functools import cache

import numpy as np

from evocity import isometries
from evocity.coding.search.blocks import canonical


def same_shape(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Group ``(n, B, B)`` blocks that differ by a level, the sign and an isometry alone.

    Returns ``of`` (n,), the index of each block's group, and ``first`` (groups,), the first
    block of each group. Only differences equal to the bit count as alike, so that a search
    for one block of a group is exact for all.
    """
    count, size = blocks.shape[0], blocks.shape[-1]
    flat = np.ascontiguousarray(blocks.reshape(count, size * size), np.float64)
    shapes, keys = np.empty((count, size * size)), np.empty(count)
    canonical(flat, isometries.sources(size), key_weights(size), shapes, keys)
    _, first, of = np.unique(keys, return_index=True, return_inverse=True)
    strange = np.flatnonzero((shapes != shapes[first[of]]).any(axis=1))
    if strange.size:  # two shapes of one key
        of[strange] = len(first) + np.arange(strange.size)
        first = np.concatenate([first, strange])
    return of, first


@cache
def key_weights(block: int) -> np.ndarray:
    """Weights of a block's pixels, ``(B²,)``, under which sums of unlike blocks hardly agree."""
    weights = np.random.default_rng(block).random(block * block)
    weights.setflags(write=False)
    return weights
