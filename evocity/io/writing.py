"""`write_map`: GeoTIFF, PNG, NPY; whole or not at all."""

import os
import warnings
from pathlib import Path

import numpy as np
import rasterio
from PIL import PngImagePlugin
from rasterio.errors import NotGeoreferencedWarning, RasterioError

from evocity.citymap import CityMap
from evocity.errors import MapError
from evocity.files import whole_file
from evocity.io.picture import render
from evocity.io.raster import PIXEL_TAG
from evocity.io.sources import north_up

# A picture's map is drawn at least this large, pixels.
_PICTURE_SIDE = 768


def write_map(city: CityMap, path: str | os.PathLike) -> None:
    """Write a map; the suffix of ``path`` chooses the format.

    ``.tif``: float32 heights with reference system, unit and attribution; read back, the
    heights are the same bit for bit. ``.png``: a picture with a colour scale in metres and
    the attribution. ``.npy``: the bare array, metres.

    Raises
    ------
    MapError : another suffix, no such folder, or the file cannot be written. Nothing
        half-written is left, and a file that was there stays as it was.
    """
    path = Path(path)
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise MapError(
            f"{path.name}: no map is written as {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(sorted(WRITERS))}",
            "choose .tif to go on working with the heights, .png to look at them",
        )
    if not path.parent.is_dir() or path.is_dir():
        raise MapError(
            f"{str(path)!r}: " + ("it is a folder" if path.is_dir() else "there is no such folder"),
            "a file name in an existing folder",
            f"make the folder {str(path.parent)!r} first, or choose another name",
        )
    try:
        with whole_file(path) as temporary:
            write(city, temporary)
    except (OSError, RasterioError) as error:
        raise MapError(
            f"{str(path)!r} cannot be written: {error}",
            "a folder this user may write to, with room left",
            "check permissions and free space, or choose another place",
        ) from error


def _write_geotiff(city: CityMap, path: Path) -> None:
    side = city.metres_per_pixel
    left, top = city.origin or (0.0, city.shape[0] * side)
    with (
        warnings.catch_warnings(action="ignore", category=NotGeoreferencedWarning),
        rasterio.open(
            path,
            "w",
            driver="GTiff",
            height=city.shape[0],
            width=city.shape[1],
            count=1,
            dtype="float32",
            crs=city.crs,
            transform=north_up(left, top, side),
            compress="deflate",
            predictor=3,
        ) as target,
    ):
        target.write(city.heights, 1)
        target.units = ("metre",)
        target.set_band_description(1, "height above ground")
        target.update_tags(
            NAME=city.name,
            ATTRIBUTION=city.attribution,
            TIFFTAG_COPYRIGHT=city.attribution.encode("ascii", "replace").decode(),
            TIFFTAG_SOFTWARE="evocity",
            **({} if city.crs else {PIXEL_TAG: repr(side)}),
        )


def _write_png(city: CityMap, path: Path) -> None:
    about = PngImagePlugin.PngInfo()
    about.add_itxt("Title", city.name)
    about.add_itxt("Copyright", city.attribution)
    about.add_itxt("Software", "evocity")
    zoom = max(1, -(-_PICTURE_SIDE // max(city.shape)))
    render(city, zoom=zoom).save(path, format="PNG", pnginfo=about)


def _write_npy(city: CityMap, path: Path) -> None:
    np.save(path, city.heights, allow_pickle=False)


#: The one table of writers.
WRITERS = {
    ".tif": _write_geotiff,
    ".tiff": _write_geotiff,
    ".png": _write_png,
    ".npy": _write_npy,
}

__all__ = ["WRITERS", "write_map"]
