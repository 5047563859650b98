"""Who watches a search: its log, and whoever else wants to know how it goes on."""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Sequence

from evocity.errors import RunError
from evocity.search.evaluator import told
from evocity.search.generation import Generation
from evocity.search.leaving import Leaving
from evocity.store import Behind, Birth, Member


class Observer:
    """Sees what a search does; a subclass tells what it looks at, and returns nothing.

    Given to `Search`, or to `Search.observe`. What it raises is logged and ends its watching, not
    the search.
    """

    def generation(
        self, generation: Generation, births: Sequence[Birth], members: Sequence[Member]
    ) -> None:
        """A ``generation`` is over: its ``births``, and who lives on."""

    def event(self, event: str, details: dict) -> None:
        """Something happened: a start, a resume, a command, a stop, the finish, …"""


class Log(Observer):
    """Writes all down, by the ``writer`` of the run's folder, at most one generation
    behind. What it raises ends the search."""

    #: What the births tell, or is of the moment.
    _UNSAID = ("number", "population", "seconds_left", "feasible")

    def __init__(self, writer: Behind):
        self._writer, self._leaving = writer, Leaving.of(writer)

    def generation(
        self, generation: Generation, births: Sequence[Birth], members: Sequence[Member]
    ) -> None:
        summary = dataclasses.asdict(dataclasses.replace(generation, population=[]))
        for key in self._UNSAID:
            del summary[key]
        for key in ("algorithm", "islands"):
            if not summary[key]:
                del summary[key]
        if math.isnan(generation.hypervolume):  # it was not taken
            del summary["hypervolume"]
        elif math.isinf(generation.hypervolume):  # JSON has no infinity
            summary["hypervolume"] = None
        births = self._leaving.written(births, members)
        self._writer.write_generation(generation.number, births, members, summary)
        if generation.number == 0:  # from the first on, who is told of it may look at the folder
            self._writer.flush()

    def event(self, event: str, details: dict) -> None:
        self._writer.event(event, **details)

    def wait(self) -> None:
        """Return once nothing is being written."""
        self._writer.wait()

    def end(self) -> None:
        """Return once all is written that can be."""
        with contextlib.suppress(RunError):  # the folder itself may be what failed
            self._writer.flush()


class Observers:
    """All that watch a search, told in turn; its log first."""

    def __init__(self, observers: Sequence[Observer] = ()):
        self._all = list(observers)

    def add(self, observer: Observer) -> None:
        self._all.append(observer)

    def log(self, writer: Behind) -> None:
        """Everything is written down from now on, before others see it."""
        self._all.insert(0, Log(writer))

    def generation(
        self, generation: Generation, births: Sequence[Birth], members: Sequence[Member]
    ) -> None:
        self._tell(lambda one: one.generation(generation, births, members))

    def event(self, event: str, **details) -> None:
        self._tell(lambda one: one.event(event, details))

    def end(self, event: str, **details) -> None:
        """As `event`, of the last one: all are told, though nothing can be written any more."""
        self._tell(lambda one: one.event(event, details), last=True)
        for log in self._logs:
            log.end()

    def wait(self) -> None:
        """Return once the log holds all that was told."""
        for log in self._logs:
            log.wait()

    @property
    def _logs(self) -> list[Log]:
        return [one for one in self._all if isinstance(one, Log)]

    def _tell(self, tell: Callable[[Observer], None], last: bool = False) -> None:
        """Tell all; one that fails is told no more."""
        for one in list(self._all):
            try:
                tell(one)
            except Exception as error:
                if isinstance(one, Log) and last and isinstance(error, RunError):
                    continue  # the folder itself may be what failed
                if isinstance(one, Log):
                    raise
                self._all.remove(one)
                self.event("observer failed", observer=type(one).__name__, reason=told(error))


__all__ = ["Log", "Observer", "Observers"]
