"""Thumbprints of maps: coarse heights that tell, cell by cell, whether two cities look alike."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from evocity.citymap import CityMap
from evocity.selection._kernels import count_differences, first_apart, resembles

#: The most cells along each axis.
SIDE = 64
#: Heights differ if they differ by more than this, metres: a storey.
STOREY = 3.0
#: Most steps in the search for the largest set that differs: some hundredths of a second.
STEPS = 10_000
#: Most looks that are compared pair by pair: more would take too long in each generation.
MOST_COMPARED = 256
# Shares of the distance, tried in turn.
_SHARES = (1.0, 0.8, 0.6, 0.4, 0.2)
# Looks are kept in decimetres.
_UNIT = 0.1


def look_of(city: CityMap) -> np.ndarray:
    """Sample the heights of a city evenly, at most `SIDE` along each axis, in decimetres, uint16
    ``(n,)``; heights above 6553 m count as 6553 m."""
    height, width = city.shape
    return decimetres(city.heights[:: -(-height // SIDE), :: -(-width // SIDE)]).ravel()


def decimetres(heights: np.ndarray) -> np.ndarray:
    """Round ``heights`` in metres to decimetres, uint16, at most 65535."""
    return np.clip(np.rint(heights / _UNIT), 0, 65535).astype(np.uint16)


def alike(look: np.ndarray, others: np.ndarray, apart: float) -> bool:
    """Whether a ``look`` (n,) resembles one of ``others`` (k, n), up to the share ``apart``."""
    return resembles(look, others, round(STOREY / _UNIT), int(apart * look.size))


def differences(looks: np.ndarray) -> np.ndarray:
    """Count the cells in which each two of the ``looks`` (k, n) differ by more than a storey: int64
    ``(k, k)``."""
    counts = np.zeros((len(looks), len(looks)), np.int64)
    count_differences(looks, round(STOREY / _UNIT), counts)
    return counts


def distinct_first(looks: Sequence[np.ndarray], apart: float, count: int) -> np.ndarray:
    """Order all ``looks``, given best first, by their indices. The first ``count`` differ pairwise
    by more than ``apart``, each the best that does. If there are too few of them, those follow that
    differ by more than .8, .6, .4 and .2 of it from all before them. The others come last, best
    first."""
    looks = np.asarray(looks)
    if not len(looks):
        return np.empty(0, np.intp)
    mosts = [int(share * apart * looks[0].size) for share in _SHARES]
    chosen = _first_apart(looks, mosts, count)
    return np.concatenate([chosen, np.setdiff1d(np.arange(len(looks)), chosen)]).astype(np.intp)


def most_distinct_first(looks: Sequence[np.ndarray], apart: float, count: int) -> np.ndarray:
    """Indices as `distinct_first` gives them. Where fewer than ``count`` differ in its order, the
    largest set that differs pairwise comes first, as far as `STEPS` steps find a larger set. Above
    `MOST_COMPARED` looks the order is that of `distinct_first`."""
    looks = np.asarray(looks)
    if not len(looks):
        return np.empty(0, np.intp)
    differ = len(_first_apart(looks, [int(apart * looks[0].size)], count))
    if differ < min(count, len(looks)) and len(looks) <= MOST_COMPARED:
        most = _most_apart(looks, apart, count)
        if len(most) > differ:
            order = np.concatenate([most, np.setdiff1d(np.arange(len(looks)), most)])
            return order[distinct_first(looks[order], apart, count)]
    return distinct_first(looks, apart, count)


def _first_apart(looks: np.ndarray, mosts: Sequence[int], count: int) -> np.ndarray:
    return first_apart(looks, round(STOREY / _UNIT), np.array(mosts), count)


def _most_apart(looks: np.ndarray, apart: float, count: int) -> list[int]:
    """Indices of the most ``looks`` (n, k) that differ pairwise, ``count`` at most; of several such
    choices the first in the order of the looks."""
    differing = [0] * len(looks)  # of each look the later ones that differ from it, a bit each
    for i, j in combinations(range(len(looks)), 2):
        differing[i] |= (not alike(looks[i], looks[j : j + 1], apart)) << j
    most: list[int] = []
    left: list[tuple[list[int], int]] = [([], (1 << len(looks)) - 1)]
    for _ in range(STEPS):
        if not left or len(most) == count:
            break
        chosen, others = left.pop()
        if len(chosen) > len(most):
            most = chosen
        if len(chosen) + others.bit_count() > len(most):
            first = (others & -others).bit_length() - 1
            left.append((chosen, others & ~(1 << first)))
            left.append(([*chosen, first], others & differing[first]))
    return most
