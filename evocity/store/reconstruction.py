"""`Reconstruction`: how to breed a birth again whose genome the log leaves out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

#: Births whose genomes a log keeps.
GENOMES = ("all", "survivors", "front")
#: Births that are bred to get one that is left out, with its left-out ancestors, at most.
MOST_BREEDINGS = 8

_STATE = 37  # bytes of a generator's state
_COLUMNS = (("settings", pa.string()), ("generator", pa.binary(_STATE)), ("breedings", pa.int8()))


@dataclass(frozen=True)
class Reconstruction:
    """How to breed a birth again from its parents.

    settings : the parameters of its operator, a JSON object.
    generator : the state of its generator before it was bred, see `state_of`.
    breedings : how many births are bred to get a genome that is left out, at most `MOST_BREEDINGS`;
        a common ancestor of both parents counts twice. 0 where the genome is kept.
    digest : of the genome that is left out.
    """

    settings: str
    generator: bytes
    breedings: int = 0
    digest: str | None = None


def reconstruction_fields(header) -> list[tuple[str, pa.DataType]]:
    """Return the columns of a log that leaves genomes out; none for other logs."""
    return [] if header.genomes == "all" else list(_COLUMNS)


def reconstruction_columns(births: Sequence, header) -> dict[str, list]:
    """Return these columns of ``births``: null, and no breedings, where the genome is kept."""
    if header.genomes == "all":
        return {}
    plans = [one.reconstruction if one.left_out else None for one in births]
    columns = {
        name: [None if one is None else getattr(one, name) for one in plans] for name, _ in _COLUMNS
    }
    return columns | {"breedings": [one or 0 for one in columns["breedings"]]}


def reconstruction_in(row: Mapping, header) -> Reconstruction | None:
    """Return the reconstruction in one row (column -> Arrow scalar) of a births table; None where
    the genome is kept, or its breeding failed. Raises ValueError for damage."""
    if header.genomes == "all" or not (breedings := row["breedings"].as_py()):
        return None
    values = {name: row[name].as_py() for name, _ in _COLUMNS} | {"digest": row["genome"].as_py()}
    if None in values.values() or not 1 <= breedings <= MOST_BREEDINGS:
        raise ValueError(f"individual {row['id']} has no genome, and no way to breed it")
    return Reconstruction(**values)


def state_of(rng: np.random.Generator) -> bytes:
    """Return the state of a PCG64 generator, 37 bytes."""
    state = rng.bit_generator.state
    numbers = state["state"]["state"], state["state"]["inc"]
    return (
        b"".join(one.to_bytes(16, "little") for one in numbers)
        + state["uinteger"].to_bytes(4, "little")
        + bytes([state["has_uint32"]])
    )


def generator_at(state: bytes) -> np.random.Generator:
    """Return the generator with a state of `state_of`."""
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
