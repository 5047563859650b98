"""Births as the page of `evocity.viewer` shows them: columns, axes, small pictures."""

from collections.abc import Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from evocity.analysis.arguments import ids_of_any
from evocity.analysis.births import label
from evocity.analysis.goals import Aim
from evocity.errors import RunError
from evocity.search.record.grid import grid_of_run
from evocity.selection.cells import Grid
from evocity.viewer.table import Column, Table

if TYPE_CHECKING:
    from evocity.viewer.sheet import Sheet

# Columns of few words, and of yes or no.
_WORDS, _FLAGS = ("island", "operator", "status"), ("alive", "feasible")
# The column of cells of the grid.
_CELL = "cell"


class ViewTable:
    """The births of a `Run`, or ``of`` these, as columns and pictures of a page."""

    def __init__(self, run: Any, of: object = None):
        from evocity.analysis.thumbnails import Thumbnails  # which draws

        self.run, births = run, run.columns
        self.grid, self._island = _grid_of(run)
        ids = births.ids if of is None else np.unique(ids_of_any(of, births))
        #: The births as columns, and small pictures of them.
        self.table = Table(ids, tuple(self._columns(births.rows(ids))))
        self.thumbnails = Thumbnails(births)

    def _columns(self, rows: np.ndarray) -> Sequence[Column]:
        births, run = self.run.columns, self.run
        columns = [_measured(aim, births.value(aim.name)[rows]) for aim in births.logged]
        for name in births.columns:
            if name in _WORDS:
                columns.append(Column.of_words(name, births.column(name)[rows]))
            elif name in _FLAGS:
                columns.append(Column.of_flags(name, births.column(name)[rows]))
            elif name in ("id", "generation", "lived", "seconds"):
                unit = "s" if name == "seconds" else ""
                columns.append(
                    Column(name, births.column(name)[rows].astype(np.float32), unit=unit)
                )
        flags = {"front": births.front}
        with suppress(RunError):  # a stranger's run may not record its goals
            flags["archive"] = run.archive.ids
        for name, ids in flags.items():
            if name not in births.columns:
                columns.append(Column.of_flags(name, np.isin(births.ids[rows], ids)))
        if self.grid is not None and _CELL not in {one.name for one in columns}:
            values = np.column_stack([births.value(name)[rows] for name in self.grid.descriptors])
            cells = self.grid.cells(values).astype(np.float32)
            columns.append(Column(_CELL, np.where(cells < 0, np.float32(np.nan), cells)))
        return columns

    def axes(self, measures: Sequence[str] | None = None) -> list[dict]:
        """Return the page's first axes: these ``measures``, or those with a goal or bounds."""
        if measures is None:
            aims = self.run.columns.aims or self.run.columns.recorded
            names = [label(aim.name) for aim in aims]
        else:
            names = [measures] if isinstance(measures, str) else measures
        columns = [self.table.column(name) for name in dict.fromkeys(names)]
        return [{"name": one.name, "turned": one.goal == "min"} for one in columns]

    @property
    def about(self) -> dict:
        """What the page shows of all births together, besides the columns."""
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
            "title": f"run {self.run.name}",
            "credit": self.run.header.attribution,
            "highest": self.thumbnails.highest,
            "thumbnails": self.thumbnails.logged,
            "ratio": self.run.header.width / self.run.header.height,
        }

    def sheet(self, ids: list[int], side: int) -> "Sheet":
        """Return pictures of the births ``ids`` side by side, at most ``side`` px along each."""
        from evocity.viewer.sheet import Sheet

        return Sheet.of(*self.thumbnails.of(ids, side))


def _grid_of(run: Any) -> tuple[Grid | None, str | None]:
    """The grid of a run, or of the first of its islands that has one, and that island."""
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
