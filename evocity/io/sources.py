"""What readers take and hand over: `Request`, `Footprints`, `Grid`, `Reader`.

A reader knows one format. It returns buildings as polygons (`Footprints`) or a raster
(`Grid`), in the source's own reference system; window, projection and pixels are not its
concern.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from affine import Affine
from pyproj import CRS

from evocity.citymap import MAX_PIXELS, MAX_SIDE
from evocity.errors import MapError, keyword


@dataclass(frozen=True)
class Request:
    """What the caller of `read_map` asked for; its docstring describes the fields."""

    pixels: int | None = None
    metres_per_pixel: float | None = None
    center: tuple[float, float] | None = None
    layer: str | None = None
    default_height: float = 6.0
    height_scale: float | None = None
    name: str | None = None


@dataclass(frozen=True)
class Footprints:
    """Buildings as polygons.

    Attributes
    ----------
    polygons : object array of shapely polygons or multipolygons, 2D, in ``crs``.
    tags : one mapping a polygon, the source's attributes; the rules of `heights` read them.
    crs : two-dimensional reference system of the coordinates; an engineering one of metres if
        they lie nowhere on Earth.
    center : (lon, lat) of the window the file itself asks for, or None; (x, y) if nowhere.
    projection : reference system in metres the file itself asks for, or None.
    side : metres a side of the window the file names, or None. It is told beside what was taken:
        how large the window is, the request says.
    bare : whether the file names a window and has nothing in it, so that no building stands there.
    """

    polygons: np.ndarray
    tags: Sequence[Mapping[str, object]]
    crs: CRS
    attribution: str = ""
    center: tuple[float, float] | None = None
    projection: CRS | None = None
    side: float | None = None
    bare: bool = False


@dataclass(frozen=True)
class Grid:
    """A raster of heights.

    Attributes
    ----------
    heights : ``(H, W)``, metres, 0 = ground.
    crs, transform : where on Earth, as rasterio has it; ``crs`` is None where nobody knows.
    metres_per_pixel : side of a pixel, if the file of an unplaced raster tells it.
    """

    heights: np.ndarray
    crs: CRS | None = None
    transform: Affine = field(default_factory=Affine.identity)
    metres_per_pixel: float | None = None
    attribution: str = ""
    name: str | None = None


@dataclass(frozen=True)
class Reader:
    """One row of the table of readers.

    Attributes
    ----------
    read : ``(path, request) -> Footprints | Grid``.
    content : the kind of content it can read, a value of `content_of`, or None for any.
    takes : which of the options ``layer`` and ``height_scale`` mean something to it.
    """

    read: Callable[[Path, Request], Footprints | Grid]
    content: str | None = None
    takes: frozenset[str] = frozenset({"layer", "height_scale"})


_MAGIC = (
    (b"\x89PNG\r\n\x1a\n", "PNG"),
    (b"\x93NUMPY", "NPY"),
    (b"II*\x00", "TIFF"),
    (b"MM\x00*", "TIFF"),
    (b"II+\x00", "TIFF"),
    (b"MM\x00+", "TIFF"),
    (b"SQLite format 3\x00", "SQLite (GeoPackage)"),
    (b"\x00\x00\x27\x0a", "Shapefile"),
    (b"PK\x03\x04", "ZIP"),
    (b"\x1f\x8b", "gzip"),
    (b"BZh", "bzip2"),
    (b"\xff\xd8\xff", "JPEG"),
    (b"%PDF", "PDF"),
)


def content_of(head: bytes) -> str:
    """The kind of content a file's first bytes (a kilobyte or more) announce."""
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            return kind
    if b"OSMHeader" in head[:64]:
        return "OSM PBF"
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    if text.startswith((b"{", b"[")):
        return "JSON"
    if text.startswith(b"<"):
        # OSM files declare no entities; those that do may grow without end.
        return "OSM XML" if b"<osm" in text and b"<!DOCTYPE" not in text else "XML"
    return "unknown"


def check_size(name: str, height: int, width: int) -> None:
    """Raise `MapError` if a raster of this size must not be allocated."""
    if max(height, width) > MAX_SIDE or height * width > MAX_PIXELS:
        raise MapError(
            f"{name}: {height} × {width} pixels",
            f"at most {MAX_SIDE} pixels a side and {MAX_PIXELS // 10**6} million in all",
            f"cut out a smaller window, or make it coarser, with {keyword('pixels')} and "
            f"{keyword('metres_per_pixel')} "
            "for footprints or with gdal_translate for a raster",
        )


def north_up(left: float, top: float, side: float) -> Affine:
    """The transform of square pixels whose north-west corner lies at (left, top)."""
    return Affine(side, 0.0, left, 0.0, -side, top)


__all__ = [
    "Footprints",
    "Grid",
    "Reader",
    "Request",
    "check_size",
    "content_of",
    "north_up",
]
