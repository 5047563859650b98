"""Resampling of a `Grid` to a `CityMap`: square pixels in metres, and the requested window.

Pixels stay as they are if they are square, in true metres, with north up, and of the requested
size. Otherwise each new pixel takes the old pixel at its centre, so that heights never mix.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import rasterio
from affine import Affine
from pyproj import CRS
from pyproj.exceptions import ProjError
from rasterio._err import CPLE_BaseError  # what a warp raises
from rasterio.enums import Resampling
from rasterio.errors import RasterioError
from rasterio.transform import array_bounds
from rasterio.warp import reproject, transform_bounds

from evocity.citymap import CityMap
from evocity.errors import MapError, keyword
from evocity.io.projection import (
    WGS84,
    code_of,
    is_metric,
    is_true_to_scale,
    local_metres,
    transform_points,
)
from evocity.io.reader_types import Grid, Request, check_size, north_up, refuse_center


def map_of_grid(grid: Grid, request: Request, name: str) -> CityMap:
    """Lay the window of ``request``, or the whole raster, on square pixels in metres. Raises
    `MapError` where it lies beyond its reference system."""
    if grid.crs is None:
        return _map_in_metres(grid, request, name)
    with placement_errors(name):
        return _map_on_earth(grid, request, name)


@contextmanager
def placement_errors(name: str) -> Iterator[None]:
    """Turn errors of PROJ and GDAL about the place of the raster ``name`` into a `MapError`."""
    try:
        with np.errstate(all="ignore"):
            yield
    except (CPLE_BaseError, RasterioError, ProjError, ArithmeticError, ValueError) as error:
        raise MapError(
            f"{name}: the positions of the pixels cannot be computed ({str(error)[:200]})",
            "a geotransform that is valid in the reference system of the file",
            "repair the file's georeference, for example with gdal_edit",
        ) from error


def _map_on_earth(grid: Grid, request: Request, name: str) -> CityMap:
    center = request.center or _middle(grid, name)
    true = is_metric(grid.crs) and is_true_to_scale(grid.crs, *center)
    crs = grid.crs if true else local_metres(*center)
    native = _pixel_side(grid, center, crs)
    side = request.metres_per_pixel or native
    if true and _is_square(grid) and math.isclose(side, native, rel_tol=1e-9):
        heights, origin = _cut_window(grid, request, center, name)
        side, taken = native, _describe_window(grid, heights)
    else:
        heights, origin = _resample(grid, request, center, crs, side, name)
        (rows, columns), (tall, wide) = grid.heights.shape, heights.shape
        taken = (
            f"{wide * side:g} × {tall * side:g} m at {side:g} m a pixel, from a raster of "
            f"{columns} × {rows} px of about {native:.4g} m"
        )
    return CityMap(
        heights,
        side,
        name=name,
        attribution=grid.attribution,
        origin=origin,
        crs=code_of(crs),
        taken=taken,
    )


def _describe_window(grid: Grid, heights: np.ndarray) -> str:
    """Describe the part of the ``grid`` that the map has, pixel for pixel."""
    (rows, columns), (tall, wide) = grid.heights.shape, heights.shape
    if (tall, wide) == (rows, columns):
        return f"the whole raster of the file, {columns} × {rows} px"
    return f"a window of {wide} × {tall} px of the file's {columns} × {rows} px"


def _map_in_metres(grid: Grid, request: Request, name: str) -> CityMap:
    side = request.metres_per_pixel or grid.metres_per_pixel
    if side is None:
        raise MapError(
            f"{name} does not record the size of its pixels",
            f"{keyword('metres_per_pixel')} with the side of a pixel in metres",
            f"give the size, for example {keyword('metres_per_pixel', 2.0)}",
        )
    refuse_center(request, name)
    rows, columns = grid.heights.shape
    pixels = request.pixels
    heights = grid.heights
    if pixels is not None:
        if pixels > min(rows, columns):
            raise _too_large(name, f"{pixels} × {pixels} px", f"{rows} × {columns} px")
        top, left = (rows - pixels) // 2, (columns - pixels) // 2
        heights = heights[top : top + pixels, left : left + pixels]
    taken = _describe_window(grid, heights)
    return CityMap(heights, side, name=name, attribution=grid.attribution, taken=taken)


def _middle(grid: Grid, name: str) -> tuple[float, float]:
    rows, columns = grid.heights.shape
    lon, lat = transform_points(*_at(grid.transform, columns / 2, rows / 2), grid.crs, WGS84)
    if not (abs(lon) <= 180 and abs(lat) <= 90):
        raise MapError(
            f"{name}: the middle of the raster lies outside the area of {grid.crs.name}",
            "coordinates that are valid in the reference system of the file",
            "repair the file's georeference, for example with gdal_edit",
        )
    return round(lon, 7), round(lat, 7)


def _pixel_side(grid: Grid, center: tuple[float, float], crs: CRS) -> float:
    """Compute the side of the square with a pixel's area, metres of ``crs``, at the center."""
    step = grid.transform
    if crs == grid.crs and step.a == -step.e and step.b == step.d == 0:
        return step.a
    x, y = transform_points(*center, WGS84, grid.crs)
    corners = np.array([(x, y), (x + step.a, y + step.d), (x + step.b, y + step.e)])
    here, right, down = np.column_stack(transform_points(*corners.T, grid.crs, crs))
    (ax, ay), (bx, by) = right - here, down - here
    return math.sqrt(abs(ax * by - ay * bx))


def _is_square(grid: Grid) -> bool:
    """Tell whether north is up, and sides are so equal that no corner drifts by half a pixel."""
    t = grid.transform
    if t.b or t.d or t.a <= 0 or t.e >= 0:
        return False
    return abs(t.a + t.e) * max(grid.heights.shape) <= 0.5 * min(t.a, -t.e)


def _cut_window(grid: Grid, request: Request, center: tuple[float, float], name: str):
    """Cut a window on the grid's own pixels: its heights and north-west corner."""
    rows, columns = grid.heights.shape
    if request.pixels is None:
        return grid.heights, _at(grid.transform, 0, 0)
    pixels = request.pixels
    x, y = (columns / 2, rows / 2)
    if request.center is not None:
        x, y = _at(~grid.transform, *transform_points(*center, WGS84, grid.crs))
    left, top = round(x - pixels / 2), round(y - pixels / 2)
    if left < 0 or top < 0 or left + pixels > columns or top + pixels > rows:
        raise _too_large(name, _window(pixels, center), f"{rows} × {columns} px")
    heights = grid.heights[top : top + pixels, left : left + pixels]
    return heights, _at(grid.transform, left, top)


def _resample(
    grid: Grid, request: Request, center: tuple[float, float], crs: CRS, side: float, name: str
):
    """Lay the window on new pixels of ``side`` metres in ``crs``: its heights and corner."""
    edges = array_bounds(*grid.heights.shape, grid.transform)
    systems = _rasterio_crs(grid.crs), _rasterio_crs(crs)
    west, south, east, north = transform_bounds(*systems, *edges)
    if request.pixels is None:
        rows, columns = max(1, round((north - south) / side)), max(1, round((east - west) / side))
        left, top = west, north
    else:
        rows = columns = request.pixels
        x, y = ((west + east) / 2, (south + north) / 2)
        if request.center is not None:
            x, y = transform_points(*center, WGS84, crs)
        left, top = x - columns * side / 2, y + rows * side / 2
        spill = max(
            west - left, top - north, left + columns * side - east, south - top + rows * side
        )
        if spill > side:
            raise _too_large(
                name,
                f"{_window(rows, center)} of {side:g} m",
                f"{north - south:.0f} × {east - west:.0f} m",
            )
    check_size(name, rows, columns)
    heights = resample_onto(grid, (rows, columns), (left, top), side, crs)
    return heights, (left, top)


def resample_onto(
    grid: Grid, shape: tuple[int, int], corner: tuple[float, float], side: float, crs: CRS
) -> np.ndarray:
    """Lay ``grid`` on ``shape`` pixels of ``side`` metres, with their north-west ``corner`` in
    ``crs``: float32, 0 outside the grid."""
    values = np.zeros(shape, np.float32)
    reproject(
        grid.heights.astype(np.float32, copy=False),
        values,
        src_transform=grid.transform,
        src_crs=_rasterio_crs(grid.crs),
        dst_transform=north_up(*corner, side),
        dst_crs=_rasterio_crs(crs),
        resampling=Resampling.nearest,
    )
    return values


def _rasterio_crs(crs: CRS) -> rasterio.crs.CRS:
    return rasterio.crs.CRS.from_wkt(crs.to_wkt())


def _at(transform: Affine, column: float, row: float) -> tuple[float, float]:
    t = transform
    return t.a * column + t.b * row + t.c, t.d * column + t.e * row + t.f


def _window(pixels: int, center: tuple[float, float]) -> str:
    return f"{pixels} × {pixels} px about {center[0]:g}, {center[1]:g}"


def _too_large(name: str, window: str, raster: str) -> MapError:
    return MapError(
        f"{name}: a window of {window} reaches beyond the raster",
        f"a window inside the raster, which has {raster}",
        f"use fewer {keyword('pixels')}, a smaller {keyword('metres_per_pixel')}, or a "
        f"{keyword('center')} nearer to the middle of the raster",
    )
