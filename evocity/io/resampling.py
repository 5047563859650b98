"""`Grid` -> `CityMap`: square pixels in metres, and the window asked for.

Pixels are kept as they are wherever they can be: if they are square, in metres that are
true, with north up, and no other size is asked for. Otherwise each new pixel takes the old
one its centre lies in, so that heights are never mixed.
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
    moved,
)
from evocity.io.sources import Grid, Request, check_size, north_up


def gridded(grid: Grid, request: Request, name: str) -> CityMap:
    """The window of ``request``, or the whole raster, on square pixels in metres.

    Raises `MapError` where it lies nowhere that its reference system knows.
    """
    if grid.crs is None:
        return _unplaced(grid, request, name)
    with placing_trouble(name):
        return _placed(grid, request, name)


@contextmanager
def placing_trouble(name: str) -> Iterator[None]:
    """Turn what PROJ and GDAL raise of the place of the raster ``name`` into a `MapError`."""
    try:
        with np.errstate(all="ignore"):
            yield
    except (CPLE_BaseError, RasterioError, ProjError, ArithmeticError, ValueError) as error:
        raise MapError(
            f"{name}: its pixels cannot be laid on the ground ({str(error)[:200]})",
            "a transform and a reference system that belong together",
            "repair its georeference, for example with gdal_edit",
        ) from error


def _placed(grid: Grid, request: Request, name: str) -> CityMap:
    center = request.center or _middle(grid, name)
    true = is_metric(grid.crs) and is_true_to_scale(grid.crs, *center)
    crs = grid.crs if true else local_metres(*center)
    native = _pixel_side(grid, center, crs)
    side = request.metres_per_pixel or native
    if true and _is_square(grid) and math.isclose(side, native, rel_tol=1e-9):
        heights, origin = _cut(grid, request, center, name)
        side, taken = native, _taken(grid, heights)
    else:
        heights, origin = _resampled(grid, request, center, crs, side, name)
        (rows, columns), (tall, wide) = grid.heights.shape, heights.shape
        taken = (
            f"{wide * side:g} × {tall * side:g} m at {side:g} m a pixel, out of a raster of "
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


def _taken(grid: Grid, heights: np.ndarray) -> str:
    """In words, what of the ``grid`` was kept, pixel for pixel."""
    (rows, columns), (tall, wide) = grid.heights.shape, heights.shape
    if (tall, wide) == (rows, columns):
        return f"the file's raster as it is, {columns} × {rows} px"
    return f"a window of {wide} × {tall} px of the file's {columns} × {rows} px"


def _unplaced(grid: Grid, request: Request, name: str) -> CityMap:
    side = request.metres_per_pixel or grid.metres_per_pixel
    if side is None:
        raise MapError(
            f"{name} does not say how large its pixels are",
            f"{keyword('metres_per_pixel')}, the side of one pixel in metres",
            f"pass it, for example {keyword('metres_per_pixel', 2.0)}",
        )
    if request.center is not None:
        raise MapError(
            f"{name} has no place on Earth, yet {keyword('center', request.center)} is asked for",
            f"a file with a reference system, or no {keyword('center')}",
            f"leave {keyword('center')} out: {keyword('pixels')} then cuts around the middle",
        )
    rows, columns = grid.heights.shape
    pixels = request.pixels
    heights = grid.heights
    if pixels is not None:
        if pixels > min(rows, columns):
            raise _too_large(name, f"{pixels} × {pixels} px", f"{rows} × {columns} px")
        top, left = (rows - pixels) // 2, (columns - pixels) // 2
        heights = heights[top : top + pixels, left : left + pixels]
    taken = _taken(grid, heights)
    return CityMap(heights, side, name=name, attribution=grid.attribution, taken=taken)


def _middle(grid: Grid, name: str) -> tuple[float, float]:
    rows, columns = grid.heights.shape
    lon, lat = moved(*_at(grid.transform, columns / 2, rows / 2), grid.crs, WGS84)
    if not (abs(lon) <= 180 and abs(lat) <= 90):
        raise MapError(
            f"{name}: its middle lies nowhere on Earth in {grid.crs.name}",
            "coordinates that belong to the reference system of the file",
            "repair its georeference, for example with gdal_edit",
        )
    return round(lon, 7), round(lat, 7)


def _pixel_side(grid: Grid, center: tuple[float, float], crs: CRS) -> float:
    """Side of the square with a pixel's area, metres of ``crs``, at the center."""
    step = grid.transform
    if crs == grid.crs and step.a == -step.e and step.b == step.d == 0:
        return step.a
    x, y = moved(*center, WGS84, grid.crs)
    corners = np.array([(x, y), (x + step.a, y + step.d), (x + step.b, y + step.e)])
    here, right, down = np.column_stack(moved(*corners.T, grid.crs, crs))
    (ax, ay), (bx, by) = right - here, down - here
    return math.sqrt(abs(ax * by - ay * bx))


def _is_square(grid: Grid) -> bool:
    """North up, and sides so equal that no corner drifts by half a pixel."""
    t = grid.transform
    if t.b or t.d or t.a <= 0 or t.e >= 0:
        return False
    return abs(t.a + t.e) * max(grid.heights.shape) <= 0.5 * min(t.a, -t.e)


def _cut(grid: Grid, request: Request, center: tuple[float, float], name: str):
    """A window on the grid's own pixels: its heights and north-west corner."""
    rows, columns = grid.heights.shape
    if request.pixels is None:
        return grid.heights, _at(grid.transform, 0, 0)
    pixels = request.pixels
    x, y = (columns / 2, rows / 2)
    if request.center is not None:
        x, y = _at(~grid.transform, *moved(*center, WGS84, grid.crs))
    left, top = round(x - pixels / 2), round(y - pixels / 2)
    if left < 0 or top < 0 or left + pixels > columns or top + pixels > rows:
        raise _too_large(name, _window(pixels, center), f"{rows} × {columns} px")
    heights = grid.heights[top : top + pixels, left : left + pixels]
    return heights, _at(grid.transform, left, top)


def _resampled(
    grid: Grid, request: Request, center: tuple[float, float], crs: CRS, side: float, name: str
):
    """The same on new pixels of ``side`` metres in ``crs``."""
    source_crs, target_crs = (rasterio.crs.CRS.from_wkt(c.to_wkt()) for c in (grid.crs, crs))
    edges = array_bounds(*grid.heights.shape, grid.transform)
    west, south, east, north = transform_bounds(source_crs, target_crs, *edges)
    if request.pixels is None:
        rows, columns = max(1, round((north - south) / side)), max(1, round((east - west) / side))
        left, top = west, north
    else:
        rows = columns = request.pixels
        x, y = ((west + east) / 2, (south + north) / 2)
        if request.center is not None:
            x, y = moved(*center, WGS84, crs)
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
    heights = np.zeros((rows, columns), dtype=np.float32)
    reproject(
        grid.heights,
        heights,
        src_transform=grid.transform,
        src_crs=source_crs,
        dst_transform=north_up(left, top, side),
        dst_crs=target_crs,
        resampling=Resampling.nearest,
    )
    return heights, (left, top)


def _at(transform: Affine, column: float, row: float) -> tuple[float, float]:
    t = transform
    return t.a * column + t.b * row + t.c, t.d * column + t.e * row + t.f


def _window(pixels: int, center: tuple[float, float]) -> str:
    return f"{pixels} × {pixels} px about {center[0]:g}, {center[1]:g}"


def _too_large(name: str, asked: str, there: str) -> MapError:
    return MapError(
        f"{name}: a window of {asked} reaches beyond the raster",
        f"a window inside it; the raster has {there}",
        f"pass fewer {keyword('pixels')}, a smaller {keyword('metres_per_pixel')}, or a "
        f"{keyword('center')} further inside",
    )


__all__ = ["gridded", "placing_trouble"]
