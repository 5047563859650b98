"""DEAP: crowding distance (Deb et al. 2002 §III-B), reference points (Deb & Jain 2014).

DEAP draws from the global generators. They are seeded from one handed down, and given back as they
were.
"""

import contextlib
import random
from collections.abc import Iterator, Sequence

import numpy as np
from deap import base
from deap.tools import emo


class _Crowded:
    """A DEAP individual reduced to what crowding needs: its fitness."""

    def __init__(self, kind: type[base.Fitness], losses: Sequence[float]):
        self.fitness = kind(losses)


def crowding_distances(losses: np.ndarray) -> np.ndarray:
    """Crowding distance of each row of one front, ``(n, m)`` losses: the higher, the further from
    the others; infinite for the best and the worst by each loss."""
    kind = type("Losses", (base.Fitness,), {"weights": (-1.0,) * losses.shape[1]})
    # distances are shares of the range: huge losses are made smaller, lest ranges overflow
    scaled = losses * 2.0**-64 if np.abs(losses).max(initial=0) > 1e290 else losses
    crowded = [_Crowded(kind, row) for row in scaled.tolist()]
    emo.assignCrowdingDist(crowded)
    return np.array([one.fitness.crowding_dist for one in crowded], float)


def reference_points(goals: int, divisions: int) -> np.ndarray:
    """Points spread evenly on the plane where all of so many ``goals`` sum to 1, each axis cut in
    so many ``divisions``: float64 ``(n, goals)``."""
    return emo.uniform_reference_points(goals, divisions)


def niches_of(losses: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Of ``(n, m)`` losses whose least is 0 by each: the reference point ``(k, m)`` that each lies
    nearest to, int64 ``(n,)``, once losses are normalised by their extremes; and how far off."""
    least, most = losses.min(axis=0), losses.max(axis=0)
    extremes = emo.find_extreme_points(losses, least)
    intercepts = emo.find_intercepts(extremes, least, most, most)
    return emo.associate_to_niche(losses, points, least, intercepts)


def fill_niches(
    count: int,
    niches: np.ndarray,
    distances: np.ndarray,
    taken: np.ndarray,
    rng: np.random.Generator,
) -> list[int]:
    """Indices of ``count`` individuals of which ``niches`` (n,) and ``distances`` (n,) tell where
    they lie: those of the emptiest niches first, of which so many (k,) are ``taken`` already."""
    with _drawing_from(rng):
        return emo.niching(list(range(len(niches))), count, niches, distances, taken.copy())


@contextlib.contextmanager
def _drawing_from(rng: np.random.Generator) -> Iterator[None]:
    """DEAP's draws are the ``rng``'s."""
    seed = int(rng.integers(2**32))
    own, arrays = random.getstate(), np.random.get_state()  # noqa: NPY002
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(own)
        np.random.set_state(arrays)  # noqa: NPY002
