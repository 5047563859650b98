"""What breeds and evaluates, wherever that happens."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Protocol

from evocity.search.evaluator import Outcome


class Engine(Protocol):
    """Carries out jobs. A job that fails costs itself alone, and the order and the bits of the
    outcomes depend neither on the kind of engine nor on its size."""

    @property
    def size(self) -> int:
        """How many jobs it works on at once."""
        ...

    @property
    def described(self) -> Mapping[str, Any]:
        """What events and `provenance.json` tell of it: ``engine``, its kind, ``workers``, the
        number of worker processes, and what else there is to tell."""
        ...

    def run(self, method: str, jobs: Sequence[tuple]) -> list[Outcome]:
        """Outcomes of ``Evaluator.method(*job)``, in the order of ``jobs``.

        Raises `RunError` if the engine can carry out none.
        """
        ...

    def stream(self, method: str, jobs: Iterator[tuple | None]) -> Iterator[tuple[int, Outcome]]:
        """Outcomes of ``Evaluator.method(*job)`` as they come about, each with the number of its
        job: how many ``jobs`` came before it.

        Jobs are drawn when there is room for them. None is no job: it says that there is none yet,
        and that another is to be drawn after the next outcome; so one must be at work then. One
        stream goes on at a time, and nothing else; what is at work when it is left before its end
        is nobody's.

        Raises `RunError` if the engine can carry out none.
        """
        ...

    def close(self) -> None:
        """End all that it began. Safe to call twice."""
        ...


__all__ = ["Engine"]
