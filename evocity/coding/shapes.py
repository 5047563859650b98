"""Range blocks alike but for level, sign and isometry: each shape need be searched but once."""

import numpy as np

from evocity import isometries

_CHUNK = 4096


def same_shape(blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Group ``(n, B, B)`` blocks that differ by a level, the sign and an isometry alone.

    Returns ``of`` (n,), the index of each block's group, and ``first`` (groups,), the first
    block of each group. Only differences equal to the bit count as alike, so that a search
    for one block of a group is exact for all.
    """
    count, size = blocks.shape[0], blocks.shape[-1]
    sources = isometries.sources(size)
    shapes = np.empty((count, size * size))
    for start in range(0, count, _CHUNK):
        part = blocks[start : start + _CHUNK].reshape(-1, size * size).astype(np.float64)
        # float32 heights have exact float64 differences
        raised = part - part.min(axis=1, keepdims=True)
        sunk = part.max(axis=1, keepdims=True) - part
        images = np.concatenate([raised[:, sources], sunk[:, sources]], axis=1)
        shapes[start : start + _CHUNK] = images[np.arange(len(part)), _least(images)]
    keys = _hashed(shapes)
    _, first, of = np.unique(keys, return_index=True, return_inverse=True)
    strange = np.flatnonzero((shapes != shapes[first[of]]).any(axis=1))
    if strange.size:  # two shapes of one hash
        of[strange] = len(first) + np.arange(strange.size)
        first = np.concatenate([first, strange])
    return of, first


def _least(images: np.ndarray) -> np.ndarray:
    """For each block of ``(n, 16, B²)``, which image has the least hash."""
    return np.argmin(_hashed(images), axis=1)


def _hashed(shapes: np.ndarray) -> np.ndarray:
    """Uint64 hash of the last axis: whole-number arithmetic, so equal bits give equal hashes."""
    bits = (shapes + 0.0).view(np.uint64)  # −0 becomes 0
    odd = np.arange(1, 2 * shapes.shape[-1], 2, dtype=np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    mixed = (bits ^ (bits >> np.uint64(29))) * odd
    return (mixed ^ (mixed >> np.uint64(32))).sum(axis=-1, dtype=np.uint64)
