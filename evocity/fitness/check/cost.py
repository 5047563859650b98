"""The cost of measures: alone, on a map with computed views, and all on one map."""

import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from evocity.fitness.check.observed_call import Case
from evocity.fitness.measure import Measure


@dataclass(frozen=True)
class Time:
    """Seconds of several repeats: the least and the median."""

    least: float
    median: float


@dataclass(frozen=True)
class Cost:
    """Time of one call: ``alone``, on a map without views, the time of its views included;
    ``shared``, on a map with computed views."""

    alone: Time
    shared: Time


def cost(measure: Measure, case: Case, repeats: int = 7) -> Cost:
    """Time ``measure`` on ``case``, after one call that does not count.

    Raises `FitnessError` as the measure does.
    """
    viewed = case.fresh()
    viewed.measured(measure)

    def with_views() -> Case:
        # a new map, because a function of several numbers keeps those of a map
        fresh = case.fresh()
        vars(fresh.city).update(vars(viewed.city))
        return fresh

    return Cost(
        alone=_time(lambda case: case.measured(measure), case.fresh, repeats),
        shared=_time(lambda case: case.measured(measure), with_views, repeats),
    )


def cost_together(measures: Sequence[Measure], case: Case, repeats: int = 7) -> Time:
    """Time all ``measures`` on one map whose views they share, after one round that does not count.

    Raises `FitnessError` as a measure does.
    """

    def measure_all(case: Case) -> None:
        for measure in measures:
            case.measured(measure)

    measure_all(case.fresh())
    return _time(measure_all, case.fresh, repeats)


def _time(work: Callable[[Case], object], fresh: Callable[[], Case], repeats: int) -> Time:
    seconds = []
    for _ in range(repeats):
        case = fresh()
        start = time.perf_counter()
        work(case)
        seconds.append(time.perf_counter() - start)
    return Time(min(seconds), statistics.median(seconds))
