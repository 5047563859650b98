"""From plans to births: bred and evaluated in one job each, or bred alone for those who evaluate
elsewhere."""

import math
from collections import deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
from numbers import Real

import numpy as np

from evocity.errors import RunError, shown
from evocity.fitness import Aims
from evocity.search.breeding import Plan
from evocity.search.evaluation import Engine
from evocity.search.evaluator import Outcome, unrecorded
from evocity.store import Birth, Header

#: How a birth ends whose worker may have taken the child with it.
LOST = ("timeout", "died", "memory")
_END = object()


@dataclass(frozen=True)
class Born:
    """How one individual came about: ``bred`` tells of its breeding, with a genome unless that
    failed, ``evaluated`` of its evaluation; None until then, and where there is nothing to
    evaluate."""

    plan: Plan
    bred: Outcome
    evaluated: Outcome | None = None

    @property
    def look(self) -> np.ndarray | None:
        """How its map looks, as far as it is known."""
        return None if self.evaluated is None else self.evaluated.look

    def birth(self, generation: int, aims: Aims) -> Birth:
        """The row of the log."""
        ended = self.bred if self.evaluated is None else self.evaluated
        genome = self.bred.genome
        return Birth(
            generation=generation,
            id=self.plan.id,
            parents=self.plan.parents,
            operator=self.plan.name,
            status=ended.status,
            error=f"{self.plan.name}: {ended.error}" if self.evaluated is None else ended.error,
            seconds=self.bred.seconds + (self.evaluated.seconds if self.evaluated else 0.0),
            values=ended.values,
            feasible=ended.status == "ok" and not aims.violation(ended.values),
            genome=genome,
            made=(dict(genome.made) if genome is not None else {}) or self.plan.made,
            island=self.plan.island,
            again=self.plan.again,
            thumbnail=None if self.evaluated is None else self.evaluated.thumbnail,
        )


def bred(pool: Engine, plans: Sequence[Plan]) -> list[Born]:
    """All individuals of ``plans`` bred, none evaluated."""
    jobs = [(plan.operator, plan.genomes, plan.rng) for plan in plans if plan.operator]
    outcomes = iter(pool.run("breed", jobs))
    return [Born(plan, next(outcomes) if plan.operator else _founder(plan)) for plan in plans]


def born(pool: Engine, plans: Iterable[Plan]) -> list[Born]:
    """All individuals of ``plans`` bred and evaluated, in their order."""
    plans = list(plans)
    found = {one.plan.id: one for one in coming(pool, iter(plans))}
    return [found[plan.id] for plan in plans]


def coming(pool: Engine, plans: Iterator[Plan | None]) -> Iterator[Born]:
    """Individuals of ``plans`` as they come about, bred and evaluated: one job each, which one
    deadline covers. None is no plan: another is asked for after the next individual.

    A worker that hung or died took the child with it. It is bred again, by the same draws: so the
    log has its genome, and tells whether the operator or a measure was to blame.
    """
    waiting: deque[tuple[Plan, Outcome | None]] = deque()  # to be bred again
    given: dict[int, tuple[Plan, Outcome | None]] = {}
    numbers = count()

    def jobs() -> Iterator[tuple | None]:
        ended = False
        while given or waiting or not ended:
            plan, lost = waiting.popleft() if waiting else (None, None)
            if plan is None and not ended:
                plan = next(plans, _END)
                ended = plan is _END
            if plan is None or plan is _END:
                if given or not ended:  # one of those at work may be lost
                    yield None
                continue
            given[next(numbers)] = plan, lost
            yield plan.operator, plan.genomes, plan.rng, lost is None

    for number, outcome in pool.stream("born", jobs()):
        plan, lost = given.pop(number)
        if lost is None and _lost(plan, outcome):
            waiting.append((plan, outcome))
        else:
            yield _born(plan, outcome, lost)


def _born(plan: Plan, outcome: Outcome, lost: Outcome | None) -> Born:
    """The individual of a ``plan`` with its ``outcome``. If it was ``lost`` before, the outcome is
    that of its second breeding: one that fails again is told by how it failed then, time and
    all."""
    if plan.operator is None:
        return Born(plan, _founder(plan), outcome)
    if outcome.genome is None:
        return Born(plan, outcome)
    return Born(plan, Outcome("ok", genome=outcome.genome), outcome if lost is None else lost)


def _lost(plan: Plan, outcome: Outcome) -> bool:
    """Whether the child is gone, and can be had again; one that measures while it breeds would
    take as long once more."""
    measures = hasattr(plan.operator, "bred_within")
    return (
        bool(plan.operator) and outcome.genome is None and outcome.status in LOST and not measures
    )


def _founder(plan: Plan) -> Outcome:
    return Outcome("ok", genome=plan.genomes[0])


def to_evaluate(asked: Sequence[Born]) -> list[Born]:
    """Those who were bred."""
    return [one for one in asked if one.bred.genome is not None]


def with_results(
    asked: Sequence[Born], results: Sequence, header: Header, bounds: Collection[str]
) -> list[Born]:
    """All who were ``asked`` for, with what somebody told of those `to_evaluate`, in their order;
    ``header`` and ``bounds`` as `outcome_of` has them. Raises `RunError` for what is no result, and
    for fewer or more of them."""
    sought = to_evaluate(asked)
    if len(results) != len(sought):
        raise RunError(
            f"{len(results)} results for {len(sought)} genomes",
            "one result a genome, in the order ask() returned them",
            "give an exception for a genome that could not be evaluated",
        )
    told = [outcome_of(one, header.measures, header.recorded, bounds) for one in results]
    outcomes = dict(zip((one.plan.id for one in sought), told, strict=True))
    return [replace(one, evaluated=outcomes.get(one.plan.id)) for one in asked]


def outcome_of(
    result,
    measures: Sequence[str],
    recorded: Sequence[str] = (),
    bounds: Collection[str] = (),
) -> Outcome:
    """What somebody told of a genome they evaluated: of all ``measures``, and of those that are
    ``recorded`` besides as many as they like. ``bounds``: the measures that are constraints alone,
    broken where they are NaN. Raises `RunError` for what is no result."""
    if isinstance(result, Outcome):
        return result
    if isinstance(result, Exception):
        return Outcome("error", f"{type(result).__name__}: {result}")
    if not isinstance(result, Mapping) or set(result) - set(recorded) != set(measures):
        found = f"values of {', '.join(result)}" if isinstance(result, Mapping) else repr(result)
        besides = f", and from those of {', '.join(recorded)} that are known" if recorded else ""
        raise RunError(
            f"a result with {found}",
            f"a mapping from each of {', '.join(measures)} to its value{besides}, or an exception",
            "tell one such result a genome",
        )
    values, wrong = {}, []
    for name in (one for one in (*measures, *recorded) if one in result):
        number = _number(result[name]) if isinstance(result[name], Real) else None
        finite = number is not None and math.isfinite(number)
        if not finite:
            wrong.append(name)
        if finite or (number is not None and name in measures):
            values[name] = number
    broken = [name for name in bounds if math.isnan(values.get(name, 0.0))]
    for name in broken:
        del values[name]
    failed = [name for name in wrong if name in measures and name not in broken]
    error = ", ".join(f"{name} is {shown(result[name])}" for name in failed)
    if not failed and wrong:
        error = unrecorded([f"{name} is {shown(result[name])}" for name in wrong])
    return Outcome("invalid" if failed else "ok", error or None, values=values)


def _number(value: Real) -> float:
    """``value`` as a float: infinite where it is beyond all floats."""
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf
