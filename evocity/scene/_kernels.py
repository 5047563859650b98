"""Compiled loops over triangles and pixels, and over sides of polygons."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def fill(corners, first, depth, surface):
    """Draw triangles into a z-buffer.

    corners (t, 3, 3): x to the right, y down, in px, and z towards the viewer. depth (H, W) keeps
    the z of the nearest triangle at each pixel's centre, surface (H, W) its number; of equal ones
    the first stays. Both keep former values, and are the rows from ``first`` on."""
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
            # the row enters the triangle at start, and leaves it at end
            start, end = left + 0.5, right + 0.5
            for p, q in (((bx, by), (cx, cy)), ((cx, cy), (ax, ay)), ((ax, ay), (bx, by))):
                slope = (p[1] - q[1]) / area
                if slope != 0:
                    root = (p[0] * (q[1] - y) - q[0] * (p[1] - y)) / (q[1] - p[1])
                    if slope > 0:
                        start = max(start, root)
                    else:
                        end = min(end, root)
            # a pixel more at each end: the test below decides
            first_column = max(left, int(min(start, right + 2.0) - 1.5))
            for column in range(first_column, min(right, int(max(end, left - 2.0) + 0.5)) + 1):
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
    """Write lit (H, W): whether the sun reaches each pixel, of the rows from ``first`` on.

    ``onto`` (3, 4) takes a pixel's x, y and z to those of the shadow map ``seen`` (h, w), the z of
    the nearest surface from the sun. ``bias`` (t,): how much nearer another surface must be to cast
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
    """Write edge (H, W): ``dark`` at the last pixels of a ``plane`` (t,), 1 elsewhere. The next
    plane lies more than ``jump`` behind, or has another direction; empty pixels lie behind."""
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
    """Write picture (H, W, 3), 0…255, and covered (H, W), from surface, lit and edge, n times finer
    each way.

    colours (2, t + 1, 3): of each triangle in the shade and in the sun, the last of empty pixels;
    ``edge`` multiplies them."""
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


@kernel
def shared(matrix, shape, where, edges, starts, grounds, begins):
    """Compute m² ``(n,)`` that objects share with grounds.

    Row n is object ``shape[n]`` under ``matrix[n]`` (2, 3), x' = a x + b y + c, and ground
    ``where[n]``. ``edges`` (e, 4) = x, y, x', y' of sides of all objects, shells counterclockwise,
    holes clockwise; object k has those from ``starts[k]`` to ``starts[k + 1]``. ``grounds`` and
    ``begins`` as well. Exact to rounding: some 1e-10 m² within 1 km.

    A polygon is the area below its upper sides less the area below its lower ones. So the common
    area is a sum over pairs of sides, of the area below both.
    """
    found = np.zeros(len(shape))
    most = 0
    for k in range(len(starts) - 1):
        most = max(most, starts[k + 1] - starts[k])
    line = np.empty((most, 5))  # from, to, height at from, slope, sign
    for n in range(len(shape)):
        a, b, c = matrix[n, 0, 0], matrix[n, 0, 1], matrix[n, 0, 2]
        d, e, f = matrix[n, 1, 0], matrix[n, 1, 1], matrix[n, 1, 2]
        way = 1.0 if a * e - b * d > 0 else -1.0
        count = 0
        left, right = np.inf, -np.inf
        for k in range(starts[shape[n]], starts[shape[n] + 1]):
            x, y, u, v = edges[k, 0], edges[k, 1], edges[k, 2], edges[k, 3]
            x, y = a * x + b * y + c, d * x + e * y + f
            u, v = a * u + b * v + c, d * u + e * v + f
            if x == u:
                continue
            if x < u:
                line[count, 0], line[count, 1], line[count, 2] = x, u, y
                line[count, 4] = -way
            else:
                line[count, 0], line[count, 1], line[count, 2] = u, x, v
                line[count, 4] = way
            line[count, 3] = (v - y) / (u - x)
            left, right = min(left, line[count, 0]), max(right, line[count, 1])
            count += 1
        total = 0.0
        for k in range(begins[where[n]], begins[where[n] + 1]):
            x, y, u, v = grounds[k, 0], grounds[k, 1], grounds[k, 2], grounds[k, 3]
            if x == u:
                continue
            sign = -1.0
            if x > u:
                x, y, u, v, sign = u, v, x, y, 1.0
            if u <= left or x >= right:
                continue
            slope = (v - y) / (u - x)
            for i in range(count):
                low, high = max(x, line[i, 0]), min(u, line[i, 1])
                if low >= high:
                    continue
                wide = high - low
                here = y + slope * (low - x)  # the ground's side, at both ends
                there = y + slope * (high - x)
                first = line[i, 2] + line[i, 3] * (low - line[i, 0]) - here  # the object's, above
                last = line[i, 2] + line[i, 3] * (high - line[i, 0]) - there
                below = (here + there) / 2 * wide
                if first < 0 and last < 0:
                    below += (first + last) / 2 * wide
                elif first < 0:
                    below += first / 2 * wide * (first / (first - last))
                elif last < 0:
                    below += last / 2 * wide * (last / (last - first))
                total += sign * line[i, 4] * below
        found[n] = total
    return found


@kernel
def tried(numbers, flips, shape, where, points, inside, sides, sizes, cells, low, step, areas):
    """Compute by points, float64 ``(n,)``, the IoU of objects with buildings, less four times the
    object's share on forbidden ground.

    Row n lays object ``shape[n]`` on building ``where[n]`` by ``numbers[n]`` = radians, scale along
    and across, x and y of the middle; ``flips`` is -1 where it is mirrored along. ``points`` (p, 2)
    are shares of a frame's sides from its middle, ``inside`` (objects, p) those in an object;
    ``sides`` (objects, 2), m, and ``sizes`` are its sides and area. ``cells`` (buildings, h, w) = 0
    on forbidden ground, 2 on the building, 1 else, from the corner ``low`` (x, y) on in steps of
    ``step``; ``areas`` are the buildings'."""
    found = np.zeros(len(shape))
    high, wide = cells.shape[1], cells.shape[2]
    for n in range(len(shape)):
        k, j = where[n], shape[n]
        along, across = sides[j, 0] * numbers[n, 1] * flips[n], sides[j, 1] * numbers[n, 2]
        c, s = np.cos(numbers[n, 0]), np.sin(numbers[n, 0])
        ux, uy = c * along / step[k, 0], s * along / step[k, 1]
        vx, vy = -s * across / step[k, 0], c * across / step[k, 1]
        x, y = (numbers[n, 3] - low[k, 0]) / step[k, 0], (numbers[n, 4] - low[k, 1]) / step[k, 1]
        whole, own, wrong = 0, 0, 0
        for i in range(len(points)):
            if not inside[j, i]:
                continue
            whole += 1
            column = int(np.floor(x + points[i, 0] * ux + points[i, 1] * vx))
            row = int(np.floor(y + points[i, 0] * uy + points[i, 1] * vy))
            what = 0
            if 0 <= row < high and 0 <= column < wide:
                what = cells[k, row, column]
            own += what == 2
            wrong += what == 0
        if whole:
            area = sizes[j] * numbers[n, 1] * numbers[n, 2]
            common = own / whole * area
            found[n] = common / (area + areas[k] - common) - 4 * wrong / whole
    return found
