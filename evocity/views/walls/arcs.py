"""Where do walls run? Each is traced once, from node to node."""

from dataclasses import dataclass

import numpy as np

from evocity.views.walls import _kernels

# Turns of `untouch` in which a neighbour's pixel is taken, not given up.
_ROUNDS = 8


@dataclass(frozen=True, eq=False)
class Arcs:
    """The walls of a raster of labels, each between two labels, between two nodes, where three
    meet. In pixels, x to the east and y to the south from the north-west corner.

    labels : int32 ``(H, W)``: those that were traced; no building meets itself at a corner alone.
    vertices : int32 ``(k, 2)``, x and y; an arc's first and last among them, a pixel apart.
    starts : int64 ``(n + 1,)``: arc a has ``vertices[starts[a] : starts[a + 1]]``.
    left, right : int32 ``(n,)``, the labels beside it, as one walks along: 0 open ground, −1 what
        lies beyond the map or its site.
    ends : int32 ``(n, 2)``, its nodes; −1 for an arc that is closed.
    nodes : int32 ``(m, 2)``, x and y.
    changed : pixels whose label changed, so that none meets itself.
    part : whether the map is a part that is no rectangle.
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
        """Bool ``(n,)``: arcs along what lies beyond the map."""
        return (self.left == _kernels.BEYOND) | (self.right == _kernels.BEYOND)

    @property
    def closed(self) -> np.ndarray:
        """Bool ``(n,)``."""
        return self.ends[:, 0] < 0


def traced(labels: np.ndarray, site: np.ndarray | None = None) -> Arcs:
    """The walls of ``labels`` int32 ``(H, W)``: 0 on open ground, 1…n on buildings, each of pixels
    that touch by sides; ``site``, bool ``(H, W)``: where the map's own pixels are, None for
    everywhere.

    A building that meets itself at a pixel's corner alone is filled there: no solid could stand on
    it. About 1 ms at 256².
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
    rows, columns = np.nonzero(numbers >= 0)  # in the order they are numbered
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
