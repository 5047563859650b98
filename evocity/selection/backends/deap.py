"""DEAP: crowding distance (Deb et al. 2002 §III-B), reference points (Deb & Jain 2014), MO-CMA-ES
(Voss, Hansen & Igel 2010).

DEAP draws from the global generators. This file seeds them from a given generator, and restores
their state afterwards.
"""

import contextlib
import random
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from deap import base, cma, tools
from deap.tools import emo

#: The object that holds the functions of DEAP's algorithms.
Toolbox = base.Toolbox
#: NSGA-II's selection: the best ``k`` of the individuals.
select_nsga2 = tools.selNSGA2

#: The function that returns the index of the individual that a front, ``(n, m)`` losses, misses
#: least.
Least = Callable[[np.ndarray], int]


class _Crowded:
    """A DEAP individual with only a fitness, which is all that crowding needs."""

    def __init__(self, kind: type[base.Fitness], losses: Sequence[float]):
        self.fitness = kind(losses)


def crowding_distances(losses: np.ndarray) -> np.ndarray:
    """Compute the crowding distances of one front of ``(n, m)`` losses; infinite for extremes."""
    kind = type("Losses", (base.Fitness,), {"weights": (-1.0,) * losses.shape[1]})
    # distances are shares of the range, and ranges of huge losses would overflow
    scaled = losses * 2.0**-64 if np.abs(losses).max(initial=0) > 1e290 else losses
    crowded = [_Crowded(kind, row) for row in scaled.tolist()]
    emo.assignCrowdingDist(crowded)
    return np.array([one.fitness.crowding_dist for one in crowded], float)


def losses_kind(goals: int, wrong: Callable[[object, int], Exception]) -> type[base.Fitness]:
    """Make a DEAP fitness class of ``goals`` finite losses; ``wrong`` makes the error of others."""

    class Losses(base.Fitness):
        weights = (-1.0,) * goals

        def setValues(self, values: Sequence[float]) -> None:
            try:
                numbers = np.asarray(tuple(values), np.float64)
                sound = numbers.shape == (goals,) and bool(np.isfinite(numbers).all())
            except (TypeError, ValueError):
                sound = False
            if not sound:
                raise wrong(values, goals)
            base.Fitness.setValues(self, numbers.tolist())

        values = property(base.Fitness.getValues, setValues, base.Fitness.delValues)

    return Losses


def reference_points(goals: int, divisions: int) -> np.ndarray:
    """Spread points evenly where all ``goals`` sum to 1, in ``divisions`` an axis, ``(n,
    goals)``."""
    return emo.uniform_reference_points(goals, divisions)


def niches_of(losses: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Find the nearest of the ``points`` (k, m) for ``(n, m)`` losses from 0, and its distance."""
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
    """Select ``count`` indices from the emptiest niches first; ``taken`` (k,) counts those
    inside."""
    with _drawing_from(rng):
        return emo.niching(list(range(len(niches))), count, niches, distances, taken.copy())


class Covariances:
    """MO-CMA-ES: ``n`` vectors, each with its own step and covariance matrix, which learn from the
    offspring that replace them.

    Parameters
    ----------
    vectors : the first vectors, ``(n, d)``, of numbers 0…1.
    losses : their losses, ``(n, m)``; lower is better.
    step : the initial standard deviation of offspring around their parents.
    least : the function that picks the individual to drop from a front.
    """

    def __init__(self, vectors: np.ndarray, losses: np.ndarray, step: float, least: Least):
        losses = _several(losses)
        kind = type("Losses", (base.Fitness,), {"weights": (-1.0,) * losses.shape[1]})
        pairs = zip(vectors, losses.tolist(), strict=True)
        self._parents = [_Vector.of(one, kind(row)) for one, row in pairs]
        self._kind, self._offspring = kind, []
        self._strategy = cma.StrategyMultiObjective(
            self._parents,
            step,
            mu=len(vectors),
            lambda_=len(vectors),
            indicator=lambda front, ref: least(-np.array([one.fitness.wvalues for one in front])),
        )

    @property
    def steps(self) -> np.ndarray:
        """The step of each of the ``n`` living, float64."""
        return np.array(self._strategy.sigmas, np.float64)

    def offspring(self, rng: np.random.Generator) -> np.ndarray:
        """Draw one child of each of the living, ``(n, d)``, within 0…1."""
        with _drawing_from(rng):
            self._offspring = self._strategy.generate(lambda one: _Vector.of(np.clip(one, 0, 1)))
        return np.array(self._offspring, np.float64)

    def select(self, losses: np.ndarray) -> list[int]:
        """Select the survivors by the ``losses`` (n, m) of the last offspring, in the order of
        `steps`: 0…n − 1 are the living until now, n…2n − 1 the offspring."""
        for one, row in zip(self._offspring, _several(losses).tolist(), strict=True):
            one.fitness = self._kind(row)
        numbers = {id(one): k for k, one in enumerate([*self._strategy.parents, *self._offspring])}
        self._strategy.update(self._offspring)
        return [numbers[id(one)] for one in self._strategy.parents]


class _Vector(np.ndarray):
    """Numbers with a DEAP fitness."""

    @classmethod
    def of(cls, values: np.ndarray, fitness: base.Fitness | None = None) -> "_Vector":
        one = np.array(values, np.float64).view(cls)
        one.fitness = fitness
        return one


def _several(losses: np.ndarray) -> np.ndarray:
    """Double a single goal: DEAP sorts only two goals and more."""
    return losses if losses.shape[1] > 1 else np.repeat(losses, 2, axis=1)


@contextlib.contextmanager
def _drawing_from(rng: np.random.Generator) -> Iterator[None]:
    """Let DEAP draw from the ``rng``."""
    seed = int(rng.integers(2**32))
    own, arrays = random.getstate(), np.random.get_state()  # noqa: NPY002
    random.seed(seed)
    np.random.seed(seed)  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(own)
        np.random.set_state(arrays)  # noqa: NPY002
