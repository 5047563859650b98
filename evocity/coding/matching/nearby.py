"""The search among the domains within reach of each range block: rows of windows."""

from collections.abc import Sequence

import numpy as np

from evocity.coding.matching._kernels import GROUP, window_kernels
from evocity.coding.matching.d4 import d4_codes
from evocity.coding.matching.domains import UNCAPPED, DomainPool, domain_pools
from evocity.coding.matching.matches import Search, listed

#: Range blocks whose surroundings are searched at a time.
NEARBY = 128


def best_nearby(
    search: Search, corners, reach: int, pool: DomainPool, part: slice, tolerance: float = 0.0
):
    """Raise ``search.best`` of one chunk of ranges by the domains of ``pool`` within ``reach``.

    Returns (which of the chunk, y, x on the map) of all domains within the ``tolerance`` (a share
    of the range block's energy) and rounding of that best.
    """
    lane_maxima, list_nearby = window_kernels(search.block)
    window = _window(pool, tuple(corner[part] for corner in corners), reach)
    first_row, last_row = int(window[:, 0].min()), int(window[:, 1].max())
    width = int((window[:, 3] - window[:, 2]).max())
    if first_row >= last_row or width <= 0:
        return np.empty((3, 0), np.int64)
    band = max(16, -(-(last_row - first_row) // 32))
    strips = -(-(last_row - first_row) // band)
    lanes = np.zeros((strips, len(window), width + -width % GROUP), np.float32)
    cap = min(np.float32(search.cap), UNCAPPED)
    lane_maxima(
        pool.planes, pool.norms, search.ranges.codes[part], window, cap, first_row, band,
        lanes, search.best[part],
    )  # fmt: skip
    which, y, x = listed(
        list_nearby, 3, pool.planes, pool.norms, search.ranges.codes[part], window, cap, lanes,
        first_row, band, search.near(part, tolerance),
    )  # fmt: skip
    return which, y + pool.top, x


def best_correlations(
    heights: np.ndarray,
    block: int = 4,
    domains: Sequence[int] = (2,),
    reach: int | None = 12,
    flat: float = 0.1,
) -> tuple[np.ndarray, np.ndarray]:
    """ρ² between each range block of the pavement and its best domain, σ unconstrained.

    Returns float32 ``(n,)`` in 0…1, and bool ``(n,)``: which range blocks are uniform (their
    heights span at most ``flat`` metres; their ρ² is 0). Domains of side D = B·``domains``,
    at every pixel position within ``reach`` px. H and W must be multiples of ``block``.
    """
    height, width = heights.shape
    rows, columns = height // block, width // block
    cut = heights.reshape(rows, block, columns, block).swapaxes(1, 2)
    flat_blocks = np.ascontiguousarray(cut, np.float32).reshape(rows * columns, block * block)
    uniform = np.ptp(flat_blocks, axis=1) <= flat
    (busy,) = np.nonzero(~uniform)
    codes = d4_codes(flat_blocks[busy])
    corners = (busy // columns * block, busy % columns * block)
    gain = np.zeros(busy.size, np.float32)
    lane_maxima, _ = window_kernels(block)
    for pool in domain_pools(heights, block, domains, flat, exact=False):
        for start in range(0, busy.size, NEARBY):
            part = slice(start, start + NEARBY)
            window = _window(pool, tuple(corner[part] for corner in corners), reach)
            width = max(0, int((window[:, 3] - window[:, 2]).max()))
            lanes = np.zeros((1, len(window), width + -width % GROUP), np.float32)
            lane_maxima(
                pool.planes, pool.norms, codes[part], window, UNCAPPED, 0, pool.shape[0],
                lanes, gain[part],
            )  # fmt: skip
    rho2 = np.zeros(rows * columns, np.float32)
    rho2[busy] = np.clip(gain / np.einsum("nk,nk->n", codes, codes), 0, 1)
    return rho2, uniform


def pairs_compared(
    shape: tuple[int, int], block: int, domains: Sequence[int], corners, reach: int | None
) -> int:
    """Range block × domain position × isometry pairs of a search, each range block counted."""
    total = 0
    for multiple in domains:
        rows, columns = (side - multiple * block + 1 for side in shape)
        window = _clipped(0, rows, columns, corners, reach)
        total += int(np.prod(window[:, 1::2] - window[:, ::2], axis=1).sum())
    return 8 * total


def _window(pool: DomainPool, corners, reach: int | None) -> np.ndarray:
    """(top, bottom, left, right) of the domain positions of each range block within ``pool``."""
    return _clipped(pool.top, *pool.shape, corners, reach)


def _clipped(top: int, rows: int, columns: int, corners, reach: int | None) -> np.ndarray:
    y, x = (np.asarray(corner, np.int64) for corner in corners)
    window = np.empty((y.size, 4), np.int64)
    if reach is None:
        window[:] = (0, rows, 0, columns)
    else:
        window[:, 0], window[:, 1] = y - top - reach, y - top + reach + 1
        window[:, 2], window[:, 3] = x - reach, x + reach + 1
        ends = np.array([rows, rows, columns, columns])
        np.minimum(np.maximum(window, 0, out=window), ends, out=window)  # np.clip is slow on few
    return window
