"""Who is bred from whom, by which operator: one plan a birth, drawn from its own generator."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from evocity.genome import Genome
from evocity.search.algorithms import Algorithm
from evocity.search.individual import Individual
from evocity.search.recipe import Recipe
from evocity.store import Again


@dataclass(frozen=True)
class Plan:
    """How one individual comes about. Without an operator it is the one ``parents`` genome.
    ``island``: on which it is born, where there are several; ``again``: how it comes about once
    more, where the log may leave its genome out."""

    id: int
    operator: object | None
    parents: tuple[int, ...]
    genomes: tuple[Genome, ...] = field(repr=False)
    rng: np.random.Generator = field(repr=False)
    island: str | None = None
    again: Again | None = field(default=None, repr=False)

    @property
    def name(self) -> str:
        return "source" if self.operator is None else self.operator.name

    @property
    def made(self) -> dict:
        """What is known of its making without a child: the operator, and what was drawn for it."""
        drawn = getattr(self.operator, "drawn", None)
        return {"operator": self.name} | ({"drawn": dict(drawn)} if drawn else {})


@dataclass(frozen=True)
class Picks:
    """Individuals that are bred from besides those that the algorithm chooses: (id, genome) each.
    Of the births the ``share`` has one of them for its first parent."""

    individuals: tuple[tuple[int, Genome], ...] = field(default=(), repr=False)
    share: float = 0.5

    def among(
        self, parents: list[tuple[int, Genome]], rng: np.random.Generator
    ) -> list[tuple[int, Genome]]:
        """The ``parents`` of one birth, the first of them a pick in the ``share`` of cases."""
        if not self.individuals or rng.random() >= self.share:
            return parents
        chosen = self.individuals[rng.integers(len(self.individuals))]
        if any(one == chosen[0] for one, _ in parents):  # it comes first, and once
            return [chosen, *(parent for parent in parents if parent[0] != chosen[0])]
        return [chosen, *parents[1:]]


NO_PICKS = Picks()


def generator(seed: int, generation: int, slot: int) -> np.random.Generator:
    """The generator of one birth: nothing else draws from it, so workers cannot matter."""
    sequence = np.random.SeedSequence(seed, spawn_key=(generation, slot))
    return np.random.Generator(np.random.PCG64(sequence))


def selecting(recipe: Recipe, generation: int, island: int = 0) -> np.random.Generator:
    """The generator of a generation's selection on an island: its slot is no birth's."""
    return generator(recipe.run.seed, generation, recipe.run.population + 2 * island)


def letting_in(recipe: Recipe, identifier: int) -> np.random.Generator:
    """The generator of the selection that one birth alone causes: its key has three numbers, where
    those of all others have two."""
    key = *divmod(identifier, recipe.run.population), 0
    sequence = np.random.SeedSequence(recipe.run.seed, spawn_key=key)
    return np.random.Generator(np.random.PCG64(sequence))


def migrating(recipe: Recipe, generation: int, island: int) -> np.random.Generator:
    """The generator of what an island lets in of a generation; of one more than there are, of who
    migrates. Its slot is no birth's, and no selection's."""
    return generator(recipe.run.seed, generation, recipe.run.population + 2 * island + 1)


def first_population(
    recipe: Recipe, sources: Sequence[Genome], slots: range | None = None
) -> list[Plan]:
    """Generation 0: the sources themselves, then their fusions and mutants.

    Of three births after the sources two are fusions, of each ordered pair of sources in turn and
    with a fill drawn from 0.1…0.9, or from the recipe's own range, and one is a mutant of a source.
    A single source has mutants alone. Fusions are quarter fusions where the recipe has them, else
    pavement fusions; mutants are by quarter refill, else by mutation. ``slots``: those that are
    bred, all unless they are told.
    """
    slots = range(recipe.run.population) if slots is None else slots
    return [founder(recipe, sources, slot) for slot in slots]


def founder(
    recipe: Recipe,
    sources: Sequence[Genome],
    slot: int,
    rng: np.random.Generator | None = None,
) -> Plan:
    """The birth in one ``slot`` of generation 0, see `first_population`; 0 or more. ``rng``: the
    generator of one that is born later."""
    count = len(sources)
    rng = generator(recipe.run.seed, 0, slot) if rng is None else rng
    if slot < count:
        return Plan(slot, None, (), (sources[slot],), rng)
    weighty = {name for name, entry in recipe.operators.items() if entry.weight > 0}
    crossing, changing = (
        next((name for name in names if name in weighty), names[-1]) for names in recipe.kind.first
    )
    pairs = [(i, j) for i in range(count) for j in range(count) if i != j]
    turn = slot - count
    if pairs and turn % 3 < 2:
        changes = {}
        if recipe.takes(crossing, "fill") and not recipe.ranged(crossing, "fill"):
            changes["fill"] = round(float(rng.uniform(0.1, 0.9)), 3)
        if recipe.parameters(crossing).get("void"):
            changes["void"] = False
        operator = recipe.operator_drawn(crossing, rng, **changes)
        parents = pairs[(turn // 3 * 2 + turn % 3) % len(pairs)]
    else:
        operator = recipe.operator_drawn(changing, rng)
        lone = (turn // 3 if pairs else turn) % count
        parents = (lone, *founders_of(operator, count))
    return Plan(slot, operator, parents, tuple(sources[i] for i in parents), rng)


def own_population(
    recipe: Recipe, algorithm: Algorithm, generation: int, sources: Sequence[Genome]
) -> list[Plan]:
    """A generation of an algorithm that breeds by itself: the births of its own operator, of all
    the ``sources``; in generation 0 these come first, in place of so many of them."""
    first = generation * recipe.run.population
    rng = generator(recipe.run.seed, generation, recipe.run.population + 1)
    plans = []
    for slot, settings in enumerate(algorithm.settings(first, len(sources), rng)):
        founder = generation == 0 and slot < len(sources)
        plans.append(
            Plan(
                first + slot,
                None if founder else recipe.operator(algorithm.breeds_by, **settings),
                () if founder else tuple(range(len(sources))),
                (sources[slot],) if founder else tuple(sources),
                generator(recipe.run.seed, generation, slot),
            )
        )
    return plans


def founders_of(operator, count: int) -> range:
    """The births, of the ``count`` sources, that an ``operator`` has as further parents."""
    return range(count if getattr(operator, "takes_founders", False) else 0)


def next_population(
    recipe: Recipe,
    algorithm: Algorithm,
    generation: int,
    living: Sequence[Individual],
    sources: Sequence[Genome],
    picks: Picks = NO_PICKS,
    weights: Mapping[str, float] | None = None,
    slots: range | None = None,
) -> list[Plan]:
    """The children of one generation: operator by weight, parents by the algorithm, then the
    operator's parameters that the recipe gives ranges of; the ``sources`` are further parents of
    operators that take from anywhere. ``picks``: who is bred from besides; ``weights``: those of
    operators that are other than the recipe's, by name; ``slots``: those that are bred, all unless
    they are told."""
    mixture = {name: entry.weight for name, entry in recipe.operators.items()} | (weights or {})
    names = [name for name, weight in mixture.items() if weight > 0]
    chances = np.array([mixture[name] for name in names])
    counts = {
        name: recipe.operators[name].parents or recipe.operator(name).parents[0] for name in names
    }
    drawing = cache(recipe.drawing)
    # what numpy's choice does with these chances, without their checks at every birth
    reached = (chances / chances.sum()).cumsum()
    reached /= reached[-1]
    plans = []
    for slot in range(recipe.run.population) if slots is None else slots:
        rng = generator(recipe.run.seed, generation, slot)
        name = names[reached.searchsorted(rng.random(), side="right")]
        count = counts[name]
        chosen = [(living[i].id, living[i].genome) for i in algorithm.parents(living, count, rng)]
        chosen = picks.among(chosen, rng)
        operator = drawing(name)(rng)
        founders = founders_of(operator, len(sources))
        plans.append(
            Plan(
                generation * recipe.run.population + slot,
                operator,
                (*(one for one, _ in chosen), *founders),
                (*(genome for _, genome in chosen), *(sources[i] for i in founders)),
                rng,
            )
        )
    return plans
