"""Survival by hypervolume contribution (Beume, Naujoks & Emmerich 2007, SMS-EMOA), as (µ + λ)."""

import numpy as np

from evocity.selection.algorithms.algorithm import Order, Ranked
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
