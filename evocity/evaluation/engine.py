"""Engines: the interface of all that breed and evaluate, and the one in the calling process."""

import contextlib
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from evocity.evaluation.evaluator import Evaluator, Outcome, Setup

#: The arguments of jobs, as a tuple or its frame; None where there is no job yet.
Jobs = Iterator[tuple | bytes | None]


class Engine(ABC):
    """Carries out jobs; outcomes depend neither on the kind of engine nor on its size.

    notes : sentences for the user, on what the engine cannot promise.
    is_prompt : whether each outcome comes as soon as it can, because a person waits for it;
        otherwise some outcomes may wait for others.
    """

    notes: Sequence[str] = ()
    is_prompt = False

    @property
    @abstractmethod
    def size(self) -> int:
        """How many jobs it works on at once."""

    @property
    @abstractmethod
    def described(self) -> Mapping[str, Any]:
        """Its entry in events and `provenance.json`: ``engine``, ``workers`` and more."""

    def run(self, method: str, jobs: Sequence[tuple | bytes]) -> list[Outcome]:
        """Return the outcomes of ``Evaluator.method(*job)`` in order. Raises `RunError` as
        `stream`."""
        outcomes = dict(self.stream(method, iter(jobs)))
        return [outcomes[number] for number in range(len(jobs))]

    @abstractmethod
    def stream(self, method: str, jobs: Jobs) -> Iterator[tuple[int, Outcome]]:
        """Yield the outcomes of ``Evaluator.method(*job)`` as they come, each with the number of
        its job. It draws jobs when it has room; after None it draws again at the next outcome. Only
        one stream or `run` works at a time; closing a stream drops its jobs. Raises `RunError` if
        the engine cannot carry out any job."""

    def cancel(self) -> None:  # noqa: B027
        """End the jobs of `stream` early, if the engine can; another thread may call it."""

    @abstractmethod
    def close(self) -> None:
        """End all that it started. Safe to call twice."""


class Here(Engine):
    """Runs every job in the calling process, without deadlines or memory limits, and without a
    check of what a measure changes in the process."""

    size = 1
    described: Mapping[str, Any] = {"engine": "in process", "workers": 0, "protected": False}

    def __init__(self, setup: Setup):
        self._evaluator = Evaluator(setup)

    def stream(self, method: str, jobs: Jobs) -> Iterator[tuple[int, Outcome]]:
        """As `Engine.stream`."""
        for number, job in enumerate(jobs):
            if job is None:
                raise RuntimeError("no job is given while no job is at work")
            with contextlib.redirect_stdout(sys.stderr):
                outcome = getattr(self._evaluator, method)(*job)
            yield number, outcome

    def close(self) -> None:
        """Do nothing: it started nothing."""
