"""Reader of footprints in GeoPackage, Shapefile, FlatGeobuf and File GDB, by GDAL, after
`reader_types.content_of` has checked the content: a virtual format under another name may point to
the network."""

import os
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

from evocity.errors import MapError
from evocity.io.account import OUTSIDE, Account
from evocity.io.footprint_files import CENTER_TAG, read_center
from evocity.io.geopackage_sql import check_views
from evocity.io.heights import (
    BUILDING_FIELDS,
    check_columns,
    has_building_fields,
    is_building_name,
    plain_name,
)
from evocity.io.layer_choice import choose_layer
from evocity.io.projection import flat, identify, is_metric, parse_crs, plane, vertical_unit
from evocity.io.reader_types import Footprints, Request
from evocity.io.window_box import SMALL, Box, empty_window_error, window_box
from evocity.io.wkb_areas import choose_areas, read_areas

#: GDAL's driver for each suffix; another driver that takes such a file may follow references.
DRIVERS = {
    ".gpkg": "GPKG",
    ".shp": "ESRI Shapefile",
    ".fgb": "FlatGeobuf",
    ".gdb": "OpenFileGDB",
}

# Files beside a Shapefile that GDAL may open.
_SHAPEFILE = (
    *(".dbf", ".shx", ".prj", ".qpj", ".cpg", ".cst", ".qix", ".sbn", ".sbx", ".idm", ".ind"),
    *(".shp.xml", ".shz", ".aux.xml", ".shp.aux.xml"),
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
    LookupError,
    ValueError,
)


def read_layers(path: Path, request: Request) -> Footprints:
    """Read the buildings of a file that GDAL reads: the named layer, or the only fitting one. If
    the request names a centre, GDAL leaves out features of a large layer that do not meet the
    window."""
    path = _place(path)
    if path.suffix.lower() == ".shp":
        _check_shapefile(path)
    if path.suffix.lower() == ".gpkg":
        check_views(path)
    if path.is_dir():
        _check_geodatabase(path)
    layer = _choose_layer(path, request.layer)
    polygons, tags, crs, metadata, account, fields, note = _read(path, layer, request)
    check_columns(path.name, fields, (request.height_column, request.levels_column))
    if crs is None and CENTER_TAG in metadata:
        crs = plane().to_wkt()
    if crs is None:
        raise MapError(
            f"{path.name} has no reference system",
            "a layer with a reference system (for a Shapefile a .prj file)",
            "assign a reference system, for example with ogr2ogr -a_srs EPSG:…",
        )
    crs, unit = _crs(path, crs)
    center = read_center(path, metadata)
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
        note=note,
    )


def layer_extent(path: Path, layer: str | None, large: int):
    """Measure the layer of buildings by the index of the file, without reading its features.

    Returns
    -------
    count, bounds, crs, first : number of features, their bounds and reference system, and the
        middle of the first feature. ``bounds`` is None for a layer of at most ``large`` features,
        and for a file without an index.
    """
    path = _place(path)
    if path.suffix.lower() == ".gpkg":
        check_views(path)
    with _gdal_errors(path):
        layer = _choose_layer(path, layer)
        info = pyogrio.read_info(path, layer=layer)
        count, bounds = int(info["features"]), info["total_bounds"]
        is_indexed = info["driver"] == DRIVERS[path.suffix.lower()] and bounds is not None
        if not is_indexed or count <= large or not info["crs"] or not np.isfinite(bounds).all():
            return count, None, None, None
        _, _, shapes, _ = pyogrio.raw.read(path, layer=layer, max_features=1, columns=[])
        west, south, east, north = shapely.bounds(shapely.from_wkb(shapes[0]))
    crs, _ = _crs(path, info["crs"])
    return count, np.array(bounds), crs, ((west + east) / 2, (south + north) / 2)


def _place(path: Path) -> Path:
    """Return the absolute path, which has no scheme of an address; raises `MapError` for a path
    that GDAL would take for a place in an archive."""
    path = path.absolute()
    if "!" in str(path) or str(path).startswith("/vsi"):
        raise MapError(
            f"GDAL reads the path {str(path)!r} as a place in an archive",
            "a path without '!' that does not begin with /vsi",
            "rename the file or its folder",
        )
    return path


def _check_geodatabase(path: Path) -> None:
    """Raise `MapError` for a folder that is not a File GDB, or has links or folders in it."""
    with os.scandir(path) as entries:
        strange = [entry.name for entry in entries if not entry.is_file(follow_symlinks=False)]
    if strange or path.is_symlink():
        raise MapError(
            f"{path.name} holds a link or a folder: {strange[0] if strange else path.name}",
            "a File GDB, a folder of plain files",
            "copy the geodatabase again from its source",
        )
    if not (path / "a00000001.gdbtable").is_file():
        raise MapError(
            f"{path.name} is a folder without a geodatabase in it",
            "a File GDB, with a file a00000001.gdbtable",
            "copy the whole folder again from its source",
        )


def _check_shapefile(path: Path) -> None:
    """Raise `MapError` for a Shapefile shorter than its header says: GDAL reads the rest of it. A
    part of it that is a link or not a regular file could name another file, or block."""
    stem = path.stem.lower()
    parts = {stem + suffix for suffix in _SHAPEFILE}
    with os.scandir(path.parent) as entries:
        beside = [entry for entry in entries if entry.name.lower() in parts]
        strange = [part.name for part in beside if not part.is_file(follow_symlinks=False)]
    if strange:
        raise MapError(
            f"{strange[0]}, a part of the Shapefile, is a link or not a regular file",
            "a Shapefile of plain files",
            "copy all files of the Shapefile again from their source",
        )
    with open(path, "rb") as file:
        head = file.read(28)
    whole, size = 2 * int.from_bytes(head[24:28]), path.stat().st_size
    if len(head) < 28 or whole > size:
        raise MapError(
            f"{path.name} is cut off: it has {size} bytes",
            f"a file of {whole} bytes, as the header of the file says",
            "copy or download the file again",
        )


def _read(path: Path, layer: str, request: Request):
    """Read polygons, their tags, the reference system, the metadata, the account of all features,
    the names of the columns of a layer, and a note about the reading."""
    with _gdal_errors(path):
        info = pyogrio.read_info(path, layer=layer, force_feature_count=True)
        if info["driver"] != DRIVERS[path.suffix.lower()]:
            raise DataSourceError(f"GDAL takes it for {info['driver']}")
        box, count = None, int(info["features"])
        if count > SMALL and info["crs"]:
            box = window_box(request, _crs(path, info["crs"])[0])
        (meta, _, shapes, columns), is_guessed = _read_columns(path, layer, info, box)
        if box is not None and not len(shapes):
            bounds = pyogrio.read_info(path, layer=layer, force_total_bounds=True)["total_bounds"]
            crs, _ = _crs(path, info["crs"])
            raise empty_window_error(path.name, request, crs, count, bounds)
        polygons, rings, extents = read_areas(shapes)
    fields = [str(name) for name in meta["fields"]]
    account = Account(len(shapes) if box is None else max(count, len(shapes)))
    account.drop(OUTSIDE, account.features - len(shapes))
    if is_guessed:
        account.remark("with texts in another encoding than the file says", len(shapes))
    kept = choose_areas(polygons, rings, account)
    tags = []
    for i in kept.tolist():
        own = {name: column[i] for name, column in zip(fields, columns, strict=True)}
        tags.append(own | ({"solid_height": float(extents[i])} if extents[i] else {}))
    metadata = (info.get("dataset_metadata") or {}) | (info.get("layer_metadata") or {})
    note = ""
    if box is not None and not info["capabilities"]["fast_spatial_filter"]:
        note = (
            f"; the file has no spatial index, so GDAL read all {count} features; an index makes "
            "this faster"
        )
    return polygons[kept], tags, meta["crs"], metadata, account, fields, note


def _read_columns(path: Path, layer: str, info: dict, box: Box | None):
    """Read the features of a layer that meet ``box``, by default all; if its texts are not in the
    encoding that the file states, also return True. A Shapefile is then read as ISO 8859-1, in
    which all bytes are letters; another file without its columns of text."""
    try:
        return pyogrio.raw.read(path, layer=layer, bbox=box), False
    except (UnicodeDecodeError, LookupError):
        if path.suffix.lower() == ".shp":
            return pyogrio.raw.read(path, layer=layer, bbox=box, encoding="ISO-8859-1"), True
        kinds = zip(info["fields"], info["dtypes"], strict=True)
        plain = [str(name) for name, kind in kinds if kind != "object"]
        return pyogrio.raw.read(path, layer=layer, bbox=box, columns=plain), True


def _choose_layer(path: Path, requested: str | None) -> str:
    with _gdal_errors(path):
        layers = [(str(name), str(kind)) for name, kind in pyogrio.list_layers(path)]
    names = [name for name, _ in layers]
    with_areas = [name for name, kind in layers if "Polygon" in kind or "Unknown" in kind]
    of_buildings = dict.fromkeys(with_areas, False)
    named = any(is_building_name(name) for name in with_areas)
    if requested is None and len(with_areas) > 1 and not named:
        of_buildings = {name: _has_building_fields(path, name) for name in with_areas}
    return choose_layer(path.name, of_buildings, requested, names)


def _has_building_fields(path: Path, layer: str) -> bool:
    with _gdal_errors(path):
        fields = pyogrio.read_info(path, layer=layer)["fields"]
    return not BUILDING_FIELDS.isdisjoint(plain_name(name) for name in fields)


def _crs(path: Path, text: str) -> tuple[CRS, float]:
    """Parse a reference system; return its horizontal part, and the metres of a unit of height."""
    if text.startswith(("EPSG:", "OGC:", "ESRI:")):
        crs = parse_crs(text, path.name)
        return crs, vertical_unit(CRS.from_user_input(text))
    with _gdal_errors(path):
        full = CRS.from_wkt(text)
        return identify(flat(full)), vertical_unit(full)


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
