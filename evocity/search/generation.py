"""`Generation`: where a search is; and whether so many failures may go on."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

from evocity.errors import RunError
from evocity.search.individual import Individual
from evocity.store import Birth


@dataclass(frozen=True)
class Generation:
    """State of a search after a generation.

    ``births`` and ``failures`` count from the start of the run, ``feasible`` how many of the
    living keep all constraints; ``best`` maps each measure that is more than a constraint to the
    raw value of the best living individual, ``hypervolume`` is in units of the first population's
    ranges, and NaN where it is not taken, see `evocity.search.fronts.volume_is_quick`.
    ``algorithm`` is what the algorithm tells of all the living, such as the coverage of
    `map_elites`; of a search on ``islands`` each has its own, see
    `evocity.search.archipelago.Archipelago.summaries`, and the rest is of all together, each of the
    living once. ``seconds_left`` is an estimate.
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
    """How quickly a search goes on: clocked from `begin` to `end` of each generation."""

    def __init__(self, workers: int):
        self._workers = max(1, workers)
        self._first = self._began = 0.0
        self._done = 0

    def begin(self) -> None:
        self._began = time.perf_counter()

    def end(self, births: Sequence[Birth]) -> tuple[float, float]:
        """Evaluations a second of the generation with these ``births``, and seconds that one
        generation takes."""
        now = time.perf_counter()
        if self._done == 0:  # workers start and kernels load: what the births took tells more
            spent = sum(born.seconds for born in births) / self._workers
            one, self._first = min(now - self._began, spent), now
        else:
            one = (now - self._first) / self._done
        self._done += 1
        return len(births) / max(now - self._began, 1e-9), one


def refuse_failures(births: Sequence[Birth], limit: float, generation: int, alive: bool) -> None:
    """Raise `RunError` if more than the share ``limit`` of a generation's ``births`` failed, or
    nobody is ``alive``."""
    failed = [birth for birth in births if not birth.ok]
    if len(failed) <= limit * len(births) and alive:
        return
    if not failed:
        reason = next((one.error for one in births if one.error), "no reason given")
        raise RunError(
            f"none of {len(births)} births of generation {generation} may live; the first: "
            f"{reason}",
            "births that have a value of each of the algorithm's descriptors",
            "choose other descriptors under [search], and start a new run",
        )
    kinds = {s: sum(b.status == s for b in failed) for s in dict.fromkeys(b.status for b in failed)}
    said = ", ".join(f"{number} {status}" for status, number in kinds.items())
    raise RunError(
        f"{len(failed)} of {len(births)} births of generation {generation} failed ({said}); "
        f"the first: {failed[0].error}",
        f"at most {limit:.0%} (evaluation.max_failures), and somebody alive",
        "correct the measure or the operator and start a new run; the births written down "
        "tell each failure",
    )
