"""From plans to births: bred and evaluated in one job each, or bred alone for those who evaluate
elsewhere."""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real

from evocity.errors import RunError, shown
from evocity.fitness import Aims
from evocity.search.breeding import Plan
from evocity.search.evaluation import Engine
from evocity.search.evaluator import Outcome, unrecorded
from evocity.store import Birth

#: How a birth ends whose worker may have taken the child with it.
_LOST = ("timeout", "died", "memory")


@dataclass(frozen=True)
class Born:
    """How one individual came about: ``bred`` tells of its breeding, with a genome unless that
    failed, ``evaluated`` of its evaluation; None until then, and where there is nothing to
    evaluate."""

    plan: Plan
    bred: Outcome
    evaluated: Outcome | None = None

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
        )


def bred(pool: Engine, plans: Sequence[Plan]) -> list[Born]:
    """All individuals of ``plans`` bred, none evaluated."""
    jobs = [(plan.operator, plan.genomes, plan.rng) for plan in plans if plan.operator]
    outcomes = iter(pool.run("breed", jobs))
    return [Born(plan, next(outcomes) if plan.operator else _founder(plan)) for plan in plans]


def born(pool: Engine, plans: Sequence[Plan]) -> list[Born]:
    """All individuals of ``plans`` bred and evaluated: one job each, which one deadline covers.

    A worker that hung or died took the child with it. It is bred again, by the same draws: so the
    log has its genome, and tells whether the operator or a measure was to blame.
    """
    jobs = [(plan.operator, plan.genomes, plan.rng) for plan in plans]
    outcomes = pool.run("born", jobs)
    lost = [
        at
        for at, (plan, one) in enumerate(zip(plans, outcomes, strict=True))
        if plan.operator and one.genome is None and one.status in _LOST and not _measures(plan)
    ]
    again = dict(zip(lost, pool.run("breed", [jobs[at] for at in lost]), strict=True))
    found = []
    for at, (plan, one) in enumerate(zip(plans, outcomes, strict=True)):
        first = again.get(at, one)
        if plan.operator is None:
            found.append(Born(plan, _founder(plan), one))
        elif first.genome is None:
            found.append(Born(plan, replace(first, seconds=one.seconds)))
        else:
            found.append(Born(plan, Outcome("ok", genome=first.genome), one))
    return found


def _measures(plan: Plan) -> bool:
    """Whether it measures while it breeds: to breed it again would take as long once more."""
    return hasattr(plan.operator, "bred_within")


def _founder(plan: Plan) -> Outcome:
    return Outcome("ok", genome=plan.genomes[0])


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
