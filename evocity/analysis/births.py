"""All births of a run as columns of numpy: read once, up to one generation."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from pydantic_core import from_json

from evocity.analysis.goals import Aim, aims_of, recorded_of
from evocity.columns import array_of, lists_of, words_of
from evocity.errors import RunError, check_word, near_miss, spell
from evocity.fitness import Aims, measures
from evocity.genome import VOID
from evocity.kinds import Expressed
from evocity.search.record.aims import aims_of_run, births_without_genomes, losses_of, violations_of
from evocity.search.record.grid import Binned, binned, grid_of_run
from evocity.selection.cells import Grid
from evocity.selection.fronts import ranks_of
from evocity.store import Birth, RunLog, Source

if TYPE_CHECKING:
    import pyarrow as pa

#: Columns of a birth besides its measures, in the order of tables; `island` in runs with islands.
OWN = ("generation", "id", "island", "operator", "status", "feasible", "seconds", "alive", "lived")
#: Why a birth without a genome has no map.
NEVER_BRED = "it was never bred"


class Births:
    """The births of a ``run`` in its generations 0…``last``, one row each, by id."""

    def __init__(self, run: RunLog, last: int | None = None):
        self.run = run
        if not run.generations:
            raise RunError(
                f"{run.path} has no complete generation yet",
                "at least one complete generation",
                "wait for the first generation to end, or resume the run: "
                f"evocity resume {run.path}",
            )
        #: The last generation that counts.
        self.last = run.generations[-1] if last is None else last

    def __len__(self) -> int:
        return len(self.ids)

    # -- columns -----------------------------------------------------------------------------

    @cached_property
    def history(self) -> list[dict]:
        return [one for one in RunLog.history(self.run) if one["generation"] <= self.last]

    @property
    def is_read(self) -> bool:
        return "_table" in self.__dict__

    @cached_property
    def _table(self) -> "pa.Table":
        header = self.run.header
        columns = ["generation", "id", "parents", "operator", "status", "seconds"]
        columns += ["island"] if header.islands else []
        columns += [f"fitness.{name}" for name in header.columns]
        table = self.read(columns)
        if (np.diff(array_of(table["id"])) <= 0).any():
            raise RunError(
                f"{self.run.path}: the log of births is damaged, because an id occurs twice",
                "a log of births as `evocity run` writes it",
                "restore the run folder from a backup",
            )
        return table

    def read(self, columns: Sequence[str]) -> "pa.Table":
        """Read ``columns`` of the log, with generation and id, of all births by id."""
        table = RunLog.births(self.run, columns=list(dict.fromkeys(["generation", "id", *columns])))
        table = table.replace_schema_metadata(None)
        born = array_of(table["generation"])
        if (born > self.last).any():  # the run may go on
            table = table.filter(born <= self.last)
        if (np.diff(array_of(table["id"])) < 0).any():
            table = table.sort_by("id")
        return table

    #: Ids ``(n,)``, int64, rising; generations, int32; seconds of a worker, float64.
    ids = cached_property(lambda self: array_of(self._table["id"]))
    generation = cached_property(lambda self: array_of(self._table["generation"]))
    seconds = cached_property(lambda self: array_of(self._table["seconds"]))
    #: Texts ``(n,)``: the operator, the status at the end, the island in a run with islands.
    operator = cached_property(lambda self: words_of(self._table["operator"]))
    status = cached_property(lambda self: words_of(self._table["status"]))
    island = cached_property(lambda self: words_of(self._table["island"]))

    @property
    def parents(self) -> "pa.ListArray":
        """Int64 lists ``(n,)``: the ids of each birth's parents."""
        return self._table["parents"].combine_chunks()

    @cached_property
    def values(self) -> np.ndarray:
        """Float64 ``(n, measures)`` in the order of ``header.columns``; NaN for no value."""
        names = [f"fitness.{name}" for name in self.run.header.columns]
        values = np.empty((len(self), len(names)))
        for column, name in zip(values.T, names, strict=True):
            column[:] = array_of(self._table[name])
        return values

    def value(self, name: str) -> np.ndarray:
        """Return the values of the measure ``name``, float64 ``(n,)``."""
        return self.values[:, self.run.header.columns.index(name)]

    #: Goals and bounds of the measures; the measures that the run only records.
    aims = cached_property(lambda self: aims_of(self.run))
    recorded = cached_property(lambda self: recorded_of(self.run))

    @property
    def logged(self) -> list[Aim]:
        """All measures of the log: those with a goal or bounds, then the recorded ones."""
        return [*self.aims, *self.recorded]

    @property
    def sought(self) -> list[Aim]:
        """The measures that have a goal, not only bounds."""
        return [aim for aim in self.aims if aim.sought]

    @cached_property
    def ok(self) -> np.ndarray:
        """Bool ``(n,)``: bred, with a value of each measure that has a goal."""
        ok = self.status == "ok"
        for aim in self.sought:
            ok &= ~np.isnan(self.value(aim.name))
        return ok

    @cached_property
    def feasible(self) -> np.ndarray:
        """Bool ``(n,)``: measured, and within all bounds that hold now."""
        within = self.ok.copy()
        for aim in self.aims:
            within &= aim.within(self.value(aim.name))
        return within

    @cached_property
    def copies(self) -> np.ndarray:
        """Bool ``(n,)``: bred, with the code of a parent."""
        digests = np.array(self.read(["genome"])["genome"].to_pylist(), object)
        lengths, parents = lists_of(self.parents)
        child = np.repeat(np.arange(len(self)), lengths)
        at = np.minimum(np.searchsorted(self.ids, parents), len(self) - 1)
        equal = (self.ids[at] == parents) & (digests[at] == digests[child])
        copies = np.zeros(len(self), bool)
        copies[child[equal & (digests[child] != None)]] = True  # noqa: E711
        return copies

    @cached_property
    def redrawn(self) -> list[list[str]]:
        """The operators whose children gave way to other draws, of each birth that was drawn
        again."""
        texts = (text for text in self.read(["made"])["made"].to_pylist() if text)
        made = (from_json(text) for text in texts if '"redrawn"' in text)
        lists = [one.get("redrawn") for one in made if isinstance(one, dict)]
        return [list(map(str, one)) for one in lists if isinstance(one, list)]

    @cached_property
    def sources(self) -> list[Source]:
        return self.run.sources()

    @cached_property
    def island_settings(self) -> dict[str, Mapping]:
        """Island -> its table of the recipe, as provenance records it."""
        recipe = self.run.provenance.get("recipe")
        listed = recipe.get("islands") if isinstance(recipe, Mapping) else None
        listed = listed if isinstance(listed, list) else ()
        tables = [one for one in listed if isinstance(one, Mapping)]
        return {str(one.get("name")): one for one in tables}

    @cached_property
    def founders(self) -> np.ndarray:
        """Ids of the births that are the source cities' own codes."""
        return self.ids[(self.operator == "source") & (self.generation == 0)]

    # -- goals -------------------------------------------------------------------------------

    @cached_property
    def weighted_aims(self) -> Aims:
        """Goals and constraints with their present weights, if they are recorded."""
        return aims_of_run(self.run)

    @property
    def goals(self) -> tuple[str, ...]:
        """Names of the goals: of measures, or of sums of measures."""
        return self.weighted_aims.names

    @cached_property
    def has_known_goals(self) -> bool:
        """Whether provenance records the goals, and the grid of a run with one."""
        with suppress(RunError):
            grid_of_run(self.run)
            return bool(self.goals)
        return False

    @cached_property
    def losses(self) -> np.ndarray:
        """Float64 ``(n, goals)``, lower is better; the largest number without a measure."""
        return losses_of(self.weighted_aims, self._aim_values)

    @cached_property
    def violation(self) -> np.ndarray:
        """Float64 ``(n,)``: how far each breaks the constraints, 0 where it keeps them."""
        return violations_of(self.weighted_aims, self._aim_values)

    @property
    def _aim_values(self) -> dict[str, np.ndarray]:
        return {name: self.value(name) for name in self.run.header.measures}

    def losses_by(self, name: str, goal: str | None = None) -> np.ndarray:
        """Return the losses by one measure, or by a sum of measures: float64 ``(n,)``, lower is
        better, NaN for no value. ``goal``: "max" or "min" in place of the run's own goal."""
        if goal is not None:
            check_word("goal", goal, ("max", "min"), "leave it out for the run's own", RunError)
        sums = sorted({aim.total for aim in self.aims} - {None})
        if name not in self.run.header.columns:
            if name in sums and goal is None:
                return self.losses[:, self.goals.index(name)]
            error = unknown(name, [*self.run.header.columns, *sums], str(self.run.path))
            if name in {measure.name for measure in measures()}:
                remedy = f"the run did not log it; measure it: run.score(run.front(), [{name!r}])"
                raise RunError(error.found, error.expected, remedy)
            raise error
        aim = next(one for one in self.logged if one.name == name)
        if goal is not None:
            aim = replace(aim, goal=goal, target=None)
        if aim.target is None and aim.goal not in ("max", "min"):
            raise RunError(
                f"{self.run.path}: the measure {name} has no goal in this run ({aim.wanted})",
                "a measure with a goal",
                f'give a goal: run.best("{name}", goal="max")',
            )
        return aim.losses(self.value(name))

    def quality_on(self, island: str | None = None) -> str:
        """Return the goal of a cell on an ``island`` or in the run; several goals with commas."""
        own = self.island_settings.get(island, {}).get("measures")
        goals = {aim.total or aim.name: {aim.total, aim.name} for aim in self.sought}
        kept = [goal for goal, names in goals.items() if own is None or names & set(map(str, own))]
        return ", ".join(kept)

    @cached_property
    def grids(self) -> dict[str | None, Binned]:
        """The best of each cell, of each grid: island -> grid, None for the run as a whole."""
        grids = {}
        for island in self.run.header.islands or (None,):
            with suppress(RunError):
                grid = grid_of_run(self.run, island)
                goal = None if island is None else self.quality_on(island)
                if grid is not None:
                    grids[island] = binned(self.run, grid, self.last, goal)
        return grids

    def source_cells(self, grid: Grid) -> dict[int, np.ndarray]:
        """Return the place in the ``grid`` of each source city's genome, by city number."""
        numbers = self.founders[self.founders < len(self.run.header.cities)]
        rows = self.rows(numbers)
        values = [self.value(name)[rows] for name in grid.descriptors]
        cells = grid.cells(np.column_stack(values))
        known = cells >= 0
        return dict(zip(numbers[known].tolist(), grid.places(cells[known]), strict=True))

    # -- the living --------------------------------------------------------------------------

    @cached_property
    def members(self) -> "pa.Table":
        """The living of each generation, an Arrow table, see `evocity.store.RunLog.members`."""
        table = self.run.members()
        born = array_of(table["generation"])
        return table.filter(born <= self.last) if (born > self.last).any() else table

    @cached_property
    def lives(self) -> tuple[np.ndarray, np.ndarray]:
        """Generation and row of each living birth of each generation, once for several islands."""
        born, ids = (array_of(self.members[name]) for name in ("generation", "id"))
        if self.run.header.islands:
            born, ids = np.unique(np.column_stack([born, ids]), axis=0).T
        return born, self.rows(ids)

    @cached_property
    def lived(self) -> np.ndarray:
        """Int64 ``(n,)``: the number of generations in which each lived."""
        return np.bincount(self.lives[1], minlength=len(self))

    @cached_property
    def alive(self) -> np.ndarray:
        """Bool ``(n,)``: alive in the last generation."""
        alive = np.zeros(len(self), bool)
        alive[self.rows(array_of(self.run.members(self.last)["id"]))] = True
        return alive

    @cached_property
    def front(self) -> np.ndarray:
        """Int64: ids of the last generation's front, best first."""
        ids, ranks = self.ranked()
        return ids[ranks == 0]

    def check_generation(self, generation: int) -> None:
        """Raise `RunError` unless ``generation`` is one of 0…`last`."""
        if isinstance(generation, bool) or generation not in range(self.last + 1):
            raise RunError(
                f"{self.run.path}: the run has no generation {generation!r}",
                f"a generation from 0 to {self.last}",
                "choose a generation up to the last generation that `evocity status` prints",
            )

    def ranked(self, generation: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Return ids and ranks of the living of a ``generation``, best first by the algorithm; in a
        run with islands each once, ranked by all goals together."""
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
        """Ranks by all goals; the best rank on any island where the goals are not recorded."""
        rows = self.rows(once)
        try:
            return ranks_of(self.losses[rows], self.violation[rows])
        except RunError:
            best = np.full(len(once), np.iinfo(np.int64).max)
            np.minimum.at(best, np.searchsorted(once, ids), ranks)
            return best

    # -- rows --------------------------------------------------------------------------------

    def rows(self, ids: Iterable[int]) -> np.ndarray:
        """Return the row of each of ``ids``. Raises `RunError` for an unknown id."""
        listed = ids if isinstance(ids, np.ndarray) else list(ids)
        try:
            sought = np.asarray(listed)
        except ValueError:  # lists of several lengths among them
            sought = np.asarray(listed, object)
        if not sought.size:
            return np.zeros(0, np.intp)
        if sought.ndim != 1:
            raise RunError(
                f"{self.run.path}: the argument 'ids' has the value {spell(sought.tolist())}",
                "a flat list of ids",
                "give the ids in a list, for example [1, 2]",
            )
        if sought.dtype.kind not in "iu":
            self.run.individuals(sought.tolist())  # raises, and names the fault
        rows = np.searchsorted(self.ids, sought)
        beyond = rows == len(self.ids)
        missing = sought[beyond | (np.append(self.ids, 0)[rows] != sought)]
        if missing.size:
            raise RunError(
                f"{self.run.path}: the run has no individual {missing[0]}",
                f"an id of a birth in generations 0…{self.last}",
                f"take an id from `evocity status {self.run.path}`, the report, or run.scores",
            )
        return rows

    def expressed(self, birth: Birth) -> Expressed:
        """Return the map of a ``birth`` of the run, or the reason why it has none."""
        if birth.genome is None:
            return Expressed(None, NEVER_BRED)
        return self.run.header.chromosome.express(birth.genome)

    @property
    def columns(self) -> list[str]:
        """Names of the columns of tables: a measure's own name, unless it is one of `OWN`."""
        own = [name for name in OWN if name != "island" or self.run.header.islands]
        return own + [label(name) for name in self.run.header.columns]

    def column(self, name: str) -> np.ndarray:
        """Return the column ``name``, one of `columns`. Raises `RunError` for another name."""
        if name not in self.columns:
            raise unknown(name, self.columns, str(self.run.path))
        if name in OWN:
            return self.ids if name == "id" else getattr(self, name)
        return self.value(name.removeprefix("fitness."))


def source_births(run: RunLog) -> list[Birth]:
    """Return the births of the source cities, in the order of the cities, without genomes."""
    places = [place for place, name in enumerate(run.header.cities) if name != VOID]
    ids = set(places[: run.header.population])
    births = births_without_genomes(run, 0)
    return [birth for birth in births if birth.operator == "source" and birth.id in ids]


def label(measure: str) -> str:
    return f"fitness.{measure}" if measure in OWN else measure


def unknown(name: object, known: Collection[str], where: str) -> RunError:
    """Make the error for a ``name`` that is not among those ``known``."""
    return RunError(
        f"{where}: there is no {name!r}",
        f"one of {', '.join(known)}",
        near_miss(str(name), known) or "choose one of these names",
    )
