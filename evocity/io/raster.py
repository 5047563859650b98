"""Readers of rasters of heights: GeoTIFF, grey PNG, NPY."""

import contextlib
import sys
import warnings
import zlib
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from PIL import Image
from pyproj import CRS
from pyproj.exceptions import ProjError
from rasterio._err import CPLE_BaseError  # what some properties of a dataset raise
from rasterio.enums import ColorInterp
from rasterio.errors import NotGeoreferencedWarning, RasterioError
from rasterio.windows import Window

from evocity.errors import MapError, keyword
from evocity.io.geotiff_seal import check_seal
from evocity.io.projection import flat
from evocity.io.reader_types import Grid, Request, check_size

#: Tag with the pixel size of a GeoTIFF without a reference system.
PIXEL_TAG = "METRES_PER_PIXEL"

# No sidecar files: they may point anywhere. Each block is read once, so the cache is small (bytes).
_ENVIRONMENT = {
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
    "GDAL_PAM_ENABLED": "NO",
    "GDAL_CACHEMAX": 1 << 26,
}

# Pixels per read.
_AT_ONCE = 1 << 22

_FEET = {"ft": 0.3048, "foot": 0.3048, "feet": 0.3048, "us-ft": 1200 / 3937}


def read_geotiff(path: Path, request: Request) -> Grid:
    """Read the one band of heights of a GeoTIFF; nodata, NaN and negative values are ground. It
    applies the band's own scale, offset and feet, and multiplies by ``height_scale``. A sealed file
    must have the bytes that evocity wrote."""
    try:
        check_seal(path)
        with (
            warnings.catch_warnings(action="ignore", category=NotGeoreferencedWarning),
            _silence_gdal(),
            rasterio.Env(**_ENVIRONMENT),
            rasterio.open(path, driver="GTiff") as source,
        ):
            check_size(path.name, *source.shape)
            band = _height_band(path, source)
            if "complex" in source.dtypes[band - 1]:
                raise _no_heights(path, "complex numbers")
            scale, offset = source.scales[band - 1], source.offsets[band - 1]
            unit = _FEET.get((source.units[band - 1] or "").lower(), 1.0)
            factor = scale * unit * (request.height_scale or 1.0)
            ground = _ground(source, band, factor, offset * unit * (request.height_scale or 1.0))
            crs, transform, tags = source.crs, source.transform, source.tags()
            if crs is not None:
                _check_transform(path, transform)
                crs = flat(CRS.from_wkt(crs.to_wkt()))
                crs = crs if crs.is_projected or crs.is_geographic else None
    except (RasterioError, CPLE_BaseError, OSError, ValueError, ProjError) as error:
        raise MapError(
            f"{path.name} cannot be read as GeoTIFF: {error.__cause__ or error}",
            "a complete GeoTIFF",
            "download or export the file again, because it may be cut off",
        ) from error
    return Grid(
        heights=ground,
        crs=crs,
        transform=transform,
        metres_per_pixel=_number(tags.get(PIXEL_TAG)),
        attribution=tags.get("ATTRIBUTION") or tags.get("TIFFTAG_COPYRIGHT") or "",
        name=tags.get("NAME"),
    )


def _ground(source: rasterio.DatasetReader, band: int, factor: float, offset: float) -> np.ndarray:
    """Read metres of a ``band``, float32 ``(H, W)``, some rows at a time: in float64 large rasters
    would fill gigabytes."""
    height, width = source.shape
    ground = np.empty((height, width), np.float32)
    deep = source.block_shapes[band - 1][0]
    step = max(deep, _AT_ONCE // max(width, 1) // deep * deep)
    for top in range(0, height, step):
        rows = min(step, height - top)
        heights = source.read(band, masked=True, window=Window(0, top, width, rows))
        with np.errstate(all="ignore"):
            if factor != 1.0 or offset != 0.0:
                heights = heights.astype(np.float64) * factor + offset
            ground[top : top + rows] = np.ma.filled(heights.astype(np.float32), np.float32(0))
        part = ground[top : top + rows]
        part[~(part > 0)] = 0
    return ground


def _check_transform(path: Path, transform: Affine) -> None:
    """Raise unless the transform gives pixels a finite place and size."""
    numbers = np.array(transform[:6], float)
    with np.errstate(all="ignore"):
        steps = np.hypot(numbers[[0, 1]], numbers[[3, 4]])
        area = abs(numbers[0] * numbers[4] - numbers[1] * numbers[3])
        right = np.isfinite(numbers).all() and (np.abs(numbers) < 1e12).all()
        right &= (steps > 1e-12).all() and area > 1e-6 * steps.prod()
    if not right:
        listed = ", ".join(f"{number:.6g}" for number in numbers)
        raise MapError(
            f"{path.name}: its geotransform is invalid ({listed})",
            "a geotransform of finite numbers that give each pixel an area",
            "repair the file's georeference, for example with gdal_edit -a_ullr",
        )


def read_png(path: Path, request: Request) -> Grid:
    """Read a grey PNG of 1, 8 or 16 bits; metres are its levels times a height scale."""
    try:
        _check_chunks(path)
        with warnings.catch_warnings(action="ignore"), Image.open(path, formats=["PNG"]) as image:
            check_size(path.name, image.height, image.width)
            if image.mode not in ("1", "L", "I", "I;16"):
                raise MapError(
                    f"{path.name} is a picture in colour ({image.mode})",
                    "a grey PNG of 8 or 16 bits whose levels are heights",
                    "read the .tif or .npy file of the map, or convert the picture to grey levels",
                )
            levels = np.asarray(image)
    except MapError:
        raise
    except Exception as error:  # bombs of pixels and of text, and errors of damaged chunks
        raise MapError(
            f"{path.name} cannot be read as PNG: {str(error)[:200] or type(error).__name__}",
            "a complete PNG of at most 170 million pixels, without long text metadata",
            "export the file again, because it may be cut off",
        ) from error
    if request.height_scale is None:
        scale = float(f"{50 / max(1, int(levels.max())):.4g}")
        raise MapError(
            f"{path.name}: its grey levels 0 to {levels.max()} have no height scale",
            f"{keyword('height_scale')} with the metres per grey level",
            f"give the height scale, for example {keyword('height_scale', scale)} if the "
            "highest level means 50 m",
        )
    return Grid(levels.astype(np.float32) * np.float32(request.height_scale))


def _check_chunks(path: Path) -> None:
    """Raise ValueError if a critical chunk of a PNG does not have its checksum: Pillow does not
    check all of them. What follows an incomplete chunk is left to Pillow."""
    with open(path, "rb") as file:
        file.seek(8)
        while len(head := file.read(8)) == 8 and head[4:] != b"IEND":
            left, check = int.from_bytes(head[:4]), zlib.crc32(head[4:])
            while part := file.read(min(left, _AT_ONCE)):
                left -= len(part)
                check = zlib.crc32(part, check)
            expected = file.read(4)
            if len(expected) < 4 or left:
                return
            if head[4:5].isupper() and int.from_bytes(expected) != check:
                raise ValueError("a part of it does not have its checksum")


def read_npy(path: Path, request: Request) -> Grid:
    """Read a two-dimensional array of numbers, metres; it refuses pickled objects."""
    try:
        with warnings.catch_warnings(action="ignore"):
            stored = np.load(path, mmap_mode="r", allow_pickle=False)
    except Exception as error:  # a damaged header raises any error of Python's parser
        reason = (str(error) or type(error).__name__).splitlines()[0]
        raise MapError(
            f"{path.name} cannot be read as NPY: {reason}",
            "a complete file of numbers written by numpy.save",
            "save the heights again with numpy.save(path, heights)",
        ) from error
    if stored.ndim != 2 or stored.dtype.kind not in "biuf":
        raise _no_heights(path, f"{stored.dtype} of shape {stored.shape}")
    check_size(path.name, *stored.shape)
    with np.errstate(over="ignore"):
        return Grid(stored.astype(np.float32) * np.float32(request.height_scale or 1.0))


@contextlib.contextmanager
def _silence_gdal() -> Iterator[None]:
    """Print nothing where rasterio fails to log a message of GDAL that is not UTF-8, as tags of
    files may cause."""
    hook = sys.unraisablehook
    sys.unraisablehook = lambda failed: None
    try:
        yield
    finally:
        sys.unraisablehook = hook


def _height_band(path: Path, source: rasterio.DatasetReader) -> int:
    bands = [
        band
        for band, kind in zip(source.indexes, source.colorinterp, strict=True)
        if kind is not ColorInterp.alpha
    ]
    if len(bands) != 1 or source.colorinterp[bands[0] - 1] is ColorInterp.palette:
        kinds = ", ".join(kind.name for kind in source.colorinterp[:4])
        raise _no_heights(path, f"{len(bands)} bands ({kinds})")
    return bands[0]


def _no_heights(path: Path, found: str) -> MapError:
    return MapError(
        f"{path.name} holds {found}",
        "one band of heights above ground in metres, or one two-dimensional array",
        "extract the heights into a separate file",
    )


def _number(text: str | None) -> float | None:
    try:
        return None if text is None else float(text)
    except ValueError:
        return None
