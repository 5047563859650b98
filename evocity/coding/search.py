"""Which domain block explains a range block best? The exact search behind encoding, repair and
autosimilarity.

For a zero-mean range block r̃ and a shrunk zero-mean domain block d̃ with p = ⟨r̃, iso d̃⟩ and
e = ‖d̃‖², the energy explained with contrast σ is σ(2p − σe), greatest at σ = p/e. The cap on
\\|σ\\| belongs inside this criterion: clipping afterwards costs decibels.
"""

import functools
import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from evocity import isometries
from evocity.coding._kernels import correlators
from evocity.coding.domains import LANES, DomainPool, d4_matrix, domain_pools
from evocity.coding.shapes import same_shape

#: Gains closer than this share of the range block's energy are a tie, won by the lowest
#: (D, y, x, iso).
TIE = 1e-9
#: How far float32 gains may be off, as a share of the energy; closer ones are re-scored.
_UNSURE = 2e-5
#: Domain positions re-scored together, at most `LANES`.
_GROUP = 16
#: Range blocks a thread takes at a time.
_CHUNK = 64
#: Ever better domains remembered for each range block until the best is known.
_RECORDS = 16


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
    pools: Iterable[DomainPool],
    blocks: np.ndarray,
    corners: tuple[np.ndarray, np.ndarray],
    *,
    reach: int | None,
    sigma_max: float,
    threads: int | None = 1,
    progress: Callable[[float], None] | None = None,
) -> Matches:
    """Exact search: the same optimum as trying every domain, isometry and size.

    Parameters
    ----------
    pools : the domain blocks, as `domain_pools` yields them.
    blocks : ``(n, B, B)`` range blocks, metres.
    corners : (y, x) of the range blocks' north-west pixels, ``(n,)`` each.
    reach : how far a domain's corner may lie from the range's along each axis, px; None for
        the whole map.
    sigma_max : cap on \\|σ\\|; ``inf`` for none.
    threads : threads to use; None for all cores. The result does not depend on it.
    progress : called with the rows of domain blocks done since the last call, on average.

    Ties (gains within `TIE` of the block's energy) go to the lowest (D, y, x, iso).
    """
    every = blocks.reshape(len(blocks), blocks.shape[-1] ** 2).astype(np.float64)
    if reach is None:  # then equal blocks have equal matches
        of, first = same_shape(blocks)
    else:
        of = first = np.arange(len(blocks))
    search = _Search(every[first], tuple(corner[first] for corner in corners), reach, sigma_max)
    parts = [slice(k, k + _CHUNK) for k in range(0, len(first), _CHUNK)]
    crew = ThreadPoolExecutor(threads or available_cores())
    try:
        for pool in pools:
            for part in crew.map(functools.partial(search.compare, pool), parts):
                if progress:
                    progress(pool.shape[0] * len(first[part]) / len(first))
    finally:
        crew.shutdown(cancel_futures=True)
    return search.matches(every, of)


class _Search:
    """What is known of n range blocks while pool after pool goes by."""

    def __init__(self, flat: np.ndarray, corners, reach, sigma_max: float):
        count, pixels = flat.shape
        self.block, self.reach, self.cap = int(np.sqrt(pixels)), reach, np.float32(sigma_max)
        self.corners = corners
        self.centred = flat - flat.mean(axis=1, keepdims=True)
        self.energy = np.einsum("nk,nk->n", self.centred, self.centred)
        self.codes = self.centred.astype(np.float32) @ d4_matrix(self.block).T
        self.best = np.zeros(count, np.float32)
        self.records = np.zeros((count, _RECORDS))
        self.places = np.zeros((count, _RECORDS, 3), np.int32)
        self.count = np.zeros(count, np.int64)
        self.shrunk: dict[int, np.ndarray] = {}

    def compare(self, pool: DomainPool, part: slice) -> slice:
        """Take the domains of ``pool`` into account for one chunk of range blocks."""
        lane_maxima, (settle, _) = correlators(self.block)
        self.shrunk[pool.multiple] = pool.shrunk
        window = _window(pool, tuple(corner[part] for corner in self.corners), self.reach)
        first_row, last_row = int(window[:, 0].min()), int(window[:, 1].max())
        if first_row >= last_row:
            return part
        width = window[:, 3:] - window[:, 2:3]
        band = max(16, -(-(last_row - first_row) // 32))
        bands = range(first_row, last_row, band)
        lanes = -(-int(width.max()) // LANES) * LANES
        best = np.zeros((len(bands), len(window), lanes), np.float32)
        for rows, maxima in zip(bands, best, strict=True):
            within = window.copy()
            within[:, :2] = np.clip(window[:, :2], rows, rows + band)
            within[:, 3:] = window[:, 2:3] + -(-width // LANES) * LANES
            lane_maxima(
                pool.planes, pool.energy, pool.inverse, self.codes[part], within, self.cap, maxima
            )
        best[:, np.arange(lanes) >= width] = 0
        self.best[part] = np.maximum(self.best[part], best.max(axis=(0, 2)))
        near = self.best[part] - np.float32(_UNSURE) * self.energy[part].astype(np.float32)
        settle(
            pool.planes, pool.energy, pool.inverse, self.codes[part], window, self.cap,
            best, first_row, band, np.maximum(near, np.float32(1e-30)),
            pool.shrunk, pool.multiple, self.centred[part], isometries.sources(self.block),
            pool.top, self.records[part], self.places[part], self.count[part],
            TIE * self.energy[part], _GROUP,
        )  # fmt: skip
        return part

    def matches(self, every: np.ndarray, of: np.ndarray) -> Matches:
        """The result for all blocks ``(n, B²)``; block i has the shape of the of[i]-th searched."""
        _, (_, resolve) = correlators(self.block)
        number = np.arange(_RECORDS)
        kept = number < self.count[:, None]
        most = self.records.max(axis=1, initial=0, where=kept)
        least = most - TIE * self.energy
        wins = kept & (self.records >= least[:, None])
        place = self.places[np.arange(len(most)), np.argmax(wins, axis=1)]
        place = np.where(wins.any(axis=1)[:, None], place, 0)[of]
        multiple, y, x = place.T
        means = every.mean(axis=1)
        centred = every - means[:, None]
        iso = np.zeros(len(every), np.uint8)
        slope, level = np.zeros(len(every)), np.zeros(len(every))
        for step, shrunk in self.shrunk.items():
            (hit,) = np.nonzero(multiple == step)
            found = np.zeros(hit.size, np.uint8), np.zeros(hit.size), np.zeros(hit.size)
            resolve(
                shrunk, step, y[hit], x[hit], centred[hit], isometries.sources(self.block),
                self.cap, least[of[hit]], *found,
            )  # fmt: skip
            iso[hit], slope[hit], level[hit] = found
        return Matches(
            multiple=multiple,
            y=y,
            x=x,
            iso=iso,
            sigma=slope,
            beta=means - slope * level,
            gain=most[of],
            energy=np.einsum("nk,nk->n", centred, centred),
        )


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
    for pool in domain_pools(heights, block, domains, flat):
        for start in range(0, busy.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            window = _window(pool, tuple(corner[part] for corner in corners), reach)
            best = _lane_maxima(pool, window, codes[part], np.inf).max(axis=1, initial=0)
            np.maximum(gain[part], best, out=gain[part])
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


def available_cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def _window(pool: DomainPool, corners, reach: int | None) -> np.ndarray:
    """(top, bottom, left, right) of the domain positions of each range block within ``pool``."""
    return _clipped(pool.top, *pool.shape, corners, reach)


def _clipped(top: int, rows: int, columns: int, corners, reach: int | None) -> np.ndarray:
    y, x = (np.asarray(corner, np.int64) for corner in corners)
    window = np.empty((y.size, 4), np.int64)
    if reach is None:
        window[:] = (0, rows, 0, columns)
    else:
        window[:, 0] = np.clip(y - top - reach, 0, rows)
        window[:, 1] = np.clip(y - top + reach + 1, 0, rows)
        window[:, 2] = np.clip(x - reach, 0, columns)
        window[:, 3] = np.clip(x + reach + 1, 0, columns)
    return window


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
