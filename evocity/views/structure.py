"""Which way walls run, pixel by pixel: the structure of the gradient of heights."""

from math import comb

import numpy as np
import scipy

from evocity.views._kernels import scharr, smooth, square

#: The binomial filter of 8 steps, σ = √2 px: its middle weight, and those at distance 1…4.
_BINOMIAL = np.array([comb(8, 4 + k) / 2**8 for k in range(5)], np.float32)


def gradients(heights: np.ndarray, metres_per_pixel: float) -> tuple[np.ndarray, np.ndarray]:
    """Float32 pair ``(d/dy, d/dx)``, ``(H, W)`` each, of ``heights``, metres a metre, y to the
    south, by the Scharr operator, edges repeated."""
    along_y, along_x = np.empty_like(heights), np.empty_like(heights)
    scharr(heights, np.float32(1 / (32 * metres_per_pixel)), along_y, along_x)
    return along_y, along_x


def structure(
    along_y: np.ndarray, along_x: np.ndarray, site: np.ndarray | None = None
) -> np.ndarray:
    """Squared gradient in doubled angles: w cos 2θ and w sin 2θ.

    along_y, along_x : float32 ``(H, W)``, gradient of heights, metres a metre, y to the south.
    site : bool ``(H, W)``: where the map's own pixels are, None for everywhere. Beyond it the
        nearest of them are repeated, as the edges of a map are.
    Returns float32 ``(2, H, W)``. θ, half its angle, is the direction of the gradient, which
    crosses walls at right angles, from east towards south; its length w = \\|∇h\\|² the weight.

    A raster's façades are staircases: their angles are found by smoothing the gradient
    (binomial, σ = √2 px), then its square (the same). Opposite gradients are one
    direction to the square, so it bears averaging where the gradient itself would cancel.

    Source: Bigün & Granlund 1987, Optimal orientation detection of linear symmetry.
    """
    beyond = None if site is None else nearest(site)
    dy, dx = _smoothed(np.stack([along_y, along_x]), beyond)
    # z² of z = dx + i dy, whose direction is twice the gradient's.
    squared = np.empty((2, *along_y.shape), np.float32)
    square(dy, dx, squared)
    return _smoothed(squared, beyond)


def nearest(site: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns ``(H, W)`` of the pixel of a ``site`` that is nearest to each: an index that
    repeats its edge beyond it."""
    found = scipy.ndimage.distance_transform_edt(~site, return_distances=False, return_indices=True)
    return found[0], found[1]


def _smoothed(
    fields: np.ndarray, beyond: tuple[np.ndarray, np.ndarray] | None = None
) -> np.ndarray:
    """``fields`` ``(n, H, W)`` under `_BINOMIAL`, edges repeated; ``beyond``: `nearest`."""
    if beyond is not None:
        fields = np.ascontiguousarray(fields[:, *beyond])
    smoothed = np.empty_like(fields)
    smooth(fields, _BINOMIAL, smoothed)
    return smoothed
