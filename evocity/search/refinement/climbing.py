"""From numbers to the best child: NLopt asks, children are bred and measured."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from evocity.coding.optimising import Enough, minimise
from evocity.errors import OperatorError
from evocity.genome import Genome
from evocity.search.evaluator import Outcome
from evocity.search.refinement.score import Score
from evocity.search.refinement.tuning import Tuning

#: Children that are bred at most for each that is measured: many points give the same child.
_BRED = 4
#: By so much worse, at most, an optimiser is told that a broken constraint is.
_PENALTY = 20.0
#: And a child that failed, than the worst that did not.
_FAILED = 10.0

#: Breeds a child: an operator, its parents, a generator.
Breed = Callable[[object, object, np.random.Generator], Outcome]
#: Measures a genome, bred from parents.
Measure = Callable[[Genome, object], Outcome]
#: Told how many children are measured, and the best sum until then.
Tell = Callable[[int, float], None]


@dataclass(frozen=True)
class Climbed:
    """The best ``genome``, its ``values`` and its ``score`` (violation, sum); ``evaluations``:
    children that were measured, of which ``failures`` failed, the first of them with ``error``;
    ``bred``: those that were bred for it, of which equal ones are measured once. ``better``:
    whether it is another than the one that was to be refined."""

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
    tell: Tell | None = None,
) -> Climbed:
    """The best of a ``genome`` with these ``values`` and of the children of its ``tuning``, as far
    as ``budget`` evaluations find one; equal children are measured once.

    What ``breed``, ``measure`` and ``tell`` raise, Ctrl-C too, is raised here.
    """
    start = score(values)
    best, evaluated, failures, bred = (start, genome, values), 0, 0, 0
    error: str | None = None
    known = {genome.digest: start[1] + _penalty(start[0])}
    worst = known[genome.digest]

    def told(point: np.ndarray, _) -> float:
        nonlocal best, evaluated, failures, bred, error, worst
        if evaluated == budget or bred == _BRED * budget:
            raise Enough
        bred += 1
        outcome = _child(breed, tuning, point)
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
            found = score(outcome.values)
            value = found[1]
            if found[0]:  # no better than where it began, and worse the more it breaks
                value = max(value, start[1]) + _penalty(found[0])
            if found < best[0]:
                best = found, child, outcome.values
        if outcome.status == "ok":
            worst = max(worst, value)
        if child is not None:
            known[child.digest] = value
        if tell is not None:
            tell(evaluated, best[0][1])
        return value

    most = _BRED * budget + 1
    ends = {"lower": tuning.lower, "upper": tuning.upper, "step": tuning.step}
    minimise(told, tuning.start, algorithm=algorithm, most=most, **ends)
    found, child, measured = best
    better = child is not genome
    return Climbed(child, measured, found, evaluated, failures, error, better, bred)


def _child(breed: Breed, tuning: Tuning, point: np.ndarray) -> Outcome:
    """What is bred at a ``point``; parameters that do not go together make a child that failed."""
    try:
        operator = tuning.operator(point)
    except OperatorError as error:
        return Outcome("error", str(error))
    return breed(operator, tuning.parents, tuning.generator)


def _penalty(violation: float) -> float:
    """Grows with how far constraints are broken, and has an end: some are undefined."""
    return _PENALTY * violation / (1 + violation) if violation < 1e300 else _PENALTY


def rounded(number: float) -> float | None:
    """For ``made``, which JSON keeps; None for what is no number."""
    return round(number, 6) if math.isfinite(number) else None


__all__ = ["Climbed", "climb", "rounded"]
