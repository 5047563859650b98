"""Lines of GeoJSON files: the document within bounds of size, and its lines as arrays."""

import json
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from evocity.errors import MapError, reason_of

#: The most points of all lines of a document.
MOST_POINTS = 1_000_000
#: Bytes of a document that is parsed whatever it holds; memory that a larger one may take, bytes.
SMALL, MOST_MEMORY = 50_000_000, 1_200_000_000
#: Geometries that have lines: lines themselves, and polygons with their rings.
LINEAR = ("LineString", "MultiLineString", "Polygon", "MultiPolygon")

# Containers within containers are read down to this depth.
_DEEPEST = 20


def read_document(path: Path, name: str = "") -> dict:
    """Read the JSON object of a file, {} for other JSON; ``name`` is the file's in messages. Raises
    `MapError` for a file that cannot be read, is not JSON, or is too large."""
    try:
        with open(path, "rb") as file:
            content = file.read(MOST_MEMORY // 2 + 1)
    except OSError as error:
        raise MapError(
            f"{path} cannot be opened: {reason_of(error)}",
            "a GeoJSON file that you may read",
            "check the path and the permissions",
        ) from None
    return parse_document(content, name or path.name)


def parse_document(content: bytes, name: str) -> dict:
    """Parse a JSON object, {} for other JSON. Raises `MapError` for content that is not JSON, or
    too large."""
    try:
        if len(content) > SMALL and estimate_memory(content) > MOST_MEMORY:
            raise MapError(
                f"{name} has {content.count(b'[') + content.count(b'{')} lists and objects in "
                f"{len(content) / 1e6:.0f} MB of JSON, which would take too much memory",
                f"a file that takes at most {MOST_MEMORY / 1e9:g} GB of memory, so at most about "
                "100 MB of JSON",
                "cut the file to the district and its surroundings, for example in QGIS",
            )
        document = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise MapError(
            f"{name} is not complete JSON: {error}",
            "a GeoJSON or CityJSON file",
            "download or export the file again; it may be cut off",
        ) from error
    return document if isinstance(document, dict) else {}


def lines_in(document: dict, name: str, kinds: Collection[str] = LINEAR) -> list[np.ndarray]:
    """List the lines of a document in their order, each float ``(n, 2)``, without repeated points;
    lines of one point stay, geometries of other ``kinds`` do not. Raises `MapError` for coordinates
    that are not lists of finite numbers, and for more points than `MOST_POINTS`."""
    lines: list[np.ndarray] = []
    waiting: list[tuple[object, int]] = [(document, 0)]
    while waiting:
        node, depth = waiting.pop()
        if not isinstance(node, dict) or depth > _DEEPEST:
            continue
        kind = node.get("type")
        if kind in kinds:
            try:
                lines += map(_points, _rows(kind, node["coordinates"]))
            except (TypeError, KeyError, ValueError, OverflowError, IndexError) as error:
                raise MapError(
                    f"{name}: the coordinates cannot be read ({error})",
                    "a list of points [x, y] with finite numbers",
                    "repair or delete this feature, for example in QGIS",
                ) from None
        waiting += [(child, depth + 1) for child in reversed(_children(node))]
    count = sum(map(len, lines))
    if count > MOST_POINTS:
        raise MapError(
            f"{name}: the lines have {count} points",
            f"at most {MOST_POINTS} points",
            "simplify the lines",
        )
    return [
        line[np.append(True, (np.diff(line, axis=0) != 0).any(axis=1))]
        for line in lines
        if len(line)
    ]


def _children(node: dict) -> list:
    kind = node.get("type")
    if kind == "Feature":
        return [node.get("geometry")]
    if kind not in ("FeatureCollection", "GeometryCollection"):
        return []
    children = node.get("features" if kind == "FeatureCollection" else "geometries")
    return children if isinstance(children, list) else []


def _rows(kind: str, coordinates: Sequence) -> Sequence:
    if kind == "LineString":
        return [coordinates]
    if kind == "MultiPolygon":
        return [ring for rings in coordinates for ring in rings]
    return list(coordinates)


def _points(row: Sequence) -> np.ndarray:
    points = np.array([(float(at[0]), float(at[1])) for at in row], np.float64).reshape(-1, 2)
    if not np.isfinite(points).all():
        raise ValueError("a number that is not finite")
    return points


def estimate_memory(content: bytes) -> int:
    """Estimate the bytes of memory of parsed JSON: of lists, objects, numbers and texts."""
    lists, objects, values = (content.count(sign) for sign in (b"[", b"{", b","))
    return 2 * len(content) + 100 * lists + 250 * objects + 40 * values
