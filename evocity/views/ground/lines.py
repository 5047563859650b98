"""Middle lines of streets: the skeleton of open ground, and its widths."""

from dataclasses import dataclass

import numpy as np

from evocity.views.ground._kernels import link_lengths, thin, widths_across
from evocity.views.ground.space import nearest_built
from evocity.views.limit_tables import read_only

#: Width above which ground is a square, a park or a field, not a street, metres.
WIDEST = 60.0
#: Depth of a wall's dents up to which they get no line, px: rasters are full of dents.
DENT = 2.0


@dataclass(frozen=True, eq=False)
class Streets:
    """The middle lines of streets, alleys and courtyards, one pixel wide.

    skeleton : bool ``(H, W)``: the middle lines of open ground. Ground has none where it is
        wider than `WIDEST`, or nearer to the map's border than to a wall: the other wall is not on
        the map.
    width : float32 ``(H, W)``: metres from wall to wall there, 0 elsewhere.
    widths : float32 ``(k,)``, metres: ``width`` on the k pixels of ``skeleton``, row by row.
    lengths : float32 ``(k,)``, metres: the length of line of each of these pixels, half of its
        links to the next pixels.
    length : metres, the sum of lengths.
    """

    skeleton: np.ndarray
    width: np.ndarray
    widths: np.ndarray
    lengths: np.ndarray
    length: float


def streets(built: np.ndarray, metres_per_pixel: float, widest: float = WIDEST) -> Streets:
    """Compute the skeleton of open ground and its widths, at most ``widest`` metres.

    Thinning removes ground in the order of its distance from walls, and keeps its topology. It
    keeps the pixels that have walls in directions 120° or more apart. Then branches into dents of
    walls (`DENT`) go. So corners and staircases of pixels have no branches. Ground wider than
    ``widest`` or cut by the border is not thinned: lines end where they reach it. (The order:
    Pudney 1998, Computer Vision and Image Understanding 72:404-413; the angle: Malandain &
    Fernández-Vidal 1998, Image and Vision Computing 16:317-327.)

    The width is the sum of the distances of two opposite neighbours across the street, and 1 px. It
    is exact for streets along rows or columns, and right within a pixel otherwise.

    3 to 5 ms at 256². All arrays are read-only."""
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
    arrays = read_only(lines), read_only(width), read_only(width[lines]), read_only(lengths)
    return Streets(*arrays, float(lengths.sum(dtype=np.float64)))
