"""Weighted straight skeletons of polygons, and the faces of the roof above them."""

from dataclasses import dataclass

import numpy as np

from evocity.scene.roofs import _kernels

#: Most points of a polygon: time grows with their third power.
MOST_POINTS = 500


@dataclass(frozen=True, eq=False)
class Skeleton:
    """The faces above a polygon whose edges move inwards.

    nodes : float64 ``(m, 3)``: x, y, and the time at which an edge arrives; the first n are the
        polygon's points, at time 0.
    corners, starts : int64; edge k has the nodes ``corners[starts[k] : starts[k + 1]]``,
        counterclockwise from its own start. A ring of two nodes is no face.
    deck : int64 ``(s, 2)``: two nodes of each side of what remains at the end, its inside to the
        left.
    """

    nodes: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    deck: np.ndarray

    @property
    def depth(self) -> float:
        """The last time at which an edge arrives."""
        return float(self.nodes[self.corners, 2].max(initial=0.0))


def skeleton_of(
    points: np.ndarray,
    after: np.ndarray,
    weights: np.ndarray,
    most: float = np.inf,
    least: float = 8e-3,
) -> Skeleton | None:
    """Return the straight skeleton of a polygon, or None if no skeleton results.

    points : float64 ``(n, 2)``, of all rings, shells counterclockwise, holes clockwise.
    after : int64 ``(n,)``: the next point of the same ring.
    weights : float64 ``(n,)``: how far the edge from each point moves inwards per unit of time, 0
        or more. An edge of weight 0 stays: its face is vertical.
    most : the time at which edges stop; what remains is flat.
    least : arcs shorter than this, metres, become one node.

    Simultaneous events of regular plans make nodes at one place, which become one. A plan of more
    than `MOST_POINTS` points has no skeleton here.

    Sources: see `evocity.scene.roofs._kernels.skeleton`.
    """
    n = len(points)
    if not 3 <= n <= MOST_POINTS:
        return None
    room = 8 * n + 16
    nodes, arcs = np.empty((room, 3)), np.empty((2 * room, 4), np.int64)
    deck = np.empty((room, 3), np.int64)
    local = np.ascontiguousarray(points - points[0])
    # the room for corners and nodes is that of nodes
    count, many, sides = _kernels.skeleton(local, after, weights, float(most), nodes, arcs, deck)
    if not count:
        return None
    root = _kernels.merged(nodes, count, n, arcs, many, deck, sides, least)
    corners = np.empty(2 * (many + sides) + 4 * n, np.int64)
    starts = np.empty(n + 1, np.int64)
    if not _kernels.trace(after, weights, root, arcs, many, deck, sides, corners, starts):
        return None
    nodes = nodes[:count]
    nodes[:, :2] += points[0]
    nodes[:n, :2] = points
    ends = root[deck[:sides, :2]]
    ends = ends[ends[:, 0] != ends[:, 1]]
    return Skeleton(nodes, corners[: starts[n]], starts, ends)
