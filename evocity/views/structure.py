"""Which way walls run, pixel by pixel: the structure of the gradient of heights."""

import numpy as np


def structure(along_y: np.ndarray, along_x: np.ndarray) -> np.ndarray:
    """Squared gradient in doubled angles: w cos 2θ and w sin 2θ.

    along_y, along_x : float32 ``(H, W)``, gradient of heights, metres a metre, y to the south.
    Returns float32 ``(2, H, W)``. θ, half its angle, is the direction of the gradient, which
    crosses walls at right angles, from east towards south; its length w = \\|∇h\\|² the weight.

    A raster's façades are staircases: their angles are found by smoothing the gradient
    (binomial, σ = √2 px), then its square (the same). Opposite gradients are one
    direction to the square, so it bears averaging where the gradient itself would cancel.

    Source: Bigün & Granlund 1987, Optimal orientation detection of linear symmetry.
    """
    dy, dx = _smoothed(np.stack([along_y, along_x]), 8)
    # z² of z = dx + i dy, whose direction is twice the gradient's.
    return _smoothed(np.stack([dx * dx - dy * dy, 2 * dx * dy]), 8)


def _smoothed(fields: np.ndarray, passes: int) -> np.ndarray:
    """``fields`` ``(n, H, W)`` under the binomial filter of ``passes`` (even) steps, which has
    σ = √passes / 2 px; edges repeated."""
    edge = passes // 2
    fields = np.pad(fields, ((0, 0), (edge, edge), (edge, edge)), mode="edge")
    for _ in range(passes):
        fields = fields[:, 1:] + fields[:, :-1]
    for _ in range(passes):
        fields = fields[:, :, 1:] + fields[:, :, :-1]
    return fields * np.float32(0.25**passes)
