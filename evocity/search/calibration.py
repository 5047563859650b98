"""A recipe to begin from, for anyone's cities: goals, and a guard calibrated on the parents' codes.

Bounds that a heap of cut buildings does not keep, and the parents do: `integrity`,
`fabric_distance` to the parents, `small_buildings` and `slivers`. What the parents' maps and codes
have of them decides where they lie; a few births tell how long the run will take.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from evocity import fitness, store
from evocity.coding import decode
from evocity.errors import FitnessError
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
#: Births that are timed, after as many that load what they need.
_TIMED, _LOADING = 10, 3


@dataclass(frozen=True)
class Begun:
    """A recipe to begin from: its ``text``, without faults as ``recipe``.

    values : measure -> parent -> what its (map, code) has, NaN where it is undefined.
    bounds : those of the guard. seconds : a birth took, of one worker. notes : what a user should
    know, in words.
    """

    text: str
    recipe: Recipe
    values: Mapping[str, Mapping[str, tuple[float, float]]]
    bounds: Sequence[Bound]
    seconds: float
    sources: Sequence[Source]
    notes: Sequence[str] = field(default=())

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
) -> Begun:
    """The recipe to be written to ``path`` for the parents and the window that ``words`` tell, with
    a calibrated guard.

    goals : what is searched by; `USUAL_GOALS` if there are none. ``tell`` is told in a few words
    what comes next. Files of goals are executed.

    Raises `RecipeError` for a window or a centre that cannot be, `MapError`, `GenomeError` or
    `FitnessError` where a map does not serve or a goal is undefined of every parent.
    """
    own = bool(goals)
    goals = list(goals) or [Goal(fitness.get(name)) for name in USUAL_GOALS]
    draft = _read(recipe_text(words, [replace(one, target=0.0) for one in goals], []), path)
    compile_once(draft.genome.block, needed(draft), tell)
    prepared = prepare(draft, tell)
    cities = [source.city for source in prepared.sources]
    measures = [goal.measure for goal in goals]
    guard = [getattr(fitness, name) for name in GUARD]
    values = {one.name: _values(one, prepared, cities) for one in [*measures, *guard]}
    goals = _defined(goals, values, own)
    bounds = [bound for one in guard if (bound := _bound(one, values[one.name])) is not None]
    text = recipe_text(words, goals, bounds, values)
    recipe = _read(text, path)
    tell("breeding a few, to tell how long it takes")
    compile_once(recipe.genome.block, needed(recipe), tell)
    trials = _trials(_prepared_anew(prepared, recipe))
    seconds = sum(one.seconds for one in trials) / len(trials)
    failed = [one for one in trials if one.status != "ok"]
    notes = list(prepared.notes)
    notes += [f"{one.name}: {_why_not(one, values)}" for one in guard if _dropped(one, bounds)]
    if failed:
        notes.append(f"{len(failed)} of {len(trials)} trial births failed: {failed[0].error}")
    found = Begun(text, recipe, values, bounds, seconds, prepared.sources, notes)
    told = recipe_text(words, goals, bounds, values, (found.births, seconds, found.duration))
    return replace(found, text=told, recipe=_read(told, path))


def _read(text: str, path: Path) -> Recipe:
    return recipe_of(text, path.parent.resolve(), {}, name=str(path))


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
        found[source.name] = tuple(float(measure(one, **extras)) for one in (source.city, code))
    return found


def _defined(goals: Sequence[Goal], values: Mapping, own: bool) -> list[Goal]:
    """The ``goals`` that the parents' codes have, with targets where they have no goal. Raises
    `FitnessError` if one of the user's ``own`` is undefined of all."""
    found = []
    for goal in goals:
        codes = {name: code for name, (_, code) in values[goal.measure.name].items()}
        defined = [code for code in codes.values() if not math.isnan(code)]
        if own and not defined:
            raise FitnessError(
                f"{goal.measure.name} is undefined of {', '.join(codes)}",
                "a measure that is a number of at least one parent",
                "try it with: evocity score MAP --fitness, or take other cities",
            )
        if not own and len(defined) < len(codes):
            continue
        if goal.measure.goal is None:
            goal = replace(goal, target=float(f"{defined[0]:.4g}"))
        found.append(goal)
    return found


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


def _why_not(measure: Measure, values: Mapping) -> str:
    undefined = [name for name, (_, code) in values[measure.name].items() if math.isnan(code)]
    return f"no bound, for it is undefined of {', '.join(undefined)}"


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
