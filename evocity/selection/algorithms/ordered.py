"""Algorithms that order the living by one rule: hypervolume, NSGA-II, and a single goal.

- Hypervolume contribution: Beume, Naujoks & Emmerich 2007, SMS-EMOA, as (µ + λ)
- NSGA-II: Deb et al. 2002, by front, then by crowding distance
"""

import numpy as np

from evocity.section import Fault, Section
from evocity.selection.algorithms.algorithm import Order, Ranked, one_goal_faults
from evocity.selection.fronts import Scale, crowding_of, ranks_of

#: Number of losses -> the most individuals whose contributions are measured, which takes some
#: seconds a generation; larger populations use crowding distance.
MOST = {1: 100_000, 2: 4000, 3: 4000, 4: 800, 5: 200, 6: 120, 7: 50}


class HypervolumeContribution(Ranked):
    """Fronts by constrained domination. The front that does not fit loses the individual that adds
    least to the hypervolume, again and again.

    Losses are in units of the front's own ranges; the reference point lies a tenth beyond its
    worst. Where contributions cost too much (`MOST` individuals), crowding distance replaces them.
    """

    name = "hypervolume"
    marks = ("contribution",)

    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        from evocity.selection.backends import moocore

        ranks = ranks_of(losses, violations)
        if len(losses) > MOST.get(losses.shape[1], 0):
            crowding = crowding_of(losses, ranks)
            return Order(np.lexsort((-crowding, ranks)), ranks, crowding)
        worth, turns = np.zeros(len(losses)), np.zeros(len(losses))
        room = self.size
        for front in np.unique(ranks):
            where = np.flatnonzero(ranks == front)
            scale = Scale(losses[where])
            surplus = min(max(len(where) - max(room, 0), 0), len(where))
            dropped, worth[where] = moocore.least_first(
                scale(losses[where]), scale.reference, surplus
            )
            turns[where] = surplus
            turns[where[dropped]] = np.arange(surplus)
            room -= len(where)
        # those dropped late come before those dropped early
        return Order(np.lexsort((-worth, -turns, ranks)), ranks, worth)


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


class Single(Ranked):
    """The best of the living and the newly born survive, by one loss. The best is never lost.

    Several measures are one goal if a recipe sums them, by ``objective = "a name"``.
    """

    name = "single"

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        faults = super().faults(keys, goals, population, parents)
        return faults + one_goal_faults(cls.name, goals)

    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        ranks = ranks_of(losses, violations)
        return Order(np.argsort(ranks, kind="stable"), ranks, np.zeros(len(ranks)))
