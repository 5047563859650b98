"""What a row of `membership` holds, and what a generation's summary tells; to and from Arrow."""

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import pyarrow as pa
from pydantic import BaseModel, Field, TypeAdapter

from evocity.store.schema import ABOUT_GENERATIONS, ABOUT_RUN, STRICT, Finite, Header, island_column


@dataclass(frozen=True)
class Member:
    """Who lived in a generation: slot, individual, front (0 = first), and what the run's algorithm
    tells of it besides, by the names of `Header.marks`; on which island, where there are several:
    an individual may live on more than one, and slots count anew on each."""

    slot: int
    id: int
    rank: int
    marks: Mapping[str, float] = field(default_factory=dict)
    island: str | None = None


class IslandSummary(BaseModel):
    """What a generation's summary tells of one island."""

    model_config = STRICT

    living: int = Field(ge=0)
    feasible: int = Field(ge=0)
    hypervolume: Finite | None = None
    best: dict[str, Finite] = Field(default_factory=dict)
    algorithm: dict[str, Finite] = Field(default_factory=dict)


class Summary(BaseModel):
    """What a generation's membership file tells besides its rows; all of it may be lacking."""

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
    """Generation -> what its summary states, by the ``metadata`` of a membership file. Raises
    KeyError, or ValueError for anything else."""
    checked = _SUMMARIES.validate_json(metadata[ABOUT_GENERATIONS])
    return {int(number): about.model_dump(exclude_unset=True) for number, about in checked.items()}


_MEMBERSHIP = (
    ("generation", pa.int32()),
    ("slot", pa.int32()),
    ("id", pa.int64()),
    ("rank", pa.int32()),
)


def membership_schema(header: Header) -> pa.Schema:
    """Columns of a membership file."""
    marks = ((name, pa.float64()) for name in header.marks)
    return pa.schema([*_MEMBERSHIP, *marks, *island_column(header)])


def membership_table(
    generation: int, members: Iterable[Member], summary: Mapping, header: Header
) -> pa.Table:
    """Arrow table of one generation's members; ``summary`` travels in its metadata."""
    members = list(members)
    summaries = json.dumps({str(generation): dict(summary)}, allow_nan=False)
    schema = membership_schema(header).with_metadata(
        {ABOUT_RUN: header.to_json(), ABOUT_GENERATIONS: summaries}
    )
    columns = [[getattr(m, name) for m in members] for name in ("slot", "id", "rank")]
    one = not header.islands  # islands have other marks each
    columns += [
        [m.marks[name] if one else m.marks.get(name) for m in members] for name in header.marks
    ]
    columns += [[m.island for m in members]] if header.islands else []
    return pa.table(
        [
            pa.array(column, kind.type)
            for column, kind in zip([[generation] * len(members), *columns], schema, strict=True)
        ],
        schema=schema,
    )
