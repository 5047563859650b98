"""Arguments and results of readers: `Request`, `Footprints`, `Grid`, `Reader`.

A reader knows one format. It returns buildings as polygons (`Footprints`) or a raster (`Grid`), in
the source's own reference system; others choose window, projection and pixels.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from affine import Affine
from pyproj import CRS

from evocity.citymap import MAX_PIXELS, MAX_SIDE
from evocity.errors import MapError, keyword
from evocity.io.account import Account


@dataclass(frozen=True)
class Request:
    """Arguments of a call of `read_map`; the fields have the names of the arguments."""

    pixels: int | None = None
    metres_per_pixel: float | None = None
    center: tuple[float, float] | None = None
    layer: str | None = None
    default_height: float = 6.0
    height_scale: float | None = None
    name: str | None = None
    height_column: str | None = None
    levels_column: str | None = None
    nodata: float | None = None
    terrain: str | float | None = None


@dataclass(frozen=True)
class Footprints:
    """Buildings as polygons.

    Attributes
    ----------
    polygons : two-dimensional shapely polygons or multipolygons, with coordinates in ``crs``,
        object array.
    tags : mappings from attribute names to values, one for each polygon. The rules for heights of
        buildings read the attributes of each polygon.
    crs : two-dimensional reference system of the coordinates. Polygons without a place on Earth
        have a local (engineering) reference system in metres.
    center : (longitude, latitude) of the centre of the window that the file names, or None. If
        polygons have no place on Earth, the centre is (x, y) in metres in a local reference system.
    projection : metric reference system that the file names; None if the file names no such system.
    side : side of the window that the file names, metres; None if the file names no side. The
        request sets the size of the window; a note with the map reports ``side`` if the two sizes
        differ.
    bare : whether the file names a window without any building.
    of_buildings : whether the name or the columns of the layer say that it holds only buildings.
    height_unit : metres of a number without a unit, in columns of heights.
    account : count of the file's features, and of those that give no polygon here; None if the
        reader does not count.
    note : how the file was read, for the note with the map; it begins with "; ".
    """

    polygons: np.ndarray
    tags: Sequence[Mapping[str, object]]
    crs: CRS
    attribution: str = ""
    center: tuple[float, float] | None = None
    projection: CRS | None = None
    side: float | None = None
    bare: bool = False
    of_buildings: bool = False
    height_unit: float = 1.0
    account: Account | None = None
    note: str = ""


@dataclass(frozen=True)
class Grid:
    """Raster of heights.

    Attributes
    ----------
    heights : heights above ground, ``(H, W)``, metres; ground is 0, and missing pixels are NaN.
        If the request names a terrain, the heights are elevations. `read_map` sets pixels of a
        writable array to ground.
    crs, transform : coordinate reference system and affine transform of the raster, as in rasterio.
        The field ``crs`` is None if the reference system is unknown.
    metres_per_pixel : side of a pixel in metres, or None; a file without a reference system can
        give this side.
    above_ground : whether it is certain that the heights are above ground. If not, evocity refuses
        heights that look like elevations.
    fault : error about implausible values; a map of these heights raises it, a mask does not.
    note : text about the values, for the user; "" without one.
    """

    heights: np.ndarray
    crs: CRS | None = None
    transform: Affine = field(default_factory=Affine.identity)
    metres_per_pixel: float | None = None
    attribution: str = ""
    name: str | None = None
    above_ground: bool = True
    fault: MapError | None = None
    note: str = ""


@dataclass(frozen=True)
class Reader:
    """Reader of one file format, as a row of the table `READERS`.

    Attributes
    ----------
    read : function ``(path, request) -> Footprints | Grid``.
    content : kind of content that the function reads; the function `content_of` gives the names of
        all kinds. If ``content`` is None, the reader accepts any content.
    takes : set of the names of options that the reader accepts; possible names are ``layer``,
        ``height_scale``, ``height_column``, ``levels_column``, ``nodata`` and ``terrain``.
    """

    read: Callable[[Path, Request], Footprints | Grid]
    content: str | None = None
    takes: frozenset[str] = frozenset({"layer", "height_scale", "height_column", "levels_column"})


#: The content of a folder that GDAL reads; a file never has this content.
GEODATABASE = "File GDB (a folder)"

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
    (b"PK\x05\x06", "ZIP"),
    (b"PAR1", "Parquet"),
    (b"fgb\x03fgb", "FlatGeobuf"),
    (b"AutoCAD Binary DXF", "binary DXF"),
    (b"\x1f\x8b", "gzip"),
    (b"BZh", "bzip2"),
    (b"\xff\xd8\xff", "JPEG"),
    (b"%PDF", "PDF"),
)


_XML = (
    (b"<osm", "OSM XML"),
    (b"<kml", "KML"),
    (b"opengis.net/kml", "KML"),
    (b"opengis.net/gml", "GML"),
)
# A comment (code 999), or the beginning of a section.
_DXF = re.compile(rb"(999\s*\n|0\s*\n\s*SECTION\s*\n)")


def content_of(head: bytes) -> str:
    """Tell the kind of content by a file's first bytes (a kilobyte or more)."""
    for magic, kind in _MAGIC:
        if head.startswith(magic):
            return kind
    if b"OSMHeader" in head[:64]:
        return "OSM PBF"
    text = head.removeprefix(b"\xef\xbb\xbf").lstrip(b"\x1e \t\r\n\f\v")
    if text[:6].lower() in (b"ncols ", b"ncols\t", b"nrows ", b"nrows\t"):
        return "ASCII grid"
    if text.startswith((b"{", b"[")):
        return "JSON"
    if text.startswith(b"<"):
        # OSM files declare no entities; those that do may grow without end.
        if b"<!DOCTYPE" in text:
            return "XML"
        kinds = (kind for mark, kind in _XML if mark in text)
        return next(kinds, "XML")
    if _DXF.match(text):
        return "DXF"
    return "unknown"


def check_size(name: str, height: int, width: int) -> None:
    """Raise `MapError` for a raster that is too large to allocate."""
    if max(height, width) > MAX_SIDE or height * width > MAX_PIXELS:
        raise MapError(
            f"{name}: {height} × {width} pixels are too many",
            f"at most {MAX_SIDE} pixels per side and {MAX_PIXELS // 10**6} million in all",
            f"choose a smaller window or larger pixels; for footprints use {keyword('pixels')} "
            f"and {keyword('metres_per_pixel')}; for a raster use gdal_translate",
        )


def refuse_center(request: Request, name: str) -> None:
    """Raise `MapError` if a center is given for the file ``name``, which has no place on Earth."""
    if request.center is not None:
        raise MapError(
            f"{name} has no coordinate reference system, so {keyword('center', request.center)} "
            "cannot apply",
            f"a file with a coordinate reference system, or a call without {keyword('center')}",
            f"leave {keyword('center')} out to use a window around the middle of the map",
        )


def north_up(left: float, top: float, side: float) -> Affine:
    """Return the transform of square pixels whose north-west corner lies at (left, top)."""
    return Affine(side, 0.0, left, 0.0, -side, top)
