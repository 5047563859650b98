"""`Run`: a run as one asks it the morning after."""

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.asked import check_count, ids_of, ids_of_any, kept_by
from evocity.analysis.births import Told
from evocity.analysis.clusters import labelled, medoids
from evocity.analysis.compromise import best_compromise, weights_of
from evocity.analysis.credit import credit_of
from evocity.analysis.extras import library
from evocity.analysis.fabrics import fabric_of
from evocity.analysis.individual import Individual
from evocity.analysis.likeness import Likeness
from evocity.analysis.pedigree import Pedigree, graph_of, steps_of
from evocity.analysis.series import series_of
from evocity.analysis.spread import diversity_of, farthest_first
from evocity.analysis.wanted import Aim
from evocity.displayed import Displayed
from evocity.errors import RunError
from evocity.search import opening

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    import pyarrow as pa

    from evocity.analysis.comparing import Comparison
    from evocity.analysis.keeping import Keeping
    from evocity.analysis.view import View
    from evocity.search import Archive

# Births whose genomes are held at a time.
_AT_A_TIME = 256


def open_run(path: str | os.PathLike) -> "Run":
    """Open a run folder to see what happened in it; nothing in it is executed, nothing changed.

    Works while the run goes on: only whole generations are seen. Raises `RunError` if there
    is no run at ``path``, if it is damaged, or if another release wrote another schema.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> run.best("alignment").picture()  # doctest: +SKIP
    """
    return Run(path)


class Run(opening.Run, Displayed):
    """A run folder, read only; made by `evocity.open_run`. What `evocity.store.Run` has, and more.

    What names several births gives a pandas frame of their scores, a birth a row, ``id`` its index;
    what names one gives an `Individual`. Where ``of`` asks which births, it takes ids, individuals,
    such a frame, or a condition, see `where`. ``len(run)``, ``run[97]``, ``run[-1]``,
    ``run[10:20]``, ``97 in run`` and iteration go over births by id.

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
        whole = isinstance(which, Integral) and not isinstance(which, bool)
        if whole and which < 0 and -len(self) <= which:  # only the last ones need all to be read
            which = int(self.told.ids[which])
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

        kept = pa.array(self.told.ids[kept_by(where, self.told)])
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
        index = pandas.Index(told.ids[rows], name="id")
        for name, column in columns.items():
            if column.dtype == object:  # text, of no births too
                columns[name] = pandas.Series(column, index, dtype="str")
        return pandas.DataFrame(columns, index)

    def where(self, condition: str) -> "pd.DataFrame":
        """The `scores` of the births that meet a ``condition``: "fsi > 2 and crumbs < 4", "operator
        == 'relocation' and not alive", "0.2 < gsi <= 0.4". Its names are columns of `scores`, and
        ``id`` and ``lived``. It is read, never executed.

        Raises `EvocityError` for what is none, and for a name that is no column.
        """
        return self.frame(kept_by(condition, self.told))

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
        losses = told.losses_by(measure, goal)
        rows = np.flatnonzero(told.feasible & np.isfinite(losses) & (told.alive | (not alive)))
        if not len(rows):
            raise self._nobody(f"no birth keeps the constraints and has a value of {measure}")
        return self[int(told.ids[rows[np.argmin(losses[rows])]])]

    def _nobody(self, found: str) -> RunError:
        return RunError(
            f"{self.path}: {found}", "one at least", "see why: run.scores, or evocity status"
        )

    @cached_property
    def archive(self) -> "Archive":
        """Of all births those that no other ever dominated, the dead among them; of a run of
        MAP-Elites the best of each cell. See `evocity.archive`; ``run.archive.ids`` are theirs."""
        from evocity.search import archive

        return archive(self, self.told.last)

    def compromise(
        self, weights: Mapping[str, float] | None = None, of: object = None
    ) -> Individual:
        """The best compromise of the archive, or ``of`` these births: the one that is least behind,
        in the goal where it is farthest behind the best of them (achievement scalarisation after
        Wierzbicki 1980). ``weights``: how much goals count, by name; 1 unless told, 0 for not.

        Raises `EvocityError` for weights that are none, `RunError` if there is no birth.
        """
        ids, heavy = self._feasible(of), weights_of(weights, self.told.goals)
        return self[int(ids[best_compromise(self.told.losses[self.told.rows(ids)], heavy)])]

    def keep(self, n: int = 5, of: object = None) -> "Keeping":
        """The ``n`` births of the archive, or ``of`` these, that are worth keeping, or as many as
        differ, the dead too: the compromise, the best by each goal, one of each kind of look. Each
        has ``individual``, ``role``, ``why``, what it ``gave_up``, whose stones are ``built``."""
        from evocity.analysis.keeping import kept_of

        check_count("n", n)
        where = "in the archive" if of is None else "given that keep the constraints"
        return kept_of(self.told, self._feasible(of), self._likeness, n, where)

    def view(
        self, of: object = None, measures: Sequence[str] | None = None, order: str | None = None
    ) -> "View":
        """All births, or ``of`` these, as a gallery and parallel coordinates with one filter: a
        widget of Jupyter. What is chosen there is ``view.selected``, what passes the filter
        ``view.filtered``; where widgets do not live, a picture stands in its place.

        measures : the axes at first; those that something was wanted of unless they are given.
        order : a name of `scores`; ``-`` before it turns the order. By the first measure, best
            first, unless it is given.

        Raises `EvocityError` without anywidget, and for a name that is none.
        """
        from evocity.analysis.view import View

        return View(self, of, measures, order)

    # -- who is like whom --------------------------------------------------------------------

    @cached_property
    def _likeness(self) -> Likeness:
        return Likeness(self.told)

    def _ids(self, of: object) -> np.ndarray:
        """The births that ``of`` names: one or many ids or individuals, a frame, a condition; None
        for the archive."""
        return ids_of_any(self.archive.ids if of is None else of, self.told)

    def _feasible(self, of: object) -> np.ndarray:
        """Those of the births that ``of`` names that keep the constraints; at least one."""
        ids = np.unique(self._ids(of))
        found = ids[self.told.feasible[self.told.rows(ids)]]
        if not len(found):
            of_archive = "no birth keeps the constraints, so the archive is empty"
            given = f"none of {len(ids)} births keeps the constraints"
            raise self._nobody(of_archive if of is None else given)
        return found

    def clusters(self, k: int, by: str = "looks", of: object = None) -> "pd.DataFrame":
        """The `scores` of the archive, or ``of`` these births, in ``k`` groups of like ones:
        ``cluster``, their number from 0, and ``medoid``, whether it is the one in the middle.

        by : "looks", the share of the map that differs by more than a storey; "scores", losses in
            units of their ranges; "kin", the share of the map with other stones.

        Raises `EvocityError` for a ``k`` that is none, or more births than can be compared.
        """
        ids = self._ids(of)
        check_count("k", k, len(ids))
        distances = self._likeness.matrix(ids, by)
        chosen = medoids(distances, k)
        medoid = np.isin(np.arange(len(ids)), chosen)
        labels = labelled(distances, chosen)
        return self.frame(self.told.rows(ids), cluster=labels, medoid=medoid)

    def nearest(
        self, one: int | Individual, n: int = 1, by: str = "looks", of: object = None
    ) -> "Individual | pd.DataFrame":
        """The birth of the archive, or ``of`` these, that is most like ``one``, other than itself:
        an `Individual`; for ``n`` above 1 their `scores` and ``distance``, the nearest first.
        ``by`` as `clusters` has it."""
        (one,) = ids_of(one, self.told)
        ids = self._ids(of)
        ids = ids[ids != one]
        check_count("n", n, len(ids))
        distances = self._likeness.from_one(int(one), ids, by)
        order = np.lexsort((ids, distances))[:n]
        if n == 1:
            return self[int(ids[order[0]])]
        return self.frame(self.told.rows(ids[order]), distance=distances[order])

    def most_different(self, n: int, of: object = None, by: str = "looks") -> "pd.DataFrame":
        """The `scores` of ``n`` of the archive, or ``of`` these births: the two that are farthest
        apart, then each time the one farthest from all before it. ``by`` as `clusters` has it."""
        ids = self._ids(of)
        check_count("n", n, len(ids))
        rows = farthest_first(self._likeness.matrix(ids, by), n)
        return self.frame(self.told.rows(ids[rows]))

    def diversity(self, by: str = "scores", generations: int = 50) -> "pd.DataFrame":
        """How far two of the living are from each other in the mean, ``apart``, in so many
        ``generations`` evenly from the first to the last, index ``generation``. ``by`` as
        `clusters` has it; by looks all of the living are decoded."""
        check_count("generations", generations)
        pandas = library("pandas", "a table of generations")
        numbers, apart = diversity_of(self.told, self._likeness, by, generations)
        return pandas.DataFrame({"apart": apart}, pandas.Index(numbers, name="generation"))

    # -- who came of what --------------------------------------------------------------------

    def survivors(self, n: int | None = None) -> "pd.DataFrame":
        """The `scores` of the births that lived in a generation at least, or of the first ``n`` of
        them, with ``lived``, in how many; longest first, of equal ones the first born."""
        lived = self.told.lived
        rows = np.lexsort((self.told.ids, -lived))[: np.count_nonzero(lived)]
        if n is not None:
            check_count("n", n)
            rows = rows[:n]
        return self.frame(rows, lived=lived[rows])

    @cached_property
    def _pedigree(self) -> Pedigree:
        return Pedigree(self.told)

    def credit(self) -> "pd.DataFrame":
        """Which operators paid, a row each, index ``operator``: ``births``; ``failed`` of them;
        ``survived``, who lived in a generation at least; ``entered``, whom none born until then
        dominated, of equal ones the first; ``ancestors``, its share of all from whom the living
        descend, 0…1, the living among them; ``paid``, that share by its share of the births: above
        1 where it has paid; ``seconds``, the mean of a birth."""
        pandas = library("pandas", "a table of operators")
        names, columns = credit_of(self.told, self._pedigree)
        return pandas.DataFrame(columns, pandas.Index(names, name="operator"))

    def lineage(self, one: int | Individual, generations: int | None = None) -> "nx.DiGraph":
        """From whom ``one`` descends, as a graph of networkx: nodes are ids, with what `scores`
        tells of each; edges lead from parent to child. ``generations``: so many steps back; all the
        way to the source cities unless it is told."""
        library("networkx", "a lineage")
        told = self.told
        rows = told.rows(ids_of(one, told))
        rows = self._pedigree.ancestors(rows, steps_of(generations))
        names = [name for name in told.columns if name not in ("id", "lived")]
        columns = {name: told.column(name)[rows] for name in names}
        return graph_of(told.ids[rows], columns, *self._pedigree.edges(rows))

    def ancestry(self, which: object) -> "dict[str, float] | pd.DataFrame":
        """Source city -> share of the map that is its stone, of one birth; of several, named by
        ids or a frame, a frame with a row each and a column a city."""
        if isinstance(which, Integral | Individual):
            return self[int(self._ids(which)[0])].ancestry()
        pandas = library("pandas", "a table of shares")
        ids = self._ids(which)
        found = np.full((len(ids), len(self.header.cities)), np.nan)
        order = np.argsort(ids, kind="stable")  # those of a generation lie together in the log
        for rows in np.array_split(order, len(ids) // _AT_A_TIME + 1):
            for row, birth in zip(rows, self.individuals(ids[rows].tolist()), strict=True):
                if birth.genome is not None:
                    found[row] = fabric_of(self.header, birth.genome, "the ancestry").shares
        index = pandas.Index(ids, name="id")
        return pandas.DataFrame(found, index, list(self.header.cities))

    # -- what the night did not ask ----------------------------------------------------------

    def score(
        self,
        ids: object,
        measures: object,
        workers: int | None = None,
        timeout: float = 60.0,
    ) -> "pd.DataFrame":
        """Measures that the run did not log, of these births (ids, individuals, a frame), index
        ``id``: a column each, NaN where it has no value, and ``error``, which says why.

        measures : names, files NAME.py, which are executed, or measures; one or a list.
        workers : processes, one a core unless told; 0 measures here, without a deadline.
        timeout : seconds, of all measures of one birth.

        What was measured once is kept in the user's cache, ``evocity/scores`` in $XDG_CACHE_HOME or
        ~/.cache, never in the run. Raises `FitnessError` for an unknown measure.
        """
        from evocity.analysis.scoring import measures_of, scored

        pandas = library("pandas", "a table of scores")
        asked, ids = measures_of(measures), self._ids(ids)
        values, reasons = scored(self, ids, asked, workers, timeout)
        columns = {one.name: column for one, column in zip(asked, values.T, strict=True)}
        table = pandas.DataFrame(columns, pandas.Index(ids, name="id"))
        table["error"] = pandas.Series(reasons, table.index, dtype=object)
        return table

    # -- files -------------------------------------------------------------------------------

    def to_csv(self, path: str | os.PathLike, form: str = "plain", of: object = None) -> None:
        """Write the scores of all births, or ``of`` these, as CSV. ``form``: "plain"; or
        "design-explorer", with ``in:`` (generation, operator, share of each city), ``out:``
        (measures) and ``img``, a picture each in the folder NAME-pictures beside it, of the archive
        unless ``of`` says otherwise. Nothing is left half-written."""
        from evocity.analysis.exporting import write_csv

        every = self.told.ids if of is None and form == "plain" else self._ids(of)
        write_csv(self.told, every, path, form)

    def save(self, which: object, path: str | os.PathLike, at: str | None = None) -> None:
        """Write births, named by ids, individuals, a frame or `keep`, into one ``path``. A .zip has
        of each its map as GeoTIFF, its footprints, a picture, its genome, its scene; their scores;
        whom to thank. A .png is a contact sheet: their maps on one scale, with ids and scores.

        at : a source city on whose ground all in a .zip are laid, as in `Individual.save`.
        """
        from evocity.analysis.exporting import roles_of, write_several

        write_several([self[int(one)] for one in self._ids(which)], path, at, roles_of(which))

    def compare(self, other: "Run | str | os.PathLike") -> "Comparison":
        """This run beside an ``other``: frames ``recipes``, what differs in them; ``hypervolume``
        by what both want; ``fronts``, who dominates whom; ``print`` tells it in sentences."""
        from evocity.analysis.comparing import Comparison, Side

        other = other if isinstance(other, Run) else open_run(other)
        names = [run.path.resolve().name for run in (self, other)]
        if names[0] == names[1]:
            names = [str(self.path), str(other.path)]
        if names[0] == names[1]:
            names[1] += " (2)"
        sides = zip(names, (self, other), strict=True)
        return Comparison(*(Side(name, run.told, run.archive.ids) for name, run in sides))


__all__ = ["Run", "open_run"]
