"""Distance transform: metres from each pixel to the nearest built pixel."""

import numpy as np

from evocity.views.ground._kernels import squared_distances


def distance_to_built(built: np.ndarray, metres_per_pixel: float) -> np.ndarray:
    """Compute the metres from each pixel's centre to that of the nearest built pixel.

    Parameters
    ----------
    built : bool ``(H, W)``.
    metres_per_pixel : side of a pixel, metres.

    Returns float32 ``(H, W)``: 0 on built pixels, infinity everywhere without any. The distance is
    Euclidean and exact (Meijster, Roerdink & Hesselink 2000). The wall itself is half a pixel
    nearer. The map's border does not count as a wall. About 0.9 ms at 256².
    """
    squares, _ = nearest_built(built)
    if squares[0, 0] < 0:
        return np.full(built.shape, np.inf, np.float32)
    return (np.sqrt(squares) * metres_per_pixel).astype(np.float32)


def nearest_built(built: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the nearest built pixel of each pixel.

    Returns int32 ``(H, W)``, squared distances in px, and int32 ``(2, H, W)``, row and column of
    the nearest built pixel; both −1 everywhere if nothing is built.
    """
    squares, nearest = np.empty(built.shape, np.int32), np.empty((2, *built.shape), np.int32)
    squared_distances(built, squares, nearest)
    return squares, nearest
