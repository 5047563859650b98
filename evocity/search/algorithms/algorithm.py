"""What an algorithm is asked, and what those have in common that rank the living."""

from abc import ABC, abstractmethod
from bisect import insort
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar

import numpy as np
from pydantic import Field

from evocity.search.individual import Individual
from evocity.search.looks import distinct_first
from evocity.search.values import Section

#: How the map of an individual looks, see `evocity.search.looks`.
Look = Callable[[Individual], np.ndarray]


@dataclass(frozen=True)
class First:
    """What a run began with: the ``losses`` (n, goals) of the first generation's births that were
    measured; of the ``sources`` among its births the values, measure -> number, as far as they
    have some; and the ``limits`` that measures declare, lowest and highest value."""

    losses: np.ndarray
    sources: Sequence[Mapping[str, float]] = ()
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)


class Algorithm(ABC):
    """How a search selects who lives on and who breeds. Losses: lower is better.

    What it decides depends on what it is given alone, in any order: a run that is taken up again
    hands it those who lived, to `judged`.

    name : what a recipe calls it.
    marks : the names of what it tells of each of the living besides its rank; columns of the
        run's membership.
    figures : the names of what it tells of all the living together, see `summary`.
    Keys : what a recipe may say of it under ``[search]``, a pydantic model.
    breeds_by : the operator that it breeds with by itself, of all the recipe's parents, see
        `settings`; None where the recipe's mixture breeds.
    replays : whether it must go through the whole run again when that is taken up again. It is then
        asked for the `settings` and the `survivors` of each generation, as it was.

    Parameters
    ----------
    size : so many are born in a generation, and most algorithms let so many live at most.
    keys : an instance of its ``Keys``.
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
    def faults(
        cls, keys: Section, goals: int, population: int, parents: int = 2
    ) -> list[tuple[str, str, str]]:
        """Faults (key, found, allowed) of a recipe with so many ``goals``, so large a
        ``population`` and so many ``parents`` that asks for it with these ``keys``."""
        return []

    @classmethod
    def described(cls, keys: Section) -> tuple[str, ...]:
        """Names of the measures that it needs of every birth besides the goals; those that a
        recipe neither wants nor records are recorded for it."""
        return ()

    def begin(self, first: First) -> None:  # noqa: B027
        """Told before all else what the run began with; the same when a run is taken up again, and
        again when goals are weighed anew. Raises `RecipeError` if it cannot begin with that."""

    def summary(self, living: Sequence[Individual]) -> dict[str, float]:
        """What it tells of all the ``living`` together, by the names of its ``figures``; logged
        with each generation as far as it is finite."""
        return {}

    def settings(
        self, first: int, sources: int, rng: np.random.Generator
    ) -> list[Mapping[str, object]]:
        """Parameters of the operator that it breeds with (``breeds_by``) of each birth of the next
        generation, of ids ``first``, ``first`` + 1, …, between so many ``sources``."""
        raise NotImplementedError(f"{self.name} does not breed by itself")

    @abstractmethod
    def survivors(
        self, candidates: Sequence[Individual], look: Look, rng: np.random.Generator
    ) -> list[Individual]:
        """Those who live on, best first, as `judged` tells of them. ``look`` is called of those
        whose map matters; what is drawn is drawn from ``rng``."""

    @abstractmethod
    def judged(self, living: Sequence[Individual]) -> list[Individual]:
        """All of the ``living``, best first, with their rank and marks."""

    def migrants(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[Individual]:
        """Those of the ``living``, given best first, that may live on another island too, ``count``
        at most: the best."""
        return list(living[:count])

    @abstractmethod
    def parents(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[int]:
        """Indices of ``count`` of the ``living`` that breed; all different while possible."""


@dataclass(frozen=True)
class Order:
    """Individuals in order: their indices ``(n,)``, best first; of each its rank, int ``(n,)``, and
    what it is worth within it, float ``(n,)``, the higher the better."""

    best_first: np.ndarray
    ranks: np.ndarray
    worth: np.ndarray


class DistinctKeys(Section):
    """``distinct``: so large a share of the living differ pairwise, by more than a storey in more
    than the share ``apart`` of the map's pixels."""

    distinct: float = Field(0.5, ge=0, le=1)
    apart: float = Field(0.25, ge=0, lt=1)


class Ranked(Algorithm):
    """(µ + λ) by a total order: the best live, and among them as many that differ as ``distinct``
    asks for, where there are so many that keep the constraints. Parents are the better of two
    drawn.

    A subclass has an ``_order``, and at most one mark, which tells what an individual is worth
    within its rank.
    """

    Keys = DistinctKeys

    def survivors(
        self, candidates: Sequence[Individual], look: Look, rng: np.random.Generator
    ) -> list[Individual]:
        candidates = sorted(candidates, key=lambda one: one.id)
        if not candidates:
            return []
        best = self._best_first(*_told(candidates), rng)
        wanted = round(self.keys.distinct * self.size)
        keep = np.array([not candidates[i].violation for i in best], bool)
        if wanted and np.count_nonzero(keep) > self.size:
            eligible = best[keep]
            looks = [look(candidates[i]) for i in eligible]
            best = eligible[distinct_first(looks, self.keys.apart, wanted)]
        return self.judged([candidates[i] for i in best[: self.size]])

    def judged(self, living: Sequence[Individual]) -> list[Individual]:
        living = sorted(living, key=lambda one: one.id)
        if not living:
            return []
        order = self._order(*_told(living))
        return [
            replace(
                living[i],
                rank=int(order.ranks[i]),
                marks=dict.fromkeys(self.marks, float(order.worth[i])),
            )
            for i in order.best_first
        ]

    def parents(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[int]:
        def key(at: int) -> tuple:
            one = living[at]
            return (one.rank, *(-one.marks[mark] for mark in self.marks), one.id)

        return tournament(len(living), key, count, rng)

    def _best_first(
        self, losses: np.ndarray, violations: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """The order in which candidates are chosen to live, if not that of the living."""
        return self._order(losses, violations).best_first

    @abstractmethod
    def _order(self, losses: np.ndarray, violations: np.ndarray) -> Order:
        """Of individuals by id: ``(n, m)`` losses, and ``(n,)`` how far each breaks the
        constraints. Of those worth the same the first is the better."""


def _told(individuals: Sequence[Individual]) -> tuple[np.ndarray, np.ndarray]:
    """Losses ``(n, m)``, and how far each breaks the constraints."""
    losses = np.array([one.losses for one in individuals], np.float64)
    return losses, np.array([one.violation for one in individuals], np.float64)


def tournament(
    size: int, key: Callable[[int], tuple], count: int, rng: np.random.Generator
) -> list[int]:
    """Indices of ``count`` of ``size`` individuals, each the one of two drawn whose ``key`` is
    less; all different while possible."""
    chosen: list[int] = []
    gone: list[int] = []  # in order
    for _ in range(count):
        if len(gone) == size:
            gone = []
        left = size - len(gone)
        two = int(rng.integers(left)), int(rng.integers(left))
        best = min((_left(one, gone) for one in two), key=key)
        chosen.append(best)
        insort(gone, best)
    return chosen


def _left(number: int, gone: Sequence[int]) -> int:
    """The individual of a ``number`` among those who are not ``gone``."""
    for one in gone:
        number += one <= number
    return number
