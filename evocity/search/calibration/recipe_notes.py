"""Notes on the goals, bounds and maps of a new recipe: what its user may want to change."""

import math
from collections.abc import Mapping, Sequence

from evocity.citymap import CityMap
from evocity.search.calibration.recipe_text import Bound, Goal


def notes_on(
    goals: Sequence[Goal], bounds: Sequence[Bound], values: Mapping, cities: Sequence[CityMap]
) -> list[str]:
    """Return notes on the ``goals`` and ``bounds`` of a recipe, in view of the ``values`` that the
    parents have, measure -> parent -> (of the map, of the code), and on the maps of the
    ``cities``."""
    first = cities[0]
    return [
        *_note_heights(goals, first),
        *_note_mixed_heights(cities),
        *_note_reached(goals, first.name),
        *_note_best(goals, values),
        *_note_beyond(goals, values),
        *_note_unkept(goals, bounds, values),
        *_note_idle(goals),
        *_note_uncredited(cities),
    ]


def _note_heights(goals: Sequence[Goal], first: CityMap) -> list[str]:
    """A note on targets that rest on heights missing in the ``first`` parent's file."""
    if not _lacks_heights(first):
        return []
    higher = first.replace(2 * first.heights)
    measures = [goal.measure for goal in goals if goal.of_first or goal.lacks_target]
    measures = [measure for measure in measures if not measure.takes]
    names = [measure.name for measure in measures if measure(first) != measure(higher)]
    if not names:
        return []
    which = "its target rests" if len(names) == 1 else "their targets rest"
    return [
        f"{', '.join(names)}: {which} on heights that {first.name} lacks; write another into the "
        "recipe, or put another city first"
    ]


def _lacks_heights(city: CityMap) -> bool:
    """Whether half of the buildings have no height in their file."""
    rules = city.height_rules
    return 2 * rules.get("default", 0) >= max(1, sum(rules.values()))


def _note_mixed_heights(cities: Sequence[CityMap]) -> list[str]:
    """A note on parents without heights beside parents with heights."""
    lacking = [city for city in cities if _lacks_heights(city)]
    if not lacking or len(lacking) == len(cities):
        return []
    names = " and ".join(city.name for city in lacking)
    return [
        f"{names}: most buildings have no height in the file and get the default, but other "
        "parents have heights. Children lower or raise buildings to those around them, so many "
        "become equally high; give real heights, or set --default-height to the usual height there"
    ]


def _note_uncredited(cities: Sequence[CityMap]) -> list[str]:
    """A note on maps whose files have no attribution."""
    names = [city.name for city in cities if not city.attribution]
    if not names:
        return []
    return [
        f"{', '.join(names)}: the file has no attribution, so pictures and files of children will "
        "not name its source; if the licence asks for a line, write it as attribution under "
        "[[parents]] in the recipe"
    ]


def _note_reached(goals: Sequence[Goal], first: str) -> list[str]:
    names = [goal.measure.name for goal in goals if goal.of_first]
    if not names:
        return []
    return [
        f"{', '.join(names)}: the target is what the code of {first} has, so {first} has reached "
        "it before the run begins; write another target to breed towards"
    ]


def _note_best(goals: Sequence[Goal], values: Mapping) -> list[str]:
    """Notes on goals of which some parents, but not all, have the best value."""
    notes = []
    for goal in goals:
        if goal.direction is None:
            continue
        best = goal.measure.range[goal.direction == "max"]
        of_parents = {name: code for name, (_, code) in values[goal.measure.name].items()}
        reached = [name for name, code in of_parents.items() if code == best]
        if reached and len(reached) < len(of_parents):
            have, them = ("have", "these") if len(reached) > 1 else ("has", "it")
            notes.append(
                f"{goal.measure.name}: {' and '.join(reached)} {have} {best:g} already, the best "
                f"possible value; children of only {them} may win, which a bound in place of the "
                "goal prevents"
            )
    return notes


def _note_beyond(goals: Sequence[Goal], values: Mapping) -> list[str]:
    """Notes on bounds and targets that lie beyond the values of all parents' maps and codes."""
    notes = []
    for goal in goals:
        given = [*goal.bounds.values(), *([] if goal.target is None else [goal.target])]
        of_parents = [
            value
            for pair in values[goal.measure.name].values()
            for value in pair
            if not math.isnan(value)
        ]
        if not given or not of_parents or goal.of_parents or goal.of_first:
            continue
        low, high = goal.bounds.get("min", -math.inf), goal.bounds.get("max", math.inf)
        if goal.target is not None:
            low, high = max(low, goal.target), min(high, goal.target)
        least, most = min(of_parents), max(of_parents)
        if low > most or high < least:
            near, way = (low, "more than") if low > most else (high, "less than")
            notes.append(
                f"{goal.measure.name}: {near:g} is {way} any parent has ({least:.3g} to "
                f"{most:.3g}), so a mixture of them may not reach it; choose a parent with "
                f"{'more' if low > most else 'less'}, or another number"
            )
    return notes


def _note_unkept(goals: Sequence[Goal], bounds: Sequence[Bound], values: Mapping) -> list[str]:
    """Notes on bounds that no parent's own code keeps. Codes need not keep a bound on
    `smallest_share`; `_note_beyond` has the user's bounds that no map keeps either."""
    given = [(goal.measure, goal.bounds) for goal in goals if goal.bounds and goal.within is None]
    beyond = [keys for _, keys in given]
    given += [(bound.measure, bound.keys) for bound in bounds]
    notes = []
    for measure, keys in given:
        codes = [code for _, code in values[measure.name].values()]
        low, high = keys.get("min", -math.inf), keys.get("max", math.inf)
        kept = any(low <= code <= high for code in codes)  # NaN keeps no bound
        maps = [of_map for of_map, _ in values[measure.name].values()]
        if keys in beyond and not any(low <= of_map <= high for of_map in maps):
            continue
        if not kept and measure.name != "smallest_share":
            listed = " and ".join(f"{key} = {value:g}" for key, value in keys.items())
            reached = [f"{code:.3g}" for code in codes if not math.isnan(code)]
            notes.append(
                f"{measure.name}: no parent's own code keeps {listed} (the codes have "
                f"{', '.join(reached) or 'no value'}), so no city of the first generation may keep "
                "it; widen the bound, or choose other parents"
            )
    return notes


def _note_idle(goals: Sequence[Goal]) -> list[str]:
    """Notes on bounds of the user that all values of a measure keep."""
    notes = []
    for goal in goals:
        low, high = goal.measure.range
        if (
            goal.bounds
            and goal.bounds.get("min", low) <= low
            and goal.bounds.get("max", high) >= high
        ):
            notes.append(
                f"{goal.measure.name}: its bounds bound nothing, because all values lie from "
                f"{low:g} to {high:g}; give a narrower bound, or remove it"
            )
    return notes
