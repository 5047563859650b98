"""NSGA-II (Deb et al. 2002): by front, then by crowding distance."""

import numpy as np

from evocity.selection.algorithms.algorithm import Order, Ranked
from evocity.selection.fronts import crowding_of, ranks_of


class Nsga2(Ranked):
    """Fronts by constrained domination; within a front those live that are far from the others.

    With ``distinct = 0`` it is the algorithm of Deb et al. 2002.
    """

    name = "nsga2"
    marks = ("crowding",)

    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        ranks = ranks_of(losses, violations)
        crowding = crowding_of(losses, ranks)
        return Order(np.lexsort((-crowding, ranks)), ranks, crowding)
