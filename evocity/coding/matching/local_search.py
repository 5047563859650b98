"""Search among the domain blocks within reach of each range block, in rows of windows."""

from collections.abc import Sequence
from functools import reduce

import numpy as np

from evocity.coding.matching.d4 import d4_codes
from evocity.coding.matching.domains import UNCAPPED, DomainPool, domain_pools, least_energy
from evocity.coding.matching.known_windows import KnownWindows, window_keys
from evocity.coding.matching.matches import Search, list_places
from evocity.coding.parameters import Coding

#: Gains kept in one batch; this limits the range blocks of a batch.
_GAINS = 1 << 19
#: The least number of rows of domain blocks that share a kept gain.
_BAND = 16
#: The most bands of a window.
_MOST_STRIPS = 32
#: What `best_correlations` has found in this process.
_KNOWN = KnownWindows()


def chunk_size(reach: int) -> int:
    """Compute the number of range blocks of a batch."""
    side = 2 * reach + 1
    return max(64, _GAINS // (side * min(-(-side // _BAND), _MOST_STRIPS)))


def best_nearby(search: Search, corners, pool: DomainPool, part: slice, tolerance: float = 0.0):
    """Raise ``search.best`` of a chunk of range blocks by the domain blocks of ``pool`` in reach.
    Returns the domain blocks near that best as `best_everywhere` does."""
    from evocity.coding.matching._kernels import window_kernels

    lane_maxima, list_nearby, _ = window_kernels(search.block)
    corners = tuple(corner[part] for corner in corners)
    window = _windows(pool.top, *pool.shape, corners, search.reach)
    band, lanes = _bands(window, _BAND)
    if not lanes.size:
        return np.empty((3, 0), np.int64)
    cap = min(np.float32(search.cap), UNCAPPED)
    lane_maxima(
        *pool.folded, search.codes[part], window, cap, band,
        lanes, search.best[part],
    )  # fmt: skip
    which, y, x = list_places(
        list_nearby, 3, *pool.folded, search.codes[part], window, cap, lanes,
        band, search.near(part, tolerance),
    )  # fmt: skip
    return which, y + pool.top, x


def _bands(window: np.ndarray, band: int) -> tuple[int, np.ndarray]:
    """Compute how many rows of a ``window`` share a gain (``band`` or a few more), and allocate
    these gains: zeros for `lane_maxima`, empty where every window is."""
    from evocity.coding.matching._kernels import GROUP

    tall = int((window[:, 1] - window[:, 0]).max(initial=0))
    wide = int((window[:, 3] - window[:, 2]).max(initial=0))
    if min(tall, wide) <= 0:
        return 1, np.zeros((0, len(window), 0), np.float32)
    strips = min(max(1, tall // band), _MOST_STRIPS)
    band = -(-tall // strips)
    return band, np.zeros((strips, len(window), wide + -wide % GROUP), np.float32)


def best_correlations(
    heights: np.ndarray,
    block: int = 4,
    domains: Sequence[int] = (2,),
    reach: int | None = 12,
    flat: float = 0.1,
) -> tuple[np.ndarray, np.ndarray]:
    """Compute the squared correlation ρ² between each range block of a map and its best domain
    block, for range blocks of one side.

    The value ρ² is the share of a range block's variance that a domain block explains with the best
    σ, if σ has no bound. Domain blocks have the sides m·B for each m in ``domains``, and lie within
    ``reach`` px of their range block. The parameter ``block`` is the side B of the range blocks;
    the sides of the map must be multiples of B.

    Returns ρ², float32 ``(n,)`` from 0 to 1, and a mask of uniform range blocks, bool ``(n,)``. A
    range block is uniform if its heights span at most ``flat`` metres; the value ρ² of a uniform
    block is 0.
    """
    from evocity.coding.matching._kernels import window_kernels

    height, width = heights.shape
    rows, columns = height // block, width // block
    cut = heights.reshape(rows, block, columns, block)
    uniform = (_extremes(cut, np.maximum) - _extremes(cut, np.minimum)).ravel() <= flat
    (busy,) = np.nonzero(~uniform)
    blocks = cut.swapaxes(1, 2).reshape(rows * columns, block * block)[busy]
    codes = d4_codes(blocks.astype(np.float32, copy=False))
    corners = (busy // columns * block, busy % columns * block)
    gain = np.zeros(busy.size, np.float32)
    # where more is found, rounding counts it as all
    enough = np.einsum("nk,nk->n", codes, codes)
    *_, most_gains = window_kernels(block)
    rho2, new = np.zeros(rows * columns, np.float32), np.arange(busy.size)
    keys = _keys(heights, block, domains, reach, flat)
    if keys is not None:
        rho2[busy], known = _KNOWN.look_up(keys[busy])
        (new,) = np.nonzero(~known)
        if not new.size:
            return rho2, uniform
    codes, enough, gain = codes[new], enough[new], gain[new]
    corners = tuple(corner[new] for corner in corners)
    for pool in domain_pools(heights, block, domains, flat, exact=False):
        window = _windows(pool.top, *pool.shape, corners, reach)
        most_gains(*pool.folded, codes, window, UNCAPPED, enough, gain)
    found = np.clip(gain / enough, 0, 1)
    rho2[busy[new]] = found
    if keys is not None:
        _KNOWN.keep(keys[busy[new]], found)
    return rho2, uniform


def _keys(heights: np.ndarray, block: int, domains, reach: int | None, flat: float):
    """Hash what decides on the correlation of each range block; None if that may be all of the
    map, or pixels outside the blocks."""
    if reach is None or any(side % block for side in heights.shape) or heights.dtype != np.float32:
        return None
    least = least_energy(heights, block, flat, exact=False)
    return window_keys(heights, block, tuple(sorted(domains)), reach, float(least), float(flat))


def _extremes(cut: np.ndarray, extreme: np.ufunc) -> np.ndarray:
    """Reduce each block of a map cut (rows, B, columns, B) by ``extreme``, in few steps along
    memory: numpy is slow along short axes."""
    block = cut.shape[1]
    lines = reduce(extreme, (cut[:, i] for i in range(block)))
    return reduce(extreme, (lines[..., j] for j in range(block)))


def pairs_compared(shape: tuple[int, int], block: int, corners, coding: Coding) -> int:
    """Count the range block × domain position × isometry pairs of a search."""
    total = 0
    for multiple in coding.domains:
        rows, columns = (side - multiple * block + 1 for side in shape)
        window = _windows(0, rows, columns, corners, coding.reach)
        total += int(np.prod(window[:, 1::2] - window[:, ::2], axis=1).sum())
    return 8 * total


def _windows(top: int, rows: int, columns: int, corners, reach: int | None) -> np.ndarray:
    """Compute (top, bottom, left, right) of the domain positions of each range block, in a pool of
    ``rows`` × ``columns`` positions from row ``top`` on."""
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
