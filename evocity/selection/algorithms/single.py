"""Selection by one goal, or by one sum of several: the best live."""

import numpy as np

from evocity.section import Fault, Section
from evocity.selection.algorithms.algorithm import Order, Ranked, one_goal_faults
from evocity.selection.fronts import ranks_of


class Single(Ranked):
    """The best of the living and the newly born survive, by one loss. The best is never lost.

    Several measures are one goal if a recipe sums them, by ``objective = "a name"``.
    """

    name = "single"

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        return one_goal_faults(cls.name, goals)

    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        ranks = ranks_of(losses, violations)
        return Order(np.argsort(ranks, kind="stable"), ranks, np.zeros(len(ranks)))
