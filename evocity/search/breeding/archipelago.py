"""`Archipelago`: the populations of a search, on one island or on several."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from evocity.fitness import Aims
from evocity.search.breeding.birth_plans import BirthPlan, Guidance, migration_generator
from evocity.search.breeding.island import Island
from evocity.search.preparation.preparation import Prepared
from evocity.selection.fronts import Hypervolume
from evocity.selection.individual import Individual
from evocity.selection.population import best_of, volume_of
from evocity.store import Birth, Member

#: Takes the name of an event and its details.
Tell = Callable[..., None]


class Archipelago:
    """The islands of a search; most searches have one, without a name. Commands have set the
    ``weights`` of operators and of measures in sums. ``event`` is called with events."""

    def __init__(
        self,
        prepared: Prepared,
        weights: Mapping[str, float] | None = None,
        event: Tell = lambda name, **details: None,
    ):
        self._prepared, self.event = prepared, event
        recipe = prepared.recipe
        self._aims = prepared.aims.reweighted(weights or {})
        names = [island.name for island in recipe.islands] or [None]
        self.islands = [
            Island(prepared, local, aims, slots, number, name)
            for number, (local, aims, slots, name) in enumerate(
                zip(recipe.local, self._aims_of_islands(weights), recipe.slots, names, strict=True)
            )
        ]
        self._first: list[Mapping[str, float]] = []

    @property
    def several(self) -> bool:
        """Whether the islands have names."""
        return self.islands[0].name is not None

    @property
    def single(self) -> Island:
        """The island of a search that has one."""
        return self.islands[0]

    def _aims_of_islands(self, weights: Mapping[str, float] | None) -> list[Aims]:
        aims, islands = self._prepared.aims, self._prepared.recipe.islands
        local = [island.aims_of(aims) for island in islands] or [aims]
        return [one.reweighted(weights or {}) for one in local]

    # -- births --------------------------------------------------------------------------------

    def weights(
        self, generation: int, ordered: Mapping[str, float]
    ) -> dict[str | None, dict[str, float]]:
        """Return, by island, the operator weights of a ``generation`` that replace the recipe's,
        with those ``ordered`` by commands. Weights that credit changed are logged as an event."""
        first, windowed = self.islands[0], self._prepared.recipe.search.window is not None
        if (generation == 0 and not windowed) or first.breeds_by is not None:
            return {}
        weights = {island.name: island.weights(ordered) for island in self.islands}
        if first.credit is not None:
            logged = weights if self.several else weights[None]
            self.event("weights", generation=generation, weights=logged)
        return weights

    def plans(self, generation: int, guidance: Guidance, refined: bool = True) -> list[BirthPlan]:
        """Plan the births of a ``generation``, by slots, see `Island.plans`."""
        return [
            plan for island in self.islands for plan in island.plans(generation, guidance, refined)
        ]

    def island_of(self, slot: int) -> Island:
        """Return the island whose births have the ``slot``."""
        return next(island for island in self.islands if slot in island.slots)

    # -- who lives -----------------------------------------------------------------------------

    def select(
        self,
        births: Sequence[Birth],
        generation: int,
        looks: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """Select who lives on, on each island, of the living and the ``births`` of a
        ``generation``; then let some migrate if it is time. ``looks``: id -> thumbprint of a map.
        """
        self._keep_first(births)
        for island in self.islands:
            island.select(self._candidates(island, births), generation, looks)
        self._migrate(generation)

    def begin_with(self, births: Sequence[Birth]) -> None:
        """Pass on all ``births`` of the first generation, see `Population.begin_with`."""
        self._keep_first(births)
        for island in self.islands:
            island.population.begin_with(self._candidates(island, births))

    def restore(self, living: Mapping[str | None, Sequence[Birth]]) -> None:
        """Replace the living by those of a logged generation, island -> births."""
        for island in self.islands:
            island.population.restore(living.get(island.name, ()))

    def reweigh(self, weights: Mapping[str, float]) -> None:
        """Judge all individuals by the ``weights`` of measures that commands have set."""
        self._aims = self._prepared.aims.reweighted(weights)
        for island, aims in zip(self.islands, self._aims_of_islands(weights), strict=True):
            island.reweigh(aims)

    def _keep_first(self, births: Sequence[Birth]) -> None:
        if not self._first:
            complete = self._aims.complete
            self._first = [dict(b.values) for b in births if b.ok and complete(b.values)]

    def _candidates(self, island: Island, births: Sequence[Birth]) -> list[Birth]:
        """The ``births`` that may live on an ``island``: its own, and the sources."""
        return [one for one in births if island.name == one.island or one.operator == "source"]

    def _migrate(self, generation: int) -> None:
        recipe, islands = self._prepared.recipe, self.islands
        migration, pairs = recipe.migration, recipe.migration.neighbours(len(islands))
        if not pairs or generation == 0 or generation % migration.every:
            return
        rng = migration_generator(recipe, generation, len(islands))
        moves = []
        for giver, taker in ((islands[giver], islands[taker]) for giver, taker in pairs):
            moves.append((giver, taker, giver.migrants(taker, migration.migrants, rng)))
        for island in islands:
            arriving = [one for _, taker, sent in moves if taker is island for one in sent]
            rng = migration_generator(recipe, generation, island.number)
            island.population.admit(arriving, rng)
        logged = []
        for giver, taker, sent in moves:
            lives = {one.id for one in taker.population.living}
            ids = [one.id for one in sent]
            stayed = [identifier for identifier in ids if identifier in lives]
            logged.append({"from": giver.name, "to": taker.name, "ids": ids, "stayed": stayed})
        self.event("migration", generation=generation, moves=logged)

    # -- summaries -----------------------------------------------------------------------------

    @property
    def alive(self) -> bool:
        """Whether every island has individuals to breed from."""
        return all(island.population.living for island in self.islands)

    @property
    def living(self) -> list[Individual]:
        """All who live, each once, island by island."""
        together = [one for island in self.islands for one in island.population.living]
        return list({one.id: one for one in reversed(together)}.values())[::-1]

    @property
    def members(self) -> list[Member]:
        """All who live, as the log has them."""
        return [
            replace(member, island=island.name)
            for island in self.islands
            for member in island.population.members
        ]

    @property
    def hypervolume(self) -> float:
        """The hypervolume of all feasible individuals by all goals, see
        `Population.hypervolume`."""
        if not self.several:
            return self.islands[0].population.hypervolume
        first = [self._aims.losses(values) for values in self._first]
        volume = Hypervolume(np.array(first)) if first else None
        living = [replace(one, losses=self._aims.losses(one.values)) for one in self.living]
        return volume_of(living, volume)

    @property
    def best(self) -> dict[str, float]:
        """The best values by all goals, see `Population.best`."""
        return best_of(self.living, self._aims)

    @property
    def summary(self) -> dict[str, float]:
        """The report of the algorithm, see `Population.summary`; `summaries` has it for islands."""
        return {} if self.several else self.islands[0].population.summary

    @property
    def summaries(self) -> dict[str, dict]:
        """Figures of each of several islands by its name: the counts of ``living`` and
        ``feasible``, ``hypervolume`` and ``best`` by its own goals, and those of its ``algorithm``.
        """
        return {island.name: _summary(island) for island in self.islands} if self.several else {}


def _summary(island: Island) -> dict:
    population = island.population
    volume = population.hypervolume
    return {
        "living": len(population.living),
        "feasible": sum(not one.violation for one in population.living),
        "hypervolume": volume if math.isfinite(volume) else None,  # JSON has no infinity
        "best": population.best,
        "algorithm": population.summary,
    }
