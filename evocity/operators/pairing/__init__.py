"""Pairing of range blocks of two cities by their contents, for the fusions by content.

The papers pair the range blocks of two cities before they exchange lifs (appariement: Marsault
2002 §4.3, 2005 §2.3). Lifs code contents, so genes with the same task meet.
"""

from collections.abc import Sequence

import numpy as np

from evocity.coding.topology import Candidates, closest_neighbourhood
from evocity.genome import Genome, Pieces
from evocity.isometries import sources
from evocity.operators.pairing._kernels import CHUNK, LANES, alike_blocks, block_traits
from evocity.pavement import Pavement

#: The most blocks, each under an isometry, that a range block may choose among by surroundings.
MOST = 64
#: Range blocks of a batch: a bound on memory.
_BATCH = 1 << 16


def pair_blocks(
    heights: np.ndarray,
    others: np.ndarray,
    pavement: Pavement,
    flat: np.ndarray,
    which: np.ndarray,
    *,
    isometries: bool = False,
    alike: float = 0.01,
) -> tuple[np.ndarray, np.ndarray]:
    """Pair range blocks of ``heights`` with those of ``others`` whose content is closest.

    The distance of contents is the root mean square of their differences, metres, level included.
    Of those within ``alike`` of the least, the closest surroundings win (`closest_neighbourhood`,
    topological collage: Marsault 2005 §2.1); of equals the same place, else the lowest (y, x, iso).
    Of more than `MOST` only the first in that order count.

    heights, others : maps on one ``pavement``, float32 ``(H, W)``, metres.
    flat : blocks of ``others`` that are level and coded so, bool ``(n,)``. All flat blocks of a
        level are equivalent: the same place wins, else the first of the level.
    which : the range blocks of ``heights`` to pair, int64 ``(m,)``.
    isometries : whether to compare under all 8.

    Returns index and isometry of the closest block for each of ``which``, int64 ``(m,)``. The
    result is exact: it equals a comparison of all pairs, in float32.
    """
    ours, theirs = (_cut(pavement, raster) for raster in (heights, others))
    (relief,) = np.nonzero(~flat)
    groups = _group_blocks(relief, theirs[relief]) if relief.size else None
    images = sources(pavement.block)[: 8 if isometries else 1].astype(np.int64)
    index, iso = np.empty(which.size, np.int64), np.zeros(which.size, np.int64)
    for start in range(0, which.size, _BATCH):
        part = slice(start, start + _BATCH)
        here = which[part]
        traits = _traits(ours[here])
        index[part], gap = _closest_level(traits, theirs, flat, here)
        if groups is None:
            continue
        keys, count = np.empty((here.size, MOST), np.int64), np.empty(here.size, np.int64)
        stays = flat[here] & (index[part] == here)
        slack = np.float32(alike * pavement.block)
        alike_blocks(ours[here], here, traits, gap, stays, *groups, images, slack, keys, count)
        (several,) = np.nonzero(count > 1)
        keys[several, 0] = _choose_by_surroundings(
            heights, others, pavement, here[several], keys[several], count[several]
        )
        (some,) = np.nonzero(count)
        index[start + some], iso[start + some] = _read(keys[some, 0], here[some])
    return index, iso


def pair_cells(
    grid: Pavement,
    second: Genome,
    maps: Sequence[np.ndarray],
    *,
    isometries: bool,
    alike: float,
    where: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Pair cells of the ``grid`` as by `pair_blocks`: for each cell of the first city a cell of the
    ``second`` and an isometry, int64 ``(n,)`` each.

    ``maps`` are the two cities' decoded heights, float32 ``(H, W)``. ``where``, bool ``(n,)``,
    selects cells; others are paired with the second's cell at the same place.
    """
    index, iso = np.arange(len(grid)), np.zeros(len(grid), np.int64)
    which = index.copy() if where is None else np.flatnonzero(where)
    flat = level_cells(grid, second, _cut(grid, maps[1]))
    how = {"isometries": isometries, "alike": alike}
    index[which], iso[which] = pair_blocks(*maps, grid, flat, which, **how)
    return index, iso


def pieces_of(grid: Pavement, whose, index: np.ndarray, iso: np.ndarray) -> Pieces:
    """Make pieces of the result of `pair_cells`; ``whose``: a genome's number, or one per cell."""
    shape = grid.rows, grid.columns
    row, column = np.divmod(index.reshape(shape), grid.columns)
    whose = np.broadcast_to(np.asarray(whose), (len(grid),)).reshape(shape)
    return Pieces(grid.block, whose, row, column, iso.reshape(shape))


def mosaic(grid: Pavement, heights: np.ndarray, index: np.ndarray, iso: np.ndarray) -> np.ndarray:
    """Lay a map ``(H, W)`` whose cell i is the index[i]-th of ``heights`` (H, W), turned by
    iso[i]."""
    pixels = _cut(grid, heights)[index]
    (turned,) = np.nonzero(iso)
    images = sources(grid.block)[iso[turned]]
    pixels[turned] = np.take_along_axis(pixels[turned], images, axis=1)
    return grid.raster(pixels.reshape(-1, grid.block, grid.block))


def level_cells(grid: Pavement, genome: Genome, blocks: np.ndarray) -> np.ndarray:
    """Find cells of lifs without a domain block whose ``blocks`` (n, B²) of the decoded map are
    level: bool ``(n,)``."""
    flat = grid.blocks(genome.pavement.raster(genome.uniform)).all(axis=(1, 2))
    return flat & (blocks == blocks[:, :1]).all(axis=1)


def _cut(grid: Pavement, heights: np.ndarray) -> np.ndarray:
    """Cut a map (H, W) into cells, ``(n, B²)``."""
    return grid.blocks(heights).reshape(len(grid), -1)


def _traits(blocks: np.ndarray) -> np.ndarray:
    """Compute traits of blocks, float32 ``(n, 2)``: B · mean, and the norm of the zero-mean block.
    No isometry changes them, and blocks are at least as far apart as these points."""
    traits = np.empty((len(blocks), 2), np.float32)
    block_traits(blocks, traits)
    return traits


def _closest_level(
    traits: np.ndarray, theirs: np.ndarray, flat: np.ndarray, here: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Find for each of the blocks of ``traits`` the closest flat block, the same place (``here``)
    before others; returns its index and the squared distance, float32, infinite without flat
    blocks."""
    (where,) = np.nonzero(flat)
    if where.size == 0:
        return here.copy(), np.full(here.size, np.inf, np.float32)
    side = np.float32(np.sqrt(theirs.shape[1]))
    levels, first = np.unique(theirs[where, 0] * side, return_index=True)
    between = (levels[1:].astype(np.float64) + levels[:-1]) / 2
    nearest = np.searchsorted(between, traits[:, 0])
    gap = (traits[:, 0] - levels[nearest]) ** 2 + traits[:, 1] ** 2
    same = flat[here] & (theirs[here, 0] * side == levels[nearest])
    return np.where(same, here, where[first[nearest]]), gap


def _group_blocks(
    which: np.ndarray, blocks: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Group blocks ``(m, B²)``, the ``which``-th, by close traits: ``(G, pixels · LANES)``. Returns
    also the indices of each group's members ``(G, LANES)``, −1 for none, and the bounds of their
    traits ``(4, G)``.

    One axis sorts the blocks; slabs of them are sorted along the other (sort-tile-recursive
    packing: Leutenegger 1997).
    """
    count, pixels = blocks.shape
    traits = _traits(blocks)
    slab = np.empty(count, np.int64)
    slabs = int(np.ceil(np.sqrt(count / LANES)))
    slab[np.argsort(traits[:, 0])] = np.arange(count) * slabs // count
    order = np.argsort(slab + traits[:, 1].astype(np.float64) / (1 + float(traits[:, 1].max())))
    order = np.append(order, np.repeat(order[-1], -count % LANES))  # filled up with its last
    members = which[order]
    members[count:] = -1
    filled = np.zeros((order.size, pixels + -pixels % CHUNK), np.float32)
    filled[:, :pixels] = blocks[order]
    groups = np.ascontiguousarray(filled.reshape(-1, LANES, filled.shape[1]).swapaxes(1, 2))
    lying = traits.T[:, order].reshape(2, -1, LANES)
    corners = np.stack([lying.min(axis=2), lying.max(axis=2)], axis=1).reshape(4, -1)
    return groups.reshape(len(groups), -1), members.reshape(-1, LANES), corners


def _choose_by_surroundings(heights, others, pavement, which, keys, count) -> np.ndarray:
    """Choose of the first count[i] ``keys`` of the which[i]-th block the closest surroundings."""
    used = np.arange(keys.shape[1]) < count[:, None]
    listed = np.sort(np.where(used, keys, np.iinfo(keys.dtype).max))[used]
    block, iso = _read(listed, which.repeat(count))
    top, left = pavement.corners
    every = np.ones(listed.size)
    candidates = Candidates(
        starts=np.concatenate([[0], np.cumsum(count)]),
        multiple=every.astype(np.int64),
        y=top[block],
        x=left[block],
        iso=iso,
        sigma=every,
        beta=0 * every,
    )
    chosen = closest_neighbourhood(
        heights, pavement.block, (top[which], left[which]), candidates, domain_heights=others
    )
    return listed[chosen]


def _read(keys: np.ndarray, here: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Decode ``keys`` of a kernel's block ``here``: index and isometry."""
    return np.where(keys < 0, here, keys // 8), keys % 8
