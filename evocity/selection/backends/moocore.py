"""moocore: ranks, non-dominated rows, hypervolume and contributions to it."""

import moocore
import numpy as np

from evocity.selection._kernels import least_of_two


def ranks(losses: np.ndarray) -> np.ndarray:
    """Compute the front of each row of ``(n, m)`` losses, int64 from 0."""
    if losses.shape[1] == 1:
        return np.unique(losses[:, 0], return_inverse=True)[1]
    return moocore.pareto_rank(losses).astype(np.int64)


def not_dominated(losses: np.ndarray) -> np.ndarray:
    """Mark the rows of ``(n, m)`` losses that no other row dominates; of equal rows the first."""
    if losses.shape[1] == 1:
        return np.arange(len(losses)) == losses[:, 0].argmin()
    return moocore.is_nondominated(losses).astype(bool)


def hypervolume(losses: np.ndarray, reference: np.ndarray) -> float:
    """Compute the volume that ``(n, m)`` losses dominate, up to the ``reference`` (m,)."""
    if losses.shape[1] == 1:
        return float(max(reference[0] - losses.min(), 0.0))
    return float(moocore.hypervolume(np.ascontiguousarray(losses), ref=reference))


def gained(losses: np.ndarray, reference: np.ndarray, point: np.ndarray) -> float:
    """Compute how much a ``point`` (m,) adds to the hypervolume of ``(n, m)`` losses."""
    if not (point < reference).all():
        return 0.0
    whole = float(np.prod(reference - point))
    if not len(losses):
        return whole
    shared = np.minimum(np.maximum(losses, point), reference)
    shared = shared[not_dominated(shared)]
    return max(whole - hypervolume(shared, reference), 0.0)


def contributions(losses: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Compute how much each row of one front of ``(n, m)`` losses adds to the hypervolume."""
    if losses.shape[1] == 1:  # in a front of one loss all are equal, and none is missed
        return np.zeros(len(losses)) if len(losses) > 1 else reference - losses[:, 0]
    added = moocore.hv_contributions(np.ascontiguousarray(losses), ref=reference)
    return np.asarray(added, np.float64)


def least_first(
    losses: np.ndarray, reference: np.ndarray, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Drop ``count`` rows of one front, each time the row that contributes least, of equal ones the
    last. Returns the rows in that order, and all contributions. A contribution never shrinks when a
    row is dropped, so a known one is a lower bound, and few are measured again."""
    known = contributions(losses, reference)
    if losses.shape[1] == 2:
        return least_of_two(losses, reference, known, count), known
    left, fresh = np.ones(len(losses), bool), np.ones(len(losses), bool)
    dropped = np.empty(count, np.int64)

    def measure(row: int) -> None:
        others = np.maximum(losses[left], losses[row])[np.flatnonzero(left) != row]
        whole = float(np.prod(reference - losses[row]))
        shared = hypervolume(others, reference) if len(others) else 0.0
        known[row], fresh[row] = max(whole - shared, 0.0), True

    for turn in range(count):
        while True:
            least = np.where(left, known, np.inf)
            row = len(least) - 1 - int(least[::-1].argmin())
            if fresh[row]:
                break
            measure(row)
        dropped[turn] = row
        left[row], fresh[:] = False, False
    for row in np.flatnonzero(left & ~fresh):
        measure(row)
    return dropped, known
