"""The base classes of selection algorithms: `Algorithm`, and `Ranked` for those that rank."""

from abc import ABC, abstractmethod
from bisect import insort
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from evocity.section import Fault, Section
from evocity.selection.individual import Individual
from evocity.selection.niches import choose_by_plan, source_of
from evocity.selection.thumbprints import distinct_first

#: Individuals, for example the living of a generation.
Living = Sequence[Individual]
#: The generator of all random draws.
Rng = np.random.Generator
#: The function that returns the look of an individual's map, see `evocity.selection.thumbprints`.
Look = Callable[[Individual], np.ndarray]


@dataclass(frozen=True)
class First:
    """The first generation: the ``losses`` (n, goals) of its measured births; the values, measure
    -> number, of the ``sources`` among its births; and the ``limits``, the lowest and the highest
    value that each measure declares."""

    losses: np.ndarray
    sources: Sequence[Mapping[str, float]] = ()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class Algorithm(ABC):
    """A selection algorithm, which selects the survivors and the parents. For all algorithms, lower
    losses are better than higher losses.

    The decisions of an algorithm must depend only on its input, and not on the order of the input,
    because a resumed run passes the living individuals to `judged`.

    name : name of the algorithm in recipes.
    marks : names of additional columns of the log's table ``membership``. Each additional column
        holds a number for each living individual, for example the crowding distance.
    figures : names of the numbers that the method `summary` computes for all living individuals
        together.
    Keys : pydantic model of the algorithm's own keys in the section ``[search]`` of a recipe.
    breeds_by : the operator by which the algorithm breeds from all parents of the recipe, see
        `settings`; None if the operators of the recipe breed the children.
    replays : whether a resumed run must replay the algorithm from the start, with calls of
        `settings` and `survivors` for each generation.

    Parameters
    ----------
    size : number of births in a generation; most algorithms keep at most this number of individuals
        alive.
    keys : the algorithm's own keys, an instance of the class ``Keys``.
    """

    name: ClassVar[str]
    marks: ClassVar[tuple[str, ...]] = ()
    figures: ClassVar[tuple[str, ...]] = ()
    Keys: ClassVar[type[Section]] = Section
    breeds_by: ClassVar[str | None] = None
    replays: ClassVar[bool] = False

    def __init__(self, size: int, keys: Section | None = None):
        self.size, self.keys = size, self.Keys() if keys is None else keys

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        """List the faults of a recipe that names the algorithm with these ``keys``; the numbers
        ``goals``, ``population`` and ``parents`` are those of the recipe."""
        return []

    @classmethod
    def described(cls, keys: Section) -> tuple[str, ...]:
        """Name the measures that the algorithm needs of every birth besides the goals; a run
        records these measures even if its recipe does not name them."""
        return ()

    def begin(self, first: First) -> None:  # noqa: B027
        """Receive the first generation, before any other method of the algorithm is called. The
        method `begin` is called again when a run is resumed, and when the weights of goals change.
        Raises `RecipeError` if the algorithm cannot begin with the first generation."""

    def summary(self, living: Living) -> dict[str, float]:
        """Compute the numbers that the attribute ``figures`` names, for all ``living`` individuals
        together; the log holds the finite numbers of each generation."""
        return {}

    def settings(self, first: int, sources: int, rng: Rng) -> list[Mapping[str, object]]:
        """Make the parameters of the operator in ``breeds_by`` for each birth of the next
        generation; the births have the ids ``first``, ``first`` + 1, …. The argument ``sources`` is
        the number of parents."""
        raise NotImplementedError(f"{self.name} does not breed by itself")

    @abstractmethod
    def survivors(self, candidates: Living, look: Look, rng: Rng) -> list[Individual]:
        """Select the survivors, best first, with rank and marks as in `judged`. The function
        ``look`` returns the map of an individual, for algorithms that compare maps; the generator
        ``rng`` makes all random draws."""

    @abstractmethod
    def judged(self, living: Living) -> list[Individual]:
        """Sort all ``living`` individuals, best first, and give each individual its rank and
        marks."""

    def migrants(self, living: Living, count: int, rng: Rng) -> list[Individual]:
        """Select at most ``count`` of the ``living`` individuals, sorted best first, for copies on
        another island; by default, select the best individuals."""
        return list(living[:count])

    @abstractmethod
    def parents(self, living: Living, count: int, rng: Rng) -> list[int]:
        """Select ``count`` of the ``living`` individuals as parents, and return their indices; all
        indices differ if enough individuals live."""


def one_goal_faults(algorithm: str, goals: int) -> list[Fault]:
    """List the fault of an ``algorithm`` for one goal in a recipe with several."""
    if goals == 1:
        return []
    allowed = 'one goal; measures with the same objective = "a name" are summed to one'
    return [("search.algorithm", f"{algorithm!r} with {goals} goals", allowed)]


@dataclass(frozen=True)
class Order:
    """Individuals in order: their indices ``(n,)``, best first; the rank of each, int ``(n,)``, and
    its worth within the rank, float ``(n,)``, higher is better."""

    best_first: np.ndarray
    ranks: np.ndarray
    worth: np.ndarray


class DistinctKeys(Section):
    """``distinct``: the share of the living that differ pairwise; two differ if their heights
    differ by more than a storey in more than the share ``apart`` of the map's pixels.

    ``per_plan``: most of the living that have one changed plan of streets; 0 for no limit.
    ``source_plans``: the share of the living that is kept for the plans of the source cities, in
    equal parts. If all individuals with plans of one city break constraints, they compete as
    parents only with each other. ``twins``: births do not enter if their heights differ from a
    living individual by more than a storey in less than this share of the pixels. ``tournament``:
    how many individuals are drawn for each parent, which is the best of them.
    """

    distinct: float = Field(0.5, ge=0, le=1)
    apart: float = Field(0.25, ge=0, lt=1)
    per_plan: int = Field(0, ge=0, le=1_000_000)
    source_plans: float = Field(0.0, ge=0, le=1)
    twins: float = Field(0.0, ge=0, lt=1)
    tournament: int = Field(2, ge=1, le=1_000_000)


class Ranked(Algorithm):
    """(µ + λ) by a total order: the best live, and among them as many distinct ones as ``distinct``
    requires, if so many keep the constraints. Niches of plans have places and limits, see
    `evocity.selection.niches`. Each parent is the best of a few drawn, by the key ``tournament``.

    A subclass has an ``_order``, and at most one mark, the worth of an individual within its rank.
    """

    Keys = DistinctKeys

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        usual = DistinctKeys.model_fields["tournament"].default
        if keys.tournament <= max(population, usual):
            return []
        found = f"{keys.tournament}, of {population} individuals"
        return [("search.tournament", found, f"{population} or less")]

    def survivors(self, candidates: Living, look: Look, rng: Rng) -> list[Individual]:
        candidates = sorted(candidates, key=lambda one: one.id)
        if not candidates:
            return []
        best = self._best_first(*losses_and_violations(candidates), rng)
        wanted = round(self.keys.distinct * self.size)
        keep = np.array([not candidates[i].violation for i in best], bool)
        niches = self.keys.per_plan or self.keys.source_plans
        if wanted and np.count_nonzero(keep) > self.size:
            eligible, broken = best[keep], best[~keep]
            looks = [look(candidates[i]) for i in eligible]
            best = eligible[self._distinct_first(looks, wanted)]
            # a plan of a source city may live in individuals that break constraints
            if niches:
                best = np.concatenate([best, broken])
        if niches:
            ordered = [candidates[i] for i in best]
            looks = [look(one) for one in ordered] if wanted else None
            limits = self.keys.per_plan, self.keys.source_plans
            best = best[choose_by_plan(ordered, self.size, *limits, looks)]
        return self.judged([candidates[i] for i in best[: self.size]])

    def judged(self, living: Living) -> list[Individual]:
        living = sorted(living, key=lambda one: one.id)
        if not living:
            return []
        order = self._order(*losses_and_violations(living))
        return [
            replace(
                living[i],
                rank=int(order.ranks[i]),
                marks=dict.fromkeys(self.marks, float(order.worth[i])),
            )
            for i in order.best_first
        ]

    def parents(self, living: Living, count: int, rng: Rng) -> list[int]:
        def key(at: int) -> tuple:
            one = living[at]
            worth = (-one.marks[mark] for mark in self.marks)
            return one.rank, *worth, one.violation, one.id

        groups = None
        if self.keys.source_plans:  # cities without keepers of the constraints breed, too
            kept = {source_of(one) for one in living if not one.violation}
            groups = [None if source_of(one) in kept else source_of(one) for one in living]
        return tournament(len(living), key, count, rng, self.keys.tournament, groups)

    def _best_first(self, losses: np.ndarray, violations: np.ndarray, rng: Rng) -> np.ndarray:
        """Order the candidates to live; by default as `_order` does."""
        return self._order(losses, violations).best_first

    def _distinct_first(self, looks: Sequence[np.ndarray], count: int) -> np.ndarray:
        """Indices of all ``looks``, given best first: those of ``count`` that differ come first."""
        return distinct_first(looks, self.keys.apart, count)

    @abstractmethod
    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        """Order individuals that are sorted by id; of two with equal worth the first is better."""


def losses_and_violations(individuals: Living) -> tuple[np.ndarray, np.ndarray]:
    """Collect the losses ``(n, m)`` and the violations of the constraints ``(n,)``."""
    losses = np.array([one.losses for one in individuals], np.float64)
    return losses, np.array([one.violation for one in individuals], np.float64)


def tournament(
    size: int,
    key: Callable[[int], tuple],
    count: int,
    rng: Rng,
    drawn: int = 2,
    groups: Sequence[object] | None = None,
) -> list[int]:
    """Select ``count`` of ``size`` indices, each the least by ``key`` of so many ``drawn``, without
    repeats while possible. With ``groups``, a name for each index, all that are drawn for one
    choice come from the group of the first."""
    chosen: list[int] = []
    used: list[int] = []  # sorted
    for _ in range(count):
        if len(used) == size:
            used = []
        left = size - len(used)
        if groups is None:
            rivals = [_unused(int(rng.integers(left)), used) for _ in range(drawn)]
        else:
            first = _unused(int(rng.integers(left)), used)
            others = [at for at in range(size) if groups[at] == groups[first] and at not in used]
            more = (others[int(rng.integers(len(others)))] for _ in range(drawn - 1))
            rivals = [first, *more]
        best = min(rivals, key=key)
        chosen.append(best)
        insort(used, best)
    return chosen


def _unused(number: int, used: Sequence[int]) -> int:
    """Return the index with a ``number`` among those that are not ``used``."""
    for index in used:
        number += index <= number
    return number
