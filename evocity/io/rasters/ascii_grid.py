"""Reader of ESRI ASCII grids (``.asc``): a header of six lines, then numbers by rows."""

import re
import warnings
from pathlib import Path
from typing import BinaryIO

import numpy as np
from affine import Affine
from pyproj.exceptions import ProjError

from evocity.errors import MapError
from evocity.io.projection import flat
from evocity.io.rasters.sidecars import read_notes, read_prj
from evocity.io.rasters.values import RasterValues
from evocity.io.reader_types import Grid, Request, check_size

# Bytes of text that are read at a time, and letters of the longest number.
_AT_ONCE, _LONGEST = 1 << 22, 64
# The value of missing pixels in a grid that names no other.
_NODATA = -9999.0
_KEYS = ("ncols", "nrows", "xllcorner", "xllcenter", "yllcorner", "yllcenter")
_STEPS = ("cellsize", "dx", "dy", "nodata_value")
_LINE = re.compile(rb"\s*([A-Za-z_]+)[ \t]+(\S+)[ \t]*\r?\n")


def read_asc(path: Path, request: Request) -> Grid:
    """Read an ESRI ASCII grid of heights; missing values are NaN. The file ``.prj`` or ``.aux.xml``
    of the same name gives its reference system; without it, the request gives the pixel size."""
    try:
        with open(path, "rb") as file:
            header = _read_header(file)
            rows, columns, transform = _layout(header)
            check_size(path.name, rows, columns)
            notes = read_notes(path, 1)
            scaled = request.height_scale or 1.0
            scale, offset = (notes.scale or 1.0) * scaled, (notes.offset or 0.0) * scaled
            values = RasterValues(path.name, (rows, columns), request, scale, offset)
            nodata = [header.get("nodata_value", _NODATA), notes.nodata]
            _read_values(file, values, [one for one in nodata if one is not None])
        crs = read_prj(path) or notes.crs
        crs = flat(crs) if crs is not None else None
    except MapError:
        raise
    except (ValueError, ArithmeticError, OSError, ProjError) as error:
        raise MapError(
            f"{path.name} cannot be read as an ASCII grid: {str(error)[:200]}",
            "a complete ESRI ASCII grid: ncols, nrows, xllcorner, yllcorner, cellsize, numbers",
            "export the grid again, because it may be cut off; or convert it with gdal_translate",
        ) from error
    return Grid(values.metres, crs, transform, above_ground=False, fault=values.fault)


def _read_header(file: BinaryIO) -> dict[str, float]:
    """Read the lines of the header, and leave the ``file`` at the first number."""
    header: dict[str, float] = {}
    head = file.read(4096)
    place = 0
    while match := _LINE.match(head, place):
        key = match[1].decode().lower()
        if key not in _KEYS + _STEPS or key in header:
            raise ValueError(f"its header has {key!r} twice, or this key is unknown")
        header[key] = float(match[2].replace(b",", b"."))
        place = match.end()
    file.seek(place)
    return header


def _layout(header: dict[str, float]) -> tuple[int, int, Affine]:
    """Return rows, columns and transform of the grid with this ``header``."""
    missing = [key for key in ("ncols", "nrows") if key not in header]
    wide, tall = header.get("cellsize", header.get("dx")), header.get("cellsize", header.get("dy"))
    if missing or wide is None or tall is None:
        raise ValueError(f"its header has no {', '.join(missing) or 'cellsize'}")
    rows, columns = header["nrows"], header["ncols"]
    if not (rows % 1 == 0 < rows < 1e9 and columns % 1 == 0 < columns < 1e9):
        raise ValueError(f"its header names {rows:g} rows of {columns:g} columns")
    left = header.get("xllcorner", header.get("xllcenter", 0.0) - wide / 2)
    low = header.get("yllcorner", header.get("yllcenter", 0.0) - tall / 2)
    numbers = np.array([left, low, wide, tall])
    if not (np.isfinite(numbers).all() and (np.abs(numbers) < 1e12).all() and min(wide, tall) > 0):
        raise ValueError(f"its header gives no place or size ({', '.join(map(str, numbers))})")
    return int(rows), int(columns), Affine(wide, 0.0, left, 0.0, -tall, low + rows * tall)


def _read_values(file: BinaryIO, values: RasterValues, nodata: list[float]) -> None:
    """Read all numbers of a ``file`` as rows of ``values``."""
    rows, columns = values.metres.shape
    rest, numbers, top = b"", np.empty(0), 0
    while True:
        text = file.read(_AT_ONCE)
        block = rest + text.replace(b",", b".")
        cut = len(block) if not text else max(block.rfind(end) for end in (b" ", b"\n", b"\t"))
        if cut < 0 or len(block) - cut > _LONGEST + 1:
            raise ValueError("a number of it has too many letters")
        rest = block[cut:]
        numbers = np.concatenate([numbers, _numbers(block[:cut])])
        deep = len(numbers) // columns
        if top + deep > rows or (not text and (top + deep < rows or len(numbers) % columns)):
            have = top * columns + len(numbers)
            raise ValueError(f"it has {have} numbers, of {rows} × {columns}")
        part = numbers[: deep * columns].reshape(deep, columns)
        missing = np.isnan(part)
        for number in nodata:
            missing |= np.isclose(part, number, rtol=1e-6, atol=0)
        values.take(top, part, missing)
        top, numbers = top + deep, numbers[deep * columns :]
        if not text:
            return


def _numbers(text: bytes) -> np.ndarray:
    """Parse the numbers in a ``text``. Raises `ValueError` for any other word."""
    if not text.strip():
        return np.empty(0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # numpy only warns of a word that is no number
        try:
            return np.fromstring(text.decode("ascii"), dtype=np.float64, sep=" ")
        except DeprecationWarning as error:
            raise ValueError("it has a word that is not a number") from error
