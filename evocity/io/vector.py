"""Reader of footprints in GeoPackage and Shapefile, by GDAL, after `reader_types.content_of` has
checked the content: a virtual format under another name may point to the network."""

import math
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
from evocity.io.account import DEGENERATE, EMPTY, NO_POLYGON, Account
from evocity.io.footprint_files import CENTER_TAG
from evocity.io.geopackage_sql import check_views
from evocity.io.heights import (
    BUILDING_FIELDS,
    check_columns,
    has_building_fields,
    is_building_name,
    plain_name,
)
from evocity.io.projection import flat, is_metric, parse_crs, vertical_unit
from evocity.io.reader_types import Footprints, Request
from evocity.io.wkb_areas import Areas

_GDAL_ERRORS = (
    DataSourceError,
    DataLayerError,
    CRSError,
    BadCRS,
    FieldError,
    GeometryError,
    shapely.errors.GEOSException,
    UnicodeDecodeError,
    LookupError,
    ValueError,
)


def read_layers(path: Path, request: Request) -> Footprints:
    """Read the buildings of a GeoPackage or Shapefile: the named layer, or the only fitting one."""
    _check_whole(path)
    if path.suffix.lower() == ".gpkg":
        check_views(path)
    layer = _choose_layer(path, request.layer)
    polygons, tags, crs, metadata, account, fields = _read(path, layer)
    check_columns(path.name, fields, (request.height_column, request.levels_column))
    if crs is None:
        raise MapError(
            f"{path.name} has no reference system",
            "a layer with a reference system (for a Shapefile a .prj file)",
            "assign a reference system, for example with ogr2ogr -a_srs EPSG:…",
        )
    crs, unit = _crs(path, crs)
    center = _center(path, metadata)
    for each in tags:
        if "solid_height" in each:
            each["solid_height"] *= unit
    return Footprints(
        polygons,
        tags,
        crs,
        _attribution(metadata),
        center,
        projection=crs if center is not None and is_metric(crs) else None,
        bare=center is not None and not account.features,
        of_buildings=is_building_name(layer) or has_building_fields(fields),
        height_unit=unit,
        account=account,
    )


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
    """Read polygons, their tags, the reference system, the metadata, the account of all features
    and the names of the columns of a layer."""
    with _gdal_errors(path):
        info = pyogrio.read_info(path, layer=layer)
        (meta, _, shapes, columns), is_guessed = _read_columns(path, layer, info)
        polygons, remarks, extents = _areas(shapes)
    fields = [str(name) for name in meta["fields"]]
    account = Account(len(shapes))
    if is_guessed:
        account.remark("with texts in another encoding than the file says", len(shapes))
    for number, remark in remarks:
        account.remark(remark, number)
    kinds = shapely.get_type_id(polygons)
    areas = np.isin(kinds, (3, 6))  # polygons and multipolygons
    lost = np.array([each == DEGENERATE for each in extents], dtype=bool)
    account.drop(DEGENERATE, int(lost.sum()))
    account.drop(EMPTY, int((~lost & ~areas & shapely.is_empty(polygons)).sum()))
    account.drop(NO_POLYGON, int((~lost & ~areas & ~shapely.is_empty(polygons)).sum()))
    kept = np.flatnonzero(areas & ~lost)
    tags = []
    for i in kept.tolist():
        own = {name: column[i] for name, column in zip(fields, columns, strict=True)}
        tags.append(own | ({"solid_height": extents[i]} if extents[i] else {}))
    metadata = (info.get("dataset_metadata") or {}) | (info.get("layer_metadata") or {})
    return polygons[kept], tags, meta["crs"], metadata, account, fields


def _read_columns(path: Path, layer: str, info: dict):
    """Read a layer; if its texts are not in the encoding that the file states, also return True.
    A Shapefile is then read as ISO 8859-1, in which all bytes are letters; a GeoPackage without its
    columns of text."""
    try:
        return pyogrio.raw.read(path, layer=layer), False
    except (UnicodeDecodeError, LookupError):
        if path.suffix.lower() == ".shp":
            return pyogrio.raw.read(path, layer=layer, encoding="ISO-8859-1"), True
        kinds = zip(info["fields"], info["dtypes"], strict=True)
        plain = [str(name) for name, kind in kinds if kind != "object"]
        return pyogrio.raw.read(path, layer=layer, columns=plain), True


def _areas(shapes: np.ndarray):
    """Convert WKB to areas seen from above. Return them, remarks as (count, text), and for each
    shape its extent in z if it is a solid, the text `DEGENERATE` if no ring of it is left, else
    0."""
    polygons = shapely.from_wkb(shapes, on_invalid="ignore")
    extents: list[float | str] = [0.0] * len(shapes)
    missing = shapely.is_missing(polygons)
    dropped = 0
    kinds = shapely.get_type_id(polygons)
    for at in np.flatnonzero(missing | (kinds == 7)):
        if shapes[at] is None:
            continue
        areas = Areas(bytes(shapes[at]))
        if areas.faces:
            polygons[at], extents[at] = areas.area, areas.extent
            dropped += areas.degenerate
        elif areas.degenerate:
            extents[at] = DEGENERATE
    return shapely.force_2d(polygons), [(dropped, "degenerate rings left out")], extents


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
        [name for name in with_areas if is_building_name(name)],
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


def _crs(path: Path, text: str) -> tuple[CRS, float]:
    """Parse a reference system; return its horizontal part, and the metres of a unit of height."""
    if text.startswith(("EPSG:", "OGC:", "ESRI:")):
        crs = parse_crs(text, path.name)
        return crs, vertical_unit(CRS.from_user_input(text))
    with _gdal_errors(path):
        full = CRS.from_wkt(text)
        return flat(full), vertical_unit(full)


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
