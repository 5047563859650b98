"""Outlines of buildings, as polygons along the edges of pixels."""

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import shapely


def outlines(
    labels: np.ndarray, metres_per_pixel: float, corner: tuple[float, float]
) -> "tuple[shapely.Polygon, ...]":
    """Draw each building of ``labels`` as a polygon along its pixels' edges, courtyards as holes.

    Parameters
    ----------
    labels : int32 ``(H, W)``: 0 on open ground, 1…n on the buildings, each of pixels that touch
        by sides (`Buildings.labels`).
    metres_per_pixel : side of a pixel, metres.
    corner : (x, y) of the north-west corner, x to the east, y to the north, metres.

    Returns n valid shapely polygons in the order of the labels: polygon i is building i + 1.
    """
    # slow to load, and few runs need polygons
    import shapely
    from affine import Affine
    from rasterio.features import shapes

    side, (left, top) = metres_per_pixel, corner
    transform = Affine(side, 0.0, left, 0.0, -side, top)
    polygons = np.empty(int(labels.max()), object)
    for shape, label in shapes(labels, labels > 0, connectivity=4, transform=transform):
        shell, *holes = shape["coordinates"]
        polygons[int(label) - 1] = shapely.Polygon(shell, holes)
    # an outline that touches itself at a corner becomes a shell and a hole that touch
    return tuple(shapely.make_valid(polygons, method="structure", keep_collapsed=False))
