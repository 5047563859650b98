"""Runs whose omitted genomes are bred again, and differences between a birth and its replay.

Nothing of a run is executed: evocity's own operators breed, and those of installed packages.
"""

import json
import math
from collections.abc import Mapping, Sequence

from evocity import store
from evocity.condensation import Condensation
from evocity.genome import Genome
from evocity.store import Birth, Header, generator_at

#: The event of a search whose replay of a birth differs.
DIFFERS = "differs"


def rebreed(
    birth: Birth, parents: Sequence[Genome], header: Header, condensation: Condensation | None
) -> Genome:
    """Breed a ``birth`` whose genome the log omits, from its ``parents``; its ``made`` is as in the
    log. Raises whatever its operator does."""
    from evocity import operators  # most runs are read without

    settings = json.loads(birth.reconstruction.settings)
    settings = operators.with_older_values(birth.operator, settings)
    operator = operators.make(birth.operator, **settings)
    child = header.chromosome.breed(operator, parents, generator_at(birth.reconstruction.generator))
    return header.chromosome.adopt(child, header, condensation, birth.made)


class CompleteRun(store.RunLog):
    """A run folder, read only, as `evocity.store.RunLog`. A genome that its log omits (``[log]
    genomes`` of its recipe) is bred again when it is read, and compared with its hash."""

    _rebreed = staticmethod(rebreed)


def differences(then: Birth, now: Birth) -> dict[str, dict]:
    """Find the columns in which two births differ, bit for bit: column -> {"then", "now"}, see
    `evocity.search.resume.replay.Replayed`."""
    pairs = {
        "parents": (list(then.parents), list(now.parents)),
        "operator": (then.operator, now.operator),
        "status": (then.status, now.status),
        "genome": (then.digest, now.digest),
    }
    names = dict.fromkeys([*then.values, *now.values])
    pairs |= {f"fitness.{name}": (then.values.get(name), now.values.get(name)) for name in names}
    return {
        column: {"then": before, "now": after}
        for column, (before, after) in pairs.items()
        if _bits(before) != _bits(after)
    }


def json_differences(differs: Mapping[str, Mapping]) -> dict[str, dict]:
    """Convert `differences` for JSON, which has no infinity and no NaN."""
    return {
        column: {when: _finite(value) for when, value in pair.items()}
        for column, pair in differs.items()
    }


def describe_differences(differs: Mapping[str, Mapping]) -> str:
    """Describe `differences` in one line."""
    return "; ".join(f"{key} was {one['then']}, is {one['now']}" for key, one in differs.items())


def _finite(value):
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def _bits(value):
    """All bits of a number: 0.0 is not -0.0, NaN is NaN."""
    return value.hex() if isinstance(value, float) else value
