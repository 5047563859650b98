"""Fronts, crowding distance and hypervolume. All losses: lower is better.

The libraries are imported where they are used, because many commands need none of them.
"""

import numpy as np


def ranks_of(losses: np.ndarray, violations: np.ndarray | None = None) -> np.ndarray:
    """Compute the front of each row of ``(n, m)`` losses, int; 0 is the non-dominated one.

    Rows with ``violations`` (n,) above 0 break a constraint. They come after all others, in fronts
    of equal violation, the least first (constrained domination, Deb et al. 2002 §VI).

    Raises ValueError for a loss that is not finite: it would be ranked first.
    """
    from evocity.selection.backends import moocore

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
    """Compute the crowding distance of each row of ``(n, m)`` losses within its front."""
    from evocity.selection.backends import deap

    crowding = np.zeros(len(losses))
    for front in np.unique(ranks):
        where = np.flatnonzero(ranks == front)
        crowding[where] = deap.crowding_distances(np.asarray(losses, np.float64)[where])
    return crowding


def not_dominated(losses: np.ndarray) -> np.ndarray:
    """Mark the rows of ``(n, m)`` losses that no other row dominates; of equal rows the first. It
    is the first front of `ranks_of` without doubles, and far quicker for many rows."""
    from evocity.selection.backends import moocore

    losses = np.ascontiguousarray(losses, np.float64)
    if not np.isfinite(losses).all():
        raise ValueError("losses must be finite to be compared")
    return moocore.not_dominated(losses) if len(losses) else np.zeros(0, bool)


class Scale:
    """Losses in units of the ranges of a sample: 0 is the best of each loss, 1 the worst."""

    def __init__(self, losses: np.ndarray):
        # Halves throughout, the same to the bit: the range of two huge values would overflow.
        self._best = 0.5 * losses.min(axis=0)
        ranges = np.ptp(0.5 * losses, axis=0)
        self._ranges = np.where(ranges > 0, ranges, 0.5)
        #: A tenth of the range beyond the worst of each loss; of equal ones a tenth.
        self.reference = ranges / self._ranges + 0.1

    def __call__(self, losses: np.ndarray) -> np.ndarray:
        """Scale ``(n, m)`` losses; one too far below the sample is not finite."""
        with np.errstate(over="ignore"):
            return (0.5 * losses - self._best) / self._ranges


#: Number of losses -> the most points whose exact hypervolume takes only a second or two.
MOST_POINTS = {5: 10_000, 6: 1_000, 7: 250, 8: 120, 9: 60, 10: 36, 11: 28, 12: 24}
_MOST_POINTS_OF_MORE = 16


def volume_is_quick(points: int, losses: int) -> bool:
    """Whether the exact hypervolume of so many ``points`` takes only a second or two."""
    return losses < min(MOST_POINTS) or points <= MOST_POINTS.get(losses, _MOST_POINTS_OF_MORE)


def volumes_are_quick(points: int, losses: int) -> bool:
    """Whether fifty exact hypervolumes of so many ``points`` take only a second or two."""
    return volume_is_quick(50 * points, losses)


class Gain:
    """Hypervolume that a point adds to others, in units of the ranges of a ``first`` sample."""

    def __init__(self, first: np.ndarray):
        self._scale = Scale(first)

    def __call__(self, losses: np.ndarray, point: np.ndarray) -> float:
        """Compute what a ``point`` (m,) adds to ``(n, m)`` losses; 0 if this is not finite."""
        from evocity.selection.backends import moocore

        scaled = self._scale(point[None])[0]
        added = moocore.gained(self._scale(losses), self._scale.reference, scaled)
        return added if np.isfinite(added) else 0.0


class Hypervolume:
    """Hypervolume in units of the first population's ranges, up to 10 % beyond its worst."""

    def __init__(self, first: np.ndarray):
        self._scale = Scale(first)

    def __call__(self, losses: np.ndarray) -> float:
        """Compute the hypervolume, 0 or more; infinite if a loss is too far below those of the
        first population. NaN unless `volume_is_quick`: it would take up to hours."""
        if not volume_is_quick(*losses.shape):
            return np.nan
        from evocity.selection.backends import moocore

        return moocore.hypervolume(self._scale(losses), self._scale.reference)
