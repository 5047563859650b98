"""All births of a run as columns: read once, settled at one generation. numpy alone."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.wanted import Aim, aims_of, recorded_of
from evocity.columns import array_of, words_of
from evocity.errors import RunError, check_word, near_miss, shown
from evocity.fitness import Aims, measures
from evocity.kinds import Expressed
from evocity.search.fronts import ranks_of
from evocity.search.judging import aims_of_run, broken_by, losses_of
from evocity.store import Birth, Run, Source

if TYPE_CHECKING:
    import pyarrow as pa

#: What a birth has besides its measures, in the order of tables; islands where there are some.
OWN = ("generation", "id", "island", "operator", "status", "feasible", "seconds", "alive", "lived")
#: Why a birth without a genome has no map.
NEVER_BRED = "it was never bred"


class Told:
    """The births of a ``run`` in its generations 0…``last``, a row each, by id; what is asked for
    is read once and kept.

    Raises `RunError` where the run is damaged, or has no whole generation yet.
    """

    def __init__(self, run: Run, last: int | None = None):
        self.run = run
        if not run.generations:
            raise RunError(
                f"{run.path} has no whole generation yet",
                "at least one",
                f"wait for the first generation to end, or go on: evocity resume {run.path}",
            )
        #: The last generation that counts.
        self.last = run.generations[-1] if last is None else last

    def __len__(self) -> int:
        return len(self.ids)

    # -- columns -----------------------------------------------------------------------------

    @cached_property
    def history(self) -> list[dict]:
        """What the log tells of each generation, as `evocity.store.Run.history` has it."""
        return [one for one in Run.history(self.run) if one["generation"] <= self.last]

    @property
    def read_already(self) -> bool:
        """Whether the columns are at hand, and cost nothing any more."""
        return "_table" in self.__dict__

    @cached_property
    def _table(self) -> "pa.Table":
        header = self.run.header
        columns = ["generation", "id", "parents", "operator", "status", "seconds"]
        columns += ["island"] if header.islands else []
        columns += [f"fitness.{name}" for name in header.columns]
        table = self.read(columns)
        ids = array_of(table["id"])
        if (np.diff(ids) <= 0).any():
            raise RunError(
                f"{self.run.path}: the births are damaged: one stands there twice",
                "births as `evocity run` writes them",
                "bring the file back from a copy",
            )
        return table

    def read(self, columns: Sequence[str]) -> "pa.Table":
        """``columns`` of the log, of all births by id, and their generation and id."""
        table = Run.births(self.run, columns=list(dict.fromkeys(["generation", "id", *columns])))
        table = table.replace_schema_metadata(None)
        born = array_of(table["generation"])
        if (born > self.last).any():  # it may go on
            table = table.filter(born <= self.last)
        if (np.diff(array_of(table["id"])) < 0).any():
            table = table.sort_by("id")
        return table

    @cached_property
    def ids(self) -> np.ndarray:
        """Int64 ``(n,)``, rising."""
        return array_of(self._table["id"])

    @cached_property
    def generation(self) -> np.ndarray:
        """Int32 ``(n,)``: when each was born."""
        return array_of(self._table["generation"])

    @property
    def parents(self) -> "pa.ListArray":
        """Int64 lists ``(n,)``: the ids of what each was bred from."""
        return self._table["parents"].combine_chunks()

    @cached_property
    def operator(self) -> np.ndarray:
        """Text ``(n,)``: by what each was bred."""
        return self._words("operator")

    @cached_property
    def status(self) -> np.ndarray:
        """Text ``(n,)``: how each birth ended."""
        return self._words("status")

    @cached_property
    def island(self) -> np.ndarray:
        """Text ``(n,)``: where each was born; of a run with islands alone."""
        return self._words("island")

    @cached_property
    def seconds(self) -> np.ndarray:
        """Float64 ``(n,)``: what each took one worker."""
        return array_of(self._table["seconds"])

    def _words(self, name: str) -> np.ndarray:
        return words_of(self._table[name])

    @cached_property
    def values(self) -> np.ndarray:
        """Float64 ``(n, measures)`` in the order of ``header.columns``; NaN where there is none."""
        names = [f"fitness.{name}" for name in self.run.header.columns]
        found = np.empty((len(self), len(names)))
        for column, name in zip(found.T, names, strict=True):
            column[:] = array_of(self._table[name])
        return found

    def value(self, name: str) -> np.ndarray:
        """Float64 ``(n,)``: what each birth has of the measure ``name``."""
        return self.values[:, self.run.header.columns.index(name)]

    @cached_property
    def aims(self) -> list[Aim]:
        """What was wanted of each measure, in words."""
        return aims_of(self.run)

    @cached_property
    def recorded(self) -> list[Aim]:
        """One a measure that is recorded besides."""
        return recorded_of(self.run)

    @property
    def logged(self) -> list[Aim]:
        """One a measure of the log: those in which something was wanted, then the recorded."""
        return [*self.aims, *self.recorded]

    @cached_property
    def ok(self) -> np.ndarray:
        """Bool ``(n,)``: it was bred, and has a value of all that is sought. One of before a
        measure was sought may lack its value."""
        found = self.status == "ok"
        for aim in self.aims:
            if aim.goal != "bounds":
                found &= ~np.isnan(self.value(aim.name))
        return found

    @cached_property
    def feasible(self) -> np.ndarray:
        """Bool ``(n,)``: it was measured, and lies within all bounds that now hold."""
        within = self.ok.copy()
        for aim in self.aims:
            within &= aim.within(self.value(aim.name))
        return within

    @cached_property
    def sources(self) -> list[Source]:
        """The source cities, maps and genomes."""
        return self.run.sources()

    @cached_property
    def islands_noted(self) -> dict[str, Mapping]:
        """What provenance notes of each island, by their names."""
        recipe = self.run.provenance.get("recipe")
        listed = recipe.get("islands") if isinstance(recipe, Mapping) else None
        listed = listed if isinstance(listed, list) else ()
        tables = [one for one in listed if isinstance(one, Mapping)]
        return {str(one.get("name")): one for one in tables}

    @cached_property
    def founders(self) -> np.ndarray:
        """Ids of the births that are the source cities, as their codes have them."""
        return self.ids[(self.operator == "source") & (self.generation == 0)]

    # -- goals -------------------------------------------------------------------------------

    @cached_property
    def wanted(self) -> Aims:
        """What the run wants, by the weights it has now. Raises `RunError` where it does not
        tell."""
        return aims_of_run(self.run)

    @property
    def goals(self) -> tuple[str, ...]:
        """Names of the goals: a measure's, or a sum's."""
        return self.wanted.names

    @cached_property
    def losses(self) -> np.ndarray:
        """Float64 ``(n, goals)``, lower is better; the worst of all where a birth was not
        measured."""
        return losses_of(self.wanted, self._wanted_values)

    @cached_property
    def violation(self) -> np.ndarray:
        """Float64 ``(n,)``: how far each breaks the constraints, 0 where it keeps them."""
        return broken_by(self.wanted, self._wanted_values)

    @property
    def _wanted_values(self) -> dict[str, np.ndarray]:
        return {name: self.value(name) for name in self.run.header.measures}

    def losses_by(self, name: str, goal: str | None = None) -> np.ndarray:
        """Float64 ``(n,)``, lower is better, NaN where there is no value: by one measure, or by a
        sum of the run's. ``goal``: "max" or "min" in place of the run's own.

        Raises `RunError` for an unknown name, and for a measure of which the run wanted neither
        more nor less, unless a goal is given.
        """
        if goal is not None:
            check_word("goal", goal, ("max", "min"), "leave it out for the run's own", RunError)
        sums = sorted({aim.total for aim in self.aims} - {None})
        if name not in self.run.header.columns:
            if name in sums and goal is None:
                return self.losses[:, self.goals.index(name)]
            error = unknown(name, [*self.run.header.columns, *sums], str(self.run.path))
            if name in {measure.name for measure in measures()}:
                ask = f"the run did not log it: run.score(run.front(), [{name!r}]) measures it now"
                raise RunError(error.found, error.expected, ask)
            raise error
        aim = next(one for one in self.logged if one.name == name)
        if goal is not None:
            aim = replace(aim, goal=goal, target=None)
        if aim.target is None and aim.goal not in ("max", "min"):
            raise RunError(
                f"{self.run.path}: the run wanted neither more nor less of {name} ({aim.wanted})",
                "a measure with a goal",
                f'say which: run.best("{name}", goal="max")',
            )
        return aim.losses(self.value(name))

    def quality_on(self, island: str | None = None) -> str:
        """What the best of a cell is the best by, on an ``island`` or in the run as a whole: a
        measure, or a sum; all of them where there are several."""
        own = self.islands_noted.get(island, {}).get("measures")
        goals = {aim.total or aim.name: {aim.total, aim.name} for aim in self.aims if aim.sought}
        kept = [goal for goal, names in goals.items() if own is None or names & set(map(str, own))]
        return ", ".join(kept)

    # -- who lived ---------------------------------------------------------------------------

    @cached_property
    def members(self) -> "pa.Table":
        """Who lived in each generation, Arrow, see `evocity.store.Run.members`."""
        table = self.run.members()
        born = array_of(table["generation"])
        return table.filter(born <= self.last) if (born > self.last).any() else table

    @cached_property
    def lives(self) -> tuple[np.ndarray, np.ndarray]:
        """Of each that lived in each generation its number, and the row of the birth; once where
        it lived on several islands."""
        names = ("generation", "id")
        born, ids = (array_of(self.members[name]) for name in names)
        if self.run.header.islands:
            born, ids = np.unique(np.column_stack([born, ids]), axis=0).T
        return born, self.rows(ids)

    @cached_property
    def lived(self) -> np.ndarray:
        """Int64 ``(n,)``: in how many generations each lived."""
        return np.bincount(self.lives[1], minlength=len(self))

    @cached_property
    def alive(self) -> np.ndarray:
        """Bool ``(n,)``: it lives in the last generation."""
        found = np.zeros(len(self), bool)
        found[self.rows(array_of(self.run.members(self.last)["id"]))] = True
        return found

    def check_generation(self, generation: int) -> None:
        """Raise `RunError` unless a ``generation`` counts."""
        if isinstance(generation, bool) or generation not in range(self.last + 1):
            raise RunError(
                f"{self.run.path}: no generation {generation!r}",
                f"one of 0…{self.last}",
                "see `evocity status`",
            )

    def ranked(self, generation: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Ids and ranks of those who lived in a ``generation``, the last unless it is given, best
        first, as its algorithm has them. Of a run with islands each individual once, ranked by all
        goals together."""
        generation = self.last if generation is None else generation
        self.check_generation(generation)
        table = self.run.members(generation)
        ids, ranks = array_of(table["id"]), array_of(table["rank"])
        if not self.run.header.islands:
            order = np.argsort(array_of(table["slot"]), kind="stable")
            return ids[order], ranks[order]
        once = np.unique(ids)
        ranks = self._ranks(once, ids, ranks)
        order = np.lexsort((once, ranks))
        return once[order], ranks[order]

    def _ranks(self, once: np.ndarray, ids: np.ndarray, ranks: np.ndarray) -> np.ndarray:
        """The fronts of individuals by all goals; the best that an island tells, where the run does
        not tell what it wanted."""
        rows = self.rows(once)
        try:
            return ranks_of(self.losses[rows], self.violation[rows])
        except RunError:
            best = np.full(len(once), np.iinfo(np.int64).max)
            np.minimum.at(best, np.searchsorted(once, ids), ranks)
            return best

    # -- rows --------------------------------------------------------------------------------

    def rows(self, ids: Iterable[int]) -> np.ndarray:
        """The row of each of these ``ids``. Raises `RunError` for one that is none."""
        listed = ids if isinstance(ids, np.ndarray) else list(ids)
        try:
            sought = np.asarray(listed)
        except ValueError:  # lists of several lengths among them
            sought = np.asarray(listed, object)
        if not sought.size:
            return np.zeros(0, np.intp)
        if sought.ndim != 1:
            raise RunError(
                f"{self.run.path}: ids {shown(sought.tolist())}",
                "ids one after the other, not lists of them",
                "give for example [1, 2]",
            )
        if sought.dtype.kind not in "iu":
            self.run.individuals(sought.tolist())  # says what is wrong with it
        found = np.searchsorted(self.ids, sought)
        beyond = found == len(self.ids)
        missing = sought[beyond | (np.append(self.ids, 0)[found] != sought)]
        if missing.size:
            raise RunError(
                f"{self.run.path}: no individual {missing[0]}",
                f"an id of a birth in generations 0…{self.last}",
                f"take one from `evocity status {self.run.path}`, the report, or run.scores",
            )
        return found

    def expressed(self, birth: Birth) -> Expressed:
        """What a ``birth`` of the run stands for: its map, or why it has none."""
        if birth.genome is None:
            return Expressed(None, NEVER_BRED)
        return self.run.header.chromosome.express(birth.genome)

    @property
    def columns(self) -> list[str]:
        """Names of what each birth has, as tables call it: a measure by its own name, unless that
        is one of `OWN`."""
        own = [name for name in OWN if name != "island" or self.run.header.islands]
        return own + [label(name) for name in self.run.header.columns]

    def column(self, name: str) -> np.ndarray:
        """What each birth has under a ``name`` of `columns`. Raises `RunError` for another."""
        if name not in self.columns:
            raise unknown(name, self.columns, str(self.run.path))
        if name in OWN:
            return self.ids if name == "id" else getattr(self, name)
        return self.value(name.removeprefix("fitness."))


def label(measure: str) -> str:
    """What a table calls a ``measure``."""
    return f"fitness.{measure}" if measure in OWN else measure


def unknown(name: object, known: Collection[str], where: str) -> RunError:
    """What is told of a ``name`` that is none of those ``known``."""
    return RunError(
        f"{where}: there is no {name!r}",
        f"one of {', '.join(known)}",
        near_miss(str(name), known) or "name one that there is",
    )


__all__ = ["NEVER_BRED", "OWN", "Told", "label", "unknown"]
