"""Neighbours: the points nearest to each of many points, and differences from them."""

from collections.abc import Callable

import numpy as np
import scipy

from evocity.fitness._kernels import nearest

# Relative difference below which two distances are equal: on a raster the shorter one is chance.
_TIE = 1e-6
# Up to so many points the distances of all pairs take no longer than a tree.
_FEW = 1000


def mean_over_neighbours(
    y: np.ndarray,
    x: np.ndarray,
    values: np.ndarray,
    count: int,
    difference: Callable[[np.ndarray, np.ndarray], np.ndarray],
) -> float:
    """Average over n points the mean ``difference`` of their value and their neighbours'.

    y, x, values : float64 ``(n,)``, with n of 2 or more. count : the number of neighbours of each
    point, nearest first. Points that are exactly as near as the last neighbour count too, and fewer
    count where there are fewer.
    """
    many = values.size
    # The point itself comes first, or another on the very same place.
    candidates = min(many, 2 * count + 1)
    distance, index = nearest_points(y, x, candidates)
    others = index != np.arange(many)[:, None]
    others[others.all(axis=1), -1] = False
    reach = distance[:, min(count, many - 1)] * (1 + _TIE)
    weights = others & (distance <= reach[:, None])
    differences = difference(values[:, None], values[index])
    return float(np.average(differences, axis=1, weights=weights).mean())


def nearest_points(y: np.ndarray, x: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Find the distances of the ``count`` points nearest to each point, itself among them, rising,
    and their numbers, ``(n, count)`` each.

    Equal distances come in the order of SciPy's tree, which takes a fifth of a second to load.
    Nearly all maps built by rule have equal distances, few districts have.
    """
    if y.size <= _FEW:
        distance, index = np.empty((y.size, count)), np.empty((y.size, count), np.int64)
        if not nearest(np.ascontiguousarray(y), np.ascontiguousarray(x), distance, index):
            return distance, index
    points = np.column_stack([y, x])
    return scipy.spatial.KDTree(points).query(points, k=count)
