"""NSGA-III (Deb & Jain 2014): fronts, then niches around reference points. For many goals."""

from collections.abc import Sequence
from math import comb

import numpy as np
from pydantic import Field

from evocity.section import Fault, Section
from evocity.selection.algorithms.algorithm import DistinctKeys, Order, Ranked, tournament
from evocity.selection.fronts import Scale, ranks_of
from evocity.selection.individual import Individual
from evocity.selection.thumbprints import most_distinct_first


class Nsga3Keys(DistinctKeys):
    """``divisions``: the parts that reference points cut each axis into; None for as many as give
    no more points than there are individuals."""

    divisions: int | None = Field(None, ge=1, le=1000)


class Nsga3(Ranked):
    """Fronts by constrained domination. In the front that does not fit, those live that lie in the
    emptiest niches: near to reference points that few others are near to.

    Losses are normalised by the extremes of those that may live. Parents are drawn with equal
    chances, except that an individual that breaks the constraints less beats one that breaks them
    more.
    """

    name = "nsga3"
    marks = ("niche_distance",)
    Keys = Nsga3Keys

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        faults = super().faults(keys, goals, population, parents)
        count = _points(goals, keys.divisions or 1)
        if count <= population:
            return faults
        found = f"{count} reference points for {goals} goals, and {population} individuals"
        if keys.divisions is None or goals > population:
            allowed = f"{goals} or more, one for each goal"
            return [*faults, ("run.population", str(population), allowed)]
        return [*faults, ("search.divisions", found, f"{_divisions(goals, population)} or less")]

    def parents(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[int]:
        places = rng.permutation(len(living)).tolist()
        keys = [(one.violation, place) for one, place in zip(living, places, strict=True)]
        return tournament(len(keys), keys.__getitem__, count, rng, self.keys.tournament)

    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        ranks, distances = ranks_of(losses, violations), np.zeros(len(losses))
        kept = violations <= 0
        if kept.any():
            distances[kept] = self._niches(losses[kept])[1]
        return Order(np.lexsort((distances, ranks)), ranks, distances)

    def _best_first(
        self, losses: np.ndarray, violations: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        from evocity.selection.backends import deap

        order = self._order(losses, violations)
        ranks = order.ranks[order.best_first]
        last = ranks[min(self.size, len(ranks)) - 1]
        among = np.sort(order.best_first[ranks <= last])
        if violations[among].any() or len(among) <= self.size:
            return order.best_first
        niches, distances = self._niches(losses[among])
        split = order.ranks[among] == last
        taken = np.bincount(niches[~split], minlength=len(self._reference(losses.shape[1])))
        room = self.size - np.count_nonzero(~split)
        filled = deap.fill_niches(room, niches[split], distances[split], taken, rng)
        chosen = among[split][filled]
        first = order.best_first[ranks < last]
        left = np.setdiff1d(order.best_first, np.concatenate([first, chosen]))
        rest = order.best_first[np.isin(order.best_first, left)]
        return np.concatenate([first, chosen, rest])

    def _distinct_first(self, looks: Sequence[np.ndarray], count: int) -> np.ndarray:
        # niches are filled by chance: their order may begin with those that leave no room for more
        return most_distinct_first(looks, self.keys.apart, count)

    def _niches(self, losses: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        from evocity.selection.backends import deap

        scale = Scale(losses)
        return deap.niches_of(scale(losses), self._reference(losses.shape[1]))

    def _reference(self, goals: int) -> np.ndarray:
        from evocity.selection.backends import deap

        return deap.reference_points(goals, self.keys.divisions or _divisions(goals, self.size))


def _points(goals: int, divisions: int) -> int:
    """Count the reference points."""
    return comb(goals - 1 + divisions, divisions)


def _divisions(goals: int, most: int) -> int:
    """Return the most divisions, at least 1, that give at ``most`` so many reference points."""
    divisions = 1
    while goals > 1 and _points(goals, divisions + 1) <= most:
        divisions += 1
    return divisions
