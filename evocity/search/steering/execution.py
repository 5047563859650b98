"""Execution of commands: the orders in force, and the genomes of picks."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from evocity.errors import EvocityError, RunError
from evocity.genome import Genome
from evocity.recipe.recipe import Recipe
from evocity.search.breeding.birth_plans import Picks
from evocity.search.record.commands import (
    ASIDE,
    DONE,
    REFUSED,
    Command,
    Pick,
    Reweight,
    StandingOrders,
    Stop,
    command_document,
    command_of,
    refuse_picks,
    refuse_unborn,
    refuse_weights,
)
from evocity.search.record.complete_run import CompleteRun
from evocity.selection.individual import Individual
from evocity.store import BackgroundWriter

#: Finds the genomes of births by id; raises `RunError` for one that was never born, or failed.
Births = Callable[[Sequence[int]], Mapping[int, Genome]]


class Steering:
    """Carries out the commands to a search by a ``recipe``; ``orders`` are those in force,
    ``births`` finds the genomes of picks. A stop among the first ``old`` lines of a resumed run's
    commands is over. ``later``: commands that are logged already, with the generation from which on
    each counts."""

    def __init__(
        self,
        recipe: Recipe,
        births: Births,
        orders: StandingOrders | None = None,
        old: int = 0,
        later: Sequence[tuple[int, Command]] = (),
    ):
        self._recipe, self._births, self._old = recipe, births, old
        self.orders = orders or StandingOrders()
        self._picked = births(self.orders.picks) if self.orders.picks else {}
        self._pending: list[Command] = []
        self._later = list(later)

    def carry_out_from(
        self, writer: BackgroundWriter | None, generation: int
    ) -> Iterator[tuple[str | None, dict]]:
        """Carry out the new commands in the run's file, which ``writer`` reads, and those that
        `add` took; yield the events to be logged. They count from the ``generation`` on.

        Commands that are logged already yield None as their event. A file with more commands than
        are read at a time is set aside.
        """
        later, self._later = self._later, []
        for since, command in later:
            if since > generation:
                self._later.append((since, command))
            elif not command.passing:
                self._execute(command)
                yield None, command_document(command)
        lines, more = ([], False) if writer is None else writer.commands(self.orders.read)
        yield from self.carry_out(lines, generation)
        if more:
            about = {"generation": generation, "read": self.orders.read}
            self.orders, self._old = replace(self.orders, read=0), 0
            yield ASIDE, about | {"file": writer.set_commands_aside()}

    def add(self, command: Command) -> None:
        """Carry out the ``command`` with the next ones."""
        self._pending.append(command)

    def carry_out(
        self, lines: Sequence[tuple[int, Mapping | None]], generation: int
    ) -> list[tuple[str, dict]]:
        """Carry out the commands in ``lines`` of the run's file, and those that `add` took. Return
        the events to be logged; they count from the ``generation`` on."""
        events = []
        for line, document in [*lines, *((None, command) for command in self._pending)]:
            about = {"generation": generation} | ({} if line is None else {"line": line})
            try:
                command = document if isinstance(document, Command) else command_of(document)
                if line is not None and line < self._old and isinstance(command, Stop):
                    raise ValueError("the run had ended when it was read")
                self._execute(command)
            except (ValueError, EvocityError) as error:
                reason = error.found if isinstance(error, EvocityError) else str(error)
                events.append((REFUSED, about | {"reason": reason}))
            else:
                events.append((DONE, about | command_document(command)))
        self._pending.clear()
        if lines:
            self.orders = replace(self.orders, read=max(self.orders.read, lines[-1][0] + 1))
        return events

    @property
    def picks(self) -> Picks:
        """The picked individuals, and their share of the births."""
        return picks_of(self.orders, self._picked, self._recipe)

    def _execute(self, command: Command) -> None:
        if isinstance(command, Pick):
            refuse_picks(self._recipe.search.algorithm)
            self._picked = {**self._picked, **self._births(command.ids)}
        if isinstance(command, Reweight):
            sums = [
                measure.name
                for entry in self._recipe.fitness
                if entry.total is not None
                for measure in entry.measures
            ]
            refuse_weights(command, self.orders, self._recipe.mixtures, sums, "the recipe")
        self.orders = self.orders.after(command)
        self._picked = {pick: self._picked[pick] for pick in self.orders.picks}


def picks_of(orders: StandingOrders, genomes: Mapping[int, Genome], recipe: Recipe) -> Picks:
    """Return the picks of ``orders`` with their ``genomes``, by id; the ``recipe`` gives the share
    where no command did."""
    picks = tuple((identifier, genomes[identifier]) for identifier in orders.picks)
    return Picks(picks, orders.share or recipe.search.picks)


def genomes_of(
    ids: Sequence[int], path: str | os.PathLike | None, living: Sequence[Individual]
) -> dict[int, Genome]:
    """Return the genomes of the births ``ids``: of any birth of the run in ``path``; without a run
    folder, of the ``living``. Raises `RunError` for one that was never born, or failed."""
    if path is not None:
        run = CompleteRun(path)
        refuse_unborn(run, ids)
        return {birth.id: birth.genome for birth in run.individuals(ids)}
    known = {individual.id: individual.genome for individual in living}
    for identifier in ids:
        if identifier not in known:
            raise RunError(
                f"individual {identifier} is not alive, and this search keeps only living "
                "individuals",
                "the id of a living individual",
                "start the search with a run folder, so that every birth can be picked",
            )
    return {identifier: known[identifier] for identifier in ids}
