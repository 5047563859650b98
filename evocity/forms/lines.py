"""Lines in windows: read from files, checked, fitted, and laid as strips."""

import json
from collections.abc import Sequence

import numpy as np

from evocity.errors import MapError, shown

#: The most points of a line in a file.
MOST_POINTS = 200_000


def line_in(content: bytes, name: str) -> tuple[np.ndarray, bool]:
    """The one line of a GeoJSON document, float ``(n, 2)``, n ≥ 2, repeated points left out; and
    whether it is in degrees (RFC 7946): a document with ``"window": true`` has metres from the
    south-west corner of a window, east and north.

    Raises `MapError`, which names the file, for what is none.
    """
    try:
        document = json.loads(content.decode())
    except (ValueError, RecursionError):
        document = None
    if not isinstance(document, dict):
        raise MapError(f"{name}: no JSON", "a GeoJSON file with one line", "export it again")
    lines: list[object] = []
    _gather(document, lines, 0)
    if len(lines) != 1:
        raise MapError(
            f"{name}: {len(lines) or 'no'} line{'s' * (len(lines) > 1)}",
            "one LineString",
            "join its parts to one line, and leave the others out",
        )
    try:
        points = np.array([pair[:2] for pair in lines[0]], np.float64)
    except (TypeError, ValueError, LookupError):
        points = np.zeros(0)
    if points.ndim != 2 or points.shape[1:] != (2,) or len(points) > MOST_POINTS:
        raise MapError(
            f"{name}: a line that is none, or of more than {MOST_POINTS} points",
            "a list of [x, y]",
            "correct it, or simplify it",
        )
    degrees = document.get("window") is not True
    bound = np.array([180.0, 90.0]) if degrees else np.array([1e9, 1e9])
    if not np.isfinite(points).all() or (np.abs(points) > bound).any():
        raise MapError(
            f"{name}: a point that lies nowhere",
            '[longitude, latitude]; or metres, with "window": true beside the type',
            "correct it",
        )
    points = points[np.append(True, (np.diff(points, axis=0) != 0).any(axis=1))]
    if len(points) < 2:
        raise MapError(f"{name}: a line of one point", "two or more", "draw it again")
    return points, degrees


def _gather(node: dict, found: list, depth: int) -> None:
    kind = node.get("type")
    if kind == "LineString":
        found.append(node.get("coordinates"))
    inner = {"FeatureCollection": "features", "GeometryCollection": "geometries"}.get(kind)
    listed = node.get(inner) if inner else [node.get("geometry")] if kind == "Feature" else []
    for one in listed if isinstance(listed, list) and depth < 8 else ():
        if isinstance(one, dict):
            _gather(one, found, depth + 1)


def placed(
    line: np.ndarray,
    degrees: bool,
    side: float,
    origin: Sequence[float] | None,
    crs: str | None,
    name: str,
) -> np.ndarray:
    """A ``line`` of a file in metres from the south-west corner of a window of ``side`` metres,
    whose north-west corner is ``origin`` in ``crs``. Raises `MapError` if one is on Earth and the
    other is not."""
    if not degrees:
        return line
    if origin is None or crs is None:
        raise MapError(
            f"{name} in degrees, for a window that lies nowhere on Earth",
            'metres in the window, with "window": true',
            "give it so",
        )
    import pyproj

    to = pyproj.Transformer.from_crs("OGC:CRS84", crs, always_xy=True)
    x, y = to.transform(line[:, 0], line[:, 1])
    return np.column_stack([x - origin[0], y - (origin[1] - side)])


def cut_to(line: np.ndarray, side: float, name: str) -> np.ndarray:
    """The longest part of a ``line`` within the window. Raises `MapError` if none is."""
    import shapely

    found = shapely.intersection(shapely.LineString(line), shapely.box(0, 0, side, side))
    parts = [one for one in shapely.get_parts(found) if one.length > 0]
    if not parts:
        raise MapError(
            f"{name} lies outside the window of {side:g} m",
            "a line that runs through it",
            "choose another centre in [[parents]], or another line",
        )
    return np.array(max(parts, key=lambda one: one.length).coords)


def crosses_itself(line: np.ndarray) -> bool:
    """Whether a line meets itself, beyond its ends."""
    import shapely

    return not shapely.LineString(line).is_simple


def leaves(line: np.ndarray, side: float) -> bool:
    """Whether some of a line lies outside the window, by more than a millionth of its side."""
    slack = 1e-6 * side
    return bool((line < -slack).any() or (line > side + slack).any())


def strip(line: np.ndarray, breadth: float, pixels: int, metres_per_pixel: float) -> np.ndarray:
    """Bool ``(pixels, pixels)``, rows from the north: pixels whose centre lies within half a
    ``breadth`` of a line, metres."""
    import affine
    import shapely
    from rasterio.features import rasterize

    ground = shapely.buffer(shapely.LineString(line), breadth / 2)
    top = pixels * metres_per_pixel
    to = (metres_per_pixel, 0.0, 0.0, 0.0, -metres_per_pixel, top)
    return rasterize(
        [(ground, 1)], (pixels, pixels), transform=affine.Affine(*to), dtype=np.uint8
    ).astype(bool)


def read_line(path, name: str | None = None) -> tuple[np.ndarray, bool]:
    """`line_in` of a file. Raises `MapError`."""
    try:
        with open(path, "rb") as file:
            content = file.read(50_000_001)
    except OSError as error:
        raise MapError(f"{path}: {error.strerror}", "a GeoJSON file", "check the path") from None
    if len(content) > 50_000_000:
        raise MapError(f"{shown(str(path))} of more than 50 MB", "one line", "simplify it")
    return line_in(content, name or str(path))
