"""Bounds of the requested window in a file's own reference system, so that the reader of a large
file reads only what the window needs."""

import math
from collections.abc import Sequence

import numpy as np
from pyproj import CRS, Transformer
from pyproj.exceptions import ProjError

from evocity.errors import MapError, keyword
from evocity.io.projection import WGS84, local_metres
from evocity.io.rasterization import METRES_PER_PIXEL, PIXELS
from evocity.io.reader_types import Request

#: Files of at most so many features are read completely, whatever the window.
SMALL = 5000

Box = tuple[float, float, float, float]

# The window's axes may be those of another projection, whose lengths differ a little.
_SLACK, _MARGIN = 1.02, 5.0


def window_box(request: Request, crs: CRS) -> Box | None:
    """Find the bounds of the window of ``request``: west, south, east, north in ``crs``. None if
    the request names no centre, or ``crs`` has no bounds for the window."""
    if request.center is None or crs.is_engineering:
        return None
    half = _side(request) / 2 * _SLACK + _MARGIN
    try:
        transformer = Transformer.from_crs(local_metres(*request.center), crs, always_xy=True)
        box = transformer.transform_bounds(-half, -half, half, half)
    except ProjError:
        return None
    west, south, east, north = box
    if not np.isfinite(box).all() or west > east or south > north:
        return None  # for example across the 180th meridian
    return west, south, east, north


def boxes_meet(boxes: np.ndarray, box: Box) -> np.ndarray:
    """Tell which of ``boxes``, float ``(n, 4)``, meet ``box``: bool ``(n,)``."""
    west, south, east, north = box
    return (
        (boxes[:, 0] <= east)
        & (boxes[:, 2] >= west)
        & (boxes[:, 1] <= north)
        & (boxes[:, 3] >= south)
    )


def empty_window_error(
    name: str, request: Request, crs: CRS, count: int, bounds: Sequence[float] | None
) -> MapError:
    """Make the error for a window that meets none of the ``count`` features of the file ``name``,
    which have these ``bounds`` in ``crs``."""
    lon, lat = request.center or (math.nan, math.nan)
    found = f"{name}: no building in the {_side(request):g} m about {lon:g}, {lat:g}"
    try:
        transformer = Transformer.from_crs(crs, WGS84, always_xy=True)
        left, bottom, right, top = [math.nan] * 4 if bounds is None else bounds
        west, south, east, north = transformer.transform_bounds(left, bottom, right, top)
    except ProjError:
        west = south = east = north = math.nan
    if not np.isfinite([west, south, east, north]).all():
        return MapError(
            found,
            f"a window among the {count} features of the file",
            f"give another {keyword('center')}, or leave it out",
        )
    remedy = f"give another {keyword('center')}, or leave it out"
    if west <= lat <= east and south <= lon <= north:
        remedy = f"give longitude first: {keyword('center', (lat, lon))}"
    return MapError(
        found,
        f"a window among its {count} features, from longitude {west:.5f} to {east:.5f} and "
        f"latitude {south:.5f} to {north:.5f}",
        remedy,
    )


def _side(request: Request) -> float:
    """The side of the requested window, metres."""
    return (request.pixels or PIXELS) * (request.metres_per_pixel or METRES_PER_PIXEL)
