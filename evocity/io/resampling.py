"""Resampling of a `Grid` to a `CityMap`: square pixels in metres, and the requested window.

Pixels stay as they are if they are square, in true metres, with north up, and of the requested
size. Otherwise each new pixel takes the old pixel at its centre, so that heights never mix.
"""

import dataclasses
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
from evocity.io.rasters.crowns import describe_crowns
from evocity.io.reader_types import Grid, Request, check_size, north_up, refuse_center

# A system of metres in which two grids of one plane are laid on each other.
_PLANE = CRS.from_epsg(3857)


def map_of_grid(grid: Grid, request: Request, name: str) -> CityMap:
    """Lay the window of ``request``, or the whole raster, on square pixels in metres. Raises
    `MapError` where it lies beyond its reference system."""
    with placement_errors(name):
        grid = upright(grid)
        return (_map_in_metres if grid.crs is None else _map_on_earth)(grid, request, name)


def upright(grid: Grid) -> Grid:
    """Turn and mirror the rows and columns of ``grid`` so that north is up and east is right, if
    its pixels have sides along x and y. Nothing is resampled."""
    heights, step = grid.heights, grid.transform
    if step.a == step.e == 0 and step.b and step.d:
        heights, step = heights.T, Affine(step.b, step.a, step.c, step.e, step.d, step.f)
    if step.b or step.d or grid.transform == Affine.identity():
        return grid
    if step.a < 0:
        heights, step = heights[:, ::-1], compose(step, Affine(-1, 0, heights.shape[1], 0, 1, 0))
    if step.e > 0:
        heights, step = heights[::-1], compose(step, Affine(1, 0, 0, 0, -1, heights.shape[0]))
    if heights is grid.heights:
        return grid
    return dataclasses.replace(grid, heights=np.ascontiguousarray(heights), transform=step)


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
        taken = _describe_resampling(grid, heights, side, native)
    return CityMap(
        heights,
        side,
        name=name,
        attribution=grid.attribution,
        origin=origin,
        crs=code_of(crs),
        taken=_add_notes(taken, grid, heights, side),
    )


def _describe_window(grid: Grid, heights: np.ndarray) -> str:
    """Describe the part of the ``grid`` that the map has, pixel for pixel."""
    (rows, columns), (tall, wide) = grid.heights.shape, heights.shape
    if (tall, wide) == (rows, columns):
        return f"the whole raster of the file, {columns} × {rows} px"
    return f"a window of {wide} × {tall} px of the file's {columns} × {rows} px"


def _describe_resampling(grid: Grid, heights: np.ndarray, side: float, native: float) -> str:
    """Describe the map's ``heights`` on pixels of ``side``, from pixels of ``native`` metres."""
    (rows, columns), (tall, wide) = grid.heights.shape, heights.shape
    text = (
        f"{wide * side:g} × {tall * side:g} m at {side:g} m a pixel, from a raster of "
        f"{columns} × {rows} px of about {native:.4g} m"
    )
    if grid.transform.b or grid.transform.d:
        turned = math.degrees(math.atan2(grid.transform.d, grid.transform.a))
        text += f", turned by {turned:.1f}°"
    return text


def _map_in_metres(grid: Grid, request: Request, name: str) -> CityMap:
    side = request.metres_per_pixel or grid.metres_per_pixel
    if side is None:
        step = math.sqrt(abs(grid.transform.determinant))
        example = 2.0 if grid.transform == Affine.identity() else float(f"{step:.6g}")
        raise MapError(
            f"{name} does not record the size of its pixels in metres",
            f"{keyword('metres_per_pixel')} with the side of a pixel in metres",
            f"give the size, for example {keyword('metres_per_pixel', example)}; an ASCII grid may "
            "have its reference system in a .prj file of the same name",
        )
    refuse_center(request, name)
    if grid.metres_per_pixel and grid.transform != Affine.identity():
        if not (_is_square(grid) and math.isclose(side, grid.metres_per_pixel, rel_tol=1e-9)):
            heights, _ = _resample(grid, request, None, None, side, name)
            taken = _describe_resampling(grid, heights, side, grid.metres_per_pixel)
            return _unplaced(grid, heights, side, name, taken)
        side = grid.metres_per_pixel
    rows, columns = grid.heights.shape
    pixels = request.pixels
    heights = grid.heights
    if pixels is not None:
        if pixels > min(rows, columns):
            raise _too_large(name, f"{pixels} × {pixels} px", f"{rows} × {columns} px")
        top, left = (rows - pixels) // 2, (columns - pixels) // 2
        heights = heights[top : top + pixels, left : left + pixels]
    taken = _describe_window(grid, heights)
    return _unplaced(grid, heights, side, name, taken)


def _unplaced(grid: Grid, heights: np.ndarray, side: float, name: str, taken: str) -> CityMap:
    """Make a map without a place on Earth."""
    taken = _add_notes(taken, grid, heights, side)
    return CityMap(heights, side, name=name, attribution=grid.attribution, taken=taken)


def _add_notes(taken: str, grid: Grid, heights: np.ndarray, side: float) -> str:
    """Append what the user must know of the values to the text about the window."""
    return "; ".join(filter(None, [taken, grid.note, describe_crowns(heights, side)]))


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
    grid: Grid,
    request: Request,
    center: tuple[float, float] | None,
    crs: CRS | None,
    side: float,
    name: str,
):
    """Lay the window on new pixels of ``side`` metres in ``crs``, or in the grid's own metres: its
    heights and corner."""
    west, south, east, north = _bounds(grid)
    if crs is not None:
        systems = _rasterio_crs(grid.crs), _rasterio_crs(crs)
        west, south, east, north = transform_bounds(*systems, west, south, east, north)
    if request.pixels is None:
        rows, columns = max(1, round((north - south) / side)), max(1, round((east - west) / side))
        left, top = west, north
    else:
        rows = columns = request.pixels
        x, y = ((west + east) / 2, (south + north) / 2)
        if request.center is not None and crs is not None:
            x, y = transform_points(*request.center, WGS84, crs)
        left, top = x - columns * side / 2, y + rows * side / 2
        spill = max(
            west - left, top - north, left + columns * side - east, south - top + rows * side
        )
        if spill > side:
            raise _too_large(
                name,
                f"{_window(rows, center) if center else f'{rows} × {rows} px'} of {side:g} m",
                f"{north - south:.0f} × {east - west:.0f} m",
            )
    check_size(name, rows, columns)
    heights = resample_onto(grid, (rows, columns), (left, top), side, crs)
    return heights, (left, top)


def resample_onto(
    grid: Grid,
    shape: tuple[int, int],
    corner: tuple[float, float],
    side: float,
    crs: CRS | None,
) -> np.ndarray:
    """Lay ``grid`` on ``shape`` pixels of ``side`` metres, with their north-west ``corner`` in
    ``crs``: float32, 0 outside the grid."""
    values = np.zeros(shape, np.float32)
    warp(grid, values, north_up(*corner, side), crs, Resampling.nearest)
    return values


def warp(
    grid: Grid, values: np.ndarray, transform: Affine, crs: CRS | None, method: Resampling, **more
) -> None:
    """Write ``grid`` into ``values``, which lie by ``transform`` in ``crs``; without a ``crs``,
    both lie in one plane."""
    here = _rasterio_crs(_PLANE if crs is None or grid.crs is None else grid.crs)
    reproject(
        np.ascontiguousarray(grid.heights, np.float32),
        values,
        src_transform=grid.transform,
        src_crs=here,
        dst_transform=transform,
        dst_crs=here if crs is None else _rasterio_crs(crs),
        resampling=method,
        **more,
    )


def _bounds(grid: Grid) -> tuple[float, float, float, float]:
    """Return west, south, east and north of all corners of a ``grid``, in its own coordinates."""
    rows, columns = grid.heights.shape
    corners = [_at(grid.transform, x, y) for x in (0, columns) for y in (0, rows)]
    (west, south), (east, north) = np.min(corners, axis=0), np.max(corners, axis=0)
    return float(west), float(south), float(east), float(north)


def _rasterio_crs(crs: CRS) -> rasterio.crs.CRS:
    return rasterio.crs.CRS.from_wkt(crs.to_wkt())


def compose(outer: Affine, inner: Affine) -> Affine:
    """Return the transform that applies ``inner``, then ``outer`` (releases of affine differ in the
    sign for it)."""
    a, d = outer.a * inner.a + outer.b * inner.d, outer.d * inner.a + outer.e * inner.d
    b, e = outer.a * inner.b + outer.b * inner.e, outer.d * inner.b + outer.e * inner.e
    c, f = _at(outer, inner.c, inner.f)
    return Affine(a, b, c, d, e, f)


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
