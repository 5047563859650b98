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
    """Archive of a run: the births that no other birth dominates; if the run has a grid, the best
    birth of each cell. The function `archive` makes an archive.

    Attributes
    ----------
    births : Arrow table of the births in the archive, by id, with the columns ``generation``,
        ``id``, ``fitness.<name>`` of each measure, ``crowding`` and ``alive``. The column
        ``crowding`` holds the distance of each birth to its neighbours in the archive. The column
        ``alive`` is true for births that live in the last generation, or equal a living individual
        in all goals. If the run has a grid, the table ``births`` is sorted by cell; it has the
        column ``alive`` and the columns of `evocity.search.record.grid.Binned`.
    hypervolume : hypervolume of the archive, in units of the first population's ranges as in the
        run's history. The hypervolume is None if its computation would take minutes.
    hypervolume_alive : hypervolume of the individuals of the last generation that break no
        constraint, or NaN if the computation would take minutes.
    grid : grid of cells that a run of ``map_elites`` fills; None for other runs.
    """

    births: pa.Table
    hypervolume: float | None
    hypervolume_alive: float
    grid: Grid | None = None

    def __len__(self) -> int:
        return len(self.births)

    @property
    def ids(self) -> np.ndarray:
        """Ids of the births in the archive, in the order of the table ``births``, int64."""
        return array_of(self.births["id"])


def archive(run: RunLog, last: int | None = None) -> Archive:
    """Find the archive of ``run``: the births that no other birth dominates by the goals of the
    run. In a run of ``map_elites``, the archive contains the best birth of each cell of the grid.

    The argument ``last`` is the last generation whose births may be in the archive, by default the
    last complete generation.

    An archive contains only births with the status ok that keep all constraints. If several births
    are equal in all goals, the archive contains the earliest. The file provenance.json of the run
    holds the goals, targets, weights and bounds.

    Raises `RunError` if the run has no complete generation yet, is damaged, or does not record its
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
