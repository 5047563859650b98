"""One generation after the other: all its births are planned at once, of those who live then."""

from collections.abc import Mapping, Sequence

from evocity.search.archipelago import Archipelago
from evocity.search.births import Born
from evocity.search.breeding import Picks, Plan
from evocity.search.evaluation import Engine
from evocity.search.preparation import Prepared
from evocity.search.rechecking import Rechecking
from evocity.store import Birth

#: Of each island the weights of operators that are not the recipe's, by name.
Weights = Sequence[Mapping[str, float]]


class Generational:
    """The births of a search whose ``population`` is replaced a generation at a time; they are bred
    and evaluated by the ``engine``."""

    def __init__(self, prepared: Prepared, population: Archipelago, engine: Engine):
        self._aims, self._population, self._engine = prepared.aims, population, engine
        self._rechecking = Rechecking(prepared, population.event)

    def births(self, generation: int, picks: Picks, weights: Weights) -> list[Birth]:
        """The births of a ``generation``, by id; those live on that are selected."""
        plans = self._population.plans(generation, picks, weights)
        return self.selected(self._rechecking.born(self._engine, plans), generation)

    def plans(self, generation: int, picks: Picks, weights: Weights) -> list[Plan]:
        """Those of a ``generation`` whose births are measured elsewhere: none is refined."""
        return self._population.plans(generation, picks, weights, refined=False)

    def selected(self, individuals: Sequence[Born], generation: int) -> list[Birth]:
        """The births of a ``generation``; of them and of the living those live on that are
        selected."""
        births = [one.birth(generation, self._aims) for one in individuals]
        looks = {one.plan.id: one.look for one in individuals if one.look is not None}
        self._population.select(births, generation, looks)
        return births

    def close(self) -> None:
        """Nothing is at work between two generations."""


__all__ = ["Generational", "Weights"]
