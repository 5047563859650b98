"""What measures cost: each alone, each on a map whose views are there, and all on one map."""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from evocity.authoring.watching import Case
from evocity.fitness.measure import Measure


@dataclass(frozen=True)
class Time:
    """Seconds of several repeats: the fewest, and the median."""

    least: float
    median: float


@dataclass(frozen=True)
class Cost:
    """What one call takes: ``alone``, on a map no other measure has seen, its views included;
    ``shared``, on a map whose views were computed before."""

    alone: Time
    shared: Time


def cost(measure: Measure, case: Case, repeats: int = 7) -> Cost:
    """What ``measure`` takes on ``case``, after one call that is not counted.

    Raises `FitnessError` as the measure does.
    """
    seen = case.fresh()
    seen.measured(measure)

    def with_views() -> Case:
        # a map of its own all the same: a function of several numbers keeps those of a map
        fresh = case.fresh()
        vars(fresh.city).update(vars(seen.city))
        return fresh

    return Cost(
        alone=_timed(lambda case: case.measured(measure), case.fresh, repeats),
        shared=_timed(lambda case: case.measured(measure), with_views, repeats),
    )


def cost_together(measures: Sequence[Measure], case: Case, repeats: int = 7) -> Time:
    """What all ``measures`` take on one map whose views they share, after one round that is not
    counted. Raises `FitnessError` as a measure does."""

    def all_of(case: Case) -> None:
        for measure in measures:
            case.measured(measure)

    all_of(case.fresh())
    return _timed(all_of, case.fresh, repeats)


def _timed(work: Callable[[Case], object], fresh: Callable[[], Case], repeats: int) -> Time:
    seconds = []
    for _ in range(repeats):
        case = fresh()
        start = time.perf_counter()
        work(case)
        seconds.append(time.perf_counter() - start)
    return Time(min(seconds), statistics.median(seconds))


__all__ = ["Cost", "Time", "cost", "cost_together"]
