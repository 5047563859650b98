"""Sequences of JSON documents, one a line: GeoJSONSeq (RFC 8142) and its kin, as one document."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evocity.errors import MapError, format_bytes
from evocity.io.projection import WGS84
from evocity.io.reader_types import Request
from evocity.io.window_box import SMALL, window_box

#: Bytes of a line, and of all lines that are kept; at most.
MOST_LINE, MOST_KEPT = 50_000_000, 400_000_000

_SEPARATOR = b"\x1e"


def is_sequence(path: Path) -> bool:
    """Tell whether a file holds several JSON objects, one a line."""
    with open(path, "rb") as file:
        lines = _lines(file.readline(MOST_LINE) for _ in range(3))
        try:
            first, second = next(lines, b""), next(lines, b"")
            if not second.startswith(b"{"):
                return False
            return isinstance(json.loads(first), dict)
        except (ValueError, RecursionError):
            return False


def read_sequence(path: Path, request: Request) -> tuple[dict, int]:
    """Read the features of a sequence as a FeatureCollection, and count all its features. If the
    request names a centre, features of a large sequence that do not meet the window are left out.
    Raises `MapError` for a line that is not a GeoJSON object."""
    box = window_box(request, WGS84)
    features: list[dict] = []
    first: list[dict] = []  # kept whole in case that there are only a few
    kept = count = 0
    with open(path, "rb") as file:
        for number, line in enumerate(_lines(iter(lambda: file.readline(MOST_LINE), b"")), 1):
            count += 1
            feature = _feature(path, number, line)
            if count <= SMALL:
                first.append(feature)
            if box is None or _meets(feature.get("geometry"), box):
                kept += len(line)
                features.append(feature)
                if kept > MOST_KEPT:
                    raise MapError(
                        f"{path.name} has more than {format_bytes(MOST_KEPT)} of features",
                        f"at most {format_bytes(MOST_KEPT)} in the window",
                        "give the centre of a window, or convert the file to GeoPackage with "
                        "ogr2ogr",
                    )
    if count <= SMALL:
        features = first
    return {"type": "FeatureCollection", "features": features}, count


def _lines(lines: Iterator[bytes]) -> Iterator[bytes]:
    for line in lines:
        if content := line.replace(_SEPARATOR, b"").removeprefix(b"\xef\xbb\xbf").strip():
            yield content


def _feature(path: Path, number: int, line: bytes) -> dict:
    try:
        document = json.loads(line)
    except (ValueError, RecursionError) as error:
        raise MapError(
            f"{path.name}, line {number}: not complete JSON ({error})",
            "a GeoJSON feature on each line",
            "download or export the file again; it may be cut off",
        ) from error
    kind = document.get("type") if isinstance(document, dict) else None
    if kind == "Feature":
        return document
    if kind in ("Polygon", "MultiPolygon", "GeometryCollection", "Point", "LineString"):
        return {"type": "Feature", "properties": {}, "geometry": document}
    raise MapError(
        f"{path.name}, line {number}: the JSON has the type {kind!r}",
        "a GeoJSON feature on each line",
        "export the building footprints as GeoJSON",
    )


def _meets(geometry: object, box: tuple[float, float, float, float]) -> bool:
    """Whether the points of a GeoJSON geometry may meet a ``box``; true for unreadable ones, which
    the reader of GeoJSON reports."""
    if not isinstance(geometry, dict) or "coordinates" not in geometry:
        return True
    try:
        rings = geometry["coordinates"]
        if geometry.get("type") == "MultiPolygon":
            rings = [ring for polygon in rings for ring in polygon]
        elif geometry.get("type") != "Polygon":
            return True
        points = np.array([point[:2] for ring in rings for point in ring], dtype=np.float64)
        (west, south), (east, north) = points.min(axis=0), points.max(axis=0)
    except (TypeError, ValueError, OverflowError, IndexError):
        return True
    return bool(west <= box[2] and east >= box[0] and south <= box[3] and north >= box[1])
