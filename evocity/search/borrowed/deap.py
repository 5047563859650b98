"""DEAP: crowding distance (Deb et al. 2002 §III-B)."""

from collections.abc import Sequence

import numpy as np
from deap import base
from deap.tools import emo


class _Crowded:
    """A DEAP individual reduced to what crowding needs: its fitness."""

    def __init__(self, kind: type[base.Fitness], losses: Sequence[float]):
        self.fitness = kind(losses)


def crowding_distances(losses: np.ndarray) -> np.ndarray:
    """Crowding distance of each row of one front, ``(n, m)`` losses: the higher, the further from
    the others; infinite for the best and the worst by each loss."""
    kind = type("Losses", (base.Fitness,), {"weights": (-1.0,) * losses.shape[1]})
    # distances are shares of the range: huge losses are made smaller, lest ranges overflow
    scaled = losses * 2.0**-64 if np.abs(losses).max(initial=0) > 1e290 else losses
    crowded = [_Crowded(kind, row) for row in scaled.tolist()]
    emo.assignCrowdingDist(crowded)
    return np.array([one.fitness.crowding_dist for one in crowded], float)
