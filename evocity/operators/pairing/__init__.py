"""Which range block of another city has this one's content? Pairing, for the fusions by content.

The papers pair the range blocks of two cities before they exchange lifs (appariement: Marsault
2002 §4.3, 2005 §2.3): lifs code contents, so genes meet that have the same task.
"""

from collections.abc import Sequence

import numpy as np

from evocity.coding.topology import Candidates, closest_neighbourhood
from evocity.genome import Genome, Pieces
from evocity.isometries import sources
from evocity.operators.pairing._kernels import CHUNK, LANES, alike_blocks, block_traits
from evocity.pavement import Pavement

#: Blocks, each under one isometry, that a range block may choose among by their surroundings.
MOST = 64
#: Range blocks paired together: a bound on memory.
_TOGETHER = 1 << 16


def paired(
    heights: np.ndarray,
    others: np.ndarray,
    pavement: Pavement,
    flat: np.ndarray,
    which: np.ndarray,
    *,
    isometries: bool = False,
    alike: float = 0.01,
) -> tuple[np.ndarray, np.ndarray]:
    """For range blocks of ``heights`` those of ``others`` whose content is closest.

    Contents are compared by the root mean square of their differences, metres, level included.
    Of those within ``alike`` of the least the one in the closest surroundings is taken
    (`closest_neighbourhood`, topological collage: Marsault 2005 §2.1); of equal ones that at the
    same place, else that of the lowest (y, x, iso). Of more than `MOST` the first in that order
    are asked.

    Parameters
    ----------
    heights, others : float32 ``(H, W)``, metres: maps on one ``pavement``.
    flat : bool ``(n,)``: blocks of ``others`` that are level and coded so. They are one as good
        as another: where the closest is one of them, it is that at the same place, else the
        first of its level.
    which : int64 ``(m,)``: the range blocks of ``heights`` to pair.
    isometries : compare under all 8, and not only as the blocks lie.
    alike : metres, 0 or more.

    Returns
    -------
    index, iso : int64 ``(m,)`` each: the which[i]-th block is closest to the index[i]-th of
        ``others`` under isometry iso[i].

    Exact: as good as comparing all pairs, in float32.
    """
    cut = (pavement.blocks(one).reshape(len(pavement), -1) for one in (heights, others))
    return _paired(heights, others, *cut, pavement, flat, which, isometries, alike)


def _paired(heights, others, ours, theirs, pavement, flat, which, isometries, alike):
    """`paired`, of maps whose range blocks, ``(n, B²)``, are cut already."""
    (relief,) = np.nonzero(~flat)
    groups = _grouped(relief, theirs[relief]) if relief.size else None
    images = sources(pavement.block)[: 8 if isometries else 1].astype(np.int64)
    index, iso = np.empty(which.size, np.int64), np.zeros(which.size, np.int64)
    for start in range(0, which.size, _TOGETHER):
        part = slice(start, start + _TOGETHER)
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
        keys[several, 0] = _in_surroundings(
            heights, others, pavement, here[several], keys[several], count[several]
        )
        (found,) = np.nonzero(count)
        index[start + found], iso[start + found] = _read(keys[found, 0], here[found])
    return index, iso


def pairing(
    grid: Pavement,
    second: Genome,
    maps: Sequence[np.ndarray],
    *,
    isometries: bool,
    alike: float,
    where: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Cells of the ``grid``, as range blocks are `paired`: for each of the first city the cell of
    the ``second``, and the isometry, int64 ``(n,)`` each.

    ``maps`` are the two cities' decoded heights, float32 ``(H, W)``; ``where``, bool ``(n,)``,
    tells which cells to pair if not all: the others are paired with what the second has there.
    """
    index, iso = np.arange(len(grid)), np.zeros(len(grid), np.int64)
    which = index.copy() if where is None else np.flatnonzero(where)
    ours, theirs = (grid.blocks(one).reshape(len(grid), -1) for one in maps)
    flat = level_cells(grid, second, theirs)
    index[which], iso[which] = _paired(*maps, ours, theirs, grid, flat, which, isometries, alike)
    return index, iso


def paired_pieces(grid: Pavement, whose, index: np.ndarray, iso: np.ndarray) -> Pieces:
    """What `pairing` found as pieces of the genomes ``whose`` (one number, or one a cell)."""
    shape = grid.rows, grid.columns
    row, column = np.divmod(index.reshape(shape), grid.columns)
    whose = np.broadcast_to(np.asarray(whose), (len(grid),)).reshape(shape)
    return Pieces(grid.block, whose, row, column, iso.reshape(shape))


def mosaic_of(
    grid: Pavement, heights: np.ndarray, index: np.ndarray, iso: np.ndarray
) -> np.ndarray:
    """``(H, W)``: cell i is the index[i]-th of ``heights`` (H, W), turned by iso[i]."""
    cut = grid.blocks(heights).reshape(len(grid), -1)
    return _mosaic(cut, grid, index, iso)


def level_cells(grid: Pavement, genome: Genome, blocks: np.ndarray) -> np.ndarray:
    """Bool ``(n,)``: cells of lifs without a domain whose ``blocks`` (n, B²) of the decoded map are
    level."""
    flat = grid.blocks(genome.pavement.raster(genome.uniform)).all(axis=(1, 2))
    return flat & (blocks == blocks[:, :1]).all(axis=1)


def _traits(blocks: np.ndarray) -> np.ndarray:
    """Float32 ``(n, 2)``: B · mean, and the norm of the block made zero-mean. No isometry changes
    them, and blocks are no closer than these points."""
    traits = np.empty((len(blocks), 2), np.float32)
    block_traits(blocks, traits)
    return traits


def _closest_level(
    traits: np.ndarray, theirs: np.ndarray, flat: np.ndarray, here: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """For each of the blocks of ``traits`` the index of the flat one closest to it, that at the
    same place (``here``) before others, and their squared distance, float32; infinite if none
    is flat."""
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


def _grouped(which: np.ndarray, blocks: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Blocks ``(m, B²)``, the ``which``-th, in groups ``(G, pixels · LANES)`` of close traits; the
    indices of each group's members ``(G, LANES)``, −1 for none, and the rectangle their traits
    lie in ``(4, G)``.

    Sorted along one axis, cut in slabs, each of which is sorted along the other (sort-tile-
    recursive packing: Leutenegger 1997).
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


def _in_surroundings(heights, others, pavement, which, keys, count) -> np.ndarray:
    """Of the first count[i] ``keys`` of the which[i]-th block, that in the closest surroundings."""
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
    """Index and isometry that each of the ``keys`` of a kernel's block ``here`` stands for."""
    return np.where(keys < 0, here, keys // 8), keys % 8


def _mosaic(theirs: np.ndarray, pavement: Pavement, index, iso) -> np.ndarray:
    """``(H, W)``: range block i is the index[i]-th of ``theirs`` (n, B²), turned by iso[i]."""
    pixels = theirs[index]
    (turned,) = np.nonzero(iso)
    images = sources(pavement.block)[iso[turned]]
    pixels[turned] = np.take_along_axis(pixels[turned], images, axis=1)
    return pavement.raster(pixels.reshape(-1, pavement.block, pavement.block))
