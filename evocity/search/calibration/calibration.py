"""A first recipe for any cities: goals, and a guard calibrated on the parents' codes.

The parents keep the bounds of the guard, and a heap of cut buildings does not keep them. The values
of the parents' maps and codes decide the bounds (`evocity.search.calibration.guard`). A few births
show how long the run will take.
"""

import contextlib
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from evocity import fitness, store
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import FitnessError, MapError, keyword
from evocity.evaluation.compilation import compile_once, kernel_parts
from evocity.evaluation.evaluator import Evaluator, Outcome
from evocity.fitness import Measure
from evocity.operators.pavement_fusion import DirectFusion
from evocity.recipe.reader import recipe_of
from evocity.recipe.recipe import Recipe
from evocity.recipe.sections import Parent
from evocity.search.breeding.birth_plans import child_plans
from evocity.search.calibration.guard import (
    BANDS,
    GUARD,
    OF_FABRIC,
    calibrate_bound,
    parents_target,
    tighten_bound,
)
from evocity.search.calibration.recipe_notes import notes_on
from evocity.search.calibration.recipe_text import Bound, Goal, RecipeSettings, recipe_text
from evocity.search.preparation.preparation import Prepared, aims_of, prepare, references_of
from evocity.selection.individual import Individual
from evocity.store import Source

#: The goals unless the user has some, as far as they are defined of the parents.
USUAL_GOALS = ("autosimilarity", "alignment", "salingaros_law", "crumbs")
#: The usual goals that have the parents' values as targets.
OF_PARENTS = ("salingaros_law", "crumbs")
#: The most generations that a time in minutes becomes.
MOST_GENERATIONS = 1_000_000
#: Seconds of a core that a birth costs besides its worker: the main process and waits.
BESIDE = 0.01
#: Births that are timed, and births before them that load what they need.
_TIMED, _LOADING = 10, 3


@dataclass(frozen=True)
class CalibratedRecipe:
    """A recipe to begin from: its ``text``, and the same as ``recipe``.

    values : measure -> parent -> values of its (map, code), NaN if undefined.
    seconds : that one birth took one worker.
    failing : why a run by it would stop at once; "" if it would not.
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
        return self.recipe.generation_size * (self.recipe.run.generations + 1)

    @property
    def duration(self) -> float:
        """Seconds that all births take, on as many workers as there are cores."""
        return self.births * _pace(self.seconds, self.recipe)


def calibrate_recipe(
    settings: RecipeSettings,
    goals: Sequence[Goal],
    path: Path,
    tell: Callable[[str], None],
    on_map: Callable[[CityMap, Parent], None] | None = None,
) -> CalibratedRecipe:
    """Write a recipe for the parents and the window of ``settings``, as it would lie at ``path``,
    with a calibrated guard. ``goals`` are by default `USUAL_GOALS`. ``tell`` is called with steps,
    ``on_map`` with each parent's map and entry.

    Raises `RecipeError` for an impossible window or centre. Raises `MapError`, `GenomeError` or
    `FitnessError` if a map cannot be used or is empty, or no parent has a value of a goal.
    """
    own = any(not goal.is_constraint for goal in goals)
    goals = list(goals) if own else _with_usual(goals)
    drafted = [replace(goal, target=0.0) if goal.lacks_target else goal for goal in goals]
    draft = _read_recipe(recipe_text(settings, drafted, []), path)
    compile_once(draft.genome.block, kernel_parts(draft), tell)

    def check_map(city: CityMap, parent: Parent) -> None:
        if on_map is not None:
            on_map(city, parent)
        _refuse_empty(city, parent)

    prepared = prepare(draft, tell, check_map)
    cities = [source.city for source in prepared.sources]
    measures = [goal.measure for goal in goals]
    named = {goal.measure.name for goal in goals if goal.within is None}
    guard = [fitness.get(name) for name in GUARD if name not in named or name not in BANDS]
    values = {one.name: _values(one, prepared, cities) for one in [*measures, *guard]}
    goals, left_out = _select_goals(goals, values, own, path)
    bounds = {one.name: calibrate_bound(one, values[one.name]) for one in guard}
    unbounded = [name for name, bound in bounds.items() if bound is None]
    bounds = [bound for bound in bounds.values() if bound is not None]
    bounds, loose = _tighten(bounds, values, prepared, cities)
    recipe = _read_recipe(recipe_text(settings, goals, bounds, values), path)
    tell("breeding trial children to estimate the duration")
    compile_once(recipe.genome.block, kernel_parts(recipe), tell)
    trials = _trials(_with_recipe(prepared, recipe))
    seconds = sum(outcome.seconds for outcome in trials) / len(trials)
    sources = prepared.sources
    failures, failing = _describe_failures(trials, recipe.evaluation.max_failures)
    notes = [
        *prepared.notes,
        *left_out,
        *notes_on(goals, bounds, values, cities),
        *loose,
        *(
            f"{n}: no bound, because it is undefined for {_list_undefined(values[n])}"
            for n in unbounded
            if n != "smallest_share" or len(cities) > 1
        ),
        *failures,
    ]
    settings = _with_generations(settings, recipe, seconds)
    content = settings, goals, bounds, values
    if settings.generations != recipe.run.generations:
        recipe = _read_recipe(recipe_text(*content), path)
    draft = CalibratedRecipe("", recipe, values, bounds, seconds, sources, notes, failing)
    uncredited = [k for k, source in enumerate(sources) if not source.city.attribution]
    text = recipe_text(*content, (draft.births, seconds, draft.duration), uncredited)
    return replace(draft, text=text, recipe=_read_recipe(text, path))


def _with_usual(constraints: Sequence[Goal]) -> list[Goal]:
    """The usual goals, with the bounds of ``constraints`` on them, and all other constraints."""
    usual = {name: Goal(fitness.get(name), of_parents=name in OF_PARENTS) for name in USUAL_GOALS}
    for one in constraints:
        name = one.measure.name
        usual[name] = replace(usual[name], bounds=one.bounds) if name in usual else one
    return list(usual.values())


def _read_recipe(text: str, path: Path) -> Recipe:
    return recipe_of(text, path.parent.resolve(), {}, name=str(path))


def _with_generations(settings: RecipeSettings, recipe: Recipe, seconds: float) -> RecipeSettings:
    """As many generations as the minutes of ``settings`` allow if a birth takes one worker so many
    ``seconds``; at least one."""
    if settings.minutes is None:
        return settings
    pace = recipe.generation_size * _pace(seconds, recipe)
    bred = 60 * settings.minutes / max(pace, 1e-9) - 1  # the first population takes as long
    return replace(settings, generations=max(1, min(int(bred), MOST_GENERATIONS)))


def _pace(seconds: float, recipe: Recipe) -> float:
    """Return the seconds between two births, if one takes a worker so many ``seconds``."""
    return (seconds + BESIDE) / max(1, recipe.worker_count)


def _values(
    measure: Measure, prepared: Prepared, cities: Sequence
) -> dict[str, tuple[float, float]]:
    """Parent -> values of its map and its code."""
    measure, values = _with_reference(measure, prepared, cities), {}
    for source in prepared.sources:
        extras = {"genome": source.genome, "parents": [source.genome], "sources": cities}
        code = decode(source.genome).city
        values[source.name] = tuple(measure(city, **extras) for city in (source.city, code))
    return values


def _with_reference(measure: Measure, prepared: Prepared, cities: Sequence) -> Measure:
    """Bind a measure that compares cities to those of the recipe, or to the parents."""
    if "reference" not in measure.takes:
        return measure
    named = prepared.references.get(measure.name)
    return measure.bound(named or fitness.Reference.sources(cities))


def _tighten(
    bounds: Sequence[Bound], values: Mapping, prepared: Prepared, cities: Sequence
) -> tuple[list[Bound], list[str]]:
    """Tighten ``bounds`` that a heap of cut buildings keeps, and note those that bound nothing. The
    heap has lifs of all parents, each drawn by itself, without repair."""
    parents = [source.genome for source in prepared.sources]
    if len(parents) < 2:
        return list(bounds), []
    heap = DirectFusion(repair=None)(parents, np.random.default_rng(0))
    city, extras = decode(heap).city, {"genome": heap, "parents": parents, "sources": cities}
    tightened, notes = [], []
    for bound in bounds:
        note = ""
        if bound.measure.name in OF_FABRIC:
            measure = _with_reference(bound.measure, prepared, cities)
            of_parents = values[bound.measure.name]
            bound, note = tighten_bound(bound, of_parents, measure(city, **extras))
        tightened.append(bound)
        notes += [note] if note else []
    return tightened, notes


def _refuse_empty(city: CityMap, parent: Parent) -> None:
    if not city.built.any():
        raise MapError(
            f"{city.name}: the map ({parent.place}) has no buildings",
            "a map with buildings for every parent",
            f"move or enlarge the window with {keyword('center')} and {keyword('pixels')}, "
            "or leave this map out",
        )


def _select_goals(
    goals: Sequence[Goal], values: Mapping, own: bool, path: Path
) -> tuple[list[Goal], list[str]]:
    """The ``goals`` that the parents' codes have values of, and notes on the others. Raises
    `FitnessError` for one of the user's ``own`` that no parent has, and if no goal is left."""
    kept, left_out = [], []
    for goal in goals:
        of_parents = values[goal.measure.name]
        defined = [code for _, code in of_parents.values() if not math.isnan(code)]
        if own and not defined:
            raise FitnessError(
                f"the measure {goal.measure.name} is undefined for {_list_undefined(of_parents)}",
                "a measure that has a value for at least one parent",
                f"test the measure with evocity score MAP --fitness {_option_value(goal, path)}, "
                "or choose other cities",
            )
        if not own and len(defined) < len(of_parents):
            undefined = _list_undefined(of_parents)
            left_out.append(
                f"{goal.measure.name}: no goal, because it is undefined for {undefined}"
            )
            continue
        if goal.of_parents:
            goal = replace(goal, target=parents_target(goal.measure, of_parents))
        elif goal.lacks_target:
            goal = replace(goal, target=float(f"{defined[0]:.4g}"), of_first=True)
        kept.append(goal)
    if not kept:
        raise FitnessError(
            f"no usual goal has a value for every parent: {'; '.join(left_out)}",
            "a measure that has a value for every parent",
            "choose another measure with --fitness, or choose other cities",
        )
    return kept, left_out


def _option_value(goal: Goal, path: Path) -> str:
    """How ``--fitness`` names a ``goal`` of the recipe at ``path`` from the current folder."""
    if goal.file is None:
        return goal.measure.name
    file = os.path.join(path.parent, goal.file)
    with contextlib.suppress(ValueError):  # on another drive
        return os.path.relpath(file)
    return file


def _describe_failures(trials: Sequence[Outcome], limit: float) -> tuple[list[str], str]:
    """Notes on failed ``trials``, and why a run would stop if more than ``limit`` failed."""
    failed = [outcome for outcome in trials if outcome.status != "ok"]
    if not failed:
        return [], ""
    said = f"{len(failed)} of {len(trials)} trial births failed; the first: {failed[0].error}"
    if len(failed) <= limit * len(trials):
        return [said], ""
    return (
        [],
        f"{said}\n  A run stops when more than {100 * limit:.0f} % of a generation's births fail",
    )


def _with_recipe(prepared: Prepared, recipe: Recipe) -> Prepared:
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
    evaluator = Evaluator(prepared.setup)
    sources = [source.genome for source in prepared.sources]
    algorithm = prepared.recipe.search.algorithm_of(len(sources))
    living = algorithm.judged([Individual(k, one, {}, (0.0,)) for k, one in enumerate(sources)])
    plans = child_plans(prepared.recipe, algorithm, 1, living, sources)
    plans = plans[: _LOADING + _TIMED]
    outcomes = [evaluator.born(plan.operator, plan.genomes, plan.rng) for plan in plans]
    return outcomes[min(_LOADING, len(outcomes) - 1) :]


def _list_undefined(of_parents: Mapping[str, tuple[float, float]]) -> str:
    reasons: dict[str, list[str]] = {}
    for name, (_, code) in of_parents.items():
        if math.isnan(code):
            reasons.setdefault(getattr(code, "reason", ""), []).append(name)
    return ", ".join(
        " and ".join(names) + f" ({reason})" * bool(reason) for reason, names in reasons.items()
    )
