"""`Island`: one population of a search, and all that decides its births.

Most searches have one, which has no name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evocity.fitness import Aims
from evocity.search.breeding import (
    Picks,
    Plan,
    first_population,
    founder,
    generator,
    letting_in,
    next_population,
    own_population,
    selecting,
)
from evocity.search.credit import Credit
from evocity.search.individual import Individual
from evocity.search.leaving import again_of
from evocity.search.population import Population
from evocity.search.preparation import Prepared
from evocity.search.recipe import Recipe
from evocity.search.refinement.step import with_refinements
from evocity.store import Birth


class Island:
    """A population by a ``recipe``, whose births have the ``slots`` of each generation.

    name : None where the search has no other island.
    number : which island it is, from 0.
    aims : what is wanted here, with the weights that count now.
    credit : what its operators have earned, None if the recipe does not adapt to it.
    """

    def __init__(
        self,
        prepared: Prepared,
        recipe: Recipe,
        aims: Aims,
        slots: range,
        number: int = 0,
        name: str | None = None,
    ):
        self.recipe, self.aims, self.slots = recipe, aims, slots
        self.number, self.name = number, name
        self.credit = Credit() if recipe.search.adapt else None
        self._sources = [source.genome for source in prepared.sources]
        self.population = Population(
            recipe.search.algorithm_of(len(slots)), aims, prepared.header.chromosome, recipe.limits
        )

    @property
    def mixture(self) -> dict[str, float]:
        """The weights that the recipe gives the operators."""
        return {name: entry.weight for name, entry in self.recipe.operators.items()}

    @property
    def breeds_by(self) -> str | None:
        """The operator that the algorithm breeds with by itself, None where the mixture does."""
        return self.population.algorithm.breeds_by

    def weights(self, asked: Mapping[str, float]) -> dict[str, float]:
        """Weights of operators that are not the recipe's: those that were ``asked`` for, and what
        credit makes of them."""
        own = self.mixture
        asked = {name: weight for name, weight in asked.items() if name in own}
        if self.credit is None:
            return asked
        own |= asked
        factors = self.credit.factors(list(own))
        return {name: weight * factors[name] for name, weight in own.items()}

    def plans(
        self, generation: int, picks: Picks, weights: Mapping[str, float], refined: bool = True
    ) -> list[Plan]:
        """The births of a ``generation``. ``weights``: those of `weights`. Nobody is ``refined``
        where births are not measured as they are bred."""
        recipe, living = self.recipe, self.population.living
        if self.breeds_by is not None:
            algorithm = self.population.algorithm
            plans = own_population(recipe, algorithm, generation, self._sources)
        elif generation == 0:
            plans = first_population(recipe, self._sources, self.slots)
        else:
            algorithm, of = self.population.algorithm, (living, self._sources, picks, weights)
            plans = next_population(recipe, algorithm, generation, *of, self.slots)
            if refined:
                of = self.population, self.aims, self.slots
                plans = with_refinements(plans, recipe, generation, *of)
        return [self._own(plan) for plan in plans]

    def plan(self, identifier: int, picks: Picks, weights: Mapping[str, float]) -> Plan:
        """The birth with this id, after generation 0, of those who live now; a founder where nobody
        does."""
        recipe, population = self.recipe, self.population
        generation, slot = divmod(identifier, recipe.run.population)
        if not population.living:
            return self.founder(identifier)
        of = population.living, self._sources, picks, weights, range(slot, slot + 1)
        plans = next_population(recipe, population.algorithm, generation, *of)
        of = population, self.aims, self.slots
        return self._own(with_refinements(plans, recipe, generation, *of)[0])

    def founder(self, identifier: int) -> Plan:
        """The birth with this id, of sources alone: one more as those of generation 0 are."""
        recipe = self.recipe
        rng = generator(recipe.run.seed, *divmod(identifier, recipe.run.population))
        return self._own(founder(recipe, self._sources, identifier, rng))

    def _own(self, plan: Plan) -> Plan:
        """A ``plan`` of a birth on this island; with how it comes about once more, where the log
        leaves genomes out."""
        again = None if self.recipe.log.genomes == "all" else again_of(plan)
        if (plan.island, plan.again) == (self.name, again):
            return plan
        return replace(plan, island=self.name, again=again)

    def let_in(self, birth: Birth, looks: Mapping[int, np.ndarray]) -> None:
        """One birth: it lives, and somebody else may not, if the algorithm selects so."""
        self.population.select([birth], letting_in(self.recipe, birth.id), looks)

    def select(
        self,
        births: Sequence[Birth],
        generation: int,
        looks: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """Those of the living and of the ``births`` of a ``generation`` live on that the algorithm
        selects."""
        self.population.select(births, selecting(self.recipe, generation, self.number), looks)
        self.learn(births)

    def learn(self, births: Sequence[Birth]) -> None:
        """Take in what the operators of a generation's ``births`` have earned."""
        if self.credit is not None:
            own = [born for born in births if born.island == self.name]
            self.credit.learn(own, self.aims, {one.id for one in self.population.living})

    def migrants(self, taker: "Island", count: int, rng: np.random.Generator) -> list[Individual]:
        """``count`` of those who live here and not on the ``taker``, as the algorithm here chooses,
        that may live there too."""
        there = {one.genome.digest for one in taker.population.living}
        strange = [one for one in self.population.living if one.genome.digest not in there]
        return self.population.algorithm.migrants(strange, count, rng)

    def relive(self, births: Sequence[Birth], generation: int) -> None:
        """Go through a ``generation`` once more, of which ``births`` came, for an algorithm that
        `replays`."""
        own_population(self.recipe, self.population.algorithm, generation, self._sources)
        self.population.select(births, selecting(self.recipe, generation, self.number))

    def reweigh(self, aims: Aims) -> None:
        """Judge all anew by other ``aims``."""
        self.aims = aims
        self.population.reweigh(aims)
        if self.credit is not None:
            self.credit.forget_front()


__all__ = ["Island"]
