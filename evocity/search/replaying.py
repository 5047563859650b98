"""How one birth of a run came about: its plan, drawn again from what the log tells."""

from collections.abc import Mapping

from evocity.errors import RunError
from evocity.genome import Genome
from evocity.search.breeding import Picks, Plan, first_population, next_population, own_population
from evocity.search.commands import Standing
from evocity.search.judging import births_without_genomes
from evocity.search.population import Population
from evocity.search.preparation import Prepared
from evocity.search.refinement.step import with_refinements
from evocity.search.resuming import standing_of
from evocity.store import Run


def plan_of(run: Run, prepared: Prepared, identifier: int) -> Plan:
    """The plan of the birth ``identifier`` of a ``run``: its operator, with the parameters drawn
    for it, its parents, and its generator, as it was before it was bred.

    ``prepared`` is of `evocity.search.rereading.read_again`. Raises `RunError` where the algorithm
    breeds by itself, from what it has learnt: what the operator was told stands in ``made``; and
    where the log tells of another operator or other parents, as of a run of another release.
    """
    plan = _drawn(run, prepared, identifier)
    (birth,) = run.individuals([identifier])
    if (plan.name, tuple(plan.parents)) != (birth.operator, tuple(birth.parents)):
        raise RunError(
            f"{run.path}: individual {identifier}, bred by {birth.operator} from "
            f"{list(birth.parents)}, is drawn again by {plan.name} from {list(plan.parents)}",
            "a run of this release whose births were all bred by the search",
            "choose another individual",
        )
    return plan


def _drawn(run: Run, prepared: Prepared, identifier: int) -> Plan:
    recipe = prepared.recipe
    generation, slot = divmod(identifier, recipe.run.population)
    sources = [source.genome for source in prepared.sources]
    algorithm = recipe.search.algorithm_of(prepared.header.population)
    if algorithm.breeds_by is not None:
        if generation == 0:
            return own_population(recipe, algorithm, 0, sources)[slot]
        raise RunError(
            f"individual {identifier} of {run.path}, whose algorithm "
            f"({recipe.search.algorithm}) breeds by itself",
            "a run whose births are bred by the recipe's operators",
            "the parameters of its operator stand in `made` of its genome",
        )
    if generation == 0:
        return first_population(recipe, sources)[slot]
    standing = standing_of(run, generation)
    aims = prepared.aims.reweighted(standing.weights)
    population = Population(algorithm, aims, prepared.header.chromosome, recipe.limits)
    population.begin_with(births_without_genomes(run, 0))
    lived = run.members(generation - 1).column("id").to_pylist()
    population.restore(run.individuals(lived))
    picked = {birth.id: birth.genome for birth in run.individuals(list(standing.picks))}
    picks = _picks(standing, picked, recipe.search.picks)
    weights = _weights(run, recipe.operators, standing, generation)
    plans = next_population(
        recipe, algorithm, generation, population.living, sources, picks, weights
    )
    return with_refinements(plans, recipe, generation, population, aims)[slot]


def _picks(standing: Standing, picked: Mapping[int, Genome], share: float) -> Picks:
    return Picks(tuple((one, picked[one]) for one in standing.picks), standing.share or share)


def _weights(run: Run, names, standing: Standing, generation: int) -> dict[str, float]:
    """Weights of operators other than the recipe's: those of commands, or what credit made of
    them."""
    for event in reversed(run.events()):  # one that was stopped before it was bred tells twice
        if event.get("event") == "weights" and event.get("generation") == generation:
            return event["weights"]
    return {name: weight for name, weight in standing.weights.items() if name in names}


__all__ = ["plan_of"]
