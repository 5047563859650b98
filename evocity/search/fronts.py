"""Who dominates whom, and how good many are together. All losses: lower is better.

What is borrowed for it is loaded when it is used: a tenth of what many commands load.
"""

import numpy as np


def ranks_of(losses: np.ndarray, violations: np.ndarray | None = None) -> np.ndarray:
    """The front of each row of ``(n, m)`` losses, int from 0: not dominated.

    Those of ``violations`` (n,) above 0 break a constraint: they come after all that do not, in
    fronts of equal violation, the least first (constrained domination, Deb et al. 2002 §VI).

    Raises ValueError for a loss that is not finite: it would be ranked first.
    """
    from evocity.search.borrowed import moocore

    losses = np.ascontiguousarray(losses, np.float64)
    broken = np.zeros(len(losses)) if violations is None else np.asarray(violations, float)
    if not (np.isfinite(losses).all() and np.isfinite(broken).all()):
        raise ValueError("losses and violations must be finite to be ranked")
    ranks = np.empty(len(losses), np.int64)
    kept = broken <= 0
    ranks[kept] = moocore.ranks(losses[kept]) if kept.any() else 0
    fronts = int(ranks[kept].max()) + 1 if kept.any() else 0
    ranks[~kept] = fronts + np.unique(broken[~kept], return_inverse=True)[1]
    return ranks


def crowding_of(losses: np.ndarray, ranks: np.ndarray) -> np.ndarray:
    """Crowding distance of each row of ``(n, m)`` losses within its front."""
    from evocity.search.borrowed import deap

    crowding = np.zeros(len(losses))
    for front in np.unique(ranks):
        where = np.flatnonzero(ranks == front)
        crowding[where] = deap.crowding_distances(np.asarray(losses, np.float64)[where])
    return crowding


def not_dominated(losses: np.ndarray) -> np.ndarray:
    """Bool: which rows of ``(n, m)`` losses no other dominates. If several such rows are equal,
    only the first of them counts.

    The first front of `ranks_of` without doubles, and for many rows far quicker.
    """
    from evocity.search.borrowed import moocore

    losses = np.ascontiguousarray(losses, np.float64)
    if not np.isfinite(losses).all():
        raise ValueError("losses must be finite to be compared")
    return moocore.not_dominated(losses) if len(losses) else np.zeros(0, bool)


class Scale:
    """Losses in units of the ranges of some: 0 is the best of each loss, 1 the worst."""

    def __init__(self, losses: np.ndarray):
        # Halves throughout, the same to the bit: the range of two huge values would overflow.
        self._best = 0.5 * losses.min(axis=0)
        ranges = np.ptp(0.5 * losses, axis=0)
        self._ranges = np.where(ranges > 0, ranges, 0.5)
        #: A tenth of the range beyond the worst of each loss; of equal ones a tenth.
        self.reference = ranges / self._ranges + 0.1

    def __call__(self, losses: np.ndarray) -> np.ndarray:
        """``(n, m)`` losses; not finite where one is too far below those of the scale."""
        with np.errstate(over="ignore"):
            return (0.5 * losses - self._best) / self._ranges


#: Points up to which the exact hypervolume of so many losses takes a second or two; of any more
#: losses, and of any fewer.
MOST_POINTS = {5: 10_000, 6: 1_000, 7: 250, 8: 120, 9: 60, 10: 36, 11: 28, 12: 24}
_MOST_POINTS_OF_MORE = 16


def volume_is_quick(points: int, losses: int) -> bool:
    """Whether the exact hypervolume of so many ``points`` takes no more than a second or two."""
    return losses < min(MOST_POINTS) or points <= MOST_POINTS.get(losses, _MOST_POINTS_OF_MORE)


class Hypervolume:
    """Hypervolume in units of the first population's ranges.

    Fixed by the losses ``(n, m)`` of the first population: each loss is scaled so that its
    best is 0 and its worst 1, and the reference lies 10 % beyond the worst of each.
    """

    def __init__(self, first: np.ndarray):
        self._scale = Scale(first)

    def __call__(self, losses: np.ndarray) -> float:
        """At least 0; infinite where a loss is too far below those of the first population. NaN
        where it is not `volume_is_quick`: of twelve losses a few points more take hours."""
        if not volume_is_quick(*losses.shape):
            return np.nan
        from evocity.search.borrowed import moocore

        return moocore.hypervolume(self._scale(losses), self._scale.reference)
