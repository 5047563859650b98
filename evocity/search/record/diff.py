"""Differences between a birth and its replay: the columns, and both values of each."""

import math
from collections.abc import Mapping

from evocity.store import Birth

#: The event of a search whose replay of a birth differs.
DIFFERS = "differs"


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
