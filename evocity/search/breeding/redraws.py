"""Redraws: other plans for births whose children equal a parent.

Each redraw has a generator of its own, keyed by the birth and the number of the redraw. So neither
the number of workers nor the order of the births changes it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from evocity import operators
from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.recipe.mixture import Drawn
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.birth_plans import BirthPlan, birth_generator, founder_indices
from evocity.search.breeding.omitted_genomes import describe_rebreeding

# The first further key of the generators of redraws; admissions have 0, replay checks have 1.
_KEY = 2


@dataclass(frozen=True)
class Redraws:
    """Draws other plans by the mixture of a ``recipe``, with the ``weights`` in force. ``sources``
    are further parents of operators that take from anywhere."""

    recipe: Recipe
    weights: Mapping[str, float]
    sources: Sequence[Genome] = field(repr=False)

    def __call__(self, plan: BirthPlan) -> BirthPlan | None:
        """Draw the plan that replaces a ``plan`` whose child equals a parent.

        It has the parents of the first plan, and an operator by weight that no plan of the birth
        had. If no other operator suits these parents, the first operator has relaxed parameters,
        see `relax`. The last of several redraws has the operator of founders that needs one parent,
        such as mutation. None after as many redraws as ``[search] redraws`` says.
        """
        number = len(plan.rejected) + 1
        if number > self.recipe.search.redraws:
            return None
        rng = birth_generator(self.recipe.run.seed, *self._place(plan), _KEY, number)
        first = plan.first
        own = self._count(first.name)
        parents = list(zip(first.parents, first.genomes, strict=True))[:own]
        names = self._names(len(parents), {*plan.rejected, plan.name})
        operator: Any = first.operator
        if number == self.recipe.search.redraws > 1:
            operator = self.recipe.operator_drawn(self.recipe.kind.first_operators[1][-1], rng)
            parents = parents[:1]
        elif names:
            chances = np.array([self.weights[name] for name in names])
            name = names[rng.choice(len(names), p=chances / chances.sum())]
            operator = self.recipe.operator_drawn(name, rng)
            parents = parents[: self._count(name)]
        else:
            for _ in range(number):
                operator = relax(operator)
        indices = founder_indices(operator, len(self.sources))
        ids, genomes = zip(*parents, *((at, self.sources[at]) for at in indices), strict=True)
        other = replace(plan, operator=operator, parents=ids, genomes=genomes, rng=rng, before=plan)
        noted = plan.reconstruction is not None or self.recipe.log.genomes != "all"
        return replace(other, reconstruction=describe_rebreeding(other) if noted else None)

    def _place(self, plan: BirthPlan) -> tuple[int, int]:
        return divmod(plan.id, self.recipe.generation_size)

    def _count(self, name: str) -> int:
        entry = self.recipe.operators.get(name)
        given = None if entry is None else entry.parents
        return given or self.recipe.operator(name).parents[0]

    def _names(self, count: int, without: set[str]) -> list[str]:
        """Name the operators that breed from ``count`` parents, or from the first of them."""
        return [
            name
            for name, weight in self.weights.items()
            if weight > 0 and name not in without and self._count(name) <= count
        ]


def relax(operator: Any) -> Any:
    """Return an ``operator`` that changes more of a map: with the parameters of its method
    ``relaxed``, if it has one, and if these are not beyond its limits."""
    if isinstance(operator, Drawn):
        operator = operators.make(operator.name, **operator.parameters, **operator.drawn)
    try:
        return operator.relaxed() if hasattr(operator, "relaxed") else operator
    except OperatorError:
        return operator
