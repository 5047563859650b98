"""The pool of domain blocks of one size, folded into the coordinates the search works in.

Under the 8 isometries of the square (the dihedral group D4) a block falls into parts that are
even or odd under the two axis flips: pp, pm, mp, mm (rows first). With s1, s2 the symmetric
and antisymmetric part of pp under transposition, s3, s4 those of mm, u = pm and w = mpᵀ, the
inner products of a range block with all 8 images of a domain block are sums of
s1·s1′, s2·s2′, s3·s3′, s4·s4′, u·u′, w·w′, u·w′ and w·u′.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import pairwise

import numpy as np

from evocity.coding._kernels import box_means
from evocity.coding.search._kernels import LANES
from evocity.coding.search.blocks import fold

#: Relief below this share of the highest roof is rounding: of float64, and of float32.
_NOISE, _COARSE = 1e-12, 4e-6
#: Stands for no cap on \\|σ\\|: finite, so that times the norm 0 of a flat domain it is 0.
UNCAPPED = np.float32(1e18)


@cache
def d4_basis(block: int) -> np.ndarray:
    """Orthonormal basis ``(B², B²)`` of blocks of ``block`` px: a row a D4 coordinate, in the
    order s1, s2, s3, s4, u, w."""
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
        """Symmetric (sign +1) or antisymmetric (−1) products of ``basis`` with itself."""
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
    """`d4_basis` with the mean removed, float32: what turns a flat block into the coordinates
    that the search compares. Inner products are kept, but for the mean."""
    basis = d4_basis(block)
    matrix = (basis - basis.mean(axis=1, keepdims=True)).astype(np.float32)
    matrix.setflags(write=False)
    return matrix


@cache
def d4_slots(block: int) -> np.ndarray:
    """Where among its D4 coordinates a block has the product of its a-th and b-th function down
    and across, first the even functions and then the odd, before (a, b) and (b, a) are mixed:
    ``(B, B)``."""
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


@dataclass(frozen=True, eq=False)
class DomainPool:
    """Domain blocks of side ``multiple``·B of one map: all whose first row lies in a band.

    block : B, px.
    shrunk : float64 ``(H − m + 1, W − m + 1)``, means of m × m pixels (m = multiple) of the
        whole map.
    top, rows : the map row where the band begins, and how many.
    least : blocks of no more energy, m², count as flat.
    """

    multiple: int
    block: int
    shrunk: np.ndarray
    top: int
    rows: int
    least: np.float32

    @property
    def shape(self) -> tuple[int, int]:
        """Number of domain positions along y and x."""
        return self.rows, self.shrunk.shape[1] - self.multiple * (self.block - 1)

    def split(self, count: int, last: float = 1.0) -> list["DomainPool"]:
        """The same domain blocks in at most ``count`` bands of rows, the last of them ``last``
        times as high as the others."""
        step = max(1, round(self.rows / (count - 1 + last)))
        edges = [*range(0, self.rows, step)[:count], self.rows]
        return [
            replace(self, top=self.top + first, rows=end - first) for first, end in pairwise(edges)
        ]

    @property
    def planes(self) -> np.ndarray:
        """Float32 ``(rows, B², columns + LANES)``, D4 coordinates of the shrunk domain blocks
        made zero-mean and of unit norm, d̃/‖d̃‖. They are 0 for flat domains and in the padding,
        which so explain nothing."""
        return self.folded[0]

    @property
    def norms(self) -> np.ndarray:
        """Float32 ``(rows, columns + LANES)``, ‖d̃‖, m; 0 where planes are."""
        return self.folded[1]

    @cached_property
    def folded(self) -> tuple[np.ndarray, np.ndarray]:
        """Planes and norms, made when first asked for."""
        (rows, columns), block = self.shape, self.block
        planes = np.zeros((rows, block * block, columns + LANES), np.float32)
        norms = np.zeros((rows, columns + LANES), np.float32)
        ones = d4_basis(block).sum(axis=1).astype(self.shrunk.dtype)
        band = self.shrunk[self.top :]
        fold(band, self.multiple, d4_slots(block), ones, self.least, planes, norms)
        return planes, norms


def domain_pools(
    heights: np.ndarray,
    block: int,
    domains: Sequence[int],
    flat: float = 0.0,
    memory: int = 64 << 20,
    exact: bool = True,
) -> Iterator[DomainPool]:
    """Every domain block of a ``(H, W)`` map, in the order of (D, y): band after band of rows,
    each of about ``memory`` bytes once folded.

    ``domains`` are multiples m of B; sizes that do not fit the map are left out. Domains surely
    flatter than ``flat`` metres from lowest to highest count as flat. Without ``exact`` heights
    are rounded to float32 before they are folded: half the time, good to about 1e-7 of the
    heights instead of the differences of heights.
    """
    height, width = heights.shape
    highest = float(heights.max(initial=0))
    # a block whose heights span `flat` has at least flat²/2 of energy
    noise = (_NOISE if exact else _COARSE) * highest
    least = np.float32(max(flat**2 / 2, (block * noise) ** 2))
    for multiple in sorted(domains):
        rows, columns = height - multiple * block + 1, width - multiple * block + 1
        if min(rows, columns) < 1:
            continue
        shrunk = np.empty((height - multiple + 1, width - multiple + 1))
        box_means(heights.astype(np.float64), multiple, multiple, shrunk)
        if not exact:
            shrunk = shrunk.astype(np.float32)
        step = max(1, memory // (4 * block**2 * (columns + LANES)))
        for top in range(0, rows, step):
            yield DomainPool(multiple, block, shrunk, top, min(step, rows - top), least)


def part_sizes(block: int) -> tuple[int, ...]:
    """Number of D4 coordinates in s1, s2, s3, s4 and u; w has as many as u."""
    even, odd = (block + 1) // 2, block // 2
    both = (1, -1)
    symmetric = [half * (half + sign) // 2 for half in (even, odd) for sign in both]
    return (*symmetric, even * odd)


def domain_pool(heights: np.ndarray, block: int, multiple: int, flat: float = 0.0) -> DomainPool:
    """All domain blocks of one size in one pool; the map must be large enough for one."""
    (pool,) = domain_pools(heights, block, [multiple], flat, memory=1 << 62)
    return pool
