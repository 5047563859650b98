"""Which domain block explains a range block best? The exact search behind encoding, repair and
autosimilarity.

For a zero-mean range block r̃ and a shrunk zero-mean domain block d̃ with p = ⟨r̃, iso d̃⟩ and
e = ‖d̃‖², the energy explained with contrast σ is σ(2p − σe), greatest at σ = p/e. The cap on
\\|σ\\| belongs inside this criterion: clipping afterwards costs decibels.

d4       the coordinates that blocks are folded into
domains  the pool of domain blocks
shapes   range blocks alike, searched but once
likeness domain blocks alike, searched but once; norms of parts, order
tiles    the search of a whole map, with bounds
everywhere  what is explained at every place, on the pavement or not
nearby   the search within reach
matches  the best domain, decided in float64
crew     threads that share the work
alike    compiled: which blocks are alike
folding  compiled: D4 coordinates
scoring  compiled: near-ties in float64
"""

import functools
from collections.abc import Callable, Iterable, Iterator

import numpy as np

from evocity.coding.matching.crew import Crew, available_cores
from evocity.coding.matching.domains import DomainPool
from evocity.coding.matching.likeness import domain_blocks
from evocity.coding.matching.matches import TIE, Matches, Search
from evocity.coding.matching.nearby import best_correlations, best_nearby, pairs_compared, together
from evocity.coding.matching.shapes import Shapes
from evocity.coding.matching.tiles import CHUNK, best_everywhere, cut_tiles
from evocity.coding.topology import Candidates

#: Domain positions of one pool that a range block may choose among.
MOST = 1024
#: Fewer range blocks than this are not worth sharing among threads: the domains are.
FEW = 256
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
    with Crew(threads) as crew:
        ready = _prepared(pools, crew, reach, sigma_max)
        shapes = _searched(blocks, reach)
        search = Search(shapes.pixels, sigma_max)
        corners = tuple(corner[shapes.first] for corner in corners)
        for pool, part, _ in _sweep(search, ready, corners, reach, crew, search.settle):
            if progress:
                progress(pool.shape[0] * _share(part, shapes))
        return search.matches(blocks, shapes)


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
    shapes = _searched(blocks, reach)
    of, first = shapes.of, shapes.first
    search = Search(shapes.pixels, sigma_max)
    # a best that none can raise, lest what is listed depend on the order of the search
    search.best[:] = matches.gain[first] + search.unsure
    search.unsure *= 2

    def listed(pool, part, which, y, x):
        order = np.lexsort((x, y, which))
        which, y, x = which[order], y[order], x[order]
        few = np.arange(which.size) - np.searchsorted(which, which) < MOST
        multiple = np.full(np.count_nonzero(few), pool.multiple)
        return which[few] + part.start, multiple, y[few], x[few]

    corners = tuple(corner[first] for corner in corners)
    found = []
    with Crew(threads) as crew:
        ready = _prepared(pools, crew, reach, sigma_max, doubles=True)
        for pool, part, places in _sweep(search, ready, corners, reach, crew, listed, tolerance):
            found.append(places)
            if progress:
                progress(pool.shape[0] * _share(part, shapes))
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


def _searched(blocks: np.ndarray, reach: int | None) -> Shapes:
    """What is searched for blocks ``(n, B, B)``."""
    # wherever they lie, blocks of one shape have the same domains to choose among
    return Shapes.of_blocks(blocks) if reach is None else Shapes.each_its_own(blocks)


def _share(part: slice, shapes: Shapes) -> float:
    """How much of the work on a pool a ``part`` of the shapes is."""
    count = len(shapes.first)
    return len(range(count)[part]) / count if count else 1.0


def _prepared(
    pools: Iterable[DomainPool], crew: Crew, reach: int | None, sigma_max: float, doubles=False
) -> Iterator[tuple[DomainPool, list[Callable]]]:
    """Each pool and, band by band, how to get what a search compares with. The ``crew`` makes all
    but the last band one pool ahead of the search, of the first pool as soon as this is called;
    the last is made by whoever asks for it."""

    def prepare(band: DomainPool):
        if reach is not None:
            return band.folded
        # of doubles the first wins, but only their surroundings tell which fits
        return cut_tiles(domain_blocks(band, doubles), sigma_max)

    def begun():
        pool = next(pools, None)
        if not pool:
            return None, []
        # whoever asks has had the range blocks to see to
        *bands, last = pool.split(crew.threads, last=0.8) if reach is None else [pool]
        mine = functools.cache(functools.partial(prepare, last))
        return pool, [*(crew.begin(prepare, band) for band in bands), mine]

    def following(ready):
        while ready[0]:
            upcoming = begun()
            yield ready
            ready = upcoming

    pools = iter(pools)
    return following(begun())


def _sweep(search: Search, ready, corners, reach: int | None, crew: Crew, act, tolerance=None):
    """``act(pool, part, which, y, x)`` on the domains that may be the best of a chunk of range
    blocks, or within the ``tolerance`` of it: yields (pool, part, what it returned) in order.
    """
    count, most = len(search.codes), CHUNK if reach is None else together(reach)
    step = max(1, min(most, -(-count // crew.threads)))
    parts = [slice(k, min(k + step, count)) for k in range(0, count, step)]
    whole, few = slice(0, count), reach is None and count < FEW
    tolerance = tolerance or 0.0
    for pool, bands in ready:
        search.shrunk[pool.multiple] = pool.shrunk

        def among(part, bands, pool=pool):
            """The domains in question in some bands."""
            if reach is not None:
                return best_nearby(search, corners, reach, pool, part, tolerance)
            found = [best_everywhere(search, tiles(), part, tolerance) for tiles in bands]
            return _joined(found)

        def compare(part, pool=pool, bands=bands, among=among):
            return act(pool, part, *among(part, bands))

        if few:  # the domains are shared, not the range blocks; a best that one thread takes
            # from another's hands only lists more
            others = [crew.begin(among, whole, [band]) for band in bands[:-1]]
            mine = among(whole, bands[-1:])
            yield pool, whole, act(pool, whole, *_joined([*(found() for found in others), mine]))
            continue
        for band in bands:  # all are made before threads ask for them
            band()
        for part, result in zip(parts, crew.map(compare, parts), strict=True):
            yield pool, part, result


def _joined(found: list) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(which, y, x) of several bands as one, which ascending."""
    if len(found) == 1:
        return found[0]
    which, y, x = (np.concatenate(column) for column in zip(*found, strict=True))
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
