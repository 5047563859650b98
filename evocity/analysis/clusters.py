"""Groups of like ones, each around one of its own: k-medoids.

Where few sets of medoids are possible all of them are tried. Else BUILD and SWAP of PAM (Kaufman
and Rousseeuw 1990), each swap the best of all (Schubert and Rousseeuw 2021, FastPAM1): nothing is
drawn at random.
"""

from itertools import combinations
from math import comb

import numpy as np

# So many sets of medoids are tried, at most.
_MOST_SETS = 20_000


def medoids(distances: np.ndarray, k: int) -> np.ndarray:
    """Rows of the ``k`` medoids, rising, of ``(n, n)`` distances: those to which all together are
    nearest. 1 ≤ k ≤ n."""
    n = len(distances)
    if comb(n, k) <= _MOST_SETS:
        sets = np.array(list(combinations(range(n), k)))
        sums = [distances[:, one].min(axis=1).sum() for one in sets]
        return sets[int(np.argmin(sums))]
    return swapped(distances, built(distances, k))


def built(distances: np.ndarray, k: int) -> np.ndarray:
    """BUILD: the one to which all are nearest, then each time the one that gains most."""
    chosen = [int(distances.sum(axis=0).argmin())]
    near = distances[:, chosen[0]]
    while len(chosen) < k:
        gains = np.maximum(near[:, None] - distances, 0).sum(axis=0)
        gains[chosen] = -1
        chosen.append(int(gains.argmax()))
        near = np.minimum(near, distances[:, chosen[-1]])
    return np.sort(chosen)


def swapped(distances: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """SWAP: while one gains, the exchange of a medoid for another that gains most."""
    chosen = chosen.copy()
    everyone = np.arange(len(distances))
    while True:
        to_each = distances[:, chosen]
        order = np.argsort(to_each, axis=1, kind="stable")
        nearest = order[:, 0]
        near = to_each[everyone, nearest]
        far = to_each[everyone, order[:, 1]] if len(chosen) > 1 else np.full(len(near), np.inf)
        shared = np.minimum(distances - near[:, None], 0)
        alone = np.minimum(distances, far[:, None]) - near[:, None] - shared
        change = np.stack([alone[nearest == one].sum(axis=0) for one in range(len(chosen))])
        change += shared.sum(axis=0)
        change[:, chosen] = 0
        gone, new = np.unravel_index(int(change.argmin()), change.shape)
        if not change[gone, new] < -1e-12 * max(1.0, near.sum()):
            return np.sort(chosen)
        chosen[gone] = new


def labelled(distances: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Int ``(n,)``: the number of the nearest of the ``chosen`` rows, of equal ones the first; a
    medoid's is its own."""
    labels = distances[:, chosen].argmin(axis=1)
    labels[chosen] = np.arange(len(chosen))
    return labels


__all__ = ["built", "labelled", "medoids", "swapped"]
