"""Steady state in an ordered window: workers never wait for the last birth of a generation.

Births are let in one at a time, in the order of their ids. Once birth k is in, birth k + w is
planned, of those who live then: so a birth has its parents among those at least w before it, and w
of them are at work. The first w are founders, as all of generation 0 are. Who is done first does
not matter, nor how many workers there are.
"""

from collections import deque
from collections.abc import Iterator

from evocity.search.archipelago import Archipelago, Tell
from evocity.search.births import Born
from evocity.search.breeding import Picks, Plan
from evocity.search.evaluation import Engine
from evocity.search.generational import Weights
from evocity.search.preparation import Prepared
from evocity.search.rechecking import Rechecking
from evocity.search.replaying import Then
from evocity.store import Birth, Run


class Steady:
    """The births of a search whose ``population`` changes with each of them; they are bred and
    evaluated by the ``engine``. A generation is a block of as many births as the population has.

    Generation 0 is whole before anybody is let in: with all of it losses are compared.
    """

    def __init__(self, prepared: Prepared, population: Archipelago, engine: Engine):
        run, self._window = prepared.recipe.run, prepared.recipe.search.window
        self._size, self._end = run.population, (run.generations + 1) * run.population
        self._aims, self.population = prepared.aims, population
        self._plans: deque[Plan] = deque()  # nobody is at work on them yet
        self._planned = 0  # the id after the last one planned
        self._early: dict[int, Born] = {}  # done before one of lower id is
        self._coming = Rechecking(prepared, population.event).coming(engine, self._given())

    def births(self, generation: int, picks: Picks, weights: Weights) -> list[Birth]:
        """The births of a ``generation``, by id, each let in after the one before it. ``picks`` and
        ``weights`` count for those that are planned meanwhile: from w after its first on."""
        first = generation * self._size
        if generation == 0:
            self._plans.extend(self.population.plans(0, picks, weights))
            self._plan_from(self._size)
        individuals = map(self._awaited, range(first, first + self._size))
        if generation == 0:
            individuals = list(individuals)
            self.population.begin_with([one.birth(0, self._aims) for one in individuals])
        births = []
        for one in individuals:
            birth = one.birth(generation, self._aims)
            looks = {} if one.look is None else {birth.id: one.look}
            self.population.let_in(birth, looks)
            self._plan_after(birth.id, picks, weights)
            births.append(birth)
        self.population.learn(births)
        if first + self._size == self._end:  # a birth's twin may still be at work
            for _ in self._coming:
                pass
        return births

    @classmethod
    def taken_up(
        cls, run: Run, prepared: Prepared, generation: int, engine: Engine, event: Tell
    ) -> "Steady":
        """Of a ``run`` that goes on with a ``generation``, not the first: the last w births of the
        log are let in once more, so that those are planned that were when the run ended. ``event``
        is told what happens from now on."""
        size, window = prepared.recipe.run.population, prepared.recipe.search.window
        first = max(0, generation * size - window) // size
        then = Then.of(run, prepared, first)
        found = cls(prepared, then.population(prepared, event), engine)
        found._plan_from(generation * size)
        for number in range(first, generation):
            then = Then.of(run, prepared, number)
            found.population.reweigh(then.standing.weights)
            for birth in then.births():
                found.population.let_in(birth)
                found._plan_after(birth.id, then.picks, [then.weights])
        return found

    def close(self) -> None:
        """Leave what is at work."""
        self._coming.close()

    def _awaited(self, identifier: int) -> Born:
        while identifier not in self._early:
            one = next(self._coming)
            self._early[one.plan.id] = one
        return self._early.pop(identifier)

    def _plan_from(self, identifier: int) -> None:
        """The births from this id on are to be planned: first those that nobody comes before by w
        or more."""
        self._planned = identifier
        while self._planned < min(self._window, self._end):
            self._plans.append(self.population.founder(self._planned))
            self._planned += 1

    def _plan_after(self, identifier: int, picks: Picks, weights: Weights) -> None:
        """The birth with this id is in: the one planned that waits for it, if it is not yet."""
        if identifier + self._window == self._planned < self._end:
            self._plans.append(self.population.plan(self._planned, picks, weights))
            self._planned += 1

    def _given(self) -> Iterator[Plan | None]:
        """All plans, as they are made."""
        while self._plans or self._planned < self._end:
            yield self._plans.popleft() if self._plans else None


__all__ = ["Steady"]
