"""The archive of a run: of all births those that no other dominates, or the best of each cell.

A population has a fixed size and forgets what it has no room for. The log does not:
this reads it, columns alone. Nothing of the run is executed, no measure is loaded.
"""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of
from evocity.displayed import Displayed
from evocity.search.binning import binned, grid_of_run
from evocity.search.cells import Grid
from evocity.search.fronts import (
    Hypervolume,
    crowding_of,
    not_dominated,
    ranks_of,
    volume_is_quick,
)
from evocity.search.judging import aims_of_run, judged, measured
from evocity.store import Run

_ROWS = 20_000  # births that are compared with the archive at a time


@dataclass(frozen=True)
class Archive(Displayed):
    """The births of a run that no other ever dominated, or of a run with a grid the best of each
    cell; made by `archive`.

    Attributes
    ----------
    births : Arrow table by id: ``generation``, ``id``, ``fitness.<name>`` of each measure,
        ``crowding`` (distance within the archive: the higher, the further from the others) and
        ``alive`` (it, or one equal in all goals, lives in the last generation). Of a run with a
        grid by cell, with the columns of `evocity.search.binning.Binned` and ``alive``.
    hypervolume : of the archive, in units of the first population's ranges as in the run's
        history; None where so many births of so many goals would take minutes.
    hypervolume_alive : of those of the last generation that break no constraint; NaN where that
        would take minutes.
    grid : the cells that a run of `map_elites` fills; None of others.
    """

    births: pa.Table
    hypervolume: float | None
    hypervolume_alive: float
    grid: Grid | None = None

    def __len__(self) -> int:
        return len(self.births)

    @property
    def ids(self) -> np.ndarray:
        """Int64: those of its births, in their order."""
        return array_of(self.births["id"])


def archive(run: Run, last: int | None = None) -> Archive:
    """Of all births of ``run`` those that no other dominates, by the run's goals, or, if it selects
    by `map_elites`, the best of each cell of its grid; up to the
    generation ``last``, the last whole one unless it is given. While the run goes on, nothing born
    after that generation counts.

    What counts are births with status ``ok`` that keep all constraints; where several are equal in
    all goals, the earliest counts alone. Goals, targets, weights and bounds are those that
    ``provenance.json`` records.

    Raises `RunError` if the run has no whole generation yet, is damaged, or does not tell what
    it wanted.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> evocity.archive(run).births.to_pandas()  # doctest: +SKIP
    """
    aims = aims_of_run(run)
    grid = grid_of_run(run)
    # a run may go on meanwhile: the generation is settled before anything of it is read
    last = len(run.generations) - 1 if last is None else last
    births = measured(run, aims.bounds)
    births = births.filter(column_of(array_of(births["generation"]) <= last))
    members, born = array_of(run.members(last)["id"]), array_of(births["generation"])
    living, first = np.isin(array_of(births["id"]), members), born == born.min(initial=last)
    chosen = np.empty(0, np.intp)
    front = np.empty((0, len(aims.names)))
    units, alive = [front], [front]
    for start in range(0, len(births), _ROWS):
        losses, kept = judged(births.slice(start, _ROWS), aims)
        here = slice(start, start + _ROWS)
        units.append(losses[first[here]])
        alive.append(losses[living[here] & kept])
        front = np.vstack([front, losses[kept]])
        chosen = np.concatenate([chosen, start + np.flatnonzero(kept)])
        among = not_dominated(front)
        front, chosen = front[among], chosen[among]
    alive = np.vstack(alive)
    lives = set(map(tuple, alive.tolist()))
    volume = Hypervolume(np.vstack(units)) if len(births) else None
    small = volume_is_quick(*front.shape)
    volumes = (
        (volume(front) if len(front) else 0.0) if small else None,
        volume(alive) if len(alive) else 0.0,
    )
    if grid is not None:
        bins = binned(run, grid, last).births
        lives = column_of(np.isin(array_of(bins["id"]), members))
        return Archive(bins.append_column("alive", lives), *volumes, grid)
    crowding = crowding_of(front, ranks_of(front))
    table = births.take(column_of(np.asarray(chosen))).drop_columns(["status"])
    table = table.append_column("crowding", column_of(np.asarray(crowding, float)))
    found = [row in lives for row in map(tuple, front.tolist())]
    table = table.append_column("alive", column_of(np.array(found, bool)))
    return Archive(table, *volumes)
