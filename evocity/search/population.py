"""The living, generation by generation: who is let in, and how good they are together."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from evocity.errors import RecipeError
from evocity.fitness import Aims
from evocity.kinds import Kind
from evocity.search.algorithms import Algorithm, First
from evocity.search.fronts import Hypervolume
from evocity.search.individual import Individual
from evocity.search.looks import look_of
from evocity.store import Birth, Member


class Population:
    """Individuals with finite losses and different genomes, best first, as an ``algorithm`` selects
    them.

    ``aims`` tell losses and broken constraints from raw values, ``kind`` the map of a genome,
    ``limits`` the lowest and highest value that measures declare.
    Failed births never enter; a genome that lives already is not let in twice.
    """

    def __init__(
        self,
        algorithm: Algorithm,
        aims: Aims,
        kind: Kind,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ):
        self.algorithm, self._aims, self._kind = algorithm, aims, kind
        self._limits = limits or {}
        self._looks: dict[int, np.ndarray] = {}
        self._hypervolume: Hypervolume | None = None
        self._first: list[Birth] = []
        self.living: list[Individual] = []

    def select(
        self,
        births: Sequence[Birth],
        rng: np.random.Generator,
        looks: Mapping[int, np.ndarray] | None = None,
    ) -> None:
        """Those of the living and the newly born live on that the algorithm selects; what it draws
        is drawn from ``rng``. ``looks``: by id, how maps look, as far as it is known."""
        self.begin_with(births)
        self._looks |= looks or {}
        self.admit([born for born in births if born.ok], rng)

    def admit(self, others: Sequence[Birth | Individual], rng: np.random.Generator) -> None:
        """Let ``others`` in, who were born, or live elsewhere, as far as the algorithm selects them
        among the living."""
        candidates = {one.genome.digest: one for one in self.living}
        for one in others:
            candidates.setdefault(one.genome.digest, self._individual(one))
        self.living = self.algorithm.survivors(list(candidates.values()), self._look, rng)
        self._looks = {one.id: self._looks[one.id] for one in self.living if one.id in self._looks}

    def begin_with(self, births: Sequence[Birth]) -> None:
        """Fix the hypervolume's unit by the first generation's births, and tell the algorithm of
        them; later calls do nothing."""
        first = [born for born in births if born.ok]
        if self._hypervolume is None and self._compared(first):
            self._first = [replace(born, genome=None) for born in first]
            losses = self.first_losses
            sources = [born for born in births if born.operator == "source"]
            values = [born.values if born.ok else {} for born in sources]
            try:
                self.algorithm.begin(First(losses, values, self._limits))
            except RecipeError as error:
                failed = [
                    f"source {born.id} failed: {born.error}" for born in sources if born.error
                ]
                found = "; ".join([error.found, *failed])
                raise RecipeError(found, error.expected, error.remedy) from None
            self._hypervolume = Hypervolume(losses)

    def _compared(self, first: Sequence[Birth]) -> list[Birth]:
        """Those of the ``first`` births that have a value of all that is sought."""
        return [born for born in first if self._aims.complete(born.values)]

    def reweigh(self, aims: Aims) -> None:
        """Judge all anew by other ``aims``; the hypervolume's unit too."""
        self._aims, self._hypervolume = aims, None
        self.begin_with(self._first)
        self.living = self.algorithm.judged([self._individual(one) for one in self.living])

    def restore(self, living: Sequence[Birth]) -> None:
        """Put back those who lived in a generation of the log."""
        self.living = self.algorithm.judged([self._individual(born) for born in living])

    @property
    def first_losses(self) -> np.ndarray:
        """Losses ``(n, goals)`` of the first generation's births that were measured."""
        return np.array([self._aims.losses(born.values) for born in self._compared(self._first)])

    @property
    def hypervolume(self) -> float:
        """Of those that break no constraint, in units of the first population's ranges, see
        `Hypervolume`; 0 if there are none."""
        return volume_of(self.living, self._hypervolume)

    @property
    def summary(self) -> dict[str, float]:
        """What the algorithm tells of all the living, as far as it is finite."""
        if not self.living:
            return {}
        told = self.algorithm.summary(self.living)
        return {name: told[name] for name in self.algorithm.figures if math.isfinite(told[name])}

    @property
    def best(self) -> dict[str, float]:
        """Raw value of the best individual, for each measure that is more than a constraint; of
        those that break the constraints least."""
        return best_of(self.living, self._aims)

    @property
    def members(self) -> list[Member]:
        return [Member(s, one.id, one.rank, one.marks) for s, one in enumerate(self.living)]

    def _individual(self, born: Birth | Individual) -> Individual:
        values = dict(born.values)
        losses, violation = self._aims.losses(values), self._aims.violation(values)
        return Individual(born.id, born.genome, values, losses, violation)

    def _look(self, one: Individual) -> np.ndarray:
        if one.id not in self._looks:
            self._looks[one.id] = look_of(self._kind.express(one.genome).city)
        return self._looks[one.id]


def volume_of(living: Sequence[Individual], volume: Hypervolume | None) -> float:
    """The hypervolume of those of the ``living`` that break no constraint, by the units of a
    ``volume``; 0 if there are none."""
    feasible = [one.losses for one in living if not one.violation]
    return volume(np.array(feasible)) if feasible else 0.0


def best_of(living: Sequence[Individual], aims: Aims) -> dict[str, float]:
    """Raw value of the best of the ``living``, for each measure that is more than a constraint; of
    those that break the constraints least."""
    if not living:
        return {}
    least = min(one.violation for one in living)
    among = [one.values for one in living if one.violation == least]
    return {
        name: min(found, key=wanted.loss)
        for wanted in aims.wanted
        if wanted.objective is not None
        for name in [wanted.measure.name]
        if (found := [values[name] for values in among if name in values])
    }
