"""Reader of genome files, of older schema versions too."""

import json
import os
import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from evocity.citymap import MAX_PIXELS
from evocity.columns import array_of
from evocity.condensation import Condensation
from evocity.errors import GenomeError, spell
from evocity.genome.genome import Genome
from evocity.genome.nucleotides import FIELDS, NEWER, packed
from evocity.genome.roofs import read_roofs
from evocity.genome.writer import (
    CONDENSED,
    FORM_KEY,
    GENOME_KEY,
    LEAVES,
    ROOFS_KEY,
    SCHEMA_VERSIONS,
)
from evocity.pavement import Pavement
from evocity.sealed_parquet import ChangedFileError, open_table

# A PROJ string may name files, so only codes and WKT pass.
_CODE_OR_WKT = re.compile(r"[A-Za-z]+:[\w.:]+\Z|[A-Z_]+\s*\[", re.ASCII)

#: The exceptions that a damaged file, or one that is not a genome, can raise.
DAMAGE = (
    pa.ArrowException,
    OSError,
    LookupError,
    ValueError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
    MemoryError,
)


def read_genome(path: str | os.PathLike) -> Genome:
    """Read a genome file written by `Genome.write`.

    Raises `GenomeError` if the file is missing, holds no genome, has another schema version, or
    holds nucleotides out of bounds. A file with a seal must contain exactly the bytes that evocity
    wrote. The function parses a file without a seal in a separate process. Reading never executes
    code from the file.
    """
    path = Path(path)
    if not path.is_file():
        raise GenomeError(
            f"there is no genome file at {path}",
            "a Parquet file written by `evocity encode`",
            "check the name, or make a genome: evocity encode MAP -o GENOME.parquet",
        )
    try:
        file = open_chromosome(path)
    except ChangedFileError as error:
        raise changed_error(path, error) from None
    except DAMAGE:
        raise _not_genome(path) from None
    with file:
        return genome_in(file, path)


def open_chromosome(path: str | os.PathLike) -> pq.ParquetFile:
    """Open the file of a chromosome of any kind, see `evocity.sealed_parquet.open_table`. Raises
    the errors `DAMAGE` for other files."""
    return open_table(path, (GENOME_KEY, FORM_KEY), MAX_PIXELS)


def changed_error(path: str | os.PathLike, error: ChangedFileError) -> GenomeError:
    """Describe the ``error`` of a sealed file."""
    return GenomeError(
        f"{path} is damaged: {error}",
        "an undamaged file that evocity wrote",
        "restore the file from a copy, or write the file again",
    )


def _not_genome(path: Path) -> GenomeError:
    return GenomeError(
        f"{path} is not a genome file, or is damaged",
        "a Parquet file written by `evocity encode`",
        "write the genome again: evocity encode MAP -o GENOME.parquet",
    )


def genome_in(file: pq.ParquetFile, path: Path) -> Genome:
    """Read the genome in an open ``file``, see `read_genome`."""
    try:
        metadata = file.schema_arrow.metadata or {}
        if GENOME_KEY not in metadata:
            raise _another_table(path, metadata)
        about = dict(json.loads(metadata[GENOME_KEY]))
        version = about.pop("schema_version")
        size, names = file.metadata, file.schema_arrow.names
    except DAMAGE:
        raise _not_genome(path) from None
    if version not in SCHEMA_VERSIONS:
        raise GenomeError(
            f"{path} has genome schema version {spell(version)}",
            f"the schema version {' or '.join(map(str, SCHEMA_VERSIONS))}",
            "read the file with the release of evocity that wrote the file, or encode the map "
            "again",
        )
    try:
        _check_size(size, about)
        columns = _columns(version, names)
        table = file.read(columns=columns).select(columns)  # KeyError where one is missing
        pavement = _pavement(about, table, size.num_rows)
        if about["sigma_max"] is None:
            about["sigma_max"] = float("inf")
        if about["origin"] is not None:
            about["origin"] = tuple(about["origin"])
        _check_system(about["crs"])
        if CONDENSED in table.column_names:
            about["condensation"] = Condensation.from_column(table.column(CONDENSED), pavement)
        arrays = {
            name: array_of(table.column(name)) for name in FIELDS if name in table.schema.names
        }
        if version < 3:
            arrays["source"] = place_of(pavement, arrays["source"], about["made"])
        if ROOFS_KEY in metadata:
            about["roofs"] = read_roofs(json.loads(metadata[ROOFS_KEY]), about["cities"])
        return Genome(pavement, **arrays, **about)
    except GenomeError as error:
        raise GenomeError(f"{path}: {error.found}", error.expected, error.remedy) from None
    except DAMAGE as error:
        raise GenomeError(
            f"{path} lacks data of a genome, or has damaged data ({str(error)[:200]})",
            f"the columns {', '.join(FIELDS)}, and the metadata that describe these columns",
            "write the genome again: evocity encode MAP -o GENOME.parquet",
        ) from None


def _check_size(file: pq.FileMetaData, about: Mapping) -> None:
    """Raise ValueError for more lifs, or more values of a column, than the map has pixels: Parquet
    can store one value for a billion rows."""
    most = min(_whole(about["height"]) * _whole(about["width"]), MAX_PIXELS)
    values = 0
    for group in map(file.row_group, range(file.num_row_groups)):
        columns = map(group.column, range(group.num_columns))
        # an empty list counts as a value too
        values += max((column.num_values for column in columns), default=0)
    if file.num_rows > most or values > 2 * most:
        raise ValueError(f"{file.num_rows} lifs, {values} values of {most} pixels")


@lru_cache(maxsize=64)
def _check_system(crs: str | None) -> None:
    """Raise `GenomeError` for an unknown reference system."""
    if crs is None:
        return
    from pyproj import CRS
    from pyproj.exceptions import ProjError

    try:
        CRS.from_user_input(crs if _CODE_OR_WKT.match(crs) else None)
    except (ProjError, TypeError):
        raise GenomeError(
            f"the reference system crs = {spell(crs)} is unknown",
            "a code that PROJ knows, for example EPSG:2154, or WKT",
            "encode the map again, or write the file with crs = null",
        ) from None


def _columns(version: int, names: list[str]) -> list[str]:
    """List the columns to read of a file of this ``version`` with columns of these ``names``."""
    if version < 3:
        return [*(name for name in FIELDS if name not in NEWER), *[CONDENSED] * (version > 1)]
    return [*FIELDS, *LEAVES, *[CONDENSED] * (CONDENSED in names)]


def _pavement(about: dict, table: pa.Table, rows: int) -> Pavement:
    """Build the pavement of a file; removes its keys from ``about``."""
    height, width = (_whole(about.pop(key)) for key in ("height", "width"))
    if not 0 < height * width <= MAX_PIXELS or min(height, width) < 1:
        raise ValueError(f"a map of {height} × {width} px")
    if "block" in about:
        block = _whole(about.pop("block"))
        pavement = Pavement(height, width, block)
        if rows != len(pavement):
            raise ValueError(f"{rows} lifs for {height} × {width} px of B = {block}")
        return pavement
    places = [array_of(table.column(name)) for name in LEAVES]
    pavement = Pavement(height, width, places[2])
    if not all(map(np.array_equal, places[:2], pavement.corners)):
        raise ValueError("leaves that overlap, leave gaps, or stand in another order")
    return pavement


def _whole(value) -> int:
    if type(value) is not int:
        raise TypeError(f"{value!r} in place of a whole number")
    return value


def _another_table(path: Path, metadata: Mapping[bytes, bytes]) -> GenomeError:
    content = "Parquet, but not a genome"
    remedy = "encode a map: evocity encode MAP -o GENOME.parquet"
    if b"geo" in metadata:
        content = "GeoParquet, which is a map"
    elif b"evocity.run" in metadata:
        content = "a table of a run"
        remedy = "name the run's folder and one individual: evocity decode RUN --id N"
    return GenomeError(f"{path} is {content}", "a Parquet file written by `evocity encode`", remedy)


def place_of(pavement: Pavement, source: np.ndarray, made: Mapping) -> np.ndarray:
    """Convert the numbers of lifs in versions before 3 to places: the inverse of
    `evocity.genome.writer.lifs_at`. A grown fabric numbers the lifs of its original, whose number
    of columns follows from the numbers themselves."""
    columns = pavement.columns
    if made.get("operator") == "growth":
        row, column = made["corner"]
        first = row * columns + column
        columns = max(int(source[first + columns]) - int(source[first]), 1)
    row, column = np.divmod(source.astype(np.int64), columns)
    return packed(row * pavement.block, column * pavement.block)
