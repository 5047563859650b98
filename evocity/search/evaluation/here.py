"""Births in the calling process, one after the other."""

import contextlib
import sys
from collections.abc import Iterator, Sequence

from evocity.search.evaluator import Evaluator, Outcome, Setup


class Here:
    """Runs everything in the calling process: for notebooks and debuggers. No deadline, no limit of
    memory."""

    def __init__(self, setup: Setup):
        self._evaluator = Evaluator(setup)

    @property
    def size(self) -> int:
        return 1

    @property
    def described(self) -> dict:
        return {"engine": "in process", "workers": 0}

    def run(self, method: str, jobs: Sequence[tuple]) -> list[Outcome]:
        """Outcomes of ``Evaluator.method(*job)``, in the order of ``jobs``."""
        return [outcome for _, outcome in self.stream(method, iter(jobs))]

    def stream(self, method: str, jobs: Iterator[tuple | None]) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`."""
        for number, job in enumerate(jobs):
            if job is None:
                raise RuntimeError("no job is given while none is at work")
            with contextlib.redirect_stdout(sys.stderr):
                outcome = getattr(self._evaluator, method)(*job)
            yield number, outcome

    def close(self) -> None:
        pass
