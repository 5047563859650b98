"""Orientation of walls, pixel by pixel: the gradient of heights and its structure tensor."""

from math import comb

import numpy as np
import scipy

from evocity.views._kernels import scharr, smooth, square

#: The binomial filter of 8 steps, σ = √2 px: its middle weight, and those at distance 1…4.
_BINOMIAL = np.array([comb(8, 4 + k) / 2**8 for k in range(5)], np.float32)


def gradients(heights: np.ndarray, metres_per_pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Compute the gradient of ``heights`` by the Scharr operator, with repeated edges.

    Returns float32 ``(d/dy, d/dx)``, ``(H, W)`` each, metres per metre, y to the south.
    """
    along_y, along_x = np.empty_like(heights), np.empty_like(heights)
    scharr(heights, np.float32(1 / (32 * metres_per_pixel)), along_y, along_x)
    return along_y, along_x


def structure(
    along_y: np.ndarray, along_x: np.ndarray, site: np.ndarray | None = None
) -> np.ndarray:
    """Compute the squared gradient in doubled angles: w cos 2θ and w sin 2θ, float32 ``(2, H, W)``.

    along_y, along_x : float32 ``(H, W)``, gradient of heights, metres per metre, y to the south.
    site : bool ``(H, W)``: the map's own pixels, None for all. Beyond it the nearest of them
        repeat, as the edges of a map do.

    θ, half the angle of the result, is the direction of the gradient, which crosses walls at right
    angles, from east towards south; its length w = \\|∇h\\|² the weight. A raster's façades are
    staircases. So the gradient is smoothed (binomial, σ = √2 px), then its square (the same
    filter). Opposite gradients have equal squares, so squares keep directions that would cancel.

    Source: Bigün & Granlund 1987, Optimal orientation detection of linear symmetry."""
    beyond = None if site is None else nearest(site)
    dy, dx = _smooth(np.stack([along_y, along_x]), beyond)
    # z² of z = dx + i dy, whose direction is twice the gradient's.
    squared = np.empty((2, *along_y.shape), np.float32)
    square(dy, dx, squared)
    return _smooth(squared, beyond)


def nearest(site: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the pixel of a ``site`` nearest to each: rows and columns ``(H, W)``, an index that
    repeats the edge of the site beyond it."""
    rows, columns = scipy.ndimage.distance_transform_edt(
        ~site, return_distances=False, return_indices=True
    )
    return rows, columns


def _smooth(fields: np.ndarray, beyond: tuple[np.ndarray, np.ndarray] | None = None) -> np.ndarray:
    """Smooth ``fields`` ``(n, H, W)`` with `_BINOMIAL`, edges repeated; ``beyond``: `nearest`."""
    if beyond is not None:
        fields = np.ascontiguousarray(fields[:, *beyond])
    smoothed = np.empty_like(fields)
    smooth(fields, _BINOMIAL, smoothed)
    return smoothed
