"""D4 coordinates of blocks, in which the search compares.

Under the 8 isometries of the square (the dihedral group D4) a block falls into parts that are
even or odd under the two axis flips: pp, pm, mp, mm (rows first). With s1, s2 the symmetric
and antisymmetric part of pp under transposition, s3, s4 those of mm, u = pm and w = mpᵀ, the
inner products of a range block with all 8 images of a domain block are sums of
s1·s1′, s2·s2′, s3·s3′, s4·s4′, u·u′, w·w′, u·w′ and w·u′.

The isometries mix coordinates only within s1, s2, s3, s4 and (u, w). Each of these parts splits
once more, into its lowest frequency and the rest. No isometry changes the norms of these.
"""

from functools import cache
from zlib import crc32

import numpy as np


@cache
def d4_basis(block: int) -> np.ndarray:
    """Build the orthonormal basis ``(B², B²)`` of blocks of ``block`` px: a row for each D4
    coordinate, in the order s1, s2, s3, s4, u, w."""
    half = np.sqrt(0.5)
    even, odd = [], []
    for i in range((block + 1) // 2):
        vector = np.zeros(block)
        vector[i] = vector[block - 1 - i] = 1 if 2 * i == block - 1 else half
        even.append(vector)
    for i in range(block // 2):
        vector = np.zeros(block)
        vector[i], vector[block - 1 - i] = half, -half
        odd.append(vector)

    def parts(basis, sign):
        """Yield symmetric (sign +1) or antisymmetric (−1) products of ``basis`` with itself."""
        for a in range(len(basis)):
            if sign > 0:
                yield np.outer(basis[a], basis[a])
            for b in range(a + 1, len(basis)):
                mixed = np.outer(basis[a], basis[b])
                yield (mixed + sign * mixed.T) * half

    rows = [*parts(even, 1), *parts(even, -1), *parts(odd, 1), *parts(odd, -1)]
    rows += [np.outer(a, b) for a in even for b in odd]
    rows += [np.outer(b, a) for a in even for b in odd]
    basis = np.array(rows).reshape(block * block, block * block)
    basis.setflags(write=False)
    return basis


@cache
def d4_matrix(block: int) -> np.ndarray:
    """Build `d4_basis` without the mean, float32: it maps a block to the coordinates that the
    search compares. Inner products stay, apart from the mean."""
    basis = d4_basis(block)
    matrix = (basis - basis.mean(axis=1, keepdims=True)).astype(np.float32)
    matrix.setflags(write=False)
    return matrix


def d4_codes(blocks: np.ndarray) -> np.ndarray:
    """Compute the D4 coordinates of n ``blocks``, float32 ``(n, B²)``, by `d4_matrix`."""
    return project(_columns(int(np.sqrt(blocks.shape[1]))), blocks)


def project(vectors: np.ndarray, blocks: np.ndarray) -> np.ndarray:
    """Compute ``blocks @ vectors``, ``(n, K)`` and ``(K, J)`` of one type, in the calling
    thread."""
    from evocity.coding.matching._kernels import products

    out = np.empty((len(blocks), vectors.shape[1]), blocks.dtype)
    products(np.ascontiguousarray(blocks), vectors, out)
    return out


@cache
def _columns(block: int) -> np.ndarray:
    return np.ascontiguousarray(d4_matrix(block).T)


@cache
def d4_slots(block: int) -> np.ndarray:
    """Number the D4 coordinates of products of functions, before (a, b) and (b, a) mix: ``(B, B)``,
    the a-th function down by the b-th across, even functions before odd ones."""
    even, k = (block + 1) // 2, 0
    slots = np.empty((block, block), np.int64)
    for functions in (range(even), range(even, block)):
        upper = [(a, b) for a in functions for b in functions if a <= b]
        for pairs in (upper, [(b, a) for a, b in upper if a < b]):
            for pair in pairs:
                slots[pair] = k
                k += 1
    size = even * (block - even)
    slots[:even, even:].flat = np.arange(k, k + size)
    slots[even:, :even].T.flat = np.arange(k + size, k + 2 * size)
    slots.setflags(write=False)
    return slots


@cache
def d4_ones(block: int) -> np.ndarray:
    """Compute the D4 coordinates ``(B²,)`` of the block of ones: all but those of s1 are 0."""
    ones = d4_basis(block).sum(axis=1)
    ones[part_sizes(block)[0] :] = 0  # without rounding
    ones.setflags(write=False)
    return ones


def part_sizes(block: int) -> tuple[int, ...]:
    """Count the D4 coordinates in s1, s2, s3, s4 and u; w has as many as u."""
    even, odd = (block + 1) // 2, block // 2
    both = (1, -1)
    symmetric = [half * (half + sign) // 2 for half in (even, odd) for sign in both]
    return (*symmetric, even * odd)


@cache
def lowest(block: int) -> np.ndarray:
    """Build for each part the unit vector of its lowest frequency (cosine transform), in the
    coordinates of that part: float32, part after part; u and w share a vector."""
    wave = np.cos(np.pi * (np.arange(block) + 0.5)[None] * np.arange(block)[:, None] / block)
    first = {"s1": (0, 2, 1), "s2": (0, 2, -1), "s3": (1, 1, 1), "s4": (1, 3, -1), "u": (0, 1, 0)}
    basis, vectors, start = d4_basis(block), [], 0
    for size, (i, j, sign) in zip(part_sizes(block), first.values(), strict=True):
        vector = np.zeros(size)
        if max(i, j) < block:
            image = np.outer(wave[i], wave[j])
            image = image + sign * image.T
            vector = (basis[start : start + size] * image.ravel()).sum(axis=1)
        norm = np.sqrt((vector * vector).sum())
        vectors.append(vector / norm if norm > 1e-9 else vector)
        start += size
    lowest = np.concatenate(vectors).astype(np.float32)
    lowest.setflags(write=False)
    return lowest


@cache
def used_parts(block: int) -> tuple[int, ...]:
    """List which of the norms (lowest, rest of each part) can differ from 0."""
    start, used = 0, []
    for part, size in enumerate(part_sizes(block)):
        low = bool(lowest(block)[start : start + size].any())
        # without the mean, s1 has one dimension less than coordinates
        room = size - (part == 0)
        used += [2 * part] * low + [2 * part + 1] * (room > low)
        start += size
    return tuple(used)


@cache
def d4_mark(block: int) -> int:
    """Compute a checksum of the tables of this file. Kernels compiled from them contain it, since
    their disk cache notices changes of the kernels' file only."""
    tables = (d4_basis(block), d4_slots(block), lowest(block))
    content = b"".join(table.tobytes() for table in tables)
    return crc32(content + repr((part_sizes(block), used_parts(block))).encode())
