"""MO-CMA-ES on a λ-field (Voss, Hansen & Igel 2010): the search learns how values go together."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from pydantic import Field

from evocity.search.algorithms.algorithm import Algorithm, Look, tournament
from evocity.search.fronts import Scale, crowding_of, ranks_of
from evocity.search.individual import Individual
from evocity.search.values import Section

if TYPE_CHECKING:
    from evocity.search.borrowed import deap

#: Of so many losses, contributions of so many individuals are measured at most: anew for each
#: that is dropped, so for fewer than `HypervolumeContribution` measures them. Crowding stands for
#: them beyond.
MOST = {1: 10_000, 2: 1000, 3: 300, 4: 100, 5: 50}
#: Values that a field may have, all parents together.
MOST_VALUES = 256
# Losses are below that; those who break a constraint are beyond.
_BEYOND = 1e30
_NOBODY = -1


class CmaKeys(Section):
    """``side``: values along each side of the λ-field, for each parent but the first; ``step``: how
    far offspring lie from their parents at first, values being 0…1."""

    side: int = Field(5, ge=1, le=16)
    step: float = Field(0.2, gt=0, le=1)


class Cma(Algorithm):
    """Whoever lives is a λ-field between the recipe's parents (`evocity.operators.LambdaField`),
    with a step and a covariance matrix of its own, and has one child in each generation, drawn by
    these. The best of both live; of a front that does not fit, whoever adds least to the
    hypervolume is dropped first.

    The operators of the recipe do not breed. Whoever breaks a constraint comes after all that do
    not. Steps and matrices come of the whole run: it is gone through again when taken up again.
    """

    name = "cma"
    marks = ("step",)
    breeds_by = "lambda_field"
    replays = True
    Keys = CmaKeys

    def __init__(self, size: int, keys: Section | None = None):
        super().__init__(size, keys)
        self._fields: np.ndarray | None = None  # of the births asked for last
        self._first = self._sources = 0
        self._strategy: deap.Covariances | None = None
        self._ids: list[int] = []  # of those who live, in the strategy's order
        self._steps: dict[int, float] = {}

    @classmethod
    def faults(
        cls, keys: Section, goals: int, population: int, parents: int = 2
    ) -> list[tuple[str, str, str]]:
        if parents < 2:
            return [("parents", "1 of them, for a λ-field between several", "2 or more")]
        count = (parents - 1) * keys.side**2
        if count > MOST_VALUES:
            most = int((MOST_VALUES / (parents - 1)) ** 0.5)
            found = f"{keys.side}, which makes {count} values for {parents} parents"
            return [("search.side", found, f"{most} or less")]
        return []

    def settings(
        self, first: int, sources: int, rng: np.random.Generator
    ) -> list[Mapping[str, object]]:
        self._first, self._sources = first, sources
        if self._strategy is None:
            fields = rng.random((self.size, (sources - 1) * self.keys.side**2))
            fields[0] = 0  # the first source itself
            self._fields = fields
        else:
            self._fields = self._strategy.offspring(rng)
        return [{"side": self.keys.side, "values": one.tolist()} for one in self._fields]

    def survivors(
        self, candidates: Sequence[Individual], look: Look, rng: np.random.Generator
    ) -> list[Individual]:
        by_id = {one.id: one for one in candidates}
        ids = [self._first + slot for slot in range(self.size)]
        if self._strategy is None:  # the other sources are no fields
            ids[1 : self._sources] = [_NOBODY] * (self._sources - 1)
        goals = max((len(one.losses) for one in candidates), default=1)
        losses = np.array([_told(by_id.get(one), goals) for one in ids])
        if self._strategy is None:
            from evocity.search.borrowed import deap

            self._strategy = deap.Covariances(self._fields, losses, self.keys.step, _least)
            self._ids = ids
        else:
            both = self._ids + ids
            self._ids = [both[place] for place in self._strategy.select(losses)]
        self._steps = dict(zip(self._ids, self._strategy.steps.tolist(), strict=True))
        return self.judged([by_id[one] for one in self._ids if one in by_id])

    def judged(self, living: Sequence[Individual]) -> list[Individual]:
        living = sorted(living, key=lambda one: one.id)
        if not living:
            return []
        ranks = ranks_of(
            np.array([one.losses for one in living], np.float64),
            np.array([one.violation for one in living], np.float64),
        )
        told = [
            replace(one, rank=int(rank), marks={"step": self._steps.get(one.id, self.keys.step)})
            for one, rank in zip(living, ranks, strict=True)
        ]
        return sorted(told, key=lambda one: one.rank)

    def parents(
        self, living: Sequence[Individual], count: int, rng: np.random.Generator
    ) -> list[int]:
        return tournament(len(living), lambda at: (living[at].rank, living[at].id), count, rng)


def _told(one: Individual | None, goals: int) -> list[float]:
    """The losses of one who was born, who counts as worse than all others if it breaks a
    constraint; and as the worst of all if it failed."""
    if one is None:
        return [_BEYOND * 1e9] * goals
    if one.violation:
        return [_BEYOND * (1 + min(one.violation, 1e6))] * goals
    return [max(-_BEYOND, min(loss, _BEYOND)) for loss in one.losses]


def _least(losses: np.ndarray) -> int:
    """Who of a front is missed least."""
    from evocity.search.borrowed import moocore

    if len(losses) > MOST.get(losses.shape[1], 0):
        return int(crowding_of(losses, np.zeros(len(losses), int)).argmin())
    scale = Scale(losses)
    return int(moocore.contributions(scale(losses), scale.reference).argmin())
