"""Plans of logged births: drawn a second time from what the log of a run holds."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, islice

from evocity.errors import RunError
from evocity.search.breeding.archipelago import Archipelago, Tell
from evocity.search.breeding.birth_plans import UNGUIDED, BirthPlan, Guidance, selection_generator
from evocity.search.preparation.preparation import Prepared
from evocity.search.record.aims import births_without_genomes, iterate_generations
from evocity.search.record.commands import StandingOrders
from evocity.search.resume.resume import living_of, orders_of
from evocity.search.steering.execution import picks_of
from evocity.store import Birth, RunLog


def plan_of(run: RunLog, prepared: Prepared, identifier: int) -> BirthPlan:
    """Draw the plan of the birth ``identifier`` of a ``run``: its operator with drawn parameters,
    its parents, and its generator before the breeding. ``prepared`` is of `read_preparation`.

    Raises `RunError` if the algorithm breeds by its own operator, whose parameters stand in
    ``made``, or if the log has another operator or other parents.
    """
    recipe = prepared.recipe
    if recipe.search.breeds_by is not None and identifier >= recipe.generation_size:
        raise RunError(
            f"{run.path}: the algorithm {recipe.search.algorithm} bred individual {identifier} "
            "with its own operator",
            "a run that breeds with the operators of the recipe",
            "read the parameters of the operator in the genome's attribute `made`",
        )
    (plan,) = plans_of(run, prepared, [identifier])
    (birth,) = run.individuals([identifier])
    for _ in birth.made.get("redrawn", ()):  # its first children equalled a parent
        plan = (plan.redraw and plan.redraw(plan)) or plan
    if (plan.name, tuple(plan.parents)) != (birth.operator, tuple(birth.parents)):
        raise RunError(
            f"{run.path}: individual {identifier} was bred by {birth.operator} from "
            f"{list(birth.parents)}, but the run's random seed now gives {plan.name} from "
            f"{list(plan.parents)}",
            "a run of this release of evocity, whose births follow from its seed",
            "choose another individual",
        )
    return plan


def plans_of(run: RunLog, prepared: Prepared, ids: Iterable[int]) -> Iterator[BirthPlan]:
    """Draw the plans of the births ``ids`` of a ``run``, each once and by id, without a look at
    their logged operators and parents. ``prepared``: as in `plan_of`."""
    recipe, ids = prepared.recipe, sorted(set(ids))
    size = recipe.generation_size
    generations = groupby(ids, lambda identifier: identifier // size)
    if recipe.search.breeds_by is not None:
        by_generation = {generation: list(group) for generation, group in generations}
        yield from _learner_plans(run, prepared, by_generation)
        return
    for generation, group in generations:
        if generation and recipe.search.window is not None:
            yield from _window_plans(run, prepared, list(group))
        else:
            yield from _generation_plans(run, prepared, generation, group)


def _generation_plans(
    run: RunLog, prepared: Prepared, generation: int, ids: Iterable[int]
) -> Iterator[BirthPlan]:
    size, guidance = prepared.recipe.generation_size, UNGUIDED
    population = Archipelago(prepared)
    if generation:
        past = PastState.of(run, prepared, generation)
        population, guidance = past.population(prepared), past.guidance
    for island, own in groupby(ids, lambda identifier: population.island_of(identifier % size)):
        plans = island.plans(generation, guidance)
        yield from (plans[identifier % size - island.slots.start] for identifier in own)


def _window_plans(run: RunLog, prepared: Prepared, ids: Sequence[int]) -> Iterator[BirthPlan]:
    """Plans in a window, from those who lived when the birth that each waits for was admitted."""
    size, window = prepared.recipe.run.population, prepared.recipe.search.window
    for generation, own in groupby(ids, lambda identifier: max(-1, (identifier - window) // size)):
        if generation < 0:
            yield from map(Archipelago(prepared).single.founder_plan, own)
            continue
        planned, past = set(own), PastState.of(run, prepared, generation)
        island = past.population(prepared).single
        for birth in past.births(max(planned) - window):
            island.admit_birth(birth)
            if birth.id + window in planned:
                yield island.plan(birth.id + window, past.guidance)


def _learner_plans(
    run: RunLog, prepared: Prepared, ids: Mapping[int, Sequence[int]]
) -> Iterator[BirthPlan]:
    """Plans of an algorithm with its own operator: it learns from all earlier births again."""
    recipe, weights = prepared.recipe, {}
    population = Archipelago(prepared)
    population.begin_with(births_without_genomes(run, 0))
    island = population.single
    past = islice(iterate_generations(run), max(ids, default=-1) + 1)
    for generation, births in enumerate(past):
        orders = orders_of(run, generation)
        if orders.weights != weights:
            weights = orders.weights
            population.reweigh(weights)
        plans = island.plans(generation, UNGUIDED)
        yield from (plans[one % recipe.generation_size] for one in ids.get(generation, ()))
        island.population.select(births, selection_generator(recipe, generation))


@dataclass(frozen=True)
class PastState:
    """A ``run`` as it was when a ``generation`` began: the ``orders`` in force, and the
    ``guidance`` of its breeding."""

    run: RunLog
    generation: int
    orders: StandingOrders
    guidance: Guidance

    @classmethod
    def of(cls, run: RunLog, prepared: Prepared, generation: int) -> "PastState":
        """Read it from the log of a ``run``."""
        recipe, orders = prepared.recipe, orders_of(run, generation)
        genomes = {birth.id: birth.genome for birth in run.individuals(list(orders.picks))}
        names = [island.name for island in recipe.islands] or [None]
        weights = {
            name: _weights(run, name, local.operators, orders, generation)
            for name, local in zip(names, recipe.local, strict=True)
        }
        guidance = Guidance(picks_of(orders, genomes, recipe), weights)
        return cls(run, generation, orders, guidance)

    def population(
        self, prepared: Prepared, event: Tell = lambda name, **details: None
    ) -> Archipelago:
        """Return the population at that time; ``event`` is called with later events."""
        population = Archipelago(prepared, self.orders.weights, event)
        population.begin_with(births_without_genomes(self.run, 0))
        if self.generation:
            population.restore(living_of(self.run, self.generation - 1))
        return population

    def births(self, last: int | None = None) -> list[Birth]:
        """Return the births of the generation with their genomes, by id, up to the ``last``."""
        size = self.run.header.population
        end = (self.generation + 1) * size if last is None else last + 1
        return self.run.individuals(list(range(self.generation * size, end)))


def _weights(
    run: RunLog, island: str | None, names: Collection[str], orders: StandingOrders, generation: int
) -> dict[str, float]:
    """The weights that commands or credit set in place of the recipe's."""
    for event in reversed(run.events()):  # a generation that was stopped has two
        if event.get("event") == "weights" and event.get("generation") == generation:
            return event["weights"] if island is None else event["weights"][island]
    return {name: weight for name, weight in orders.weights.items() if name in names}
