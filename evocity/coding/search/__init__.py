"""Which domain block explains a range block best? The exact search behind encoding, repair and
autosimilarity.

For a zero-mean range block r̃ and a shrunk zero-mean domain block d̃ with p = ⟨r̃, iso d̃⟩ and
e = ‖d̃‖², the energy explained with contrast σ is σ(2p − σe), greatest at σ = p/e. The cap on
\\|σ\\| belongs inside this criterion: clipping afterwards costs decibels.

domains  the pool of domain blocks, folded into D4 coordinates
shapes   range blocks alike, searched but once
likeness domain blocks alike: norms of parts, order, doubles
tiles    the search of a whole map, with bounds
nearby   the search within reach
matches  the best domain, decided in float64
blocks   compiled: what a block is, whatever it is compared with
scoring  compiled: near-ties in float64
"""

import functools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from evocity.coding.search.domains import DomainPool
from evocity.coding.search.likeness import unit_blocks
from evocity.coding.search.matches import TIE, Matches, Search
from evocity.coding.search.nearby import NEARBY, best_correlations, best_nearby, pairs_compared
from evocity.coding.search.shapes import same_shape
from evocity.coding.search.tiles import CHUNK, best_everywhere, cut_tiles
from evocity.coding.topology import Candidates

#: Domain positions of one pool that a range block may choose among.
MOST = 1024
#: Domain positions scored together.
_TOGETHER = 1 << 17


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
    of, first = _searched(blocks, reach)
    search = Search(every[first], sigma_max)
    corners = tuple(corner[first] for corner in corners)
    for pool, part, _ in _sweep(search, pools, corners, reach, threads, search.settle):
        if progress:
            progress(pool.shape[0] * len(first[part]) / len(first))
    return search.matches(every, of)


def near_best(
    pools: Iterable[DomainPool],
    blocks: np.ndarray,
    corners: tuple[np.ndarray, np.ndarray],
    matches: Matches,
    tolerance: float,
    *,
    reach: int | None,
    sigma_max: float,
    threads: int | None = 1,
    progress: Callable[[float], None] | None = None,
) -> Iterator[tuple[np.ndarray, Candidates]]:
    """All domains whose collage error is within ``tolerance`` (a share of ‖r̃‖²) of the best.

    Parameters are those of `best_matches`, and ``matches`` what it found. Yields, for some
    range blocks at a time, their indices ``(n,)`` and what they may choose among: of more than
    `MOST` domain positions in one pool those of lowest (y, x).
    """
    every = blocks.reshape(len(blocks), blocks.shape[-1] ** 2).astype(np.float64)
    of, first = _searched(blocks, reach)
    search = Search(every[first], sigma_max)
    search.best[:] = matches.gain[first]

    def listed(pool, part, which, y, x):
        order = np.lexsort((x, y, which))
        which, y, x = which[order], y[order], x[order]
        few = np.arange(which.size) - np.searchsorted(which, which) < MOST
        multiple = np.full(np.count_nonzero(few), pool.multiple)
        return which[few] + part.start, multiple, y[few] + pool.top, x[few]

    corners = tuple(corner[first] for corner in corners)
    found = []
    for pool, part, places in _sweep(search, pools, corners, reach, threads, listed, tolerance):
        found.append(places)
        if progress:
            progress(pool.shape[0] * len(first[part]) / len(first))
    if not found:
        return
    shape, *places = (np.concatenate(column) for column in zip(*found, strict=True))
    order = np.argsort(shape, kind="stable")  # pools came in the order of (D, y)
    places = [column[order] for column in places]
    bounds = np.searchsorted(shape[order], np.arange(len(first) + 1))
    sizes = np.diff(bounds)[of]
    start = 0
    while start < len(blocks):
        end = start + max(1, int(np.searchsorted(np.cumsum(sizes[start:]), _TOGETHER)))
        part = np.arange(start, min(end, len(blocks)))
        which = np.repeat(np.arange(part.size), sizes[part])
        ends = np.cumsum(sizes[part])
        at = np.arange(which.size) - np.repeat(ends - sizes[part], sizes[part])
        at += np.repeat(bounds[of[part]], sizes[part])
        least = matches.gain[part] - (tolerance + TIE) * search.energy[of[part]]
        yield part, search.scored(which, *(column[at] for column in places), every[part], least)
        start = end


def _searched(blocks: np.ndarray, reach: int | None) -> tuple[np.ndarray, np.ndarray]:
    """Which blocks are searched, and which of them each block ``(n, B, B)`` is answered by."""
    if reach is None:  # then equal blocks have equal matches
        return same_shape(blocks)
    every = np.arange(len(blocks))
    return every, every


def _sweep(
    search: Search, pools, corners, reach: int | None, threads: int | None, act, tolerance=None
):
    """``act(pool, part, which, y, x)`` on the domains that may be the best of a chunk of range
    blocks, or within the ``tolerance`` of it: yields (pool, part, what it returned) in order.
    """
    threads = threads or available_cores()
    count = len(search.codes)
    most = CHUNK if reach is None else NEARBY
    step = max(1, min(most, -(-count // threads)))
    parts = [slice(k, min(k + step, count)) for k in range(0, count, step)]
    crew = ThreadPoolExecutor(threads)
    try:
        for pool in pools:
            search.shrunk[pool.multiple] = pool.shrunk
            if reach is not None:
                _ = pool.folded  # once, before threads ask for it
                find = functools.partial(best_nearby, search, corners, reach, pool)
            else:
                # of doubles the first wins, but only their surroundings tell which fits
                units = unit_blocks(pool, doubles=tolerance is not None)
                find = functools.partial(best_everywhere, search, cut_tiles(units, search.cap))

            def compare(part, pool=pool, find=find):
                return act(pool, part, *find(part, tolerance or 0.0))

            for part, result in zip(parts, crew.map(compare, parts), strict=True):
                yield pool, part, result
    finally:
        crew.shutdown(cancel_futures=True)


def available_cores() -> int:
    """Cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


__all__ = [
    "Matches",
    "available_cores",
    "best_correlations",
    "best_matches",
    "near_best",
    "pairs_compared",
]
