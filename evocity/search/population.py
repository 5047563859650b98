"""The living, generation by generation: who is let in, and how good they are together."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from evocity.fitness import Aims
from evocity.search.breeding import Individual
from evocity.search.nsga2 import Hypervolume, ranks_and_crowding, select
from evocity.store import Birth, Member


class Population:
    """At most ``size`` individuals with finite losses and different genomes, best first.

    ``aims`` tell losses and broken constraints from raw values. Failed births never enter; a
    genome that lives already is not let in twice.
    """

    def __init__(self, size: int, aims: Aims):
        self._size, self._aims = size, aims
        self._hypervolume: Hypervolume | None = None
        self.living: list[Individual] = []

    def select(self, births: Sequence[Birth]) -> None:
        """(µ + λ): the best of the living and the newly born live on."""
        self.begin_with(births)
        candidates = {one.genome.digest: one for one in self.living}
        for born in births:
            if born.ok:
                candidates.setdefault(born.genome.digest, self._individual(born))
        self._keep(list(candidates.values()))

    def begin_with(self, births: Sequence[Birth]) -> None:
        """Fix the hypervolume's unit by the first generation's births; later calls do nothing."""
        first = [self._aims.losses(born.values) for born in births if born.ok]
        if self._hypervolume is None and first:
            self._hypervolume = Hypervolume(np.array(first))

    def restore(self, living: Sequence[Birth]) -> None:
        """Put back those who lived in a generation of the log."""
        self._keep([self._individual(born) for born in living])

    @property
    def hypervolume(self) -> float:
        """Of those that break no constraint, in units of the first population's ranges, see
        `Hypervolume`; 0 if there are none."""
        feasible = [one.losses for one in self.living if not one.violation]
        return self._hypervolume(np.array(feasible)) if feasible else 0.0

    @property
    def best(self) -> dict[str, float]:
        """Raw value of the best individual, for each measure that is more than a constraint; of
        those that break the constraints least."""
        if not self.living:
            return {}
        least = min(one.violation for one in self.living)
        among = [one.values for one in self.living if one.violation == least]
        return {
            name: min((values[name] for values in among), key=wanted.loss)
            for wanted in self._aims.wanted
            if wanted.objective is not None
            for name in [wanted.measure.name]
        }

    @property
    def members(self) -> list[Member]:
        return [Member(s, one.id, one.rank, one.crowding) for s, one in enumerate(self.living)]

    def _individual(self, born: Birth) -> Individual:
        values = dict(born.values)
        losses, violation = self._aims.losses(values), self._aims.violation(values)
        return Individual(born.id, born.genome, values, losses, violation)

    def _keep(self, candidates: list[Individual]) -> None:
        if not candidates:
            self.living = []
            return
        chosen = [candidates[i] for i in _selected(candidates, self._size)]
        ordered = [chosen[i] for i in _selected(chosen, self._size)]
        by_id = sorted(ordered, key=lambda one: one.id)
        ranks, crowding = ranks_and_crowding(
            np.array([one.losses for one in by_id]), np.array([one.violation for one in by_id])
        )
        judged = {
            one.id: (int(r), float(c)) for one, r, c in zip(by_id, ranks, crowding, strict=True)
        }
        self.living = [
            replace(one, rank=judged[one.id][0], crowding=judged[one.id][1]) for one in ordered
        ]


def _selected(individuals: Sequence[Individual], count: int) -> np.ndarray:
    losses = np.array([one.losses for one in individuals])
    violations = np.array([one.violation for one in individuals])
    return select([one.id for one in individuals], losses, count, violations)
