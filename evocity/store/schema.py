"""The header of a run, and rows of `births`, to and from Arrow tables."""

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pyarrow as pa
from pydantic import AfterValidator, ConfigDict, Field, TypeAdapter
from pydantic_core import from_json

from evocity.citymap import MAX_PIXELS
from evocity.columns import words_of
from evocity.condensation import Condensation
from evocity.errors import RunError, cut_short, plain_text
from evocity.genome import Genome
from evocity.kinds import KINDS, Kind
from evocity.pavement import Pavement
from evocity.store.reconstruction import (
    GENOMES,
    Reconstruction,
    reconstruction_columns,
    reconstruction_fields,
    reconstruction_in,
)
from evocity.store.thumbnails import LONGEST, Thumbnails, thumbnail_columns, thumbnail_fields

#: Versions of a run folder's layout and columns that are read. 2 has a locked layer. 3 has range
#: blocks of many sides, lists of any length, a kind of chromosome, and settled roofs or not. 4 has
#: recorded measures. 5 has other marks of the living than crowding distance. 6 has figures of all
#: the living. 7 has islands. 8 leaves genomes out. 9 has other kinds of chromosomes than fabric.
#: 10 has thumbnails, and lists without nulls. 11 settles roofs, not whole buildings. 12 counts no
#: locked pixels in the shares of source cities.
#: New runs without these are written as 3; a run of an older release goes on as it began.
SCHEMA_VERSIONS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12)

#: How a birth can end. Only `ok` individuals may live, breed or be best. `invalid`: a measure has
#: no finite value; `died`: the worker ended early; `memory`: the birth took too much memory.
STATUSES = ("ok", "error", "timeout", "died", "invalid", "memory")

ABOUT_RUN = b"evocity.run"
ABOUT_GENERATIONS = b"evocity.generations"

_WORD = pa.dictionary(pa.int32(), pa.string())

# Types and bounds of a stranger's file are checked.
STRICT = ConfigDict(strict=True, extra="forbid")


def _each_once(names: tuple[str, ...]) -> tuple[str, ...]:
    if len(set(names)) < len(names):
        raise ValueError("a name twice")
    return names


def _no_column(names: tuple[str, ...]) -> tuple[str, ...]:
    if {"generation", "slot", "id", "rank", "island"} & set(names):
        raise ValueError("a column that every membership has")
    return names


#: Marks of the living in runs whose header names none.
CROWDING = ("crowding",)
# The first version that has each part of a header, unless the part has its default.
_SINCE = {"recorded": 4, "marks": 5, "figures": 6, "islands": 7, "genomes": 8, "thumbnails": 10}
_SINCE |= {"shares": 12}

_Side = Annotated[int, Field(ge=1, le=MAX_PIXELS)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
_Names = Annotated[tuple[str, ...], AfterValidator(_each_once)]


@dataclass(frozen=True)
class Header:
    """What all births of a run share, kept in the metadata of every Parquet file.

    ``measures``: measures with a goal or bounds; ``recorded``: measures that are only logged; all
    are columns ``fitness.<name>``. ``cities``: the sources that the genomes' ``parent`` points
    into. ``population``: births of a generation, and the most that live unless the algorithm says
    otherwise. ``locked``: the digest of the condensation of all genomes, None without. ``kind``:
    the kind of chromosome, see `evocity.kinds`. ``settle``: whether and how decoding settles
    roofs, see `evocity.decode`.
    ``block``: the side of all range blocks in runs of older releases, None in others. ``marks``:
    the algorithm's values of each living individual, columns of the membership; ``figures``: its
    values of all the living, in each generation's summary. ``islands``: names; births and
    membership then have a column ``island``, marks are those of all islands, and the summary has
    each island's figures. ``genomes``: the births whose genomes the log keeps, see
    `evocity.search.breeding.omitted_genomes`. ``thumbnails``: how small maps of births are made,
    None if the log has none. ``shares``: whether `smallest_share` counts "all" pixels, as in older
    runs, or only those that are "free", that is not locked.
    """

    height: _Side
    width: _Side
    metres_per_pixel: Annotated[float, Field(gt=0, allow_inf_nan=False)]
    sigma_max: Annotated[float, Field(gt=0)]
    cities: Annotated[_Names, Field(max_length=256)]
    attribution: str
    origin: tuple[Finite, Finite] | None
    crs: str | None
    seed: Annotated[int, Field(ge=0, lt=2**63)]
    population: Annotated[int, Field(ge=1, le=2**31)]
    recipe_hash: str
    measures: _Names
    locked: str | None = None
    kind: Literal[tuple(KINDS)] = "fabric"
    settle: bool | Literal["roofs"] = False
    block: _Side | None = None
    recorded: _Names = ()
    marks: Annotated[_Names, AfterValidator(_no_column)] = CROWDING
    figures: _Names = ()
    islands: _Names = ()
    genomes: Literal[GENOMES] = "all"
    thumbnails: Thumbnails | None = None
    shares: Literal["all", "free"] = "all"

    __pydantic_config__ = STRICT

    @property
    def schema_version(self) -> int:
        """The oldest version of the layout that has all of its parts."""
        if self.block is not None:
            return 1 if self.locked is None else 2
        since = {**_SINCE, "kind": 9}
        least = 11 if isinstance(self.settle, str) else 3
        return max(
            [since[key] for key in since if getattr(self, key) != getattr(Header, key)] + [least]
        )

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of all measures."""
        return self.measures + self.recorded

    @property
    def chromosome(self) -> Kind:
        """The kind of the run's genomes."""
        return KINDS[self.kind]

    def to_json(self) -> str:
        """Return the header without spaces, for each file of the log holds it twice."""
        about = asdict(self) | {"schema_version": self.schema_version}
        if self.locked is None:
            del about["locked"]
        version = self.schema_version
        newer = ("block",) if version > 2 else ("kind", "settle")
        for name in (*newer, *(key for key, since in _SINCE.items() if version < since)):
            del about[name]
        about["sigma_max"] = None if np.isinf(self.sigma_max) else self.sigma_max
        return json.dumps(about, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str | bytes, path) -> "Header":
        """Raises `RunError` for another schema version; other errors for damage."""
        about = from_json(text)
        version = about.pop("schema_version")
        check_version(version, path)
        about["sigma_max"] = math.inf if about["sigma_max"] is None else about["sigma_max"]
        header = _header_model().validate_json(json.dumps(about))
        if header.height * header.width > MAX_PIXELS:
            raise ValueError(f"a map of {header.height} × {header.width} px")
        if (version < 3) != (header.block is not None):
            raise ValueError(f"schema version {version} with block = {header.block}")
        if set(header.measures) & set(header.recorded):
            raise ValueError(f"measured and recorded: {header.recorded}")
        if version != header.schema_version:
            stated = ", ".join(f"{name} = {getattr(header, name)}" for name in _SINCE)
            raise ValueError(f"schema version {version} with {stated}")
        if header.thumbnails is not None:
            shape = header.thumbnails.shape(header.height, header.width)
            if max(shape) > LONGEST:
                raise ValueError(f"thumbnails of {shape[0]} × {shape[1]} cells")
        if header.block is not None:
            Pavement(header.height, header.width, header.block)  # raises where they do not fit
        return header


@cache
def _header_model() -> TypeAdapter:
    return TypeAdapter(Header)


@dataclass(frozen=True)
class Birth:
    """One evaluated individual.

    ``values``: measure -> raw value, as far as measures were reached; a recorded measure or a
    constraint may lack its value, and ``error`` says why. ``made``: the parameters and results that
    the operator recorded. ``genome``: None where breeding failed, and where the log leaves it out;
    then ``reconstruction`` says how to breed it again. ``seconds``: of one worker, breeding and
    evaluation. ``feasible``: ok, and no constraint is broken. ``island``: where it was born.
    ``thumbnail``: the logged small map, see `Thumbnails`; not read back with the birth.
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
    feasible: bool = True
    island: str | None = None
    reconstruction: Reconstruction | None = None
    thumbnail: bytes | None = field(default=None, repr=False, compare=False)

    @property
    def ok(self) -> bool:
        """Whether it was bred and measured."""
        return self.status == "ok"

    @property
    def left_out(self) -> bool:
        """Whether the log leaves its genome out."""
        return (
            self.genome is None
            and self.reconstruction is not None
            and self.reconstruction.breedings > 0
        )

    @property
    def digest(self) -> str | None:
        """The hash of its genome, also of one that is left out; None where breeding failed."""
        if self.genome is not None:
            return self.genome.digest
        return self.reconstruction.digest if self.left_out else None


#: Columns of births and membership in which every row has a value.
_NEVER_NULL = frozenset(
    ("generation", "id", "parents", "operator", "made", "status", "seconds", "feasible", "island")
) | {"breedings", "slot", "rank"}


#: Bytes of an error's text in the log, at most.
LONGEST_ERROR = 1000


# The folders before the name of a Python file.
_FOLDERS = re.compile(r"(?<![\w.~])(?:[A-Za-z]:)?[/\\](?:[^\s/\\:()]+[/\\])*(?=[^\s/\\:()]+\.py\b)")


def shortened_error(error: str | None) -> str | None:
    """Return an ``error`` as the log keeps it: in `LONGEST_ERROR` bytes, without control characters
    and the user's folders: only the name of a measure's file, "~" for home."""
    if error is None:
        return None
    text = _FOLDERS.sub("", error[: 4 * LONGEST_ERROR])
    home = str(Path.home())
    text = text.replace(home, "~") if len(home) > 1 else text
    return cut_short(plain_text(text, "\n"), LONGEST_ERROR)


def island_column(header: Header) -> list[tuple[str, pa.DataType]]:
    """Return the column of islands, if there are any."""
    return [("island", _WORD)] if header.islands else []


def births_schema(header: Header) -> pa.Schema:
    """Return the columns of a births file; ``genome`` is the digest, ``made`` a JSON document."""
    columns = [
        ("generation", pa.int32()),
        ("id", pa.int64()),
        *island_column(header),
        ("parents", pa.list_(pa.int64())),
        ("operator", _WORD),
        ("made", pa.string()),
        ("status", _WORD),
        ("error", pa.string()),
        ("seconds", pa.float64()),
        *((f"fitness.{name}", pa.float64()) for name in header.columns),
        ("feasible", pa.bool_()),
        ("genome", pa.string()),
        *reconstruction_fields(header),
        *thumbnail_fields(header),
        *header.chromosome.fields(header),
    ]
    if header.schema_version > 9:
        columns = [(name, _without_nulls(kind)) for name, kind in columns]
    return pa.schema(columns, metadata={ABOUT_RUN: header.to_json()})


def _without_nulls(kind: pa.DataType) -> pa.DataType:
    """A ``kind`` of lists without null elements, which is read a sixth faster; other kinds stay."""
    if not pa.types.is_list(kind):
        return kind
    return pa.list_(kind.value_field.with_nullable(False))


def check_rows(table: pa.Table, header: Header, membership: bool) -> None:
    """Raise ValueError if a ``table`` read from a file lacks a value that every row has; in a
    ``membership`` its marks too, unless islands have their own."""
    marks = header.marks if membership and not header.islands else ()
    for name in set(table.column_names) & {*_NEVER_NULL, *marks}:
        if table[name].null_count:
            raise ValueError(f"a row without {name}")
    for name, known in (("status", STATUSES), ("island", header.islands)):
        if name in table.column_names and not set(words_of(table[name])) <= set(known):
            article = "an" if name == "island" else "a"
            raise ValueError(f"{article} {name} other than {', '.join(known)}")


def births_table(births: Sequence[Birth], header: Header) -> pa.Table:
    """Return an Arrow table with a row per birth, with the columns of `births_schema`."""
    schema = births_schema(header)
    plain_columns = ("generation", "id", "island", "operator", "status", "seconds")
    columns = {name: [getattr(b, name) for b in births] for name in plain_columns} | {
        "parents": [list(b.parents) for b in births],
        "made": [json.dumps(b.made, default=plain) for b in births],
        "error": [shortened_error(b.error) for b in births],
        "feasible": [b.ok and b.feasible for b in births],
        "genome": [b.digest for b in births],
    }
    for name in header.columns:
        columns[f"fitness.{name}"] = [b.values.get(name) for b in births]
    columns |= reconstruction_columns(births, header) | thumbnail_columns(births, header)
    columns |= header.chromosome.columns([b.genome for b in births], header)
    arrays = [
        column.cast(kind.type) if isinstance(column, pa.Array) else pa.array(column, kind.type)
        for kind in schema
        for column in [columns[kind.name]]
    ]
    return pa.table(arrays, schema=schema)


_PLAIN = ("generation", "id", "operator", "status", "error", "seconds", "feasible")


def births_of(
    table: pa.Table, header: Header, condensation: Condensation | None = None
) -> list[Birth]:
    """Return the births of a `births_table`; genomes that are left out stay so."""
    births = []
    for index in range(len(table)):
        row = {name: table.column(name)[index] for name in table.column_names}
        values = {name: row[f"fitness.{name}"].as_py() for name in header.columns}
        plan, genome = reconstruction_in(row, header), None
        made = dict(from_json(row["made"].as_py()))
        if plan is None and row["genome"].is_valid:
            genome = header.chromosome.genome(row, header, condensation, dict(made))
        if genome is not None and genome.digest != row["genome"].as_py():
            raise ValueError(f"the genome of individual {row['id']} is not the one that was bred")
        if row["status"].as_py() == "ok":
            _check_ok(row, values, header.measures if row["feasible"].as_py() else ())
        births.append(
            Birth(
                **{name: row[name].as_py() for name in _PLAIN},
                parents=tuple(row["parents"].as_py()),
                values={name: value for name, value in values.items() if value is not None},
                genome=genome,
                island=row["island"].as_py() if header.islands else None,
                made=made,
                reconstruction=plan,
            )
        )
    return births


def _check_ok(row: Mapping, values: Mapping, measures: Sequence[str]) -> None:
    if not row["genome"].is_valid or any(values[name] is None for name in measures):
        raise ValueError(f"individual {row['id']} without a genome or a value, though it is ok")
    if not all(math.isfinite(value) for value in values.values() if value is not None):
        raise ValueError(f"individual {row['id']} with a value that is not finite, though it is ok")


def check_version(version, path) -> None:
    """Raise `RunError` unless this release reads the ``version``."""
    if version not in SCHEMA_VERSIONS:
        raise RunError(
            f"{path} has run schema version {version}",
            f"a run schema version from {SCHEMA_VERSIONS[0]} to {SCHEMA_VERSIONS[-1]}",
            "read the run with the release of evocity that wrote the run",
        )


def plain(value):
    """Return JSON for values in ``made``: numpy numbers, arrays, tuples."""
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else str(value)
