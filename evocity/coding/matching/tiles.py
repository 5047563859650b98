"""Tiles of similar domain blocks, with bounds on the energy that a tile can explain.

The bounds exclude most pairs of blocks from the search of a whole map. The isometries mix D4
coordinates only within the parts s1, s2, s3, s4 and (u, w), each split in its lowest frequency and
the rest (`evocity.coding.matching.d4`). So for unit domain blocks, by Cauchy and Schwarz part by
part,

    max over isometries of |⟨r̃, iso d̃⟩|  ≤  Σ over parts of ‖r̃ part‖·‖d̃ part‖.

A tile's bound takes the greatest norm of its blocks. Similar blocks make it sharp, so tiles are cut
from the Z-order curve (Morton 1966) through the norms that vary most.
"""

from dataclasses import dataclass

import numpy as np

from evocity.coding.matching.candidates import Blocks, RangeCodes
from evocity.coding.matching.d4 import used_parts
from evocity.coding.matching.domains import UNCAPPED
from evocity.coding.matching.equivalence._kernels import z_order
from evocity.coding.matching.matches import Search, list_places

#: Range blocks of a batch: more of them use a tile more often while it is in the cache.
CHUNK = 1024
#: Rows of tiles at which a range block begins.
_SEEDS = 2


@dataclass(frozen=True, eq=False)
class Tiles:
    """The domain blocks of a pool that are not flat, `LANES` to a tile; F parts of their norm.

    planes : float32 ``(tiles, B², LANES)``, D4 coordinates of the unit blocks d̃/‖d̃‖; 0 in empty
        lanes.
    ceilings : float32 ``(tiles, LANES)``, σ_max·‖d̃‖, m.
    shares : float32 ``(tiles, F, LANES)``, norms of the parts of d̃/‖d̃‖, 0…1.
    tops, peaks : float32 ``(tiles,)`` and ``(tiles, F)``, the greatest of these in each tile.
    row_tops, row_peaks : float32 ``(rows,)`` and ``(F, rows)``, the greatest in `ROW` tiles.
    at : int64 ``(n,)``, the first pixel of each block in a raster of ``width`` px.
    """

    planes: np.ndarray
    ceilings: np.ndarray
    shares: np.ndarray
    tops: np.ndarray
    peaks: np.ndarray
    row_tops: np.ndarray
    row_peaks: np.ndarray
    at: np.ndarray
    width: int


def cut_tiles(blocks: Blocks, sigma_max: float) -> Tiles:
    """Put the blocks that are not flat in tiles of similar norms, of parts and of the whole."""
    from evocity.coding.matching._kernels import LANES, ROW
    from evocity.coding.matching.d4_folding._kernels import fold_kernels

    pixels, at, least = blocks.raster.ravel(), blocks.at, blocks.least
    block, count = int(np.sqrt(blocks.offsets.size)), -(-at.size // LANES)
    parts = len(used_parts(block))
    measure_blocks, lay_tiles = fold_kernels(block)
    values = np.empty((parts + 1, count * LANES), np.float32)
    measure_blocks(pixels, blocks.offsets, at, least, values[-1], values[:-1])
    values = values[:, : at.size]
    if not values[-1].all():
        at, values = at[values[-1] > 0], values[:, values[-1] > 0]
        count = -(-at.size // LANES)
    if np.isfinite(sigma_max):
        values[-1] = np.log(values[-1]) / 3
    else:  # without a cap, norms do not limit σ
        values = values[:-1]
    order = np.empty(at.size, np.int64)
    z_order(values, order)
    at = at[order]
    planes = np.empty((count, block * block, LANES), np.float32)
    ceilings = np.empty((count, LANES), np.float32)
    shares = np.empty((count, parts, LANES), np.float32)
    tops, peaks = np.zeros(count, np.float32), np.zeros((count, parts), np.float32)
    cap, row = min(np.float32(sigma_max), UNCAPPED), np.arange(0, count, ROW)
    lay_tiles(pixels, blocks.offsets, at, least, cap, planes, ceilings, shares, tops, peaks)
    row_tops = np.maximum.reduceat(tops, row) if count else tops
    row_peaks = np.ascontiguousarray((np.maximum.reduceat(peaks, row) if count else peaks).T)
    most = tops, peaks, row_tops, row_peaks
    return Tiles(planes, ceilings, shares, *most, at, blocks.raster.shape[1])


def best_everywhere(search: Search, tiles: Tiles, part: slice, tolerance: float = 0.0):
    """Raise ``search.best`` of a chunk of range blocks by all domain blocks in ``tiles``. Returns
    (which of the chunk, ascending, y, x) of all domain blocks within the ``tolerance`` (a share of
    the range block's energy) and rounding of that best."""
    from evocity.coding.matching._kernels import tile_kernels

    ranges = search.ranges[part]
    slack = search.unsure[part] + np.float32(tolerance) * search.energy[part].astype(np.float32)
    near = raise_best(tiles, ranges, slack, search.best[part])
    _, list_tiles = tile_kernels(search.block, tiles.shares.shape[1])
    pairs = list_places(
        list_tiles, 2, tiles.planes, tiles.ceilings, tiles.at, ranges.codes, *near,
        search.near(part, tolerance),
    )  # fmt: skip
    which, at = pairs[:, np.argsort(pairs[0].astype(np.uint32), kind="stable")]  # chunks are short
    return which, *np.divmod(at, tiles.width)


def raise_best(tiles: Tiles, ranges: RangeCodes, slack: np.ndarray, best: np.ndarray):
    """Raise ``best`` (n,) to the largest gain of the range blocks in any tile. Returns (tile, range
    block, gain) ``(m,)`` each, ascending by tile, wherever the largest gain within a tile comes
    within ``slack`` (n,) of the best."""
    from evocity.coding.matching._kernels import ROOM, most_likely, tile_kernels

    codes, shares, norms = ranges.codes, ranges.shares, ranges.norms
    reach_tiles, _ = tile_kernels(int(np.sqrt(codes.shape[1])), shares.shape[1])
    first = np.empty((min(_SEEDS, tiles.row_tops.size), len(codes)), np.int64)
    most_likely(tiles.row_peaks, tiles.row_tops, shares, first)
    first, start, used = first.ravel(), 0, 0
    places, gains = np.empty((2, ROOM), np.int32), np.empty(ROOM, np.float32)
    while True:
        start, used = reach_tiles(
            tiles.planes, tiles.ceilings, tiles.shares, tiles.peaks, tiles.tops, codes, shares,
            norms, slack, first, best, start, used, places, gains,
        )  # fmt: skip
        if start == tiles.tops.size:
            return *places[:, :used], gains[:used]
        more = ((0, 0), (0, used + 2 * len(codes)))
        first, places, gains = first[:0], np.pad(places, more), np.pad(gains, more[1])
