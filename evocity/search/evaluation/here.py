"""Births in the calling process, one after the other."""

import contextlib
import sys
from collections.abc import Sequence

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
        with contextlib.redirect_stdout(sys.stderr):
            return [getattr(self._evaluator, method)(*job) for job in jobs]

    def close(self) -> None:
        pass
