"""Writers of GeoTIFF: maps, fields, and maps by windows."""

import contextlib
import math
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from pyproj import CRS
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.formats.ascii_text import to_ascii
from evocity.io.export.reference_systems import LOCAL, export_system, file_system
from evocity.io.export.styles import raster_style
from evocity.io.export.warp import warp, warped_grid
from evocity.io.geotiff_seal import SEAL, UNSEALED, seal
from evocity.io.projection import code_of
from evocity.io.rasters.reader import HEIGHTS_TITLE, PIXEL_TAG
from evocity.io.reader_types import north_up
from evocity.io.writers import WindowSource, bands
from evocity.pictures.colours import roofs_end, scale_end
from evocity.pictures.field import Field
from evocity.pictures.picture import values_end

# The layout of a file that is written by windows, GDAL's cache in bytes, and the distance of the
# pixels that choose the colours, px.
_TILED: dict[str, Any] = {
    "tiled": True,
    "blockxsize": 256,
    "blockysize": 256,
    "bigtiff": "if_safer",
}
_CACHE, _SAMPLED = 64 << 20, 4


def write_geotiff(city: CityMap, path: Path, crs: str | None = None) -> str:
    """Write a map, in the reference system ``crs`` or its own; return its style for QGIS."""
    with _placed_band(city, HEIGHTS_TITLE, "metre", path, crs) as target:
        target.write(city.heights, 1)
    return raster_style(scale_end(city))


def write_field_geotiff(field: Field, path: Path) -> str:
    """Write a field; return its style for QGIS."""
    values = field.values.astype(np.float32, copy=False)
    with _band(field.city, field.title, field.unit, path) as target:
        target.write(values, 1)
    return raster_style(values_end(values[~np.isnan(values)]), field=True)


def write_windows_geotiff(
    what: WindowSource,
    path: Path,
    progress: Callable[[int, int], None] | None = None,
    crs: str | None = None,
) -> str:
    """Write a map band by band, as tiles; ``progress`` as of `bands`. Return its style for QGIS,
    whose colours go by a sample of the roofs."""
    roofs = []
    with (
        rasterio.Env(GDAL_CACHEMAX=_CACHE),
        _placed_band(what, HEIGHTS_TITLE, "metre", path, crs, **_TILED) as target,
    ):
        for top, heights in bands(what, progress):
            window = rasterio.windows.Window(0, top, heights.shape[1], heights.shape[0])
            target.write(heights, 1, window=window)
            sample = heights[::_SAMPLED, ::_SAMPLED]
            roofs.append(sample[sample > BUILT_ABOVE])
    return raster_style(roofs_end(np.concatenate(roofs)))


@contextlib.contextmanager
def _placed_band(
    about: CityMap | WindowSource, title: str, unit: str, path: Path, crs: str | None, **layout
) -> Iterator[rasterio.io.DatasetWriter]:
    """Open a GeoTIFF as `_band`, and convert it to the reference system ``crs`` at the end."""
    target = export_system(about, crs, metres=True)
    if target is None or target == CRS.from_user_input(about.crs):
        with _band(about, title, unit, path, **layout) as file:
            yield file
        return
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".evocity-") as folder:
        own = Path(folder) / "own.tif"
        with _band(about, title, unit, own, **_TILED) as file:
            yield file
        text = file_system(code_of(target))
        shape, corner = warped_grid(own, text, about.metres_per_pixel)
        with _band(about, title, unit, path, text, shape, corner, **_TILED) as file:
            warp(own, file)


@contextlib.contextmanager
def _band(
    about: CityMap | WindowSource,
    title: str,
    unit: str,
    path: Path,
    crs: str | None = None,
    shape: tuple[int, int] | None = None,
    corner: tuple[float, float] | None = None,
    **layout,
) -> Iterator[rasterio.io.DatasetWriter]:
    """Open a GeoTIFF of one float32 band, with the description of a map, for writing; seal it at
    the end. ``crs``, ``shape`` and the north-west ``corner`` are the map's by default; a map
    without a place has the system `LOCAL`. Missing
    pixels are NaN. Raises OSError where the library cannot write."""
    side, (rows, columns) = about.metres_per_pixel, shape or about.shape
    left, top = corner or about.origin or (0.0, rows * side)
    if crs is None:
        crs = LOCAL if about.crs is None else file_system(about.crs)
    try:
        with (
            warnings.catch_warnings(action="ignore", category=NotGeoreferencedWarning),
            rasterio.open(
                path,
                "w",
                driver="GTiff",
                height=rows,
                width=columns,
                count=1,
                dtype="float32",
                crs=crs,
                nodata=math.nan,
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
                TIFFTAG_COPYRIGHT=to_ascii(about.attribution),
                TIFFTAG_SOFTWARE="evocity",
                **{SEAL: UNSEALED},
                **({PIXEL_TAG: repr(side)} if crs == LOCAL else {}),
            )
    except RasterioError as error:
        raise OSError(str(error)) from error
    seal(path)
