"""Footprints from GeoPackage and Shapefile, read by GDAL.

The kind of content is checked before GDAL sees a file (`sources.content_of`), so that a
virtual format under another name, which may point to the network, is never opened.
"""

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
from evocity.io.computed import check_views
from evocity.io.heights import BUILDING_FIELDS, plain_name
from evocity.io.polygons import CENTER_TAG
from evocity.io.projection import crs_named, flat, is_metric
from evocity.io.sources import Footprints, Request

# names of layers of buildings, in some of the languages that publish them
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
    """Read the buildings of a GeoPackage or Shapefile, of the layer that is named or found."""
    _check_whole(path)
    if path.suffix.lower() == ".gpkg":
        check_views(path)
    polygons, tags, crs, metadata, count = _read(path, _chosen_layer(path, request.layer))
    if crs is None:
        raise MapError(
            f"{path.name} names no reference system",
            "a layer with one (a .prj file beside a Shapefile)",
            "assign it, for example with ogr2ogr -a_srs EPSG:…",
        )
    crs = _crs(path, crs)
    center = _center(path, metadata)
    own = crs if center is not None and is_metric(crs) else None
    bare = center is not None and not count
    return Footprints(polygons, tags, crs, _attribution(metadata), center, own, bare=bare)


def _check_whole(path: Path) -> None:
    """GDAL reads what is left of a Shapefile that was cut off; its header tells its length."""
    if path.suffix.lower() != ".shp":
        return
    with open(path, "rb") as file:
        head = file.read(28)
    told, there = 2 * int.from_bytes(head[24:28]), path.stat().st_size
    if len(head) < 28 or told > there:
        raise MapError(
            f"{path.name} is cut off: {there} bytes",
            f"the {told} bytes its header tells of",
            "copy or download it again",
        )


def _read(path: Path, layer: str):
    """Polygons, their tags, the reference system and the metadata of one layer, and how many
    features it has of any kind."""
    with _gdal_trouble(path):
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


def _chosen_layer(path: Path, wanted: str | None) -> str:
    with _gdal_trouble(path):
        layers = [(str(name), str(kind)) for name, kind in pyogrio.list_layers(path)]
    names = [name for name, _ in layers]
    if wanted is not None:
        if wanted in names:
            return wanted
        raise _which_layer(path, f"no layer {wanted!r}", names)
    with_areas = [name for name, kind in layers if "Polygon" in kind or "Unknown" in kind]
    for candidates in (
        [name for name in with_areas if _BUILDING_NAME.search(name)],
        [name for name in with_areas if _has_building_fields(path, name)],
        with_areas,
    ):
        if len(candidates) == 1:
            return candidates[0]
        if candidates:
            raise _which_layer(path, f"{len(candidates)} layers that may be meant", candidates)
    raise _which_layer(path, "no layer of polygons", names)


def _has_building_fields(path: Path, layer: str) -> bool:
    with _gdal_trouble(path):
        fields = pyogrio.read_info(path, layer=layer)["fields"]
    return not BUILDING_FIELDS.isdisjoint(plain_name(name) for name in fields)


def _which_layer(path: Path, found: str, names: list[str]) -> MapError:
    return MapError(
        f"{path.name} has {found}",
        f"one layer of building footprints; there are: {', '.join(names) or 'none'}",
        f"name the layer with {keyword('layer')}",
    )


def _crs(path: Path, text: str):
    """GDAL gives a code or, where there is none, its own WKT."""
    if text.startswith(("EPSG:", "OGC:", "ESRI:")):
        return crs_named(text, path.name)
    with _gdal_trouble(path):
        return flat(CRS.from_wkt(text))


def _center(path: Path, metadata: Mapping[str, str]) -> tuple[float, float] | None:
    """The middle of the window that evocity wrote the layer for, if it was evocity."""
    told = metadata.get(CENTER_TAG)
    if told is None:
        return None
    try:
        x, y = (float(number) for number in told.split())
    except ValueError:
        x = y = math.nan
    if not (math.isfinite(x) and math.isfinite(y)):
        raise MapError(
            f"{path.name}: {CENTER_TAG} {told[:80]!r} in the metadata",
            "two numbers, longitude and latitude",
            "correct it, or take it out: the middle of the buildings is then taken",
        )
    return x, y


def _attribution(metadata: Mapping[str, str]) -> str:
    for name, value in metadata.items():
        if name.lower() in ("attribution", "copyright") and isinstance(value, str):
            return value
    return ""


@contextmanager
def _gdal_trouble(path: Path) -> Iterator[None]:
    """Turn GDAL's errors about ``path`` into a `MapError`, and keep its warnings quiet."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except _GDAL_ERRORS as error:
        raise MapError(
            f"{path.name} cannot be read: {(str(error).splitlines() or ['damaged'])[0][:200]}",
            "a whole file of the format its name says",
            "download or export it again; it may have been cut off or be incomplete",
        ) from error


__all__ = ["read_layers"]
