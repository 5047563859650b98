"""From middle lines to streets: what is left out, pruned and joined."""

from dataclasses import dataclass

import numpy as np
import scipy

from evocity.views.streets._kernels import (
    contracted,
    joined,
    lengths_of,
    middles_and_leasts,
    traced,
    without_spurs,
)
from evocity.views.streets.skeleton import Ground

#: Crossings are one where the longest way between them is no longer than this share of the radius
#: of the widest disc there: their discs then share most of their ground.
SAME = 1.0


@dataclass(frozen=True, eq=False)
class Lines:
    """A graph of pixels of a `Ground`: ``nodes`` (n,) their pixels, ``out`` (n,) whether they stand
    at the frame; ``first``, ``last`` (m,) nodes, and ``path[starts[k] : starts[k + 1]]`` the pixels
    of edge k."""

    nodes: np.ndarray
    out: np.ndarray
    first: np.ndarray
    last: np.ndarray
    starts: np.ndarray
    path: np.ndarray

    def pieces(self) -> tuple[int, np.ndarray]:
        """How many connected components there are, and of each node which it is of."""
        return _pieces(len(self.nodes), self.first, self.last)


def whole(ground: Ground) -> Lines:
    """All lines of a ground, crossings that share their ground made one."""
    columns = ground.open.shape[1]
    nodes, first, last, starts, path = traced(ground.lines, ground.exits)
    out = ground.frame.ravel()[nodes]
    radius = np.sqrt(ground.squares.ravel()[nodes])
    lengths = lengths_of(starts, path, columns)
    lengths[out[first] | out[last]] = np.inf  # what leaves the map goes on leaving it
    became, first, last, starts, path = contracted(
        nodes, first, last, starts, path, lengths, radius, SAME
    )
    return _used(nodes, out, became, first, last, starts, path)


def chosen(lines: Lines, ground: Ground, least_width: float, spurs: float, courts: bool) -> Lines:
    """The streets among ``lines``.

    least_width : an edge anywhere narrower, px, goes, and a lone node. spurs : an edge goes that
    ends nowhere, and is shorter than so many times the width of the ground where it begins. courts
    : whether what then has no way to the frame, which may lead over places, stays."""
    columns = ground.open.shape[1]
    _, leasts = across(lines, ground.across)
    alive, lone = leasts >= least_width, ground.across.ravel()[lines.nodes] >= least_width
    while True:
        lines = _joined(lines, alive, lone)
        lone = np.ones(len(lines.nodes), bool)
        alive = np.ones(len(lines.first), bool)
        lengths = lengths_of(lines.starts, lines.path, columns)
        bound = spurs * 2 * np.sqrt(ground.squares.ravel()[lines.nodes])
        if not without_spurs(lines.first, lines.last, lengths, bound, lines.out, alive):
            break
    if not courts:
        reached = reaching(lines, ground)[0]
        lines = _joined(lines, reached[lines.first], reached)
    return lines


def across(lines: Lines, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of each edge the median and the least of ``values`` at its pixels."""
    middles, leasts = np.empty(len(lines.first)), np.empty(len(lines.first))
    middles_and_leasts(lines.starts, lines.path, values, middles, leasts)
    return middles, leasts


def reaching(lines: Lines, ground: Ground) -> tuple[np.ndarray, np.ndarray]:
    """Bool: which nodes, and which middles of places (n,), are joined to the frame by lines, and
    over places that these run along."""
    many, hubs = len(lines.nodes), int(ground.hubs.max()) if ground.hubs.size else 0
    edge, hub = _beside(lines, ground)
    lone = np.bincount(lines.first, minlength=many) + np.bincount(lines.last, minlength=many) == 0
    own = ground.beside.ravel()[lines.nodes]
    joins = [
        (lines.first, lines.last),
        (lines.first[edge], many + hub - 1),
        (np.flatnonzero(lines.out), np.full(np.count_nonzero(lines.out), many)),
        (np.flatnonzero(lone & (own > 0)), many + own[lone & (own > 0)] - 1),
    ]
    one, other = (np.concatenate(ends) for ends in zip(*joins, strict=True))
    _, piece = _pieces(many + max(hubs, 1), one, other)
    reached = piece == piece[many]
    return reached[:many], reached[many:][ground.hubs[1:] - 1]


def _pieces(many: int, one: np.ndarray, other: np.ndarray) -> tuple[int, np.ndarray]:
    """How many components ``many`` nodes have, some joined, and of each node which it is of."""

    links = np.ones(len(one), bool), (one, other)
    return scipy.sparse.csgraph.connected_components(
        scipy.sparse.coo_array(links, shape=(many, many)), directed=False
    )


def _beside(lines: Lines, ground: Ground) -> tuple[np.ndarray, np.ndarray]:
    """What edges run along besides buildings: pairs of an edge and a hub of `Ground.beside`."""
    columns = ground.open.shape[1]
    step = np.array([0, 1, -1, columns, -columns])  # one of two walls may be a neighbour's next
    hub = ground.beside.ravel()[lines.path[:, None] + step]
    edge = np.repeat(np.arange(len(lines.first)), np.diff(lines.starts))
    at, _ = np.nonzero(hub)
    return edge[at], hub[hub > 0]


def _joined(lines: Lines, alive: np.ndarray, lone: np.ndarray) -> Lines:
    """The ``alive`` edges, joined where two meet; and of the nodes that had none, those
    ``lone``."""
    many = len(lines.nodes)
    had = np.bincount(lines.first, minlength=many) + np.bincount(lines.last, minlength=many) > 0
    graph = joined(many, lines.first, lines.last, lines.starts, lines.path, alive, lines.out)
    kept = ~had & lone
    kept[graph[0]] = kept[graph[1]] = True
    became = np.where(kept, np.arange(many), -1)
    return _used(lines.nodes, lines.out, became, *graph)


def _used(nodes, out, became, first, last, starts, path) -> Lines:
    """Without the nodes that are others now."""
    kept = became == np.arange(len(became))
    number = np.cumsum(kept) - 1
    return Lines(nodes[kept], out[kept], number[first], number[last], starts, path)
