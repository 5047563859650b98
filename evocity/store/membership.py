"""Rows of `membership` and the summaries of generations, to and from Arrow."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import pyarrow as pa
from pydantic import BaseModel, Field, TypeAdapter

from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN, STRICT, Finite, Header, island_column


@dataclass(frozen=True)
class Member:
    """A living individual of a generation: slot, id, front (0 = first), and the algorithm's values,
    named by `Header.marks`. ``island``: where it lives; an individual may live on several islands,
    and slots count on each island."""

    slot: int
    id: int
    rank: int
    marks: Mapping[str, float] = field(default_factory=dict)
    island: str | None = None


class IslandSummary(BaseModel):
    """The summary of one island."""

    model_config = STRICT

    living: int = Field(ge=0)
    feasible: int = Field(ge=0)
    hypervolume: Finite | None = None
    best: dict[str, Finite] = Field(default_factory=dict)
    algorithm: dict[str, Finite] = Field(default_factory=dict)


class Summary(BaseModel):
    """The summary of a generation; each part may be missing."""

    model_config = STRICT

    births: int = Field(0, ge=0)
    failures: int = Field(0, ge=0)
    hypervolume: Finite | None = None
    best: dict[str, Finite] = Field(default_factory=dict)
    evaluations_per_second: Finite | None = None
    algorithm: dict[str, Finite] = Field(default_factory=dict)
    islands: dict[str, IslandSummary] = Field(default_factory=dict)


_SUMMARIES = TypeAdapter(dict[str, Summary])


def summaries_of(metadata: Mapping[bytes, bytes]) -> dict[int, dict]:
    """Return generation -> summary, by the ``metadata`` of a membership file. Raises KeyError,
    ValueError."""
    checked = _SUMMARIES.validate_json(metadata[ABOUT_GENERATIONS])
    return {int(number): about.model_dump(exclude_unset=True) for number, about in checked.items()}


_MEMBERSHIP = (
    ("generation", pa.int32()),
    ("slot", pa.int32()),
    ("id", pa.int64()),
    ("rank", pa.int32()),
)


def membership_schema(header: Header) -> pa.Schema:
    """Return the columns of a membership file."""
    marks = ((name, pa.float64()) for name in header.marks)
    return pa.schema([*_MEMBERSHIP, *marks, *island_column(header)])


def membership_table(
    generation: int, members: Iterable[Member], summary: Mapping, header: Header
) -> pa.Table:
    """Return an Arrow table of one generation's members, with its ``summary`` in the metadata."""
    members = list(members)
    about = {str(generation): dict(summary)}
    summaries = json.dumps(about, allow_nan=False, separators=(",", ":"))
    schema = membership_schema(header).with_metadata(
        {ABOUT_RUN: header.to_json(), ABOUT_GENERATIONS: summaries}
    )
    columns = [[getattr(m, name) for m in members] for name in ("slot", "id", "rank")]
    alone = not header.islands  # each island has its own marks
    columns += [
        [m.marks[name] if alone else m.marks.get(name) for m in members] for name in header.marks
    ]
    columns += [[m.island for m in members]] if header.islands else []
    return pa.table(
        [
            pa.array(column, kind.type)
            for column, kind in zip([[generation] * len(members), *columns], schema, strict=True)
        ],
        schema=schema,
    )
