"""GeoParquet: footprints and their columns, of the row groups that the window needs.

Statistics of a bounding box column (``covering``) tell which row groups and rows meet the window;
without such a column, the reader streams all rows and keeps those that meet it.
"""

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import shapely
from pyproj import CRS
from pyproj.exceptions import ProjError

from evocity.errors import MapError, format_bytes, keyword
from evocity.io.account import OUTSIDE, Account
from evocity.io.heights import check_columns, has_building_fields, is_building_name
from evocity.io.projection import WGS84, flat, parse_whole_crs, vertical_unit
from evocity.io.reader_types import Footprints, Request
from evocity.io.window_box import SMALL, Box, boxes_meet, empty_window_error, window_box
from evocity.io.wkb_areas import choose_areas, read_areas

#: Bytes of the outlines and attributes that are read, and rows of a file; at most.
MOST_BYTES, MOST_ROWS = 1 << 30, 100_000_000

_BATCH = 16_384
_EDGES = ("xmin", "ymin", "xmax", "ymax")
_SYSTEMS = ("GeographicCRS", "GeodeticCRS", "ProjectedCRS", "CompoundCRS")


@dataclass
class _Table:
    """An open file: its geometry column, what its metadata say of it, its other columns."""

    path: Path
    file: pq.ParquetFile
    geometry: str
    about: dict
    columns: list[str]

    @property
    def rows(self) -> int:
        return self.file.metadata.num_rows

    @property
    def covering(self) -> list[str] | None:
        """The paths of the columns with the bounds of each row: xmin, ymin, xmax, ymax."""
        named = (self.about.get("covering") or {}).get("bbox") or {}
        try:
            paths = [".".join(named[edge]) for edge in _EDGES]
        except (KeyError, TypeError):
            # Overture's files have such a column from before GeoParquet had a name for it
            paths = [f"bbox.{edge}" for edge in _EDGES]
        known = {self.file.schema.column(i).path for i in range(len(self.file.schema))}
        return paths if known.issuperset(paths) else None


def read_geoparquet(path: Path, request: Request) -> Footprints:
    """Read the buildings of a GeoParquet file; with a centre, those that may meet the window."""
    with _parquet_errors(path):
        # strings stay dictionaries: a file of a few bytes may repeat a text without end
        table = _open(path)
        check_columns(path.name, table.columns, (request.height_column, request.levels_column))
        whole = _crs(table)
        crs, unit = flat(whole), vertical_unit(whole)
        box = window_box(request, crs) if table.rows > SMALL else None
        if table.rows > MOST_ROWS:
            raise _too_large(path, f"{table.rows} rows")
        shapes, rings, extents, tags = _read(table, box)
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
    return Footprints(
        shapes[kept],
        [tags[i] for i in kept],
        crs,
        of_buildings=is_building_name(path.stem) or has_building_fields(table.columns),
        height_unit=unit,
        account=account,
        note=note,
    )


def _open(path: Path) -> _Table:
    schema = pq.read_schema(path)
    try:
        about = json.loads((schema.metadata or {})[b"geo"])
        geometry = about["primary_column"]
        own = about["columns"][geometry]
        encoding = own.get("encoding")
    except KeyError:
        raise MapError(
            f"{path.name} has no metadata of GeoParquet",
            "a GeoParquet file, with an entry 'geo' in its metadata",
            "of a table with places, write GeoParquet with geopandas or GDAL; of a genome, make a "
            "map first: evocity decode",
        ) from None
    if encoding != "WKB":
        raise MapError(
            f"{path.name} writes outlines as {str(encoding)[:40]!r}",
            "a GeoParquet file with the encoding WKB",
            "write the file again with geopandas, or with GDAL and GEOMETRY_ENCODING=WKB",
        )
    kind = schema.field(geometry).type
    if not (pa.types.is_binary(kind) or pa.types.is_large_binary(kind)):
        raise MapError(
            f"{path.name}: the column {geometry!r} holds {kind}",
            "outlines as WKB, in a column of the type binary",
            "write the file again with geopandas",
        )
    columns = [one.name for one in schema if one.name != geometry and _is_scalar(one.type)]
    texts = [one.name for one in schema if _is_text(one.type) or one.name == geometry]
    file = pq.ParquetFile(path, read_dictionary=texts)
    return _Table(path, file, geometry, own, columns)


def _is_text(kind: pa.DataType) -> bool:
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def _is_scalar(kind: pa.DataType) -> bool:
    if pa.types.is_dictionary(kind):
        kind = kind.value_type
    number = pa.types.is_integer(kind) or pa.types.is_floating(kind)
    return number or _is_text(kind) or pa.types.is_boolean(kind)


def _crs(table: _Table) -> CRS:
    """The reference system of the geometry column; longitude and latitude if none is named."""
    where = f"{table.path.name}, column {table.geometry!r}"
    if "crs" not in table.about:
        return WGS84
    stated = table.about["crs"]
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
        crs = CRS.from_json(text)
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
    covering = table.covering if box is not None else None
    groups = list(range(table.file.num_row_groups))
    if covering and box:
        groups = [group for group in groups if _group_meets(table, group, covering, box)]
    shapes: list[tuple[np.ndarray, ...]] = [read_areas(np.array([], dtype=object))]
    tags: list[dict] = []
    room = MOST_BYTES
    columns = [table.geometry, *table.columns, *(covering or [])]
    for batch in table.file.iter_batches(_BATCH, groups, columns, use_threads=False):
        rows = None
        if covering and box:
            rows = np.flatnonzero(boxes_meet(_bounds(batch, covering), box))
            if not len(rows):
                continue
            batch = batch.take(pa.array(rows))
        found = _outlines(table, batch.column(table.geometry), room)
        if box is not None and not covering:
            rows = np.flatnonzero(boxes_meet(shapely.bounds(found[0]), box))
            if not len(rows):
                continue
            found = tuple(each[rows] for each in found)
            batch = batch.take(pa.array(rows))
        room -= batch.nbytes + 100 * batch.num_rows * len(table.columns)
        if room < 0:
            raise _too_large(table.path, f"more than {format_bytes(MOST_BYTES)} of outlines")
        shapes.append(found)
        tags += _attributes(table, batch)
    areas, rings, extents = (np.concatenate(parts) for parts in zip(*shapes, strict=True))
    return areas, rings, extents, tags


def _group_meets(table: _Table, group: int, covering: Sequence[str], box: Box) -> bool:
    """Whether the statistics of a row group allow that a row meets ``box``."""
    found = table.file.metadata.row_group(group)
    index = {table.file.schema.column(i).path: i for i in range(len(table.file.schema))}
    edges = []
    for place, path in enumerate(covering):
        statistics = found.column(index[path]).statistics
        if statistics is None or not statistics.has_min_max:
            return True
        edges.append(float(statistics.min if place < 2 else statistics.max))
    return not np.isfinite(edges).all() or bool(boxes_meet(np.array([edges]), box)[0])


def _bounds(batch: pa.RecordBatch, covering: Sequence[str]) -> np.ndarray:
    """The bounds of each row, float ``(n, 4)``."""
    edges = []
    for path in covering:
        first, *rest = path.split(".")
        column = batch.column(first)
        for name in rest:
            column = pc.struct_field(column, name)
        edges.append(np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64))
    return np.stack(edges, axis=1)


def _outlines(table: _Table, column: pa.Array, room: int) -> tuple[np.ndarray, ...]:
    """The geometries of a column, None for rows without one, with their numbers of degenerate rings
    and their extents in z; equal geometries are read once."""
    if not isinstance(column, pa.DictionaryArray):
        column = column.dictionary_encode()
    sizes = pc.binary_length(column.dictionary)
    indices = np.asarray(pc.fill_null(column.indices, -1).to_numpy(zero_copy_only=False))
    lengths = np.append(np.asarray(pc.fill_null(sizes, 0), dtype=np.int64), 0)
    if lengths[indices].sum() > room:
        raise _too_large(table.path, f"more than {format_bytes(MOST_BYTES)} of outlines")
    used, places = np.unique(indices, return_inverse=True)
    known = np.full(len(used), None, dtype=object)
    inside = used >= 0
    known[inside] = column.dictionary.take(pa.array(used[inside])).to_pylist()
    return tuple(each[places.ravel()] for each in read_areas(known))


def _attributes(table: _Table, batch: pa.RecordBatch) -> list[dict]:
    columns = [batch.column(name).to_pylist() for name in table.columns]
    return [dict(zip(table.columns, row, strict=True)) for row in zip(*columns, strict=True)] or [
        {} for _ in range(batch.num_rows)
    ]


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
