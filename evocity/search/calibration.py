"""A recipe to begin from, for anyone's cities: goals, and a guard calibrated on the parents' codes.

Bounds that a heap of cut buildings does not keep, and the parents do: `integrity`,
`fabric_distance` to the parents, `small_buildings` and `slivers`. What the parents' maps and codes
have of them decides where they lie; a few births tell how long the run will take.
"""

import contextlib
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from evocity import fitness, store
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import FitnessError, MapError, keyword
from evocity.fitness import Measure
from evocity.search.breeding import next_population
from evocity.search.compiling import compile_once, needed
from evocity.search.evaluator import Evaluator, Outcome
from evocity.search.guarding import rounded
from evocity.search.individual import Individual
from evocity.search.preparation import Prepared, aims_of, prepare, references_of
from evocity.search.reading import recipe_of
from evocity.search.recipe import Recipe
from evocity.search.recipe_text import Bound, Goal, Words, recipe_text
from evocity.search.sections import Parent
from evocity.store import Source

#: What is searched by unless the user has goals: those of these that the parents have.
USUAL_GOALS = ("autosimilarity", "alignment", "salingaros_buildings", "crumbs")
#: What the guard bounds.
GUARD = ("integrity", "fabric_distance", "small_buildings", "slivers")
#: Least share of what is built that stands in whole buildings of the parents.
LEAST_INTEGRITY = 0.5
#: The fabric distance that is always granted; beyond it, so many times what coding costs.
NEAR, TIMES_CODED = 0.15, 2.0
#: How many times the small buildings of the parent that has more of them; never fewer, 1/ha.
TIMES_SMALL, FEW_SMALL = 1.3, 0.1
#: By how much the share of slivers may be above that of the code that has more of them.
MORE_SLIVERS = 0.03
#: Generations that a time in minutes stands for, at most.
MOST_GENERATIONS = 1_000_000
#: Births that are timed, after as many that load what they need.
_TIMED, _LOADING = 10, 3


@dataclass(frozen=True)
class Begun:
    """A recipe to begin from: its ``text``, without faults as ``recipe``.

    values : measure -> parent -> what its (map, code) has, NaN where it is undefined.
    bounds : those of the guard. seconds : a birth took, of one worker. notes : what a user should
    know, in words. failing : why a run by it would stop at once, in words; "" if it would not.
    """

    text: str
    recipe: Recipe
    values: Mapping[str, Mapping[str, tuple[float, float]]]
    bounds: Sequence[Bound]
    seconds: float
    sources: Sequence[Source]
    notes: Sequence[str] = field(default=())
    failing: str = ""

    @property
    def births(self) -> int:
        return self.recipe.run.population * (self.recipe.run.generations + 1)

    @property
    def duration(self) -> float:
        """Seconds that all births take, on as many workers as there are cores."""
        return self.births * self.seconds / max(1, self.recipe.worker_count)


def begun(
    words: Words,
    goals: Sequence[Goal],
    path: Path,
    tell: Callable[[str], None],
    met: Callable[[CityMap, Parent], None] | None = None,
) -> Begun:
    """The recipe to be written to ``path`` for the parents and the window that ``words`` tell, with
    a calibrated guard.

    goals : what is searched by; `USUAL_GOALS` if there are none. ``tell`` is told in a few words
    what comes next, ``met`` each parent's map and its [[parents]] as soon as it is read. Files of
    goals are executed.

    Raises `RecipeError` for a window or a centre that cannot be, `MapError`, `GenomeError` or
    `FitnessError` where a map does not serve, nothing is built on it, or a goal is undefined of
    every parent.
    """
    own = bool(goals)
    goals = list(goals) or [Goal(fitness.get(name)) for name in USUAL_GOALS]
    asked = [replace(one, target=0.0) if one.lacks_target else one for one in goals]
    draft = _read(recipe_text(words, asked, []), path)
    compile_once(draft.genome.block, needed(draft), tell)

    def built(city: CityMap, parent: Parent) -> None:
        if met is not None:
            met(city, parent)
        _refuse_empty(city, parent)

    prepared = prepare(draft, tell, built)
    cities = [source.city for source in prepared.sources]
    measures = [goal.measure for goal in goals]
    guard = [getattr(fitness, name) for name in GUARD]
    values = {one.name: _values(one, prepared, cities) for one in [*measures, *guard]}
    goals, left = _defined(goals, values, own, path)
    bounds = [bound for one in guard if (bound := _bound(one, values[one.name])) is not None]
    text = recipe_text(words, goals, bounds, values)
    recipe = _read(text, path)
    tell("breeding a few, to tell how long it takes")
    compile_once(recipe.genome.block, needed(recipe), tell)
    trials = _trials(_prepared_anew(prepared, recipe))
    seconds = sum(one.seconds for one in trials) / len(trials)
    words = _as_long(words, recipe, seconds)
    first = prepared.sources[0]
    notes = [*prepared.notes, *left, *_invented(goals, first.city), *_reached(goals, first.name)]
    notes += _at_best(goals, values)
    notes += [
        f"{one.name}: no bound, for it is undefined of {_undefined(values[one.name])}"
        for one in guard
        if _dropped(one, bounds)
    ]
    some, failing = _failures(trials, recipe.evaluation.max_failures)
    notes += some
    found = Begun(text, recipe, values, bounds, seconds, prepared.sources, notes, failing)
    if words.generations != recipe.run.generations:
        found = replace(found, recipe=_read(recipe_text(words, goals, bounds, values), path))
    cost = found.births, seconds, found.duration
    uncredited = [k for k, one in enumerate(prepared.sources) if not one.city.attribution]
    told = recipe_text(words, goals, bounds, values, cost, uncredited)
    return replace(found, text=told, recipe=_read(told, path))


def _read(text: str, path: Path) -> Recipe:
    return recipe_of(text, path.parent.resolve(), {}, name=str(path))


def _as_long(words: Words, recipe: Recipe, seconds: float) -> Words:
    """As many generations as pass in the minutes that ``words`` tell, where a birth takes so many
    ``seconds`` of a worker; at least one."""
    if words.minutes is None:
        return words
    pace = words.population * seconds / max(1, recipe.worker_count)
    bred = 60 * words.minutes / max(pace, 1e-9) - 1  # the first population takes as long
    return replace(words, generations=max(1, min(int(bred), MOST_GENERATIONS)))


def _values(
    measure: Measure, prepared: Prepared, cities: Sequence
) -> dict[str, tuple[float, float]]:
    """Parent -> what its map and its code have of a ``measure``."""
    if "reference" in measure.takes:
        named = prepared.references.get(measure.name)
        measure = measure.bound(named or fitness.Reference.sources(cities))
    found = {}
    for source in prepared.sources:
        extras = {"genome": source.genome, "parents": [source.genome], "sources": cities}
        code = decode(source.genome).city
        found[source.name] = tuple(measure(one, **extras) for one in (source.city, code))
    return found


def _refuse_empty(city: CityMap, parent: Parent) -> None:
    """Raise `MapError` if nothing is built on a parent's map."""
    if not city.built.any():
        raise MapError(
            f"{city.name}: nothing is built on its map ({parent.place})",
            "buildings to breed from on the map of every parent",
            f"choose a window with buildings, with {keyword('center')} and {keyword('pixels')}, "
            "or leave this map out",
        )


def _defined(
    goals: Sequence[Goal], values: Mapping, own: bool, path: Path
) -> tuple[list[Goal], list[str]]:
    """The ``goals`` that the parents' codes have, with targets where they have no goal; and which
    are left out, and why. Raises `FitnessError` if one of the user's ``own`` is undefined of all,
    or all others are of one."""
    found, left = [], []
    for goal in goals:
        of_parents = values[goal.measure.name]
        defined = [code for _, code in of_parents.values() if not math.isnan(code)]
        if own and not defined:
            raise FitnessError(
                f"{goal.measure.name} is undefined of {_undefined(of_parents)}",
                "a measure that is a number of at least one parent",
                f"try it with: evocity score MAP --fitness {_typed(goal, path)}, or take other "
                "cities",
            )
        if not own and len(defined) < len(of_parents):
            left.append(
                f"{goal.measure.name}: no goal, for it is undefined of {_undefined(of_parents)}"
            )
            continue
        if goal.lacks_target:
            goal = replace(goal, target=float(f"{defined[0]:.4g}"), of_first=True)
        found.append(goal)
    if not found:
        raise FitnessError(
            f"nothing to search by: {'; '.join(left)}",
            "a measure that is a number of every parent",
            "choose another with --fitness, or take other cities",
        )
    return found, left


def _reached(goals: Sequence[Goal], first: str) -> list[str]:
    """That targets which are the ``first`` parent's own are reached before a run begins, in
    words."""
    told = [goal.measure.name for goal in goals if goal.of_first]
    if not told:
        return []
    return [
        f"{', '.join(told)}: the target is what the code of {first} has, so {first} has reached it "
        "before the run begins; write another target to breed towards"
    ]


def _at_best(goals: Sequence[Goal], values: Mapping) -> list[str]:
    """That some parents have the best that there can be of a goal, and others have not, in words:
    who is bred of the former alone has it too."""
    told = []
    for goal in goals:
        if goal.wanted is None:
            continue
        best = goal.measure.range[goal.wanted == "max"]
        of_parents = {name: code for name, (_, code) in values[goal.measure.name].items()}
        reached = [name for name, code in of_parents.items() if code == best]
        if reached and len(reached) < len(of_parents):
            have, them = ("have", "these") if len(reached) > 1 else ("has", "it")
            told.append(
                f"{goal.measure.name}: {' and '.join(reached)} {have} {best:g} already, the best "
                f"there can be; children of {them} alone may win, which a bound in place of the "
                "goal prevents"
            )
    return told


def _invented(goals: Sequence[Goal], first: CityMap) -> list[str]:
    """That targets are made of heights which the ``first`` parent's file does not tell, in
    words: where that is half of its buildings, and the measure is another if all are higher."""
    rules = first.height_rules
    if 2 * rules.get("default", 0) < max(1, sum(rules.values())):
        return []
    higher = first.replace(2 * first.heights)
    asked = [one for one in goals if one.of_first or one.lacks_target]
    asked = [one for one in asked if not one.measure.takes]
    told = [one.measure.name for one in asked if one.measure(first) != one.measure(higher)]
    if not told:
        return []
    which = "its target is" if len(told) == 1 else "their targets are"
    return [
        f"{', '.join(told)}: {which} made of heights that {first.name} does not tell; write "
        "another into the recipe, or take another city first"
    ]


def _undefined(of_parents: Mapping[str, tuple[float, float]]) -> str:
    """The parents that a measure is undefined of, with its reasons, in words."""
    reasons: dict[str, list[str]] = {}
    for name, (_, code) in of_parents.items():
        if math.isnan(code):
            reasons.setdefault(getattr(code, "reason", ""), []).append(name)
    return ", ".join(
        " and ".join(names) + f" ({reason})" * bool(reason) for reason, names in reasons.items()
    )


def _typed(goal: Goal, path: Path) -> str:
    """How ``--fitness`` names a ``goal`` of the recipe at ``path``, typed here."""
    if goal.file is None:
        return goal.measure.name
    file = os.path.join(path.parent, goal.file)
    with contextlib.suppress(ValueError):  # on another drive
        return os.path.relpath(file)
    return file


def _bound(measure: Measure, values: Mapping[str, tuple[float, float]]) -> Bound | None:
    """The bound of the guard on a ``measure``, given what the parents have; None where it is
    undefined."""
    maps, codes = zip(*values.values(), strict=True)
    if any(map(math.isnan, codes)):
        return None
    if measure.name == fitness.integrity.name:
        return Bound(measure, min=min(LEAST_INTEGRITY, rounded(max(codes), up=False)))
    if measure.name == fitness.small_buildings.name:
        asked = max(TIMES_SMALL * max(maps), FEW_SMALL)
        if min(codes) > asked:
            return Bound(measure, max=rounded(min(codes), up=True), relaxed=True)
        return Bound(measure, max=rounded(asked, up=False))
    if measure.name == fitness.slivers.name:
        return Bound(measure, max=rounded(max(codes) + MORE_SLIVERS, up=True))
    return Bound(measure, max=max(NEAR, rounded(TIMES_CODED * max(codes), up=True)))


def _dropped(measure: Measure, bounds: Sequence[Bound]) -> bool:
    return all(one.measure.name != measure.name for one in bounds)


def _failures(trials: Sequence[Outcome], limit: float) -> tuple[list[str], str]:
    """What is to be said of the ``trials`` that failed: notes, and why a run would stop if more
    than a share of ``limit`` did."""
    failed = [one for one in trials if one.status != "ok"]
    if not failed:
        return [], ""
    said = f"{len(failed)} of {len(trials)} trial births failed; the first: {failed[0].error}"
    if len(failed) <= limit * len(trials):
        return [said], ""
    return [], f"{said}\n  A run stops when more than {limit:.0%} of a generation's births fail"


def _prepared_anew(prepared: Prepared, recipe: Recipe) -> Prepared:
    """The same parents, prepared for a ``recipe`` with other measures."""
    cities = [source.city for source in prepared.sources]
    header = replace(
        prepared.header,
        measures=tuple(measure.name for measure in recipe.measures),
        recipe_hash=store.hash_of_text(recipe.text),
    )
    return replace(
        prepared,
        recipe=recipe,
        header=header,
        aims=aims_of(recipe),
        references=references_of(recipe, cities, {}),
    )


def _trials(prepared: Prepared) -> list[Outcome]:
    """Children of the parents by the recipe's operators, bred and evaluated here."""
    evaluator = Evaluator(prepared.setup)
    sources = [source.genome for source in prepared.sources]
    algorithm = prepared.recipe.search.algorithm_of(len(sources))
    living = algorithm.judged([Individual(k, one, {}, (0.0,)) for k, one in enumerate(sources)])
    plans = next_population(prepared.recipe, algorithm, 1, living, sources)
    plans = plans[: _LOADING + _TIMED]
    found = [evaluator.born(plan.operator, plan.genomes, plan.rng) for plan in plans]
    return found[min(_LOADING, len(found) - 1) :]


__all__ = ["USUAL_GOALS", "Begun", "begun"]
