"""Conversion of GeoTIFFs to another reference system, by the nearest pixel."""

import math
from pathlib import Path

import rasterio
from rasterio.enums import Resampling
from rasterio.errors import RasterioError
from rasterio.warp import reproject, transform_bounds

# Memory of the conversion, MiB.
_MEMORY = 64


def warped_grid(path: Path, crs: str, side: float) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return rows and columns, and the north-west corner, of a grid in ``crs`` with pixels of
    ``side`` metres that covers the raster ``path``; corners are whole multiples of ``side``."""
    with rasterio.open(path) as source:
        west, south, east, north = transform_bounds(source.crs, crs, *source.bounds)
    first, last = (math.floor(edge / side + 1e-6) for edge in (west, south))
    columns = math.ceil(east / side - 1e-6) - first
    rows = math.ceil(north / side - 1e-6) - last
    return (rows, columns), (first * side, (last + rows) * side)


def warp(path: Path, target: rasterio.io.DatasetWriter) -> None:
    """Fill the open raster ``target`` with the nearest values of the raster ``path``, NaN outside.
    Raises OSError where the library cannot write."""
    try:
        with rasterio.open(path) as source:
            reproject(
                rasterio.band(source, 1),
                rasterio.band(target, 1),
                resampling=Resampling.nearest,
                src_nodata=math.nan,
                dst_nodata=math.nan,
                warp_mem_limit=_MEMORY,
            )
    except RasterioError as error:
        raise OSError(str(error)) from error
