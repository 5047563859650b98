"""The memetic step of a search: some births are the best that an optimiser finds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from evocity.fitness import Aims
from evocity.genome import Genome
from evocity.search.breeding import Plan, generator
from evocity.search.evaluator import Evaluator
from evocity.search.individual import Individual
from evocity.search.mixture import operator_of
from evocity.search.population import Population
from evocity.search.recipe import Recipe
from evocity.search.refinement.climbing import climb, rounded
from evocity.search.refinement.score import Score
from evocity.search.refinement.tuning import of_field, of_heights


@dataclass(frozen=True)
class Refinement:
    """Breeds what an optimiser makes of the first parent: of its street blocks' fabric, of which
    the other parents offer theirs, or of its heights. It measures children to find out, so it is
    bred where births are measured, by what `bred_within` makes of it.

    values : those of the first parent, measure -> raw number.
    score : what is minimised.
    make : gives the operator of a field, of its ``side`` and ``values``.

    ``made`` tells, under ``refined``, how many ``evaluations`` it took and the scores.
    """

    way: str
    budget: int
    algorithm: str
    side: int
    score: Score
    values: dict
    make: Callable

    name: ClassVar[str] = "refinement"
    parents: ClassVar[tuple[int, int | None]] = (1, None)

    def bred_within(self, evaluator: Evaluator) -> "_Within":
        return _Within(self, evaluator)


@dataclass(frozen=True)
class _Within:
    """A `Refinement` that can measure."""

    step: Refinement
    evaluator: Evaluator

    def __call__(self, parents: Sequence[Genome], rng: np.random.Generator) -> Genome:
        step, first = self.step, parents[0]
        tuning = (
            of_heights(first, step.side, step.make)
            if step.way == "heights"
            else of_field(first, parents[1:], step.side, step.make)
        )
        climbed = climb(
            first,
            step.values,
            tuning,
            step.score,
            self.evaluator.breed,
            self.evaluator.evaluate,
            step.budget,
            step.algorithm,
        )
        noted = {
            "way": step.way,
            "algorithm": step.algorithm,
            "evaluations": climbed.evaluations,
            "score_before": rounded(step.score(step.values)[1]),
            "score": rounded(climbed.score[1]),
            "weights": [round(one, 4) for one in step.score.weights],
        }
        made = climbed.genome.made if climbed.better else {}
        return climbed.genome.replace(made={**made, "refined": noted})


def with_refinements(
    plans: Sequence[Plan],
    recipe: Recipe,
    generation: int,
    population: Population,
    aims: Aims,
    slots: range,
) -> list[Plan]:
    """The ``plans`` of a ``generation``; those for the last of the ``slots`` are refinements, if
    the recipe says so.

    Each refines the best of the living by weights of the goals that are drawn for it; those who
    offer their fabric are drawn from the others.
    """
    section = recipe.refine
    if not section.births or generation == 0 or generation % section.every:
        return list(plans)
    if section.way == "lambda_field" and len(population.living) < 2:  # nobody offers any fabric
        return list(plans)
    last, found = slots[max(0, len(slots) - section.births) :], []
    for plan in plans:
        slot = plan.id % recipe.run.population
        if slot in last:
            rng = generator(recipe.run.seed, generation, slot)
            score = Score.of(aims, population.first_losses)
            operator, parents = _refinement(population.living, score, recipe, rng)
            ids, genomes = zip(*((one.id, one.genome) for one in parents), strict=True)
            plan = Plan(plan.id, operator, ids, genomes, rng)
        found.append(plan)
    return found


def _refinement(
    living: Sequence[Individual], score: Score, recipe: Recipe, rng: np.random.Generator
) -> tuple[Refinement, list[Individual]]:
    """The refinement of one birth, and its parents."""
    section, name = recipe.refine, recipe.refine.operator
    weights = rng.dirichlet(np.ones(len(score.weights))) * len(score.weights)
    score = replace(score, weights=tuple(weights.tolist()))
    best = min(living, key=lambda one: (score(one.values), one.id))
    parents = [best]
    if section.way == "lambda_field":
        others = [one for one in living if one is not best]
        drawn = rng.permutation(len(others))[: section.others]
        parents += [others[at] for at in drawn.tolist()]
    told = Refinement(
        section.way,
        section.budget,
        section.algorithm,
        section.side,
        score,
        dict(best.values),
        partial(operator_of, name, recipe.parameters(name), recipe.genome.coding),
    )
    return told, parents


__all__ = ["Refinement", "with_refinements"]
