"""Which domain block explains a range block best? The exact search behind encoding, repair and
autosimilarity.

For a zero-mean range block r̃ and a shrunk zero-mean domain block d̃ with p = ⟨r̃, iso d̃⟩ and
e = ‖d̃‖², the energy explained with contrast σ is σ(2p − σe), greatest at σ = p/e. The cap on
\\|σ\\| belongs inside this criterion: clipping afterwards costs decibels.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from evocity import isometries
from evocity.coding._kernels import correlators
from evocity.coding.domains import LANES, DomainPool, d4_matrix, domain_pool

#: Gains closer than this share of the range block's energy are a tie, won by the lowest
#: (D, y, x, iso).
TIE = 1e-9
#: How far float32 gains may be off, as a share of the energy; closer ones are re-scored.
_UNSURE = 2e-5
_CHUNK = 64


@dataclass(frozen=True, eq=False)
class Matches:
    """Best domain of each of n range blocks: arrays ``(n,)``.

    multiple (D/B), y, x (px), iso, sigma, beta (m); gain, energy (m², summed over the block):
    what the match explains of ‖r̃‖². Where nothing explains anything, multiple, sigma and
    gain are 0 and beta is the block's mean.
    """

    multiple: np.ndarray
    y: np.ndarray
    x: np.ndarray
    iso: np.ndarray
    sigma: np.ndarray
    beta: np.ndarray
    gain: np.ndarray
    energy: np.ndarray


def best_matches(
    pools: Sequence[DomainPool],
    blocks: np.ndarray,
    corners: tuple[np.ndarray, np.ndarray],
    *,
    reach: int | None,
    sigma_max: float,
    threads: int | None = 1,
    progress: Callable[[int, int], None] | None = None,
) -> Matches:
    """Exact search: the same optimum as trying every domain, isometry and size.

    Parameters
    ----------
    pools : one `DomainPool` a domain size, of the map searched in.
    blocks : ``(n, B, B)`` range blocks, metres.
    corners : (y, x) of the range blocks' north-west pixels, ``(n,)`` each.
    reach : how far a domain's corner may lie from the range's along each axis, px; None for
        the whole map.
    sigma_max : cap on \\|σ\\|; ``inf`` for none.
    threads : threads to use; None for all cores. The result does not depend on it.
    progress : called with (range blocks done, n).

    Ties (gains within `TIE` of the block's energy) go to the lowest (D, y, x, iso).
    """
    pools = sorted(pools, key=lambda pool: pool.multiple)
    count, block = len(blocks), blocks.shape[-1]
    flat = blocks.reshape(count, block * block).astype(np.float64)
    means = flat.mean(axis=1)
    centred = flat - means[:, None]
    energy = np.einsum("nk,nk->n", centred, centred)
    codes = centred.astype(np.float32) @ d4_matrix(block).T
    out = Matches(
        multiple=np.zeros(count, np.int32),
        y=np.zeros(count, np.int32),
        x=np.zeros(count, np.int32),
        iso=np.zeros(count, np.uint8),
        sigma=np.zeros(count),
        beta=means.copy(),
        gain=np.zeros(count),
        energy=energy,
    )

    def search(part: slice) -> None:
        windows = [_windows(pool, corners, part, reach) for pool in pools]
        lanes = [
            _lane_maxima(p, w, codes[part], sigma_max) for p, w in zip(pools, windows, strict=True)
        ]
        near = np.max([lane.max(axis=1, initial=0) for lane in lanes], axis=0)
        near = np.maximum(near - np.float32(_UNSURE) * energy[part].astype(np.float32), 1e-30)
        _settle(pools, windows, lanes, near, codes, centred, sigma_max, part, out)

    _in_chunks(search, count, threads, progress)
    return out


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
    codes = flat_blocks[busy] @ d4_matrix(block).T
    corners = (busy // columns * block, busy % columns * block)
    gain = np.zeros(busy.size, np.float32)
    for multiple in domains:
        if multiple * block > min(height, width):
            continue
        pool = domain_pool(heights, block, multiple, flat)
        for start in range(0, busy.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            window = _windows(pool, corners, part, reach)
            best = _lane_maxima(pool, window, codes[part], np.inf).max(axis=1, initial=0)
            np.maximum(gain[part], best, out=gain[part])
    rho2 = np.zeros(rows * columns, np.float32)
    rho2[busy] = np.clip(gain / np.einsum("nk,nk->n", codes, codes), 0, 1)
    return rho2, uniform


def window_sizes(pool_shape: tuple[int, int], corners, reach: int | None) -> np.ndarray:
    """Number of domain positions each range block is compared with, int64 ``(n,)``."""
    window = _window(pool_shape, corners, reach).astype(np.int64)
    return (window[:, 1] - window[:, 0]) * (window[:, 3] - window[:, 2])


def _window(shape, corners, reach) -> np.ndarray:
    y, x = (np.asarray(corner, np.int64) for corner in corners)
    rows, columns = shape
    window = np.empty((y.size, 4), np.int64)
    if reach is None:
        window[:] = (0, rows, 0, columns)
    else:
        window[:, 0], window[:, 1] = np.clip(y - reach, 0, rows), np.clip(y + reach + 1, 0, rows)
        window[:, 2], window[:, 3] = (
            np.clip(x - reach, 0, columns),
            np.clip(x + reach + 1, 0, columns),
        )
    return window


def _windows(pool: DomainPool, corners, part: slice, reach) -> np.ndarray:
    return _window(pool.shape, (corners[0][part], corners[1][part]), reach)


def _lane_maxima(pool: DomainPool, window, codes, cap) -> np.ndarray:
    """Largest gain of each range in each column of its window; 0 beyond the window."""
    lane_maxima, _ = correlators(int(np.sqrt(codes.shape[1])))
    width = window[:, 3:] - window[:, 2:3]
    whole = window.copy()
    whole[:, 3:] = whole[:, 2:3] + -(-width // LANES) * LANES
    best = np.zeros((len(codes), -(-int(width.max(initial=0)) // LANES) * LANES), np.float32)
    lane_maxima(pool.planes, pool.energy, pool.inverse, codes, whole, np.float32(cap), best)
    best[np.arange(best.shape[1]) >= width] = 0
    return best


def _settle(pools, windows, lanes, near, codes, centred, sigma_max, part, out: Matches) -> None:
    """Decide near-ties of one chunk in float64 and write its matches."""
    block = int(np.sqrt(centred.shape[1]))
    _, settle = correlators(block)
    sources = isometries.sources(block)
    count = len(near)
    least, slope, level = np.zeros(count), np.zeros(count), np.zeros(count)
    found = np.full((count, 3), -1, np.int32)
    multiple = np.zeros(count, np.int32)

    def sweep(first: bool) -> None:
        for pool, window, best in zip(pools, windows, lanes, strict=True):
            settle(
                pool.planes, pool.energy, pool.inverse, codes[part], window, np.float32(sigma_max),
                best, near, pool.shrunk, pool.multiple, centred[part], sources,
                least, first, found, slope, level,
            )  # fmt: skip
            if first:
                multiple[(multiple == 0) & (found[:, 0] >= 0)] = pool.multiple

    sweep(False)
    explained = least.copy()
    least -= TIE * out.energy[part]
    least[explained <= 0] = np.inf
    sweep(True)
    hit = multiple > 0
    out.multiple[part] = multiple
    for name, column in (("y", 0), ("x", 1), ("iso", 2)):
        getattr(out, name)[part] = np.where(hit, found[:, column], 0)
    out.sigma[part] = np.where(hit, slope, 0)
    out.beta[part] -= np.where(hit, slope * level, 0)
    out.gain[part] = np.where(hit, explained, 0)


def available_cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _in_chunks(search, count: int, threads: int | None, progress) -> None:
    parts = [slice(start, min(start + _CHUNK, count)) for start in range(0, count, _CHUNK)]
    workers = threads or available_cores()
    if workers == 1 or len(parts) < 2:
        for part in parts:
            search(part)
            if progress:
                progress(part.stop, count)
        return
    with ThreadPoolExecutor(workers) as pool:
        done = 0
        for part, _ in zip(parts, pool.map(search, parts), strict=True):
            done = part.stop
            if progress:
                progress(done, count)
