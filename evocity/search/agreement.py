"""Do the parts of a recipe agree: sections with each other, entries with their operators?"""

import math

from evocity import operators
from evocity.citymap import MAX_SIDE
from evocity.errors import GenomeError, OperatorError, shown, with_near_miss
from evocity.genome import MOST_PARENTS
from evocity.operators.grid import METRES
from evocity.pavement import read_sides
from evocity.pavement.levels import USUAL
from evocity.search.islands import merged_operators
from evocity.search.mixture import (
    OperatorEntry,
    corners,
    is_range,
    operator_of,
    parted,
    range_faults,
    usual_operators,
)
from evocity.search.sections import LARGEST_BLOCK


def across_sections(raw: dict) -> list[tuple[str, str, str]]:
    """Faults (key, found, allowed) between sections, as far as ``raw`` is well-formed."""
    faults = []
    pixels, domains = _of(raw, "map", "pixels", 256), _of(raw, "genome", "domains", [2])
    block = _of(raw, "genome", "block", "{}-{}".format(*USUAL))
    sides = _sides(block)
    if sides and _whole(pixels) and 0 < pixels <= MAX_SIDE:
        finest, root = sides[0], sides[-1]
        if pixels % root:
            low = pixels // root * root
            of = f"{root}, the largest side of genome.block = {shown(block)}"
            of = of if len(sides) > 1 else f"genome.block = {root}"
            fits = f"a multiple of {of}, for example {low or root}"
            faults.append(("map.pixels", str(pixels), fits))
        listed = isinstance(domains, list) and domains and all(map(_whole, domains))
        if listed and min(domains) * finest > pixels:
            found = f"{shown(domains)} · {finest} px"
            faults.append(("genome.domains", found, f"domain blocks within {pixels} px"))
        choices = [
            key for key in ("lifs", "max_error") if _of(raw, "genome", key, None) is not None
        ]
        if choices and len(sides) == 1:
            allowed = 'none where all range blocks have one side; or block = "2-16"'
            faults.append(
                (f"genome.{choices[0]}", shown(_of(raw, "genome", choices[0], 0)), allowed)
            )
        elif len(choices) == 2:
            faults.append(("genome.max_error", "lifs as well", "lifs or max_error, not both"))
    entries = raw.get("operators")
    own = _mixture_faults(entries, raw, sides) if isinstance(entries, dict) else []
    faults += own
    usual = {name: dict(entry) for name, entry in usual_operators().items()}
    for key, entries in merged_operators(raw, usual):
        told = _mixture_faults(entries, raw, sides)
        faults += [(key + fault[0], *fault[1:]) for fault in told if fault not in own]
    return faults


def _mixture_faults(entries: dict, raw: dict, sides: tuple[int, ...]) -> list[tuple[str, str, str]]:
    """Faults of one mixture of operators."""
    faults = _operator_faults(entries)
    metres = _of(raw, "map", "metres_per_pixel", 2.0)
    if len(sides) > 1 and isinstance(metres, int | float):
        faults += _sizes_in_blocks(entries, metres)
    return faults


def _sizes_in_blocks(entries: dict, pixel: float) -> list[tuple[str, str, str]]:
    """Faults of sizes in range blocks, which leaves of many sides give no meaning."""
    faults, known = [], operators.operators()
    for name, table in entries.items():
        if name not in known or not isinstance(table, dict):
            continue
        accepted = operators.parameters_of(known[name])
        for key, metric in METRES.items():
            count = table.get(key)
            count = count.get("from") if isinstance(count, dict) else count
            if metric in accepted and _whole(count) and count > 0:
                found = f"{count} range blocks, of many sides"
                size = count * (4 * pixel) ** 2 if key == "limit" else count * 4 * pixel
                unit = "m²" if key == "limit" else "m"
                allowed = f"{metric} = {size:g} ({unit}, {count} range blocks of 4 px)"
                faults.append((f"operators.{name}.{key}", found, allowed))
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
    given = {key: value for key, value in table.items() if key in accepted}
    for key, value in list(given.items()):
        if is_range(kind, key, value) and (found := range_faults(kind, key, value)):
            faults += [(f".{place}", *told) for place, *told in found]
            del given[key]
    fixed, ranges = parted(kind, given)
    for ends in corners(ranges):
        standing = {key: given[key][end] for key, end in ends.items()}
        for key, told in _faults_of(name, fixed | standing, count if whole else None).items():
            place = "".join(f".{part}" for part in (key, ends.get(key)) if part)
            faults.append((place, *told))
    return list(dict.fromkeys(faults))


def _faults_of(name: str, given: dict, count: int | None) -> dict[str, tuple[str, str]]:
    """Faults of an operator's parameters, and of them for a ``count`` of parents: parameter, or ""
    for none of them, -> (found, allowed)."""
    try:
        operator = operator_of(name, given, None)
        if count is not None and hasattr(operator, "check_count"):
            operator.check_count(count)
    except OperatorError as error:
        return dict(error.faults) or {"": (error.found, error.expected)}
    return {}


def _of(raw: dict, section: str, key: str, default):
    part = raw.get(section, {})
    return part.get(key, default) if isinstance(part, dict) else default


def _sides(block) -> tuple[int, ...]:
    """The sides that ``block`` names, the finest first; none if it is at fault."""
    try:
        sides = read_sides(str(block))
    except GenomeError:
        return ()
    sides = (sides,) if isinstance(sides, int) else sides
    return sides if sides[0] > 1 and sides[-1] <= LARGEST_BLOCK else ()


def _whole(value) -> bool:
    return isinstance(value, int) and not isinstance(value, bool)
