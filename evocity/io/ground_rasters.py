"""Rasters of ground elevations (DTM): reading for surfaces, and writing of surfaces."""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from rasterio.crs import CRS

from evocity.errors import MapError
from evocity.io.map_reader import data_of, options_of
from evocity.io.reader_types import Grid, Request
from evocity.io.resampling import placement_errors, upright
from evocity.io.writers import open_output


@dataclass(frozen=True, eq=False)
class GroundRaster:
    """Elevations of the ground.

    heights : float64 ``(R, C)``, metres, the first row in the north; holes are NaN.
    spacing : distance between the centres of pixels down and across, metres.
    corner : (x, y) of the centre of the first pixel.
    crs : reference system as a code or a text, or None.
    attribution : credit line of the source.
    """

    heights: np.ndarray
    spacing: tuple[float, float]
    corner: tuple[float, float] = (0.0, 0.0)
    crs: str | None = None
    attribution: str = ""


def read_ground(path: str | os.PathLike, nodata: float | None = None) -> GroundRaster:
    """Read elevations of the ground from a raster, such as a GeoTIFF or an ASCII grid.

    nodata : the value of missing pixels; None means the value that the file declares.

    Raises `MapError` for a file that is not a raster of metres with square or rectangular pixels.
    """
    name = Path(path).name
    if "terrain" not in options_of(path):
        raise _not_ground(name, "a file of another kind")
    data, _ = data_of(path, Request(nodata=nodata, terrain=os.fspath(path)))
    if not isinstance(data, Grid):
        raise _not_ground(name, "footprints")
    if data.fault is not None:
        raise data.fault
    with placement_errors(name):
        grid = upright(data)
    step, crs = grid.transform, grid.crs
    if crs is not None and not crs.is_projected:
        raise MapError(
            f"{name} has degrees: {crs.name[:80]}",
            "a raster in metres",
            "convert the raster, for example with gdalwarp -t_srs EPSG:32631",
        )
    if step.b or step.d:
        raise MapError(
            f"the pixels of {name} are turned or sheared",
            "pixels with sides to the north and the east",
            "convert the raster, for example with gdalwarp",
        )
    own = grid.metres_per_pixel if crs is None else None
    spacing = (abs(step.e), abs(step.a)) if own is None else (own, own)
    corner = step.c + step.a / 2, step.f + step.e / 2
    code = None if crs is None else CRS.from_user_input(crs).to_string()
    heights = np.asarray(grid.heights, np.float64)
    return GroundRaster(heights, spacing, corner, code, grid.attribution)


def write_ground(ground: GroundRaster, path: str | os.PathLike) -> None:
    """Write elevations of the ground as a GeoTIFF of float32, or as ``.npy``."""
    path = Path(path)
    heights = ground.heights.astype(np.float32)
    with open_output(path) as temporary:
        if path.suffix.lower() == ".npy":
            with open(temporary, "wb") as file:
                np.save(file, heights)
            return
        (down, across), (x, y) = ground.spacing, ground.corner
        place = Affine(across, 0, x - across / 2, 0, -down, y + down / 2)
        rows, columns = heights.shape
        with rasterio.open(
            temporary, "w", driver="GTiff", height=rows, width=columns, count=1, dtype="float32",
            crs=ground.crs, transform=place, nodata=float("nan"), compress="deflate",
        ) as file:  # fmt: skip
            file.write(heights, 1)
            file.update_tags(attribution=ground.attribution)


def _not_ground(name: str, found: str) -> MapError:
    return MapError(
        f"{name} is {found}",
        "a raster of elevations of the ground, in metres",
        "give a GeoTIFF or an ASCII grid",
    )
