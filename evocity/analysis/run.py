"""`Run`: a run as one asks it the morning after."""

import os
from collections.abc import Iterator, Sequence
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from evocity import store
from evocity.analysis.births import Told, unknown
from evocity.analysis.condition import Condition
from evocity.analysis.extras import library
from evocity.analysis.individual import Individual
from evocity.analysis.series import series_of
from evocity.analysis.wanted import Aim
from evocity.displayed import Displayed
from evocity.errors import RunError

if TYPE_CHECKING:
    import pandas as pd
    import pyarrow as pa

    from evocity.search import Archive


def open_run(path: str | os.PathLike) -> "Run":
    """Open a run folder to see what happened in it; nothing in it is executed, nothing changed.

    Works while the run goes on: only whole generations are seen. Raises `RunError` if there
    is no run at ``path``, if it is damaged, or if another release wrote another schema.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> run.best("alignment").picture()  # doctest: +SKIP
    """
    return Run(path)


class Run(store.Run, Displayed):
    """A run folder, read only; made by `evocity.open_run`. What `evocity.store.Run` has, and more.

    What names several births gives a pandas frame of their scores, a birth a row, ``id`` its index;
    what names one gives an `Individual`. ``len(run)``, ``run[97]``, ``run[-1]``, ``run[10:20]``,
    ``97 in run`` and iteration go over births by id.

    Of a run that goes on, all of one object tells of the generations that were whole when it was
    first asked, until `refresh`. All methods raise `RunError` on damage, and where there is no
    whole generation yet; those that give frames `EvocityError` without pandas.
    """

    @property
    def generations(self) -> range:
        """Numbers of the generations that were whole when this was first asked: 0…g."""
        if not self.__dict__.get("_settled"):  # while there is none, it is looked for anew
            self._settled = super().generations
        return self._settled

    def refresh(self) -> "Run":
        """Look at the folder anew: at generations that have been bred since, at what was
        replaced. Returns the run itself."""
        path = self.path
        self.__dict__.clear()
        self.__init__(path)
        return self

    @cached_property
    def told(self) -> Told:
        """All births as columns of numpy, for who wants no pandas."""
        return Told(self)

    # -- births one by one -------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.told) if self.generations else 0

    def __iter__(self) -> Iterator[Individual]:
        return (Individual(self.told, one) for one in (self.told.ids.tolist() if len(self) else ()))

    def __contains__(self, one: object) -> bool:
        if isinstance(one, Individual):
            return one.run.path.resolve() == self.path.resolve() and one.id in self
        whole = isinstance(one, Integral) and not isinstance(one, bool)
        return whole and len(self) > 0 and bool(np.isin(one, self.told.ids))

    def __getitem__(self, which: int | slice) -> Individual | list[Individual]:
        """``run[97]``: the individual 97; ``run[-1]``: the last one born; ``run[10:20]``: those ten
        as a list."""
        if isinstance(which, slice):
            return [Individual(self.told, one) for one in self.told.ids[which].tolist()]
        if isinstance(which, Integral) and not isinstance(which, bool) and -len(self) <= which < 0:
            which = self.told.ids[which]
        return Individual(self.told, which)

    # -- births in tables --------------------------------------------------------------------

    def births(
        self,
        generation: int | None = None,
        columns: Sequence[str] | None = None,
        where: str | None = None,
    ) -> "pa.Table":
        """Births of one generation, or of all, as an Arrow table, which polars and DuckDB take as
        it is.

        ``columns``: those wanted, in their order; all those of the files if not given. ``where``:
        a condition, see `where`. Raises `RunError` for a name that is no column, and for a
        generation that is not whole; `EvocityError` for what is no condition.
        """
        if where is None:
            return super().births(generation, columns)
        import pyarrow as pa
        import pyarrow.compute as pc

        kept = pa.array(self.told.ids[self._kept(where)])
        asked = columns if columns is None else [*self._known(columns), "id"]
        table = super().births(generation, None if asked is None else list(dict.fromkeys(asked)))
        table = table.filter(pc.is_in(table["id"], value_set=kept))
        return table if columns is None else table.select(list(columns))

    @property
    def scores(self) -> "pd.DataFrame":
        """All births, a row each, index ``id``: generation, operator, status, feasible (it was
        measured, and keeps all bounds that now hold), seconds, alive (in the last generation), then
        the measures under their own names; NaN where there is no value. In a run with islands
        ``island`` too. A measure named as one of these columns is fitness.NAME."""
        return self.frame(slice(None))

    def frame(self, rows: np.ndarray | slice, **more: np.ndarray) -> "pd.DataFrame":
        """The `scores` of some ``rows`` of `told`, in their order, with ``more`` columns."""
        told = self.told
        names = [name for name in told.columns if name not in ("id", "lived")]
        columns = {name: told.column(name)[rows] for name in names} | more
        pandas = library("pandas", "a table of births")
        return pandas.DataFrame(columns, pandas.Index(told.ids[rows], name="id"))

    def where(self, condition: str) -> "pd.DataFrame":
        """The `scores` of the births that meet a ``condition``: "fsi > 2 and crumbs < 4", "operator
        == 'relocation' and not alive", "0.2 < gsi <= 0.4". Its names are columns of `scores`, and
        ``id`` and ``lived``. It is read, never executed.

        Raises `EvocityError` for what is none, and for a name that is no column.
        """
        return self.frame(self._kept(condition))

    def _kept(self, condition: str) -> np.ndarray:
        """Bool: which births meet a ``condition``."""
        told = self.told
        return Condition.read(condition, told.columns).kept(told.column, len(told))

    @property
    def series(self) -> "pd.DataFrame":
        """A row a generation, index ``generation``: births and failures up to then, living,
        feasible of them, hypervolume, evaluations_per_second; ``best.<measure>``, the best of the
        living; ``mean.<measure>`` of the living."""
        pandas = library("pandas", "a table of generations")
        columns = series_of(self.told)
        index = pandas.Index(columns.pop("generation"), name="generation")
        return pandas.DataFrame(columns, index)

    # -- what was wanted, and who is good ----------------------------------------------------

    @property
    def aims(self) -> list[Aim]:
        """What was wanted of each measure, in words and signs, in the recipe's order."""
        return list(self.told.aims)

    def front(self, generation: int | None = None) -> "pd.DataFrame":
        """The `scores` of those who lived in a ``generation``, the last unless it is given, and
        whom none of these dominated, best first. Of a run with islands by all goals together."""
        ids, ranks = self.told.ranked(generation)
        return self.frame(self.told.rows(ids[ranks == 0]))

    def best(self, measure: str, goal: str | None = None, alive: bool = False) -> Individual:
        """Of all births that keep the constraints the best by a ``measure``, or by a sum of the
        run's; of equal ones the first born.

        goal : "max" or "min" in place of the run's own; needed where the run wanted nothing of it.
        alive : only of those who live in the last generation.

        Raises `RunError` for an unknown measure, for one without a goal, and if nobody qualifies.
        """
        told = self.told
        losses = self._losses_by(measure, goal)
        rows = np.flatnonzero(told.feasible & np.isfinite(losses) & (told.alive | (not alive)))
        if not len(rows):
            raise RunError(
                f"{self.path}: no birth keeps the constraints and has a value of {measure}",
                "one at least",
                "see why: run.scores, or evocity status",
            )
        return self[int(told.ids[rows[np.argmin(losses[rows])]])]

    def _losses_by(self, measure: str, goal: str | None) -> np.ndarray:
        """What a ``measure`` or a sum is of each birth, lower is better."""
        told = self.told
        if measure in self.header.columns:
            aims = {aim.name: aim for aim in [*told.aims, *told.recorded]}
            return _losses(aims[measure], told.value(measure), goal, self)
        sums = {aim.total for aim in told.aims} - {None}
        if measure in sums and goal is None:
            return told.losses[:, told.goals.index(measure)]
        raise unknown(measure, [*self.header.columns, *sorted(sums)], str(self.path))

    @cached_property
    def archive(self) -> "Archive":
        """Of all births those that no other ever dominated, the dead among them; of a run of
        MAP-Elites the best of each cell. See `evocity.archive`; ``run.archive.ids`` are theirs."""
        from evocity.search import archive

        return archive(self, self.told.last)


def _losses(aim: Aim, values: np.ndarray, goal: str | None, run: Run) -> np.ndarray:
    if goal not in (None, "max", "min"):
        raise RunError(f"goal = {goal!r}", "max or min", "leave it out for the run's own")
    if goal is None and aim.target is not None:
        return np.abs(values - aim.target)
    goal = goal or aim.goal
    if goal not in ("max", "min"):
        raise RunError(
            f"{run.path}: the run wanted neither more nor less of {aim.name} ({aim.wanted})",
            "a measure with a goal",
            f'say which: run.best("{aim.name}", goal="max")',
        )
    return values if goal == "min" else -values


__all__ = ["Run", "open_run"]
