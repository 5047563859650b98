"""`Again`: how a birth is bred once more, where the log leaves its genome out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

#: Of what births a log holds the genomes.
GENOMES = ("all", "survivors", "front")
#: Births that are bred to have one that is left out, itself and those of its ancestors that are
#: left out too, at most.
MOST_BREEDINGS = 8

_STATE = 37  # bytes of a generator's
_COLUMNS = (
    ("settings", pa.string()),
    ("generator", pa.binary(_STATE)),
    ("breedings", pa.int8()),
)


@dataclass(frozen=True)
class Again:
    """How a birth is bred once more from its parents.

    settings : the parameters of its operator, a JSON object.
    generator : the state of its generator before it was bred, see `state_of`.
    breedings : where the log leaves its genome out, how many births are bred to have it, 1 up to
        `MOST_BREEDINGS`; one that an ancestor of both parents is counts twice. 0 where it is kept.
    digest : of the genome that is left out.
    """

    settings: str
    generator: bytes
    breedings: int = 0
    digest: str | None = None


def again_fields(header) -> list[tuple[str, pa.DataType]]:
    """Columns of births in runs by a ``header`` whose log leaves genomes out; else none."""
    return [] if header.genomes == "all" else list(_COLUMNS)


def again_columns(births: Sequence, header) -> dict[str, list]:
    """These columns of ``births``: null, and no breedings, of those whose genomes are kept."""
    if header.genomes == "all":
        return {}
    told = [one.again if one.left_out else None for one in births]
    columns = {
        name: [None if one is None else getattr(one, name) for one in told] for name, _ in _COLUMNS
    }
    return columns | {"breedings": [one or 0 for one in columns["breedings"]]}


def again_in(row: Mapping, header) -> Again | None:
    """What one row (column -> Arrow scalar) of a births table tells; None where the genome is kept,
    or its breeding failed. Raises ValueError for damage."""
    if header.genomes == "all" or not (breedings := row["breedings"].as_py()):
        return None
    told = {name: row[name].as_py() for name, _ in _COLUMNS} | {"digest": row["genome"].as_py()}
    if None in told.values() or not 1 <= breedings <= MOST_BREEDINGS:
        raise ValueError(f"individual {row['id']} has no genome, nor what it is bred by")
    return Again(**told)


def state_of(rng: np.random.Generator) -> bytes:
    """The state of a PCG64 generator, 37 bytes."""
    told = rng.bit_generator.state
    numbers = told["state"]["state"], told["state"]["inc"]
    return (
        b"".join(one.to_bytes(16, "little") for one in numbers)
        + told["uinteger"].to_bytes(4, "little")
        + bytes([told["has_uint32"]])
    )


def generator_at(state: bytes) -> np.random.Generator:
    """The generator whose state `state_of` told."""
    bits = np.random.PCG64(0)
    bits.state = {
        "bit_generator": "PCG64",
        "state": {
            "state": int.from_bytes(state[:16], "little"),
            "inc": int.from_bytes(state[16:32], "little"),
        },
        "uinteger": int.from_bytes(state[32:36], "little"),
        "has_uint32": state[36] & 1,
    }
    return np.random.Generator(bits)


__all__ = [
    "GENOMES",
    "MOST_BREEDINGS",
    "Again",
    "again_columns",
    "again_fields",
    "again_in",
    "generator_at",
    "state_of",
]
