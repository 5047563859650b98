"""Sequences of JSON documents, one a line: GeoJSONSeq (RFC 8142) and its kin, as one document."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from evocity.errors import MapError, format_bytes
from evocity.formats.geojson_lines import MOST_MEMORY, estimate_memory
from evocity.io.projection import WGS84
from evocity.io.reader_types import Request
from evocity.io.window_box import SMALL, boxes_meet, empty_window_error, window_box

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
            return estimate_memory(first) > MOST_MEMORY or isinstance(json.loads(first), dict)
        except (ValueError, RecursionError):
            return False


def read_sequence(path: Path, request: Request) -> tuple[dict, int]:
    """Read the features of a sequence as a FeatureCollection, and count all its features. If the
    request names a centre, features of a large sequence that do not meet the window are left out.
    Raises `MapError` for a line that is not a GeoJSON object, for lines that would take too much
    memory, and for a large sequence without a feature in the window."""
    box = window_box(request, WGS84)
    features: list[dict] = []
    first: list[dict] = []  # kept whole in case that there are only a few
    kept = count = early = memory = 0
    extent = np.array([np.inf, np.inf, -np.inf, -np.inf])
    with open(path, "rb") as file:
        for number, line in enumerate(_lines(iter(lambda: file.readline(MOST_LINE), b"")), 1):
            count += 1
            size = estimate_memory(line)
            if size > MOST_MEMORY:
                raise _too_large(f"{path.name}, line {number},", MOST_MEMORY, "of memory")
            feature = _feature(path, number, line)
            if count <= SMALL:
                first.append(feature)
                early += size
            else:
                first, early = [], 0
            bounds = None if box is None else _bounds(feature.get("geometry"))
            if bounds is not None:
                extent[:2] = np.minimum(extent[:2], bounds[:2])
                extent[2:] = np.maximum(extent[2:], bounds[2:])
            if box is None or bounds is None or boxes_meet(bounds[None], box).all():
                kept += len(line)
                memory += size
                features.append(feature)
                if kept > MOST_KEPT:
                    raise _too_large(path.name, MOST_KEPT, "of features")
            if max(early, memory) > MOST_MEMORY:
                raise _too_large(path.name, MOST_MEMORY, "of memory for features")
    if count <= SMALL:
        features = first
    elif not features:
        raise empty_window_error(path.name, request, WGS84, count, extent.tolist())
    return {"type": "FeatureCollection", "features": features}, count


def _too_large(name: str, most: int, noun: str) -> MapError:
    return MapError(
        f"{name} needs more than {format_bytes(most)} {noun}",
        f"at most {format_bytes(most)} in the window",
        "give the centre of a window, or convert the file to GeoPackage with ogr2ogr",
    )


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


def _bounds(geometry: object) -> np.ndarray | None:
    """The bounds of the points of a GeoJSON polygon, float ``(4,)``; None for other geometries, and
    for unreadable ones, which the reader of GeoJSON reports."""
    if not isinstance(geometry, dict) or "coordinates" not in geometry:
        return None
    try:
        rings = geometry["coordinates"]
        if geometry.get("type") == "MultiPolygon":
            rings = [ring for polygon in rings for ring in polygon]
        elif geometry.get("type") != "Polygon":
            return None
        points = np.array([point[:2] for ring in rings for point in ring], dtype=np.float64)
        bounds = np.concatenate([points.min(axis=0), points.max(axis=0)])
    except (TypeError, ValueError, OverflowError, IndexError):
        return None
    return bounds if bounds.shape == (4,) and not np.isnan(bounds).any() else None
