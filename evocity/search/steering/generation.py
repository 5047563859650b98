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

    number : number of the generation, from 0. births, failures : counts since the start of the run.
    hypervolume : the hypervolume in units of the first population's ranges. NaN if it would take
        too long, see `evocity.selection.fronts.volume_is_quick`.
    best : for each measure that is a goal, the raw value of the best living individual.
    evaluations_per_second, seconds_left : the evaluations per second, and an estimate of the
        seconds left.
    population : the living individuals, each listed once. feasible : how many of them keep all
        constraints.
    algorithm : the figures that the algorithm reports of the living, for example the coverage of
        ``map_elites``.
    islands : the reports of the islands, in a search on islands, in place of ``algorithm``. See
        `evocity.search.breeding.archipelago.Archipelago.summaries`. All other values here cover all
        islands together.
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
            f"no birth of the {len(births)} in generation {generation} can survive; the first: "
            f"{reason}",
            "births that have a value of each of the algorithm's descriptors",
            "choose other descriptors under [search], and start a new run",
        )
    kinds = {s: sum(b.status == s for b in failed) for s in dict.fromkeys(b.status for b in failed)}
    said = ", ".join(f"{number} {status}" for status, number in kinds.items())
    raise RunError(
        f"{len(failed)} of {len(births)} births of generation {generation} failed ({said}); "
        f"the first: {failed[0].error}",
        f"at most {limit:.0%} (evaluation.max_failures), and at least one birth alive",
        "correct the measure or the operator and start a new run; the log has the error of each "
        "failed birth",
    )
