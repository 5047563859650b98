"""Fitting of maps to a height map of ground, along both axes, by the fit of curves."""

import numpy as np
import scipy
from numpy.typing import ArrayLike

from evocity.shapes.checks import check_range
from evocity.shapes.curve_fit import MOST_FITTED, fit_maps
from evocity.shapes.detail import check_depth, point_count
from evocity.shapes.surface_detail import (
    DetailedSurface,
    check_heights,
    check_sides,
    resample_heights,
)

#: The most components of a height map to which the maps are fitted.
_COMPONENTS = 8


def fit_surface(
    heights: ArrayLike,
    points: int = 7,
    maps: int = 2,
    depth: int | None = None,
    drawn: int = 3,
    starts: int = 3,
    rng: np.random.Generator | None = None,
    rounds: int = 25,
    spacing: tuple[float, float] = (1.0, 1.0),
) -> DetailedSurface:
    """Fit maps to a height map, and return the height map as a `DetailedSurface`.

    heights : float ``(R, C)``, metres, without holes; `DetailedSurface.of` resamples them.
    points, maps : numbers of control points and of parts along each axis. Smooth ground needs more
        points: 4 points draw it with kinks between the parts.
    depth : number of levels; by default the depth whose number of heights is nearest to that of
        the longer side.
    drawn : number of finest levels that the maps draw without details.
    starts, rng, rounds : as in `fit_curve`.
    spacing : distance between neighbouring heights along both axes, metres.

    The maps of each axis are fitted to all lines of the height map along this axis together. Raises
    `ShapeError` for heights with holes, and for fewer heights along an axis than control points.
    """
    heights = check_heights(heights, points)
    check_range("points", points, 2, MOST_FITTED, whole=True)
    check_range("maps", maps, 2, 64, whole=True)
    if depth is None:
        longer = max(heights.shape)
        depth = min(range(1, 24), key=lambda d: abs(point_count(points, maps, d, True) - longer))
    check_depth(points, maps, depth, True)
    check_range("drawn", drawn, 1, 64, whole=True)
    side = point_count(points, maps, depth, True)
    check_sides(side, side)
    at, spacing = resample_heights(heights, (side, side), spacing)
    rng = np.random.default_rng(0) if rng is None else rng
    fitted: list[np.ndarray] = []
    for lines in (at, at.T):
        left, lengths, _ = scipy.linalg.svd(lines - lines.mean(), full_matrices=False)
        # a turn of all lines in their space does not change the fit
        turned = (left * lengths)[:, :_COMPONENTS]
        fitted.append(
            fit_maps(
                turned, points, maps, depth, min(drawn, depth), starts, rng, rounds, is_sampled=True
            )
        )  # fmt: skip
    rows, columns = fitted
    return DetailedSurface.of(at, rows, columns, depth, spacing)


def surface_rms(surface: DetailedSurface, levels: int) -> float:
    """Compute the root mean square change of the heights without the finest ``levels``, metres."""
    off = surface.dropped(levels).heights() - surface.heights()
    return float(np.sqrt((off**2).mean()))
