"""How one birth of a run came about: its plan, drawn again from what the log tells."""

from collections.abc import Mapping

from evocity.errors import RunError
from evocity.genome import Genome
from evocity.search.archipelago import Archipelago
from evocity.search.breeding import NO_PICKS, Picks, Plan
from evocity.search.commands import Standing
from evocity.search.judging import births_without_genomes
from evocity.search.preparation import Prepared
from evocity.search.resuming import living_of, standing_of
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
    if generation == 0:
        island = Archipelago(prepared).island_of(slot)
        return island.plans(0, NO_PICKS, {})[slot - island.slots.start]
    if recipe.search.breeds_by is not None:
        raise RunError(
            f"individual {identifier} of {run.path}, whose algorithm "
            f"({recipe.search.algorithm}) breeds by itself",
            "a run whose births are bred by the recipe's operators",
            "the parameters of its operator stand in `made` of its genome",
        )
    standing = standing_of(run, generation)
    population = Archipelago(prepared, standing.weights)
    population.begin_with(births_without_genomes(run, 0))
    population.restore(living_of(run, generation - 1))
    picked = {birth.id: birth.genome for birth in run.individuals(list(standing.picks))}
    picks = _picks(standing, picked, recipe.search.picks)
    island = population.island_of(slot)
    weights = _weights(run, recipe.operators, standing, generation)
    return island.plans(generation, picks, weights)[slot - island.slots.start]


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
