"""`Archipelago`: all who live in a search, on one island or on several."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from evocity.search.breeding import Picks, Plan
from evocity.search.individual import Individual
from evocity.search.island import Island
from evocity.search.preparation import Prepared
from evocity.store import Birth, Member

#: Told of an event, and its details.
Tell = Callable[..., None]


class Archipelago:
    """The islands of a search by what was ``prepared``; most have one.

    ``weights`` are those that commands have set, of operators and of measures in sums; ``event`` is
    told what happens.
    """

    def __init__(
        self,
        prepared: Prepared,
        weights: Mapping[str, float] | None = None,
        event: Tell = lambda name, **details: None,
    ):
        self._prepared, self._event = prepared, event
        recipe, aims = prepared.recipe, prepared.aims.reweighted(weights or {})
        self.islands = [Island(prepared, recipe, aims, range(prepared.header.population))]

    # -- births --------------------------------------------------------------------------------

    def weights(self, generation: int, asked: Mapping[str, float]) -> list[dict[str, float]]:
        """Of each island the weights of operators in a ``generation`` that are not the recipe's,
        with those that were ``asked`` for. What credit makes of them is told as an event."""
        first, windowed = self.islands[0], self._prepared.recipe.search.window is not None
        if (generation == 0 and not windowed) or first.breeds_by is not None:
            return [{} for _ in self.islands]
        found = [island.weights(asked) for island in self.islands]
        if first.credit is not None:
            self._event("weights", generation=generation, weights=found[0])
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
        algorithms select. ``looks``: by id, how maps look, as far as it is known."""
        self.islands[0].select(births, generation, looks)

    def let_in(self, birth: Birth, looks: Mapping[int, np.ndarray] | None = None) -> None:
        """One birth, see `Island.let_in`."""
        self.islands[0].let_in(birth, looks or {})

    def learn(self, births: Sequence[Birth]) -> None:
        """Take in what operators have earned by ``births`` that were let in one by one."""
        self.islands[0].learn(births)

    def begin_with(self, births: Sequence[Birth]) -> None:
        """Tell all of the first generation's ``births``, see `Population.begin_with`."""
        self.islands[0].population.begin_with(births)

    def relive(self, births: Sequence[Birth], generation: int) -> None:
        """Go through a ``generation`` once more, for algorithms that need it."""
        self.islands[0].relive(births, generation)

    def restore(self, living: Mapping[str | None, Sequence[Birth]]) -> None:
        """Put back those who lived in a generation of the log, by the island."""
        for island in self.islands:
            island.population.restore(living.get(island.name, ()))

    def reweigh(self, weights: Mapping[str, float]) -> None:
        """Judge all anew by the ``weights`` of measures that commands have set."""
        self.islands[0].reweigh(self._prepared.aims.reweighted(weights))

    # -- what is told of them ------------------------------------------------------------------

    @property
    def living(self) -> list[Individual]:
        """Everybody who lives."""
        return self.islands[0].population.living

    @property
    def members(self) -> list[Member]:
        return self.islands[0].population.members

    @property
    def hypervolume(self) -> float:
        """Of those that break no constraint, see `Population.hypervolume`."""
        return self.islands[0].population.hypervolume

    @property
    def best(self) -> dict[str, float]:
        """See `Population.best`."""
        return self.islands[0].population.best

    @property
    def summary(self) -> dict[str, float]:
        """What the algorithm tells of all the living, see `Population.summary`."""
        return self.islands[0].population.summary


__all__ = ["Archipelago"]
