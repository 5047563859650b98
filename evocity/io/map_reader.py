"""`read_map`: chooses the reader by the suffix, and the window; and the table of readers."""

import dataclasses
import os
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path

from evocity.citymap import CityMap
from evocity.errors import MapError, keyword, reason_of
from evocity.io import bundled_cities
from evocity.io.map_options import (
    check_column,
    check_count,
    check_finite,
    check_line,
    check_place,
    check_positive,
    check_terrain,
)
from evocity.io.map_paths import is_map_path, network_address
from evocity.io.rasterization import rasterize_footprints
from evocity.io.rasters.terrain import above_ground
from evocity.io.reader_types import (
    GEODATABASE,
    Footprints,
    Grid,
    Reader,
    Request,
    content_of,
)
from evocity.io.resampling import map_of_grid
from evocity.plugins import load_plugins, origin_of

_PLAIN = frozenset({"height_column", "levels_column"})
_LAYERED = _PLAIN | {"layer"}
_SCALED = frozenset({"height_scale", "nodata", "terrain"})
# The options that only some readers take.
_SPECIAL = ("layer", "height_scale", "height_column", "levels_column", "nodata", "terrain")


class _OptionError(MapError):
    """An option that the reader of a file does not take."""


class _LazyReader:
    # A reader of a module of this room, which is loaded, with its library, at the first use.

    def __init__(self, module: str, name: str):
        self._home = f"evocity.io.{module}", name

    @property
    def _read(self) -> Callable[[Path, Request], Footprints | Grid]:
        module, name = self._home
        return getattr(import_module(module), name)

    @property
    def __doc__(self) -> str | None:
        return self._read.__doc__

    def __call__(self, path: Path, request: Request) -> Footprints | Grid:
        return self._read(path, request)


_read_layers, _read_osm = (
    _LazyReader("vector", "read_layers"),
    _LazyReader("openstreetmap.reader", "read_osm"),
)
_JSON = Reader(_LazyReader("geojson", "read_json"), "JSON", _PLAIN)
_PARQUET = Reader(_LazyReader("geoparquet", "read_geoparquet"), "Parquet", _PLAIN)
_GML = Reader(_LazyReader("xml.gml", "read_gml"), "GML", _LAYERED)
_PBF = Reader(_read_osm, "OSM PBF", _PLAIN)
_TIFF = Reader(_LazyReader("rasters.reader", "read_geotiff"), "TIFF", _SCALED)

#: The table of readers. Packages add rows by entry points of the group ``evocity.readers``:
#: the name is the suffix, the object a `Reader` or a function
#: ``(path, request) -> Footprints | Grid``.
READERS: dict[str, Reader] = {
    ".geojson": _JSON,
    ".json": _JSON,
    ".city.json": _JSON,
    ".cityjson": _JSON,
    ".city.jsonl": _JSON,
    ".jsonl": _JSON,
    ".gpkg": Reader(_read_layers, "SQLite (GeoPackage)", _LAYERED),
    ".shp": Reader(_read_layers, "Shapefile", _LAYERED),
    ".fgb": Reader(_read_layers, "FlatGeobuf", _LAYERED),
    ".gdb": Reader(_read_layers, GEODATABASE, _LAYERED),
    ".parquet": _PARQUET,
    ".geoparquet": _PARQUET,
    ".geojsonl": _JSON,
    ".geojsons": _JSON,
    ".geojsonseq": _JSON,
    ".ndjson": _JSON,
    ".kml": Reader(_LazyReader("xml.kml", "read_kml"), "KML", _LAYERED),
    ".kmz": Reader(_LazyReader("xml.kml", "read_kmz"), "ZIP", _LAYERED),
    ".gml": _GML,
    ".citygml": _GML,
    ".dxf": Reader(_LazyReader("dxf", "read_dxf"), "DXF", _LAYERED),
    ".zip": Reader(_LazyReader("archives", "read_zip"), "ZIP", _LAYERED | _SCALED),
    ".osm": Reader(_read_osm, "OSM XML", _PLAIN),
    ".osm.gz": Reader(_read_osm, "gzip", _PLAIN),
    ".osm.bz2": Reader(_read_osm, "bzip2", _PLAIN),
    ".osm.pbf": _PBF,
    ".pbf": _PBF,
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".asc": Reader(_LazyReader("rasters.ascii_grid", "read_asc"), "ASCII grid", _SCALED),
    ".png": Reader(_LazyReader("rasters.reader", "read_png"), "PNG", _SCALED),
    ".npy": Reader(_LazyReader("rasters.reader", "read_npy"), "NPY", _SCALED),
}


#: Remedies for files that are often mistaken for maps.
_REMEDIES = {
    ".toml": "run a recipe with `evocity run`",
}


def read_map(
    source: str | os.PathLike,
    *,
    pixels: int | None = None,
    metres_per_pixel: float | None = None,
    center: tuple[float, float] | None = None,
    layer: str | None = None,
    default_height: float = 6.0,
    height_scale: float | None = None,
    nodata: float | None = None,
    terrain: str | os.PathLike | float | None = None,
    name: str | None = None,
    attribution: str | None = None,
    height_column: str | None = None,
    levels_column: str | None = None,
) -> CityMap:
    """Read a map from a file, or read one of the districts that `cities` lists.

    Parameters
    ----------
    source : path, or name of a bundled district. The suffix of the file chooses the reader
        (`READERS`): GeoJSON, CityJSON, GeoPackage, Shapefile, GeoParquet, FlatGeobuf, File GDB,
        GML, KML, DXF, OSM XML and PBF, GeoTIFF, ESRI ASCII grid, PNG, NPY, and a zip with one of
        these.
    pixels : number of pixels along each side of the square window. By default, the window has 256 ×
        256 px for a file of footprints, and covers a raster completely.
    metres_per_pixel : length of a pixel's side, metres. By default, footprints get pixels of 2.0 m,
        and a GeoTIFF or ASCII grid keeps its own pixel size. PNG and NPY files require the option
        ``metres_per_pixel``.
    center : centre of the window, ``(longitude, latitude)``. By default, the centre comes from the
        ``window`` member of a GeoJSON file. Without a ``window`` member, the centre is the middle
        of the buildings' bounds, or the middle of the raster.
    layer : name of the layer with the buildings; required if several layers may hold buildings. For
        a zip with several maps, the name of a map.
    default_height : height of a building to which no height rule applies, metres (see
        `evocity.io.heights`).
    height_scale : metres per grey level (required for PNG), or per unit (other rasters).
    nodata : value of missing pixels in a raster that declares no such value, in units of the file.
        Missing pixels are ground. The value also applies to a terrain.
    terrain : raster of the ground (DTM) that is subtracted from a raster of elevations (DSM), or
        the elevation of flat ground in metres; 0 states that the heights are above ground. The
        terrain needs the reference system of the raster, and values for 99 % of its pixels.
    name : name of the map; by default the name of the district, or of the file.
    attribution : credit that the licence of the source demands, at most 1000 characters; this
        argument replaces the file's own credit. For a bundled district, the argument
        ``attribution`` has no effect.
    height_column : column or tag of footprints with the heights of buildings, metres. Where the
        column has no height, the usual rules apply.
    levels_column : column or tag of footprints with the storeys of buildings; a storey is 3 m high.

    Returns
    -------
    CityMap : map whose pixels measure true metres on the ground. Footprints keep the projection of
        the file if its lengths in the window are right within .1 %; else they are projected to a
        transverse Mercator projection about the centre. A raster keeps its pixels if they are
        square, have the requested size, and measure true metres on the ground.

    Raises
    ------
    MapError : the file cannot be read, the window has no buildings, or the window lies beyond the
        raster. Heights of more than 1000 m or less than -100 m raise MapError, and so do elevations
        without a terrain: fewer than 5 % of the pixels lie within 0.5 m of 0.
    """
    request = Request(
        pixels=check_count(pixels),
        metres_per_pixel=check_positive("metres_per_pixel", metres_per_pixel),
        center=check_place(center),
        layer=layer,
        default_height=check_positive("default_height", default_height),
        height_scale=check_positive("height_scale", height_scale),
        name=name,
        height_column=check_column("height_column", height_column),
        levels_column=check_column("levels_column", levels_column),
        nodata=check_finite("nodata", nodata),
        terrain=check_terrain(terrain),
    )
    data, stem = data_of(source, request)
    if attribution is not None and not _locate(source)[1]:
        data = dataclasses.replace(data, attribution=check_line("attribution", attribution))
    if isinstance(data, Footprints):
        return rasterize_footprints(data, request, name or stem)
    name = name or data.name or stem
    return map_of_grid(above_ground_of(data, request, name), request, name)


def above_ground_of(grid: Grid, request: Request, name: str) -> Grid:
    """Return ``grid`` with heights above ground, after reading the terrain that ``request`` names.
    Raises `MapError` as `above_ground`."""
    return above_ground(grid, request, name, _terrain_reader(request))


def path_of_map(source: str | os.PathLike) -> Path:
    """Return the path of a file or bundled district. Raises `MapError` if it does not exist."""
    return _locate(source)[0]


def data_of(source: str | os.PathLike, request: Request) -> tuple[Footprints | Grid, str]:
    """Read the footprints or grid of a file or district, and its name without suffix. Raises
    `MapError` as `read_map`."""
    path, attribution = _locate(source)
    suffix, reader = _reader_of(path)
    _check_options(path, suffix, reader, request)
    _check_content(path, reader)
    data = reader.read(path, request)
    if attribution:
        data = dataclasses.replace(data, attribution=attribution)
    return data, path.name[: -len(suffix)]


def _terrain_reader(request: Request) -> Callable[[str], tuple[Grid, str]]:
    """Return a function that reads a terrain; it raises `MapError` for a file without a grid."""

    def read(terrain: str) -> tuple[Grid, str]:
        fault = MapError(
            f"the terrain {Path(terrain).name} is not a raster",
            "a raster of elevations of the ground, in metres",
            f"give a GeoTIFF or an ASCII grid as {keyword('terrain')}",
        )
        if "terrain" not in options_of(terrain):
            raise fault
        try:
            data, _ = data_of(terrain, Request(nodata=request.nodata, terrain=terrain))
        except _OptionError as error:  # footprints in a zip
            raise fault from error
        if isinstance(data, Footprints):
            raise TypeError(f"the reader of {terrain} returned footprints")
        return data, Path(terrain).name

    return read


def name_of(source: str | os.PathLike) -> str:
    """Find the default name of a map: the name in a GeoTIFF, or else the file's name without
    suffix. Raises `MapError` for the same reasons as `read_map`."""
    path, _ = _locate(source)
    suffix, reader = _reader_of(path)
    own = data_of(source, Request())[0].name if reader is _TIFF else None
    return own or path.name[: -len(suffix)]


def options_of(source: str | os.PathLike) -> frozenset[str]:
    """Tell which options for certain formats the reader of a file takes, see `Reader.takes`."""
    return _reader_of(_locate(source)[0])[1].takes


def suffixes() -> list[str]:
    """List the suffixes of all readers, including those of installed packages."""
    return sorted({*READERS, *_from_plugins()[0]})


def readers() -> dict[str, tuple[Reader, str]]:
    """Return a mapping from each suffix to a pair: the reader of this suffix, and the reader's
    origin. The origin is "evocity", or the package and version of a plugin."""
    ours = {suffix: (reader, "evocity") for suffix, reader in READERS.items()}
    found, _, origins = _from_plugins()
    return ours | {suffix: (found[suffix], origins[suffix]) for suffix in found}


def plugin_warnings() -> tuple[str, ...]:
    """Return a warning for each entry point of the group ``evocity.readers`` that failed to
    load."""
    return _from_plugins()[1]


@cache
def _from_plugins() -> tuple[dict[str, Reader], tuple[str, ...], dict[str, str]]:
    """Load the readers of other packages by suffix, with warnings of failures and their origins."""
    found: dict[str, Reader] = {}
    origins: dict[str, str] = {}

    def take(entry: EntryPoint) -> None:
        suffix, reader = entry.name.lower(), entry.load()
        if not isinstance(reader, Reader) and not callable(reader):
            raise TypeError(f"it is a {type(reader).__name__}, not a reader or a function")
        if suffix in READERS or suffix in found:
            raise ValueError(f"a second reader of {suffix}")
        found[suffix] = reader if isinstance(reader, Reader) else Reader(reader)
        origins[suffix] = origin_of(entry)

    return found, load_plugins("evocity.readers", take), origins


def _locate(source: str | os.PathLike) -> tuple[Path, str]:
    text = os.fspath(source)
    if text in bundled_cities.cities():
        return bundled_cities.path_of(text), bundled_cities.attribution_of(text)
    path = Path(text)
    try:
        if (address := network_address(text)) and not path.exists():
            raise MapError(
                f"no file {address!r}: it is an address on the network",
                "a file on this computer; evocity does not load from the network",
                f"download it first, for example: curl -L -O {address}",
            )
        if is_map_path(path) and path.is_dir():
            return path, ""
        if path.is_dir():
            if (path / "provenance.json").is_file():
                raise MapError(
                    f"{text!r} is a run folder",
                    "a map file",
                    "write the map of an individual first: evocity decode RUN --id N -o MAP.tif",
                )
            raise MapError(
                f"{text!r} is a folder",
                "a file",
                f"name a file in this folder that ends in {_join(suffixes())}",
            )
        if not path.is_file():
            if not path.suffix and path.parent == Path():
                bundled_cities.path_of(text)  # raises, and lists the districts
            raise MapError(
                f"no file {text!r}"
                + ("" if path.parent.is_dir() else f": there is no folder {str(path.parent)!r}"),
                "an existing file, or the name of a bundled city",
                "check the path; `evocity cities` lists the bundled cities",
            )
    except (OSError, ValueError) as error:
        raise _unreadable(text, error) from error
    return path, ""


def _reader_of(path: Path) -> tuple[str, Reader]:
    """Return the longest suffix of the file's name that has a reader, and the reader."""
    lower = path.name.lower()
    fitting = [suffix for suffix in suffixes() if lower.endswith(suffix) and lower != suffix]
    if not fitting:
        raise MapError(
            "; ".join(
                [
                    f"{path.name}: no reader for {path.suffix or 'a file without a suffix'}",
                    *plugin_warnings(),
                ]
            ),
            f"a file that ends in {_join(suffixes())}",
            _REMEDIES.get(
                path.suffix.lower(),
                "convert it to one of these; GeoJSON and GeoTIFF are the easiest to check",
            ),
        )
    suffix = max(fitting, key=len)
    return suffix, READERS.get(suffix) or _from_plugins()[0][suffix]


def _check_options(path: Path, suffix: str, reader: Reader, request: Request) -> None:
    for option in _SPECIAL:
        if getattr(request, option) is not None and option not in reader.takes:
            takers = [s for s in READERS if option in READERS[s].takes]
            raise _OptionError(
                f"{path.name}: {keyword(option)} does not apply to {suffix}",
                f"{keyword(option)} only with {_join(takers)}",
                f"leave {keyword(option)} out",
            )


def _check_content(path: Path, reader: Reader) -> None:
    if path.is_dir():
        return  # the reader checks what is in the folder
    try:
        with open(path, "rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise _unreadable(str(path), error) from error
    if not head:
        raise MapError(
            f"{path.name} is empty", "a file with a map", "download or export the file again"
        )
    content = content_of(head)
    if reader.content is not None and content != reader.content:
        raise MapError(
            f"{path.name} holds {content if content != 'unknown' else 'data in an unknown format'}",
            f"{reader.content}, as the suffix of the file name says",
            "give the file name the suffix of its format, or export the file again",
        )


def _unreadable(text: str, error: Exception) -> MapError:
    return MapError(
        f"{text!r} cannot be opened: {reason_of(error)}",
        "a file that you may read",
        "check the path and the permissions",
    )


def _join(items: list[str]) -> str:
    return ", ".join(sorted(items))
