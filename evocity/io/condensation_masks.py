"""Condensations and masks from files: pixels that decoding keeps, by footprints or rasters.

If raster and map lie on Earth, each pixel of the map takes the raster's pixel at its centre.
"""

import os
from collections.abc import Sequence

import numpy as np

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import MapError
from evocity.io.heights import TALLEST
from evocity.io.map_reader import data_of, options_of
from evocity.io.rasterization import crs_of, rasterize_onto
from evocity.io.rasters.terrain import above_ground
from evocity.io.reader_types import Footprints, Grid, Request
from evocity.io.resampling import placement_errors, resample_onto


def read_condensation(
    place: str | os.PathLike,
    city: CityMap,
    heights: str | os.PathLike | float | None = None,
) -> tuple[Condensation, str]:
    """Read a condensation on the grid of ``city``, together with the attribution that the licences
    of the files demand.

    Parameters
    ----------
    place : file in any format that `read_map` reads. The condensation fixes each pixel whose centre
        lies in a polygon of the file, or whose raster value exceeds 0.
    city : map to encode, or another map on the same grid.
    heights : number or file that gives the fixed heights; None uses the heights of ``city``. If
        ``heights`` is a number, all pixels of the condensation get this height, metres. A raster
        file (GeoTIFF, ASCII grid, NPY) gives heights in metres, and 0 for missing values. A file of
        footprints gives heights according to the rules of `evocity.io.heights`, or 6 m if no rule
        applies.

    Raises
    ------
    MapError : a file cannot be read, or a raster differs in size from the city. A height outside 0
        to 1000 m raises MapError, and so does a file that covers no pixel of the city. If the city
        has no place on Earth, a file with a place on Earth raises MapError.
    """
    mask, attribution = _mask(place, city)
    lines = [attribution]
    if isinstance(heights, str | os.PathLike):
        city = _heights(heights, city)
        lines.append(city.attribution)
    elif heights is not None:
        if not 0 <= heights <= TALLEST:  # nor NaN
            raise MapError(
                f"the fixed height of {heights:g} m is out of range",
                f"a height from 0 m (ground) to {TALLEST:g} m",
                "give the height above ground, or a file of heights",
            )
        city = city.replace(np.full(city.shape, heights))
    credits = dict.fromkeys(line for several in lines for line in several.split("; ") if line)
    return Condensation.cut(city, mask), "; ".join(credits)


def read_mask(place: str | os.PathLike, cities: Sequence[CityMap]) -> np.ndarray:
    """Read a mask, bool ``(H, W)``, from the file ``place``, for the first city in ``cities`` that
    the file covers.

    A pixel of the mask is true in two cases: its centre lies in a polygon of the file, or its
    raster value exceeds 0. All ``cities`` must have the same size.

    If the file covers no city, the function raises the `MapError` that `read_condensation` raises
    for the first city.
    """
    faults = []
    for city in cities:
        try:
            return _mask(place, city)[0]
        except MapError as error:
            faults.append(error)
    raise faults[0]


def read_water(place: str | os.PathLike, city: CityMap) -> tuple[np.ndarray, str]:
    """Read water from the file ``place``: the open ground of ``city`` that a polygon of the file or
    a raster value above 0 covers, bool ``(H, W)``, and the attribution of the file.

    Raises `MapError` for a file that cannot be read, or that covers no open ground of the map.
    """
    mask, attribution = _mask(place, city)
    mask &= city.open_ground
    if not mask.any():
        raise MapError(
            f"{os.fspath(place)!r} marks no open ground of the map {city.name} as water",
            "a file that marks at least one pixel of open ground",
            "check the file, or leave the water out",
        )
    return mask, attribution


def _mask(source: str | os.PathLike, city: CityMap) -> tuple[np.ndarray, str]:
    """Read a mask, bool ``(H, W)``, and the attribution of its file."""
    # levels of a mask have no unit, but the PNG reader requires one
    request = Request(height_scale=1.0 if "height_scale" in options_of(source) else None)
    data, name = data_of(source, request)
    if isinstance(data, Footprints):
        return ~np.isnan(rasterize_onto(city, data, name)), data.attribution
    mask = _on_grid(data, city, name) > 0  # NaN is not
    if not mask.any():
        raise MapError(
            f"{name}: the mask has no value above 0 on the map {city.name}",
            "a mask with a value above 0 for at least one pixel",
            "check the file, and draw the mask on this map",
        )
    return mask, data.attribution


def _heights(source: str | os.PathLike, city: CityMap) -> CityMap:
    """Read heights on the pixels of ``city``, 0 where the file has none."""
    if os.fspath(source).lower().endswith(".png"):
        raise MapError(
            f"{os.fspath(source)!r} holds grey levels, not metres",
            "a file of heights in metres: .tif, .npy or building footprints",
            "save the heights as .npy or .tif",
        )
    data, name = data_of(source, Request())
    if isinstance(data, Footprints):
        heights = np.nan_to_num(rasterize_onto(city, data, name))
    else:
        flat = Request(terrain=0.0)  # a file of fixed heights needs no open ground
        heights = _on_grid(above_ground(data, flat, name), city, name)
    return CityMap(heights, city.metres_per_pixel, name=name, attribution=data.attribution)


def _on_grid(grid: Grid, city: CityMap, name: str) -> np.ndarray:
    """Lay the values of ``grid`` on the pixels of ``city``: float32 ``(H, W)``."""
    if grid.crs is None or city.crs is None:
        if grid.heights.shape != city.shape:
            there, here = (f"{h} × {w} px" for h, w in (grid.heights.shape, city.shape))
            raise MapError(
                f"{name} has {there}, but {city.name} has {here}",
                "two rasters of the same size; or two rasters that both have a coordinate "
                "reference system",
                f"write the raster with {here}, the pixels of the map",
            )
        return grid.heights
    crs = crs_of(city, name)
    with placement_errors(name):
        return resample_onto(grid, city.shape, city.origin, city.metres_per_pixel, crs)
