"""Compiled rays across streets. Pixel (row, column) covers half a pixel each way about its
numbers."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def distances_along(ground, lines, starts, ways, own, reach, distances):
    """distances[k] = how far, px, the ray from ``starts[k]`` in direction ``ways[k]`` runs to the
    edge of the first wall's pixel; -1 if it ends at ``reach`` px, leaves the map, or crosses
    another line before.

    ground : uint8 (H, W), 0 open, 1 wall, 2 beyond the map; what lies beyond the array is beyond
    the map too. lines : int32 (H, W), the line of each pixel, 0 for none; the ray passes its
    ``own`` one, int32 (n,). starts, ways : float64 (n, 2), row and column; ways have the length 1.
    """
    rows, columns = ground.shape
    for k in range(distances.size):
        distances[k] = -1.0
        y, x = int(np.floor(starts[k, 0] + 0.5)), int(np.floor(starts[k, 1] + 0.5))
        down, along = ways[k, 0], ways[k, 1]
        step_y, step_x = (1 if down > 0 else -1), (1 if along > 0 else -1)
        # along the ray: to the next side of a pixel in each direction, and from side to side
        next_y = (y + 0.5 * step_y - starts[k, 0]) / down if down != 0 else np.inf
        next_x = (x + 0.5 * step_x - starts[k, 1]) / along if along != 0 else np.inf
        every_y = abs(1 / down) if down != 0 else np.inf
        every_x = abs(1 / along) if along != 0 else np.inf
        away = 0.0
        while away <= reach and 0 <= y < rows and 0 <= x < columns and ground[y, x] != 2:
            if ground[y, x] == 1:
                distances[k] = away
                break
            if lines[y, x] != 0 and lines[y, x] != own[k]:
                break
            if next_y < next_x:
                away = next_y
                next_y += every_y
                y += step_y
            else:
                away = next_x
                next_x += every_x
                x += step_x
