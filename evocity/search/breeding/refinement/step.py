"""The memetic step of a search: some births are the best child that an optimiser finds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar

import numpy as np

from evocity.evaluation.evaluator import Evaluator
from evocity.fitness import Aims
from evocity.genome import Genome
from evocity.recipe.mixture import operator_of
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.birth_plans import BirthPlan, birth_generator
from evocity.search.breeding.refinement.climb import Score, climb, round_score
from evocity.search.breeding.refinement.variables import field_tuning, height_tuning
from evocity.selection.individual import Individual
from evocity.selection.population import Population


@dataclass(frozen=True)
class Refinement:
    """An operator that tunes the fabric or the heights of its first parent, and measures the
    children by an evaluator, see `bred_within`. The child's ``made`` describes this under
    ``refined``.

    values : of the first parent, measure -> raw number.
    score : what the optimiser minimises.
    make : gives the operator of a field from its ``side`` and ``values``.
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

    def bred_within(self, evaluator: Evaluator) -> Callable:
        """Return the operator that breeds and measures by ``evaluator``."""
        return partial(self._breed, evaluator)

    def _breed(
        self, evaluator: Evaluator, parents: Sequence[Genome], rng: np.random.Generator
    ) -> Genome:
        first, *others = parents
        tuning = (
            height_tuning(first, self.side, self.make)
            if self.way == "heights"
            else field_tuning(first, others, self.side, self.make)
        )
        climbed = climb(
            first,
            self.values,
            tuning,
            self.score,
            evaluator.breed,
            evaluator.evaluate,
            self.budget,
            self.algorithm,
        )
        noted = {
            "way": self.way,
            "algorithm": self.algorithm,
            "evaluations": climbed.evaluations,
            "score_before": round_score(self.score(self.values)[1]),
            "score": round_score(climbed.score[1]),
            "weights": [round(weight, 4) for weight in self.score.weights],
        }
        made = climbed.genome.made if climbed.better else {}
        return climbed.genome.replace(made={**made, "refined": noted})


def add_refinements(
    plans: Sequence[BirthPlan],
    recipe: Recipe,
    generation: int,
    population: Population,
    aims: Aims,
    slots: range,
) -> list[BirthPlan]:
    """Replace the ``plans`` for the last of the ``slots`` of a ``generation`` by refinements, if
    the recipe says so. Each refines the best of the living by drawn weights of the goals, and draws
    from the others those who offer their fabric."""
    section = recipe.refine
    if not section.births or generation == 0 or generation % section.every:
        return list(plans)
    if section.way == "lambda_field" and len(population.living) < 2:  # nobody offers any fabric
        return list(plans)
    last, refined = slots[max(0, len(slots) - section.births) :], []
    for plan in plans:
        slot = plan.id % recipe.generation_size
        if slot in last:
            rng = birth_generator(recipe.run.seed, generation, slot)
            score = Score.of(aims, population.first_losses)
            operator, parents = _refinement(population.living, score, recipe, rng)
            ids, genomes = zip(*((one.id, one.genome) for one in parents), strict=True)
            plan = BirthPlan(plan.id, operator, ids, genomes, rng)
        refined.append(plan)
    return refined


def _refinement(
    living: Sequence[Individual], score: Score, recipe: Recipe, rng: np.random.Generator
) -> tuple[Refinement, list[Individual]]:
    section, name = recipe.refine, recipe.refine.operator
    weights = rng.dirichlet(np.ones(len(score.weights))) * len(score.weights)
    score = replace(score, weights=tuple(weights.tolist()))
    best = min(living, key=lambda one: (score(one.values), one.id))
    parents = [best]
    if section.way == "lambda_field":
        others = [one for one in living if one is not best]
        drawn = rng.permutation(len(others))[: section.others]
        parents += [others[at] for at in drawn.tolist()]
    refinement = Refinement(
        section.way,
        section.budget,
        section.algorithm,
        section.side,
        score,
        dict(best.values),
        partial(operator_of, name, recipe.parameters(name), recipe.genome.coding),
    )
    return refinement, parents
