"""Births of a run as the page of `evocity.viewer` has them: columns, axes, small pictures."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.asked import ids_of_any
from evocity.analysis.births import label
from evocity.analysis.wanted import Aim
from evocity.errors import RunError
from evocity.search.binning import grid_of_run
from evocity.search.cells import Grid
from evocity.viewer.table import Column, Table

if TYPE_CHECKING:
    from evocity.viewer.sheet import Sheet

# What is in few words, and what is yes or no.
_WORDS, _FLAGS = ("island", "operator", "status"), ("alive", "feasible")
# In which cell of the grid, where there is one.
_CELL = "cell"


class Viewed:
    """The births of a `Run`, or ``of`` these, as they were told when this was made. Raises as
    `Run` does."""

    def __init__(self, run: Any, of: object = None):
        from evocity.analysis.thumbnails import Thumbnails  # which draws

        self.run, told = run, run.told
        self.grid, self._island = _grid_of(run)
        ids = told.ids if of is None else np.unique(ids_of_any(of, told))
        #: The births as columns, and small pictures of them.
        self.table = Table(ids, tuple(self._columns(told.rows(ids))))
        self.thumbnails = Thumbnails(told)

    def _columns(self, rows: np.ndarray) -> Sequence[Column]:
        told, run = self.run.told, self.run
        found = [_measured(aim, told.value(aim.name)[rows]) for aim in told.logged]
        for name in told.columns:
            if name in _WORDS:
                found.append(Column.of_words(name, told.column(name)[rows]))
            elif name in _FLAGS:
                found.append(Column.of_flags(name, told.column(name)[rows]))
            elif name in ("id", "generation", "lived", "seconds"):
                unit = "s" if name == "seconds" else ""
                found.append(Column(name, told.column(name)[rows].astype(np.float32), unit=unit))
        best, ranks = told.ranked()
        flags = {"front": best[ranks == 0]}
        with suppress(RunError):  # of a stranger's run, which does not tell what it wanted
            flags["archive"] = run.archive.ids
        for name, ids in flags.items():
            if name not in told.columns:
                found.append(Column.of_flags(name, np.isin(told.ids[rows], ids)))
        if self.grid is not None and _CELL not in {one.name for one in found}:
            values = np.column_stack([told.value(name)[rows] for name in self.grid.descriptors])
            cells = self.grid.cells(values).astype(np.float32)
            found.append(Column(_CELL, np.where(cells < 0, np.float32(np.nan), cells)))
        return found

    def axes(self, measures: Sequence[str] | None = None) -> list[dict]:
        """The axes at first, as the page has them: these ``measures``, or those that something was
        wanted of. Raises `EvocityError` for a name that is none."""
        if measures is None:
            aims = self.run.told.aims or self.run.told.recorded
            names = [label(aim.name) for aim in aims]
        else:
            names = [measures] if isinstance(measures, str) else measures
        columns = [self.table.column(name) for name in dict.fromkeys(names)]
        return [{"name": one.name, "turned": one.goal == "min"} for one in columns]

    @property
    def about(self) -> dict:
        """What the page is told of the births together, besides the columns."""
        grid = None
        if self.grid is not None:
            grid = {
                "column": _CELL,
                "island": self._island,
                "descriptors": [label(name) for name in self.grid.descriptors],
                "counts": list(self.grid.counts),
                "edges": [self.grid.edges(axis).tolist() for axis in range(len(self.grid.counts))],
            }
        return {
            "grid": grid,
            "title": f"run {self.run.path.resolve().name}",
            "credit": self.run.header.attribution,
            "highest": self.thumbnails.highest,
            "thumbnails": self.thumbnails.logged,
            "ratio": self.run.header.width / self.run.header.height,
        }

    def sheet(self, ids: list[int], side: int) -> "Sheet":
        """Pictures of the births ``ids``, side by side, at most ``side`` px along the longer
        side."""
        from evocity.viewer.sheet import Sheet

        return Sheet.of(*self.thumbnails.of(ids, side))


def _grid_of(run: Any) -> tuple[Grid | None, str | None]:
    """The grid that a run selects by, or the first of its islands that has one, and that island;
    None for a run that has none, or does not tell it."""
    with suppress(RunError):
        for island in run.header.islands or [None]:
            grid = grid_of_run(run, island)
            if grid is not None and set(grid.descriptors) <= set(run.header.columns):
                return grid, island
    return None, None


def _measured(aim: Aim, values: np.ndarray) -> Column:
    return Column(
        label(aim.name),
        values.astype(np.float32),
        unit=aim.unit,
        sign=aim.sign,
        wanted=aim.wanted,
        goal=aim.goal if aim.goal in ("max", "min") and aim.target is None else None,
        target=aim.target,
    )


__all__ = ["Viewed"]
