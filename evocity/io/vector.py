"""Reader of footprints in GeoPackage and Shapefile, by GDAL, after `reader_types.content_of` has
checked the content: a virtual format under another name may point to the network."""

import math
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pyogrio
import shapely
from pyogrio.errors import CRSError, DataLayerError, DataSourceError, FieldError, GeometryError
from pyproj import CRS
from pyproj.exceptions import CRSError as BadCRS

from evocity.errors import MapError, keyword
from evocity.io.footprint_files import CENTER_TAG
from evocity.io.geopackage_sql import check_views
from evocity.io.heights import BUILDING_FIELDS, plain_name
from evocity.io.projection import flat, is_metric, parse_crs
from evocity.io.reader_types import Footprints, Request

# names of layers of buildings in several languages
_BUILDING_NAME = re.compile(
    r"build|footprint|b[aâ]ti|geb(ae|ä)ude|edific|edifíc|pand|edifici|budov|budyn|здан", re.I
)

_GDAL_ERRORS = (
    DataSourceError,
    DataLayerError,
    CRSError,
    BadCRS,
    FieldError,
    GeometryError,
    shapely.errors.GEOSException,
    UnicodeDecodeError,
)


def read_layers(path: Path, request: Request) -> Footprints:
    """Read the buildings of a GeoPackage or Shapefile: the named layer, or the only fitting one."""
    _check_whole(path)
    if path.suffix.lower() == ".gpkg":
        check_views(path)
    polygons, tags, crs, metadata, count = _read(path, _choose_layer(path, request.layer))
    if crs is None:
        raise MapError(
            f"{path.name} has no reference system",
            "a layer with a reference system (for a Shapefile a .prj file)",
            "assign a reference system, for example with ogr2ogr -a_srs EPSG:…",
        )
    crs = _crs(path, crs)
    center = _center(path, metadata)
    own = crs if center is not None and is_metric(crs) else None
    bare = center is not None and not count
    return Footprints(polygons, tags, crs, _attribution(metadata), center, own, bare=bare)


def _check_whole(path: Path) -> None:
    """Raise `MapError` for a Shapefile shorter than its header says: GDAL reads the rest of it."""
    if path.suffix.lower() != ".shp":
        return
    with open(path, "rb") as file:
        head = file.read(28)
    whole, size = 2 * int.from_bytes(head[24:28]), path.stat().st_size
    if len(head) < 28 or whole > size:
        raise MapError(
            f"{path.name} is cut off: it has {size} bytes",
            f"a file of {whole} bytes, as the header of the file says",
            "copy or download the file again",
        )


def _read(path: Path, layer: str):
    """Read polygons, their tags, the reference system and the metadata of a layer, and its number
    of features of any kind."""
    with _gdal_errors(path):
        info = pyogrio.read_info(path, layer=layer)
        meta, _, shapes, columns = pyogrio.raw.read(path, layer=layer, force_2d=True)
        polygons = shapely.from_wkb(shapes)
    kinds = shapely.get_type_id(polygons)
    kept = np.flatnonzero(np.isin(kinds, (3, 6)))  # polygons and multipolygons
    fields = [str(name) for name in meta["fields"]]
    tags = [
        {name: column[i] for name, column in zip(fields, columns, strict=True)}
        for i in kept.tolist()
    ]
    metadata = (info.get("dataset_metadata") or {}) | (info.get("layer_metadata") or {})
    return polygons[kept], tags, meta["crs"], metadata, len(shapes)


def _choose_layer(path: Path, requested: str | None) -> str:
    with _gdal_errors(path):
        layers = [(str(name), str(kind)) for name, kind in pyogrio.list_layers(path)]
    names = [name for name, _ in layers]
    if requested is not None:
        if requested in names:
            return requested
        raise _layer_error(path, f"no layer {requested!r}", names)
    with_areas = [name for name, kind in layers if "Polygon" in kind or "Unknown" in kind]
    for candidates in (
        [name for name in with_areas if _BUILDING_NAME.search(name)],
        [name for name in with_areas if _has_building_fields(path, name)],
        with_areas,
    ):
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            raise _layer_error(
                path, f"{len(candidates)} layers that may hold buildings", candidates
            )
    raise _layer_error(path, "no layer of polygons", names)


def _has_building_fields(path: Path, layer: str) -> bool:
    with _gdal_errors(path):
        fields = pyogrio.read_info(path, layer=layer)["fields"]
    return not BUILDING_FIELDS.isdisjoint(plain_name(name) for name in fields)


def _layer_error(path: Path, problem: str, names: list[str]) -> MapError:
    return MapError(
        f"{path.name} has {problem}",
        f"one layer of building footprints; the file has the layers: {', '.join(names) or 'none'}",
        f"name the layer with {keyword('layer')}",
    )


def _crs(path: Path, text: str):
    if text.startswith(("EPSG:", "OGC:", "ESRI:")):
        return parse_crs(text, path.name)
    with _gdal_errors(path):
        return flat(CRS.from_wkt(text))


def _center(path: Path, metadata: Mapping[str, str]) -> tuple[float, float] | None:
    """Read the middle of the window from a layer that evocity wrote; None for other layers."""
    text = metadata.get(CENTER_TAG)
    if text is None:
        return None
    try:
        x, y = (float(number) for number in text.split())
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise MapError(
            f"{path.name}: the metadata entry {CENTER_TAG} = {text[:80]!r} is invalid",
            "two numbers, longitude and latitude",
            "correct this entry, or remove it to use the middle of the buildings",
        )
    return x, y


def _attribution(metadata: Mapping[str, str]) -> str:
    for name, value in metadata.items():
        if name.lower() in ("attribution", "copyright") and isinstance(value, str):
            return value
    return ""


@contextmanager
def _gdal_errors(path: Path) -> Iterator[None]:
    """Turn GDAL's errors about ``path`` into a `MapError`, and hide its warnings."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except _GDAL_ERRORS as error:
        raise MapError(
            f"{path.name} cannot be read: {(str(error).splitlines() or ['damaged'])[0][:200]}",
            "a complete file of the format that its suffix names",
            "download or export the file again; it may be cut off or incomplete",
        ) from error
