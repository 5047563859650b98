"""NSGA-II (Deb et al. 2002): who dominates, who lives, who breeds. All losses: lower is better.

The only file that knows DEAP (its types and crowding distance) and moocore (ranks, the filter
of what is not dominated, and hypervolume). Draws come from a handed-down generator; ties are
broken by id.
"""

from collections.abc import Sequence

import moocore
import numpy as np
from deap import base
from deap.tools import emo


class _Crowded:
    """A DEAP individual reduced to what crowding needs: its fitness."""

    def __init__(self, kind: type[base.Fitness], losses: Sequence[float]):
        self.fitness = kind(losses)


def ranks_and_crowding(
    losses: np.ndarray, violations: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Front (int, 0 = not dominated) and crowding distance of each row of ``(n, m)`` losses.

    Those of ``violations`` (n,) above 0 break a constraint: they come after all that do not, in
    fronts of equal violation, the least first (constrained domination, Deb et al. 2002 §VI).

    Raises ValueError for a loss that is not finite: moocore and DEAP would rank NaN first.
    """
    losses = np.ascontiguousarray(losses, np.float64)
    broken = np.zeros(len(losses)) if violations is None else np.asarray(violations, float)
    if not (np.isfinite(losses).all() and np.isfinite(broken).all()):
        raise ValueError("losses and violations must be finite to be ranked")
    ranks = np.empty(len(losses), np.int64)
    kept = broken <= 0
    ranks[kept] = _ranks(losses[kept]) if kept.any() else 0
    fronts = int(ranks[kept].max()) + 1 if kept.any() else 0
    ranks[~kept] = fronts + np.unique(broken[~kept], return_inverse=True)[1]
    kind = type("Losses", (base.Fitness,), {"weights": (-1.0,) * losses.shape[1]})
    crowding = np.zeros(len(losses))
    for front in np.unique(ranks):
        where = np.flatnonzero(ranks == front)
        crowded = [_Crowded(kind, row) for row in _without_overflow(losses[where]).tolist()]
        emo.assignCrowdingDist(crowded)
        crowding[where] = [one.fitness.crowding_dist for one in crowded]
    return ranks, crowding


def not_dominated(losses: np.ndarray) -> np.ndarray:
    """Bool: which rows of ``(n, m)`` losses no other dominates. If several such rows are equal,
    only the first of them counts.

    The first front of `ranks_and_crowding` without doubles, and for many rows far quicker.
    """
    losses = np.ascontiguousarray(losses, np.float64)
    if not np.isfinite(losses).all():
        raise ValueError("losses must be finite to be compared")
    if not len(losses):
        return np.zeros(0, bool)
    if losses.shape[1] == 1:
        return np.arange(len(losses)) == losses[:, 0].argmin()
    return moocore.is_nondominated(losses).astype(bool)


def select(
    ids: Sequence[int], losses: np.ndarray, count: int, violations: np.ndarray | None = None
) -> np.ndarray:
    """Indices of the ``count`` that live, best first: by front, then crowding, then id."""
    if not len(ids):
        return np.empty(0, np.intp)
    by_id = np.argsort(ids, kind="stable")
    broken = None if violations is None else np.asarray(violations)[by_id]
    ranks, crowding = ranks_and_crowding(losses[by_id], broken)
    return by_id[np.lexsort((-crowding, ranks))][:count]


def tournament(
    ids: Sequence[int],
    ranks: Sequence[int],
    crowding: Sequence[float],
    count: int,
    rng: np.random.Generator,
) -> list[int]:
    """Indices of ``count`` parents, each the better of two drawn; all different while possible."""
    chosen: list[int] = []
    left = list(range(len(ids)))
    for _ in range(count):
        if not left:
            left = list(range(len(ids)))
        two = rng.integers(len(left), size=2)
        best = min(left[two[0]], left[two[1]], key=lambda i: (ranks[i], -crowding[i], ids[i]))
        chosen.append(best)
        left.remove(best)
    return chosen


class Hypervolume:
    """Hypervolume in units of the first population's ranges.

    Fixed by the losses ``(n, m)`` of the first population: each loss is scaled so that its
    best is 0 and its worst 1, and the reference lies 10 % beyond the worst of each.
    """

    def __init__(self, first: np.ndarray):
        # Halves throughout, the same to the bit: the range of two huge values would overflow.
        self._best = 0.5 * first.min(axis=0)
        ranges = np.ptp(0.5 * first, axis=0)
        self._ranges = np.where(ranges > 0, ranges, 0.5)
        self._reference = ranges / self._ranges + 0.1

    def __call__(self, losses: np.ndarray) -> float:
        """At least 0; not finite where a loss is too far below those of the first population."""
        with np.errstate(over="ignore"):
            scaled = (0.5 * losses - self._best) / self._ranges
        if scaled.shape[1] == 1:
            return float(max(self._reference[0] - scaled.min(), 0.0))
        return float(moocore.hypervolume(np.ascontiguousarray(scaled), ref=self._reference))


def _without_overflow(losses: np.ndarray) -> np.ndarray:
    """Losses for crowding distances, which are shares of their range: huge ones made smaller."""
    return losses * 2.0**-64 if np.abs(losses).max(initial=0) > 1e290 else losses


def _ranks(losses: np.ndarray) -> np.ndarray:
    if losses.shape[1] == 1:
        return np.unique(losses[:, 0], return_inverse=True)[1]
    return moocore.pareto_rank(losses).astype(np.int64)
