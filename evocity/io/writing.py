"""`write_map` and its like: rasters, pictures, footprints, whole or not."""

import functools
import os
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from PIL import Image, PngImagePlugin

from evocity.citymap import CityMap, Walls
from evocity.errors import MapError, keyword
from evocity.files import whole_file
from evocity.io.windows import Windowed, bands
from evocity.pictures.field import Field, Shares
from evocity.pictures.leaves import CLOSEST, Leaves, render_leaves
from evocity.pictures.picture import render, render_field, render_shares

# A picture's map is drawn at least this large, pixels.
_PICTURE_SIDE = 768


def write_map(
    city: CityMap,
    path: str | os.PathLike,
    *,
    raw: bool = False,
    streets: bool = False,
    walls: Walls | None = None,
    columns: Mapping[str, np.ndarray] | None = None,
) -> None:
    """Write a map; the suffix of ``path`` chooses the format.

    ``.tif``: float32 heights with reference system, unit and attribution; read back, the
    heights are the same bit for bit. ``.png``: a picture with a colour scale in metres and
    the attribution. ``.npy``: the bare array, metres.

    ``.gpkg``, ``.geojson``: footprints, a polygon a building of `CityMap.buildings`, courtyards as
    holes, with ``id`` (its label there), ``height`` (m, the mean of its pixels) and ``area`` (m²),
    and the attribution. They have the straight walls of `CityMap.walls`, and are a valid coverage;
    ``raw``, the edges of their pixels (`CityMap.outline`): read back with the same ``pixels`` and
    ``metres_per_pixel``, the same pixels are then built, each as high as its building. A GeoPackage
    has one layer, ``buildings``, in the map's reference system; in metres from the map's south-west
    corner, which GIS call an undefined Cartesian system, if the map lies nowhere on Earth. GeoJSON
    is in longitude and latitude (RFC 7946).

    ``streets``, of ``.gpkg`` alone: `CityMap.street_graph` beside the buildings, as layers
    ``street_edges`` (with the nodes ``u`` and ``v``, length, width, kind), ``street_nodes`` and
    ``places``; and of each building the ``quarter`` it is of.

    ``walls``, of ``.gpkg`` alone: those to write, as `CityMap.walled` made them, in place of
    `CityMap.walls`; ``columns``: what else to tell of each of their polygons, by name.

    Raises
    ------
    MapError : another suffix, no such folder, the file cannot be written, streets are asked for
        of another format, or GeoJSON is asked for of a map that lies nowhere on Earth, or across
        the 180th meridian. Nothing half-written is left, and a file that was there stays as it
        was.
    """
    writers = WRITERS | RAW_WRITERS if raw else WRITERS
    if raw and walls is not None:
        raise MapError(
            "raw outlines and walls of one's own", "one of them", f"leave {keyword('raw')} out"
        )
    if streets or walls is not None:
        suffix, what = Path(path).suffix.lower(), "streets" if streets else "walls of one's own"
        if suffix in writers and suffix != ".gpkg":
            raise MapError(
                f"{Path(path).name}: {what} in a {suffix} file",
                "a .gpkg, which has a layer for each kind of thing",
                f"write a .gpkg, or leave {what} out",
            )
        how = {"streets": streets, "walls": walls, "columns": columns}
        own = functools.partial(writers[".gpkg"], **how)
        writers = writers | {".gpkg": own}
    _write(city, path, writers)


def write_field(field: Field, path: str | os.PathLike) -> None:
    """Write values on a city's grid; the suffix of ``path`` chooses the format.

    ``.tif``: float32 values with title, unit, reference system and attribution. ``.png``: a
    picture with a colour scale. ``.npy``: the bare array. Raises as `write_map`.
    """
    _write(field, path, FIELD_WRITERS)


def write_shares(shares: Shares, path: str | os.PathLike) -> None:
    """Write whose part each pixel of a city is; the suffix of ``path`` chooses the format.

    ``.png``: a picture with a hue for each part. ``.npy``: the bare array ``(H, W, n)``. Raises
    as `write_map`.
    """
    _write(shares, path, SHARES_WRITERS)


def write_leaves(leaves: Leaves, path: str | os.PathLike) -> None:
    """Write a map with the borders of its range blocks as a picture, ``.png``. Raises as
    `write_map`."""
    _write(leaves, path, LEAVES_WRITERS)


def write_windows(
    what: Windowed,
    path: str | os.PathLike,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Write a map of any size, a band of rows at a time; the suffix of ``path`` chooses the format.

    ``.tif``: a tiled GeoTIFF of what `write_map` says, a BigTIFF if it must be. ``.npy``: the
    bare array. ``progress`` is called with (done, total), counted in rows. Raises as `write_map`.
    """
    writers = {
        suffix: functools.partial(write, progress=progress)
        for suffix, write in WINDOW_WRITERS.items()
    }
    _write(what, path, writers)


def _write_windows_npy(what: Windowed, path: Path, progress) -> None:
    header = {"descr": "<f4", "fortran_order": False, "shape": tuple(what.shape)}
    with open(path, "wb") as file:
        np.lib.format.write_array_header_2_0(file, header)
        for _, heights in bands(what, progress):
            file.write(heights.astype("<f4", copy=False).tobytes())


def _write(
    what: CityMap | Field | Shares | Windowed, path: str | os.PathLike, writers: dict[str, Callable]
) -> None:
    path = Path(path)
    write = writers.get(path.suffix.lower())
    if write is None:
        raise MapError(
            f"{path.name}: no map is written as {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(sorted(writers))}",
            "choose .tif to go on working with the values, .png to look at them"
            + (", .gpkg for footprints in a GIS" if ".gpkg" in writers else ""),
        )
    if not path.parent.is_dir() or path.is_dir():
        raise MapError(
            f"{str(path)!r}: " + ("it is a folder" if path.is_dir() else "there is no such folder"),
            "a file name in an existing folder",
            f"make the folder {str(path.parent)!r} first, or choose another name",
        )
    try:
        with whole_file(path) as temporary:
            write(what, temporary)
    except OSError as error:
        raise MapError(
            f"{str(path)!r} cannot be written: {error}",
            "a folder this user may write to, with room left",
            "check permissions and free space, or choose another place",
        ) from error


def _write_geotiff(city: CityMap, path: Path) -> None:
    _tiff().write_geotiff(city, path)


def _write_field_geotiff(field: Field, path: Path) -> None:
    _tiff().write_field_geotiff(field, path)


def _write_windows_geotiff(what: Windowed, path: Path, progress) -> None:
    _tiff().write_windows_geotiff(what, path, bands(what, progress))


def _tiff():
    from evocity.io import tiff  # which loads GDAL

    return tiff


def _write_geopackage(city: CityMap, path: Path, **how) -> None:
    from evocity.io.polygons import write_geopackage

    write_geopackage(city, path, **how)


def _write_geojson(city: CityMap, path: Path, **how) -> None:
    from evocity.io.polygons import write_geojson

    write_geojson(city, path, **how)


def _write_png(city: CityMap, path: Path) -> None:
    save_picture(render(city, zoom=_picture_zoom(city)), city, city.name, path)


def _write_field_png(field: Field, path: Path) -> None:
    picture = render_field(field, zoom=_picture_zoom(field.city))
    save_picture(picture, field.city, f"{field.city.name}: {field.title}", path)


def _write_shares_png(shares: Shares, path: Path) -> None:
    picture = render_shares(shares, zoom=_picture_zoom(shares.city))
    save_picture(picture, shares.city, f"{shares.city.name}: {shares.title}", path)


def _write_leaves_png(leaves: Leaves, path: Path) -> None:
    city = leaves.city
    picture = render_leaves(leaves, zoom=max(CLOSEST, _picture_zoom(city)))
    save_picture(picture, city, f"{city.name}: {leaves.title}", path)


def _picture_zoom(city: CityMap) -> int:
    return max(1, -(-_PICTURE_SIDE // max(city.shape)))


def save_picture(picture: Image.Image, city: CityMap, title: str, path: Path) -> None:
    """Write a ``picture`` of a city as PNG, with its title and the attribution."""
    about = PngImagePlugin.PngInfo()
    about.add_itxt("Title", title)
    about.add_itxt("Copyright", city.attribution)
    about.add_itxt("Software", "evocity")
    picture.save(path, format="PNG", pnginfo=about)


def _write_npy(city: CityMap, path: Path) -> None:
    np.save(path, city.heights, allow_pickle=False)


def _write_field_npy(field: Field, path: Path) -> None:
    np.save(path, field.values.astype(np.float32, copy=False), allow_pickle=False)


def _write_shares_npy(shares: Shares, path: Path) -> None:
    np.save(path, shares.weights.astype(np.float32, copy=False), allow_pickle=False)


#: The one table of writers of maps.
WRITERS = {
    ".tif": _write_geotiff,
    ".tiff": _write_geotiff,
    ".png": _write_png,
    ".npy": _write_npy,
    ".gpkg": _write_geopackage,
    ".geojson": _write_geojson,
}

#: Those of footprints along the pixels' edges.
RAW_WRITERS = {
    ".gpkg": functools.partial(_write_geopackage, raw=True),
    ".geojson": functools.partial(_write_geojson, raw=True),
}

#: The same of maps written by windows.
WINDOW_WRITERS = {
    ".tif": _write_windows_geotiff,
    ".tiff": _write_windows_geotiff,
    ".npy": _write_windows_npy,
}

#: The same of fields.
FIELD_WRITERS = {
    ".tif": _write_field_geotiff,
    ".tiff": _write_field_geotiff,
    ".png": _write_field_png,
    ".npy": _write_field_npy,
}

#: The same of shares.
SHARES_WRITERS = {".png": _write_shares_png, ".npy": _write_shares_npy}

#: The same of range blocks.
LEAVES_WRITERS = {".png": _write_leaves_png}

__all__ = [
    "FIELD_WRITERS",
    "LEAVES_WRITERS",
    "RAW_WRITERS",
    "SHARES_WRITERS",
    "WINDOW_WRITERS",
    "WRITERS",
    "save_picture",
    "write_field",
    "write_leaves",
    "write_map",
    "write_shares",
    "write_windows",
]
