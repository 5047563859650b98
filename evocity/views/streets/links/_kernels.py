"""Compiled loops over links of lines. Slow twins stand in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def _root(parent, node):
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


@kernel
def _unite(parent, one, other):
    parent[_root(parent, one)] = _root(parent, other)


@kernel
def reach_frame(first, last, starts, path, nodes, out, beside, reached):
    """Find the nodes and the hubs that are connected to the frame, by edges and along hubs: bool
    ``reached`` ``(n + h,)``, the n nodes, then the h hubs.

    first, last, starts, path, nodes, out : as of `evocity.views.streets.lines.Lines`. beside :
    int32 ``(H, W)``, the hub beside each pixel, 1…h, of which the first is the frame; 0 for none.
    An edge is connected to the hubs beside its pixels and beside their four neighbours, a node
    without edges to the hub beside it.
    """
    many, columns = nodes.size, beside.shape[1]
    hubs, parent = beside.ravel(), np.arange(reached.size)
    lone = np.ones(many, np.bool_)
    for edge in range(first.size):
        lone[first[edge]] = lone[last[edge]] = False
        _unite(parent, first[edge], last[edge])
        before = 0
        for k in range(starts[edge], starts[edge + 1]):
            p = path[k]
            for place in (p, p + 1, p - 1, p + columns, p - columns):
                hub = hubs[place]
                if hub > 0 and hub != before:
                    _unite(parent, first[edge], many + hub - 1)
                    before = hub
    for node in range(many):
        if out[node]:
            _unite(parent, node, many)
        if lone[node] and hubs[nodes[node]] > 0:
            _unite(parent, node, many + hubs[nodes[node]] - 1)
    frame = _root(parent, many)
    for k in range(reached.size):
        reached[k] = _root(parent, k) == frame
