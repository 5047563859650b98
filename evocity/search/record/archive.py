"""The archive of a run: the births that no other dominates, or the best of each cell.

A population has a fixed size and forgets what it has no room for; the log forgets nothing. Only
columns of it are read. Nothing of the run is executed, no measure is loaded.
"""

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of
from evocity.html_display import Displayed
from evocity.search.record.aims import aims_of_run, judge_births, measured_births
from evocity.search.record.grid import binned, grid_of_run
from evocity.selection.cells import Grid
from evocity.selection.fronts import (
    Hypervolume,
    crowding_of,
    not_dominated,
    ranks_of,
    volume_is_quick,
)
from evocity.store import RunLog

_ROWS = 20_000  # births that are compared with the archive at a time


@dataclass(frozen=True)
class Archive(Displayed):
    """The births of a run that no other birth dominates. In a run with a grid, they are the best
    birth of each cell. The function `archive` makes the archive.

    Attributes
    ----------
    births : Arrow table of these births by id. Its columns are ``generation``, ``id``,
        ``fitness.<name>`` of each measure, ``crowding`` and ``alive``. Crowding is the distance
        within the archive: the higher, the further from other births. Alive is true if the birth,
        or an individual with the same values in all goals, lives in the last generation. In a run
        with a grid the table is sorted by cell, and has ``alive`` and the columns of
        `evocity.search.record.grid.Binned`.
    hypervolume : hypervolume of the archive, in units of the first population's ranges as in the
        run's history. None if the number of births and goals is so large that it would take
        minutes.
    hypervolume_alive : hypervolume of those individuals of the last generation that break no
        constraint; NaN if it would take minutes.
    grid : the cells that a run of ``map_elites`` fills; None for other runs.
    """

    births: pa.Table
    hypervolume: float | None
    hypervolume_alive: float
    grid: Grid | None = None

    def __len__(self) -> int:
        return len(self.births)

    @property
    def ids(self) -> np.ndarray:
        """The ids of the births, in the order of ``births``, int64."""
        return array_of(self.births["id"])


def archive(run: RunLog, last: int | None = None) -> Archive:
    """Find the archive of ``run``: the births that no other birth dominates by the goals of the
    run. For a run that selects by map_elites, it is the best birth of each cell of the grid.

    The argument ``last`` is the last generation that counts, by default the last whole one. If the
    run goes on, later births do not count.

    A birth counts if its status is ok and it keeps all constraints. Of several births that are
    equal in all goals, only the earliest counts. The file provenance.json holds the goals, targets,
    weights and bounds.

    Raises `RunError` if the run has no whole generation yet, is damaged, or does not record its
    goals.

    >>> import evocity
    >>> run = evocity.open_run("runs/demo")  # doctest: +SKIP
    >>> evocity.archive(run).births.to_pandas()  # doctest: +SKIP
    """
    aims = aims_of_run(run)
    grid = grid_of_run(run)
    # a run may go on meanwhile: the generation is fixed before anything is read
    last = len(run.generations) - 1 if last is None else last
    births = measured_births(run, aims.bounds)
    births = births.filter(column_of(array_of(births["generation"]) <= last))
    members, born = array_of(run.members(last)["id"]), array_of(births["generation"])
    living, first = np.isin(array_of(births["id"]), members), born == born.min(initial=last)
    chosen = np.empty(0, np.intp)
    front = np.empty((0, len(aims.names)))
    units, alive = [front], [front]
    for start in range(0, len(births), _ROWS):
        losses, kept = judge_births(births.slice(start, _ROWS), aims)
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
