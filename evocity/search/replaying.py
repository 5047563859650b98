"""How births of a run came about: their plans, drawn again from what the log tells."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby, islice

from evocity.errors import RunError
from evocity.genome import Genome
from evocity.search.archipelago import Archipelago, Tell
from evocity.search.breeding import NO_PICKS, Picks, Plan, selecting
from evocity.search.commands import Standing
from evocity.search.judging import births_without_genomes, every_generation
from evocity.search.preparation import Prepared
from evocity.search.resuming import living_of, standing_of
from evocity.store import Birth, Run


def plan_of(run: Run, prepared: Prepared, identifier: int) -> Plan:
    """The plan of the birth ``identifier`` of a ``run``: its operator, with the parameters drawn
    for it, its parents, and its generator, as it was before it was bred.

    ``prepared`` is of `evocity.search.rereading.read_again`. Raises `RunError` where the algorithm
    breeds by itself, from what it has learnt: what the operator was told stands in ``made``; and
    where the log tells of another operator or other parents, as of a run of another release.
    """
    recipe = prepared.recipe
    if recipe.search.breeds_by is not None and identifier >= recipe.run.population:
        raise RunError(
            f"individual {identifier} of {run.path}, whose algorithm "
            f"({recipe.search.algorithm}) breeds by itself",
            "a run whose births are bred by the recipe's operators",
            "the parameters of its operator stand in `made` of its genome",
        )
    (plan,) = plans_of(run, prepared, [identifier])
    (birth,) = run.individuals([identifier])
    if (plan.name, tuple(plan.parents)) != (birth.operator, tuple(birth.parents)):
        raise RunError(
            f"{run.path}: individual {identifier}, bred by {birth.operator} from "
            f"{list(birth.parents)}, is drawn again by {plan.name} from {list(plan.parents)}",
            "a run of this release whose births were all bred by the search",
            "choose another individual",
        )
    return plan


def plans_of(run: Run, prepared: Prepared, ids: Iterable[int]) -> Iterator[Plan]:
    """The plans of the births ``ids`` of a ``run``, each once and by id, whatever the log tells of
    their operators and parents. ``prepared``: as of `plan_of`."""
    recipe, ids = prepared.recipe, sorted(set(ids))
    size = recipe.run.population
    generations = groupby(ids, lambda one: one // size)
    if recipe.search.breeds_by is not None:
        yield from _learnt(run, prepared, {g: list(group) for g, group in generations})
        return
    for generation, group in generations:
        if generation and recipe.search.window is not None:
            yield from _windowed(run, prepared, list(group))
        else:
            yield from _of_generation(run, prepared, generation, group)


def _of_generation(
    run: Run, prepared: Prepared, generation: int, ids: Iterable[int]
) -> Iterator[Plan]:
    """Plans of one generation, of those who lived when it began."""
    size = prepared.recipe.run.population
    then = Then.of(run, prepared, generation) if generation else None
    population = Archipelago(prepared) if then is None else then.population(prepared)
    for island, own in groupby(ids, lambda one: population.island_of(one % size)):
        if then is None:
            plans = island.plans(0, NO_PICKS, {})
        else:
            weights = _weights(run, island.name, island.mixture, then.standing, generation)
            plans = island.plans(generation, then.picks, weights)
        yield from (plans[one % size - island.slots.start] for one in own)


def _windowed(run: Run, prepared: Prepared, ids: Sequence[int]) -> Iterator[Plan]:
    """Plans of births after generation 0 in a window: each of those who lived once the one that it
    waits for was in."""
    size, window = prepared.recipe.run.population, prepared.recipe.search.window
    for generation, own in groupby(ids, lambda one: max(-1, (one - window) // size)):
        if generation < 0:
            yield from map(Archipelago(prepared).founder, own)
            continue
        wanted, then = set(own), Then.of(run, prepared, generation)
        population = then.population(prepared)
        for birth in then.births(max(wanted) - window):
            population.let_in(birth)
            if birth.id + window in wanted:
                yield population.plan(birth.id + window, then.picks, [then.weights])


def _learnt(run: Run, prepared: Prepared, wanted: Mapping[int, Sequence[int]]) -> Iterator[Plan]:
    """Plans of an algorithm that breeds by itself, ``wanted`` by the generation: it learns from all
    births before once more."""
    recipe, weights = prepared.recipe, {}
    population, first = Archipelago(prepared), births_without_genomes(run, 0)
    population.begin_with(first)
    (island,) = population.islands
    past = islice(every_generation(run), max(wanted, default=-1) + 1)
    for generation, births in enumerate(past):
        standing = standing_of(run, generation)
        if standing.weights != weights:
            weights = standing.weights
            population.reweigh(weights)
        plans = island.plans(generation, NO_PICKS, {})
        yield from (plans[one % recipe.run.population] for one in wanted.get(generation, ()))
        island.population.select(births, selecting(recipe, generation))


@dataclass(frozen=True)
class Then:
    """A ``run`` as its log tells that it was when a ``generation`` began: what was ``standing`` of
    commands, who was picked, and the ``weights`` of operators that were not the recipe's, where
    there is one island."""

    run: Run
    generation: int
    standing: Standing
    picks: Picks
    weights: Mapping[str, float]

    @classmethod
    def of(cls, run: Run, prepared: Prepared, generation: int) -> "Then":
        recipe, standing = prepared.recipe, standing_of(run, generation)
        picked = {birth.id: birth.genome for birth in run.individuals(list(standing.picks))}
        picks = _picks(standing, picked, recipe.search.picks)
        weights = (
            {} if recipe.islands else _weights(run, None, recipe.operators, standing, generation)
        )
        return cls(run, generation, standing, picks, weights)

    def population(
        self, prepared: Prepared, event: Tell = lambda name, **details: None
    ) -> Archipelago:
        """Who lived then; ``event`` is told what happens from now on."""
        population = Archipelago(prepared, self.standing.weights, event)
        population.begin_with(births_without_genomes(self.run, 0))
        if self.generation:
            population.restore(living_of(self.run, self.generation - 1))
        return population

    def births(self, last: int | None = None) -> list[Birth]:
        """Those of the generation with their genomes, by id, up to the ``last``."""
        size = self.run.header.population
        end = (self.generation + 1) * size if last is None else last + 1
        return self.run.individuals(list(range(self.generation * size, end)))


def _picks(standing: Standing, picked: Mapping[int, Genome], share: float) -> Picks:
    return Picks(tuple((one, picked[one]) for one in standing.picks), standing.share or share)


def _weights(
    run: Run, island: str | None, names: Collection[str], standing: Standing, generation: int
) -> dict[str, float]:
    """Weights of an ``island``'s operators, of these ``names``, other than the recipe's: those of
    commands, or what credit made of them."""
    for event in reversed(run.events()):  # one that was stopped before it was bred tells twice
        if event.get("event") == "weights" and event.get("generation") == generation:
            return event["weights"] if island is None else event["weights"][island]
    return {name: weight for name, weight in standing.weights.items() if name in names}


__all__ = ["Then", "plan_of", "plans_of"]
