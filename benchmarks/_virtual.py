"""Simulated workers on a virtual clock: they do what an engine here does, and nobody waits."""

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from evocity.evaluation import Engine
from evocity.evaluation.evaluator import Outcome

_END = object()

#: Seconds that a job takes, by the outcome and a generator that is the birth's own.
Seconds = Callable[[Outcome, np.random.Generator], float]


class Virtual:
    """So many ``workers``, each of which works on one job of the ``inner`` engine at a time, for as
    many virtual ``seconds`` as are told; at most until the ``deadline``.

    ``now`` is the virtual time, in seconds; ``busy`` the seconds that all workers have worked.
    """

    def __init__(
        self, inner: Engine, workers: int, seconds: Seconds, deadline: float = float("inf")
    ):
        self._inner, self._seconds, self._deadline = inner, seconds, deadline
        self.size, self.now, self.busy = workers, 0.0, 0.0
        self.notes = inner.notes

    @property
    def described(self) -> dict:
        return {"engine": "virtual", "workers": self.size}

    @property
    def busy_share(self) -> float:
        """Of the time of all workers the share in which they worked."""
        return self.busy / (self.now * self.size)

    def run(self, method: str, jobs: Sequence[tuple]) -> list[Outcome]:
        outcomes = dict(self.stream(method, iter(jobs)))
        return [outcomes[number] for number in range(len(jobs))]

    def stream(self, method: str, jobs: Iterator[tuple | None]) -> Iterator[tuple[int, Outcome]]:
        at_work: list[tuple[float, int, Outcome]] = []
        number = 0
        while True:
            job = None
            while len(at_work) < self.size:
                job = next(jobs, _END)
                if job is None or job is _END:
                    break
                outcome = self._done(method, job)
                heapq.heappush(at_work, (self.now + outcome.seconds, number, outcome))
                self.busy += outcome.seconds
                number += 1
            if not at_work:
                if job is None:
                    raise RuntimeError("no job is given while none is at work")
                return
            self.now, done, outcome = heapq.heappop(at_work)
            yield done, outcome

    def close(self) -> None:
        self._inner.close()

    def _done(self, method: str, job: tuple) -> Outcome:
        (outcome,) = self._inner.run(method, [job])
        if method != "born" or not job[3]:  # a child that is bred again takes next to nothing
            return replace(outcome, seconds=0.01)
        seconds = self._seconds(outcome, job[2])
        if seconds <= self._deadline:
            return replace(outcome, seconds=seconds)
        text = f"no result after {self._deadline:g} s"
        return Outcome("timeout", text, self._deadline)


def uneven(hanging: float = 0.0) -> Seconds:
    """Log-normal with the mean 1 and the deviation 1; the share that is ``hanging`` has no end."""
    spread = np.log(2.0)

    def seconds(outcome: Outcome, rng: np.random.Generator) -> float:
        hangs, drawn = rng.random() < hanging, rng.lognormal(-spread / 2, spread**0.5)
        return float("inf") if hangs else float(drawn)

    return seconds
