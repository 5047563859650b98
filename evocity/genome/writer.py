"""Writer of genome files: Parquet with a row for each lifs, and a description in its metadata."""

import json
import math
import os
from collections.abc import Mapping

import numpy as np
import pyarrow as pa

from evocity.columns import column_of
from evocity.errors import GenomeError, reason_of
from evocity.files import whole_file
from evocity.genome.nucleotides import FIELDS, NEWER, unpacked
from evocity.pavement import Pavement
from evocity.sealed_parquet import write_table

#: The keys of the metadata by which a file tells its kind: a fabric, or another form.
GENOME_KEY, FORM_KEY = b"evocity.genome", b"evocity.form"
#: The key of the roofs of source cities, which readers may leave out.
ROOFS_KEY = b"evocity.roofs"
#: The readable versions of the file's schema; a change that a reader must know of adds one. A
#: genome is written in the oldest version that holds it. 2 adds a column `CONDENSED`; 3 adds
#: columns `LEAVES` and `NEWER`, places for sources, and ``settle``; 4 has roofs for ``settle``.
SCHEMA_VERSIONS = (1, 2, 3, 4)
#: The column of the condensation, see `Condensation.column`.
CONDENSED = "condensation"
#: The columns of each range block's place, from version 3 on.
LEAVES = ("top", "left", "side")


def write_genome(genome, path: str | os.PathLike) -> None:
    """Write a `Genome`, see `Genome.write`."""
    columns, about = _describe(genome)
    arrays = {
        name: column_of(column) if isinstance(column, np.ndarray) else column
        for name, column in columns.items()
    }
    roofs = {name: table.document for name, table in genome.roofs.items()}
    more = {ROOFS_KEY.decode(): json.dumps(roofs)} if roofs else {}
    write_described(pa.table(arrays), GENOME_KEY.decode(), about, path, more)


def write_described(
    table: pa.Table,
    key: str,
    about: Mapping,
    path: str | os.PathLike,
    more: Mapping[str, str] | None = None,
) -> None:
    """Write the ``table`` of a chromosome, with its description ``about`` as JSON under a ``key``
    of the schema's metadata, and with ``more`` entries there. The file has a seal. Raises
    `GenomeError` if writing fails."""
    metadata = {key: json.dumps(about, default=str), **(more or {})}
    try:
        with whole_file(path) as temporary:
            write_table(table.replace_schema_metadata(metadata), temporary)
    except OSError as error:
        raise GenomeError(
            f"{path} cannot be written: {reason_of(error)}",
            "a file name in an existing folder, on a disk with free space",
            "create the folder, or choose another folder",
        ) from error


def _describe(genome) -> tuple[dict, dict]:
    """Collect columns and description of a genome, in the oldest schema version that holds it."""
    p = genome.pavement
    columns = {name: getattr(genome, name) for name in FIELDS}
    about = {
        "schema_version": 1 if genome.condensation is None else 2,
        "height": p.height,
        "width": p.width,
        "block": p.block if p.uniform else None,
        "metres_per_pixel": genome.metres_per_pixel,
        "cities": list(genome.cities),
        "sigma_max": None if np.isinf(genome.sigma_max) else genome.sigma_max,
        "attribution": genome.attribution,
        "origin": genome.origin,
        "crs": genome.crs,
        "made": _finite(genome.made),
    }
    plain = not (genome.settle or genome.turn.any() or (genome.part < 1).any())
    numbers = lifs_at(p, genome.source) if plain else None
    if numbers is None:
        top, left = p.corners
        version = 4 if isinstance(genome.settle, str) else 3
        about |= {"schema_version": version, "settle": genome.settle}
        del about["block"]
        columns |= dict(zip(LEAVES, (top, left, p.side), strict=True))
    else:
        columns["source"] = numbers
        for name in NEWER:
            del columns[name]
    if genome.condensation is not None:
        columns[CONDENSED] = genome.condensation.column(p)
    return columns, about


def lifs_at(pavement: Pavement, source: np.ndarray) -> np.ndarray | None:
    """Number the lifs of a uniform ``pavement`` at the places ``source``, as versions before 3 do;
    None if a place is not the corner of a lifs."""
    if not pavement.uniform:
        return None
    (row, high), (column, wide) = (np.divmod(place, pavement.block) for place in unpacked(source))
    legal = not (high.any() or wide.any())
    if not legal or (row >= pavement.rows).any() or (column >= pavement.columns).any():
        return None
    return row * pavement.columns + column


def _finite(value):
    """Replace infinity and NaN, which JSON lacks, by text."""
    if isinstance(value, Mapping):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
