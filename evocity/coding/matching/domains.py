"""Pools of the domain blocks of one size, with their D4 coordinates (see `d4`)."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from evocity.coding._kernels import box_means
from evocity.coding.matching.d4 import d4_ones, d4_slots

#: Relief below this share of the highest roof is rounding, in float64 and in float32.
_NOISE, _COARSE = 1e-12, 4e-6
#: Replaces an infinite cap on \\|σ\\|: times the norm 0 of a flat domain block it gives 0.
UNCAPPED = np.float32(1e18)


@dataclass(frozen=True, eq=False)
class DomainPool:
    """All domain blocks of side ``multiple``·B of a map with their first row in a band: ``rows``
    rows from ``top`` on. Blocks with at most the energy ``least``, m², count as flat.

    shrunk : float64 ``(H − m + 1, W − m + 1)``, means of m × m pixels (m = multiple) of the map.
    exact : whether D4 coordinates come from float64, or from float32.
    """

    multiple: int
    block: int
    shrunk: np.ndarray
    top: int
    rows: int
    least: np.float32
    exact: bool = True

    @property
    def shape(self) -> tuple[int, int]:
        """Number of domain positions along y and x."""
        return self.rows, self.shrunk.shape[1] - self.multiple * (self.block - 1)

    def split(self, count: int, last: float = 1.0) -> list["DomainPool"]:
        """Divide the pool into at most ``count`` bands of rows, the last ``last`` times as high as
        the others."""
        step = max(1, round(self.rows / (count - 1 + last)))
        edges = [*range(0, self.rows, step)[:count], self.rows]
        return [
            replace(self, top=self.top + first, rows=end - first) for first, end in pairwise(edges)
        ]

    @cached_property
    def folded(self) -> tuple[np.ndarray, np.ndarray]:
        """Planes, float32 ``(rows, B², columns + LANES)``: D4 coordinates of the shrunk domain
        blocks made zero-mean and of unit norm, d̃/‖d̃‖; and norms ‖d̃‖, m, float32 ``(rows, columns
        + LANES)``. Both are 0 for flat domain blocks and in the padding."""
        from evocity.coding.matching._kernels import LANES
        from evocity.coding.matching.d4_folding._kernels import fold

        (rows, columns), block = self.shape, self.block
        planes = np.empty((rows, block * block, columns + LANES), np.float32)
        norms = np.empty((rows, columns + LANES), np.float32)
        planes[:, :, columns:] = norms[:, columns:] = 0
        kind = np.float64 if self.exact else np.float32
        band = self.shrunk[self.top : self.top + rows + self.multiple * (block - 1)]
        band = band.astype(kind, copy=False)
        ones = d4_ones(block).astype(kind)
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
    """Yield every domain block of a ``(H, W)`` map, in the order of (D, y), in bands of rows whose
    D4 coordinates take about ``memory`` bytes.

    ``domains`` are multiples m of B; sizes that do not fit the map are skipped. Domain blocks whose
    heights surely span less than ``flat`` metres count as flat. Without ``exact`` heights are
    rounded to float32 first, in half the time: precision is then about 1e-7 of the heights.
    """
    from evocity.coding.matching._kernels import LANES

    height, width = heights.shape
    least = least_energy(heights, block, flat, exact)
    for multiple in sorted(domains):
        rows, columns = height - multiple * block + 1, width - multiple * block + 1
        if min(rows, columns) < 1:
            continue
        shrunk = np.empty((height - multiple + 1, width - multiple + 1))
        box_means(heights.astype(np.float64), multiple, multiple, shrunk)
        step = max(1, memory // (4 * block**2 * (columns + LANES)))
        for top in range(0, rows, step):
            yield DomainPool(multiple, block, shrunk, top, min(step, rows - top), least, exact)


def least_energy(heights: np.ndarray, block: int, flat: float, exact: bool) -> np.float32:
    """Compute the energy up to which domain blocks count as flat, m², see `domain_pools`."""
    noise = (_NOISE if exact else _COARSE) * float(heights.max(initial=0))
    # a block whose heights span `flat` has at least flat²/2 of energy
    return np.float32(max(flat**2 / 2, (block * noise) ** 2))
