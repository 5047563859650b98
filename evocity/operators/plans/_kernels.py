"""Compiled loop of candidates for a face. Its slow twin stands in tests/naive.py."""

import numpy as np

from evocity.accelerate import kernel


@kernel
def count_built(numbers, used, ratio, down, along, inner, row, column, turns, counts):
    """Count the built points of a lot at each of k candidates: int64 ``counts`` ``(k, 4)``.

    numbers : int32 ``(h, w)``, polygon of each fine pixel, 0 on ground. used : bool ``(H, W)``,
    pixels that stand on the map already. ratio : fine pixels along a pixel.
    down, along : float64 ``(n,)``, offsets of points from the centre of the face, metres; the first
    ``inner`` are points of the whole lot, the others of the strip along its outline.
    row, column : float64 ``(k,)``, places, px. turns : float64 ``(k, 4)``, rows and then columns of
    the source, px, that a metre down and a metre along the plan become.

    counts : built points of the lot; built points of the strip; built and used points of the lot; 1
    where a point lies beyond the source, and the other counts are unfinished.
    """
    height, width = numbers.shape
    for k in range(row.size):
        counts[k] = 0
        for i in range(down.size):
            y = row[k] + turns[k, 0] * down[i] + turns[k, 1] * along[i] + 0.5
            x = column[k] + turns[k, 2] * down[i] + turns[k, 3] * along[i] + 0.5
            fine_y, fine_x = int(np.floor(y * ratio)), int(np.floor(x * ratio))
            if fine_y < 0 or fine_x < 0 or fine_y >= height or fine_x >= width:
                counts[k, 3] = 1
                break
            if numbers[fine_y, fine_x] > 0:
                if i >= inner:
                    counts[k, 1] += 1
                else:
                    counts[k, 0] += 1
                    coarse_y = min(int(y), used.shape[0] - 1)
                    coarse_x = min(int(x), used.shape[1] - 1)
                    counts[k, 2] += used[coarse_y, coarse_x]
