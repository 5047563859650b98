"""`read_map`: which reader, which window; and the table of readers."""

import dataclasses
import numbers
import os
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path

from evocity.citymap import MAX_SIDE, PIXEL_SIDES, CityMap
from evocity.errors import MapError, keyword, setting
from evocity.io import bundled
from evocity.io.burning import burnt
from evocity.io.resampling import gridded
from evocity.io.sources import Footprints, Grid, Reader, Request, content_of
from evocity.plugins import load_plugins, origin_of

_PLAIN, _LAYERED, _SCALED = frozenset(), frozenset({"layer"}), frozenset({"height_scale"})


class _Late:
    # A reader of a module of this room, which is loaded with the first file that it reads, or when
    # it is asked what it is; and the library of that format with it.

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


_read_layers, _read_osm = _Late("vector", "read_layers"), _Late("osm", "read_osm")
_JSON = Reader(_Late("geojson", "read_json"), "JSON", _PLAIN)
_PBF = Reader(_read_osm, "OSM PBF", _PLAIN)
_TIFF = Reader(_Late("raster", "read_geotiff"), "TIFF", _SCALED)

#: The one table of readers. Packages add rows by entry points of the group
#: ``evocity.readers``: the name is the suffix, the object a `Reader` or a function
#: ``(path, request) -> Footprints | Grid``.
READERS: dict[str, Reader] = {
    ".geojson": _JSON,
    ".json": _JSON,
    ".city.json": _JSON,
    ".cityjson": _JSON,
    ".gpkg": Reader(_read_layers, "SQLite (GeoPackage)", _LAYERED),
    ".shp": Reader(_read_layers, "Shapefile", _LAYERED),
    ".osm": Reader(_read_osm, "OSM XML", _PLAIN),
    ".osm.gz": Reader(_read_osm, "gzip", _PLAIN),
    ".osm.bz2": Reader(_read_osm, "bzip2", _PLAIN),
    ".osm.pbf": _PBF,
    ".pbf": _PBF,
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".png": Reader(_Late("raster", "read_png"), "PNG", _SCALED),
    ".npy": Reader(_Late("raster", "read_npy"), "NPY", _SCALED),
}


#: Letters of an attribution, at most.
MOST_CREDIT = 1000

_PARQUET = (
    "of GeoParquet, export GeoPackage or GeoJSON; of a genome, `evocity decode` makes a map first"
)

#: What to do with files that are no maps, but are often taken for some.
_REMEDIES = {
    ".parquet": _PARQUET,
    ".geoparquet": _PARQUET,
    ".toml": "a recipe is carried out by `evocity run`",
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
    name: str | None = None,
    attribution: str | None = None,
) -> CityMap:
    """Read a map from a file, or one of the districts that `cities` lists.

    Parameters
    ----------
    source : a path, or the name of a bundled district. The suffix chooses the reader
        (`READERS`): GeoJSON, CityJSON, GeoPackage, Shapefile, OSM XML and PBF, GeoTIFF, PNG,
        NPY.
    pixels : side of the square window. Footprints: 256. A raster: its own extent.
    metres_per_pixel : side of a pixel, metres. Footprints: 2.0. GeoTIFF: its own. PNG and
        NPY do not say it themselves: it is required.
    center : (longitude, latitude) of the window. Else the ``window`` member of a GeoJSON, else
        the middle of the buildings' bounds, or of the raster.
    layer : which layer of a GeoPackage, if the one of the buildings cannot be told.
    default_height : metres of a building whose height no rule tells (see `evocity.io.heights`).
    height_scale : metres of one grey level (PNG: required), or of one unit (GeoTIFF, NPY).
    name : what to call the map; else its district, or the file's name.
    attribution : the line that the licence of a file's source asks for, 1000 letters at most, in
        place of what the file says. A bundled district keeps its own.

    Returns
    -------
    CityMap : in true metres. Footprints are projected to the file's own projection in metres,
        else to a transverse Mercator about the center; rasters keep their pixels where these
        are square, in true metres, and no others are asked for.

    Raises
    ------
    MapError : whatever is wrong with the file or the window.
    """
    request = Request(
        pixels=_count(pixels),
        metres_per_pixel=_positive("metres_per_pixel", metres_per_pixel),
        center=_place(center),
        layer=layer,
        default_height=_positive("default_height", default_height),
        height_scale=_positive("height_scale", height_scale),
        name=name,
    )
    data, stem = data_of(source, request)
    if attribution is not None and not _found(source)[1]:
        data = dataclasses.replace(data, attribution=_line("attribution", attribution))
    if isinstance(data, Footprints):
        return burnt(data, request, name or stem)
    return gridded(data, request, name or data.name or stem)


def data_of(source: str | os.PathLike, request: Request) -> tuple[Footprints | Grid, str]:
    """What a file or a bundled district holds, as its reader hands it over, and its name without
    suffix. Raises `MapError` as `read_map`."""
    path, attribution = _found(source)
    suffix, reader = _reader_of(path)
    _check_options(path, suffix, reader, request)
    _check_content(path, reader)
    data = reader.read(path, request)
    if attribution:
        data = dataclasses.replace(data, attribution=attribution)
    return data, path.name[: -len(suffix)]


def name_of(source: str | os.PathLike) -> str:
    """What `read_map` calls a map unless told otherwise: as the file itself does, which only
    GeoTIFF can, else the file's name without suffix. Raises `MapError` as `read_map`."""
    path, _ = _found(source)
    suffix, reader = _reader_of(path)
    own = data_of(source, Request())[0].name if reader is _TIFF else None
    return own or path.name[: -len(suffix)]


def options_of(source: str | os.PathLike) -> frozenset[str]:
    """Which of ``layer`` and ``height_scale`` mean something to the reader of a file."""
    return _reader_of(_found(source)[0])[1].takes


def suffixes() -> list[str]:
    """Suffixes that can be read, those of installed packages included."""
    return sorted({*READERS, *_from_plugins()[0]})


def readers() -> dict[str, tuple[Reader, str]]:
    """All readers by suffix, each with where it comes from: "evocity", or a plugin's package and
    version."""
    ours = {suffix: (reader, "evocity") for suffix, reader in READERS.items()}
    found, _, origins = _from_plugins()
    return ours | {suffix: (found[suffix], origins[suffix]) for suffix in found}


def plugin_warnings() -> tuple[str, ...]:
    """One text for each entry point of the group ``evocity.readers`` that could not be loaded."""
    return _from_plugins()[1]


@cache
def _from_plugins() -> tuple[dict[str, Reader], tuple[str, ...], dict[str, str]]:
    """Readers of other packages by suffix, what is wrong with those left out, and where each is
    from."""
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


def _line(name: str, text: object) -> str:
    """A ``text`` to be shown. Raises `MapError` for what is none."""
    if not isinstance(text, str) or not text.strip() or len(text) > MOST_CREDIT:
        raise MapError(
            setting(name, text),
            f"a text of 1 to {MOST_CREDIT} letters",
            f"leave {keyword(name)} out where the file tells it",
        )
    return text.strip()


def _found(source: str | os.PathLike) -> tuple[Path, str]:
    """The file, and the attribution of a bundled one."""
    text = os.fspath(source)
    if text in bundled.cities():
        return bundled.path_of(text), bundled.attribution_of(text)
    path = Path(text)
    try:
        if path.is_dir():
            if (path / "provenance.json").is_file():
                raise MapError(
                    f"{text!r} is a folder, that of a run",
                    "a map file",
                    "make a map of one individual first: evocity decode RUN --id N -o MAP.tif",
                )
            raise MapError(
                f"{text!r} is a folder", "a file", f"name a file in it: {_listed(suffixes())}"
            )
        if not path.is_file():
            if not path.suffix and path.parent == Path():
                bundled.path_of(text)  # raises, and lists the districts
            raise MapError(
                f"no file {text!r}"
                + ("" if path.parent.is_dir() else f": there is no folder {str(path.parent)!r}"),
                "an existing file, or the name of a bundled city",
                "check the path; `evocity cities` lists the bundled ones",
            )
    except (OSError, ValueError) as error:
        raise _unreadable(text, error) from error
    return path, ""


def _reader_of(path: Path) -> tuple[str, Reader]:
    """The row of the longest suffix the file's name ends with."""
    lower = path.name.lower()
    fitting = [suffix for suffix in suffixes() if lower.endswith(suffix) and lower != suffix]
    if not fitting:
        raise MapError(
            "; ".join(
                [
                    f"{path.name}: nothing reads {path.suffix or 'a file without a suffix'}",
                    *plugin_warnings(),
                ]
            ),
            f"a file that ends in {_listed(suffixes())}",
            _REMEDIES.get(
                path.suffix.lower(),
                "convert it to one of these; GeoJSON and GeoTIFF are the easiest to check",
            ),
        )
    suffix = max(fitting, key=len)
    return suffix, READERS.get(suffix) or _from_plugins()[0][suffix]


def _check_options(path: Path, suffix: str, reader: Reader, request: Request) -> None:
    for option in ("layer", "height_scale"):
        if getattr(request, option) is not None and option not in reader.takes:
            takers = [s for s in READERS if option in READERS[s].takes]
            raise MapError(
                f"{path.name}: {keyword(option)} means nothing for {suffix}",
                f"{keyword(option)} only with {_listed(takers)}",
                f"leave {keyword(option)} out",
            )


def _check_content(path: Path, reader: Reader) -> None:
    try:
        with open(path, "rb") as file:
            head = file.read(4096)
    except OSError as error:
        raise _unreadable(str(path), error) from error
    if not head:
        raise MapError(f"{path.name} is empty", "a map", "download or export it again")
    content = content_of(head)
    if reader.content is not None and content != reader.content:
        raise MapError(
            f"{path.name} holds {content if content != 'unknown' else 'something else'}",
            f"{reader.content}, as its name says",
            "give the file the suffix of what it holds, or export it again",
        )


def _unreadable(text: str, error: Exception) -> MapError:
    reason = getattr(error, "strerror", None) or error
    return MapError(
        f"{text!r} cannot be opened: {reason}",
        "a file this user may read",
        "check the path and the permissions",
    )


def _listed(items: list[str]) -> str:
    return ", ".join(sorted(items))


def _count(pixels: object) -> int | None:
    if pixels is None:
        return None
    whole = isinstance(pixels, numbers.Integral) and not isinstance(pixels, bool)
    if not whole or not 1 <= pixels <= MAX_SIDE:
        raise MapError(
            setting("pixels", pixels),
            f"a whole number from 1 to {MAX_SIDE}",
            f"give the side of the square window in pixels, for example {keyword('pixels', 256)}",
        )
    return int(pixels)


def _positive(option: str, value: object) -> float | None:
    if value is None and option != "default_height":
        return None
    number = isinstance(value, numbers.Real) and not isinstance(value, bool)
    low, high = PIXEL_SIDES  # heights lie within these too
    if not number or not low <= value <= high:
        raise MapError(
            setting(option, value),
            f"a positive number of metres, {low:g} to {high:g}",
            f"correct {keyword(option)}, or leave it out",
        )
    return float(value)


def _place(center: object) -> tuple[float, float] | None:
    if center is None:
        return None
    try:
        lon, lat = (float(value) for value in center)
        if abs(lon) <= 180 and abs(lat) < 90:
            return lon, lat
    except (TypeError, ValueError):
        pass
    raise MapError(
        setting("center", center),
        "(longitude, latitude) in degrees, longitude first, within ±180 and ±90",
        "give the place as two numbers, for example " + keyword("center", (4.8344, 45.7685)),
    )


__all__ = ["READERS", "data_of", "options_of", "plugin_warnings", "read_map", "readers", "suffixes"]
