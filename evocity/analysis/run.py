"""`Run`: a run folder and its births, as tables, graphs, pictures and files."""

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.arguments import check_count, ids_of, ids_of_any, mask_of
from evocity.analysis.births import Births
from evocity.analysis.clusters import farthest_first, label_clusters, medoids
from evocity.analysis.compromise import best_compromise, weights_of
from evocity.analysis.credit import credit_of
from evocity.analysis.fabric_genomes import shares_of
from evocity.analysis.goals import Aim
from evocity.analysis.individual import Individual
from evocity.analysis.likeness import Likeness
from evocity.analysis.optional_libraries import library
from evocity.analysis.pedigree import Pedigree, graph_of, steps_of
from evocity.analysis.series import diversity_of, series_of
from evocity.errors import RunError
from evocity.html_display import Displayed
from evocity.search.record import complete_run

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    import pyarrow as pa

    from evocity.analysis.comparison import Comparison
    from evocity.analysis.shortlist import Shortlist
    from evocity.analysis.view import View
    from evocity.search import Archive


def open_run(path: str | os.PathLike) -> "Run":
    """Open a run folder, read only. Opening a run executes nothing and changes nothing.

    The run may still be in progress; only whole generations are visible. Raises `RunError` if there
    is no run at ``path``, if it is damaged, or if another release wrote it with another schema.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> run.best("alignment").picture()  # doctest: +SKIP
    """
    return Run(path)


class Run(complete_run.CompleteRun, Displayed):
    """Run folder, read only; `evocity.open_run` opens it. It extends `evocity.store.RunLog`.

    Methods for several births return a pandas frame of their scores: one row for each birth, with
    the index ``id``. Methods for one birth return an `Individual`.
    The argument ``of`` chooses births by ids, individuals, a frame of scores, or a condition (see
    `where`). Births can be counted, indexed by id and iterated: ``len(run)``, ``run[97]``,
    ``run[-1]``, ``run[10:20]``, ``97 in run``.

    While a run is in progress, an object shows the generations that were whole at its first use,
    until `refresh`. Methods raise `RunError` if the run is damaged or has no whole generation, and
    `EvocityError` if they need pandas and it is missing.
    """

    @property
    def generations(self) -> range:
        """Numbers of the generations that were whole at the first use of this object: 0…g."""
        if not self.__dict__.get("_settled"):  # without any, the folder is looked at again
            self._settled = super().generations
        return self._settled

    def refresh(self) -> "Run":
        """Read the folder again, for new generations and a new recipe. Return the run itself."""
        path = self.path
        self.__dict__.clear()
        self.__init__(path)
        return self

    @cached_property
    def columns(self) -> Births:
        """All births as columns of numpy; needs no pandas."""
        return Births(self)

    @property
    def told(self) -> Births:
        """Former name of `columns`."""
        return self.columns

    # -- single births -----------------------------------------------------------------------

    def __len__(self) -> int:
        return len(self.columns) if self.generations else 0

    def __iter__(self) -> Iterator[Individual]:
        ids = self.columns.ids.tolist() if len(self) else ()
        return (Individual(self.columns, one) for one in ids)

    def __contains__(self, one: object) -> bool:
        if isinstance(one, Individual):
            return one.run.path.resolve() == self.path.resolve() and one.id in self
        whole = isinstance(one, Integral) and not isinstance(one, bool)
        return whole and len(self) > 0 and bool(np.isin(one, self.columns.ids))

    def __getitem__(self, which: int | slice) -> Individual | list[Individual]:
        """``run[97]``: the individual 97; ``run[-1]``: the last birth; ``run[10:20]``: ten
        individuals as a list."""
        if isinstance(which, slice):
            return [Individual(self.columns, one) for one in self.columns.ids[which].tolist()]
        whole = isinstance(which, Integral) and not isinstance(which, bool)
        if whole and which < 0 and -len(self) <= which:  # only this needs all births
            which = int(self.columns.ids[which])
        return Individual(self.columns, which)

    # -- tables of births --------------------------------------------------------------------

    def births(
        self,
        generation: int | None = None,
        columns: Sequence[str] | None = None,
        where: str | None = None,
    ) -> "pa.Table":
        """Return the births of one generation, or of all, as an Arrow table. polars and DuckDB read
        this table directly.

        The argument ``columns`` names columns in order, by default all of the log. See `where` for
        conditions. Raises `RunError` if a column is unknown or the generation not whole, and
        `EvocityError` if ``where`` is not a condition.
        """
        if where is None:
            return super().births(generation, columns)
        import pyarrow as pa
        import pyarrow.compute as pc

        kept = pa.array(self.columns.ids[mask_of(where, self.columns)])
        names = columns if columns is None else [*self._known(columns), "id"]
        table = super().births(generation, None if names is None else list(dict.fromkeys(names)))
        table = table.filter(pc.is_in(table["id"], value_set=kept))
        return table if columns is None else table.select(list(columns))

    @property
    def scores(self) -> "pd.DataFrame":
        """Scores of all births: one row for each, with the index ``id``. Columns: generation,
        operator, status, feasible (measured, and within all present bounds), seconds and alive (in
        the last generation), and each measure; NaN for no value. A run with islands also has
        ``island``. A measure whose name is already a column is named fitness.NAME."""
        return self.frame(slice(None))

    def frame(self, rows: np.ndarray | slice, **more: np.ndarray) -> "pd.DataFrame":
        """Return the `scores` of some ``rows`` of `columns`, in order, with ``more`` columns."""
        births = self.columns
        names = [name for name in births.columns if name not in ("id", "lived")]
        columns = {name: births.column(name)[rows] for name in names} | more
        pandas = library("pandas", "a table of births")
        index = pandas.Index(births.ids[rows], name="id")
        for name, column in columns.items():
            if column.dtype == object:  # text, of no births too
                columns[name] = pandas.Series(column, index, dtype="str")
        return pandas.DataFrame(columns, index)

    def where(self, condition: str) -> "pd.DataFrame":
        """Return the `scores` of the births that meet a ``condition``. Examples are "fsi > 2 and
        crumbs < 4", "operator == 'relocation' and not alive" and "0.2 < gsi <= 0.4". Names are
        columns of `scores`, ``id`` and ``lived``. The condition is parsed, never executed.

        Raises `EvocityError` if the text is not a condition, or names an unknown column.
        """
        return self.frame(mask_of(condition, self.columns))

    @property
    def series(self) -> "pd.DataFrame":
        """Course of the run, one row per generation: ``births`` and ``failures`` so far,
        ``living``, ``feasible`` ones among them, ``hypervolume`` and ``evaluations_per_second``.
        Columns ``best.<measure>`` and ``mean.<measure>`` summarise the living."""
        pandas = library("pandas", "a table of generations")
        columns = series_of(self.columns)
        index = pandas.Index(columns.pop("generation"), name="generation")
        return pandas.DataFrame(columns, index)

    # -- goals and the best ------------------------------------------------------------------

    @property
    def aims(self) -> list[Aim]:
        """Goal of each measure, in words and signs, in the recipe's order."""
        return list(self.columns.aims)

    def front(self, generation: int | None = None) -> "pd.DataFrame":
        """Return the `scores` of the front of a ``generation``, by default the last, best first:
        the living that no other dominates. With islands, the goals of all islands count."""
        ids, ranks = self.columns.ranked(generation)
        return self.frame(self.columns.rows(ids[ranks == 0]))

    def best(self, measure: str, goal: str | None = None, alive: bool = False) -> Individual:
        """Return the best birth by a ``measure``, or by a sum of measures in the recipe. Only
        births that keep the constraints count. Of equally good births, the first wins.

        goal : "max" or "min" in place of the run's own goal; required if the run has none.
        alive : whether only individuals that are alive in the last generation count.

        Raises `RunError` if the measure is unknown or has no goal, or if no birth qualifies.
        """
        births = self.columns
        losses = births.losses_by(measure, goal)
        rows = np.flatnonzero(births.feasible & np.isfinite(losses) & (births.alive | (not alive)))
        if not len(rows):
            raise self._none_left(f"no birth keeps the constraints and has a value of {measure}")
        return self[int(births.ids[rows[np.argmin(losses[rows])]])]

    def _none_left(self, found: str) -> RunError:
        return RunError(
            f"{self.path}: {found}",
            "at least one birth",
            "see the reason in run.scores, or with evocity status",
        )

    @cached_property
    def archive(self) -> "Archive":
        """The births of the whole run that no other dominates; of a run of MAP-Elites the best of
        each cell. See `evocity.archive`; ``run.archive.ids`` are their ids."""
        from evocity.search import archive

        return archive(self, self.columns.last)

    def compromise(
        self, weights: Mapping[str, float] | None = None, of: object = None
    ) -> Individual:
        """Return the best compromise of the archive, or ``of`` these births. Every birth has a
        distance from the best value of each goal. The compromise is the birth whose largest
        distance is smallest (achievement scalarisation, Wierzbicki 1980). The mapping ``weights``
        gives goals a weight: 1 by default, 0 to ignore the goal.

        Raises `EvocityError` for wrong weights, and `RunError` if there is no birth.
        """
        ids, heavy = self._feasible(of), weights_of(weights, self.columns.goals)
        return self[int(ids[best_compromise(self.columns.losses[self.columns.rows(ids)], heavy)])]

    def keep(self, n: int = 5, of: object = None) -> "Shortlist":
        """Return the ``n`` births of the archive, or ``of`` these, that are worth keeping. They are
        the compromise, the best by each goal, and births that look different; fewer if few differ.
        Each entry has ``individual``, ``role``, ``why``, ``gave_up`` and ``built``."""
        from evocity.analysis.shortlist import choose_shortlist

        check_count("n", n)
        where = "in the archive" if of is None else "given that keep the constraints"
        return choose_shortlist(self.columns, self._feasible(of), self.likeness, n, where)

    def view(
        self, of: object = None, measures: Sequence[str] | None = None, order: str | None = None
    ) -> "View":
        """Return a Jupyter widget of all births, or ``of`` these: a gallery and parallel
        coordinates with one filter. The attribute ``view.selected`` lists selected births, and
        ``view.filtered`` births that pass the filter. Without widgets, a notebook shows a picture.

        measures : first axes of the plot; by default the measures with a goal or bounds.
        order : column of `scores` that orders the births; ``-`` before the name reverses the order.
            The default is the first measure, best first.

        Raises `EvocityError` if anywidget is missing, or if a name is unknown.
        """
        from evocity.analysis.view import View

        return View(self, of, measures, order)

    # -- likeness ----------------------------------------------------------------------------

    @cached_property
    def likeness(self) -> Likeness:
        """Distances between births; keeps the maps that it decodes."""
        return Likeness(self.columns)

    def _ids(self, of: object) -> np.ndarray:
        """Ids that ``of`` names: ids, individuals, a frame, a condition; None for the archive."""
        return ids_of_any(self.archive.ids if of is None else of, self.columns)

    def _feasible(self, of: object) -> np.ndarray:
        """Ids that ``of`` names and that keep the constraints; at least one."""
        ids = np.unique(self._ids(of))
        kept = ids[self.columns.feasible[self.columns.rows(ids)]]
        if not len(kept):
            of_archive = "no birth keeps the constraints, so the archive is empty"
            given = f"none of {len(ids)} births keeps the constraints"
            raise self._none_left(of_archive if of is None else given)
        return kept

    def clusters(self, k: int, by: str = "looks", of: object = None) -> "pd.DataFrame":
        """Divide the archive, or ``of`` these births, into ``k`` groups of similar births. Return
        the scores with two more columns. The column ``cluster`` is the number of the group, from 0.
        The column ``medoid`` marks the middle birth of each group.

        by : kind of distance. "looks" is the share of the map that differs by more than a storey.
            "scores" is the difference of losses in units of their ranges. "kin" is the share of the
            map whose range blocks come from other places.

        Raises `EvocityError` if ``k`` is wrong, or if there are too many births to compare.
        """
        ids = self._ids(of)
        check_count("k", k, len(ids))
        distances = self.likeness.matrix(ids, by)
        chosen = medoids(distances, k)
        medoid = np.isin(np.arange(len(ids)), chosen)
        labels = label_clusters(distances, chosen)
        return self.frame(self.columns.rows(ids), cluster=labels, medoid=medoid)

    def nearest(
        self, one: int | Individual, n: int = 1, by: str = "looks", of: object = None
    ) -> "Individual | pd.DataFrame":
        """Return the birth of the archive, or ``of`` these, that is most similar to the birth
        ``one``. For ``n`` above 1, return the scores of the ``n`` most similar, nearest first, with
        ``distance``. See `clusters` for the kinds of distance."""
        (one,) = ids_of(one, self.columns)
        ids = self._ids(of)
        ids = ids[ids != one]
        check_count("n", n, len(ids))
        distances = self.likeness.from_one(int(one), ids, by)
        order = np.lexsort((ids, distances))[:n]
        if n == 1:
            return self[int(ids[order[0]])]
        return self.frame(self.columns.rows(ids[order]), distance=distances[order])

    def most_different(self, n: int, of: object = None, by: str = "looks") -> "pd.DataFrame":
        """Return the scores of ``n`` births of the archive, or ``of`` these: first the two that
        differ most, then always the farthest from all before. See `clusters` for the distances."""
        ids = self._ids(of)
        check_count("n", n, len(ids))
        rows = farthest_first(self.likeness.matrix(ids, by), n)
        return self.frame(self.columns.rows(ids[rows]))

    def diversity(self, by: str = "scores", generations: int = 50) -> "pd.DataFrame":
        """Return the mean distance ``apart`` between two living individuals, in generations spread
        evenly over the run. See `clusters` for the distances; "looks" decodes all living
        individuals."""
        check_count("generations", generations)
        pandas = library("pandas", "a table of generations")
        numbers, apart = diversity_of(self.columns, self.likeness, by, generations)
        return pandas.DataFrame({"apart": apart}, pandas.Index(numbers, name="generation"))

    # -- descent -----------------------------------------------------------------------------

    def survivors(self, n: int | None = None) -> "pd.DataFrame":
        """Return the scores of the (first ``n``) births that survived at least one generation. The
        column ``lived`` counts generations. The longest come first, then the
        first born."""
        lived = self.columns.lived
        rows = np.lexsort((self.columns.ids, -lived))[: np.count_nonzero(lived)]
        if n is not None:
            check_count("n", n)
            rows = rows[:n]
        return self.frame(rows, lived=lived[rows])

    @cached_property
    def pedigree(self) -> Pedigree:
        """Parents and ancestors of all births, as arrays."""
        return Pedigree(self.columns)

    @cached_property
    def operator_credit(self) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """The table of `credit` as arrays: names of the operators, and columns."""
        return credit_of(self.columns, self.pedigree)

    def credit(self) -> "pd.DataFrame":
        """Return one row per operator. Columns are ``births``, ``failed`` and ``survived`` (at
        least one generation). The column ``entered`` counts births that entered the archive when
        born. The column ``ancestors`` is the operator's share of the living and their ancestors.
        The column ``paid`` divides this share by the operator's share of births; above 1, the
        operator has paid. The column ``seconds`` is the mean time of a birth."""
        pandas = library("pandas", "a table of operators")
        names, columns = self.operator_credit
        return pandas.DataFrame(columns, pandas.Index(names, name="operator"))

    def lineage(self, one: int | Individual, generations: int | None = None) -> "nx.DiGraph":
        """Return the ancestors of ``one`` birth as a graph of networkx. Nodes are ids with their
        scores; edges lead from parent to child. The graph goes back ``generations`` steps, by
        default to the source cities."""
        library("networkx", "a lineage")
        births = self.columns
        rows = births.rows(ids_of(one, births))
        rows = self.pedigree.ancestors(rows, steps_of(generations))
        names = [name for name in births.columns if name not in ("id", "lived")]
        columns = {name: births.column(name)[rows] for name in names}
        return graph_of(births.ids[rows], columns, *self.pedigree.edges(rows))

    def ancestry(self, which: object) -> "dict[str, float] | pd.DataFrame":
        """Return the share of the map that comes from each source city. One birth gives a mapping
        from city to share. Several births give a frame: a row per birth, a column per city."""
        if isinstance(which, Integral | Individual):
            return self[int(self._ids(which)[0])].ancestry()
        pandas = library("pandas", "a table of shares")
        ids = self._ids(which)
        index = pandas.Index(ids, name="id")
        return pandas.DataFrame(shares_of(self, ids), index, list(self.header.cities))

    # -- other measures ----------------------------------------------------------------------

    def score(
        self, ids: object, measures: object, workers: int | None = None, timeout: float = 60.0
    ) -> "pd.DataFrame":
        """Measure births (ids, individuals or a frame) by measures that the run did not log. Return
        one column per measure, with NaN for missing values, and the reason in ``error``.

        measures : one measure or a list: names, measures, or files NAME.py, which are executed.
        workers : number of processes, by default one per core; 0 uses this process, no deadline.
        timeout : seconds that all measures of one birth may take together.

        The values are kept in the user's cache, evocity/scores in $XDG_CACHE_HOME or ~/.cache, and
        never in the run. Raises `FitnessError` for an unknown measure.
        """
        from evocity.analysis.scores import measures_of, score_births

        pandas = library("pandas", "a table of scores")
        chosen, ids = measures_of(measures), self._ids(ids)
        values, reasons = score_births(self, ids, chosen, workers, timeout)
        columns = {one.name: column for one, column in zip(chosen, values.T, strict=True)}
        table = pandas.DataFrame(columns, pandas.Index(ids, name="id"))
        table["error"] = pandas.Series(reasons, table.index, dtype=object)
        return table

    # -- files -------------------------------------------------------------------------------

    def to_csv(self, path: str | os.PathLike, form: str = "plain", of: object = None) -> None:
        """Write the scores of all births, or ``of`` these, as CSV, whole or not at all.

        The ``form`` is "plain" or "design-explorer". The second has columns named ``in:``
        (generation, operator, share of each city), ``out:`` (measures) and ``img``. It
        writes the archive by default, and a picture of each birth in the folder NAME-pictures next
        to the file.
        """
        from evocity.analysis.export import write_csv

        every = self.columns.ids if of is None and form == "plain" else self._ids(of)
        write_csv(self.columns, every, path, form)

    def save(self, which: object, path: str | os.PathLike, at: str | None = None) -> None:
        """Write births, as ids, individuals, a frame or the result of `keep`, into one file.

        A ``.zip`` holds a table of scores and the attribution. It also holds five files for each
        birth: map as GeoTIFF, footprints, picture, genome and scene. A ``.png`` is a contact sheet:
        maps on one scale, with ids and scores.

        at : source city at whose place the maps in a ``.zip`` lie, see `Individual.save`.
        """
        from evocity.analysis.export import roles_of, write_several

        write_several([self[int(one)] for one in self._ids(which)], path, at, roles_of(which))

    def compare(self, other: "Run | str | os.PathLike") -> "Comparison":
        """Compare this run with another, in frames. The frame ``recipes`` lists differences of the
        recipes. The frame ``hypervolume`` uses the goals of both runs. The frame ``fronts`` says
        which run dominates which. Printing the result shows sentences."""
        from evocity.analysis.comparison import compare

        return compare(self, other if isinstance(other, Run) else open_run(other))
