"""The climb of a refinement: NLopt proposes parameters, children are bred, measured and scored."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evocity.coding.optimiser import Enough, minimise
from evocity.errors import OperatorError
from evocity.evaluation.evaluator import Outcome
from evocity.fitness import Aims
from evocity.genome import Genome
from evocity.search.breeding.refinement.variables import Tuning
from evocity.search.record.aims import uncallable_measure

#: Children that are bred for each that is measured, at most: many points give the same child.
_BRED = 4
#: The most by which a broken constraint raises what the optimiser minimises.
_PENALTY = 20.0
#: By how much a failed child is worse than the worst of the others.
_FAILED = 10.0

#: Breeds a child: an operator, its parents, a generator.
Breed = Callable[[object, object, np.random.Generator], Outcome]
#: Measures a genome, bred from parents.
Measure = Callable[[Genome, object], Outcome]
#: Takes how many children were measured, and the best score so far.
Progress = Callable[[int, float], None]


@dataclass(frozen=True)
class Score:
    """The weighted sum of an individual's losses, each less its least (``lows``) and over its range
    (``ranges``) among a run's first births; lower is better. A broken constraint is worse than any
    sum."""

    aims: Aims
    lows: Sequence[float]
    ranges: Sequence[float]
    weights: Sequence[float]

    @classmethod
    def of(cls, aims: Aims, first: np.ndarray, weights: Sequence[float] | None = None) -> "Score":
        """Create it from the losses of the ``first`` births, ``(n, goals)``, n ≥ 1. A goal with one
        value among them has the range 1."""
        lows, highs = first.min(axis=0), first.max(axis=0)
        ranges = np.where(highs > lows, highs - lows, 1.0)
        weights = np.ones(len(lows)) if weights is None else np.asarray(weights, float)
        return cls(_without_functions(aims), *(tuple(a.tolist()) for a in (lows, ranges, weights)))

    def __call__(self, values: Mapping[str, float]) -> tuple[float, float]:
        """Return how far raw ``values`` break the constraints, 0 if they keep them, and the sum."""
        losses = self.aims.losses(values)
        parts = zip(losses, self.lows, self.ranges, self.weights, strict=True)
        total = sum(weight * (loss - low) / unit for loss, low, unit, weight in parts)
        return self.aims.violation(values), float(total)


def _without_functions(aims: Aims) -> Aims:
    """The ``aims`` for another process, which may lack the user's own measures."""
    wanted = []
    for one in aims.wanted:
        measure = uncallable_measure(one.measure.name)
        parts = {
            key: replace(part, measure=measure)
            for key, part in (("objective", one.objective), ("constraint", one.constraint))
            if part is not None
        }
        wanted.append(replace(one, measure=measure, **parts))
    return Aims(tuple(wanted))


@dataclass(frozen=True)
class ClimbResult:
    """The best ``genome``, its ``values`` and its ``score`` (violation, sum). Of the ``bred``
    children, equal ones are measured once (``evaluations``); ``error`` is that of the first of the
    ``failures``. ``better``: whether the best is a child."""

    genome: Genome
    values: Mapping[str, float]
    score: tuple[float, float]
    evaluations: int
    failures: int
    error: str | None
    better: bool
    bred: int = 0


def climb(
    genome: Genome,
    values: Mapping[str, float],
    tuning: Tuning,
    score: Score,
    breed: Breed,
    measure: Measure,
    budget: int,
    algorithm: str,
    tell: Progress | None = None,
) -> ClimbResult:
    """Find the best of a ``genome`` with these ``values`` and of the children of its ``tuning``, in
    ``budget`` evaluations at most. Passes on what ``breed``, ``measure`` and ``tell`` raise."""
    start = score(values)
    best, evaluated, failures, bred = (start, genome, values), 0, 0, 0
    error: str | None = None
    known = {genome.digest: start[1] + _penalty(start[0])}
    worst = known[genome.digest]

    def objective(point: np.ndarray, _) -> float:
        nonlocal best, evaluated, failures, bred, error, worst
        if evaluated == budget or bred == _BRED * budget:
            raise Enough
        bred += 1
        outcome = _breed_child(breed, tuning, point)
        child = outcome.genome
        if child is not None and child.digest in known:
            return known[child.digest]
        evaluated += 1
        if child is not None:
            outcome = measure(child, tuning.parents)
        if outcome.status != "ok":
            failures += 1
            error = error or outcome.error or outcome.status
            value = worst + _FAILED
        else:
            scored = score(outcome.values)
            value = scored[1]
            if scored[0]:  # no better than the start, and worse the more it breaks
                value = max(value, start[1]) + _penalty(scored[0])
            if scored < best[0]:
                best = scored, child, outcome.values
            worst = max(worst, value)
        if child is not None:
            known[child.digest] = value
        if tell is not None:
            tell(evaluated, best[0][1])
        return value

    ends = {"lower": tuning.lower, "upper": tuning.upper, "step": tuning.step}
    most = _BRED * budget + 1
    minimise(objective, tuning.start, algorithm=algorithm, most=most, **ends)
    scored, child, measured = best
    better = child is not genome
    return ClimbResult(child, measured, scored, evaluated, failures, error, better, bred)


def _breed_child(breed: Breed, tuning: Tuning, point: np.ndarray) -> Outcome:
    """Parameters that do not go together make a child that failed."""
    try:
        operator = tuning.operator(point)
    except OperatorError as error:
        return Outcome("error", str(error))
    return breed(operator, tuning.parents, tuning.generator)


def _penalty(violation: float) -> float:
    """It grows with the violation up to `_PENALTY`, which undefined values have."""
    return _PENALTY * violation / (1 + violation) if violation < 1e300 else _PENALTY


def round_score(number: float) -> float | None:
    """Round a score for ``made``; None if it is not finite, which JSON cannot hold."""
    return round(number, 6) if math.isfinite(number) else None
