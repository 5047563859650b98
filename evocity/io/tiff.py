"""Rasters become GeoTIFF files."""

import contextlib
import unicodedata
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import rasterio
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from evocity.citymap import CityMap
from evocity.io.raster import PIXEL_TAG
from evocity.io.sources import north_up
from evocity.io.windows import Windowed
from evocity.pictures.field import Field

# Side of the tiles of a file that is written by windows, px, and bytes GDAL may keep of it.
_TILE, _CACHE = 256, 64 << 20


def write_geotiff(city: CityMap, path: Path) -> None:
    with _band(city, "height above ground", "metre", path) as target:
        target.write(city.heights, 1)


def write_field_geotiff(field: Field, path: Path) -> None:
    values = field.values.astype(np.float32, copy=False)
    layout = {"nodata": np.nan} if np.isnan(values).any() else {}
    with _band(field.city, field.title, field.unit, path, **layout) as target:
        target.write(values, 1)


def write_windows_geotiff(
    what: Windowed, path: Path, bands: Iterator[tuple[int, np.ndarray]]
) -> None:
    """The map in ``bands``, each with its first row."""
    layout = {"tiled": True, "blockxsize": _TILE, "blockysize": _TILE, "bigtiff": "if_safer"}
    with (
        rasterio.Env(GDAL_CACHEMAX=_CACHE),
        _band(what, "height above ground", "metre", path, **layout) as target,
    ):
        for top, heights in bands:
            window = rasterio.windows.Window(0, top, heights.shape[1], heights.shape[0])
            target.write(heights, 1, window=window)


@contextlib.contextmanager
def _band(
    about: CityMap | Windowed, title: str, unit: str, path: Path, **layout
) -> Iterator[rasterio.io.DatasetWriter]:
    """A GeoTIFF of one float32 band, with all that is known of a map, open to be written. Raises
    OSError where the library cannot."""
    side = about.metres_per_pixel
    left, top = about.origin or (0.0, about.shape[0] * side)
    try:
        with (
            warnings.catch_warnings(action="ignore", category=NotGeoreferencedWarning),
            rasterio.open(
                path,
                "w",
                driver="GTiff",
                height=about.shape[0],
                width=about.shape[1],
                count=1,
                dtype="float32",
                crs=about.crs,
                transform=north_up(left, top, side),
                compress="deflate",
                predictor=3,
                **layout,
            ) as target,
        ):
            yield target
            target.units = (unit,)
            target.set_band_description(1, title)
            target.update_tags(
                NAME=about.name,
                ATTRIBUTION=about.attribution,
                TIFFTAG_COPYRIGHT=_ascii(about.attribution),
                TIFFTAG_SOFTWARE="evocity",
                **({} if about.crs else {PIXEL_TAG: repr(side)}),
            )
    except RasterioError as error:
        raise OSError(str(error)) from error


def _ascii(text: str) -> str:
    """``text`` for the tags of TIFF, which are ASCII: © as (c), é as e."""
    for sign, letters in {"©": "(c)", "®": "(R)", "–": "-", "—": "-", "’": "'"}.items():
        text = text.replace(sign, letters)
    plain = unicodedata.normalize("NFKD", text)
    return (
        "".join(c for c in plain if not unicodedata.combining(c))
        .encode("ascii", "replace")
        .decode()
    )


__all__ = ["write_field_geotiff", "write_geotiff", "write_windows_geotiff"]
