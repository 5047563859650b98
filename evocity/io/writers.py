"""Writers of maps, fields and shares: rasters, pictures and footprints, chosen by suffix."""

import contextlib
import functools
import os
from collections.abc import Callable, Iterator, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from PIL import Image, PngImagePlugin

from evocity.citymap import CityMap, Classes, Walls
from evocity.errors import MapError, keyword
from evocity.files import whole_file
from evocity.pictures.field import Faces, Field, Leaves, Shares
from evocity.pictures.picture import (
    CLOSEST,
    render,
    render_faces,
    render_field,
    render_leaves,
    render_shares,
)

# The least side of the map in a picture, pixels.
_PICTURE_SIDE = 768
# Rows of a band, as of the tiles of a GeoTIFF.
_ROWS = 256


class WindowSource(Protocol):
    """A map that may be too large for memory, and gives windows of itself."""

    shape: tuple[int, int]
    metres_per_pixel: float
    name: str
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None

    def window(self, top: int, left: int, height: int, width: int) -> np.ndarray:
        """Compute float32 ``(height, width)``, metres, from pixel (top, left) on."""
        ...


def write_map(
    city: CityMap,
    path: str | os.PathLike,
    *,
    raw: bool = False,
    streets: bool = False,
    water: np.ndarray | None = None,
    walls: Walls | None = None,
    columns: Mapping[str, np.ndarray] | None = None,
    classes: Classes | None = None,
    crs: str | None = None,
) -> None:
    """Write a map; the suffix of ``path`` chooses the format.

    A ``.tif`` file holds float32 heights with reference system, pixel size and attribution. Reading
    a ``.tif`` file restores the same heights bit for bit. A ``.png`` file is a picture with the
    attribution and a colour scale in metres. A ``.npy`` file holds only the array of heights,
    metres.

    A ``.gpkg``, ``.fgb``, ``.geoparquet`` or ``.geojson`` file holds one polygon for each building
    of `CityMap.buildings`; courtyards are holes. A file of polygons has the columns ``id`` (label
    of the building), ``height`` (mean height of its pixels, m) and ``area`` (m²), and, except
    GeoJSON, ``class`` (name of the building's class in ``classes`` or `CityMap.classes`). A file of
    polygons contains the attribution of the map.

    The polygons have the straight walls of `CityMap.walls`, and form a valid coverage. With the
    option ``raw``, the polygons follow the edges of the pixels (`CityMap.outline`). If you read a
    ``raw`` file with the ``pixels`` and ``metres_per_pixel`` of the map, each pixel gets the height
    of its building.

    A GeoPackage has the version 1.2 and one layer, ``buildings``. The files `.gpkg`, `.fgb` and
    `.geoparquet` have the map's reference system. For a map without a place on Earth, coordinates
    are metres from the map's south-west corner. If a map has no place on Earth, GIS programs show
    an undefined Cartesian reference system for its file. Coordinates in a `.geojson` file are
    longitude and latitude (RFC 7946).

    QGIS shows each layer of a GeoPackage in the colours of evocity's pictures. A GeoTIFF has its
    style in a second file, with the suffix ``.qml``. A ``.qml`` file of another origin stays
    unchanged.

    The option ``streets``, only for ``.gpkg``, adds the graph `CityMap.street_graph` to the file.
    The street graph becomes three layers: ``street_edges`` (with the nodes u and v, length, width
    and kind), ``street_nodes`` and ``places``. With the option ``streets``, the layer of buildings
    has the additional column ``quarter``. The layer ``ground`` has the surfaces between
    buildings. The option ``water``, bool ``(H, W)``, marks open ground that is water.

    The option ``walls``, for ``.gpkg``, ``.fgb`` and ``.geoparquet``, writes walls from
    `CityMap.walled` instead of `CityMap.walls`. The option ``columns`` maps the names of additional
    columns of the polygons to their values. The option ``classes`` holds other classes of the map,
    from `CityMap.classified`.

    The option ``crs`` is the reference system of the file: a code such as ``"EPSG:2154"``, or a
    plain PROJ string. None keeps the map's own. A raster in another reference system has the same
    side of a pixel, the value of the nearest pixel of the map, and NaN outside the map.

    Raises
    ------
    MapError : the suffix is unknown, the folder is missing, or the file cannot be written. The
        options ``streets`` and ``walls`` raise MapError for a format that cannot hold them, and
        ``water`` raises MapError without ``streets`` or with another size than the map. A map
        without a place on Earth, or across the 180th meridian, cannot be written as GeoJSON, and
        raises MapError. The option ``crs`` raises MapError for an unknown system, for a system that
        is not defined at the map's place, for a map without a place, for a format without
        coordinates, and for degrees in a raster. After an error, no partial file remains, and an
        existing file stays unchanged.
    """
    writers = WRITERS | RAW_WRITERS if raw else WRITERS
    if raw and walls is not None:
        raise MapError(
            "raw outlines and the parameter 'walls' are both given",
            "either raw outlines or the parameter 'walls'",
            f"leave {keyword('raw')} out",
        )
    suffix, name = Path(path).suffix.lower(), Path(path).name
    if streets and suffix in writers and suffix != ".gpkg":
        raise MapError(
            f"{name}: streets cannot go into a {suffix} file",
            "a .gpkg file, because a GeoPackage can have several layers",
            "write a .gpkg, or leave streets out",
        )
    if walls is not None and suffix in writers and suffix not in TABLES:
        raise MapError(
            f"{name}: walls= cannot go into a {suffix} file",
            f"a file with the suffix {', '.join(TABLES)}",
            "write a .gpkg, or leave walls= out",
        )
    check_water(city, water, streets)
    how: dict[str, Any] = {"streets": True, "water": water} if streets else {}
    if suffix in TABLES:
        how |= {"walls": walls, "columns": columns, "classes": classes}
    if suffix in writers:
        write = functools.partial(writers[suffix], **how, **_crs_option(name, suffix, crs))
        writers = writers | {suffix: write}
    _write(city, path, writers)


def write_field(field: Field, path: str | os.PathLike) -> None:
    """Write values on the grid of a city; the suffix of ``path`` chooses the format.

    A ``.tif`` file holds float32 values with title, unit, reference system and attribution. A
    ``.png`` file is a picture with a colour scale. A ``.npy`` file holds only the array. Raises
    `MapError` for the same reasons as `write_map`.
    """
    _write(field, path, FIELD_WRITERS)


def write_shares(shares: Shares, path: str | os.PathLike) -> None:
    """Write the shares of several parts, for example source cities, in each pixel of a city; the
    suffix of ``path`` chooses the format.

    A ``.png`` file is a picture with one hue for each part. A ``.npy`` file holds only the array
    ``(H, W, n)`` of the shares of n parts. Raises `MapError` for the same reasons as `write_map`.
    """
    _write(shares, path, SHARES_WRITERS)


def write_leaves(leaves: Leaves, path: str | os.PathLike) -> None:
    """Write a picture of a map with the borders of its range blocks, as ``.png``. Raises `MapError`
    for the same reasons as `write_map`."""
    _write(leaves, path, LEAVES_WRITERS)


def write_faces(faces: Faces, path: str | os.PathLike) -> None:
    """Write a picture of a map with the faces between its streets, as ``.png``. Raises `MapError`
    for the same reasons as `write_map`."""
    _write(faces, path, FACES_WRITERS)


def write_windows(
    what: WindowSource,
    path: str | os.PathLike,
    progress: Callable[[int, int], None] | None = None,
    crs: str | None = None,
) -> None:
    """Write a map of any size, in bands of rows. The suffix of ``path`` chooses the format.

    A ``.tif`` file is a tiled GeoTIFF with the contents that `write_map` gives; a very large map
    becomes a BigTIFF. A ``.npy`` file holds only the array. The function ``progress`` is called
    with two numbers: the number of finished rows, and the number of all rows. The option ``crs`` is
    as in `write_map`. Raises `MapError` for the same reasons as `write_map`.
    """
    name, suffix = Path(path).name, Path(path).suffix.lower()
    writers = {
        own: functools.partial(write, progress=progress, **_crs_option(name, suffix, crs))
        for own, write in WINDOW_WRITERS.items()
    }
    _write(what, path, writers)


def bands(
    what: WindowSource, progress: Callable[[int, int], None] | None = None
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the map from north to south, as (first row, heights) of bands of its width; calls
    ``progress`` with (done, total), rows."""
    height, width = what.shape
    for top in range(0, height, _ROWS):
        rows = min(_ROWS, height - top)
        yield top, what.window(top, 0, rows, width)
        if progress is not None:
            progress(top + rows, height)


def _crs_option(name: str, suffix: str, crs: str | None) -> dict[str, str]:
    """Return the option ``crs`` of a writer; raises `MapError` for a file without coordinates."""
    if crs is None:
        return {}
    if suffix not in PLACED:
        raise MapError(
            f"{name}: a {suffix} file has no coordinates for {keyword('crs', crs)}",
            f"a file with the suffix {', '.join(PLACED)}",
            f"choose another suffix, or leave {keyword('crs')} out",
        )
    return {"crs": crs}


def _write(what: object, path: str | os.PathLike, writers: dict[str, Callable]) -> None:
    path = Path(path)
    write = writers.get(path.suffix.lower())
    if write is None:
        raise MapError(
            f"{path.name}: no writer for {path.suffix or 'a file without a suffix'}",
            f"a name that ends in {', '.join(sorted(writers))}",
            "choose .tif to go on working with the values, .png to look at them"
            + (", .gpkg for footprints in a GIS" if ".gpkg" in writers else ""),
        )
    check_place(path)
    with open_output(path) as temporary:
        style = write(what, temporary)
    if style is not None:
        from evocity.io.export.styles import write_style

        try:
            write_style(path, style)
        except OSError as error:
            raise _write_error(path.with_suffix(".qml"), error) from error


def check_place(path: Path) -> None:
    """Raise `MapError` unless ``path`` is a file name in a folder that exists."""
    if not path.parent.is_dir() or path.is_dir():
        raise MapError(
            f"{str(path)!r}: " + ("it is a folder" if path.is_dir() else "there is no such folder"),
            "a file name in an existing folder",
            f"make the folder {str(path.parent)!r} first, or choose another name",
        )


def check_water(city: CityMap, water: np.ndarray | None, streets: bool) -> None:
    """Raise `MapError` for ``water`` of another size or kind than bool ``(H, W)``, or without
    streets."""
    if water is None:
        return
    if not streets:
        raise MapError(
            "the parameter 'water' is given without streets",
            "streets=True, which divides the ground into surfaces",
            "set streets=True, or leave the parameter 'water' out",
        )
    if not isinstance(water, np.ndarray) or water.dtype.kind != "b" or water.shape != city.shape:
        raise MapError(
            f"the parameter 'water' has the shape {np.shape(water)}",
            f"an array of booleans of the shape {city.shape}, one for each pixel",
            "convert the array, for example water = numbers > 0",
        )


@contextlib.contextmanager
def open_output(path: Path) -> Iterator[Path]:
    """Give a temporary path that becomes ``path`` once it is written; `MapError` on failure."""
    try:
        with whole_file(path) as temporary:
            yield temporary
    except OSError as error:
        raise _write_error(path, error) from error


def _write_error(path: Path, error: OSError) -> MapError:
    return MapError(
        f"{str(path)!r} cannot be written: {error}",
        "a folder that you may write to, on a disk with free space",
        "check permissions and free space, or choose another folder",
    )


def _lazy(module: str, name: str, **options) -> Callable:
    """Make a writer of a module of this room that loads, with its library, at the first call."""

    def write(what: object, path: Path, **more) -> str | None:
        return getattr(import_module(f"evocity.io.{module}"), name)(what, path, **options | more)

    return write


def _write_array(values: Callable[[Any], np.ndarray]) -> Callable:
    """Make a writer of NPY, of the array that ``values`` takes from the argument."""

    def write(what: object, path: Path) -> None:
        np.save(path, values(what).astype(np.float32, copy=False), allow_pickle=False)

    return write


def _write_windows_npy(what: WindowSource, path: Path, progress) -> None:
    header = {"descr": "<f4", "fortran_order": False, "shape": tuple(what.shape)}
    with open(path, "wb") as file:
        np.lib.format.write_array_header_2_0(file, header)
        for _, heights in bands(what, progress):
            file.write(heights.astype("<f4", copy=False).tobytes())


def _write_png(city: CityMap, path: Path) -> None:
    save_picture(render(city, zoom=_picture_zoom(city)), city, city.name, path)


def _write_titled_png(draw: Callable, what: Field | Shares | Leaves | Faces, path: Path) -> None:
    city = what.city
    least = CLOSEST if isinstance(what, Leaves | Faces) else 1
    picture = draw(what, zoom=max(least, _picture_zoom(city)))
    save_picture(picture, city, f"{city.name}: {what.title}", path)


def _picture_zoom(city: CityMap) -> int:
    return max(1, -(-_PICTURE_SIDE // max(city.shape)))


def save_picture(picture: Image.Image, city: CityMap, title: str, path: Path) -> None:
    """Write a ``picture`` of a city as PNG, with its title and the attribution."""
    about = PngImagePlugin.PngInfo()
    about.add_itxt("Title", title)
    about.add_itxt("Copyright", city.attribution)
    about.add_itxt("Software", "evocity")
    picture.save(path, format="PNG", pnginfo=about)


_write_geotiff = _lazy("tiff", "write_geotiff")
_write_field_geotiff = _lazy("tiff", "write_field_geotiff")
_write_windows_geotiff = _lazy("tiff", "write_windows_geotiff")

#: Writers of maps, by suffix.
WRITERS = {
    ".tif": _write_geotiff,
    ".tiff": _write_geotiff,
    ".png": _write_png,
    ".npy": _write_array(lambda city: city.heights),
    ".gpkg": _lazy("export.geopackage", "write_geopackage"),
    ".fgb": _lazy("export.footprint_tables", "write_flatgeobuf"),
    ".geoparquet": _lazy("export.footprint_tables", "write_geoparquet"),
    ".geojson": _lazy("footprint_files", "write_geojson"),
}

#: Suffixes of files with polygons and columns, and of files that have coordinates.
TABLES = (".gpkg", ".fgb", ".geoparquet")
PLACED = (*TABLES, ".geojson", ".tif", ".tiff")

#: Writers of footprints along the pixels' edges.
RAW_WRITERS = {
    ".gpkg": _lazy("export.geopackage", "write_geopackage", raw=True),
    ".fgb": _lazy("export.footprint_tables", "write_flatgeobuf", raw=True),
    ".geoparquet": _lazy("export.footprint_tables", "write_geoparquet", raw=True),
    ".geojson": _lazy("footprint_files", "write_geojson", raw=True),
}

#: Writers of maps by windows.
WINDOW_WRITERS = {
    ".tif": _write_windows_geotiff,
    ".tiff": _write_windows_geotiff,
    ".npy": _write_windows_npy,
}

#: Writers of fields.
FIELD_WRITERS = {
    ".tif": _write_field_geotiff,
    ".tiff": _write_field_geotiff,
    ".png": functools.partial(_write_titled_png, render_field),
    ".npy": _write_array(lambda field: field.values),
}

#: Writers of shares.
SHARES_WRITERS = {
    ".png": functools.partial(_write_titled_png, render_shares),
    ".npy": _write_array(lambda shares: shares.weights),
}

#: Writers of range blocks.
LEAVES_WRITERS = {".png": functools.partial(_write_titled_png, render_leaves)}

#: Writers of faces between streets.
FACES_WRITERS = {".png": functools.partial(_write_titled_png, render_faces)}
