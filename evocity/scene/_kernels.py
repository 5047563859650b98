"""Compiled loops over triangles and pixels."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def fill(corners, first, depth, surface):
    """Draw triangles in front of each other: corners (t, 3, 3) = x to the right, y down, in px, and
    z towards the viewer. depth (H, W) becomes the z of what is nearest at each pixel's centre,
    surface (H, W) its triangle; of equal ones the first stays. Both go on from what they hold, and
    are the rows from ``first`` on."""
    rows, columns = depth.shape
    for k in range(corners.shape[0]):
        ax, ay, az = corners[k, 0, 0], corners[k, 0, 1], corners[k, 0, 2]
        bx, by, bz = corners[k, 1, 0], corners[k, 1, 1], corners[k, 1, 2]
        cx, cy, cz = corners[k, 2, 0], corners[k, 2, 1], corners[k, 2, 2]
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        if area == 0:
            continue
        top = max(0, int(np.ceil(min(ay, by, cy) - 0.5)) - first)
        low = min(rows - 1, int(np.floor(max(ay, by, cy) - 0.5)) - first)
        left = max(0, int(np.ceil(min(ax, bx, cx) - 0.5)))
        right = min(columns - 1, int(np.floor(max(ax, bx, cx) - 0.5)))
        for row in range(top, low + 1):
            y = first + row + 0.5
            for column in range(left, right + 1):
                x = column + 0.5
                a = ((bx - x) * (cy - y) - (cx - x) * (by - y)) / area
                b = ((cx - x) * (ay - y) - (ax - x) * (cy - y)) / area
                c = 1 - a - b
                if a >= -1e-9 and b >= -1e-9 and c >= -1e-9:  # no gap along a shared side
                    z = np.float32(a * az + b * bz + c * cz)
                    if z > depth[row, column]:
                        depth[row, column] = z
                        surface[row, column] = k


@kernel
def light(depth, surface, first, onto, seen, bias, lit):
    """lit (H, W) = whether the sun reaches what is at each pixel, of the rows from ``first`` on:
    ``onto`` (3, 4) takes a pixel's x, y and z to those of the picture ``seen`` from the sun,
    (h, w), the z of what is nearest there; ``bias`` (t,) is how much nearer another must be to cast
    a shadow on a triangle."""
    rows, columns = depth.shape
    high, wide = seen.shape
    for row in range(rows):
        y = first + row + 0.5
        for column in range(columns):
            k = surface[row, column]
            lit[row, column] = True
            if k < 0:
                continue
            x, z = column + 0.5, depth[row, column]
            u = int(np.floor(onto[0, 0] * x + onto[0, 1] * y + onto[0, 2] * z + onto[0, 3]))
            v = int(np.floor(onto[1, 0] * x + onto[1, 1] * y + onto[1, 2] * z + onto[1, 3]))
            if 0 <= u < wide and 0 <= v < high:
                w = onto[2, 0] * x + onto[2, 1] * y + onto[2, 2] * z + onto[2, 3]
                lit[row, column] = seen[v, u] <= w + bias[k]


@kernel
def outlined(depth, surface, plane, jump, dark, edge):
    """edge (H, W) = ``dark`` where a pixel is the last of its ``plane`` (t,) before another that
    lies behind it, more than ``jump`` away, or turns off from it, 1 elsewhere; what is empty lies
    behind."""
    rows, columns = depth.shape
    for row in range(rows):
        for column in range(columns):
            k = surface[row, column]
            edge[row, column] = 1
            if k < 0:
                continue
            for step in range(4):
                y = row + (step == 0) - (step == 1)
                x = column + (step == 2) - (step == 3)
                if y < 0 or x < 0 or y >= rows or x >= columns:
                    continue
                other = surface[y, x]
                if other < 0:
                    edge[row, column] = dark
                elif plane[other] != plane[k]:
                    nearer = depth[row, column] - depth[y, x]
                    if nearer > jump or (nearer >= -jump and step % 2 == 0):
                        edge[row, column] = dark


@kernel
def painted(surface, lit, edge, colours, picture, covered):
    """picture (H, W, 3), 0…255, and covered (H, W), whether anything is there, of surface, lit and
    edge, n times finer each way: colours (2, t + 1, 3) are those of a triangle in the shade and in
    the sun, the last of what is empty; ``edge`` is what share of it is left."""
    finer = surface.shape[0] // picture.shape[0]
    count = finer * finer
    for row in range(picture.shape[0]):
        for column in range(picture.shape[1]):
            red, green, blue = 0.0, 0.0, 0.0
            covered[row, column] = False
            for y in range(row * finer, (row + 1) * finer):
                for x in range(column * finer, (column + 1) * finer):
                    k = surface[y, x]
                    covered[row, column] |= k >= 0
                    shown = colours[int(lit[y, x]), k]  # −1 is the last
                    red += shown[0] * edge[y, x]
                    green += shown[1] * edge[y, x]
                    blue += shown[2] * edge[y, x]
            picture[row, column, 0] = round(min(255.0, red / count))
            picture[row, column, 1] = round(min(255.0, green / count))
            picture[row, column, 2] = round(min(255.0, blue / count))
