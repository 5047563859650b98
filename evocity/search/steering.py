"""Carrying out commands: what stands of them, and what breeding needs to know of that."""

import os
from collections.abc import Callable, Mapping, Sequence

from evocity.errors import EvocityError, RunError
from evocity.genome import Genome
from evocity.search.breeding import Picks
from evocity.search.commands import (
    DONE,
    REFUSED,
    Command,
    Pick,
    Reweight,
    Standing,
    Stop,
    command_of,
    refuse_idle,
    refuse_own_breeding,
    refuse_unborn,
    refuse_weights,
    told,
)
from evocity.search.individual import Individual
from evocity.search.opening import open_run
from evocity.search.recipe import Recipe

#: Genomes of births, by id; raises `RunError` for one that was never born, or failed.
Births = Callable[[Sequence[int]], Mapping[int, Genome]]


class Steering:
    """What was asked of a search by a ``recipe``, and is carried out.

    ``births`` finds those that are picked; ``standing`` is what was carried out before a run was
    taken up again, of which the first ``old`` lines were written by then: a stop among them is
    over.
    """

    def __init__(
        self, recipe: Recipe, births: Births, standing: Standing | None = None, old: int = 0
    ):
        self._recipe, self._births, self._old = recipe, births, old
        self.standing = standing or Standing()
        self._picked = births(self.standing.picks) if self.standing.picks else {}
        self._asked: list[Command] = []

    def ask(self, command: Command) -> None:
        """Carry out the ``command`` with the next ones."""
        self._asked.append(command)

    def carry_out(
        self, lines: Sequence[tuple[int, Mapping | None]], generation: int
    ) -> list[tuple[str, dict]]:
        """Carry out what the ``lines`` of the run's file ask for, and what `ask` was given. Returns
        the events that tell of it, which count from the ``generation`` on."""
        events = []
        for line, document in [*lines, *((None, one) for one in self._asked)]:
            about = {"generation": generation} | ({} if line is None else {"line": line})
            try:
                command = document if isinstance(document, Command) else command_of(document)
                if line is not None and line < self._old and isinstance(command, Stop):
                    raise ValueError("the run had ended when it was read")
                self._do(command)
            except (ValueError, EvocityError) as error:
                reason = error.found if isinstance(error, EvocityError) else str(error)
                events.append((REFUSED, about | {"reason": reason}))
            else:
                events.append((DONE, about | told(command)))
        self._asked.clear()
        if lines:
            read = max(self.standing.read, lines[-1][0] + 1)
            self.standing = self.standing.having_read(read)
        return events

    @property
    def picks(self) -> Picks:
        """Who is bred from besides the living."""
        share = self.standing.share or self._recipe.search.picks
        return Picks(tuple((one, self._picked[one]) for one in self.standing.picks), share)

    def _do(self, command: Command) -> None:
        if isinstance(command, Pick):
            refuse_own_breeding(self._recipe.search.algorithm)
            self._picked = {**self._picked, **self._births(command.ids)}
        if isinstance(command, Reweight):
            sums = [
                measure.name
                for entry in self._recipe.fitness
                if entry.total is not None
                for measure in entry.measures
            ]
            mixtures = self._recipe.mixtures
            refuse_weights(command.weights, mixtures, sums, "the recipe")
            refuse_idle({**self.standing.weights, **command.weights}, mixtures, "the run")
        self.standing = self.standing.after(command)
        self._picked = {one: self._picked[one] for one in self.standing.picks}


def genomes_of(
    ids: Sequence[int], path: str | os.PathLike | None, living: Sequence[Individual]
) -> dict[int, Genome]:
    """The genomes of births by id: of any, in the run kept at ``path``; of the ``living``, where
    None is kept. Raises `RunError` for one that was never born, or failed."""
    if path is not None:
        run = open_run(path)
        refuse_unborn(run, ids)
        return {birth.id: birth.genome for birth in run.individuals(ids)}
    known = {one.id: one.genome for one in living}
    for one in ids:
        if one not in known:
            raise RunError(
                f"individual {one} does not live, and this search keeps no others",
                "one of the living",
                "give the search a run folder: all its births can be picked then",
            )
    return {one: known[one] for one in ids}
