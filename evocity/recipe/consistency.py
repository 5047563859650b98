"""Consistency of a recipe: faults between its raw tables, and between its valid sections."""

import math
from collections.abc import Iterator

from pydantic import BaseModel
from pydantic_core import PydanticCustomError

from evocity import fitness, operators
from evocity.citymap import MAX_SIDE
from evocity.errors import OperatorError, add_near_miss, is_whole, spell
from evocity.fitness.part import own_name
from evocity.genome import MOST_PARENTS
from evocity.operators.grid import METRES
from evocity.pavement.levels import USUAL
from evocity.recipe.islands import island_faults, merged_operators
from evocity.recipe.mixture import (
    LEVER_OF,
    OperatorEntry,
    corners,
    is_range,
    operator_of,
    range_faults,
    split_ranges,
    usual_operators,
)
from evocity.recipe.sections import read_block
from evocity.section import Fault


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
    """Map an operator's parameters at fault to (found, allowed); "" stands for several at once."""
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
    try:
        sides = read_block(block)
    except PydanticCustomError:
        return ()
    return (sides,) if isinstance(sides, int) else sides


# -- valid sections ------------------------------------------------------------------------------


def cross_faults(recipe: BaseModel) -> list[Fault]:
    """List the faults of a `Recipe` whose keys are valid each by itself."""
    checks = (_measures, _parents, _operators, _subjects, _populations, island_faults, _descriptors)
    return [
        fault
        for check in (*checks, _refinement, _steering, _targets, _shares, _plans)
        for fault in check(recipe)
    ]


def _measures(recipe: BaseModel) -> Iterator[Fault]:
    """Measures named twice, and sums named like measures."""
    names = [measure.name for measure in recipe.measures]
    places: dict[str, list[int]] = {}  # of recorded measures
    for number, entry in enumerate(recipe.run.record):
        for measure in entry.measures:
            places.setdefault(measure.name, []).append(number)
    for name in sorted({name for name in names if names.count(name) > 1}):
        yield "fitness", f"{name} twice", _each_once(name)
    for name, at in places.items():
        if len(at) > 1:
            yield f"run.record[{at[1]}]", f"{name} twice", _each_once(name)
    for name, at in places.items():
        if name in names:
            found = f"{name}, which is in [[fitness]] too"
            yield f"run.record[{at[0]}]", found, "other measures: [[fitness]] logs this one already"
    if not any(entry.is_objective for entry in recipe.fitness):
        yield "fitness", "only constraints", "a measure to search by as well"
    sums = {entry.total for entry in recipe.fitness} - {None}
    for name in sorted(sums.intersection([*names, *places])):
        yield "fitness", f"objective = {name!r}, which is a measure", "a name that no measure has"


def _each_once(name: str) -> str:
    return "each measure once" + (" a part; a label tells parts apart" if "@" in name else "")


def _parents(recipe: BaseModel) -> Iterator[Fault]:
    """Parents and courses that the kind of chromosome does not have."""
    kind = recipe.kind
    for number, parent in enumerate(recipe.parents):
        if not parent.bred and parent.given not in kind.sources:
            allowed = f"{' or '.join(kind.sources)}; or genome, or run and id, of a {kind.name}"
            yield f"parents[{number}].{parent.given}", f"in a run of {kind.name}s", allowed
    if recipe.curves and kind.name != "site":
        found = f"in a run of kind {spell(kind.name)}"
        yield "curves", found, 'no curves; or kind = "site" in [run]'
    if kind.name == "site" and not recipe.curves:
        yield "curves", "missing", "one [[curves]] or more, with width and from, or start and end"
    pixel, side = recipe.map.metres_per_pixel, recipe.map.pixels * recipe.map.metres_per_pixel
    for number, course in enumerate(recipe.curves):
        if not pixel <= course.width <= side:
            found = f"{course.width:g} m, with pixels of {pixel:g} m"
            yield f"curves[{number}].width", found, f"{pixel:g} to {side:g} m, a pixel or wider"
        for key in ("start", "end"):
            point = getattr(course, key)
            if point is not None and not all(0 <= one <= side for one in point):
                allowed = f"within the window, 0 to {side:g} m"
                yield f"curves[{number}].{key}", spell(list(point)), allowed


def _operators(recipe: BaseModel) -> Iterator[Fault]:
    """Operators and algorithms that breed another kind of chromosome."""
    kind, known = recipe.kind, operators.operators()
    for local in recipe.local:
        for name in filter(known.get, local.breeding):  # `consistency` reports unknown ones
            bred = operators.bred_by(known[name])
            if bred not in kind.factors:
                key = f"operators.{name}" if name in local.operators else "search.algorithm"
                if local.refine.births and name == local.refine.operator:
                    key = "refine.births"
                allowed = ", ".join(operators.operators(kind.factors))
                yield key, f"it breeds {bred}, the run {kind.name}", allowed
    if recipe.refine.births and kind.name != "fabric":
        yield "refine.births", f"in a run of {kind.name}s", "0: refinement tunes only fabrics"
    if kind.name != "fabric" and any(one.search.breeds_by for one in recipe.local):
        yield "search.algorithm", "it breeds fabrics by itself", "one that breeds by the operators"


def _subjects(recipe: BaseModel) -> Iterator[Fault]:
    """Measures and locks of something that the kind of chromosome does not have."""
    kind = recipe.kind
    for key, entries in (("fitness", recipe.fitness), ("run.record", recipe.run.record)):
        for number, entry in enumerate(entries):
            place = f"{key}[{number}]"
            for measure in entry.measures:
                if measure.of not in kind.subjects:
                    found = f"{measure.name}, a measure of a {measure.of}"
                    allowed = f"measures of a {' or of a '.join(kind.subjects)}"
                    yield f"{place} ({measure.name})", found, allowed
                elif measure.of != "city" and entry.within is not None:
                    yield (
                        f"{place}.within",
                        f"for a measure of a {measure.of}",
                        "a measure of a city",
                    )
                elif measure.of != "city" and getattr(entry, "like", None) is not None:
                    found = f"for {measure.name}, a measure of a {measure.of}"
                    yield f"{place}.like", found, "a target: a city has no such value"
                elif "fabric" not in kind.factors and {"genome", "parents"} & set(measure.needs):
                    found = f"{measure.name} needs data that a {kind.name} does not have"
                    yield f"{place} ({measure.name})", found, "a measure of only the map"
    if recipe.locked.given and "fabric" not in kind.factors:
        yield "locked", f"in a run of {kind.name}s", "no lock: only fabrics have locked pixels"


def _populations(recipe: BaseModel) -> Iterator[Fault]:
    """Populations too small for the parents, or for the algorithm."""
    parents = len(recipe.parents)
    if recipe.run.population < parents:
        allowed = f"{parents} or more, one for each of the parents"
        yield "run.population", str(recipe.run.population), allowed
    if not recipe.islands:
        yield from recipe.search.faults(len(recipe.goals), recipe.run.population, parents)
    births, allowed = recipe.search.births, ""
    if births is None:
        return
    if recipe.islands:
        found, allowed = f"with {len(recipe.islands)} islands", "each breeds as many as live on it"
    elif recipe.search.breeds_by is not None:
        found = f"with the algorithm {recipe.search.algorithm!r}"
        allowed = "it breeds one child of each individual"
    elif recipe.search.window is not None:
        found, allowed = "with a window", "births enter it one at a time"
    if allowed:
        yield "search.births", f"{births}, {found}", f"no births: {allowed}"
    elif births < parents:
        yield "search.births", str(births), f"{parents} or more, one for each of the parents"


def _descriptors(recipe: BaseModel) -> Iterator[Fault]:
    """Measures that an algorithm needs of every birth, and that nothing measures."""
    own = [measure.name for measure in [*recipe.measures, *recipe.recorded]]
    known = sorted({*own, *(measure.name for measure in fitness.measures())})
    keys = [f"islands[{number}]" for number in range(len(recipe.islands))] or ["search"]
    for key, local in zip(keys, recipe.local, strict=True):
        for name in local.search.described:
            if name not in own:
                found = add_near_miss(f"no measure {spell(name)} of one number", name, known)
                allowed = f"a measure of evocity, [[fitness]] or run.record: {', '.join(own)}"
                yield f"{key}.descriptors", found, allowed


def _shares(recipe: BaseModel) -> Iterator[Fault]:
    """Bounds on `smallest_share` that no child of so many parents keeps."""
    count = len(recipe.parents)
    for number, entry in enumerate(recipe.fitness):
        names = {own_name(measure.name) for measure in entry.measures}
        if fitness.smallest_share.name not in names or entry.min is None:
            continue
        found = f"{entry.min:g} for smallest_share, with {count} parent{'s' * (count > 1)}"
        if count == 1:
            allowed = "no bound on smallest_share: the lone parent always has all"
            yield f"fitness[{number}].min", found, allowed
        elif entry.min > 1 / count:
            allowed = f"{math.floor(100 / count) / 100:g} or less: each of {count} equal shares"
            yield f"fitness[{number}].min", found, allowed


def _plans(recipe: BaseModel) -> Iterator[Fault]:
    """Niches of plans in a run whose chromosomes have no plan."""
    if recipe.kind.name == "fabric":
        return
    keys = [f"islands[{number}]" for number in range(len(recipe.islands))] or ["search"]
    for place, local in zip(keys, recipe.local, strict=True):
        for key in ("per_plan", "source_plans", "mates"):
            if value := local.search.settings.get(key, 0):
                found = f"{value:g}, in a run of kind {spell(recipe.kind.name)}"
                yield f"{place}.{key}", found, "0: only fabrics have plans of streets"


def _steering(recipe: BaseModel) -> Iterator[Fault]:
    """Steering of a run whose births, or whose targets, have no levers."""
    steer = recipe.search.steer
    if not steer:
        return
    entries = [one for one in recipe.fitness if one.target is not None or one.like is not None]
    targets = {measure.name for entry in entries for measure in entry.measures}
    if recipe.kind.name != "fabric":
        found = f"in a run of kind {spell(recipe.kind.name)}"
        yield "search.steer", f"{steer:g}, {found}", "0: only fabrics have levers"
    elif recipe.search.breeds_by is not None:
        found = f"with the algorithm {recipe.search.algorithm!r}"
        yield "search.steer", f"{steer:g}, {found}", "0: this algorithm breeds by itself"
    elif not targets:
        found = f"{steer:g}, but no goal has a target"
        yield "search.steer", found, f"0; or a target, or like, for {', '.join(LEVER_OF)}"
    elif targets.isdisjoint(LEVER_OF):
        found = f"{steer:g}, but no goal with a target has a lever"
        yield "search.steer", found, f"0; or a target, or like, for {', '.join(LEVER_OF)}"


def _refinement(recipe: BaseModel) -> Iterator[Fault]:
    """More refined births than births, or an algorithm that breeds by itself."""
    births, population = recipe.refine.births, min(map(len, recipe.slots))
    if births > population:
        on = " on the smallest island" if recipe.islands else ""
        found = f"{births} of {population} births a generation{on}"
        yield "refine.births", found, f"{population} or fewer"
    if births and not recipe.islands and recipe.search.breeds_by is not None:
        found = f"{births}, with the algorithm {recipe.search.algorithm!r}"
        yield "refine.births", found, "0: this algorithm breeds by itself"


def _targets(recipe: BaseModel) -> Iterator[Fault]:
    """Targets of ``[stop]`` that no birth can reach."""
    entries = {
        measure.name: entry
        for entry in recipe.fitness
        if entry.is_objective
        for measure in entry.measures
    }
    goals = {measure.name: measure.goal for measure in recipe.measures}
    for name, value in recipe.stop.target.items():
        key = f"stop.target.{name}"
        if name not in entries:
            found = add_near_miss(f"{spell(name)}, which is not a goal", name, entries)
            yield key, found, ", ".join(entries)
            continue
        entry, (low, high) = entries[name], recipe.limits[name]
        if entry.target is not None or entry.like is not None:
            if value < 0:
                yield key, f"{value:g}", "the distance from the entry's target, 0 or more"
        elif not (value <= high if (entry.goal or goals[name]) == "max" else value >= low):
            yield key, f"{value:g}", f"within its range, {low:g}…{high:g}"
