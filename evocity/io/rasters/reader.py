"""Readers of rasters of heights: GeoTIFF, grey PNG, NPY."""

import contextlib
import math
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
from evocity.io.projection import flat, identify
from evocity.io.rasters.sidecars import BandNotes, read_mask, read_notes, read_world_file
from evocity.io.rasters.values import RasterValues, is_value
from evocity.io.reader_types import Grid, Request, check_size
from evocity.io.resampling import compose

#: Tag with the pixel size of a GeoTIFF without a reference system.
PIXEL_TAG = "METRES_PER_PIXEL"

# GDAL opens no sidecar files, which may point anywhere: see `evocity.io.rasters.sidecars`.
# Each block is read once, so the cache is small (bytes).
_ENVIRONMENT = {
    "GDAL_DISABLE_READDIR_ON_OPEN": "EMPTY_DIR",
    "GDAL_PAM_ENABLED": "NO",
    "GDAL_CACHEMAX": 1 << 26,
}

# Pixels per read.
_AT_ONCE = 1 << 22

#: Description of the band of a map, which says that its heights are above ground.
HEIGHTS_TITLE = "height above ground"

# Metres of the units of a band, by their names in small letters.
_UNITS = {
    **dict.fromkeys(("m", "metre", "metres", "meter", "meters"), 1.0),
    **dict.fromkeys(("ft", "foot", "feet", "international foot"), 0.3048),
    **dict.fromkeys(("us-ft", "us survey foot", "us survey feet", "ftus", "foot us"), 1200 / 3937),
    **dict.fromkeys(("dm", "decimetre", "decimeter"), 0.1),
    **dict.fromkeys(("cm", "centimetre", "centimeter"), 0.01),
    **dict.fromkeys(("mm", "millimetre", "millimeter"), 0.001),
}


def read_geotiff(path: Path, request: Request) -> Grid:
    """Read the one band of heights of a GeoTIFF; missing pixels are NaN. It applies the mask,
    nodata, scale, offset and unit of the file and of its sidecars, and multiplies by
    ``height_scale``. A sealed file must have the bytes that evocity wrote."""
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
            notes = read_notes(path, band)
            crs = notes.crs if source.crs is None else CRS.from_wkt(source.crs.to_wkt())
            unit, note = _unit(notes.unit or source.units[band - 1] or "", crs, request)
            values = _values(path, source, band, request, notes, unit)
            transform, tags = source.transform, source.tags()
            declared = source.descriptions[band - 1] == HEIGHTS_TITLE
            side = _number(tags.get(PIXEL_TAG))
            if crs is not None:
                if transform == Affine.identity():
                    transform = notes.transform or read_world_file(path) or transform
                _check_transform(path, transform, crs)
                crs, transform, side = _placed(identify(flat(crs)), transform, side)
    except (RasterioError, CPLE_BaseError, OSError, ValueError, ProjError) as error:
        raise MapError(
            f"{path.name} cannot be read as GeoTIFF: {error.__cause__ or error}",
            "a complete GeoTIFF",
            "download or export the file again, because it may be cut off",
        ) from error
    return Grid(
        heights=values.metres,
        crs=crs,
        transform=transform,
        metres_per_pixel=side,
        attribution=tags.get("ATTRIBUTION") or tags.get("TIFFTAG_COPYRIGHT") or "",
        name=tags.get("NAME"),
        above_ground=declared,
        fault=None if declared else values.fault,
        note=note,
    )


def _placed(
    crs: CRS, transform: Affine, side: float | None
) -> tuple[CRS | None, Affine, float | None]:
    """Return the reference system if it has a place on Earth; else None, and the transform and the
    side of a pixel in metres, if its unit is a length."""
    if crs.is_projected or crs.is_geographic:
        return crs, transform, side
    factors = {axis.unit_conversion_factor for axis in crs.axis_info}
    if not crs.is_engineering or len(factors) != 1 or 0 in factors:
        return None, transform, side
    transform = compose(Affine.scale(factors.pop()), transform)
    return None, transform, math.sqrt(abs(transform.determinant))


def _unit(named: str, crs: CRS | None, request: Request) -> tuple[float, str]:
    """Return the metres of one unit of a band, and a note. The unit is the ``named`` one of the
    band, else that of the vertical axis, else feet if x and y are in feet; ``height_scale``
    replaces this last guess."""
    known = _UNITS.get(named.lower().replace("_", " "))
    if known is not None or crs is None:
        return known or 1.0, ""
    axes, axis = crs.axis_info, None
    if len(axes) == 3:
        axis = axes[2]
    elif crs.is_projected and request.height_scale is None:
        axis = axes[0]
    if axis is None or not 0.3 < axis.unit_conversion_factor < 0.31:
        return 1.0, ""
    note = f"heights in {axis.unit_name}, the unit of the reference system"
    return axis.unit_conversion_factor, note


def _values(
    path: Path,
    source: rasterio.DatasetReader,
    band: int,
    request: Request,
    notes: BandNotes,
    unit: float,
) -> RasterValues:
    """Read metres of a ``band``, some rows at a time: in float64 large rasters would fill
    gigabytes."""
    height, width = source.shape
    scaled = unit * (request.height_scale or 1.0)
    scale = source.scales[band - 1] if notes.scale is None else notes.scale
    offset = source.offsets[band - 1] if notes.offset is None else notes.offset
    values = RasterValues(path.name, source.shape, request, scale * scaled, offset * scaled)
    mask = read_mask(path, source.shape)
    deep = source.block_shapes[band - 1][0]
    step = max(deep, _AT_ONCE // max(width, 1) // deep * deep)
    for top in range(0, height, step):
        rows = min(step, height - top)
        read = source.read(band, masked=True, window=Window(0, top, width, rows))
        missing = np.ma.getmaskarray(read).copy()
        if mask is not None:
            missing |= mask[top : top + rows]
        if notes.nodata is not None:
            missing |= is_value(read.data, notes.nodata)
        values.take(top, read.data, missing)
    return values


def _check_transform(path: Path, transform: Affine, crs: CRS) -> None:
    """Raise unless the transform gives pixels a finite place and size in ``crs``."""
    if transform == Affine.identity() and not crs.is_engineering:
        raise MapError(
            f"{path.name} has the reference system {crs.name[:80]}, but no place in it",
            "a GeoTIFF with a geotransform, or a file .aux.xml or .tfw of the same name beside it",
            "copy the files beside the raster too, or write the place with gdal_edit -a_ullr",
        )
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
            if image.mode not in ("1", "L", "I", "I;16", "LA"):
                raise MapError(
                    f"{path.name} is a picture in colour ({image.mode})",
                    "a grey PNG of 8 or 16 bits whose levels are heights",
                    "read the .tif or .npy file of the map, or convert the picture to grey levels",
                )
            alpha = image.getchannel("A") if image.mode == "LA" else None
            levels = np.asarray(image if alpha is None else image.getchannel("L"))
            missing = None if alpha is None else np.asarray(alpha) == 0
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
    scale = float(np.float32(request.height_scale))
    values = RasterValues(path.name, levels.shape, request, scale, filled=False)
    values.take(0, levels, missing)
    return Grid(values.metres, above_ground=False, fault=values.fault)


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
    values = RasterValues(path.name, stored.shape, request, request.height_scale or 1.0)
    step = max(1, _AT_ONCE // max(stored.shape[1], 1))
    for top in range(0, len(stored), step):
        values.take(top, np.asarray(stored[top : top + step]))
    fault = _array_fault(path, values.metres, request) or values.fault
    return Grid(values.metres, above_ground=False, fault=fault)


def _array_fault(path: Path, metres: np.ndarray, request: Request) -> MapError | None:
    """Make the error for an array without a value somewhere, or with heights below the ground."""
    if request.terrain is not None:
        return None
    if request.nodata is None and not np.isfinite(metres).all():
        found, remedy = "NaN or infinite values", f"give {keyword('nodata')}, or write 0 for ground"
    elif (metres < 0).any():
        found, remedy = "heights below ground", f"write 0 for ground, or give {keyword('terrain')}"
    else:
        return None
    expected = "finite heights in metres, 0 or more"
    return MapError(f"{path.name} holds {found}", expected, remedy)


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
