"""The table of a library's folder, a GeoPackage: an object in each row, checked on reading."""

import math
import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import shapely

from evocity.errors import MapError
from evocity.files import whole_file
from evocity.io.export.styles import add_styles, height_style
from evocity.pictures.colours import roofs_end
from evocity.views.walls.coverage import find_pinched

#: The table of a library's folder, and its layer.
TABLE, LAYER = "objects.gpkg", "objects"
#: The columns of the table besides the footprint; the last two are optional.
COLUMNS = ("id", "class", "height", "atmosphere", "licence", "attribution", "attached")
#: The greatest height of an object, metres: as for `read_map`.
TALLEST = 1000.0

_NEEDED = ("id", "class", "height", "atmosphere", "licence")
# Metres without a place on Earth.
_METRES = (
    'ENGCRS["metres of a library of objects",EDATUM["none"],CS[Cartesian,2],'
    'AXIS["x",east],AXIS["y",north],LENGTHUNIT["metre",1]]'
)
# Metres between objects in the table's layout.
_APART = 5.0


def read_table(folder: Path) -> tuple[np.ndarray, dict[str, list | np.ndarray]]:
    """Read the valid polygons of the objects in a library's ``folder``, and its `COLUMNS` by name.

    Raises `MapError` as `Library.read`.
    """
    path = folder / TABLE
    shapes, fields, crs = _layer(folder, path)
    _check_metres(path, crs)
    missing = [name for name in _NEEDED if name not in fields]
    if missing:
        raise MapError(
            f"{path}: these columns are missing: {', '.join(missing)}",
            f"the columns {', '.join(_NEEDED)}",
            "add the missing columns; evocity library new makes a table with all columns",
        )
    ids = _texts(fields["id"])
    check_ids(ids, str(path))
    count = len(ids)
    names = [f"{path}: object {one}" for one in ids]
    empty = np.full(count, "", dtype=object)
    _check_no_meshes(fields.get("path", empty), names)
    attached = fields.get("attached", np.zeros(count, bool))
    columns = {
        "id": ids,
        "class": _required_texts(fields["class"], names, "class", "building, or another class"),
        "height": _heights(fields["height"], names),
        "atmosphere": _texts(fields["atmosphere"]),
        "licence": _required_texts(
            fields["licence"], names, "licence", "the licence it may be used under"
        ),
        "attribution": _texts(fields.get("attribution", empty)),
        "attached": np.array([one in (True, 1) for one in attached], bool),
    }
    return _check_polygons(shapes, names), columns


def write_table(folder: Path, polygons: np.ndarray, columns: dict[str, Sequence]) -> Path:
    """Write a table into a ``folder`` as `Library.write`; return its path."""
    kinds = {"height": float, "attached": bool}
    import pyogrio  # which loads pandas, if it is there

    fields = [np.array(columns[name], dtype=kinds.get(name, object)) for name in COLUMNS]
    thanks = "; ".join(sorted(set(columns["attribution"]) - {""}))
    try:
        folder.mkdir(exist_ok=True)
        with whole_file(folder / TABLE) as temporary, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # GDAL warns of an empty layer
            pyogrio.raw.write(
                temporary,
                geometry=shapely.to_wkb(_lay_out(polygons)),
                field_data=fields,
                fields=list(COLUMNS),
                layer=LAYER,
                driver="GPKG",
                geometry_type="Polygon",
                crs=_METRES,
                dataset_options={"VERSION": "1.2"},
                layer_options={"DESCRIPTION": thanks},
            )
            highest = roofs_end(np.array(columns["height"], dtype=float))
            add_styles(temporary, [(LAYER, "heights", height_style(highest), True)])
    except _file_errors() as error:
        raise MapError(
            f"{str(folder / TABLE)!r} cannot be written: {error}",
            "a folder that you may write to, inside an existing folder",
            "check the path, permissions and free space, or choose another folder",
        ) from error
    return folder / TABLE


def check_ids(ids: Sequence[str], where: str) -> None:
    """Raise `MapError` for a missing or repeated id."""
    seen = set()
    for number, one in enumerate(ids, 1):
        if not one:
            raise MapError(
                f"{where}: row {number} has no id", "an id in each row", "write an id into this row"
            )
        if one in seen:
            raise MapError(
                f"{where}: id {one} occurs twice",
                "a different id for each object",
                "change one of the two ids",
            )
        seen.add(one)


def _lay_out(polygons: np.ndarray) -> np.ndarray:
    laid = np.empty(len(polygons), object)
    if not len(polygons):
        return laid
    west, south, east, north = shapely.bounds(polygons).T
    wide = east - west + _APART
    row = math.sqrt(float((wide * (north - south + _APART)).sum())) * 1.2
    x = y = deep = 0.0
    for k, polygon in enumerate(polygons):
        if x and x + wide[k] > row:
            x, y, deep = 0.0, y - deep - _APART, 0.0
        at = np.round([x - west[k], y - north[k]], 3)
        laid[k] = shapely.transform(polygon, lambda points, at=at: points + at)
        x, deep = x + wide[k], max(deep, north[k] - south[k])
    return laid


def _layer(folder: Path, path: Path) -> tuple[np.ndarray, dict[str, np.ndarray], str | None]:
    """Read the footprints as WKB, the columns by name, and the reference system."""
    import pyogrio

    from evocity.io.geopackage_sql import check_views
    from evocity.io.reader_types import content_of

    if not path.is_file():
        what = "no table in it" if folder.is_dir() else "no such folder"
        raise MapError(
            f"{str(folder)!r}: {what}",
            f"the folder of a library, which contains {TABLE}",
            "make a library with: evocity library new MAP… -o FOLDER",
        )
    try:
        with open(path, "rb") as file:
            content = content_of(file.read(1024))
        if content != "SQLite (GeoPackage)":
            raise MapError(
                f"{path} holds {content}", "a GeoPackage", "export the table again as a GeoPackage"
            )
        check_views(path)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if LAYER not in [str(name) for name, _ in pyogrio.list_layers(path)]:
                raise MapError(
                    f"{path}: there is no layer {LAYER!r}",
                    f"a layer with the name {LAYER!r}",
                    "give this name to the layer of objects",
                )
            meta, _, shapes, columns = pyogrio.raw.read(path, layer=LAYER, force_2d=True)
    except (*_file_errors(), UnicodeDecodeError) as error:
        raise MapError(
            f"{path} cannot be read: {[*str(error).splitlines(), 'it is damaged'][0][:200]}",
            "a complete GeoPackage",
            "make or export the file again; it may be cut off",
        ) from error
    if shapes is None:
        raise MapError(
            f"{path}: the layer {LAYER!r} has no footprints",
            "a polygon for each object",
            "export the table again, with the geometry of the objects",
        )
    return shapes, dict(zip(map(str, meta["fields"]), columns, strict=True)), meta["crs"]


def _file_errors() -> tuple[type[Exception], ...]:
    from pyogrio.errors import DataLayerError, DataSourceError, FeatureError, GeometryError
    from pyproj.exceptions import CRSError

    return DataSourceError, DataLayerError, FeatureError, GeometryError, CRSError, OSError


def _check_metres(path: Path, crs: str | None) -> None:
    if crs is None:
        return
    from pyproj import CRS
    from pyproj.exceptions import CRSError

    try:
        axes = CRS.from_user_input(crs).axis_info
    except CRSError:
        axes = []
    if any(not math.isclose(axis.unit_conversion_factor, 1.0) for axis in axes[:2]):
        raise MapError(
            f"{path}: the footprints are in {axes[0].unit_name}",
            "footprints in metres",
            "project the footprints to a reference system in metres first",
        )


def _check_polygons(shapes: np.ndarray, names: Sequence[str]) -> np.ndarray:
    polygons = shapely.from_wkb(shapes, on_invalid="ignore")
    wanted = "a closed polygon that does not cross itself, metres"
    for polygon, name in zip(polygons, names, strict=True):
        if polygon is not None and polygon.geom_type == "MultiPolygon" and len(polygon.geoms) == 1:
            polygon = polygon.geoms[0]
        kind = "ring that is open" if polygon is None else polygon.geom_type
        if kind != "Polygon":
            raise MapError(f"{name}: a {kind}", wanted, "close it, or make one object of each part")
        if not (polygon.is_valid and polygon.area > 0 and np.isfinite(polygon.bounds).all()):
            reason = shapely.is_valid_reason(polygon) if polygon.area > 0 else "no area"
            raise MapError(f"{name}: an invalid footprint, {reason}", wanted, "repair it")
        if find_pinched(np.array([polygon]))[0]:
            raise MapError(
                f"{name}: a point of the footprint occurs twice, for example where a courtyard "
                "touches a wall",
                "a footprint whose walls do not touch each other, so that it becomes a solid",
                "move the point by some centimetres, or open the courtyard",
            )
    parts = [one.geoms[0] if one.geom_type == "MultiPolygon" else one for one in polygons]
    found = np.empty(len(parts), object)
    found[:] = parts
    return found


def _heights(column: np.ndarray, names: Sequence[str]) -> np.ndarray:
    heights = np.array([_number(value) for value in column.tolist()], dtype=np.float64)
    for height, value, name in zip(heights, column, names, strict=True):
        if not 0 < height <= TALLEST:
            raise MapError(
                f"{name}: the height {value} is out of range",
                f"a height in metres above 0, at most {TALLEST:g}",
                "correct the height in the table",
            )
    return heights


def _number(value: object) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        return math.nan


def _texts(column: np.ndarray) -> list[str]:
    """Return a column as texts; "" for missing values."""
    return ["" if one is None or one != one else str(one).strip() for one in column.tolist()]


def _required_texts(
    column: np.ndarray, names: Sequence[str], what: str, expected: str
) -> tuple[str, ...]:
    texts = _texts(column)
    for text, name in zip(texts, names, strict=True):
        if not text:
            raise MapError(f"{name} without a {what}", expected, f"fill the column {what}")
    return tuple(texts)


def _check_no_meshes(column: np.ndarray, names: Sequence[str]) -> None:
    for path, name in zip(_texts(column), names, strict=True):
        if path:
            raise MapError(
                f"{name} has the mesh file {path!r} in the column 'path'",
                "objects with a footprint and a height, because a library uses no mesh files",
                "remove the column 'path' from the table of objects",
            )
