"""`Archipelago`: all who live in a search, on one island or on several."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from evocity.fitness import Aims
from evocity.search.breeding import Picks, Plan, migrating
from evocity.search.fronts import Hypervolume
from evocity.search.individual import Individual
from evocity.search.island import Island
from evocity.search.population import best_of, volume_of
from evocity.search.preparation import Prepared
from evocity.store import Birth, Member

#: Told of an event, and its details.
Tell = Callable[..., None]


class Archipelago:
    """The islands of a search by what was ``prepared``; of most searches one, without a name.

    ``weights`` are those that commands have set, of operators and of measures in sums; ``event`` is
    told what happens.
    """

    def __init__(
        self,
        prepared: Prepared,
        weights: Mapping[str, float] | None = None,
        event: Tell = lambda name, **details: None,
    ):
        self._prepared, self.event = prepared, event
        recipe = prepared.recipe
        self._aims = prepared.aims.reweighted(weights or {})
        names = [one.name for one in recipe.islands] or [None]
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

    def _aims_of_islands(self, weights: Mapping[str, float] | None) -> list[Aims]:
        aims, islands = self._prepared.aims, self._prepared.recipe.islands
        own = [island.aims_of(aims) for island in islands] or [aims]
        return [one.reweighted(weights or {}) for one in own]

    # -- births --------------------------------------------------------------------------------

    def weights(self, generation: int, asked: Mapping[str, float]) -> list[dict[str, float]]:
        """Of each island the weights of operators in a ``generation`` that are not the recipe's,
        with those that were ``asked`` for. What credit makes of them is told as an event."""
        first, windowed = self.islands[0], self._prepared.recipe.search.window is not None
        if (generation == 0 and not windowed) or first.breeds_by is not None:
            return [{} for _ in self.islands]
        found = [island.weights(asked) for island in self.islands]
        if first.credit is not None:
            named = dict(zip((island.name for island in self.islands), found, strict=True))
            self.event(
                "weights", generation=generation, weights=named if self.several else found[0]
            )
        return found

    def plans(
        self,
        generation: int,
        picks: Picks,
        weights: Sequence[Mapping[str, float]],
        refined: bool = True,
    ) -> list[Plan]:
        """The births of a ``generation``, by slots, see `Island.plans`."""
        return [
            plan
            for island, own in zip(self.islands, weights, strict=True)
            for plan in island.plans(generation, picks, own, refined)
        ]

    def plan(self, identifier: int, picks: Picks, weights: Sequence[Mapping[str, float]]) -> Plan:
        """One birth, see `Island.plan`."""
        return self.islands[0].plan(identifier, picks, weights[0])

    def founder(self, identifier: int) -> Plan:
        """One birth of the sources, see `Island.founder`."""
        return self.islands[0].founder(identifier)

    def island_of(self, slot: int) -> Island:
        """Whose birth the one in a ``slot`` is."""
        return next(island for island in self.islands if slot in island.slots)

    # -- who lives -----------------------------------------------------------------------------

    def select(
        self,
        births: Sequence[Birth],
        generation: int,
        looks: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """Those of the living and of the ``births`` of a ``generation`` live on that the islands'
        algorithms select; then some migrate, if it is time. ``looks``: by id, how maps look, as far
        as it is known."""
        self._count_from(births)
        for island in self.islands:
            island.select(self._landing(island, births), generation, looks)
        self._migrate(generation)

    def let_in(self, birth: Birth, looks: Mapping[int, np.ndarray] | None = None) -> None:
        """One birth, see `Island.let_in`."""
        self.islands[0].let_in(birth, looks or {})

    def learn(self, births: Sequence[Birth]) -> None:
        """Take in what operators have earned by ``births`` that were let in one by one."""
        self.islands[0].learn(births)

    def begin_with(self, births: Sequence[Birth]) -> None:
        """Tell all of the first generation's ``births``, see `Population.begin_with`."""
        self._count_from(births)
        for island in self.islands:
            island.population.begin_with(self._landing(island, births))

    def relive(self, births: Sequence[Birth], generation: int) -> None:
        """Go through a ``generation`` once more, for an algorithm that needs it; it is the only
        one."""
        self.islands[0].relive(births, generation)

    def restore(self, living: Mapping[str | None, Sequence[Birth]]) -> None:
        """Put back those who lived in a generation of the log, by the island."""
        for island in self.islands:
            island.population.restore(living.get(island.name, ()))

    def reweigh(self, weights: Mapping[str, float]) -> None:
        """Judge all anew by the ``weights`` of measures that commands have set."""
        self._aims = self._prepared.aims.reweighted(weights)
        for island, aims in zip(self.islands, self._aims_of_islands(weights), strict=True):
            island.reweigh(aims)

    def _count_from(self, births: Sequence[Birth]) -> None:
        """The first ``births`` are what all are compared with."""
        if not self._first:
            self._first = [dict(born.values) for born in births if born.ok]

    def _landing(self, island: Island, births: Sequence[Birth]) -> list[Birth]:
        """Those of the ``births`` that may live on an ``island``: its own, and the sources."""
        return [one for one in births if island.name == one.island or one.operator == "source"]

    def _migrate(self, generation: int) -> None:
        recipe = self._prepared.recipe
        asked, pairs = recipe.migration, recipe.migration.neighbours(len(self.islands))
        if not pairs or generation == 0 or generation % asked.every:
            return
        rng = migrating(recipe, generation, len(self.islands))
        moves = [
            (self.islands[giver], self.islands[taker], sent)
            for giver, taker in pairs
            for sent in [self.islands[giver].migrants(self.islands[taker], asked.migrants, rng)]
        ]
        for island in self.islands:
            arriving = [one for _, taker, sent in moves if taker is island for one in sent]
            island.population.admit(arriving, migrating(recipe, generation, island.number))
        told = []
        for giver, taker, sent in moves:
            lives = {one.id for one in taker.population.living}
            ids = [one.id for one in sent]
            stayed = [one for one in ids if one in lives]
            told.append({"from": giver.name, "to": taker.name, "ids": ids, "stayed": stayed})
        self.event("migration", generation=generation, moves=told)

    # -- what is told of them ------------------------------------------------------------------

    @property
    def alive(self) -> bool:
        """Whether there is somebody to breed from on every island."""
        return all(island.population.living for island in self.islands)

    @property
    def living(self) -> list[Individual]:
        """Everybody who lives, once, island by island."""
        if not self.several:
            return self.islands[0].population.living
        together = [one for island in self.islands for one in island.population.living]
        return list({one.id: one for one in reversed(together)}.values())[::-1]

    @property
    def members(self) -> list[Member]:
        if not self.several:
            return self.islands[0].population.members
        return [
            replace(member, island=island.name)
            for island in self.islands
            for member in island.population.members
        ]

    @property
    def hypervolume(self) -> float:
        """Of all the living that break no constraint, by all goals, see
        `Population.hypervolume`."""
        if not self.several:
            return self.islands[0].population.hypervolume
        first = [self._aims.losses(values) for values in self._first]
        volume = Hypervolume(np.array(first)) if first else None
        return volume_of([self._by_all_goals(one) for one in self.living], volume)

    @property
    def best(self) -> dict[str, float]:
        """By all goals, see `Population.best`."""
        return best_of(self.living, self._aims)

    @property
    def summary(self) -> dict[str, float]:
        """What the algorithm tells of all the living, see `Population.summary`; of several islands
        `summaries` tell it."""
        return {} if self.several else self.islands[0].population.summary

    @property
    def summaries(self) -> dict[str, dict]:
        """What is told of each of several islands, by its name: how many are ``living``, and keep
        the constraints (``feasible``); their ``hypervolume`` and ``best`` by the island's own
        goals; and what its ``algorithm`` tells of them."""
        return {island.name: _summary(island) for island in self.islands} if self.several else {}

    def _by_all_goals(self, one: Individual) -> Individual:
        return replace(one, losses=self._aims.losses(one.values))


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


__all__ = ["Archipelago"]
