"""Writers of GeoTIFF: maps, fields, and maps by windows."""

import contextlib
import unicodedata
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import rasterio
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from evocity.citymap import CityMap
from evocity.io.geotiff_seal import SEAL, UNSEALED, seal
from evocity.io.rasters.reader import HEIGHTS_TITLE, PIXEL_TAG
from evocity.io.reader_types import north_up
from evocity.io.writers import WindowSource, bands
from evocity.pictures.field import Field

# Side of the tiles of a file that is written by windows, px, and GDAL's cache, bytes.
_TILE, _CACHE = 256, 64 << 20


def write_geotiff(city: CityMap, path: Path) -> None:
    with _band(city, HEIGHTS_TITLE, "metre", path) as target:
        target.write(city.heights, 1)


def write_field_geotiff(field: Field, path: Path) -> None:
    values = field.values.astype(np.float32, copy=False)
    layout = {"nodata": np.nan} if np.isnan(values).any() else {}
    with _band(field.city, field.title, field.unit, path, **layout) as target:
        target.write(values, 1)


def write_windows_geotiff(
    what: WindowSource, path: Path, progress: Callable[[int, int], None] | None = None
) -> None:
    """Write a map band by band, as tiles; ``progress`` as of `bands`."""
    layout = {"tiled": True, "blockxsize": _TILE, "blockysize": _TILE, "bigtiff": "if_safer"}
    with (
        rasterio.Env(GDAL_CACHEMAX=_CACHE),
        _band(what, HEIGHTS_TITLE, "metre", path, **layout) as target,
    ):
        for top, heights in bands(what, progress):
            window = rasterio.windows.Window(0, top, heights.shape[1], heights.shape[0])
            target.write(heights, 1, window=window)


@contextlib.contextmanager
def _band(
    about: CityMap | WindowSource, title: str, unit: str, path: Path, **layout
) -> Iterator[rasterio.io.DatasetWriter]:
    """Open a GeoTIFF of one float32 band, with the description of a map, for writing; seal it at
    the end. Raises OSError where the library cannot write."""
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
                **{SEAL: UNSEALED},
                **({} if about.crs else {PIXEL_TAG: repr(side)}),
            )
    except RasterioError as error:
        raise OSError(str(error)) from error
    seal(path)


def _ascii(text: str) -> str:
    """Spell ``text`` in ASCII, as tags of TIFF are: © as (c), é as e."""
    for sign, letters in {"©": "(c)", "®": "(R)", "–": "-", "—": "-", "’": "'"}.items():
        text = text.replace(sign, letters)
    plain = unicodedata.normalize("NFKD", text)
    return (
        "".join(c for c in plain if not unicodedata.combining(c))
        .encode("ascii", "replace")
        .decode()
    )
