"""Domain blocks in tiles of their like, and bounds on what a tile can explain.

The search of a whole map compares every range block with every domain block; most pairs are
hopeless, and a bound can tell. The isometries mix D4 coordinates only within the parts s1, s2,
s3, s4 and (u, w) of a block (see `evocity.coding.search.domains`), so that for unit domain
blocks, by Cauchy and Schwarz part by part,

    max over isometries of |⟨r̃, iso d̃⟩|  ≤  Σ over parts of ‖r̃ part‖·‖d̃ part‖.

Each part is split once more, into its lowest frequency and the rest, and a tile's bound takes
the greatest norm of its domain blocks. The fewer kinds of blocks a tile holds, the sharper the
bound: tiles are cut from the Z-order curve (Morton 1966) through the norms that vary most.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from evocity.coding.search._kernels import (
    ABREAST,
    most_likely,
    tile_bounds,
    tile_kernels,
    tiled,
)
from evocity.coding.search.blocks import kinds, part_norms
from evocity.coding.search.domains import LANES, UNCAPPED, DomainPool, d4_basis, part_sizes
from evocity.coding.search.matches import Search, listed

#: Range blocks searched at a time: the more, the more often a tile is used while in the cache.
CHUNK = 1024
#: Norms that the order of domain blocks goes by, and bits of each.
_KEYS, _BITS = 5, 3
#: Rows of tiles that a range block begins with.
_SEEDS = 8


@dataclass(frozen=True, eq=False)
class Tiles:
    """Domain blocks of one pool that are not flat, `LANES` to a tile; F parts of their norm.

    planes : float32 ``(rows, B², …)``, D4 coordinates of the unit blocks d̃/‖d̃‖, `ABREAST` tiles
        to a row; 0 in lanes that hold none.
    ceilings : float32 ``(rows, ABREAST · LANES)``, σ_max·‖d̃‖, m.
    shares : float32 ``(tiles, F, LANES)``, norms of the parts of d̃/‖d̃‖, 0…1.
    tops, peaks : float32 ``(tiles,)`` and ``(F, tiles)``, the greatest of these in each tile.
    y, x : int32 ``(tiles · LANES,)``, where in its pool each block lies.
    """

    planes: np.ndarray
    ceilings: np.ndarray
    shares: np.ndarray
    tops: np.ndarray
    peaks: np.ndarray
    y: np.ndarray
    x: np.ndarray


def cut_tiles(planes: np.ndarray, norms: np.ndarray, places: np.ndarray, sigma_max: float) -> Tiles:
    """Tiles of the unit blocks ``planes`` (rows, B², columns), of ``norms`` (rows, columns) in
    metres, at ``places`` (n,) = y · columns + x, ascending."""
    block = int(np.sqrt(planes.shape[1]))
    shares = _part_norms(planes, places, block)
    order = _order(np.concatenate([shares, np.log(norms.flat[places])[None] / 3]))
    rows = -(-places.size // (ABREAST * LANES))
    count, width = rows * ABREAST, ABREAST * LANES
    found = Tiles(
        # a row's width of a power of two would set its planes on top of one another in the cache
        planes=np.zeros((rows, block**2, width + LANES), np.float32),
        ceilings=np.zeros((rows, width), np.float32),
        shares=np.zeros((count, len(shares), LANES), np.float32),
        tops=np.zeros(count, np.float32),
        peaks=np.zeros((len(shares), count), np.float32),
        y=np.zeros(rows * width, np.int32),
        x=np.zeros(rows * width, np.int32),
    )
    cap = min(np.float32(sigma_max), UNCAPPED)
    tiled(
        planes, norms, places[order], shares[:, order], cap, found.planes, found.ceilings,
        found.shares, found.tops, found.peaks, found.y, found.x,
    )  # fmt: skip
    return found


def distinct(pool: DomainPool) -> np.ndarray:
    """Places y · columns + x of the domain blocks of ``pool`` that are not flat, of those that
    differ by a level alone the first: no other can win. Ascending."""
    room = int(np.count_nonzero(pool.norms))
    firsts = np.empty(room, np.int64)
    table = np.zeros(2 << room.bit_length(), np.int32)
    block = int(np.sqrt(pool.planes.shape[1]))
    count = kinds(
        pool.planes, pool.norms, pool.shrunk, pool.multiple, block, pool.top, table, firsts
    )
    return firsts[:count]


def range_shares(codes: np.ndarray) -> np.ndarray:
    """Norms of the parts of range blocks from their D4 coordinates ``(n, B²)``: ``(n, F)``."""
    planes = np.ascontiguousarray(codes.T)[None]
    every = np.arange(len(codes))
    return np.ascontiguousarray(_part_norms(planes, every, int(np.sqrt(codes.shape[1]))).T)


def _part_norms(planes: np.ndarray, places: np.ndarray, block: int) -> np.ndarray:
    sizes = np.array(part_sizes(block))
    shares = np.empty((2 * sizes.size, places.size), np.float32)
    part_norms(planes, places, sizes, lowest(block), shares)
    return shares[list(used_parts(block))]


def best_everywhere(search: Search, tiles: Tiles, part: slice, tolerance: float = 0.0):
    """Raise ``search.best`` of one chunk of ranges by all domains in ``tiles``.

    Returns (which of the chunk, y, x) of all domains within the ``tolerance`` (a share of the
    range block's energy) and rounding of that best.
    """
    codes = search.codes[part]
    slack = search.unsure[part] + np.float32(tolerance) * search.energy[part].astype(np.float32)
    reached = reach(tiles, codes, slack, search.best[part])
    _, list_tiles = tile_kernels(search.block, tiles.shares.shape[1])
    return listed(
        list_tiles, tiles.planes, tiles.ceilings, tiles.y, tiles.x, codes, reached,
        search.near(part, tolerance),
    )  # fmt: skip


def reach(tiles: Tiles, codes: np.ndarray, slack: np.ndarray, best: np.ndarray) -> np.ndarray:
    """Raise ``best`` (n,) to the largest gain of the range blocks ``codes`` (n, B²) in any tile.

    Returns float32 ``(n, tiles)``: the largest gain within each tile, or −1 where it is sure to
    fall more than ``slack`` short of the best.
    """
    reach_tiles, _ = tile_kernels(int(np.sqrt(codes.shape[1])), tiles.shares.shape[1])
    shares = range_shares(codes)
    norms = np.linalg.norm(codes, axis=1) * np.float32(1 + 1e-6)
    reached = np.empty((len(codes), len(tiles.tops)), np.float32)
    if not reached.size:
        return reached
    tile_bounds(tiles.peaks, tiles.tops, shares, norms, reached)
    reach_tiles(
        tiles.planes, tiles.ceilings, tiles.shares, codes, shares, norms, slack,
        _seeds(tiles, shares), reached, best,
    )  # fmt: skip
    return reached


def _seeds(tiles: Tiles, shares: np.ndarray) -> np.ndarray:
    """For each range block the rows of tiles most likely to hold its best domain: those of the
    highest bounds, were its own energy no limit. ``(n, at most _SEEDS)``"""
    peaks = tiles.peaks.reshape(len(tiles.peaks), len(tiles.planes), ABREAST).max(axis=2)
    tops = tiles.tops.reshape(-1, ABREAST).max(axis=1)
    likings = np.empty((len(shares), tops.size), np.float32)
    tile_bounds(peaks, tops, shares, np.full(len(shares), np.inf, np.float32), likings)
    seeds = np.empty((len(shares), min(_SEEDS, tops.size)), np.int64)
    most_likely(likings, seeds)
    return seeds


@cache
def lowest(block: int) -> np.ndarray:
    """For each part the unit vector, in its own coordinates, of the block's lowest frequency
    (cosine transform) in that part: float32, the parts one after another; u and w share one."""
    wave = np.cos(np.pi * (np.arange(block) + 0.5)[None] * np.arange(block)[:, None] / block)
    first = {"s1": (0, 2, 1), "s2": (0, 2, -1), "s3": (1, 1, 1), "s4": (1, 3, -1), "u": (0, 1, 0)}
    basis, vectors, start = d4_basis(block), [], 0
    for size, (i, j, sign) in zip(part_sizes(block), first.values(), strict=True):
        vector = np.zeros(size)
        if max(i, j) < block:
            image = np.outer(wave[i], wave[j])
            image = image + sign * image.T
            vector = basis[start : start + size] @ image.ravel()
        norm = np.linalg.norm(vector)
        vectors.append(vector / norm if norm > 1e-9 else vector)
        start += size
    lowest = np.concatenate(vectors).astype(np.float32)
    lowest.setflags(write=False)
    return lowest


@cache
def used_parts(block: int) -> tuple[int, ...]:
    """Which of the norms (lowest, rest of each part) are not 0 for every block."""
    start, used = 0, []
    for part, size in enumerate(part_sizes(block)):
        low = bool(lowest(block)[start : start + size].any())
        # the mean is no variation: a part s1 holds one dimension less than coordinates
        room = size - (part == 0)
        used += [2 * part] * low + [2 * part + 1] * (room > low)
        start += size
    return tuple(used)


def _order(values: np.ndarray) -> np.ndarray:
    """Order of the columns of ``(F, n)`` along a Z-order curve through the rows that vary most."""
    key = np.zeros(values.shape[1], np.uint16)
    if not key.size:
        return np.argsort(key)
    most = np.argsort(-values[:, :: max(1, key.size >> 12)].std(axis=1), kind="stable")[:_KEYS]
    low = values[most].min(axis=1, keepdims=True)
    span = np.maximum(values[most].max(axis=1, keepdims=True) - low, np.float32(1e-6))
    cells = ((values[most] - low) * ((1 << _BITS) - 0.01) / span).astype(np.uint16)
    for bit in reversed(range(_BITS)):
        for cell in cells:
            key = key << 1 | cell >> bit & 1
    return np.argsort(key, kind="stable")
