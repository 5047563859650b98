"""Streets: the middle lines of the ground between buildings, and how wide it is there."""

from dataclasses import dataclass

import numpy as np

from evocity.views.ground._kernels import link_lengths, thin, widths_across
from evocity.views.ground.distance import nearest_built

#: Ground wider than this, metres, is a square, a park or a field, and no street.
WIDEST = 60.0
#: Dents of a wall no deeper than this, px, have no line of their own: rasters are full of them.
DENT = 2.0


@dataclass(frozen=True, eq=False)
class Streets:
    """The lines streets run along, one pixel wide, in streets, alleys and courtyards alike.

    skeleton : bool ``(H, W)``: the middle lines of open ground, less where it is nearer to the
        map's border than to a wall (the other wall is not on the map) or wider than `WIDEST`.
    width : float32 ``(H, W)``: metres from wall to wall there, 0 elsewhere.
    widths : float32 ``(k,)``, metres: ``width`` on the k pixels of ``skeleton``, row by row.
    lengths : float32 ``(k,)``, metres: how much of the lines each of these pixels stands for,
        half of its links to the next ones.
    length : metres, their sum.
    """

    skeleton: np.ndarray
    width: np.ndarray
    widths: np.ndarray
    lengths: np.ndarray
    length: float


def streets(built: np.ndarray, metres_per_pixel: float, widest: float = WIDEST) -> Streets:
    """The skeleton of open ground and its widths.

    Parameters
    ----------
    built : bool ``(H, W)``.
    metres_per_pixel : side of a pixel, metres.
    widest : the widest ground that counts, metres.

    The ground is thinned in the order of its distance from walls, its topology kept, down to
    the pixels that have walls in directions 120° or more apart; then branches into dents of
    walls (`DENT`) go. So corners and staircases of pixels have none. What is wider than
    ``widest`` or cut by the border is not thinned: lines end where they reach it. (The order:
    Pudney 1998, Computer Vision and Image Understanding 72:404-413; the angle: Malandain &
    Fernández-Vidal 1998, Image and Vision Computing 16:317-327.)

    Twice the distance to the nearest built pixel would be a pixel too wide where the middle line
    runs along pixel centres, and right where it runs between them. So the width is 1 px more
    than the sum of the distances of two opposite neighbours, across the street: exactly w where a
    street along the rows or columns is w px wide, within a pixel otherwise.

    3 to 5 ms at 256². All arrays are read-only.
    """
    squares, nearest = nearest_built(built)
    lines, width = ~built, np.empty(built.shape, np.float32)
    rows, columns = (np.minimum(n, n[::-1]) for n in map(np.arange, built.shape))
    border = np.minimum(rows[:, None], columns)
    solid = (
        (squares < 0) | (squares >= border**2) | (4 * squares > (widest / metres_per_pixel) ** 2)
    )
    thin(built, squares, nearest, solid, DENT, lines)
    lines &= ~solid
    widths_across(squares, lines, width)
    width *= np.float32(metres_per_pixel)
    lines &= width <= widest
    width *= lines
    lengths = np.empty(np.count_nonzero(lines), np.float32)
    link_lengths(lines, lengths)
    lengths *= np.float32(metres_per_pixel)
    arrays = lines, width, width[lines], lengths
    for array in arrays:
        array.setflags(write=False)
    return Streets(*arrays, float(lengths.sum(dtype=np.float64)))
