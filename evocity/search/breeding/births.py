"""Births: plans carried out by an engine, bred and measured in one job each, or only bred."""

import math
from collections import deque
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from numbers import Real

import numpy as np

from evocity.errors import RunError, spell
from evocity.evaluation import Engine
from evocity.evaluation.evaluator import Outcome, unrecorded
from evocity.fitness import Aims
from evocity.search.breeding.birth_plans import BirthPlan
from evocity.search.preparation.preparation import Prepared
from evocity.store import Birth

#: Statuses of births whose worker may have ended before it returned the child.
LOST = ("timeout", "died", "memory")
_END = object()


@dataclass(frozen=True)
class Offspring:
    """A plan carried out: the outcome of its ``breeding``, with a genome unless that failed, and of
    its ``evaluation``; None before it, and where nothing can be evaluated."""

    plan: BirthPlan
    breeding: Outcome
    evaluation: Outcome | None = None

    @property
    def look(self) -> np.ndarray | None:
        """The thumbprint of its map, if the engine made one."""
        return None if self.evaluation is None else self.evaluation.look

    def birth(self, generation: int, aims: Aims) -> Birth:
        """Return its row in the log."""
        ended = self.evaluation or self.breeding
        genome = self.breeding.genome
        made = (dict(genome.made) if genome is not None else {}) or self.plan.made
        if rejected := self.plan.rejected:
            made = {**made, "redrawn": rejected}
            genome = None if genome is None else genome.replace(made=made)
        return Birth(
            generation=generation,
            id=self.plan.id,
            parents=self.plan.parents,
            operator=self.plan.name,
            status=ended.status,
            error=ended.error if self.evaluation else f"{self.plan.name}: {ended.error}",
            seconds=self.breeding.seconds + (self.evaluation.seconds if self.evaluation else 0.0),
            values=ended.values,
            feasible=ended.status == "ok" and not aims.violation(ended.values),
            genome=genome,
            made=made,
            island=self.plan.island,
            reconstruction=self.plan.reconstruction,
            thumbnail=self.evaluation.thumbnail if self.evaluation else None,
        )


def breed_plans(engine: Engine, plans: Sequence[BirthPlan]) -> list[Offspring]:
    """Breed all ``plans`` without evaluating the children. A child that equals a parent is replaced
    by that of the plan's ``redraw``."""
    jobs = [(plan.operator, plan.genomes, plan.rng) for plan in plans if plan.operator]
    outcomes = iter(engine.run("breed", jobs))
    offspring = [
        Offspring(plan, next(outcomes) if plan.operator else Outcome("ok", genome=plan.genomes[0]))
        for plan in plans
    ]
    redrawn = {at: _redrawn(child.plan, child.breeding) for at, child in enumerate(offspring)}
    redrawn = {at: plan for at, plan in redrawn.items() if plan is not None}
    if redrawn:
        for at, child in zip(redrawn, breed_plans(engine, [*redrawn.values()]), strict=True):
            offspring[at] = child
    return offspring


def stream_offspring(engine: Engine, plans: Iterator[BirthPlan | None]) -> Iterator[Offspring]:
    """Breed and evaluate ``plans``, one job each, and yield each individual when it is done. After
    a None in ``plans``, the next plan is taken once another individual is done. The lost child of a
    worker that hung or died is bred again, by the same draws, so that the log has its genome. A
    child that equals a parent is replaced by that of the plan's ``redraw``."""
    waiting: deque[tuple[BirthPlan, Outcome | None]] = deque()  # to be bred again
    given: dict[int, tuple[BirthPlan, Outcome | None]] = {}
    numbers = count()

    def jobs() -> Iterator[tuple | None]:
        ended = False
        while given or waiting or not ended:
            plan, lost = waiting.popleft() if waiting else (None, None)
            if plan is None and not ended:
                plan = next(plans, _END)
                ended = plan is _END
            if plan is None or plan is _END:
                if given or not ended:  # a job under way may be lost
                    yield None
                continue
            given[next(numbers)] = plan, lost
            yield plan.operator, plan.genomes, plan.rng, lost is None

    for number, outcome in engine.stream("born", jobs()):
        plan, lost = given.pop(number)
        if (other := _redrawn(plan, outcome)) is not None:
            waiting.append((other, None))
        elif lost is None and _is_lost(plan, outcome):
            waiting.append((plan, outcome))
        else:
            yield _offspring(plan, outcome, lost)


def _offspring(plan: BirthPlan, outcome: Outcome, lost: Outcome | None) -> Offspring:
    """If the child was ``lost``, ``outcome`` is that of its second breeding; unless this failed
    too, the child keeps the status and the seconds of the first."""
    if plan.operator is None:
        return Offspring(plan, Outcome("ok", genome=plan.genomes[0]), outcome)
    if outcome.genome is None:
        return Offspring(plan, outcome)
    return Offspring(plan, Outcome("ok", genome=outcome.genome), lost or outcome)


def _redrawn(plan: BirthPlan, outcome: Outcome) -> BirthPlan | None:
    """Draw the plan that replaces one whose child equals a parent; None if the child stays."""
    if plan.operator is None or plan.redraw is None or outcome.genome is None:
        return None
    return plan.redraw(plan) if plan.equals_parent(outcome.genome) else None


def _is_lost(plan: BirthPlan, outcome: Outcome) -> bool:
    """An operator that measures while it breeds would take as long again: it is not repeated."""
    repeatable = bool(plan.operator) and not hasattr(plan.operator, "bred_within")
    return repeatable and outcome.genome is None and outcome.status in LOST


def without_failed(offspring: Sequence[Offspring]) -> list[Offspring]:
    """Return the ``offspring`` whose breeding succeeded."""
    return [child for child in offspring if child.breeding.genome is not None]


def add_results(
    offspring: Sequence[Offspring], results: Sequence, prepared: Prepared
) -> list[Offspring]:
    """Return all ``offspring`` with the ``results`` of those `without_failed`, in their order.
    Raises `RunError` for a wrong result, see `outcome_of`, or a wrong number of them."""
    header, bounds = prepared.header, prepared.aims.bounds
    living = without_failed(offspring)
    if len(results) != len(living):
        raise RunError(
            f"tell() received {len(results)} results for {len(living)} genomes",
            "one result for each genome, in the order in which ask() returned the genomes",
            "pass an exception as the result of a genome that could not be evaluated",
        )
    outcomes = {
        child.plan.id: outcome_of(result, header.measures, header.recorded, bounds)
        for child, result in zip(living, results, strict=True)
    }
    return [replace(child, evaluation=outcomes.get(child.plan.id)) for child in offspring]


def outcome_of(
    result,
    measures: Sequence[str],
    recorded: Sequence[str] = (),
    bounds: Collection[str] = (),
) -> Outcome:
    """Check a ``result`` of an evaluation elsewhere: an exception, or values of all ``measures``
    and any ``recorded`` ones. NaN breaks ``bounds``. Raises `RunError` for anything else."""
    if isinstance(result, Outcome):
        return result
    if isinstance(result, Exception):
        return Outcome("error", f"{type(result).__name__}: {result}")
    if not isinstance(result, Mapping) or set(result) - set(recorded) != set(measures):
        found = f"values of {', '.join(result)}" if isinstance(result, Mapping) else repr(result)
        besides = f", with values of {', '.join(recorded)} if they are known" if recorded else ""
        raise RunError(
            f"tell() received a result with {found}",
            f"an exception, or a value of each measure: {', '.join(measures)}{besides}",
            "pass an exception or a mapping from measures to values for each genome",
        )
    values, wrong = {}, []
    for name in (name for name in (*measures, *recorded) if name in result):
        number = _to_float(result[name]) if isinstance(result[name], Real) else None
        finite = number is not None and math.isfinite(number)
        if not finite:
            wrong.append(name)
        if finite or (number is not None and name in measures):
            values[name] = number
    broken = [name for name in bounds if math.isnan(values.get(name, 0.0))]
    for name in broken:
        del values[name]
    failed = [name for name in wrong if name in measures and name not in broken]
    error = ", ".join(f"{name} is {spell(result[name])}" for name in failed)
    if not failed and wrong:
        error = unrecorded([f"{name} is {spell(result[name])}" for name in wrong])
    return Outcome("invalid" if failed else "ok", error or None, values=values)


def _to_float(value: Real) -> float:
    """Infinity stands for an integer or fraction beyond all floats."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
