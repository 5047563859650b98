"""Births as columns of a page, with their axes, their order and their grid."""

from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from evocity.analysis.births import label
from evocity.analysis.goals import Aim
from evocity.analysis.shortlist import rank_compromises
from evocity.errors import RunError
from evocity.search.record.grid import grid_of_run
from evocity.selection.cells import Grid
from evocity.viewer.table import Column, Table

#: The column of ranks by compromise, and the column of cells of the grid.
COMPROMISE, CELL = "compromise", "cell"
# Columns of few words, of yes or no, and of whole numbers or seconds.
_WORDS, _FLAGS = ("island", "operator", "status"), ("alive", "feasible")
_NUMBERS = ("id", "generation", "lived", "seconds")


def table_of(run: Any, ids: np.ndarray, grid: Grid | None) -> Table:
    """Return the births ``ids`` of a run as columns of a page."""
    births = run.columns
    rows = births.rows(ids)
    columns = [_measured(aim, births.value(aim.name)[rows]) for aim in births.logged]
    for name in births.columns:
        if name in _WORDS:
            columns.append(Column.of_words(name, births.column(name)[rows]))
        elif name in _FLAGS:
            columns.append(Column.of_flags(name, births.column(name)[rows]))
        elif name in _NUMBERS:
            values = births.column(name)[rows].astype(np.float32)
            columns.append(Column(name, values, unit="s" if name == "seconds" else ""))
    flags, ranks = {"front": births.front}, None
    with suppress(RunError):  # a stranger's run may not record its goals
        flags["archive"] = run.archive.ids
        ranks = rank_compromises(births, flags["archive"])[rows]
    taken = {one.name for one in columns}
    for name in [name for name in flags if name not in taken]:
        columns.append(Column.of_flags(name, np.isin(births.ids[rows], flags[name])))
    if ranks is not None and COMPROMISE not in taken:
        wanted = "1 is the best compromise; a birth that breaks a bound has no rank"
        columns.append(Column(COMPROMISE, ranks, wanted=wanted, goal="min"))
    if grid is not None and CELL not in taken:
        values = np.column_stack([births.value(name)[rows] for name in grid.descriptors])
        cells = grid.cells(values).astype(np.float32)
        columns.append(Column(CELL, np.where(cells < 0, np.float32(np.nan), cells)))
    return Table(ids, tuple(columns))


def axes_of(run: Any, table: Table, measures: Sequence[str] | None) -> list[dict]:
    """Return the first axes of a page: these ``measures``, or those with a goal or bounds."""
    if measures is None:
        measures = [label(aim.name) for aim in run.columns.aims or run.columns.recorded]
    names = [measures] if isinstance(measures, str) else measures
    columns = [table.column(name) for name in dict.fromkeys(names)]
    return [{"name": one.name, "turned": one.goal == "min"} for one in columns]


def grid_of(run: Any) -> tuple[Grid | None, str | None]:
    """Return the grid of a run, or of the first of its islands that has one, and that island."""
    with suppress(RunError):
        for island in run.header.islands or [None]:
            grid = grid_of_run(run, island)
            if grid is not None and set(grid.descriptors) <= set(run.header.columns):
                return grid, island
    return None, None


def describe_grid(grid: Grid | None, island: str | None) -> dict | None:
    """Return a grid as plain values; None without a grid."""
    if grid is None:
        return None
    return {
        "column": CELL,
        "island": island,
        "descriptors": [label(name) for name in grid.descriptors],
        "counts": list(grid.counts),
        "edges": [grid.edges(axis).tolist() for axis in range(len(grid.counts))],
    }


def _measured(aim: Aim, values: np.ndarray) -> Column:
    with np.errstate(over="ignore"):  # a huge value becomes infinite
        numbers = values.astype(np.float32)
    return Column(
        label(aim.name),
        numbers,
        unit=aim.unit,
        sign=aim.sign,
        wanted=aim.wanted,
        goal=aim.goal if aim.goal in ("max", "min") and aim.target is None else None,
        target=aim.target,
    )
