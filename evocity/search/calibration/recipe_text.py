"""The text of a recipe in TOML, with comments that explain its lines."""

import json
import math
import textwrap
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from evocity import operators
from evocity.coding.matching import available_cores
from evocity.fitness import Measure
from evocity.recipe.mixture import OperatorEntry, plan_operators, usual_operators
from evocity.recipe.sections import GenomeSection

_WIDTH = 100
#: More births than this fill a disk with genomes: the log of their recipe keeps fewer.
MANY_BIRTHS = 50_000


@dataclass(frozen=True)
class RecipeSettings:
    """The user's choices for a recipe: its ``name``, ``parents`` as [[parents]] has them, window,
    ``seed``, and length in ``generations``, or in ``minutes`` on all cores. ``population``: 12 for
    each parent, and 24 at least, if it is None. ``by``: who writes it. ``locked``: keys of
    [locked]."""

    name: str
    parents: Sequence[Mapping[str, Any]]
    pixels: int = 256
    metres_per_pixel: float = 2.0
    population: int | None = None
    generations: int = 100
    seed: int = 7
    minutes: float | None = None
    by: str = "`evocity recipe new`"
    locked: Mapping[str, Any] | None = None

    @property
    def living(self) -> int:
        """The number of individuals that live; benchmarks/README.md, "Settings of a search"."""
        return self.population or max(24, 12 * len(self.parents))

    @property
    def births(self) -> int | None:
        """Births of a generation: three for each core, if these are more than live. None for as
        many as live."""
        births = 3 * available_cores()
        return births if births > self.living else None


@dataclass(frozen=True)
class Goal:
    """A measure as a goal. ``file``: its file, as the recipe names it; ``several``: whether this
    has other measures too. ``goal``: "max" or "min" in place of the measure's own; ``target``: a
    number in place of a goal; ``of_first``: whether that is the first parent's value;
    ``of_parents``: whether that is what all parents have. ``bounds``: the keys min and max;
    ``is_constraint``: whether it is no goal besides; ``within``: the file of the measured part."""

    measure: Measure
    file: str | None = None
    several: bool = False
    target: float | None = None
    goal: str | None = None
    of_first: bool = False
    of_parents: bool = False
    bounds: Mapping[str, float] = field(default_factory=dict)
    is_constraint: bool = False
    within: str | None = None

    @property
    def lacks_target(self) -> bool:
        """Whether there is neither a goal nor a target."""
        directed = self.goal is not None or self.measure.goal is not None
        return not self.is_constraint and self.target is None and (self.of_parents or not directed)

    @property
    def direction(self) -> str | None:
        """ "max" or "min"; None for a target, given or to come."""
        if self.of_parents or self.is_constraint or self.target is not None:
            return None
        return self.goal or self.measure.goal


@dataclass(frozen=True)
class Bound:
    """A bound of the guard; ``relaxed``: wider than usual, since a code keeps no other;
    ``tightened``: narrower than usual, since a heap of cut buildings keeps the usual bound."""

    measure: Measure
    min: float | None = None
    max: float | None = None
    relaxed: bool = False
    tightened: bool = False

    @property
    def keys(self) -> dict[str, float]:
        bounds = {"min": self.min, "max": self.max}
        return {key: bound for key, bound in bounds.items() if bound is not None}


#: Factors of the least and the longest time of a run, of the births' number times the mean time of
#: a trial birth, over the workers. Nine of ten runs of `benchmarks/estimates.py` lie within.
DURATIONS = (0.6, 5.0)

#: The purpose of each bound of the guard.
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
        "bound is .06 above the code of the parent that has more of them."
    ),
    "street_distance": (
        "street_distance: how far the streets are from those of the nearest parent. Of pairs of "
        "windows of one city, half are less than .1 apart. The bound is the larger of .1 and twice "
        "what the parents' own codes have."
    ),
    "repetition": (
        "repetition: share of built ground whose place in a parent stands on the map twice. In a "
        "window of a real city every place stands once. Without this bound a search mirrors and "
        "copies quarters."
    ),
    "smallest_share": (
        "smallest_share: share of the parent from which the least built ground comes. The bound is "
        "half of an equal share. Without this bound, most searches breed copies of one parent. The "
        "parents themselves cannot keep the bound: only children can. Locked pixels do not count."
    ),
    "gsi": (
        "gsi: built share of the ground. The band reaches from a tenth below the least to a tenth "
        "above the most that the parents' maps and codes have. Without it a search hollows "
        "districts out; to breed another density, make gsi a goal with a target."
    ),
    "fsi": (
        "fsi: floor area for each square metre of ground. The band reaches from a tenth below the "
        "least to a tenth above the most that the parents' maps and codes have."
    ),
}
#: What a target means.
_OF_FIRST = "It has no goal of its own: the target is what the code of the first has."
_OF_PARENTS = "The nearer the target, the better: it is the mean of the parents' maps."
_OF_LAW = "The nearer the target, the better: the parents' maps have the law, so it is 1."
_CONSTRAINT = "No goal: every birth should keep these bounds."
_LOCKED = "pixels that no birth changes"
_TARGET = "The nearer the target, the better."
_AS_MANY = ", and births in each generation"
_BIRTHS = "in each generation: three for each core, so that few cores wait"
_GENOMES = "genomes of other births are bred again when they are needed"
_RELAXED = (
    "A code of a parent has more than that: the bound is the largest value of the parents' codes."
)
_TIGHTENED = (
    "A heap of cut buildings keeps that: the bound is halfway between the parents' codes and the "
    "heap."
)


def recipe_text(
    settings: RecipeSettings,
    goals: Sequence[Goal],
    bounds: Sequence[Bound],
    values: Mapping[str, Mapping[str, tuple[float, float]]] | None = None,
    cost: tuple[int, float, float] | None = None,
    uncredited: Collection[int] = (),
) -> str:
    """Write a recipe in TOML.

    values : measure -> parent -> the values of its map and its code.
    cost : how many births, seconds of one, and seconds of all.
    uncredited : the parents, by number, whose files have no attribution.
    """
    values = values or {}
    guarded = {bound.measure.name: bound for bound in bounds}
    parts = [
        _head(settings, cost),
        _table(
            "[run]",
            {
                "name": settings.name,
                "seed": settings.seed,
                "population": settings.living,
                "generations": settings.generations,
            },
            {
                "seed": "the same seed, the same births",
                "population": "individuals alive" + ("" if settings.births else _AS_MANY),
            },
        ),
        _table(
            "[map]",
            {"pixels": settings.pixels, "metres_per_pixel": settings.metres_per_pixel},
            {"pixels": f"a window of {settings.pixels * settings.metres_per_pixel:g} m"},
        ),
        *(_parent(parent, k in uncredited) for k, parent in enumerate(settings.parents)),
        *([_table("[locked]", settings.locked, {}, _LOCKED)] if settings.locked else []),
        _genome(),
        _operators(len(settings.parents)),
        *_search(settings),
        _comment("-- goals: what the search improves " + "-" * 50),
        *(
            _goal(goal, None if goal.within else guarded.pop(goal.measure.name, None), values)
            for goal in goals
        ),
    ]
    if guarded:
        parts.append(
            _comment("-- the guard: what every birth should keep " + "-" * 37)
            + _comment(
                "An individual that breaks a bound loses to all that keep them. The code of at "
                "least one parent keeps each bound, except that on smallest_share. The values are "
                "those of the parents' maps, and of their codes as they are decoded."
            )
        )
    parts += [
        _reason(bound, values) + _table("[[fitness]]", {"name": bound.measure.name} | bound.keys)
        for bound in guarded.values()
    ]
    parts.append(
        _table("[evaluation]", {"timeout": 60}, {"timeout": "seconds that one individual may take"})
        + "# workers = 2            # processes that evaluate; one a core while this is a comment\n"
    )
    if (settings.births or settings.living) * (settings.generations + 1) > MANY_BIRTHS:
        parts.append(_table("[log]", {"genomes": "survivors"}, {"genomes": _GENOMES}))
    return "\n".join(parts)


def toml_value(value: Any) -> str:
    """Write a value in TOML."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {toml_value(v)}" for key, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(toml_value, value)) + "]"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    return repr(value)


def describe_duration(seconds: float) -> str:
    """Describe a time in seconds, minutes or hours."""
    if seconds < 90:
        whole = max(1, round(seconds))
        return f"{whole} second" if whole == 1 else f"{whole} seconds"
    if seconds < 5400:
        return f"{seconds / 60:.0f} minutes"
    return f"{seconds / 3600:.1f} hours"


def describe_forecast(seconds: float) -> str:
    """Describe the range of the time of a run, from the ``seconds`` that it takes if all births are
    as the trial births."""
    least, most = (describe_duration(factor * seconds) for factor in DURATIONS)
    number, unit = least.split()
    return (
        f"{number} to {most}"
        if most.split()[1].rstrip("s") == unit.rstrip("s")
        else f"{least} to {most}"
    )


def _head(settings: RecipeSettings, cost) -> str:
    text = f"Written by {settings.by}, to be changed. docs/recipe.md explains every key."
    if cost is not None:
        births, each, whole = cost
        text += (
            f" {births} births; one took {1000 * each:.0f} ms here, bred and measured, so that all "
            f"take {describe_forecast(whole)} on this machine's cores. Children of the parents "
            "were timed; later ones may take longer."
        )
    return _comment(text)


def _genome() -> str:
    usual = GenomeSection.model_fields
    sides = usual["block"].default
    return _table(
        "[genome]",
        {
            "block": f"{sides[0]}-{sides[1]}",
            **{key: usual[key].default for key in ("reach", "fit")},
            "settle": "roofs",
        },
        {
            "block": "sides of range blocks, px: small at walls, large on open ground",
            "reach": "how far a domain block may lie, px; short ones survive crossing",
            "fit": "the parents' codes refined, to decode closest to their maps",
            "settle": "each roof lies at its median height, and small steps stay",
        },
    )


def _operators(parents: int) -> str:
    mixture = plan_operators() if parents > 1 else usual_operators()
    table = {name: _entry(entry) for name, entry in mixture.items()}
    comments = {name: _first_sentence(operators.operators()[name]) for name in mixture}
    about = "weights of a mixture; a range is drawn at each birth"
    return _table("[operators]", table, comments, about)


#: Keys of ``[search]`` in a new recipe with several parents.
SEARCH_KEYS: Mapping[str, tuple[float, str]] = {
    "distinct": (1.0, "share of the living that should differ from each other"),
    "apart": (0.15, "two cities differ if more of their pixels differ by a storey"),
    "per_plan": (8, "most of the living with one changed plan of streets"),
    "source_plans": (0.25, "share of the living that is kept for the plans of the parents"),
    "twins": (0.005, "births that differ from a living one in a smaller share do not enter"),
    "mates": (1.0, "share of the crossings whose two parents have one plan"),
    "redraws": (3, "how often a birth that equals a parent is drawn again"),
}


def _search(settings: RecipeSettings) -> list[str]:
    keys = SEARCH_KEYS if len(settings.parents) > 1 else {}
    if settings.births:
        keys = {"births": (settings.births, _BIRTHS)} | keys
    values = {key: value for key, (value, _) in keys.items()}
    notes = {key: note for key, (_, note) in keys.items()}
    return [_table("[search]", values, notes)] if keys else []


def _parent(entry: Mapping[str, Any], uncredited: bool) -> str:
    line = '# attribution = "…"      # the line that its licence asks for: the file has none\n'
    return _table("[[parents]]", entry) + (line if uncredited and "map" in entry else "")


def _entry(entry: OperatorEntry) -> Any:
    weight = int(entry.weight) if entry.weight == int(entry.weight) else entry.weight
    others = ({} if entry.parents is None else {"parents": entry.parents}) | entry.parameters
    return {"weight": weight} | others if others else weight


def _first_sentence(kind: type) -> str:
    text = " ".join((kind.__doc__ or "").split()).partition(". ")[0].rstrip(".").replace("`", "")
    return text[:1].lower() + text[1:]


def _goal(goal: Goal, bound: Bound | None, values: Mapping) -> str:
    measure = goal.measure
    entry: dict[str, Any] = {} if goal.file is None else {"file": goal.file}
    if goal.file is None or goal.several:
        entry["name"] = measure.name
    if goal.within is not None:
        entry["within"] = goal.within
    bounds = goal.bounds or (bound.keys if bound else {})
    if goal.target is not None:
        entry["target"] = goal.target
    elif not goal.is_constraint and (goal.goal is not None or bounds):
        entry["goal"] = goal.direction  # with only a bound it were no goal
    text = f"{measure.name}: {measure.summary}" if measure.summary else f"{measure.name}."
    directions = {"max": "More of it is better.", "min": "Less of it is better."}
    text += " " + directions.get(goal.direction, _describe_target(goal))
    entry |= bounds
    return _comment(text + _parent_values(measure.name, values)) + _table("[[fitness]]", entry)


def _describe_target(goal: Goal) -> str:
    if goal.is_constraint:
        return _CONSTRAINT
    if goal.of_parents:
        lawful = goal.measure.name == "salingaros_law" and goal.target == 1
        return _OF_LAW if lawful else _OF_PARENTS
    return _OF_FIRST if goal.of_first else _TARGET


def _reason(bound: Bound, values: Mapping) -> str:
    text = _REASONS[bound.measure.name] + (" " + _RELAXED if bound.relaxed else "")
    text += " " + _TIGHTENED if bound.tightened else ""
    return _comment(text + _parent_values(bound.measure.name, values))


def _parent_values(name: str, values: Mapping) -> str:
    texts = [
        f"{parent} has {_format_value(of_map)}, its code {_format_value(of_code)}"
        for parent, (of_map, of_code) in values.get(name, {}).items()
    ]
    return f" The map of {'; that of '.join(texts)}." if texts else ""


def _format_value(value: float) -> str:
    return "undefined" if math.isnan(value) else f"{value:.3g}"


def _comment(text: str) -> str:
    lines = textwrap.wrap(text, _WIDTH - 2, break_on_hyphens=False, break_long_words=False)
    return "".join(f"# {line}\n" for line in lines)


def _table(
    head: str,
    entries: Mapping[str, Any],
    comments: Mapping[str, str] | None = None,
    about: str = "",
) -> str:
    lines = [_with_comment(head, about)]
    for key, value in entries.items():
        comment = (comments or {}).get(key, "")
        lines.append(_with_comment(f"{key} = {toml_value(value)}", comment))
    return "\n".join(lines) + "\n"


def _with_comment(line: str, text: str) -> str:
    """A long comment stands above its line."""
    if not text:
        return line
    whole = f"{line:<24} # {text}"
    return whole if len(whole) <= _WIDTH else _comment(text) + line
