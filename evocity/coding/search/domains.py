"""The pool of domain blocks of one size, folded into the coordinates the search works in.

Under the 8 isometries of the square (the dihedral group D4) a block falls into parts that are
even or odd under the two axis flips: pp, pm, mp, mm (rows first). With s1, s2 the symmetric
and antisymmetric part of pp under transposition, s3, s4 those of mm, u = pm and w = mpᵀ, the
inner products of a range block with all 8 images of a domain block are sums of
s1·s1′, s2·s2′, s3·s3′, s4·s4′, u·u′, w·w′, u·w′ and w·u′.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

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


@dataclass(frozen=True, eq=False)
class DomainPool:
    """Domain blocks of side ``multiple``·B of one map: all whose first row lies in a band.

    shrunk : float64 ``(H − m + 1, W − m + 1)``, means of m × m pixels (m = multiple) of the
        whole map.
    planes : float32 ``(rows, B², columns + LANES)``, D4 coordinates of the shrunk domain blocks
        made zero-mean and of unit norm, d̃/‖d̃‖.
    norms : float32 ``(rows, columns + LANES)``, ‖d̃‖, m. Norms and planes are 0 for flat
        domains and in the padding, which so explain nothing.
    top : the map row where the first of the ``rows`` begins.
    """

    multiple: int
    shrunk: np.ndarray
    planes: np.ndarray
    norms: np.ndarray
    top: int = 0

    @property
    def shape(self) -> tuple[int, int]:
        """Number of domain positions along y and x."""
        rows, columns = self.norms.shape
        return rows, columns - LANES


def domain_pools(
    heights: np.ndarray,
    block: int,
    domains: Sequence[int],
    flat: float = 0.0,
    memory: int = 64 << 20,
    exact: bool = True,
) -> Iterator[DomainPool]:
    """Fold every domain block of a ``(H, W)`` map, in the order of (D, y): band after band of
    rows, each of about ``memory`` bytes.

    ``domains`` are multiples m of B; sizes that do not fit the map are left out. Domains surely
    flatter than ``flat`` metres from lowest to highest count as flat. Without ``exact`` heights
    are rounded to float32 before they are folded: half the time, good to about 1e-7 of the
    heights instead of the differences of heights.
    """
    height, width = heights.shape
    highest = float(heights.max(initial=0))
    # a block whose heights span `flat` has at least flat²/2 of energy
    noise = (_NOISE if exact else _COARSE) * highest
    least = max(flat**2 / 2, (block * noise) ** 2)
    for multiple in sorted(domains):
        rows, columns = height - multiple * block + 1, width - multiple * block + 1
        if min(rows, columns) < 1:
            continue
        shrunk = np.empty((height - multiple + 1, width - multiple + 1))
        box_means(heights.astype(np.float64), multiple, multiple, shrunk)
        lines = shrunk if exact else shrunk.astype(np.float32)
        ones = d4_basis(block).sum(axis=1).astype(lines.dtype)
        step = max(1, memory // (4 * block**2 * (columns + LANES)))
        for top in range(0, rows, step):
            band = min(step, rows - top)
            planes = np.zeros((band, block * block, columns + LANES), np.float32)
            norms = np.zeros((band, columns + LANES), np.float32)
            fold(lines[top:], multiple, block, ones, np.float32(least), planes, norms)
            yield DomainPool(multiple, shrunk, planes, norms, top)


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
