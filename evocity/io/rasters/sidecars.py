"""Files beside a raster: ``.aux.xml`` (nodata, scale, offset, unit, place), ``.tfw``, ``.msk``,
``.prj``.

evocity reads these files itself, and GDAL sees only their bytes: so no such file can name another.
A link, a file that is not a regular file, and a file beyond the limit of size are refused.
"""

import math
import os
import stat
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from affine import Affine
from pyproj import CRS
from pyproj.exceptions import ProjError
from rasterio.errors import RasterioError
from rasterio.io import MemoryFile

from evocity.errors import MapError, format_bytes, reason_of
from evocity.io.projection import identify

# Largest sizes, bytes: texts, and masks.
_MOST_TEXT, _MOST_MASK = 16 << 20, 256 << 20
# Suffixes of world files; users of Windows write them in capitals.
WORLD_FILES = (".tfw", ".TFW", ".tifw", ".tiffw", ".wld")
# The first words of WKT; PROJ could take other text for the name of a file.
_WKT = ("GEOGC", "PROJC", "PROJCS", "LOCAL_CS", "COMPD_CS", "COMPOUNDCRS", "ENGCRS", "BOUNDCRS")


@dataclass(frozen=True)
class BandNotes:
    """Notes of ``.aux.xml`` about one band, and about the place of the raster; None where it has
    no note."""

    nodata: float | None = None
    scale: float | None = None
    offset: float | None = None
    unit: str | None = None
    crs: CRS | None = None
    transform: Affine | None = None


def read_notes(path: Path, band: int) -> BandNotes:
    """Read what the ``.aux.xml`` of the raster ``path`` notes about a ``band``. Raises `MapError`
    for a file that cannot be read."""
    place = path.with_name(path.name + ".aux.xml")
    data = _read_beside(place, _MOST_TEXT)
    if data is None:
        return BandNotes()
    try:
        text = data.decode("utf-8-sig")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise ValueError("it declares entities")
        root = ElementTree.fromstring(text)
        of_band = [
            one for one in root.iter("PAMRasterBand") if (one.get("band") or "1") == str(band)
        ]
        found = of_band[0] if of_band else ElementTree.Element("none")
        crs = (root.findtext("SRS") or "").strip()
        return BandNotes(
            nodata=_number_in(found, "NoDataValue", finite=False),
            scale=_number_in(found, "Scale"),
            offset=_number_in(found, "Offset"),
            unit=(found.findtext("UnitType") or "").strip() or None,
            crs=_crs_in(crs) if crs else None,
            transform=_transform_in(root.findtext("GeoTransform") or ""),
        )
    except (ValueError, ElementTree.ParseError, ProjError, RecursionError) as error:
        raise _unreadable(place, "XML as GDAL writes it", error) from error


def read_world_file(path: Path) -> Affine | None:
    """Read the transform in the world file of the raster ``path``, six numbers; None without this
    file. Raises `MapError` for a file that cannot be read."""
    for suffix in WORLD_FILES:
        place = path.with_suffix(suffix)
        data = _read_beside(place, _MOST_TEXT)
        if data is None:
            continue
        try:
            a, d, b, e, c, f = map(float, data.decode("utf-8-sig").replace(",", ".").split())
            # the last two numbers place the centre of the first pixel
            return Affine(a, b, c - (a + b) / 2, d, e, f - (d + e) / 2)
        except (ValueError, OverflowError) as error:
            raise _unreadable(place, "a world file of six numbers", error) from error
    return None


def read_mask(path: Path, shape: tuple[int, int]) -> np.ndarray | None:
    """Read the mask of missing pixels from the ``.msk`` of the raster ``path``, bool ``(H, W)``;
    None without this file. Raises `MapError` for a file that cannot be read."""
    place = path.with_name(path.name + ".msk")
    data = _read_beside(place, _MOST_MASK)
    if data is None:
        return None
    try:
        with MemoryFile(data) as memory, memory.open(driver="GTiff") as mask:
            if mask.shape != shape:
                there, here = (f"{rows} × {columns} px" for rows, columns in (mask.shape, shape))
                raise ValueError(f"it has {there}, and the raster {here}")
            if mask.dtypes[0] != "uint8":
                raise ValueError(f"it holds {mask.dtypes[0]}")
            return mask.read(1) == 0
    except (RasterioError, ValueError, OSError) as error:
        raise _unreadable(place, "a mask of bytes, of the raster's size", error) from error


def read_prj(path: Path) -> CRS | None:
    """Read the reference system in the ``.prj`` of the raster ``path``; None without this file.
    Raises `MapError` for a file that cannot be read."""
    place = path.with_suffix(".prj")
    data = _read_beside(place, _MOST_TEXT)
    if data is None:
        return None
    try:
        return _crs_in(data.decode("utf-8-sig").strip())
    except (ValueError, ProjError, RecursionError) as error:
        raise _unreadable(place, "a reference system as WKT", error) from error


def _read_beside(place: Path, most: int) -> bytes | None:
    """Read a regular file of at most ``most`` bytes, not through a link; None without it."""
    try:
        # a FIFO would block without O_NONBLOCK
        flags = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
        if place.is_symlink():
            raise OSError("it is a link")
        descriptor = os.open(place, os.O_RDONLY | flags | getattr(os, "O_BINARY", 0))
        with os.fdopen(descriptor, "rb") as file:
            about = os.fstat(descriptor)
            if not stat.S_ISREG(about.st_mode):
                raise OSError("it is not a regular file")
            if about.st_size > most:
                raise OSError(f"it has {format_bytes(about.st_size)}")
            return file.read(most)
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise _unreadable(
            place, f"a regular file of at most {format_bytes(most)}", error
        ) from error


def _number_in(element: ElementTree.Element, name: str, finite: bool = True) -> float | None:
    text = element.findtext(name)
    if text is None or not text.strip():
        return None
    number = float(text)
    if finite and not math.isfinite(number):
        raise ValueError(f"{name} is {number}")
    return number


def _transform_in(text: str) -> Affine | None:
    if not text.strip():
        return None
    numbers = [float(number) for number in text.split(",")]
    if len(numbers) != 6:
        raise ValueError(f"GeoTransform has {len(numbers)} numbers")
    return Affine.from_gdal(*numbers)


def _crs_in(text: str) -> CRS:
    if not text.upper().startswith(_WKT):
        raise ValueError("its reference system is not WKT")
    return identify(CRS.from_wkt(text))


def _unreadable(place: Path, expected: str, error: Exception) -> MapError:
    reason = reason_of(error) if isinstance(error, OSError) else str(error)[:200]
    return MapError(
        f"{place.name}, beside the raster, cannot be read: {reason}",
        expected,
        "write the file again with GDAL or QGIS, or remove it if it is not needed",
    )
