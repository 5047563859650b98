"""Compiled loops over points and triangles."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def keys_of_faces(points, triangles, major, steps, keys):
    """Write ``keys`` (t,), equal for triangles of one flat face: their ``major`` (t,) number, and
    the direction of their normal in whole ``steps`` of its components, at most 2000.

    points : (p, 3). triangles : (t, 3).
    """
    for k in range(triangles.shape[0]):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        ux, uy, uz = points[b, 0], points[b, 1], points[b, 2]
        vx, vy, vz = points[c, 0], points[c, 1], points[c, 2]
        x, y, z = points[a, 0], points[a, 1], points[a, 2]
        ux, uy, uz, vx, vy, vz = ux - x, uy - y, uz - z, vx - x, vy - y, vz - z
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = max(np.sqrt(x * x + y * y + z * z), 1e-300)
        key = major[k]
        for part in (x, y, z):
            key = key << 12 | (np.int64(np.rint(part / length * steps)) + steps)
        keys[k] = key


@kernel
def corners_of_faces(points, triangles, face, used, index, of, normals):
    """Give each flat face its own corners, and return their number.

    points : (p, 3). triangles : (t, 3). face : (t,), rising, the face of each triangle.

    Writes ``used`` (3 t,), the point of each new corner: by face, and by point in a face. ``of``
    (3 t,) is the face of each, ``index`` (t, 3) the new corners of each triangle. ``normals``
    (f, 3) become the sums of the cross products of a face's triangles.
    """
    place = np.full(points.shape[0], -1)
    begin, first, count = 0, 0, 0
    for k in range(triangles.shape[0]):
        a, b, c = triangles[k, 0], triangles[k, 1], triangles[k, 2]
        ux, uy, uz = points[b, 0], points[b, 1], points[b, 2]
        vx, vy, vz = points[c, 0], points[c, 1], points[c, 2]
        x, y, z = points[a, 0], points[a, 1], points[a, 2]
        ux, uy, uz, vx, vy, vz = ux - x, uy - y, uz - z, vx - x, vy - y, vz - z
        own = face[k]
        normals[own, 0] += uy * vz - uz * vy
        normals[own, 1] += uz * vx - ux * vz
        normals[own, 2] += ux * vy - uy * vx
        for corner in (a, b, c):
            # a place from ``first`` on was given in this face
            if place[corner] < first:
                place[corner] = count
                used[count] = corner
                of[count] = own
                count += 1
        if k + 1 == triangles.shape[0] or face[k + 1] != own:
            if count - first > 32:
                used[first:count].sort()
            else:  # most faces are walls of four corners
                for slot in range(first + 1, count):
                    corner, row = used[slot], slot
                    while row > first and used[row - 1] > corner:
                        used[row] = used[row - 1]
                        row -= 1
                    used[row] = corner
            for slot in range(first, count):
                place[used[slot]] = slot
            for row in range(begin, k + 1):
                for side in range(3):
                    index[row, side] = place[triangles[row, side]]
            begin, first = k + 1, count
    return count


@kernel
def texture(points, of, normals, wall, tiles, level, normal, uv):
    """Write the normals (c, 3) and the texture coordinates ``uv`` (c, 2) of the corners of faces,
    as of `evocity.formats.facets.Facets`.

    points : (c, 3), the corners, by face. of : (c,), the face of each. normals : (f, 3), the sums
    of cross products. wall : (f,), whether a face is a wall. tiles : (f,), the height of a tile on
    walls. A face is level if the z of its normal is above ``level``, up or down.
    """
    first = 0
    for k in range(points.shape[0]):
        own = of[k]
        x, y, z = normals[own, 0], normals[own, 1], normals[own, 2]
        length = np.sqrt(x * x + y * y + z * z)
        if length > 0:
            x, y, z = x / length, y / length, z / length
        else:  # a face without area has any normal of length 1
            x, y, z = 0.0, 0.0, 1.0
        normal[k, 0], normal[k, 1], normal[k, 2] = x, y, z
        if abs(z) > level and not wall[own]:
            uv[k, 0], uv[k, 1] = points[k, 0], points[k, 1]
            continue
        slope = np.sqrt(x * x + y * y)
        east, north = -y / max(slope, 1e-9), x / max(slope, 1e-9)
        along = points[k, 0] * east + points[k, 1] * north
        if wall[own]:
            uv[k, 0], uv[k, 1] = along / tiles[own], points[k, 2] / tiles[own]
        else:  # up the slope: the cross product of the normal and the direction along the eaves
            across = points[k, 1] * east - points[k, 0] * north
            uv[k, 0], uv[k, 1] = along, across * z + points[k, 2] * slope
        # the least u of a face is 0
        if k == 0 or of[k - 1] != own:
            first = k
        if k + 1 == points.shape[0] or of[k + 1] != own:
            least = uv[first, 0]
            for row in range(first, k + 1):
                least = min(least, uv[row, 0])
            for row in range(first, k + 1):
                uv[row, 0] -= least


@kernel
def match_rows(rows, sought, table, found):
    """Find ``sought`` (n, 3) among the ``rows`` (m, 3), whole numbers: ``found`` (n,) becomes the
    first equal row of each, or -1. ``table`` has a power of 2 of places, more than m, all -1."""
    last = table.shape[0] - 1
    for k in range(rows.shape[0] + sought.shape[0]):
        known = k < rows.shape[0]
        row = rows[k] if known else sought[k - rows.shape[0]]
        mixed = np.uint64(0)
        for part in range(3):
            mixed = (mixed ^ np.uint64(row[part])) * np.uint64(0x9E3779B97F4A7C15)
            mixed ^= mixed >> np.uint64(29)
        place = np.int64(mixed & np.uint64(last))
        while table[place] >= 0:
            other = rows[table[place]]
            if other[0] == row[0] and other[1] == row[1] and other[2] == row[2]:
                break
            place = (place + 1) & last
        if not known:
            found[k - rows.shape[0]] = table[place]
        elif table[place] < 0:
            table[place] = k
