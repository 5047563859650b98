"""One goal, or several as one sum: the best live."""

import numpy as np

from evocity.search.algorithms.algorithm import Order, Ranked
from evocity.search.fronts import ranks_of
from evocity.search.values import Section


class Single(Ranked):
    """The best of the living and the newly born live on, by one loss. The best is never lost.

    Several measures are one goal where a recipe sums them, by ``objective = "a name"``.
    """

    name = "single"

    @classmethod
    def faults(
        cls, keys: Section, goals: int, population: int, parents: int = 2
    ) -> list[tuple[str, str, str]]:
        if goals == 1:
            return []
        allowed = 'one; measures that have the same objective = "a name" are summed to one'
        return [("search.algorithm", f"{cls.name!r} with {goals} goals", allowed)]

    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        ranks = ranks_of(losses, violations)
        return Order(np.argsort(ranks, kind="stable"), ranks, np.zeros(len(ranks)))
