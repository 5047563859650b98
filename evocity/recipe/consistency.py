"""Consistency of a recipe's raw tables: map with range blocks, entries with their operators.

`evocity.recipe.cross_checks` has the checks that need valid sections.
"""

import math
from collections.abc import Iterator

from evocity import operators
from evocity.citymap import MAX_SIDE
from evocity.errors import GenomeError, OperatorError, add_near_miss, spell
from evocity.genome import MOST_PARENTS
from evocity.operators.grid import METRES
from evocity.pavement import read_sides
from evocity.pavement.levels import USUAL
from evocity.recipe.islands import merged_operators
from evocity.recipe.mixture import (
    OperatorEntry,
    corners,
    is_range,
    operator_of,
    range_faults,
    split_ranges,
    usual_operators,
)
from evocity.recipe.sections import LARGEST_BLOCK
from evocity.section import Fault, is_whole


def raw_faults(raw: dict) -> list[Fault]:
    """List the faults between the tables of ``raw``; malformed values are skipped."""
    block = _value(raw, "genome", "block", "{}-{}".format(*USUAL))
    sides = _read_sides(block)
    faults = list(_size_faults(raw, block, sides)) if sides else []
    entries = raw.get("operators")
    shared = _mixture_faults(entries, raw, sides) if isinstance(entries, dict) else []
    faults += shared
    usual = {name: dict(entry) for name, entry in usual_operators().items()}
    for key, entries in merged_operators(raw, usual):
        own = _mixture_faults(entries, raw, sides)
        faults += [(key + fault[0], *fault[1:]) for fault in own if fault not in shared]
    return faults


def _size_faults(raw: dict, block, sides: tuple[int, ...]) -> Iterator[Fault]:
    """Yield the faults of map, domains and leaves with range blocks of these ``sides``."""
    pixels, domains = _value(raw, "map", "pixels", 256), _value(raw, "genome", "domains", [2])
    if not is_whole(pixels) or not 0 < pixels <= MAX_SIDE:
        return
    finest, root = sides[0], sides[-1]
    if pixels % root:
        largest = f"genome.block = {root}"
        if len(sides) > 1:
            largest = f"{root}, the largest side of genome.block = {spell(block)}"
        allowed = f"a multiple of {largest}, for example {pixels // root * root or root}"
        yield "map.pixels", str(pixels), allowed
    listed = isinstance(domains, list) and domains and all(map(is_whole, domains))
    if listed and min(domains) * finest > pixels:
        found = f"{spell(domains)} · {finest} px"
        yield "genome.domains", found, f"domain blocks within {pixels} px"
    keys = [key for key in ("lifs", "max_error") if _value(raw, "genome", key, None) is not None]
    if keys and len(sides) == 1:
        allowed = 'none where all range blocks have one side; or block = "2-16"'
        yield f"genome.{keys[0]}", spell(_value(raw, "genome", keys[0], 0)), allowed
    elif len(keys) == 2:
        yield "genome.max_error", "lifs as well", "lifs or max_error, not both"


def _mixture_faults(entries: dict, raw: dict, sides: tuple[int, ...]) -> list[Fault]:
    """List the faults of one mixture of operators."""
    faults = list(_operator_faults(entries))
    metres = _value(raw, "map", "metres_per_pixel", 2.0)
    if len(sides) > 1 and isinstance(metres, int | float):
        faults += _block_size_faults(entries, metres)
    return faults


def _block_size_faults(entries: dict, pixel: float) -> Iterator[Fault]:
    """Yield the faults of sizes in range blocks, where range blocks have many sides."""
    known = operators.operators()
    for name, table in entries.items():
        if name not in known or not isinstance(table, dict):
            continue
        accepted = operators.parameters_of(known[name])
        for key, metric in METRES.items():
            count = table.get(key)
            count = count.get("from") if isinstance(count, dict) else count
            if metric in accepted and is_whole(count) and count > 0:
                found = f"{count} range blocks, which have many sides"
                size = count * (4 * pixel) ** 2 if key == "limit" else count * 4 * pixel
                unit = "m²" if key == "limit" else "m"
                allowed = f"{metric} = {size:g} ({unit}, {count} range blocks of 4 px)"
                yield f"operators.{name}.{key}", found, allowed


def _operator_faults(entries: dict) -> Iterator[Fault]:
    known, weights = operators.operators(), []
    for name, value in entries.items():
        if name not in known:
            found = add_near_miss("unknown operator", name, known)
            found = "; ".join([found, *operators.plugin_warnings()])
            yield f"operators.{name}", found, ", ".join(sorted(known))
            continue
        table = value if isinstance(value, dict) else {"weight": value}
        weight = table.get("weight", 1.0)
        weights.append(weight if isinstance(weight, int | float) else math.nan)
        for key, *rest in dict.fromkeys(_entry_faults(name, known[name], table)):
            yield f"operators.{name}{key}", *rest
    if weights and all(weight == 0 for weight in weights):
        yield "operators", "all weights are 0", "at least one weight above 0"


def _entry_faults(name: str, kind: type, table: dict) -> Iterator[Fault]:
    """Yield the faults of one operator's table, except in the keys that `OperatorEntry` checks."""
    own, accepted = list(OperatorEntry.model_fields), operators.parameters_of(kind)
    for key in table:
        if key not in own + accepted:
            found = add_near_miss("unknown key", key, own + accepted)
            yield f".{key}", found, ", ".join(own + accepted)
    fewest, most = kind.parents
    count = table.get("parents", fewest)
    if not is_whole(count) or not 0 < count <= MOST_PARENTS:
        count = None
    elif not fewest <= count <= (count if most is None else most):
        yield ".parents", str(count), f"{fewest} or more" if most is None else f"{fewest} to {most}"
        count = None
    given = {key: value for key, value in table.items() if key in accepted}
    for key, value in list(given.items()):
        if is_range(kind, key, value) and (faults := range_faults(kind, key, value)):
            yield from ((f".{place}", *rest) for place, *rest in faults)
            del given[key]
    fixed, ranges = split_ranges(kind, given)
    for ends in corners(ranges):
        values = {key: given[key][end] for key, end in ends.items()}
        for key, fault in _parameter_faults(name, fixed | values, count).items():
            place = "".join(f".{part}" for part in (key, ends.get(key)) if part)
            yield place, *fault


def _parameter_faults(name: str, given: dict, count: int | None) -> dict[str, tuple[str, str]]:
    """Map an operator's parameters at fault, for a ``count`` of parents, to (found, allowed); ""
    stands for a fault of several."""
    try:
        operator = operator_of(name, given, None)
        if count is not None and hasattr(operator, "check_count"):
            operator.check_count(count)
    except OperatorError as error:
        return dict(error.faults) or {"": (error.found, error.expected)}
    return {}


def _value(raw: dict, section: str, key: str, default):
    part = raw.get(section, {})
    return part.get(key, default) if isinstance(part, dict) else default


def _read_sides(block) -> tuple[int, ...]:
    """Read the sides of range blocks, the finest first; none if ``block`` is at fault."""
    try:
        sides = read_sides(str(block))
    except GenomeError:
        return ()
    sides = (sides,) if isinstance(sides, int) else sides
    return sides if sides[0] > 1 and sides[-1] <= LARGEST_BLOCK else ()
