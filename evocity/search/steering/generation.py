"""`Generation`: the state of a search after each generation, its pace, and too many failures."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from evocity.errors import RunError
from evocity.selection.individual import Individual
from evocity.store import Birth


@dataclass(frozen=True)
class Generation:
    """State of a search after one generation.

    number : number of the generation, from 0.
    births, failures : numbers of births and of failed births since the start of the run.
    hypervolume : hypervolume of the living individuals, in units of the first population's ranges,
        or NaN if the computation would take too long (`evocity.selection.fronts.volume_is_quick`).
    best : raw value of the best living individual in each measure that is a goal.
    evaluations_per_second, seconds_left : evaluations per second, and estimated seconds until the
        last generation ends.
    population : living individuals, each listed once.
    feasible : number of living individuals that keep all constraints.
    algorithm : figures that the algorithm computes from the living individuals, such as the
        coverage of ``map_elites``; empty in a search with islands.
    islands : figures of each island, see
        `evocity.search.breeding.archipelago.Archipelago.summaries`; empty in a search without
        islands. All attributes except ``islands`` cover all islands together.
    """

    number: int
    births: int
    failures: int
    hypervolume: float
    best: dict[str, float]
    evaluations_per_second: float
    seconds_left: float
    population: list[Individual] = field(repr=False)
    feasible: int = 0
    algorithm: dict[str, float] = field(default_factory=dict)
    islands: dict[str, dict] = field(default_factory=dict)


class Pace:
    """The pace of a search by so many ``workers``, clocked from `begin` to `end` of each
    generation."""

    def __init__(self, workers: int):
        self._workers = max(1, workers)
        self._first = self._began = 0.0
        self._done = 0

    def begin(self) -> None:
        """Start the clock of a generation."""
        self._began = time.perf_counter()

    def end(self, births: Sequence[Birth]) -> tuple[float, float]:
        """Return the evaluations per second of a generation with these ``births``, and the seconds
        that a generation takes."""
        now = time.perf_counter()
        if self._done == 0:  # workers start and kernels load: the births' own seconds count
            spent = sum(birth.seconds for birth in births) / self._workers
            seconds, self._first = min(now - self._began, spent), now
        else:
            seconds = (now - self._first) / self._done
        self._done += 1
        return len(births) / max(now - self._began, 1e-9), seconds


def refuse_failures(births: Sequence[Birth], limit: float, generation: int, alive: bool) -> None:
    """Raise `RunError` if more than a share ``limit`` of a generation's ``births`` failed, or
    nobody is ``alive``."""
    failed = [birth for birth in births if not birth.ok]
    if len(failed) <= limit * len(births) and alive:
        return
    if not failed:
        reason = next((birth.error for birth in births if birth.error), "no reason given")
        raise RunError(
            f"no birth of the {len(births)} in generation {generation} can survive; first error: "
            f"{reason}",
            "births with a value of each descriptor that the algorithm uses",
            "choose other descriptors in [search] of the recipe, and start a new run",
        )
    kinds = {s: sum(b.status == s for b in failed) for s in dict.fromkeys(b.status for b in failed)}
    said = ", ".join(f"{number} {status}" for status, number in kinds.items())
    raise RunError(
        f"{len(failed)} of {len(births)} births of generation {generation} failed ({said}); "
        f"first error: {failed[0].error}",
        f"at most {100 * limit:.0f} % failed births (the limit evaluation.max_failures), "
        "and at least one living individual",
        "correct the measure or the operator, and start a new run; the log holds the error of "
        "each failed birth",
    )
