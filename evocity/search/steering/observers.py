"""Observers of a search: its log, and the user's own objects."""

import contextlib
import dataclasses
import math
from collections.abc import Callable, Sequence

from evocity.errors import RunError
from evocity.evaluation.evaluator import describe_failure
from evocity.search.breeding.omitted_genomes import OmittedGenomes
from evocity.search.steering.generation import Generation
from evocity.store import BackgroundWriter, Birth, Member


class Observer:
    """Base class for objects that follow a search. A subclass overrides the method `generation`,
    the method `event`, or both; these methods return nothing.

    Pass an observer to `Search`, or to `Search.observe`. If an observer raises an error, the search
    logs the error, removes this observer and continues.
    """

    def generation(
        self, generation: Generation, births: Sequence[Birth], members: Sequence[Member]
    ) -> None:
        """Receive a complete generation, its births, and its living individuals as members."""

    def event(self, event: str, details: dict) -> None:
        """Receive an event of the search, such as "start", "command" or "stop", with details."""


class Log(Observer):
    """Writes everything into the run's folder by ``writer``, at most one generation late. An error
    of it ends the search."""

    #: What the births hold, or what is only of the moment.
    _UNLOGGED = ("number", "population", "seconds_left", "feasible")

    def __init__(self, writer: BackgroundWriter):
        self.writer, self._omitted = writer, OmittedGenomes.of(writer)

    def generation(
        self, generation: Generation, births: Sequence[Birth], members: Sequence[Member]
    ) -> None:
        about = dataclasses.asdict(dataclasses.replace(generation, population=[]))
        left = {*self._UNLOGGED, *(key for key in ("algorithm", "islands") if not about[key])}
        summary = {key: value for key, value in about.items() if key not in left}
        if math.isnan(generation.hypervolume):  # it was not computed
            del summary["hypervolume"]
        elif math.isinf(generation.hypervolume):  # JSON has no infinity
            summary["hypervolume"] = None
        births = self._omitted.omit_from(births, members)
        self.writer.write_generation(generation.number, births, members, summary)
        if generation.number == 0:  # from now on, an observer may read the folder
            self.writer.flush()

    def event(self, event: str, details: dict) -> None:
        self.writer.event(event, **details)


class Observers:
    """Passes generations and events on: to the log first, then to all observers in turn."""

    def __init__(self, observers: Sequence[Observer] = ()):
        self._log: Log | None = None
        self._others = list(observers)

    def add(self, observer: Observer) -> None:
        """Pass everything on to ``observer`` too, from now on."""
        self._others.append(observer)

    def log(self, writer: BackgroundWriter) -> None:
        """Write everything down by ``writer`` from now on."""
        self._log = Log(writer)

    def generation(
        self, generation: Generation, births: Sequence[Birth], members: Sequence[Member]
    ) -> None:
        """Pass on a whole generation."""
        if self._log is not None:
            self._log.generation(generation, births, members)
        self._pass_on(lambda observer: observer.generation(generation, births, members))

    def event(self, event: str, **details) -> None:
        """Pass on an event."""
        if self._log is not None:
            self._log.event(event, details)
        self._pass_on(lambda observer: observer.event(event, details))

    def end(self, event: str, **details) -> None:
        """Pass on the last event, to the observers too if the folder cannot be written any more."""
        if self._log is not None:
            with contextlib.suppress(RunError):
                self._log.event(event, details)
        self._pass_on(lambda observer: observer.event(event, details))
        if self._log is not None:
            with contextlib.suppress(RunError):
                self._log.writer.flush()

    def wait(self) -> None:
        """Return once the log holds everything that was passed on."""
        if self._log is not None:
            self._log.writer.wait()

    def _pass_on(self, call: Callable[[Observer], None]) -> None:
        for observer in list(self._others):
            try:
                call(observer)
            except Exception as error:
                self._others.remove(observer)
                name = type(observer).__name__
                self.event("observer failed", observer=name, reason=describe_failure(error))
