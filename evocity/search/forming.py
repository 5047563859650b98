"""Does a recipe suit the kind of chromosome that it breeds?"""

from collections.abc import Iterator

from pydantic import BaseModel

from evocity import operators
from evocity.errors import shown

Fault = tuple[str, str, str]

# What of a birth is fabric, and measures ask for.
_OF_CODES = {"genome", "parents"}


def of_kind(recipe: BaseModel) -> list[Fault]:
    """Faults (key, found, allowed) of parents, courses, operators and measures that are of another
    kind of chromosome than the ``recipe`` breeds."""
    return [*_parents(recipe), *_operators(recipe), *_measures(recipe), *_rest(recipe)]


def _parents(recipe: BaseModel) -> Iterator[Fault]:
    kind = recipe.kind
    for number, parent in enumerate(recipe.parents):
        if not parent.bred and parent.given not in kind.sources:
            allowed = f"{' or '.join(kind.sources)}; or genome, or run and id, of a {kind.name}"
            yield f"parents[{number}].{parent.given}", f"in a run of {kind.name}s", allowed
    if recipe.curves and kind.name != "site":
        yield "curves", f"in a run of kind {shown(kind.name)}", 'none; or kind = "site" in [run]'
    if kind.name == "site" and not recipe.curves:
        yield "curves", "missing", "one [[curves]] or more, with width and from, or start and end"
    for number, course in enumerate(recipe.curves):
        pixel, side = recipe.map.metres_per_pixel, recipe.map.pixels * recipe.map.metres_per_pixel
        if not pixel <= course.width <= side:
            found = f"{course.width:g} m, of pixels of {pixel:g} m"
            yield f"curves[{number}].width", found, f"{pixel:g} to {side:g} m, a pixel or wider"
        for key in ("start", "end"):
            point = getattr(course, key)
            if point is not None and not all(0 <= one <= side for one in point):
                allowed = f"within the window, 0 to {side:g} m"
                yield f"curves[{number}].{key}", shown(list(point)), allowed


def _operators(recipe: BaseModel) -> Iterator[Fault]:
    kind, told = recipe.kind, operators.operators()
    for local in recipe.local:
        for name in filter(told.get, local.breeding):  # others are told where they are unknown
            bred = operators.bred_by(told[name])
            if bred not in kind.factors:
                key = f"operators.{name}" if name in local.operators else "search.algorithm"
                if local.refine.births and name == local.refine.operator:
                    key = "refine.births"
                allowed = ", ".join(operators.operators(kind.factors))
                yield key, f"it breeds {bred}, the run {kind.name}", allowed
    if recipe.refine.births and kind.name != "fabric":
        yield "refine.births", f"in a run of {kind.name}s", "0: what is tuned is a fabric"
    if kind.name != "fabric" and any(one.search.breeds_by for one in recipe.local):
        yield "search.algorithm", "it breeds fabrics by itself", "one that breeds by the operators"


def _measures(recipe: BaseModel) -> Iterator[Fault]:
    kind = recipe.kind
    listed = [("fitness", recipe.fitness), ("run.record", recipe.run.record)]
    for key, entries in listed:
        for number, entry in enumerate(entries):
            place = f"{key}[{number}]"
            for measure in entry.measures:
                if measure.of not in kind.subjects:
                    found = f"{measure.name}, which is of a {measure.of}"
                    allowed = f"measures of a {' or of a '.join(kind.subjects)}"
                    yield f"{place} ({measure.name})", found, allowed
                elif measure.of != "city" and entry.within is not None:
                    yield f"{place}.within", f"of a {measure.of}", "a measure of a city"
                elif measure.of != "city" and getattr(entry, "like", None) is not None:
                    found = f"for {measure.name}, which is of a {measure.of}"
                    yield f"{place}.like", found, "a target: a city has none"
                elif "fabric" not in kind.factors and set(measure.needs) & _OF_CODES:
                    found = f"{measure.name} asks for what a {kind.name} has not"
                    yield f"{place} ({measure.name})", found, "a measure of the map alone"


def _rest(recipe: BaseModel) -> Iterator[Fault]:
    if recipe.locked.asked and "fabric" not in recipe.kind.factors:
        yield "locked", f"in a run of {recipe.kind.name}s", "none: what is locked is of a fabric"


__all__ = ["of_kind"]
