"""The text of a recipe, with comments that tell what its lines mean."""

import json
import math
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from evocity import operators
from evocity.fitness import Measure
from evocity.search.mixture import OperatorEntry
from evocity.search.recipe import Recipe
from evocity.search.sections import GenomeSection

_WIDTH = 100


@dataclass(frozen=True)
class Words:
    """What the user tells of a recipe: its ``name``; each of its ``parents`` as [[parents]] has it,
    map and options; the window; how long, in ``generations``, or in ``minutes`` on all cores, by
    which their number goes once a birth was timed; the ``seed``. ``by``: who writes it."""

    name: str
    parents: Sequence[Mapping[str, Any]]
    pixels: int = 256
    metres_per_pixel: float = 2.0
    population: int = 48
    generations: int = 100
    seed: int = 7
    minutes: float | None = None
    by: str = "`evocity recipe new`"


@dataclass(frozen=True)
class Goal:
    """A measure to search by; ``file``: the file it is in, as the recipe names it, and ``several``
    whether others are in it too. ``goal`` is "max" or "min" where it is not the measure's own,
    ``target`` the number that is wanted in place of a goal, ``of_first`` whether that is what the
    first parent has."""

    measure: Measure
    file: str | None = None
    several: bool = False
    target: float | None = None
    goal: str | None = None
    of_first: bool = False

    @property
    def lacks_target(self) -> bool:
        """Whether nothing is told that a search could go by."""
        return self.target is None and self.goal is None and self.measure.goal is None

    @property
    def wanted(self) -> str | None:
        """ "max" or "min"; None where a target is wanted, told or not."""
        return None if self.target is not None else self.goal or self.measure.goal


@dataclass(frozen=True)
class Bound:
    """A bound of the guard; ``relaxed``: wider than it should be, for the codes keep no other."""

    measure: Measure
    min: float | None = None
    max: float | None = None
    relaxed: bool = False

    @property
    def keys(self) -> dict[str, float]:
        told = {"min": self.min, "max": self.max}
        return {key: bound for key, bound in told.items() if bound is not None}


#: What the bounds of the guard are for.
_REASONS = {
    "integrity": (
        "integrity: share of what is built that stands in whole buildings of the parents. Breeding "
        "that cuts buildings reaches many goals sooner; this bound keeps half of them whole."
    ),
    "fabric_distance": (
        "fabric_distance: how far the areas and shapes of the buildings are from the parents'. "
        "Two windows of one city are about .05 apart. The bound is the larger of .15 and twice "
        "what the parents' own codes have: no birth is truer than these."
    ),
    "small_buildings": (
        "small_buildings: buildings of less than 50 m², a hectare: sheds, and pieces of what was "
        "cut. The bound is 1.3 times what the map of the parent with more of them has."
    ),
    "slivers": (
        "slivers: share of buildings that are less than 5 m wide, mostly strips of roofs. The "
        "bound is .03 above the code of the parent that has more of them."
    ),
}
#: Of a measure with a target, by whether it is the first parent's.
_TARGET = {
    True: "It has no goal of its own: the target is what the code of the first has.",
    False: "The nearer the target, the better.",
}
_RELAXED = "The codes of the parents have more than that: the bound is what the better of them has."


def recipe_text(
    words: Words,
    goals: Sequence[Goal],
    bounds: Sequence[Bound],
    values: Mapping[str, Mapping[str, tuple[float, float]]] | None = None,
    cost: tuple[int, float, float] | None = None,
    uncredited: Collection[int] = (),
) -> str:
    """A recipe in TOML.

    values : measure -> parent -> what its map and its code have. cost : how many births, seconds of
    one, and seconds of all. uncredited : the parents, by number, whose files tell no attribution.
    """
    values = values or {}
    guarded = {one.measure.name: one for one in bounds}
    parts = [
        _head(words, cost),
        _table(
            "[run]",
            {
                "name": words.name,
                "seed": words.seed,
                "population": words.population,
                "generations": words.generations,
            },
            {
                "seed": "the same seed, the same births",
                "population": "individuals alive, and births in each generation",
            },
        ),
        _table(
            "[map]",
            {"pixels": words.pixels, "metres_per_pixel": words.metres_per_pixel},
            {"pixels": f"a window of {words.pixels * words.metres_per_pixel:g} m"},
        ),
        *(_parent(one, k in uncredited) for k, one in enumerate(words.parents)),
        _genome(),
        _operators(),
        _comment("-- goals: what is searched by " + "-" * 50),
        *(_goal(one, guarded.pop(one.measure.name, None), values) for one in goals),
    ]
    if guarded:
        parts.append(
            _comment("-- the guard: what every birth should keep " + "-" * 37)
            + _comment(
                "An individual that breaks a bound loses to all that keep them. Each was laid so "
                "that the own code of at least one parent keeps it; the values are those of the "
                "parents' maps, and of their codes as they are decoded."
            )
        )
    parts += [
        _reason(one, values) + _table("[[fitness]]", {"name": one.measure.name} | one.keys)
        for one in guarded.values()
    ]
    parts.append(
        _table("[evaluation]", {"timeout": 60}, {"timeout": "seconds that one individual may take"})
        + "# workers = 2            # processes that evaluate; one a core while this is a comment\n"
    )
    return "\n".join(parts)


def value_of(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {value_of(one)}" for key, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(value_of, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def duration(seconds: float) -> str:
    """A time in words."""
    if seconds < 90:
        return f"{max(1, round(seconds))} seconds"
    if seconds < 5400:
        return f"{seconds / 60:.0f} minutes"
    return f"{seconds / 3600:.1f} hours"


def _head(words: Words, cost) -> str:
    text = f"Written by {words.by}, to be changed. docs/recipe.md tells every key."
    if cost is not None:
        births, each, whole = cost
        text += (
            f" {births} births; one took {1000 * each:.0f} ms here, bred and measured, so that all "
            f"take about {duration(whole)} on this machine's cores. Children of the parents were "
            "timed; later ones may take longer."
        )
    return _comment(text)


def _genome() -> str:
    usual = GenomeSection.model_fields
    sides = usual["block"].default
    return _table(
        "[genome]",
        {
            "block": f"{sides[0]}-{sides[1]}",
            "reach": usual["reach"].default,
            "fit": usual["fit"].default,
            "settle": usual["settle"].default,
        },
        {
            "block": "sides of range blocks, px: small at walls, large on open ground",
            "reach": "how far a domain block may lie, px; short ones survive crossing",
            "fit": "the parents' codes refined, to decode closest to their maps",
            "settle": "each building lies at its median height",
        },
    )


def _operators() -> str:
    mixture = Recipe.model_fields["operators"].get_default(call_default_factory=True)
    table, told = {}, {}
    for name, entry in mixture.items():
        table[name] = _entry(entry)
        told[name] = _in_short(operators.operators()[name])
    return _table(
        "[operators]", table, told, "weights of a mixture; a range is drawn at each birth"
    )


def _parent(entry: Mapping[str, Any], uncredited: bool) -> str:
    """One of [[parents]]; of an ``uncredited`` map with the place for its attribution."""
    told = '# attribution = "…"      # the line that its licence asks for: the file tells none\n'
    return _table("[[parents]]", entry) + (told if uncredited and "map" in entry else "")


def _entry(entry: OperatorEntry) -> Any:
    weight = int(entry.weight) if entry.weight == int(entry.weight) else entry.weight
    others = ({} if entry.parents is None else {"parents": entry.parents}) | entry.parameters
    return {"weight": weight} | others if others else weight


def _in_short(kind: type) -> str:
    text = " ".join((kind.__doc__ or "").split()).partition(". ")[0].rstrip(".").replace("`", "")
    return text[:1].lower() + text[1:]


def _goal(goal: Goal, bound: Bound | None, values: Mapping) -> str:
    measure = goal.measure
    entry: dict[str, Any] = {} if goal.file is None else {"file": goal.file}
    if goal.file is None or goal.several:
        entry["name"] = measure.name
    if goal.target is not None:
        entry["target"] = goal.target
    elif goal.goal is not None or bound is not None:  # with a bound alone it were no goal
        entry["goal"] = goal.wanted
    text = f"{measure.name}: {measure.summary}" if measure.summary else f"{measure.name}."
    wanted = {"max": "More of it is better.", "min": "Less of it is better."}
    text += " " + wanted.get(goal.wanted, _TARGET[goal.of_first])
    had = _had(measure.name, values)
    entry |= {} if bound is None else bound.keys
    return _comment(text + had) + _table("[[fitness]]", entry)


def _reason(bound: Bound, values: Mapping) -> str:
    text = _REASONS[bound.measure.name] + (" " + _RELAXED if bound.relaxed else "")
    return _comment(text + _had(bound.measure.name, values))


def _had(name: str, values: Mapping) -> str:
    """What the parents have, in words."""
    told = [
        f"{parent} has {_shown(of_map)}, its code {_shown(of_code)}"
        for parent, (of_map, of_code) in values.get(name, {}).items()
    ]
    return f" The map of {'; that of '.join(told)}." if told else ""


def _shown(value: float) -> str:
    return "undefined" if math.isnan(value) else f"{value:.3g}"


def _comment(text: str) -> str:
    lines = textwrap.wrap(text, _WIDTH - 2, break_on_hyphens=False, break_long_words=False)
    return "".join(f"# {line}\n" for line in lines)


def _table(
    head: str,
    entries: Mapping[str, Any],
    told: Mapping[str, str] | None = None,
    about: str = "",
) -> str:
    """A table of TOML; what is ``told`` of a key stands behind it, or above where it is long."""
    lines = [_behind(head, about)]
    for key, value in entries.items():
        lines.append(_behind(f"{key} = {value_of(value)}", (told or {}).get(key, "")))
    return "\n".join(lines) + "\n"


def _behind(line: str, text: str) -> str:
    if not text:
        return line
    whole = f"{line:<24} # {text}"
    return whole if len(whole) <= _WIDTH else f"# {text}\n{line}"


__all__ = ["Bound", "Goal", "Words", "duration", "recipe_text", "value_of"]
