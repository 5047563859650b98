"""Flat roofs: each building at its median height, against the roughness of decoding."""

import numpy as np

from evocity.errors import MapError
from evocity.views.buildings import _kernels
from evocity.views.buildings.segmentation import STEP, zones_of


def settled(
    heights: np.ndarray,
    labels: np.ndarray,
    metres_per_pixel: float,
    keep: np.ndarray | None = None,
) -> np.ndarray:
    """Set every building to its median height, and open ground to 0.

    Gaps and steps of height separate buildings, as in `separate_buildings` by default. The median
    of an even number of heights is the lower of the middle two: every roof has a height that
    occurs in it. Neighbours whose medians differ by no more than the step would be one building in
    the result. They unite and take the median of all their pixels, until no such pair remains. So
    the function is idempotent, and the buildings of the result are those it made flat. A map with
    flat buildings and ground at 0 stays the same, bit for bit.

    Pixels marked in ``keep`` stay the same, and belong to no building here: a building that is
    kept in part takes the median of its other pixels. All other pixels that are not built are
    traces of decoding, and become ground.

    Parameters
    ----------
    heights : float32 ``(H, W)``, metres.
    labels : ``(H, W)``: 0 or False on open ground, else built (`CityMap.labels`, `CityMap.built`).
    metres_per_pixel : side of a pixel, metres.
    keep : bool ``(H, W)``, or None for nothing.

    Returns float32 ``(H, W)``, metres, an array of its own. About 2 ms at 256².

    Raises
    ------
    MapError : ``keep`` has another shape than ``heights``.

    Source: ours.
    """
    roofs, _ = settled_zones(heights, labels, metres_per_pixel, keep)
    return roofs


def settled_zones(
    heights: np.ndarray,
    labels: np.ndarray,
    metres_per_pixel: float,
    keep: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Do as `settled`, and return the labels of the flat buildings too: int32 ``(H, W)``, else 0.

    With nothing to ``keep`` they equal those of `separate_buildings` in the settled map.
    """
    if keep is not None and np.shape(keep) != heights.shape:
        raise MapError(
            f"keep of shape {np.shape(keep)} for a map of shape {heights.shape}",
            "a bool for each pixel of the map",
            f"give keep the shape {heights.shape}",
        )
    roofs = np.zeros(heights.shape, np.float32)
    if keep is not None:
        labels = np.where(keep, labels.dtype.type(0), labels)  # keeps the type
        np.copyto(roofs, heights, where=keep)
    zones = zones_of(heights, labels, metres_per_pixel)
    _kernels.level(heights, zones, int(zones.max(initial=0)), STEP, roofs)
    return roofs, zones
