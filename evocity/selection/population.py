"""The population: the living individuals, their survival, and their hypervolume."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from evocity.citymap import CityMap
from evocity.errors import RecipeError
from evocity.fitness import Aims
from evocity.genome import Genome
from evocity.kinds import Kind
from evocity.selection.algorithms import Algorithm, First
from evocity.selection.fronts import Hypervolume
from evocity.selection.individual import Individual
from evocity.selection.niches import Twins
from evocity.selection.thumbprints import look_of
from evocity.store import Birth, Member


class Population:
    """Individuals with finite losses and different genomes, best first, as an ``algorithm`` selects
    them.

    ``aims`` give losses and broken constraints for raw values, ``kind`` the map of a genome,
    ``limits`` the lowest and the highest value that measures declare. The function ``plan_of``
    gives the name of a genome's plan, and whether the plan differs from those of all source cities;
    None for runs without niches of plans. Failed births never enter, nor does a genome that lives
    already, nor a twin by the key ``twins`` of the algorithm.
    """

    def __init__(
        self,
        algorithm: Algorithm,
        aims: Aims,
        kind: Kind,
        limits: Mapping[str, tuple[float, float]] | None = None,
        plan_of: Callable[[Genome], tuple[str | None, bool]] | None = None,
    ):
        self.algorithm, self._aims, self._kind = algorithm, aims, kind
        self._limits, self._plan_of = limits or {}, plan_of
        self._twins: float = getattr(algorithm.keys, "twins", 0.0)
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
        """Let the algorithm select among the living and ``births``; ``looks`` has known maps by
        id."""
        self.begin_with(births)
        self._looks |= looks or {}
        self.admit([born for born in births if born.ok], rng)

    def admit(self, others: Sequence[Birth | Individual], rng: np.random.Generator) -> None:
        """Let the algorithm select among the living and ``others``, births or individuals."""
        candidates = {one.genome.digest: one for one in self.living}
        for one in others:
            if one.genome.digest not in candidates:
                candidates[one.genome.digest] = self._individual(one)
        entering = list(candidates.values())[len(self.living) :]
        if self._twins and entering:
            twins = Twins(self._twins, self._look, self._city)
            sifted = twins.sift(sorted(entering, key=lambda one: one.id), self.living)
        else:
            sifted = list(candidates.values())
        self.living = self.algorithm.survivors(sifted, self._look, rng)
        self._looks = {one.id: self._looks[one.id] for one in self.living if one.id in self._looks}

    def begin_with(self, births: Sequence[Birth]) -> None:
        """Begin the algorithm and the hypervolume with the first generation's births, only once."""
        first = [born for born in births if born.ok]
        if self._hypervolume is None and self._complete(first):
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

    def _complete(self, first: Sequence[Birth]) -> list[Birth]:
        """Select those of the ``first`` births that have a value for every goal."""
        return [born for born in first if self._aims.complete(born.values)]

    def reweigh(self, aims: Aims) -> None:
        """Judge all again by other ``aims``; also fix the hypervolume's unit again."""
        self._aims, self._hypervolume = aims, None
        self.begin_with(self._first)
        self.living = self.algorithm.judged([self._individual(one) for one in self.living])

    def restore(self, living: Sequence[Birth]) -> None:
        """Put back the individuals that lived in a generation of the log."""
        self.living = self.algorithm.judged([self._individual(born) for born in living])

    @property
    def first_losses(self) -> np.ndarray:
        """Losses ``(n, goals)`` of the first generation's births that were measured."""
        return np.array([self._aims.losses(born.values) for born in self._complete(self._first)])

    @property
    def hypervolume(self) -> float:
        """The hypervolume of the feasible, in units of the first population's ranges, or 0."""
        return volume_of(self.living, self._hypervolume)

    @property
    def summary(self) -> dict[str, float]:
        """The algorithm's finite figures of all the living."""
        if not self.living:
            return {}
        figures = self.algorithm.summary(self.living)
        return {key: figures[key] for key in self.algorithm.figures if math.isfinite(figures[key])}

    @property
    def best(self) -> dict[str, float]:
        """The value of the best individual by goal, among those that are least infeasible."""
        return best_of(self.living, self._aims)

    @property
    def members(self) -> list[Member]:
        return [Member(s, one.id, one.rank, one.marks) for s, one in enumerate(self.living)]

    def _individual(self, born: Birth | Individual) -> Individual:
        values = dict(born.values)
        losses, violation = self._aims.losses(values), self._aims.violation(values)
        genome, plan_of = born.genome, self._plan_of
        plan, changed = (None, False) if plan_of is None else plan_of(genome)
        founder = born.founder if isinstance(born, Individual) else born.operator == "source"
        return Individual(
            born.id, genome, values, losses, violation, plan=plan, changed=changed, founder=founder
        )

    def _look(self, one: Individual) -> np.ndarray:
        if one.id not in self._looks:
            self._looks[one.id] = look_of(self._city(one))
        return self._looks[one.id]

    def _city(self, one: Individual) -> CityMap:
        return self._kind.express(one.genome).city


def volume_of(living: Sequence[Individual], volume: Hypervolume | None) -> float:
    """Compute the hypervolume of the feasible of the ``living``, in units of a ``volume``, or 0."""
    feasible = [one.losses for one in living if not one.violation]
    return volume(np.array(feasible)) if feasible else 0.0


def best_of(living: Sequence[Individual], aims: Aims) -> dict[str, float]:
    """Return the best value by goal, among those of the ``living`` that are least infeasible."""
    least = min((one.violation for one in living), default=0.0)
    best: dict[str, float] = {}
    for aim in aims.wanted:
        name = aim.measure.name
        feasible = [one.values for one in living if one.violation == least]
        values = [one[name] for one in feasible if name in one]
        if aim.objective is not None and values:
            best[name] = min(values, key=aim.loss)
    return best
