"""Arguments and results of readers: `Request`, `Footprints`, `Grid`, `Reader`.

A reader knows one format. It returns buildings as polygons (`Footprints`) or a raster (`Grid`), in
the source's own reference system; others choose window, projection and pixels.
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
    """Arguments of `read_map`, whose docstring describes them."""

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
    polygons : object array of shapely polygons or multipolygons, in two dimensions, in ``crs``.
    tags : for each polygon, a mapping of its attributes in the source. The height rules use
        these values.
    crs : two-dimensional reference system of the coordinates. Polygons without a place on Earth
        have an engineering system in metres.
    center : centre of the window that the file names, or None. It is (lon, lat), or (x, y) in an
        engineering system.
    projection : metric reference system that the file names, or None.
    side : side of the window that the file names, metres, or None. The note about the map quotes
        it, but the request sets the size of the window.
    bare : whether the file names a window that contains nothing.
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
    """Raster of heights.

    Attributes
    ----------
    heights : heights ``(H, W)``, metres, 0 = ground.
    crs, transform : place of the raster on Earth, as in rasterio. The field ``crs`` is None if
        unknown.
    metres_per_pixel : side of a pixel, if a file without ``crs`` states it.
    """

    heights: np.ndarray
    crs: CRS | None = None
    transform: Affine = field(default_factory=Affine.identity)
    metres_per_pixel: float | None = None
    attribution: str = ""
    name: str | None = None


@dataclass(frozen=True)
class Reader:
    """Row of the table of readers.

    Attributes
    ----------
    read : function ``(path, request) -> Footprints | Grid``.
    content : kind of content that the function reads, as `content_of` names it. None reads any
        content.
    takes : names of the options ``layer`` and ``height_scale`` that apply to this reader.
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
    """Tell the kind of content by a file's first bytes (a kilobyte or more)."""
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
    """Raise `MapError` for a raster that is too large to allocate."""
    if max(height, width) > MAX_SIDE or height * width > MAX_PIXELS:
        raise MapError(
            f"{name}: {height} × {width} pixels are too many",
            f"at most {MAX_SIDE} pixels per side and {MAX_PIXELS // 10**6} million in all",
            f"cut a smaller window, or choose larger pixels, with {keyword('pixels')} and "
            f"{keyword('metres_per_pixel')} for footprints or with gdal_translate for a raster",
        )


def north_up(left: float, top: float, side: float) -> Affine:
    """Return the transform of square pixels whose north-west corner lies at (left, top)."""
    return Affine(side, 0.0, left, 0.0, -side, top)
