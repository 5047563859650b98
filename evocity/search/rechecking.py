"""A run that replays one birth in a thousand by itself: so it notices measures that are not
deterministic.

A birth that is chosen gets a twin, bred and measured from the same plan by whoever is free, and
compared with it. A twin is no birth: it is not written, and changes nothing of the search.
"""

from collections.abc import Callable, Iterator
from copy import deepcopy
from dataclasses import replace

import numpy as np

from evocity.search.births import LOST, Born, coming
from evocity.search.breeding import Plan
from evocity.search.differing import DIFFERS, differences, told
from evocity.search.evaluation import Engine
from evocity.search.preparation import Prepared

#: The share of births that is replayed.
RATE = 0.001


class Rechecking:
    """The births of a search, of which some are replayed; ``event`` is told `DIFFERS` of those that
    are not the same: generation, id, and ``differs`` as `evocity.search.repeating.Replayed` has
    it. One that hung or died, the first time or the second, is not compared."""

    def __init__(self, prepared: Prepared, event: Callable[..., None]):
        self._run, self._aims, self._event = prepared.recipe.run, prepared.aims, event
        self._chosen: tuple[int, frozenset[int]] = -1, frozenset()
        self._twins: dict[int, Plan] = {}
        self._pairs: dict[int, dict[bool, Born]] = {}  # by id: the birth (False), its twin (True)

    def coming(self, engine: Engine, plans: Iterator[Plan | None]) -> Iterator[Born]:
        """As `evocity.search.births.coming`, twins left out."""
        for one in coming(engine, self._with_twins(plans)):
            twin = self._is_twin(one)
            if one.plan.id in self._twins:
                self._done(one)
            if not twin:
                yield one

    def born(self, engine: Engine, plans: list[Plan]) -> list[Born]:
        """As `evocity.search.births.born`, twins left out."""
        found = {one.plan.id: one for one in self.coming(engine, iter(plans))}
        return [found[plan.id] for plan in plans]

    def chosen(self, identifier: int) -> bool:
        """Whether a birth is replayed, which a generator of the generation's own decides: its key
        has three numbers, and ends otherwise than those of births that are let in."""
        generation, slot = divmod(identifier, self._run.population)
        if self._chosen[0] != generation:
            sequence = np.random.SeedSequence(self._run.seed, spawn_key=(generation, 0, 1))
            drawn = np.random.Generator(np.random.PCG64(sequence)).random(self._run.population)
            self._chosen = generation, frozenset(np.flatnonzero(drawn < RATE).tolist())
        return slot in self._chosen[1]

    def _with_twins(self, plans: Iterator[Plan | None]) -> Iterator[Plan | None]:
        for plan in plans:
            if plan is None or not self.chosen(plan.id):
                yield plan
                continue
            twin = replace(plan, rng=deepcopy(plan.rng))  # before the first draws from it
            self._twins[plan.id] = twin
            yield plan
            yield twin

    def _is_twin(self, one: Born) -> bool:
        return self._twins.get(one.plan.id) is one.plan

    def _done(self, one: Born) -> None:
        """One of a pair is done: it is kept until the other is, then they are compared."""
        pair = self._pairs.setdefault(one.plan.id, {})
        pair[self._is_twin(one)] = one
        if len(pair) < 2:
            return
        del self._pairs[one.plan.id], self._twins[one.plan.id]
        generation = one.plan.id // self._run.population
        then, now = (pair[twin].birth(generation, self._aims) for twin in (False, True))
        if {then.status, now.status}.isdisjoint(LOST) and (found := differences(then, now)):
            self._event(DIFFERS, generation=generation, id=then.id, differs=told(found))


__all__ = ["DIFFERS", "RATE", "Rechecking"]
