"""Arcs: the walls of a raster of labels, each traced once from node to node."""

from dataclasses import dataclass

import numpy as np

from evocity.views.walls import _kernels

# Rounds of `untouch` in which a label takes a neighbour's pixel, before it gives up its own.
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Arcs:
    """The walls of a raster of labels, each between two labels and between two nodes.

    Three labels meet at a node. Coordinates are in pixels, x to the east and y to the south from
    the north-west corner.

    labels : int32 ``(H, W)``: the traced labels; no building touches itself only at a corner.
    vertices : int32 ``(k, 2)``, x and y, a pixel apart, the ends of each arc included.
    starts : int64 ``(n + 1,)``: arc a has ``vertices[starts[a] : starts[a + 1]]``.
    left, right : int32 ``(n,)``, the labels on both sides of each arc, in its direction: 0 open
        ground, −1 beyond the map or its site.
    ends : int32 ``(n, 2)``, its nodes; −1 for a closed arc.
    nodes : int32 ``(m, 2)``, x and y.
    changed : number of pixels whose label changed, so that no label touches itself at a corner.
    part : whether the map is a part that is not a rectangle.
    """

    labels: np.ndarray
    vertices: np.ndarray
    starts: np.ndarray
    left: np.ndarray
    right: np.ndarray
    ends: np.ndarray
    nodes: np.ndarray
    changed: int
    part: bool

    def __len__(self) -> int:
        return self.left.size

    @property
    def beyond(self) -> np.ndarray:
        """Bool ``(n,)``: arcs along the border of the map or its site."""
        return (self.left == _kernels.BEYOND) | (self.right == _kernels.BEYOND)

    @property
    def closed(self) -> np.ndarray:
        """Bool ``(n,)``: arcs that end where they begin."""
        return self.ends[:, 0] < 0


def trace_arcs(labels: np.ndarray, site: np.ndarray | None = None) -> Arcs:
    """Trace the walls of ``labels`` int32 ``(H, W)``: 0 on open ground, 1…n on buildings, each of
    pixels that touch by sides; ``site``, bool ``(H, W)``: the map's own pixels, None for all.

    A building that touches itself only at a pixel's corner is filled there, because it would not
    be a valid solid. About 1 ms at 256².
    """
    inner = labels if site is None else np.where(site, labels, np.int32(_kernels.BEYOND))
    framed = np.pad(inner, 1, constant_values=_kernels.BEYOND)
    changed = _kernels.untouch(framed, _ROUNDS)
    numbers = np.empty((framed.shape[0] - 1, framed.shape[1] - 1), np.int32)
    _, edges = _kernels.mark_nodes(framed, numbers)
    vertices = np.empty((2 * edges, 2), np.int32)
    starts = np.empty(edges + 1, np.int64)
    left, right = np.empty((2, edges), np.int32)
    ends = np.empty((edges, 2), np.int32)
    arcs = _kernels.trace(framed, numbers, vertices, starts, left, right, ends)
    rows, columns = np.nonzero(numbers >= 0)  # in the order of their numbers
    return Arcs(
        labels=np.maximum(framed[1:-1, 1:-1], 0),
        vertices=vertices[: starts[arcs]].copy(),
        starts=starts[: arcs + 1].copy(),
        left=left[:arcs].copy(),
        right=right[:arcs].copy(),
        ends=ends[:arcs].copy(),
        nodes=np.stack([columns, rows], axis=1).astype(np.int32),
        changed=int(changed),
        part=site is not None,
    )
