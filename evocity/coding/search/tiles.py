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

import numpy as np

from evocity.coding.search._kernels import ROOM, ROW, most_likely, tile_kernels, tiled
from evocity.coding.search.domains import LANES, UNCAPPED
from evocity.coding.search.likeness import UnitBlocks, range_shares, z_order
from evocity.coding.search.matches import Search, listed

#: Range blocks searched at a time: the more, the more often a tile is used while in the cache.
CHUNK = 1024
#: Rows of tiles that a range block begins with.
_SEEDS = 2


@dataclass(frozen=True, eq=False)
class Tiles:
    """Domain blocks of one pool that are not flat, `LANES` to a tile; F parts of their norm.

    planes : float32 ``(tiles, B², LANES)``, D4 coordinates of the unit blocks d̃/‖d̃‖; 0 in lanes
        that hold none.
    ceilings : float32 ``(tiles, LANES)``, σ_max·‖d̃‖, m.
    shares : float32 ``(tiles, F, LANES)``, norms of the parts of d̃/‖d̃‖, 0…1.
    tops, peaks : float32 ``(tiles,)`` and ``(tiles, F)``, the greatest of these in each tile.
    y, x : int32 ``(n,)``, where on the map each block begins, px.
    """

    planes: np.ndarray
    ceilings: np.ndarray
    shares: np.ndarray
    tops: np.ndarray
    peaks: np.ndarray
    y: np.ndarray
    x: np.ndarray


def cut_tiles(units: UnitBlocks, sigma_max: float) -> Tiles:
    """Tiles of domain blocks, alike in the norms of their parts and in their own."""
    order = z_order(np.concatenate([units.shares, np.log(units.norms)[None] / 3]))
    count, parts = -(-order.size // LANES), len(units.shares)
    found = Tiles(
        planes=np.zeros((count, units.codes.shape[1], LANES), np.float32),
        ceilings=np.zeros((count, LANES), np.float32),
        shares=np.zeros((count, parts, LANES), np.float32),
        tops=np.zeros(count, np.float32),
        peaks=np.zeros((count, parts), np.float32),
        y=units.y[order],
        x=units.x[order],
    )
    cap = min(np.float32(sigma_max), UNCAPPED)
    tiled(
        units.codes, units.norms, units.shares, order, cap, found.planes, found.ceilings,
        found.shares, found.tops, found.peaks,
    )  # fmt: skip
    return found


def best_everywhere(search: Search, tiles: Tiles, part: slice, tolerance: float = 0.0):
    """Raise ``search.best`` of one chunk of ranges by all domains in ``tiles``.

    Returns (which of the chunk, y, x on the map) of all domains within the ``tolerance`` (a share
    of the range block's energy) and rounding of that best; which ascends.
    """
    codes = search.codes[part]
    slack = search.unsure[part] + np.float32(tolerance) * search.energy[part].astype(np.float32)
    reached = reach(tiles, codes, slack, search.best[part])
    _, list_tiles = tile_kernels(search.block, tiles.shares.shape[1])
    found = listed(
        list_tiles, tiles.planes, tiles.ceilings, tiles.y, tiles.x, codes, *reached,
        search.near(part, tolerance),
    )  # fmt: skip
    order = np.argsort(found[0].astype(np.uint32), kind="stable")  # chunks are short
    return tuple(column[order] for column in found)


def reach(tiles: Tiles, codes: np.ndarray, slack: np.ndarray, best: np.ndarray):
    """Raise ``best`` (n,) to the largest gain of the range blocks ``codes`` (n, B²) in any tile.

    Returns (tile, range block, gain) ``(m,)`` each, ascending by tile: where the largest gain
    within a tile is not more than ``slack`` (n,) short of the best.
    """
    reach_tiles, _ = tile_kernels(int(np.sqrt(codes.shape[1])), tiles.shares.shape[1])
    shares = range_shares(codes)
    norms = np.linalg.norm(codes, axis=1) * np.float32(1 + 1e-6)
    first, start, used = _seeds(tiles, shares), 0, 0
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


def _seeds(tiles: Tiles, shares: np.ndarray) -> np.ndarray:
    """For each range block the rows of `ROW` tiles most likely to hold its best domain:
    those of the highest bounds. ``(at most _SEEDS · n,)``, range blocks innermost."""
    starts = np.arange(0, tiles.tops.size, ROW)
    seeds = np.empty((min(_SEEDS, starts.size), len(shares)), np.int64)
    if starts.size:
        peaks = np.ascontiguousarray(np.maximum.reduceat(tiles.peaks, starts).T)
        most_likely(peaks, np.maximum.reduceat(tiles.tops, starts), shares, seeds)
    return seeds.ravel()
