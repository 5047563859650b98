"""Do the parts of a recipe agree: sections with each other, entries with their operators?"""

import math

from evocity import operators
from evocity.citymap import MAX_SIDE
from evocity.errors import OperatorError, shown, with_near_miss
from evocity.search.recipe import MOST_PARENTS, OperatorEntry, operator_of


def across_sections(raw: dict) -> list[tuple[str, str, str]]:
    """Faults (key, found, allowed) between sections, as far as ``raw`` is well-formed."""
    faults = []
    pixels, block, domains = (
        _of(raw, "map", "pixels", 256),
        _of(raw, "genome", "block", 4),
        _of(raw, "genome", "domains", [2]),
    )
    sized = _whole(pixels) and _whole(block)
    if sized and 0 < pixels <= MAX_SIDE and 1 < block <= MAX_SIDE:
        if pixels % block:
            low = pixels // block * block
            fits = f"a multiple of genome.block = {block}, for example {low or block}"
            faults.append(("map.pixels", str(pixels), fits))
        listed = isinstance(domains, list) and domains and all(map(_whole, domains))
        if listed and min(domains) * block > pixels:
            found = f"{shown(domains)} · {block} px"
            faults.append(("genome.domains", found, f"domain blocks within {pixels} px"))
    entries = raw.get("operators")
    if isinstance(entries, dict):
        faults += _operator_faults(entries)
    return faults


def _operator_faults(entries: dict) -> list[tuple[str, str, str]]:
    known, faults, weights = operators.operators(), [], []
    for name, value in entries.items():
        if name not in known:
            found = with_near_miss("unknown operator", name, known)
            found = "; ".join([found, *operators.plugin_warnings()])
            faults.append((f"operators.{name}", found, ", ".join(sorted(known))))
            continue
        table = value if isinstance(value, dict) else {"weight": value}
        weight = table.get("weight", 1.0)
        weights.append(weight if isinstance(weight, int | float) else math.nan)
        for key, found, allowed in _entry_faults(name, known[name], table):
            faults.append((f"operators.{name}{key}", found, allowed))
    if weights and all(weight == 0 for weight in weights):
        faults.append(("operators", "all weights are 0", "at least one weight above 0"))
    return faults


def _entry_faults(name: str, kind: type, table: dict) -> list[tuple[str, str, str]]:
    """Faults of one operator's table, whose own keys `OperatorEntry` checks."""
    own, accepted = list(OperatorEntry.model_fields), operators.parameters_of(kind)
    faults = []
    for key in table:
        if key not in own + accepted:
            found = with_near_miss("unknown key", key, own + accepted)
            faults.append((f".{key}", found, ", ".join(own + accepted)))
    fewest, most = kind.parents
    count = table.get("parents", fewest)
    whole = _whole(count) and 0 < count <= MOST_PARENTS
    if whole and not fewest <= count <= (count if most is None else most):
        allowed = f"{fewest} or more" if most is None else f"{fewest} to {most}"
        faults.append((".parents", str(count), allowed))
        whole = False
    try:
        given = {key: value for key, value in table.items() if key in accepted}
        operator = operator_of(name, given, None)
        if whole and hasattr(operator, "check_count"):
            operator.check_count(count)
    except OperatorError as error:
        parts = {f".{key}": told for key, told in error.faults.items()}
        parts = parts or {"": (error.found, error.expected)}
        faults += [(key, found, allowed) for key, (found, allowed) in parts.items()]
    return faults


def _of(raw: dict, section: str, key: str, default):
    part = raw.get(section, {})
    return part.get(key, default) if isinstance(part, dict) else default


def _whole(value) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
