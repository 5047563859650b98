"""The graph of middle lines: narrow edges and short dead ends removed, crossings merged."""

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
from evocity.views.streets.links import reach_frame
from evocity.views.streets.skeleton import Ground

#: Longest way between two crossings that merge, as a share of the radius of the widest disc there:
#: their discs then share most of their ground.
SAME = 1.0


@dataclass(frozen=True, eq=False)
class Lines:
    """A graph of pixels of a `Ground`.

    nodes : (n,), their pixels. out : (n,), whether they are at the frame. first, last : (m,), the
    nodes of each edge. starts, path : ``path[starts[k] : starts[k + 1]]`` are the pixels of edge k.
    """

    nodes: np.ndarray
    out: np.ndarray
    first: np.ndarray
    last: np.ndarray
    starts: np.ndarray
    path: np.ndarray

    def pieces(self) -> tuple[int, np.ndarray]:
        """Count the connected components, and find the component of each node."""
        return _pieces(len(self.nodes), self.first, self.last)


def build_lines(ground: Ground) -> Lines:
    """Make the graph of all lines of a ground, and merge crossings that share their ground."""
    columns = ground.open.shape[1]
    nodes, first, last, starts, path = traced(ground.lines, ground.exits)
    out = ground.frame.ravel()[nodes]
    radius = np.sqrt(ground.squares.ravel()[nodes])
    lengths = lengths_of(starts, path, columns)
    lengths[out[first] | out[last]] = np.inf  # lines that leave the map stay
    became, first, last, starts, path = contracted(
        nodes, first, last, starts, path, lengths, radius, SAME
    )
    return _compact(nodes, out, became, first, last, starts, path)


def select_streets(
    lines: Lines, ground: Ground, least_width: float, spurs: float, courts: bool
) -> Lines:
    """Select the streets among ``lines``.

    least_width : edges narrower at any point, px, go, and so do lone nodes. spurs : a dead end goes
    if it is shorter than so many times the width of the ground where it begins. courts : whether
    lines without a way to the frame stay; the way may lead over places.
    """
    columns = ground.open.shape[1]
    _, leasts = edge_values(lines, ground.across)
    alive, lone = leasts >= least_width, ground.across.ravel()[lines.nodes] >= least_width
    while True:
        lines = _join(lines, alive, lone)
        lone = np.ones(len(lines.nodes), bool)
        alive = np.ones(len(lines.first), bool)
        lengths = lengths_of(lines.starts, lines.path, columns)
        bound = spurs * 2 * np.sqrt(ground.squares.ravel()[lines.nodes])
        if not without_spurs(lines.first, lines.last, lengths, bound, lines.out, alive):
            break
    if not courts:
        reached = connected_to_frame(lines, ground)[0]
        lines = _join(lines, reached[lines.first], reached)
    return lines


def edge_values(lines: Lines, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Compute the median and the least of ``values`` at the pixels of each edge."""
    middles, leasts = np.empty(len(lines.first)), np.empty(len(lines.first))
    middles_and_leasts(lines.starts, lines.path, values, middles, leasts)
    return middles, leasts


def connected_to_frame(lines: Lines, ground: Ground) -> tuple[np.ndarray, np.ndarray]:
    """Select the nodes, and the middles of places (n,), that connect to the frame by lines, or over
    places along these: two bool arrays."""
    many, hubs = len(lines.nodes), max(int(ground.hubs.max(initial=0)), 1)
    reached = np.empty(many + hubs, bool)
    reach_frame(
        lines.first, lines.last, lines.starts, lines.path, lines.nodes, lines.out, ground.beside,
        reached,
    )  # fmt: skip
    return reached[:many], reached[many:][ground.hubs[1:] - 1]


def along_hubs(lines: Lines, ground: Ground) -> np.ndarray:
    """Select the edges of which over half run along middles of places or of open land, which the
    ground counts as walls: bool ``(m,)``."""
    count = len(lines.first)
    edge = np.repeat(np.arange(count), np.diff(lines.starts))
    beside = _hubs_beside(lines, ground).any(axis=1)
    return 2 * np.bincount(edge, beside, minlength=count) > np.diff(lines.starts)


def _hubs_beside(lines: Lines, ground: Ground) -> np.ndarray:
    """Find the hubs of `Ground.beside` at each pixel of the edges and at its four neighbours: int32
    ``(k, 5)``."""
    columns = ground.open.shape[1]
    step = np.array([0, 1, -1, columns, -columns])  # one of two walls may be a neighbour's next
    return ground.beside.ravel()[lines.path[:, None] + step]


def _pieces(many: int, one: np.ndarray, other: np.ndarray) -> tuple[int, np.ndarray]:
    """Count the components of ``many`` nodes with links, and find the component of each node."""
    links = np.ones(len(one), bool), (one, other)
    return scipy.sparse.csgraph.connected_components(
        scipy.sparse.coo_array(links, shape=(many, many)), directed=False
    )


def _join(lines: Lines, alive: np.ndarray, lone: np.ndarray) -> Lines:
    """Keep the ``alive`` edges, joined where only two meet; and of the nodes without edges, those
    ``lone``."""
    many = len(lines.nodes)
    linked = np.bincount(lines.first, minlength=many) + np.bincount(lines.last, minlength=many) > 0
    graph = joined(many, lines.first, lines.last, lines.starts, lines.path, alive, lines.out)
    kept = ~linked & lone
    kept[graph[0]] = kept[graph[1]] = True
    became = np.where(kept, np.arange(many), -1)
    return _compact(lines.nodes, lines.out, became, *graph)


def _compact(nodes, out, became, first, last, starts, path) -> Lines:
    """Remove the nodes that merged into others."""
    kept = became == np.arange(len(became))
    number = np.cumsum(kept) - 1
    return Lines(nodes[kept], out[kept], number[first], number[last], starts, path)
