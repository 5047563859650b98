"""The replay check of a search: one birth in a thousand, to find nondeterministic measures.

The twin of a chosen birth is bred and measured from the same plan by any free worker, and compared
with it. A twin is no birth: the log does not have it, and it changes nothing of the search.
"""

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace

import numpy as np

from evocity.evaluation import Engine
from evocity.search.breeding.births import LOST, Offspring, stream_offspring
from evocity.search.breeding.plans import Plan
from evocity.search.preparation.preparation import Prepared
from evocity.search.record.diff import DIFFERS, differences, json_differences

#: The share of births that is replayed.
RATE = 0.001


class ReplayCheck:
    """Carries out the plans of a search, some of them twice. It calls ``event`` with `DIFFERS` for
    those that differ: generation, id, and ``differs`` as in
    `evocity.search.resume.replay.Replayed`. A pair of which one hung or died is not compared."""

    def __init__(self, prepared: Prepared, event: Callable[..., None]):
        self._run, self._aims, self._event = prepared.recipe.run, prepared.aims, event
        self._chosen: tuple[int, frozenset[int]] = -1, frozenset()
        self._twins: dict[int, Plan] = {}
        self._pairs: dict[int, dict[bool, Offspring]] = {}  # id -> the birth (False), its twin

    def stream(self, engine: Engine, plans: Iterator[Plan | None]) -> Iterator[Offspring]:
        """Do as `evocity.search.breeding.births.stream_offspring`, and keep the twins."""
        for child in stream_offspring(engine, self._with_twins(plans)):
            is_twin = self._twins.get(child.plan.id) is child.plan
            if child.plan.id in self._twins:
                self._compare(child, is_twin)
            if not is_twin:
                yield child

    def breed_and_evaluate(self, engine: Engine, plans: list[Plan]) -> list[Offspring]:
        """Breed and evaluate all ``plans``, and keep the twins; the result has their order."""
        done = {child.plan.id: child for child in self.stream(engine, iter(plans))}
        return [done[plan.id] for plan in plans]

    def is_chosen(self, identifier: int) -> bool:
        """Whether a birth is replayed. A generator of the generation decides; its key has three
        numbers, and ends with 1 where that of an admission ends with 0."""
        generation, slot = divmod(identifier, self._run.population)
        if self._chosen[0] != generation:
            sequence = np.random.SeedSequence(self._run.seed, spawn_key=(generation, 0, 1))
            drawn = np.random.Generator(np.random.PCG64(sequence)).random(self._run.population)
            self._chosen = generation, frozenset(np.flatnonzero(drawn < RATE).tolist())
        return slot in self._chosen[1]

    def _with_twins(self, plans: Iterator[Plan | None]) -> Iterator[Plan | None]:
        for plan in plans:
            if plan is None or not self.is_chosen(plan.id):
                yield plan
                continue
            twin = replace(plan, rng=deepcopy(plan.rng))  # before the first draws from it
            self._twins[plan.id] = twin
            yield plan
            yield twin

    def _compare(self, child: Offspring, is_twin: bool) -> None:
        """Keep the first of a pair; compare the second with it."""
        pair = self._pairs.setdefault(child.plan.id, {})
        pair[is_twin] = child
        if len(pair) < 2:
            return
        del self._pairs[child.plan.id], self._twins[child.plan.id]
        generation = child.plan.id // self._run.population
        then, now = (pair[twin].birth(generation, self._aims) for twin in (False, True))
        if {then.status, now.status}.isdisjoint(LOST) and (found := differences(then, now)):
            differs = json_differences(found)
            self._event(DIFFERS, generation=generation, id=then.id, differs=differs)
