"""What a row of `births` and of `membership` holds, to and from Arrow tables."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import pyarrow as pa

from evocity.errors import RunError
from evocity.genome import FIELDS, Genome, Pavement

#: Version of a run folder's layout and columns. Raised by one with every change a reader
#: must know of.
SCHEMA_VERSION = 1

#: How a birth can end. Only `ok` individuals may live, breed or be best. `invalid` is a
#: measure without a finite value; `died` a worker that ended in the middle.
STATUSES = ("ok", "error", "timeout", "died", "invalid")

ABOUT_RUN = b"evocity.run"
ABOUT_GENERATIONS = b"evocity.generations"

_WORD = pa.dictionary(pa.int32(), pa.string())


@dataclass(frozen=True)
class Header:
    """What all births of a run share, kept in the metadata of every Parquet file.

    ``measures`` names the ``fitness.<name>`` columns, ``cities`` the sources that the genomes'
    ``parent`` points into, ``population`` the births a generation: an individual's id is
    generation · population + slot.
    """

    height: int
    width: int
    block: int
    metres_per_pixel: float
    sigma_max: float
    cities: tuple[str, ...]
    attribution: str
    origin: tuple[float, float] | None
    crs: str | None
    seed: int
    population: int
    recipe_hash: str
    measures: tuple[str, ...]

    @property
    def pavement(self) -> Pavement:
        return Pavement(self.height, self.width, self.block)

    def adopt(self, genome: Genome) -> Genome:
        """The same genome told in the run's terms: its table of cities, attribution, place."""
        lookup = np.array([self.cities.index(city) for city in genome.cities], dtype=np.uint8)
        return genome.replace(
            parent=lookup[genome.parent],
            cities=self.cities,
            attribution=self.attribution,
            origin=self.origin,
            crs=self.crs,
        )

    def to_json(self) -> str:
        about = asdict(self) | {"schema_version": SCHEMA_VERSION}
        about["sigma_max"] = None if np.isinf(self.sigma_max) else self.sigma_max
        return json.dumps(about)

    @classmethod
    def from_json(cls, text: str | bytes, path) -> "Header":
        """Raises `RunError` for another schema version, ValueError or TypeError for damage."""
        about = json.loads(text)
        check_version(about.pop("schema_version"), path)
        about["sigma_max"] = float("inf") if about["sigma_max"] is None else about["sigma_max"]
        for name in ("cities", "measures", "origin"):
            about[name] = None if about[name] is None else tuple(about[name])
        return cls(**about)


@dataclass(frozen=True)
class Birth:
    """One evaluated individual.

    ``values`` maps measures to raw values, as far as they were reached; ``made`` is what the
    operator recorded (its parameters, what it reached). ``genome`` is None where breeding
    itself failed. ``seconds`` of one worker, breeding and evaluation.
    """

    generation: int
    id: int
    parents: tuple[int, ...]
    operator: str
    status: str
    error: str | None
    seconds: float
    values: Mapping[str, float]
    genome: Genome | None
    made: Mapping = field(default_factory=dict)

    @property
    def ok(self) -> bool:
        return self.status == "ok"


@dataclass(frozen=True)
class Member:
    """Who lived in a generation: slot, individual, front (0 = first), crowding distance."""

    slot: int
    id: int
    rank: int
    crowding: float


def births_schema(header: Header) -> pa.Schema:
    """Columns of a births file; ``genome`` is the digest, ``made`` a JSON document."""
    lifs = len(header.pavement)
    columns = [
        ("generation", pa.int32()),
        ("id", pa.int64()),
        ("parents", pa.list_(pa.int64())),
        ("operator", _WORD),
        ("made", pa.string()),
        ("status", _WORD),
        ("error", pa.string()),
        ("seconds", pa.float64()),
        *((f"fitness.{name}", pa.float64()) for name in header.measures),
        ("feasible", pa.bool_()),
        ("genome", pa.string()),
        *(
            (name, pa.list_(pa.from_numpy_dtype(nucleotide.dtype), lifs))
            for name, nucleotide in FIELDS.items()
        ),
    ]
    return pa.schema(columns, metadata={ABOUT_RUN: header.to_json()})


def births_table(births: Sequence[Birth], header: Header) -> pa.Table:
    """Arrow table with one row a birth, columns as `births_schema`."""
    schema = births_schema(header)
    columns = {
        "generation": [b.generation for b in births],
        "id": [b.id for b in births],
        "parents": [list(b.parents) for b in births],
        "operator": [b.operator for b in births],
        "made": [json.dumps(b.made, default=_plain) for b in births],
        "status": [b.status for b in births],
        "error": [b.error for b in births],
        "seconds": [b.seconds for b in births],
        "feasible": [b.ok for b in births],
        "genome": [b.genome.digest if b.genome is not None else None for b in births],
    }
    for name in header.measures:
        columns[f"fitness.{name}"] = [b.values.get(name) for b in births]
    bred = [b.genome for b in births]
    for name, nucleotide in FIELDS.items():
        columns[name] = _lists(bred, name, nucleotide.dtype, len(header.pavement))
    arrays = [
        column if isinstance(column, pa.Array) else pa.array(column, kind.type)
        for kind in schema
        for column in [columns[kind.name]]
    ]
    return pa.table(arrays, schema=schema)


def genome_of(row: Mapping, header: Header) -> Genome:
    """The genome in one row (column -> Arrow scalar) of a births table."""
    arrays = {name: row[name].values.to_numpy(zero_copy_only=False) for name in FIELDS}
    return Genome(
        header.pavement,
        **arrays,
        metres_per_pixel=header.metres_per_pixel,
        cities=header.cities,
        sigma_max=header.sigma_max,
        attribution=header.attribution,
        origin=header.origin,
        crs=header.crs,
        made=json.loads(row["made"].as_py()),
    )


def births_of(table: pa.Table, header: Header) -> list[Birth]:
    """`births_table` the other way round."""
    births = []
    for index in range(len(table)):
        row = {name: table.column(name)[index] for name in table.column_names}
        values = {name: row[f"fitness.{name}"].as_py() for name in header.measures}
        births.append(
            Birth(
                **{
                    name: row[name].as_py()
                    for name in ("generation", "id", "operator", "status", "error", "seconds")
                },
                parents=tuple(row["parents"].as_py()),
                values={name: value for name, value in values.items() if value is not None},
                genome=genome_of(row, header) if row["genome"].is_valid else None,
                made=json.loads(row["made"].as_py()),
            )
        )
    return births


def membership_table(
    generation: int, members: Iterable[Member], summary: Mapping, header: Header
) -> pa.Table:
    """Arrow table of one generation's members; ``summary`` travels in its metadata."""
    members = list(members)
    schema = pa.schema(
        [
            ("generation", pa.int32()),
            ("slot", pa.int32()),
            ("id", pa.int64()),
            ("rank", pa.int32()),
            ("crowding", pa.float64()),
        ],
        metadata={
            ABOUT_RUN: header.to_json(),
            ABOUT_GENERATIONS: json.dumps({str(generation): dict(summary)}, allow_nan=False),
        },
    )
    columns = [[getattr(m, name) for m in members] for name in schema.names[1:]]
    return pa.table(
        [
            pa.array(column, kind.type)
            for column, kind in zip([[generation] * len(members), *columns], schema, strict=True)
        ],
        schema=schema,
    )


def check_version(version, path) -> None:
    """Raise `RunError` unless ``version`` is the one this release writes."""
    if version != SCHEMA_VERSION:
        raise RunError(
            f"{path} has run schema version {version}",
            f"version {SCHEMA_VERSION}",
            "read it with the release of evocity that wrote it",
        )


def _lists(genomes: Sequence[Genome | None], name: str, dtype, lifs: int) -> pa.Array:
    rows = np.zeros((len(genomes), lifs), dtype=dtype)
    for row, genome in zip(rows, genomes, strict=True):
        if genome is not None:
            row[:] = getattr(genome, name)
    absent = pa.array([genome is None for genome in genomes], pa.bool_())
    return pa.FixedSizeListArray.from_arrays(pa.array(rows.ravel()), lifs, mask=absent)


def _plain(value):
    """JSON for what operators may leave in ``made``: numpy numbers, arrays, tuples."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)
