"""`Island`: one population of a search, and what decides its births.

Most searches have one island, which has no name.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evocity.fitness import Aims
from evocity.genome import Genome
from evocity.operators.plans.inheritance import InheritedPlan, founder_name
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.birth_plans import (
    UNGUIDED,
    BirthPlan,
    Guidance,
    admission_generator,
    birth_generator,
    child_plans,
    founder_plan,
    founder_plans,
    learner_plans,
    selection_generator,
)
from evocity.search.breeding.credit import Credit
from evocity.search.breeding.omitted_genomes import describe_rebreeding
from evocity.search.breeding.redraws import Redraws
from evocity.search.breeding.refinement.step import add_refinements
from evocity.search.preparation.preparation import Prepared
from evocity.selection.individual import Individual
from evocity.selection.population import Population
from evocity.store import Birth


def plan_name(genome: Genome) -> tuple[str | None, bool]:
    """Return the name of the plan of a ``genome``, and whether it differs from those of all source
    cities. The name is None if the genome inherits no plan."""
    state = InheritedPlan.from_made(genome.made)
    if state is not None:
        return state.key, bool(state.changes)
    return founder_name(genome), False


class Island:
    """A population by a ``recipe``, whose births have the ``slots`` of each generation.

    name : None for the only island of a search.
    number : which island it is, from 0.
    aims : its goals and constraints, with the weights in force.
    credit : what its operators earned; None if the recipe does not adapt their weights.
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
        self.credit = Credit(recipe.search.credit) if recipe.search.adapt else None
        self._sources = [source.genome for source in prepared.sources]
        self.population = Population(
            recipe.search.algorithm_of(len(slots) if name is not None else recipe.run.population),
            aims,
            prepared.header.chromosome,
            recipe.limits,
            plan_name if recipe.search.has_niches else None,
        )

    @property
    def mixture(self) -> dict[str, float]:
        """The weights that the recipe gives the operators."""
        return {name: entry.weight for name, entry in self.recipe.operators.items()}

    @property
    def breeds_by(self) -> str | None:
        """The operator by which the algorithm breeds; None if the mixture does."""
        return self.population.algorithm.breeds_by

    def weights(self, ordered: Mapping[str, float]) -> dict[str, float]:
        """Return the operator weights that replace the recipe's: those ``ordered`` by commands,
        times what credit makes of them."""
        mixture = self.mixture
        ordered = {name: weight for name, weight in ordered.items() if name in mixture}
        if self.credit is None:
            return ordered
        mixture |= ordered
        factors = self.credit.factors(list(mixture))
        return {name: weight * factors[name] for name, weight in mixture.items()}

    # -- plans ---------------------------------------------------------------------------------

    def plans(self, generation: int, guidance: Guidance, refined: bool = True) -> list[BirthPlan]:
        """Plan the births of a ``generation``. Without ``refined``, none is a refinement: births
        that are measured elsewhere cannot measure while they breed."""
        algorithm = self.population.algorithm
        if self.breeds_by is not None:
            plans = learner_plans(self.recipe, algorithm, generation, self._sources)
        elif generation == 0:
            plans = founder_plans(self.recipe, self._sources, self.slots)
        else:
            return self._later_plans(generation, guidance, refined)
        return [self._complete(plan, guidance) for plan in plans]

    def _later_plans(self, generation: int, guidance: Guidance, refined: bool) -> list[BirthPlan]:
        """Plan a ``generation`` after the first: founders until there are as many as can live."""
        first = generation * self.recipe.generation_size
        missing = min(max(0, self.recipe.run.population - first), len(self.slots))
        founders = [self.founder_plan(first + slot) for slot in self.slots[:missing]]
        if missing == len(self.slots):
            return founders
        return founders + self._child_plans(generation, guidance, self.slots[missing:], refined)

    def plan(self, identifier: int, guidance: Guidance) -> BirthPlan:
        """Plan the birth ``identifier``, after generation 0, from those who live now; a founder if
        nobody does."""
        if not self.population.living:
            return self.founder_plan(identifier)
        generation, slot = divmod(identifier, self.recipe.generation_size)
        return self._child_plans(generation, guidance, range(slot, slot + 1))[0]

    def founder_plan(self, identifier: int) -> BirthPlan:
        """Plan the birth ``identifier`` from sources, as those of generation 0."""
        recipe = self.recipe
        rng = birth_generator(recipe.run.seed, *divmod(identifier, recipe.generation_size))
        return self._complete(founder_plan(recipe, self._sources, identifier, rng), UNGUIDED)

    def _child_plans(
        self, generation: int, guidance: Guidance, slots: range, refined: bool = True
    ) -> list[BirthPlan]:
        recipe, population = self.recipe, self.population
        plans = child_plans(
            recipe,
            population.algorithm,
            generation,
            population.living,
            self._sources,
            guidance,
            self.name,
            slots,
            self.aims,
        )
        if refined:
            plans = add_refinements(plans, recipe, generation, population, self.aims, self.slots)
        return [self._complete(plan, guidance) for plan in plans]

    def _complete(self, plan: BirthPlan, guidance: Guidance) -> BirthPlan:
        """Add what only the island knows: its name, how the child is bred a second time, and what
        replaces a child that equals a parent."""
        reconstruction = None if self.recipe.log.genomes == "all" else describe_rebreeding(plan)
        redraw = None
        if self.recipe.search.redraws and plan.operator is not None and self.breeds_by is None:
            weights = self.mixture | dict(guidance.weights.get(self.name, {}))
            draws = Redraws(self.recipe, weights, self._sources)
            redraw = None if hasattr(plan.operator, "bred_within") else draws
        if (plan.island, plan.reconstruction, redraw) == (self.name, reconstruction, None):
            return plan
        return replace(plan, island=self.name, reconstruction=reconstruction, redraw=redraw)

    # -- selection -----------------------------------------------------------------------------

    def admit_birth(self, birth: Birth, looks: Mapping[int, np.ndarray] | None = None) -> None:
        """Add one ``birth``, and remove another individual if the algorithm selects so."""
        self.population.select([birth], admission_generator(self.recipe, birth.id), looks)

    def select(
        self,
        births: Sequence[Birth],
        generation: int,
        looks: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """Select who lives on, of the living and the ``births`` of a ``generation``."""
        rng = selection_generator(self.recipe, generation, self.number)
        self.population.select(births, rng, looks)
        self.learn(births)

    def learn(self, births: Sequence[Birth]) -> None:
        """Credit the operators of a generation's ``births``."""
        if self.credit is not None:
            births = [birth for birth in births if birth.island == self.name]
            living = {individual.id for individual in self.population.living}
            self.credit.learn(births, self.aims, living)

    def migrants(self, taker: "Island", count: int, rng: np.random.Generator) -> list[Individual]:
        """Return ``count`` individuals, chosen by the algorithm, that may live on ``taker`` too,
        and do not yet."""
        there = {individual.genome.digest for individual in taker.population.living}
        strange = [one for one in self.population.living if one.genome.digest not in there]
        return self.population.algorithm.migrants(strange, count, rng)

    def replay_generation(self, births: Sequence[Birth], generation: int) -> None:
        """Select from the logged ``births`` of a ``generation``, for an algorithm that
        `replays`."""
        learner_plans(self.recipe, self.population.algorithm, generation, self._sources)
        rng = selection_generator(self.recipe, generation, self.number)
        self.population.select(births, rng)

    def reweigh(self, aims: Aims) -> None:
        """Judge all individuals by other ``aims``."""
        self.aims = aims
        self.population.reweigh(aims)
        if self.credit is not None:
            self.credit.forget_front()
