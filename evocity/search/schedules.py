"""Schedules of births: whole generations, or a steady state in an ordered window.

In a window of w births, workers never wait for the last birth of a generation. Births are admitted
one at a time, in the order of their ids. Once birth k is admitted, birth k + w is planned from
those who live then: its parents are at least w births older, and w births are under way. The first
w are founders, as all of generation 0 are. The result depends neither on the number of workers nor
on which of them is done first.

`ReplayCheck` replays a few births while the search goes on, and compares them.
"""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from copy import deepcopy
from dataclasses import replace

import numpy as np

from evocity.evaluation import Engine
from evocity.search.breeding.archipelago import Archipelago, Tell
from evocity.search.breeding.birth_plans import BirthPlan, Guidance, birth_generator
from evocity.search.breeding.births import LOST, Offspring, stream_offspring
from evocity.search.preparation.preparation import Prepared
from evocity.search.record.complete_run import DIFFERS, differences, json_differences
from evocity.search.resume.logged_plans import PastState
from evocity.store import Birth, RunLog

#: The share of births that is replayed.
RATE = 0.001
# Births whose mean says how long an operator takes.
_OF_LATE = 16


class WholeGenerations:
    """The births of a search whose ``population`` is replaced a generation at a time; the
    ``engine`` breeds and evaluates them."""

    def __init__(self, prepared: Prepared, population: Archipelago, engine: Engine):
        self._aims, self._population, self._engine = prepared.aims, population, engine
        self._check = ReplayCheck(prepared, population.event)

    def births(self, generation: int, guidance: Guidance) -> list[Birth]:
        """Breed a ``generation`` and select who lives on; return its births by id."""
        plans = self._population.plans(generation, guidance)
        return self.select(self._check.breed_and_evaluate(self._engine, plans), generation)

    def plans(self, generation: int, guidance: Guidance) -> list[BirthPlan]:
        """Plan a ``generation`` that is measured elsewhere, without refinements."""
        return self._population.plans(generation, guidance, refined=False)

    def select(self, offspring: Sequence[Offspring], generation: int) -> list[Birth]:
        """Select who lives on, of the living and the ``offspring``; return these as births."""
        births = [child.birth(generation, self._aims) for child in offspring]
        looks = {child.plan.id: child.look for child in offspring if child.look is not None}
        self._population.select(births, generation, looks)
        return births

    def close(self) -> None:
        """Do nothing: no birth is under way between two generations."""


class SteadyState:
    """The births of a search whose ``population`` changes with each of them; the ``engine`` breeds
    and evaluates them. A generation is a block of as many births as the population has.

    All of generation 0 is bred before the first admission: losses are compared with all of it.
    """

    def __init__(self, prepared: Prepared, population: Archipelago, engine: Engine):
        run, self._window = prepared.recipe.run, prepared.recipe.search.window
        self._size, self._end = run.population, (run.generations + 1) * run.population
        self._aims, self.population, self._island = prepared.aims, population, population.single
        self._plans: deque[BirthPlan] = deque()  # not yet under way
        self._planned = 0  # the id after the last plan's
        self._early: dict[int, Offspring] = {}  # done before one of lower id
        self._done = ReplayCheck(prepared, population.event).stream(engine, self._next_plans())

    def births(self, generation: int, guidance: Guidance) -> list[Birth]:
        """Breed a ``generation`` and admit each birth after the one before it; return them by id.
        The ``guidance`` counts for the births planned meanwhile: from w after its first on."""
        first = generation * self._size
        if generation == 0:
            self._plans.extend(self.population.plans(0, guidance))
            self._plan_from(self._size)
        offspring = map(self._wait_for, range(first, first + self._size))
        if generation == 0:
            offspring = list(offspring)
            self.population.begin_with([child.birth(0, self._aims) for child in offspring])
        births = []
        for child in offspring:
            birth = child.birth(generation, self._aims)
            self._island.admit_birth(birth, {} if child.look is None else {birth.id: child.look})
            self._plan_after(birth.id, guidance)
            births.append(birth)
        self._island.learn(births)
        if first + self._size == self._end:  # replays may still be under way
            for _ in self._done:
                pass
        return births

    @classmethod
    def resume(
        cls, run: RunLog, prepared: Prepared, generation: int, engine: Engine, event: Tell
    ) -> "SteadyState":
        """Go on with a ``generation`` after the first of a logged ``run``: admit its last w births
        again, so that the births under way are planned. ``event`` is called with later events."""
        size, window = prepared.recipe.run.population, prepared.recipe.search.window
        first = max(0, generation * size - window) // size
        past = PastState.of(run, prepared, first)
        steady = cls(prepared, past.population(prepared, event), engine)
        steady._plan_from(generation * size)
        for number in range(first, generation):
            past = PastState.of(run, prepared, number)
            steady.population.reweigh(past.orders.weights)
            for birth in past.births():
                steady._island.admit_birth(birth)
                steady._plan_after(birth.id, past.guidance)
        return steady

    def close(self) -> None:
        """Abandon the births under way."""
        self._done.close()

    def _wait_for(self, identifier: int) -> Offspring:
        while identifier not in self._early:
            child = next(self._done)
            self._early[child.plan.id] = child
        return self._early.pop(identifier)

    def _plan_from(self, identifier: int) -> None:
        """Plan from this id on; first the founders, which have no birth w before them."""
        self._planned = identifier
        while self._planned < min(self._window, self._end):
            self._plans.append(self._island.founder_plan(self._planned))
            self._planned += 1

    def _plan_after(self, identifier: int, guidance: Guidance) -> None:
        """Plan the birth that waits for the admission of this one, unless it is planned."""
        if identifier + self._window == self._planned < self._end:
            self._plans.append(self._island.plan(self._planned, guidance))
            self._planned += 1

    def _next_plans(self) -> Iterator[BirthPlan | None]:
        while self._plans or self._planned < self._end:
            yield self._plans.popleft() if self._plans else None


class ReplayCheck:
    """Carries out the plans of a search, some of them twice. It calls ``event`` with `DIFFERS` for
    pairs that differ. A pair of which one hung or died is not compared."""

    def __init__(self, prepared: Prepared, event: Callable[..., None]):
        recipe, self._aims, self._event = prepared.recipe, prepared.aims, event
        self._seed, self._size = recipe.run.seed, recipe.generation_size
        self._chosen: tuple[int, frozenset[int]] = -1, frozenset()
        self._twins: dict[int, BirthPlan] = {}
        self._pairs: dict[int, dict[bool, Offspring]] = {}  # id -> the birth (False), its twin
        self._seconds: dict[str, float] = {}  # operator -> seconds of a birth

    def stream(self, engine: Engine, plans: Iterator[BirthPlan | None]) -> Iterator[Offspring]:
        """Do as `evocity.search.breeding.births.stream_offspring`, and keep the twins."""
        for child in stream_offspring(engine, self._with_twins(plans)):
            is_twin = self._twins.get(child.plan.id) is child.plan.first
            if child.plan.id in self._twins:
                self._compare(child, is_twin)
            if not is_twin:
                yield child

    def breed_and_evaluate(self, engine: Engine, plans: list[BirthPlan]) -> list[Offspring]:
        """Breed and evaluate all ``plans``, and keep the twins; the result has their order. Workers
        begin with the births that probably take longest, so that none waits long for the last."""
        order = plans if engine.size < 2 else sorted(plans, key=self._expected_seconds)
        done = {}
        for child in self.stream(engine, iter(order)):
            done[child.plan.id] = child
            self._learn_seconds(child)
            if child.breeding.genome is not None:
                _ = child.breeding.genome.digest  # selection needs it while all workers wait
        return [done[plan.id] for plan in plans]

    def _expected_seconds(self, plan: BirthPlan) -> float:
        """Return the seconds that births of the operator took of late, times −1."""
        return -self._seconds.get(plan.name, 0.0)

    def _learn_seconds(self, child: Offspring) -> None:
        seconds = (child.evaluation or child.breeding).seconds
        known = self._seconds.get(child.plan.name, seconds)
        self._seconds[child.plan.name] = known + (seconds - known) / _OF_LATE

    def is_chosen(self, identifier: int) -> bool:
        """Whether a birth is replayed: a generator of its generation decides."""
        generation, slot = divmod(identifier, self._size)
        if self._chosen[0] != generation:
            rng = birth_generator(self._seed, generation, 0, 1)
            drawn = rng.random(self._size)
            self._chosen = generation, frozenset(np.flatnonzero(drawn < RATE).tolist())
        return slot in self._chosen[1]

    def _with_twins(self, plans: Iterator[BirthPlan | None]) -> Iterator[BirthPlan | None]:
        for plan in plans:
            if plan is None or not self.is_chosen(plan.id):
                yield plan
                continue
            twin = replace(plan, rng=deepcopy(plan.rng))  # before the first draws from it
            self._twins[plan.id] = twin
            yield plan
            yield twin

    def _compare(self, child: Offspring, is_twin: bool) -> None:
        pair = self._pairs.setdefault(child.plan.id, {})
        pair[is_twin] = child
        if len(pair) < 2:
            return
        del self._pairs[child.plan.id], self._twins[child.plan.id]
        generation = child.plan.id // self._size
        then, now = (pair[twin].birth(generation, self._aims) for twin in (False, True))
        if {then.status, now.status}.isdisjoint(LOST) and (found := differences(then, now)):
            differs = json_differences(found)
            self._event(DIFFERS, generation=generation, id=then.id, differs=differs)
