"""Transforms from the metres of a reference system to the globe."""

import numpy as np

# Length over which the directions of a reference system are measured on the globe, metres.
_SPAN = 100.0


def globe_transform(
    crs: str | None, corner: tuple[float, float], size: tuple[float, float] = (0.0, 0.0)
) -> list[float] | None:
    """Compute the matrix of 16 numbers, column by column, from metres at a ``corner`` in ``crs`` to
    Earth-centred coordinates (EPSG:4978); None for a map without a place.

    The matrix holds the position, the directions and the scale of ``crs`` at the middle of a map of
    ``size``, metres to the east and to the north. There, the height of the ground is 0 above the
    ellipsoid. A matrix cannot bend: at d metres from the middle, the ground lies about d² / 12.7 Mm
    above the ellipsoid.
    """
    if crs is None:
        return None
    from pyproj import CRS, Transformer
    from pyproj.exceptions import ProjError

    from_corner = np.array(size) / 2
    x, y = np.array(corner) + from_corner
    try:
        lon, lat = Transformer.from_crs(CRS.from_user_input(crs), 4979, always_xy=True).transform(
            [x, x + _SPAN, x], [y, y, y + _SPAN]
        )
        globe = Transformer.from_crs(4979, 4978, always_xy=True)
        points = np.column_stack(globe.transform(lon, lat, [0.0, 0.0, 0.0]))
    except ProjError:
        return None
    if not np.isfinite(points).all():
        return None
    east, north = points[1] - points[0], points[2] - points[0]
    scale = float(np.sqrt((east**2).sum())) / _SPAN
    east /= np.sqrt((east**2).sum())
    up = np.cross(east, north)
    up /= np.sqrt((up**2).sum())
    north = np.cross(up, east)
    matrix = np.eye(4)  # of rows that become columns of the file
    matrix[:3, :3] = np.stack([east, north, up]) * scale
    matrix[3, :3] = points[0] - from_corner @ matrix[:2, :3]
    return [float(number) for number in matrix.ravel()]
