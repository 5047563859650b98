"""MO-CMA-ES on a λ-field (Voss, Hansen & Igel 2010): it learns the covariances of good fields."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from evocity.section import Fault, Section
from evocity.selection.algorithms.algorithm import (
    Algorithm,
    Living,
    Look,
    Rng,
    losses_and_violations,
    tournament,
)
from evocity.selection.fronts import Scale, crowding_of, ranks_of
from evocity.selection.individual import Individual

if TYPE_CHECKING:
    from evocity.selection.backends import deap

#: Number of losses -> the most individuals whose contributions are measured; larger fronts use
#: crowding distance. `HypervolumeContribution` measures more, as it measures less often.
MOST = {1: 10_000, 2: 1000, 3: 300, 4: 100, 5: 50}
#: The most values of a field, all parents together.
MOST_VALUES = 256
# The largest loss of those who keep all constraints; the others are beyond.
_BEYOND = 1e30
_NOBODY = -1


class CmaKeys(Section):
    """``side``: values along each side of the λ-field, for each parent except the first; ``step``:
    the initial distance of offspring from their parents, where values are 0…1."""

    side: int = Field(5, ge=1, le=16)
    step: float = Field(0.2, gt=0, le=1)


class Cma(Algorithm):
    """Each individual is a λ-field between the recipe's parents (`evocity.operators.LambdaField`)
    with its own step and covariance matrix. It has one child in each generation, drawn from these.
    The best of both live; the front that does not fit loses those first that add least to the
    hypervolume.

    The operators of the recipe do not breed. Those that break a constraint rank after all others.
    Steps and matrices depend on the whole run, so a resumed run replays it.
    """

    name = "cma"
    marks = ("step",)
    breeds_by = "lambda_field"
    replays = True
    Keys = CmaKeys

    def __init__(self, size: int, keys: Section | None = None):
        super().__init__(size, keys)
        self._fields: np.ndarray | None = None  # of the next generation
        self._first = self._sources = 0
        self._strategy: deap.Covariances | None = None
        self._ids: list[int] = []  # of those who live, in the strategy's order
        self._steps: dict[int, float] = {}

    @classmethod
    def faults(cls, keys: Section, goals: int, population: int, parents: int = 2) -> list[Fault]:
        if parents < 2:
            return [("parents", "1 parent, for a λ-field between several", "2 or more")]
        count = (parents - 1) * keys.side**2
        if count > MOST_VALUES:
            most = int((MOST_VALUES / (parents - 1)) ** 0.5)
            found = f"{keys.side}, which gives {count} values for {parents} parents"
            return [("search.side", found, f"{most} or less")]
        return []

    def settings(self, first: int, sources: int, rng: Rng) -> list[Mapping[str, object]]:
        self._first, self._sources = first, sources
        if self._strategy is None:
            fields = rng.random((self.size, (sources - 1) * self.keys.side**2))
            fields[0] = 0  # the first source itself
            self._fields = fields
        else:
            self._fields = self._strategy.offspring(rng)
        return [{"side": self.keys.side, "values": one.tolist()} for one in self._fields]

    def survivors(self, candidates: Living, look: Look, rng: Rng) -> list[Individual]:
        by_id = {one.id: one for one in candidates}
        ids = [self._first + slot for slot in range(self.size)]
        if self._strategy is None:  # the other sources are not fields
            ids[1 : self._sources] = [_NOBODY] * (self._sources - 1)
        goals = max((len(one.losses) for one in candidates), default=1)
        losses = np.array([_penalised(by_id.get(one), goals) for one in ids])
        if self._strategy is None:
            from evocity.selection.backends import deap

            self._strategy = deap.Covariances(self._fields, losses, self.keys.step, _least)
            self._ids = ids
        else:
            both = self._ids + ids
            self._ids = [both[place] for place in self._strategy.select(losses)]
        self._steps = dict(zip(self._ids, self._strategy.steps.tolist(), strict=True))
        return self.judged([by_id[one] for one in self._ids if one in by_id])

    def judged(self, living: Living) -> list[Individual]:
        living = sorted(living, key=lambda one: one.id)
        if not living:
            return []
        ranks = ranks_of(*losses_and_violations(living))
        ranked = [
            replace(one, rank=int(rank), marks={"step": self._steps.get(one.id, self.keys.step)})
            for one, rank in zip(living, ranks, strict=True)
        ]
        return sorted(ranked, key=lambda one: one.rank)

    def parents(self, living: Living, count: int, rng: Rng) -> list[int]:
        return tournament(len(living), lambda at: (living[at].rank, living[at].id), count, rng)


def _penalised(one: Individual | None, goals: int) -> list[float]:
    """Return the losses of a birth, worse if it breaks a constraint, and worst if it failed."""
    if one is None:
        return [_BEYOND * 1e9] * goals
    if one.violation:
        return [_BEYOND * (1 + min(one.violation, 1e6))] * goals
    return [max(-_BEYOND, min(loss, _BEYOND)) for loss in one.losses]


def _least(losses: np.ndarray) -> int:
    """Return the index of the individual that a front misses least."""
    from evocity.selection.backends import moocore

    if len(losses) > MOST.get(losses.shape[1], 0):
        return int(crowding_of(losses, np.zeros(len(losses), int)).argmin())
    scale = Scale(losses)
    return int(moocore.contributions(scale(losses), scale.reference).argmin())
