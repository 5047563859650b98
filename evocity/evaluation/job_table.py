"""The jobs of one stream: which ones wait, which have outcomes, which are in doubt.

A birth that leaves its worker changed fails the worker's next canary, together with the births that
the worker did since its last good one. All of them are done again, each in a worker that has just
passed a check. The birth whose worker then fails once more is the cause, and becomes an error.
"""

from collections import Counter, deque
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

from evocity.evaluation.engine import Jobs
from evocity.evaluation.evaluator import Outcome
from evocity.evaluation.frames import LENGTH, write_frame
from evocity.evaluation.kept_genomes import GenomeTokens
from evocity.evaluation.worker_seat import Seat

# Jobs that wait for each worker: its next one, and some to choose from.
_DRAWN = 3
_END: Any = object()
#: The failed checks that make a birth the cause; the last one concerns this birth only.
_FAILED = 2
_CAUSE = (
    "this birth leaves its worker so changed that evocity computes other values (expected: "
    "measures and operators that change no code of evocity or of Python)"
)


class JobTable:
    """The ``jobs`` of a stream, which ``method`` carries out, by their numbers. ``tokens``:
    those of the pool's genomes.

    ``waiting``: numbers of jobs without a worker. ``suspects``: those that run one at a time,
    because one of them may kill the starter of workers. ``outcomes``: those to be yielded.
    ``strikes``: how often a job's worker was lost.
    """

    def __init__(self, method: str, jobs: Jobs, tokens: GenomeTokens | None = None):
        self.method, self._coming = method, jobs
        self._tokens = tokens or GenomeTokens()
        self._drawn, self._ended = 0, False
        self._jobs: dict[int, tuple | bytes] = {}  # those without an outcome
        self.outcomes: dict[int, Outcome] = {}
        self.waiting: deque[int] = deque()
        self.suspects: deque[int] = deque()
        self.strikes: Counter[int] = Counter()
        self._failed: Counter[int] = Counter()
        self._isolated: set[int] = set()
        # job that ended its worker -> its outcome, and the jobs in doubt that came before it
        self._postponed: dict[int, tuple[Outcome, set[int]]] = {}

    def draw(self, workers: int) -> bool:
        """Draw jobs, enough for each worker's next one. Returns whether any job is to be done."""
        while not self._ended and len(self.waiting) < _DRAWN * workers:
            job = next(self._coming, _END)
            self._ended = job is _END
            if job is None or self._ended:
                break
            self._jobs[self._drawn] = job
            self.waiting.append(self._drawn)
            self._drawn += 1
        if not self._jobs and not self._ended:
            raise RuntimeError("no job is given while no job is at work")
        return bool(self._jobs)

    def write(self, number: int, seat: Seat) -> bytes:
        """Return a job as a message to the worker of a seat. Raises the errors of pickling."""
        job = self._jobs[number]
        if isinstance(job, bytes):
            return write_frame((number, self.method, job[LENGTH.size :], (), ()))
        return write_frame((number, self.method, *seat.genomes.write(job, self._tokens)))

    def requeue(self, numbers: Iterable[int]) -> None:
        """Let these jobs wait again, before the others."""
        self.waiting.extendleft(reversed(list(numbers)))

    def settle(self, number: int, outcome: Outcome) -> None:
        """Take the ``outcome`` of a job, and of those that waited only for this one."""
        del self._jobs[number]
        self.outcomes[number] = outcome
        for other, (ended, before) in list(self._postponed.items()):
            before.discard(number)
            if not before:
                del self._postponed[other]
                self.settle(other, ended)

    def settle_ended(self, seat: Seat, outcome: Outcome) -> None:
        """Take the ``outcome`` of the job that ended its worker, but only once the jobs whose
        outcomes the worker held have good ones: else they may be the cause."""
        if seat.job is None:
            return
        if seat.held:
            self._postponed[seat.job] = outcome, {number for number, _ in seat.held}
        else:
            self.settle(seat.job, outcome)

    def isolates(self, seat: Seat, number: int) -> bool:
        """Whether a check must come between the jobs of a worker and the job ``number``."""
        before = [one for one, _ in seat.held]
        before += [] if seat.job is None else [seat.job]
        return bool(before) and not self._isolated.isdisjoint([number, *before])

    def fail(self, held: Sequence[tuple[int, Outcome]]) -> str:
        """Take what a worker ``held`` whose check failed: let the jobs be done again, or settle the
        one that is the cause. Returns a sentence about it."""
        numbers = [number for number, _ in held]
        self._failed.update(numbers)
        again = [
            number
            for number, (_, before) in self._postponed.items()
            if not before.isdisjoint(numbers)
        ]
        for number in again:  # it ended a worker that had been changed before
            del self._postponed[number]
        caused = len(held) == 1 and self._failed[numbers[0]] >= _FAILED
        again += [] if caused else numbers
        self._isolated.update(again)
        self.requeue(again)
        if caused:
            number, outcome = held[0]
            if outcome.status == "ok":
                outcome = replace(outcome, status="error", error=_CAUSE, values={}, look=None)
            self.settle(number, outcome)
            return "a birth left its worker changed: the birth fails, and the worker is replaced"
        done = "the birth" if len(held) == 1 else f"the {len(held)} births"
        return (
            "a worker computes other values than at its start: it is replaced, and "
            f"{done} since its last check {'is' if len(held) == 1 else 'are'} done again"
        )
