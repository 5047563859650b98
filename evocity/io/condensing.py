"""What of a map decoding shall keep, as files tell it: footprints or a mask, and other heights.

Footprints are burnt onto the map's grid. A raster that is placed on Earth, as the map is, is laid
on it, each pixel taking the one its centre lies in; any other must have the map's size.
"""

import os
from collections.abc import Sequence

import numpy as np
import rasterio
from rasterio.enums import Resampling
from rasterio.warp import reproject

from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import MapError
from evocity.io.burning import burnt_onto, crs_of
from evocity.io.heights import TALLEST
from evocity.io.reading import data_of, options_of
from evocity.io.resampling import placing_trouble
from evocity.io.sources import Footprints, Grid, Request, north_up


def read_condensation(
    place: str | os.PathLike,
    city: CityMap,
    heights: str | os.PathLike | float | None = None,
) -> tuple[Condensation, str]:
    """A layer on the grid of ``city``, and what the licences of its files ask for.

    Parameters
    ----------
    place : a file of any format that `read_map` reads. Kept are the pixels whose centres lie in
        its polygons, or where its raster is above 0.
    city : the map that is to be coded, or another on its grid.
    heights : what stands there: None for the heights of ``city``; metres; or a file of metres
        (GeoTIFF, NPY; 0 where it tells nothing) or of footprints, whose heights follow the rules
        of `evocity.io.heights`, 6 m where none applies.

    Raises
    ------
    MapError : whatever is wrong with a file; a height beyond 0…1000 m; a raster of another size;
        a file that is placed on Earth for a city that is not; a place that covers no pixel of the
        city.
    """
    mask, attribution = _mask(place, city)
    lines = [attribution]
    if isinstance(heights, str | os.PathLike):
        city = _heights(heights, city)
        lines.append(city.attribution)
    elif heights is not None:
        if not 0 <= heights <= TALLEST:  # nor NaN
            raise MapError(
                f"{heights:g} m to be condensed",
                f"0 (ground) to {TALLEST:g} m",
                "give the height above ground, or a file of heights",
            )
        city = city.replace(np.full(city.shape, heights))
    told = dict.fromkeys(line for several in lines for line in several.split("; ") if line)
    return Condensation.cut(city, mask), "; ".join(told)


def read_mask(place: str | os.PathLike, cities: Sequence[CityMap]) -> np.ndarray:
    """Bool ``(H, W)``: the pixels whose centres lie in the polygons of the file ``place``, or where
    its raster is above 0, on the first of ``cities``, of one size, that it lies on.

    Raises `MapError` as `read_condensation` says, of the first.
    """
    faults = []
    for city in cities:
        try:
            return _mask(place, city)[0]
        except MapError as error:
            faults.append(error)
    raise faults[0]


def _mask(source: str | os.PathLike, city: CityMap) -> tuple[np.ndarray, str]:
    """Bool ``(H, W)``, and the attribution of the file."""
    # a mask's levels have no unit, but the reader of PNG asks for one
    request = Request(height_scale=1.0 if "height_scale" in options_of(source) else None)
    data, name = data_of(source, request)
    if isinstance(data, Footprints):
        return ~np.isnan(burnt_onto(city, data, name)), data.attribution
    mask = _on_grid(data, city, name) > 0
    if not mask.any():
        raise MapError(
            f"{name}: no pixel of {city.name} is above 0 in it",
            "a mask that is above 0 where something is marked",
            "check that it is the right file, and that it is drawn on this very map",
        )
    return mask, data.attribution


def _heights(source: str | os.PathLike, city: CityMap) -> CityMap:
    """The heights a file tells of the pixels of ``city``, 0 where it tells none."""
    if os.fspath(source).lower().endswith(".png"):
        raise MapError(
            f"{os.fspath(source)!r} holds grey levels, which are no metres",
            "heights in metres: .tif, .npy or footprints",
            "save the heights as .npy or .tif",
        )
    data, name = data_of(source, Request())
    if isinstance(data, Footprints):
        heights = np.nan_to_num(burnt_onto(city, data, name))
    else:
        heights = _on_grid(data, city, name)
    return CityMap(heights, city.metres_per_pixel, name=name, attribution=data.attribution)


def _on_grid(grid: Grid, city: CityMap, name: str) -> np.ndarray:
    """Float32 ``(H, W)``: the values of ``grid`` on the pixels of ``city``."""
    if grid.crs is None or city.crs is None:
        if grid.heights.shape != city.shape:
            there, here = (f"{h} × {w} px" for h, w in (grid.heights.shape, city.shape))
            raise MapError(
                f"{name} has {there}, {city.name} has {here}",
                "a raster of the map's size, or, where both are placed on Earth, of the same place",
                f"make it {here}, pixel on pixel",
            )
        return grid.heights
    values = np.zeros(city.shape, np.float32)
    source, target = (
        rasterio.crs.CRS.from_wkt(crs.to_wkt()) for crs in (grid.crs, crs_of(city, name))
    )
    with placing_trouble(name):
        reproject(
            grid.heights.astype(np.float32, copy=False),
            values,
            src_transform=grid.transform,
            src_crs=source,
            dst_transform=north_up(*city.origin, city.metres_per_pixel),
            dst_crs=target,
            resampling=Resampling.nearest,
        )
    return values


__all__ = ["read_condensation", "read_mask"]
