"""Heights above ground of a raster: checks, and the subtraction of a terrain.

A surface of which almost nothing lies near 0 holds elevations, unless only its buildings have
values. The terrain is another raster, of the ground, or one elevation in metres.
"""

import dataclasses
import math
from collections.abc import Callable

import numpy as np
from rasterio.enums import Resampling

from evocity.errors import MapError, keyword
from evocity.io.rasters.values import HEIGHTS
from evocity.io.reader_types import Grid, Request
from evocity.io.resampling import compose, placement_errors, upright, warp

# Ground lies within so many metres of 0, and is at least this share of a surface.
_GROUND, _LEAST_GROUND = 0.5, 0.05
# A raster of buildings only: the least share without values; the most metres of its lowest tenth;
# the least edges between values and gaps for each pixel with a value.
_GAPS, _LOW, _EDGES = 0.25, 25.0, 0.02
# The most pixels of a surface, as a share, for which a terrain may lack values.
_LACK = 0.01
# Heights this far below the terrain show that it is another surface, metres.
_BELOW = 2.0
# Rows at a time.
_ROWS = 1024


def above_ground(
    grid: Grid, request: Request, name: str, read: Callable[[str], tuple[Grid, str]] | None = None
) -> Grid:
    """Return ``grid`` with heights above ground: no missing pixels, nothing below 0. ``read`` reads
    the terrain that the request names. Raises `MapError` for implausible values, for elevations
    without a terrain, and for a terrain that does not fit."""
    if grid.fault is not None:
        raise grid.fault
    with placement_errors(name):
        grid = upright(grid)
    heights, notes = grid.heights, [grid.note]
    terrain = request.terrain
    if isinstance(terrain, str) and read is not None:
        ground, title = read(terrain)
        if ground.fault is not None:
            raise ground.fault
        heights, lacking = _subtract(grid, ground, name, title)
        notes.append(f"heights less the terrain {title}")
        if lacking:
            notes.append(f"{lacking} pixels without a terrain are ground")
    elif terrain:
        heights = heights - np.float32(terrain)
        _check_less(heights, f"{name} less {terrain:g} m", is_flat=True)
        notes.append(f"heights less {terrain:g} m")
    if terrain is None and not grid.above_ground:
        _check_ground(heights, name)
    if not heights.flags.writeable:
        heights = heights.copy()
    missing = _fill_ground(heights)
    if missing:
        notes.append(f"{missing} pixels without a value are ground")
    return dataclasses.replace(grid, heights=heights, note="; ".join(filter(None, notes)))


def _fill_ground(heights: np.ndarray) -> int:
    """Set missing and negative values to 0, some rows at a time, for a large raster has no room for
    a copy; return the number of missing values."""
    missing = 0
    for top in range(0, len(heights), _ROWS):
        part = heights[top : top + _ROWS]
        missing += int((part != part).sum())
        part[~(part > 0)] = 0
    return missing


def _check_ground(heights: np.ndarray, name: str) -> None:
    """Raise `MapError` if ``heights`` are elevations: almost no pixel lies near 0."""
    share = _ground_share(heights)
    if share >= _LEAST_GROUND or _is_buildings_only(heights):
        return
    low, high = float(np.nanmin(heights)), float(np.nanmax(heights))
    raise MapError(
        f"{name} seems to hold elevations above sea level: {100 * share:.2g} % of its pixels lie "
        f"within {_GROUND:g} m of 0, and its values reach from {low:.4g} to {high:.4g} m",
        "heights above ground, with 0 for open ground",
        f"give {keyword('terrain')} with a raster of the ground (a DTM), or its elevation in "
        f"metres; if the heights are above ground, give {keyword('terrain', 0)}",
    )


def _ground_share(heights: np.ndarray) -> float:
    """Return the share of pixels near 0 among those with a value; 1 without any value."""
    near = valid = 0
    for top in range(0, len(heights), _ROWS):
        part = heights[top : top + _ROWS]
        valid += int((part == part).sum())
        near += int((np.abs(part) < _GROUND).sum())
    return near / valid if valid else 1.0


def _is_buildings_only(heights: np.ndarray) -> bool:
    """Tell whether only buildings have values: gaps surround small pieces of low values."""
    valid = ~np.isnan(heights) if heights.dtype.kind == "f" else np.ones(heights.shape, bool)
    rows, columns = (np.flatnonzero(valid.any(axis=axis)) for axis in (1, 0))
    inside = np.s_[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    valid, heights = valid[inside], heights[inside]
    count = int(valid.sum())
    if count > (1 - _GAPS) * valid.size:
        return False
    edges = np.count_nonzero(valid[1:] != valid[:-1])
    edges += np.count_nonzero(valid[:, 1:] != valid[:, :-1])
    if edges < _EDGES * count:
        return False
    return int((heights[valid] <= _LOW).sum()) >= count / 10


def _subtract(grid: Grid, ground: Grid, name: str, title: str) -> tuple[np.ndarray, int]:
    """Subtract the terrain ``ground`` from ``grid``; return float32, and the number of pixels for
    which the terrain has no value."""
    with placement_errors(title):
        below = _terrain_on(grid, upright(ground), name, title)
    heights = grid.heights - below
    valid = int((grid.heights == grid.heights).sum())
    lacking = valid - int((heights == heights).sum())
    if lacking > _LACK * valid:
        raise MapError(
            f"the terrain {title} has values for {100 * (1 - lacking / valid):.3g} % of the pixels "
            f"of {name}",
            f"a terrain with values for at least {100 * (1 - _LACK):g} % of them",
            "give a terrain of a larger extent; fill gaps under buildings, for example with "
            "gdal_fillnodata",
        )
    _check_less(heights, f"{name} less the terrain {title}")
    return heights, lacking


def _check_less(heights: np.ndarray, title: str, is_flat: bool = False) -> None:
    """Raise `MapError` unless the ``heights`` of ``title``, less a terrain, are above ground."""
    low, high = HEIGHTS
    with np.errstate(invalid="ignore"):
        beyond = int(((heights < low) | (heights > high)).sum())
        deep, tall = (int((sign * heights > _BELOW).sum()) for sign in (-1, 1))
    if beyond:
        same = "give both rasters in the same unit and vertical datum"
        flat = "give the elevation of the ground in the unit and vertical datum of the raster"
        raise MapError(
            f"{title} reaches from {np.nanmin(heights):.4g} to {np.nanmax(heights):.4g} m",
            f"heights from {low:g} to {high:g} m",
            f"{flat if is_flat else same}, or use {keyword('nodata')} for the value of missing "
            "pixels",
        )
    share = _ground_share(heights)
    rises = share < _LEAST_GROUND and not (is_flat and _is_buildings_only(heights))
    if rises or deep > tall:
        same = "check that the two files are not exchanged, and that both have the same datum"
        flat = "give another elevation; if the ground is not flat, give a raster of the ground"
        raise MapError(
            f"{title} does not give heights above ground: {100 * share:.2g} % of it lies within "
            f"{_GROUND:g} m of 0, and {deep} pixels lie more than {_BELOW:g} m below the terrain",
            "a terrain of the same place, unit and vertical datum",
            flat if is_flat else same,
        )


def _terrain_on(grid: Grid, ground: Grid, name: str, title: str) -> np.ndarray:
    """Lay the terrain ``ground`` on the pixels of ``grid``: float32, NaN where it has no value."""
    same_crs = grid.crs is None if ground.crs is None else _is_same(grid, ground)
    same_grid = grid.heights.shape == ground.heights.shape and _is_near(grid, ground)
    if same_grid and (same_crs or ground.crs is None or grid.crs is None):
        return ground.heights
    systems = ("no reference system" if g.crs is None else g.crs.name[:80] for g in (ground, grid))
    there, here = systems
    if not same_crs:
        raise MapError(
            f"the terrain {title} has {there}, and {name} has {here}",
            "two rasters in the same reference system",
            "convert the terrain, for example with gdalwarp -t_srs",
        )
    if grid.crs is None and grid.metres_per_pixel is None:
        tall, wide = ground.heights.shape
        rows, columns = grid.heights.shape
        raise MapError(
            f"the terrain {title} has {wide} × {tall} px, and {name} has {columns} × {rows} px",
            "rasters of the same pixels, or two rasters with a reference system",
            "cut both to the same pixels, for example with gdalwarp -te",
        )
    values = np.full(grid.heights.shape, np.nan, np.float32)
    offset = compose(~ground.transform, grid.transform)
    whole = math.isclose(offset.a, 1, abs_tol=1e-9) and math.isclose(offset.e, 1, abs_tol=1e-9)
    whole = whole and offset.b == offset.d == 0 and _is_whole(offset.c) and _is_whole(offset.f)
    method = Resampling.nearest if whole else Resampling.bilinear
    warp(ground, values, grid.transform, grid.crs, method, src_nodata=np.nan, dst_nodata=np.nan)
    return values


def _is_same(grid: Grid, ground: Grid) -> bool:
    """Tell whether two grids have the same reference system."""
    if grid.crs is None or ground.crs is None:
        return False
    return grid.crs.equals(ground.crs, ignore_axis_order=True)


def _is_near(grid: Grid, ground: Grid) -> bool:
    """Tell whether the pixels of two grids have the same places, within a hundredth of a pixel."""
    rows, columns = grid.heights.shape
    o = compose(~ground.transform, grid.transform)
    corners = [(x, y) for x in (0, columns) for y in (0, rows)]
    placed = [(o.a * x + o.b * y + o.c, o.d * x + o.e * y + o.f) for x, y in corners]
    return all(math.dist(*pair) < 0.01 for pair in zip(placed, corners, strict=True))


def _is_whole(number: float) -> bool:
    return abs(number - round(number)) < 0.01
