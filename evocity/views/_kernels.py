"""Compiled filters and pieces of maps. The tests hold them against SciPy's."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def scharr(heights, scale, along_y, along_x):
    """``along_y`` and ``along_x`` (H, W) get ``scale`` times the Scharr differences of ``heights``
    (weights 3, 10, 3), edges repeated."""
    rows, columns = heights.shape
    three, ten = heights.dtype.type(3), heights.dtype.type(10)
    padded = np.empty((3, columns + 2), heights.dtype)
    for y in range(rows):
        for k in range(3):
            line = heights[min(max(y + k - 1, 0), rows - 1)]
            padded[k, 1 : columns + 1] = line
            padded[k, 0], padded[k, columns + 1] = line[0], line[columns - 1]
        above, here, below = padded
        for x in range(columns):
            # differences first, along both axes: a turned map has turned bits
            north, middle, south = (
                above[x + 2] - above[x],
                here[x + 2] - here[x],
                below[x + 2] - below[x],
            )
            along_x[y, x] = scale * (three * (north + south) + ten * middle)
            west, middle, east = (
                below[x] - above[x],
                below[x + 1] - above[x + 1],
                below[x + 2] - above[x + 2],
            )
            along_y[y, x] = scale * (three * (west + east) + ten * middle)


@kernel
def smooth(fields, weights, smoothed):
    """``smoothed`` (n, H, W) gets ``fields`` under a symmetric filter along both axes, edges
    repeated; ``weights`` (r + 1,) are its middle one and those at distance 1…r.

    Pixels at equal distance are added first, so a mirrored map has mirrored bits.
    """
    count, rows, columns = fields.shape
    reach = weights.size - 1
    line = np.empty(columns + 2 * reach, fields.dtype)
    for f in range(count):
        field = fields[f]
        for y in range(rows):
            middle = line[reach : reach + columns]
            here = field[y]
            for x in range(columns):
                middle[x] = weights[0] * here[x]
            for k in range(1, reach + 1):
                above, below, weight = field[max(y - k, 0)], field[min(y + k, rows - 1)], weights[k]
                for x in range(columns):
                    middle[x] += weight * (above[x] + below[x])
            line[:reach] = middle[0]
            line[reach + columns :] = middle[columns - 1]
            target = smoothed[f, y]
            for x in range(columns):
                target[x] = weights[0] * middle[x]
            for k in range(1, reach + 1):
                west, east = line[reach - k : reach - k + columns], line[reach + k :]
                weight = weights[k]
                for x in range(columns):
                    target[x] += weight * (west[x] + east[x])


@kernel
def square(along_y, along_x, squared):
    """``squared`` (2, H, W) gets real and imaginary part of (along_x + i along_y)²."""
    rows, columns = along_y.shape
    two = along_y.dtype.type(2)
    for y in range(rows):
        for x in range(columns):
            down, across = along_y[y, x], along_x[y, x]
            squared[0, y, x] = across * across - down * down
            squared[1, y, x] = two * across * down


@kernel
def _root(parent, a):
    while parent[np.uintp(a)] != a:
        parent[np.uintp(a)] = parent[np.uintp(parent[np.uintp(a)])]
        a = parent[np.uintp(a)]
    return a


@kernel
def _unite(parent, a, b):
    """The lower of the two roots becomes that of both, and is returned."""
    a, b = _root(parent, a), _root(parent, b)
    low, high = min(a, b), max(a, b)
    parent[np.uintp(high)] = low
    return low


@kernel
def _number(zones, parent, count):
    """Renumber ``zones`` by their roots, in the order of these; returns how many there are.

    ``zones`` bear numbers 0…count in the order in which they first appear, and a root is the
    lowest of its set: so the new numbers too are in raster order.
    """
    names = np.zeros(count + 1, np.int32)
    number = 0
    for a in range(1, count + 1):
        root = _root(parent, a)
        if root == a:
            number += 1
            names[a] = number
        else:
            names[a] = names[root]
    for y in range(np.uintp(zones.shape[0])):
        for x in range(np.uintp(zones.shape[1])):
            zones[y, x] = names[np.uintp(zones[y, x])]
    return number


@kernel
def label(mask, corners, labels):
    """``labels`` (H, W) get 1…n on the pieces of a ``mask`` that touch by pixels' sides, or by
    ``corners`` too, in raster order; returns n."""
    rows, columns = mask.shape
    parent = np.empty(mask.size + 1, np.int32)
    count, aside = 0, 1 if corners else 0
    for y in range(rows):
        for x in range(columns):
            labels[y, x] = 0
            if not mask[y, x]:
                continue
            a = labels[y, x - 1] if x else np.int32(0)
            if y:
                for beside in range(max(x - aside, 0), min(x + aside, columns - 1) + 1):
                    above = labels[y - 1, beside]
                    if a == 0:
                        a = above
                    elif above and above != a:
                        a = np.int32(_unite(parent, a, above))
            if a == 0:
                count += 1
                a = np.int32(count)
                parent[np.uintp(count)] = a
            labels[y, x] = a
    return _number(labels, parent, count)
