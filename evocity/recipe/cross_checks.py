"""Checks across the valid sections of a recipe: kinds, measures, refinement, targets.

`evocity.recipe.consistency` has the checks that need no valid sections.
"""

from collections.abc import Iterator

from pydantic import BaseModel

from evocity import fitness, operators
from evocity.errors import add_near_miss, spell
from evocity.recipe.islands import island_faults
from evocity.section import Fault

# The data of a birth that only fabric has and measures may take.
_FABRIC_DATA = {"genome", "parents"}


def cross_faults(recipe: BaseModel) -> list[Fault]:
    """List the faults of a `Recipe` whose keys are valid each by itself."""
    checks = (_measures, _parents, _operators, _subjects, _populations, island_faults, _descriptors)
    return [fault for check in (*checks, _refinement, _targets) for fault in check(recipe)]


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
                elif "fabric" not in kind.factors and set(measure.needs) & _FABRIC_DATA:
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
