"""Condensations and masks from files: pixels that decoding keeps, by footprints or rasters.

Footprints are rasterized on the map's grid. Where raster and map are placed on Earth, each pixel of
the map takes the raster's pixel at its centre; any other raster must have the map's size.
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
from evocity.io.heights import TALLEST
from evocity.io.map_reader import data_of, options_of
from evocity.io.rasterization import crs_of, rasterize_onto
from evocity.io.reader_types import Footprints, Grid, Request, north_up
from evocity.io.resampling import placement_errors


def read_condensation(
    place: str | os.PathLike,
    city: CityMap,
    heights: str | os.PathLike | float | None = None,
) -> tuple[Condensation, str]:
    """Read a condensation on the grid of ``city``, and the attribution lines that the licences of
    its files demand.

    Parameters
    ----------
    place : file in any format that `read_map` reads. The condensation keeps the pixels whose
        centres lie in the file's polygons, or where its raster is above 0.
    city : map to encode, or another map on the same grid.
    heights : source of the kept heights. None keeps the heights of ``city``. A number is one height
        for all pixels, metres. A raster file (GeoTIFF, NPY) holds metres; missing values are 0. A
        file of footprints has heights by the rules of `evocity.io.heights`, and 6 m where no rule
        applies.

    Raises
    ------
    MapError : a file cannot be read, a height is beyond 0…1000 m, or a raster has another size. Or
        a file lies on Earth and the city does not. Or the place covers no pixel of the city.
    """
    mask, attribution = _mask(place, city)
    lines = [attribution]
    if isinstance(heights, str | os.PathLike):
        city = _heights(heights, city)
        lines.append(city.attribution)
    elif heights is not None:
        if not 0 <= heights <= TALLEST:  # nor NaN
            raise MapError(
                f"a condensed height of {heights:g} m is out of range",
                f"0 (ground) to {TALLEST:g} m",
                "give the height above ground, or a file of heights",
            )
        city = city.replace(np.full(city.shape, heights))
    credits = dict.fromkeys(line for several in lines for line in several.split("; ") if line)
    return Condensation.cut(city, mask), "; ".join(credits)


def read_mask(place: str | os.PathLike, cities: Sequence[CityMap]) -> np.ndarray:
    """Read a mask, bool ``(H, W)``, from the file ``place``, on the first of ``cities`` that it
    covers.

    A pixel is true if its centre lies in the polygons of the file, or if the raster of the file is
    above 0. All cities have one size.

    Raises the `MapError` for the first city, as `read_condensation` does.
    """
    faults = []
    for city in cities:
        try:
            return _mask(place, city)[0]
        except MapError as error:
            faults.append(error)
    raise faults[0]


def _mask(source: str | os.PathLike, city: CityMap) -> tuple[np.ndarray, str]:
    """Read a mask, bool ``(H, W)``, and the attribution of its file."""
    # levels of a mask have no unit, but the PNG reader requires one
    request = Request(height_scale=1.0 if "height_scale" in options_of(source) else None)
    data, name = data_of(source, request)
    if isinstance(data, Footprints):
        return ~np.isnan(rasterize_onto(city, data, name)), data.attribution
    mask = _on_grid(data, city, name) > 0
    if not mask.any():
        raise MapError(
            f"{name}: no pixel of {city.name} is above 0",
            "a mask with values above 0 where it marks pixels",
            "check the file, and draw the mask on this map",
        )
    return mask, data.attribution


def _heights(source: str | os.PathLike, city: CityMap) -> CityMap:
    """Read heights on the pixels of ``city``, 0 where the file has none."""
    if os.fspath(source).lower().endswith(".png"):
        raise MapError(
            f"{os.fspath(source)!r} holds grey levels, not metres",
            "heights in metres: .tif, .npy or footprints",
            "save the heights as .npy or .tif",
        )
    data, name = data_of(source, Request())
    if isinstance(data, Footprints):
        heights = np.nan_to_num(rasterize_onto(city, data, name))
    else:
        heights = _on_grid(data, city, name)
    return CityMap(heights, city.metres_per_pixel, name=name, attribution=data.attribution)


def _on_grid(grid: Grid, city: CityMap, name: str) -> np.ndarray:
    """Lay the values of ``grid`` on the pixels of ``city``: float32 ``(H, W)``."""
    if grid.crs is None or city.crs is None:
        if grid.heights.shape != city.shape:
            there, here = (f"{h} × {w} px" for h, w in (grid.heights.shape, city.shape))
            raise MapError(
                f"{name} has {there}, but {city.name} has {here}",
                "a raster of the map's size; or of the same place, if both have a place on Earth",
                f"make the raster {here}, with the same pixels as the map",
            )
        return grid.heights
    values = np.zeros(city.shape, np.float32)
    source, target = (
        rasterio.crs.CRS.from_wkt(crs.to_wkt()) for crs in (grid.crs, crs_of(city, name))
    )
    with placement_errors(name):
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
