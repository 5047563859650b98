"""Exact search for the domain block that explains a range block best, for encoding, repair and
autosimilarity.

For a zero-mean range block r̃ and a shrunk zero-mean domain block d̃ with p = ⟨r̃, iso d̃⟩ and
e = ‖d̃‖², the energy explained with contrast σ is σ(2p − σe), greatest at σ = p/e. The cap on
\\|σ\\| belongs inside this criterion: clipping afterwards costs decibels.
"""

import functools
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from evocity.coding.matching.candidates import Shapes, domain_blocks
from evocity.coding.matching.domains import DomainPool
from evocity.coding.matching.local_search import (
    best_correlations,
    best_nearby,
    chunk_size,
    pairs_compared,
)
from evocity.coding.matching.matches import TIE, Matches, Search
from evocity.coding.matching.tiles import CHUNK, best_everywhere, cut_tiles
from evocity.coding.parameters import Coding
from evocity.coding.topology import Candidates

#: The most domain positions of one pool that a range block may choose among.
MOST = 1024
#: Below this number of range blocks, threads share the domain blocks instead.
FEW = 256
#: Domain positions scored in one batch.
_BATCH = 1 << 17


class Crew:
    """A crew of ``threads`` threads, None for one per core; a single one is the caller's thread.
    The end of its ``with`` block cancels work that has not begun."""

    def __init__(self, threads: int | None):
        self.threads = threads or available_cores()
        # threads start with their first work; a caller that works too replaces one
        self._helpers, self._all = (
            [ThreadPoolExecutor(count) for count in (self.threads - 1, self.threads)]
            if self.threads > 1
            else [None, None]
        )

    def __enter__(self) -> "Crew":
        return self

    def __exit__(self, *_) -> None:
        for pool in (self._helpers, self._all):
            if pool:
                pool.shutdown(wait=False, cancel_futures=True)

    def begin(self, work: Callable, *arguments) -> Callable:
        """Begin ``work`` in another thread, if there is one. Returns a function that waits for the
        result; without another thread it does the work."""
        if self._helpers:
            return self._helpers.submit(work, *arguments).result
        return functools.partial(work, *arguments)

    def map(self, work: Callable, parts: Iterable) -> Iterator:
        """Yield the results of ``work`` on each of ``parts``, in order; the caller waits."""
        return self._all.map(work, parts) if self._all else map(work, parts)


def available_cores() -> int:
    """Count the cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def best_matches(
    pools: Iterable[DomainPool],
    blocks: np.ndarray,
    corners: tuple[np.ndarray, np.ndarray],
    coding: Coding,
    *,
    threads: int | None = 1,
    progress: Callable[[float], None] | None = None,
) -> Matches:
    """Find the optimum over every domain block of ``pools`` (`domain_pools`), isometry and size.

    blocks : ``(n, B, B)`` range blocks, metres.
    corners : (y, x) of the range blocks' north-west pixels, ``(n,)`` each.
    threads : threads to use; None for all cores. The result does not depend on it.
    progress : called with the rows of domain blocks done since the last call, on average.

    Ties (gains within `TIE` of the block's energy) go to the lowest (D, y, x, iso).
    """
    with Crew(threads) as crew:
        ready = _prepare_pools(pools, crew, coding)
        shapes = _shapes_of(blocks, coding)
        search = Search(shapes.pixels, coding)
        corners = tuple(corner[shapes.first] for corner in corners)
        for _ in _sweep(search, ready, corners, crew, search.settle, progress):
            pass
        return search.matches(blocks, shapes)


def near_best(
    pools: Iterable[DomainPool],
    blocks: np.ndarray,
    corners: tuple[np.ndarray, np.ndarray],
    matches: Matches,
    tolerance: float,
    coding: Coding,
    *,
    threads: int | None = 1,
    progress: Callable[[float], None] | None = None,
) -> Iterator[tuple[np.ndarray, Candidates]]:
    """Find all domain blocks whose collage error is within ``tolerance``, a share of ‖r̃‖², of the
    best: the ``matches`` of `best_matches` with the same arguments. Yields batches: indices of
    range blocks ``(n,)`` and their candidates; of each pool the `MOST` positions of lowest (y,
    x)."""
    pixels = blocks.reshape(len(blocks), blocks.shape[-1] ** 2).astype(np.float64)
    shapes = _shapes_of(blocks, coding)
    of, first = shapes.of, shapes.first
    search = Search(shapes.pixels, coding)
    # start above any gain, so that the list does not depend on the order of the search
    search.best[:] = matches.gain[first] + search.unsure
    search.unsure *= 2

    def select(pool, part, which, y, x):
        order = np.lexsort((x, y, which))
        which, y, x = which[order], y[order], x[order]
        few = np.arange(which.size) - np.searchsorted(which, which) < MOST
        multiple = np.full(np.count_nonzero(few), pool.multiple)
        return which[few] + part.start, multiple, y[few], x[few]

    corners = tuple(corner[first] for corner in corners)
    with Crew(threads) as crew:
        ready = _prepare_pools(pools, crew, coding, doubles=True)
        parts = list(_sweep(search, ready, corners, crew, select, progress, tolerance))
    if not parts:
        return
    shape, *places = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(shape, kind="stable")  # pools came in the order of (D, y)
    places = [column[order] for column in places]
    bounds = np.searchsorted(shape[order], np.arange(len(first) + 1))
    sizes = np.diff(bounds)[of]
    start = 0
    while start < len(blocks):
        end = start + max(1, int(np.searchsorted(np.cumsum(sizes[start:]), _BATCH)))
        part = np.arange(start, min(end, len(blocks)))
        which = np.repeat(np.arange(part.size), sizes[part])
        ends = np.cumsum(sizes[part])
        at = np.arange(which.size) - np.repeat(ends - sizes[part], sizes[part])
        at += np.repeat(bounds[of[part]], sizes[part])
        least = matches.gain[part] - (tolerance + TIE) * search.energy[of[part]]
        yield part, search.score(which, *(column[at] for column in places), pixels[part], least)
        start = end


def _shapes_of(blocks: np.ndarray, coding: Coding) -> Shapes:
    """Reduce blocks ``(n, B, B)`` to the shapes that the search compares."""
    # over the whole map, blocks of one shape have the same domain blocks to choose among
    return Shapes.of_blocks(blocks) if coding.reach is None else Shapes.one_each(blocks)


def _prepare_pools(
    pools: Iterable[DomainPool], crew: Crew, coding: Coding, doubles: bool = False
) -> Iterator[tuple[DomainPool, list[Callable]]]:
    """Yield each pool and, for each of its bands, a function that returns what a search compares.

    The ``crew`` prepares all but the last band one pool ahead of the search, and begins with the
    call; the caller prepares the last band.
    """
    local = coding.reach is not None

    def prepare(band: DomainPool):
        if local:
            return band.folded
        # the first of doubles wins the search, but surroundings tell doubles apart
        return cut_tiles(domain_blocks(band, doubles), coding.sigma_max)

    def begin():
        pool = next(pools, None)
        if not pool:
            return None, []
        # the caller prepares the range blocks too, so its band is smaller
        *bands, last = [pool] if local else pool.split(crew.threads, last=0.8)
        mine = functools.cache(functools.partial(prepare, last))
        return pool, [*(crew.begin(prepare, band) for band in bands), mine]

    def follow(ready):
        while ready[0]:
            upcoming = begin()
            yield ready
            ready = upcoming

    pools = iter(pools)
    return follow(begin())


def _sweep(
    search: Search, ready, corners, crew: Crew, act, progress, tolerance: float = 0.0
) -> Iterator:
    """Yield, in order, the results of ``act(pool, part, which, y, x)`` on the domain blocks that
    may be the best of a chunk of range blocks, or within the ``tolerance`` of it."""
    count, local = len(search.codes), search.reach is not None
    most = chunk_size(search.reach) if local else CHUNK
    step = max(1, min(most, -(-count // crew.threads)))
    parts = [slice(k, min(k + step, count)) for k in range(0, count, step)]
    whole, few = slice(0, count), not local and count < FEW

    def report(pool, part) -> None:
        if progress:
            share = len(range(count)[part]) / count if count else 1.0
            progress(pool.shape[0] * share)

    for pool, bands in ready:
        search.shrunk[pool.multiple] = pool.shrunk

        def among(part, bands, pool=pool):
            """Find the domain blocks in question in some bands."""
            if local:
                return best_nearby(search, corners, pool, part, tolerance)
            return _join_bands(
                [best_everywhere(search, tiles(), part, tolerance) for tiles in bands]
            )

        def compare(part, pool=pool, bands=bands, among=among):
            return act(pool, part, *among(part, bands))

        if few:  # threads share the domain blocks; a best that another thread raises meanwhile
            # only makes the list longer
            others = [crew.begin(among, whole, [band]) for band in bands[:-1]]
            mine = among(whole, bands[-1:])
            result = act(pool, whole, *_join_bands([*(result() for result in others), mine]))
            report(pool, whole)
            yield result
            continue
        for band in bands:  # prepare all bands before threads use them
            band()
        for part, result in zip(parts, crew.map(compare, parts), strict=True):
            report(pool, part)
            yield result


def _join_bands(bands: list) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Join (which, y, x) of several bands, which ascending."""
    if len(bands) == 1:
        return bands[0]
    which, y, x = (np.concatenate(column) for column in zip(*bands, strict=True))
    order = np.argsort(which, kind="stable")
    return which[order], y[order], x[order]


__all__ = [
    "Matches",
    "available_cores",
    "best_correlations",
    "best_matches",
    "near_best",
    "pairs_compared",
]
