"""Arithmetic of `search_power.py`: what births reach together, as they come."""

from collections.abc import Sequence

import moocore
import numpy as np


class Unit:
    """One measure of length for all methods of a case.

    worst : of each goal, the greatest loss of the parents' codes. The reference point lies a tenth
        of the range beyond it.
    ranges : of each goal, the range of its losses among the first births.
    """

    def __init__(self, worst: Sequence[float], ranges: Sequence[float]):
        self.worst, self.ranges = list(worst), list(ranges)

    @classmethod
    def of(cls, first: np.ndarray, parents: np.ndarray) -> "Unit":
        """From the losses ``(n, m)`` of the first births, NaN for what failed, and ``(p, m)`` of
        the parents' codes."""
        ranges = np.nanmax(first, axis=0) - np.nanmin(first, axis=0)
        ranges = np.where(ranges > 0, ranges, 1.0)
        return cls(np.nanmax(parents, axis=0).tolist(), ranges.tolist())

    def __call__(self, losses: np.ndarray) -> np.ndarray:
        """``(n, m)``: 0 at the worst parent, −1 a range below; the reference is at .1."""
        return (losses - self.worst) / self.ranges


#: The reference point, in units.
REFERENCE = 0.1


def curve(unit: Unit, losses: np.ndarray, counted: np.ndarray, step: int) -> np.ndarray:
    """Hypervolume of the archive of the births ``counted`` (n,), after each ``step`` of ``losses``
    (n, m)."""
    goals = losses.shape[1]
    front, found = np.empty((0, goals)), []
    for start in range(0, len(losses), step):
        new = unit(losses[start : start + step][counted[start : start + step]])
        new = new[(new < REFERENCE).all(axis=1)]
        if len(new):
            front = np.vstack([front, new])
            front = front[moocore.is_nondominated(front)]
        volume = moocore.hypervolume(front, ref=[REFERENCE] * goals) if len(front) else 0.0
        found.append(float(volume))
    return np.array(found)


def passed(own: Sequence[float], value: float) -> float:
    """After which share of a curve it exceeds a ``value``; infinite if it never does."""
    above = np.flatnonzero(np.asarray(own) > value)
    return (above[0] + 1) / len(own) if len(above) else np.inf
