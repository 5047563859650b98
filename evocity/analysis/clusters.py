"""Clusters of similar births, and the births that differ most: k-medoids and farthest-first choice.

Where few sets of medoids are possible all are tried. Otherwise BUILD and SWAP of PAM (Kaufman and
Rousseeuw 1990), each swap the best of all (Schubert and Rousseeuw 2021, FastPAM1). Nothing is
random.
"""

from itertools import combinations
from math import comb

import numpy as np

# Sets of medoids that are tried, at most.
_MOST_SETS = 20_000


def medoids(distances: np.ndarray, k: int) -> np.ndarray:
    """Return the rows of the ``k`` medoids, rising, of ``(n, n)`` distances. 1 ≤ k ≤ n."""
    n = len(distances)
    if comb(n, k) <= _MOST_SETS:
        sets = np.array(list(combinations(range(n), k)))
        sums = [distances[:, one].min(axis=1).sum() for one in sets]
        return sets[int(np.argmin(sums))]
    return swap(distances, build(distances, k))


def build(distances: np.ndarray, k: int) -> np.ndarray:
    """Choose ``k`` medoids one after the other, each the one that gains most (BUILD)."""
    chosen = [int(distances.sum(axis=0).argmin())]
    near = distances[:, chosen[0]]
    while len(chosen) < k:
        gains = np.maximum(near[:, None] - distances, 0).sum(axis=0)
        gains[chosen] = -1
        chosen.append(int(gains.argmax()))
        near = np.minimum(near, distances[:, chosen[-1]])
    return np.sort(chosen)


def swap(distances: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Exchange medoids, each time the exchange that gains most, as long as that gains (SWAP)."""
    chosen = chosen.copy()
    every = np.arange(len(distances))
    while True:
        to_each = distances[:, chosen]
        order = np.argsort(to_each, axis=1, kind="stable")
        nearest = order[:, 0]
        near = to_each[every, nearest]
        far = to_each[every, order[:, 1]] if len(chosen) > 1 else np.full(len(near), np.inf)
        shared = np.minimum(distances - near[:, None], 0)
        alone = np.minimum(distances, far[:, None]) - near[:, None] - shared
        change = np.stack([alone[nearest == one].sum(axis=0) for one in range(len(chosen))])
        change += shared.sum(axis=0)
        change[:, chosen] = 0
        gone, new = np.unravel_index(int(change.argmin()), change.shape)
        if not change[gone, new] < -1e-12 * max(1.0, near.sum()):
            return np.sort(chosen)
        chosen[gone] = new


def label_clusters(distances: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return the number of the nearest of the ``chosen`` rows, int ``(n,)``."""
    labels = distances[:, chosen].argmin(axis=1)
    labels[chosen] = np.arange(len(chosen))
    return labels


def farthest_first(distances: np.ndarray, count: int) -> np.ndarray:
    """Return ``count`` rows of ``(n, n)`` distances: the two farthest from each other, then each
    time the one farthest from all before it."""
    if not len(distances):
        return np.zeros(0, np.intp)
    chosen = list(np.unravel_index(int(distances.argmax()), distances.shape))
    chosen = list(dict.fromkeys(int(one) for one in chosen))[:count]
    near = distances[:, chosen].min(axis=1) if chosen else np.zeros(0)
    while 0 < len(chosen) < min(count, len(distances)):
        near[chosen] = -1
        chosen.append(int(near.argmax()))
        near = np.minimum(near, distances[:, chosen[-1]])
    return np.array(chosen, np.intp)
