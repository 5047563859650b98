"""Lines in a window: read from GeoJSON, placed in metres, checked, and laid as strips of pixels."""

from collections.abc import Sequence
from pathlib import Path
from threading import Lock

import numpy as np

from evocity.errors import MapError

# rasterio hides a warning of its own by filters that all threads share
_RASTERIZING = Lock()


def read_line(path: Path, name: str) -> tuple[np.ndarray, bool]:
    """Read the line of a GeoJSON file, as `line_in`; ``name`` is the file's in messages."""
    from evocity.formats.geojson_lines import read_document  # the room loads shapely

    return _single_line(read_document(path, name), name)


def line_in(content: bytes, name: str) -> tuple[np.ndarray, bool]:
    """Parse GeoJSON with one LineString, float ``(n, 2)``, n ≥ 2, without repeated points; and
    whether it is in degrees (RFC 7946). A document with ``"window": true`` has metres from the
    south-west corner of a window, east and north.

    Raises `MapError`, which names the file, for other content.
    """
    from evocity.formats.geojson_lines import parse_document

    return _single_line(parse_document(content, name), name)


def _single_line(document: dict, name: str) -> tuple[np.ndarray, bool]:
    from evocity.formats.geojson_lines import lines_in

    lines = lines_in(document, name, kinds=("LineString",))
    if len(lines) != 1:
        raise MapError(
            f"{name} has {len(lines) or 'no'} line{'s' * (len(lines) != 1)}",
            "a file with exactly one LineString",
            "join the parts of the line, and remove all other lines",
        )
    (points,) = lines
    degrees = document.get("window") is not True
    bound = np.array([180.0, 90.0]) if degrees else np.array([1e9, 1e9])
    if (np.abs(points) > bound).any():
        raise MapError(
            f"{name}: a point of the line is out of range",
            'points as [longitude, latitude], or in metres with "window": true next to "type"',
            "correct the coordinates of the line",
        )
    if len(points) < 2:
        found = f"{name}: the line has only one point"
        raise MapError(found, "a line of at least two points", "draw the line again")
    return points, degrees


def place_line(
    line: np.ndarray,
    degrees: bool,
    side: float,
    origin: Sequence[float] | None,
    crs: str | None,
    name: str,
) -> np.ndarray:
    """Convert a ``line`` of a file to metres from the south-west corner of a window of ``side``
    metres, whose north-west corner is ``origin`` in ``crs``. Raises `MapError` for a line on Earth
    in a window that is not."""
    if not degrees:
        return line
    if origin is None or crs is None:
        raise MapError(
            f"{name} has points in degrees, but the window has no position in a reference system",
            'points in metres from the corner of the window, with "window": true in the file',
            "convert the points of the line to metres",
        )
    import pyproj

    to = pyproj.Transformer.from_crs("OGC:CRS84", crs, always_xy=True)
    x, y = to.transform(line[:, 0], line[:, 1])
    return np.column_stack([x - origin[0], y - (origin[1] - side)])


def cut_to_window(line: np.ndarray, side: float, name: str) -> np.ndarray:
    """Cut a ``line`` to its longest part within the window. Raises `MapError` for a line outside
    the window."""
    import shapely

    inside = shapely.intersection(shapely.LineString(line), shapely.box(0, 0, side, side))
    parts = [part for part in shapely.get_parts(inside) if part.length > 0]
    if not parts:
        raise MapError(
            f"the line {name} lies outside the window, a square of {side:g} m",
            "a line that runs through the window",
            "choose another centre in [[parents]], or another line",
        )
    return np.array(max(parts, key=lambda part: part.length).coords)


def crosses_itself(line: np.ndarray) -> bool:
    """Tell whether a line meets itself, beyond its ends."""
    import shapely

    return not shapely.LineString(line).is_simple


def leaves_window(line: np.ndarray, side: float) -> bool:
    """Tell whether part of a line lies outside the window, by more than a millionth of its side."""
    slack = 1e-6 * side
    return bool((line < -slack).any() or (line > side + slack).any())


def strip_mask(
    line: np.ndarray, breadth: float, pixels: int, metres_per_pixel: float
) -> np.ndarray:
    """Mark the pixels whose centre lies within half a ``breadth`` of a line, metres: bool
    ``(pixels, pixels)``, rows from the north."""
    import affine
    import shapely
    from rasterio.features import rasterize

    ground = shapely.buffer(shapely.LineString(line), breadth / 2)
    top = pixels * metres_per_pixel
    to = (metres_per_pixel, 0.0, 0.0, 0.0, -metres_per_pixel, top)
    with _RASTERIZING:
        mask = rasterize(
            [(ground, 1)], (pixels, pixels), transform=affine.Affine(*to), dtype=np.uint8
        )
    return mask.astype(bool)
