"""GeoParquet: footprints and their columns, of the row groups that the window needs.

Statistics of a bounding box column (``covering``) tell which row groups and rows meet the window;
without such a column, the reader streams all rows and keeps those that meet it. A child process
reads the file, within limits of memory and time.
"""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import shapely
from pyproj import CRS
from pyproj.exceptions import ProjError

from evocity.errors import MapError, format_bytes, keyword
from evocity.io.account import OUTSIDE, Account
from evocity.io.footprint_files import CENTER_TAG, read_center
from evocity.io.heights import check_columns, has_building_fields, is_building_name
from evocity.io.projection import (
    WGS84,
    flat,
    identify,
    is_metric,
    parse_whole_crs,
    plane,
    vertical_unit,
)
from evocity.io.reader_types import Footprints, Request
from evocity.io.window_box import SMALL, Box, empty_window_error, window_box
from evocity.io.wkb_areas import CurveError, choose_areas, read_areas
from evocity.parquet_child import UnreadableParquetError, describe_rows, select_rows
from evocity.parquet_rows import TOO_LARGE

#: Bytes of the outlines and attributes that are read, and rows of a file; at most.
MOST_BYTES, MOST_ROWS = 1 << 29, 100_000_000

# Rows that the child reads in a second, at least.
_ROWS_A_SECOND = 100_000
_EDGES = ("xmin", "ymin", "xmax", "ymax")
_SYSTEMS = ("GeographicCRS", "GeodeticCRS", "ProjectedCRS", "CompoundCRS")


@dataclass
class _Table:
    """A file: its geometry column, what its metadata say of it, its other columns, those of texts,
    and the paths of its leaves."""

    path: Path
    rows: int
    geometry: str
    about: dict
    columns: list[str]
    texts: list[str]
    leaves: list[str]
    tags: dict[str, str]

    @property
    def covering(self) -> list[str] | None:
        """The paths of the columns with the bounds of each row: xmin, ymin, xmax, ymax."""
        named = (self.about.get("covering") or {}).get("bbox") or {}
        try:
            paths = [".".join(named[edge]) for edge in _EDGES]
        except (KeyError, TypeError):
            # Overture's files have such a column from before GeoParquet had a name for it
            paths = [f"bbox.{edge}" for edge in _EDGES]
        return paths if set(self.leaves).issuperset(paths) else None


def read_geoparquet(path: Path, request: Request) -> Footprints:
    """Read the buildings of a GeoParquet file; with a centre, those that may meet the window."""
    with _parquet_errors(path):
        table = _open(path)
        check_columns(path.name, table.columns, (request.height_column, request.levels_column))
        whole = _crs(table)
        crs, unit = flat(whole), vertical_unit(whole)
        box = window_box(request, crs) if table.rows > SMALL else None
        if table.rows > MOST_ROWS:
            raise _too_large(path, f"{table.rows} rows")
        shapes, rings, extents, tags = _read(table, box)
        if len(shapes) and shapely.is_missing(shapes).all() and not rings.any():
            raise ValueError("none of its outlines is complete")
        if box is not None and not len(shapes):
            bounds = table.about.get("bbox")
            raise empty_window_error(path.name, request, crs, table.rows, _flat_bounds(bounds))
    account = Account(table.rows)
    account.drop(OUTSIDE, table.rows - len(shapes))
    kept = choose_areas(shapes, rings, account)
    if len(shapes) and not len(kept):
        raise MapError(
            f"{path.name} has {len(shapes)} rows, but no polygon",
            "a GeoParquet file of building footprints",
            "choose the file with the outlines of the buildings, not their middles or lines",
        )
    note = ""
    if box is not None and table.covering is None:
        note = (
            f"; the file has no bounds of its rows, so evocity read all {table.rows}; a column "
            "'bbox' makes this faster"
        )
    for i in np.flatnonzero(extents):
        tags[i]["solid_height"] = float(extents[i]) * unit
    center = read_center(path, table.tags)
    return Footprints(
        shapes[kept],
        [tags[i] for i in kept],
        crs,
        table.tags.get("ATTRIBUTION", ""),
        center,
        projection=crs if center is not None and is_metric(crs) else None,
        bare=center is not None and not account.features,
        of_buildings=is_building_name(path.stem) or has_building_fields(table.columns),
        height_unit=unit,
        account=account,
        note=note,
    )


def _open(path: Path) -> _Table:
    found = describe_rows(path)
    kinds = dict(found["columns"])
    try:
        about = json.loads(found["geo"] or "{}")
        geometry = about["primary_column"]
        own = about["columns"][geometry]
        encoding = own.get("encoding")
    except KeyError:
        raise MapError(
            f"{path.name} has no metadata of GeoParquet",
            "a GeoParquet file, with an entry 'geo' in its metadata",
            "if the file is a table with places, write it as GeoParquet with geopandas; if it is a "
            "genome, make a map first with evocity decode",
        ) from None
    if encoding != "WKB":
        raise MapError(
            f"{path.name} writes outlines as {str(encoding)[:40]!r}",
            "a GeoParquet file with the encoding WKB",
            "write the file again with geopandas, or with GDAL and GEOMETRY_ENCODING=WKB",
        )
    if kinds[geometry] != "binary":
        kind = "texts" if kinds[geometry] == "text" else kinds[geometry]
        raise MapError(
            f"{path.name}: the column {geometry!r} holds {kind}",
            "outlines as WKB, in a column of the type binary",
            "write the file again with geopandas",
        )
    columns = [
        name for name, kind in kinds.items() if kind in ("text", "scalar") and name != geometry
    ]
    texts = [name for name in columns if kinds[name] == "text"]
    tags = _tags(found["tags"])
    return _Table(path, found["rows"], geometry, own, columns, texts, found["leaves"], tags)


def _tags(text: str | None) -> dict[str, str]:
    """The tags of a file that evocity wrote; nothing for other files."""
    try:
        tags = json.loads(text or "{}")
        return {str(name): text for name, text in tags.items() if isinstance(text, str)}
    except (ValueError, AttributeError, RecursionError):
        return {}


def _crs(table: _Table) -> CRS:
    """The reference system of the geometry column; longitude and latitude if none is named."""
    where = f"{table.path.name}, column {table.geometry!r}"
    if "crs" not in table.about:
        return WGS84
    stated = table.about["crs"]
    if stated is None and CENTER_TAG in table.tags:
        return plane()
    if stated is None:
        raise MapError(
            f"{where}: no reference system",
            "a column with a reference system",
            "assign the right system with geopandas (set_crs) and write the file again",
        )
    if not isinstance(stated, dict):
        return parse_whole_crs(stated, where)
    code = stated.get("id")
    if isinstance(code, dict) and code.get("authority") in ("EPSG", "OGC", "ESRI"):
        return parse_whole_crs(f"{code['authority']}:{code.get('code')}", where)
    text = json.dumps(stated)
    try:
        if stated.get("type") not in _SYSTEMS or "nadgrids" in text or len(text) > 100_000:
            raise ProjError("not a plain system")
        crs = identify(CRS.from_json(text))
        flat(crs)  # which may fail
        return crs
    except ProjError as error:
        raise MapError(
            f"{where}: the reference system {str(stated.get('name'))[:80]!r} is unknown",
            "a system that PROJ knows, for example EPSG:2154",
            "convert the file with geopandas: to_crs(4326)",
        ) from error


def _read(table: _Table, box: Box | None) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[dict]]:
    """Read the outlines that may meet ``box``, by default all, with their numbers of degenerate
    rings, extents in z and attributes."""
    try:
        content = select_rows(
            table.path,
            table.rows / _ROWS_A_SECOND,
            geometry=table.geometry,
            columns=table.columns,
            texts=table.texts,
            covering=table.covering if box is not None else None,
            box=box,
            most=MOST_BYTES,
        )
    except UnreadableParquetError as error:
        if str(error) != TOO_LARGE:
            raise
        found = f"more than {format_bytes(MOST_BYTES)} of outlines and attributes"
        raise _too_large(table.path, found) from error
    shapes: list[tuple[np.ndarray, ...]] = [read_areas(np.array([], dtype=object))]
    tags: list[dict] = []
    if content:
        with pa.ipc.open_stream(content) as stream:
            for batch in stream:
                shapes.append(_outlines(batch.column(table.geometry)))
                tags += _attributes(table, batch)
    areas, rings, extents = (np.concatenate(parts) for parts in zip(*shapes, strict=True))
    return areas, rings, extents, tags


def _outlines(column: pa.Array) -> tuple[np.ndarray, ...]:
    """The geometries of a column, None for rows without one, with their numbers of degenerate rings
    and their extents in z; equal geometries are read once."""
    if not isinstance(column, pa.DictionaryArray):
        column = column.dictionary_encode()
    indices = np.asarray(pc.fill_null(column.indices, -1).to_numpy(zero_copy_only=False))
    known = np.full(len(column.dictionary) + 1, None, dtype=object)
    known[:-1] = column.dictionary.to_pylist()
    return tuple(each[indices] for each in read_areas(known))


def _attributes(table: _Table, batch: pa.RecordBatch) -> list[dict]:
    columns = [_values(batch.column(name).to_pylist()) for name in table.columns]
    return [dict(zip(table.columns, row, strict=True)) for row in zip(*columns, strict=True)] or [
        {} for _ in range(batch.num_rows)
    ]


def _values(values: list) -> list:
    """Return the values of a column, with decimal numbers as floats."""
    return [float(value) if isinstance(value, Decimal) else value for value in values]


def _flat_bounds(bounds: object) -> list[float] | None:
    """The horizontal part of the metadata's ``bbox``; None if it is not one."""
    try:
        edges = [float(edge) for edge in bounds]  # type: ignore[attr-defined]
    except (TypeError, ValueError):
        return None
    half = len(edges) // 2
    return [*edges[:2], *edges[half : half + 2]] if len(edges) in (4, 6) else None


def _too_large(path: Path, found: str) -> MapError:
    return MapError(
        f"{path.name} has {found}",
        f"at most {MOST_ROWS} rows, and {format_bytes(MOST_BYTES)} in the window",
        f"give the {keyword('center')} of a window, or cut the file to the town",
    )


@contextmanager
def _parquet_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except CurveError as error:
        raise MapError(
            f"{path.name}: {error}",
            "outlines of straight lines",
            "write the file again with ogr2ogr -nlt CONVERT_TO_LINEAR",
        ) from error
    except (
        *(pa.ArrowException, shapely.errors.ShapelyError, OSError, MemoryError, RecursionError),
        *(ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError),
    ) as error:
        first = (str(error).splitlines() or [""])[0] or type(error).__name__
        raise MapError(
            f"{path.name} cannot be read as GeoParquet: {first[:200]}",
            "a complete GeoParquet file",
            "download or export the file again; it may be cut off or damaged",
        ) from error
