"""Energy distance: the mean distances of tables of features, of which it is made."""

import numpy as np

from evocity.fitness import _kernels


def mean_distance(x: np.ndarray, y: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Average the Euclidean distances of the columns of ``x`` and ``y``; 0 without any pair.

    x, y : float32 ``(F, n)`` and ``(F, m)``. If both are one array, only pairs of two different
    columns count. ends : int ``(k,)``. The first number counts the rows before ends[0]; number i
    counts these and the rows from ends[i − 1] to ends[i]. Returns float64 ``(k,)``.
    """
    sums, n = np.zeros(ends.size), x.shape[1]
    _kernels.distances(x, y, ends, x is y, sums)
    return sums / max(n * (n - 1) / 2 if x is y else n * y.shape[1], 1)
