"""`Run`: a run folder and its births, as tables, graphs, pictures and files."""

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.arguments import check_count, ids_of, ids_of_any, mask_of
from evocity.analysis.births import Births
from evocity.analysis.clusters import farthest_first, label_clusters, medoids
from evocity.analysis.goals import Aim
from evocity.analysis.individual import Individual, shares_of
from evocity.analysis.likeness import Likeness
from evocity.analysis.pedigree import Pedigree, credit_of, graph_of, steps_of
from evocity.analysis.series import diversity_of, series_of
from evocity.analysis.shortlist import best_compromise, weights_of
from evocity.errors import RunError, is_whole
from evocity.html_display import Displayed
from evocity.lazy_imports import frame_of, library
from evocity.search.record import complete_run

if TYPE_CHECKING:
    import networkx as nx
    import pandas as pd
    import pyarrow as pa

    from evocity.analysis.comparison import Comparison
    from evocity.analysis.shortlist import Shortlist
    from evocity.analysis.view import View
    from evocity.search import Archive


class Run(complete_run.CompleteRun, Displayed):
    """Run folder that was opened for reading by `evocity.open_run`. The class `Run` extends
    `evocity.store.RunLog`.

    Methods for several births return a pandas data frame of scores, with one row per birth and the
    index ``id``. Methods for one birth return an `Individual`. The argument "of" chooses births:
    by ids, by individuals, by a data frame of scores, or by a condition (see `where`). You can
    count births, index births by id and iterate over births: ``len(run)``, ``run[97]``,
    ``run[-1]``, ``run[10:20]``, ``97 in run``.

    While a run is in progress, a `Run` object shows the generations that were complete when you
    first used the object. To see newer generations, call `refresh`. Methods raise `RunError` if the
    run is damaged or has no complete generation, and `EvocityError` if pandas is missing.
    """

    @property
    def generations(self) -> range:
        """Numbers 0…g of the generations that were complete when this object was first used."""
        if not self.__dict__.get("_settled"):  # without any, the folder is looked at again
            self._settled = super().generations
        return self._settled

    def refresh(self) -> "Run":
        """Read the run folder again, to see new generations and a changed recipe. Return this
        run."""
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
        """Former name of the attribute ``columns``."""
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
        return is_whole(one) and len(self) > 0 and bool(np.isin(one, self.columns.ids))

    def __getitem__(self, which: int | slice) -> Individual | list[Individual]:
        """``run[97]``: the individual 97; ``run[-1]``: the last birth; ``run[10:20]``: ten
        individuals as a list."""
        if isinstance(which, slice):
            return [Individual(self.columns, one) for one in self.columns.ids[which].tolist()]
        if is_whole(which) and which < 0 and -len(self) <= which:  # only this needs all births
            which = int(self.columns.ids[which])
        return Individual(self.columns, which)

    # -- tables of births --------------------------------------------------------------------

    def births(
        self,
        generation: int | None = None,
        columns: Sequence[str] | None = None,
        where: str | None = None,
    ) -> "pa.Table":
        """Return the births of one generation, or of all generations, as an Arrow table. The
        libraries polars and DuckDB read Arrow tables directly.

        The argument ``columns`` names the columns of the table in their order; by default, the
        table has all columns of the log. The argument "where" is a condition, as the method `where`
        explains. Raises `RunError` if a column is unknown or the generation is incomplete, and
        `EvocityError` for an invalid condition.
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
        """Data frame of the scores of all births, with one row per birth and the index ``id``. The
        columns are ``generation``, ``operator``, ``status``, ``feasible``, ``seconds``, ``alive``
        and the measures. The column ``feasible`` is true for a birth whose values all lie within
        the run's current bounds. The column ``alive`` is true for a birth of the last generation. A
        missing value is NaN. A run with islands has the additional column ``island``. If a measure
        has the same name as another column, the measure's column is called fitness.NAME."""
        return self.frame(slice(None))

    def frame(self, rows: np.ndarray | slice, **more: np.ndarray) -> "pd.DataFrame":
        """Return the `scores` of the births in the given ``rows``, with an additional column for
        each keyword argument."""
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
        """Return the `scores` of the births that meet a ``condition``. Examples of conditions are
        "fsi > 2 and crumbs < 4", "operator == 'relocation' and not alive" and "0.2 < gsi <= 0.4". A
        condition can use the columns of `scores`, and the names ``id`` and ``lived``. The method
        parses the text of the condition, and never executes the text as code.

        Raises `EvocityError` if the text is not a condition, or if it names an unknown column.
        """
        return self.frame(mask_of(condition, self.columns))

    @property
    def series(self) -> "pd.DataFrame":
        """Data frame of the course of the run, with one row per generation. In each row, the
        columns ``births`` and ``failures`` count the births so far; the columns ``living`` and
        ``feasible`` count individuals of the generation. The data frame has the additional columns
        ``hypervolume``, ``evaluations_per_second``, ``best.<measure>`` and ``mean.<measure>``."""
        columns = series_of(self.columns)
        return frame_of(columns, columns.pop("generation"), "generation")

    # -- goals and the best ------------------------------------------------------------------

    @property
    def aims(self) -> list[Aim]:
        """Goals of the measures, as `Aim` objects in the order of the recipe."""
        return list(self.columns.aims)

    def front(self, generation: int | None = None) -> "pd.DataFrame":
        """Return the `scores` of the Pareto front of a ``generation``, with the best individuals
        first. The front consists of the living individuals that no other individual dominates. By
        default, the method uses the last generation. In a run with islands, the front uses the
        goals of all islands."""
        ids, ranks = self.columns.ranked(generation)
        return self.frame(self.columns.rows(ids[ranks == 0]))

    def best(self, measure: str, goal: str | None = None, alive: bool = False) -> Individual:
        """Return the best birth according to a ``measure``, or to a sum of measures in the recipe.
        Only births that keep all constraints can be the best birth. If several births are equally
        good, the earliest of these births wins.

        goal : direction "max" or "min"; required for a measure without a goal in the run.
        alive : whether to choose only among individuals that are alive in the last generation.

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
            f"{self.path} has no birth to choose: {found}",
            "at least one birth",
            "look for the reason in run.scores or in the output of `evocity status`",
        )

    @cached_property
    def archive(self) -> "Archive":
        """Births of the whole run that no other birth dominates; in a run of MAP-Elites, the best
        birth of each cell. See `evocity.archive`. The attribute ``run.archive.ids`` holds the ids
        of these births."""
        from evocity.search import archive

        return archive(self, self.columns.last)

    def compromise(
        self, weights: Mapping[str, float] | None = None, of: object = None
    ) -> Individual:
        """Return the best compromise of the archive, or of the births in the argument "of". Every
        birth has a distance from the best value of each goal. The compromise is the birth for which
        the largest of these distances is smallest (achievement scalarisation, Wierzbicki 1980). The
        mapping ``weights`` gives each goal a weight; the default weight is 1, and 0 ignores a goal.

        Raises `EvocityError` for invalid weights, and `RunError` if there is no birth.
        """
        ids, heavy = self._feasible(of), weights_of(weights, self.columns.goals)
        return self[int(ids[best_compromise(self.columns.losses[self.columns.rows(ids)], heavy)])]

    def keep(self, n: int = 5, of: object = None) -> "Shortlist":
        """Return a shortlist of at most ``n`` births of the archive, or of other births ``of``: the
        compromise, the best for each goal, and births that look different; from a small archive,
        also living births. Entries have ``individual``, ``role``, ``why``, ``gave_up``, ``built``.
        """
        from evocity.analysis.shortlist import choose_shortlist

        check_count("n", n)
        where = None if of is None else "given that keep the constraints"
        return choose_shortlist(self.columns, self._feasible(of), self.likeness, n, where)

    def view(
        self, of: object = None, measures: Sequence[str] | None = None, order: str | None = None
    ) -> "View":
        """Return a Jupyter widget that shows all births, or the births in the argument "of". The
        widget has a gallery and parallel coordinates, which share one filter. The attribute
        ``view.selected`` lists the selected births, and ``view.filtered`` the births that pass the
        filter. A notebook without widgets shows a picture.

        measures : names of the measures for the first axes; by default the measures with a goal or
            bounds.
        order : name of the column of `scores` that sorts the births; ``-`` before the name reverses
            the order. By default, the first measure sorts the births, with the best first.

        Raises `EvocityError` if the library anywidget is not installed, or if a name is unknown.
        """
        from evocity.analysis.view import View

        return View(self, of, measures, order)

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
        """Divide the births of the archive into ``k`` groups of similar births. The argument "of"
        replaces the archive by other births. Return the scores of the births with two additional
        columns. The column ``cluster`` numbers the groups from 0. The column ``medoid`` is true for
        the middle birth of each group.

        by : kind of distance: "looks", the share of the area where heights differ by more than a
            storey; "structure", by structural similarity; "shift", by correlation over all shifts;
            "scores", the difference of losses, each divided by its range; "kin", the share of the
            area with different places of source cities.

        Raises `EvocityError` if ``k`` is out of range, or if there are too many births to compare.
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
        """Return the birth of the archive that is most similar to a given birth. If ``n`` is above
        1, return the scores of the ``n`` most similar births, nearest first, with the column
        ``distance``. The argument "of" replaces the archive by other births. The method `clusters`
        explains the kinds of distance."""
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
        """Return the scores of ``n`` very different births of the archive, or of the births in the
        argument "of". The first two rows are the two births that differ most. Each further row is
        the birth that differs most from all births in the rows above. The method `clusters`
        explains the kinds of distance."""
        ids = self._ids(of)
        check_count("n", n, len(ids))
        rows = farthest_first(self.likeness.matrix(ids, by), n)
        return self.frame(self.columns.rows(ids[rows]))

    def diversity(self, by: str = "scores", generations: int = 50) -> "pd.DataFrame":
        """Return a data frame whose column ``apart`` holds the mean distance between two living
        individuals. The rows are generations, evenly spaced over the run. The method `clusters`
        explains the kinds of distance. The distance "looks" is slow to compute, because all living
        individuals must be decoded."""
        check_count("generations", generations)
        numbers, apart = diversity_of(self.columns, self.likeness, by, generations)
        return frame_of({"apart": apart}, numbers, "generation")

    # -- descent -----------------------------------------------------------------------------

    def survivors(self, n: int | None = None) -> "pd.DataFrame":
        """Return the scores of the births that survived at least one generation, at most ``n``
        births. The column ``lived`` counts the generations that a birth survived. The births that
        survived longest come first; among equal births, older births come first."""
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
        """Return a data frame of the success of operators, one row per operator. The columns
        ``births``, ``failed`` and ``survived`` count the operator's births; a birth survives if it
        lives for a generation. The column ``copies`` counts births that equal a parent. The column
        ``redrawn`` counts draws that equalled a parent and were drawn again. The column ``entered``
        counts births that entered the archive. The column ``ancestors`` is the operator's share of
        the living and their ancestors. The column ``paid`` divides that share by the operator's
        share of births, on average 1. The column ``seconds`` is the mean time of a birth."""
        names, columns = self.operator_credit
        return frame_of(columns, names, "operator")

    def lineage(self, one: int | Individual, generations: int | None = None) -> "nx.DiGraph":
        """Return the ancestors of one birth as a graph of networkx. The nodes are ids with the
        scores of the births; the edges lead from parent to child. The argument ``generations``
        limits the steps from child to parent; by default, the graph reaches the source cities."""
        library("networkx", "a lineage")
        births = self.columns
        rows = births.rows(ids_of(one, births))
        rows = self.pedigree.ancestors(rows, steps_of(generations))
        names = [name for name in births.columns if name not in ("id", "lived")]
        columns = {name: births.column(name)[rows] for name in names}
        return graph_of(births.ids[rows], columns, *self.pedigree.edges(rows))

    def ancestry(self, which: object) -> "dict[str, float] | pd.DataFrame":
        """Return the share of the map that comes from each source city. For one birth, the result
        is a mapping from city to share. For several births, the result is a data frame with a row
        per birth and a column per city."""
        if isinstance(which, Integral | Individual):
            return self[int(self._ids(which)[0])].ancestry()
        ids = self._ids(which)
        return frame_of(shares_of(self, ids), ids, "id", list(self.header.cities))

    def score(
        self, ids: object, measures: object, workers: int | None = None, timeout: float = 60.0
    ) -> "pd.DataFrame":
        """Compute measures that the run did not log, for births given as ids, individuals or a data
        frame. Return a data frame with one column per measure, with NaN for missing values. The
        column ``error`` gives the reasons for missing values.

        measures : one measure or several. Each measure is a name, a measure object, or a file
            NAME.py, which evocity executes.
        workers : number of processes, by default one per core; 0 uses this process without limits.
        timeout : time limit in seconds for all measures of one birth.

        The method keeps the values in the user's cache, the folder ``evocity/scores`` in
        ``$XDG_CACHE_HOME`` or ``~/.cache``. Raises `FitnessError` for an unknown measure.
        """
        from evocity.analysis.scores import measures_of, score_births

        pandas = library("pandas", "a table of scores")
        chosen, ids = measures_of(measures), self._ids(ids)
        values, reasons = score_births(self, ids, chosen, workers, timeout)
        columns = {one.name: column for one, column in zip(chosen, values.T, strict=True)}
        table = pandas.DataFrame(columns, pandas.Index(ids, name="id"))
        table["error"] = pandas.Series(reasons, table.index, dtype=object)
        return table

    def to_csv(self, path: str | os.PathLike, form: str = "plain", of: object = None) -> None:
        """Write the scores of all births, or of the births in the argument "of", into a CSV file.

        The argument ``form`` is "plain" or "design-explorer". In the form "design-explorer", names
        of columns begin with ``in:`` for generation, operator and shares of cities, and with
        ``out:`` for measures. The column ``img`` names a picture in the folder NAME-pictures next
        to the file. In the form "design-explorer", the file contains only the archive by default.
        """
        from evocity.analysis.export import write_csv

        every = self.columns.ids if of is None and form == "plain" else self._ids(of)
        write_csv(self.columns, every, path, form)

    def save(
        self, which: Any, path: str | os.PathLike, at: str | None = None, crs: str | None = None
    ) -> None:
        """Write several births into one file: ids, individuals, a data frame, or those of `keep`.

        A ``.zip`` file contains a table of scores, the attribution, and for each birth the GeoTIFF
        map with its style, footprints, picture, genome and scene. A ``.png`` file is a contact
        sheet of maps with a common scale of heights. In a ``.zip``, files have the place on Earth
        of the source city ``at``, and the reference system ``crs``, such as ``"EPSG:2154"``.
        """
        from evocity.analysis.export import roles_of, write_several

        write_several([self[int(one)] for one in self._ids(which)], path, at, roles_of(which), crs)

    def compare(self, other: "Run | str | os.PathLike") -> "Comparison":
        """Compare this run with another run. The result has three data frames, the attributes
        ``recipes``, ``hypervolume`` and ``fronts``. The frame ``recipes`` lists the differences
        between the recipes. The frame ``hypervolume`` holds the hypervolume of each run over time,
        by the goals that both runs have. The frame ``fronts`` counts, for each run, the births that
        the other run's archive dominates. Printing the result shows the comparison in sentences."""
        from evocity.analysis.comparison import compare

        return compare(self, other if isinstance(other, Run) else Run(other))
