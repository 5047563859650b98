"""The grid of a run: the best of its births in each cell, from the log."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of
from evocity.errors import RecipeError, RunError
from evocity.search.record.aims import (
    DAMAGE,
    aims_of_run,
    damaged_provenance,
    judge_births,
    measured_births,
)
from evocity.selection.algorithms import algorithms
from evocity.selection.algorithms.map_elites import MapElites
from evocity.selection.cells import Grid, Quality, ranges_around
from evocity.store import RunLog


@dataclass(frozen=True)
class Binned:
    """The best birth of each filled cell of a ``grid``; made by `binned`.

    Attributes
    ----------
    births : Arrow table by cell: ``generation``, ``id``, ``fitness.<name>`` of each measure and of
        each descriptor, ``cell``, its number, and ``cell.<descriptor>``, its place along each
        descriptor, from 0, the lowest.
    worth : what each adds to the QD-score, float ``(n,)``.
    coverage, qd_score : the share of cells that are filled, and the sum of ``worth``.
    """

    grid: Grid
    births: pa.Table
    worth: np.ndarray

    def __len__(self) -> int:
        return len(self.births)

    @property
    def coverage(self) -> float:
        return len(self) / len(self.grid)

    @property
    def qd_score(self) -> float:
        return float(self.worth.sum())


def binned(
    run: RunLog, grid: Grid | None = None, last: int | None = None, goal: str | None = None
) -> Binned:
    """Sort the births of ``run``, up to the generation ``last``, into the cells of a ``grid``, and
    find the best birth of each cell. The default grid is the grid of the run.

    The best birth of a cell is the birth with the least loss, or the earliest of several with equal
    losses. If the run has several goals, the argument ``goal`` names the goal that determines the
    best births. Cells contain only births that have the status ok, keep all constraints, and have a
    value of each descriptor. The class `evocity.selection.cells.Quality` computes the QD-score from
    the losses of the run's first generation.

    Raises `RunError` in four cases: ``goal`` is not one of several goals; the run does not log a
    descriptor; neither run nor caller has a grid; the run is damaged.
    """
    aims = aims_of_run(run)
    grid = grid_of_run(run) if grid is None else grid
    if grid is None:
        raise RunError(
            f"the run {run.path} has no grid, and the call gives no grid",
            "a run of the algorithm map_elites, or a grid for the births",
            "pass a grid: evocity.selection.cells.Grid(descriptors, counts, ranges)",
        )
    if goal not in aims.names and (goal is not None or len(aims.names) > 1):
        raise RunError(
            f"{run.path} has {len(aims.names)} goals, but goal = {goal!r} is not one of these",
            "the name of one goal, which decides the best birth of each cell",
            f"set goal to one of {', '.join(aims.names)}",
        )
    missing = [name for name in grid.descriptors if name not in run.header.columns]
    if missing:
        raise RunError(
            f"{run.path} does not log the descriptors {', '.join(missing)}",
            f"descriptors among the logged measures: {', '.join(run.header.columns)}",
            "choose other descriptors, or record the missing ones in the recipe: [run] record = "
            "[...]",
        )
    last = len(run.generations) - 1 if last is None else last
    births = measured_births(run, aims.bounds, grid.descriptors)
    births = births.filter(column_of(array_of(births["generation"]) <= last)).combine_chunks()
    losses, kept = judge_births(births, aims)
    losses = losses[:, aims.names.index(goal) if goal else 0]
    columns = [array_of(births[f"fitness.{name}"]) for name in grid.descriptors]
    cells = grid.cells(np.column_stack(columns).astype(np.float64))
    order = np.lexsort((array_of(births["id"]), losses))
    order = order[(kept & (cells >= 0))[order]]
    _, at = np.unique(cells[order], return_index=True)
    best = order[at]
    born = array_of(births["generation"])
    first = losses[born == (born.min() if len(born) else 0)]
    worth = Quality(first).worth(losses[best]) if len(first) else np.zeros(len(best))
    table = births.take(column_of(best)).drop_columns(["status"])
    table = table.append_column("cell", column_of(cells[best].astype(np.int64)))
    for name, places in zip(grid.descriptors, grid.places(cells[best]).T, strict=True):
        table = table.append_column(f"cell.{name}", column_of(places.astype(np.int32)))
    return Binned(grid, table, worth)


def grid_of_run(run: RunLog, island: str | None = None) -> Grid | None:
    """Read the grid by which ``run``, or an ``island`` of it, selects; None if it has none. Raises
    `RunError` for a damaged grid, an unknown island, and without a whole generation."""
    noted = _search(run, island)
    name = noted.get("algorithm") if isinstance(noted, Mapping) else None
    kind = algorithms().get(name) if isinstance(name, str) else None
    if kind is None or not issubclass(kind, MapElites):
        return None
    try:
        given = {key: value for key, value in noted.items() if key in kind.Keys.model_fields}
        keys = kind.Keys.model_validate(given)
        if faults := keys.disagreements():
            raise ValueError("; ".join(map(": ".join, (fault[:2] for fault in faults))))
        ranges = keys.ranges or ranges_around(keys.descriptors, _sources(run), _limits(run))
    except (*DAMAGE, RecipeError) as error:
        raise _unknown_grid(run, error) from error
    pairs = tuple((float(low), float(high)) for low, high in ranges)
    return Grid(tuple(keys.descriptors), tuple(keys.grid), pairs)


def _search(run: RunLog, island: str | None) -> object:
    if island is not None and island not in run.header.islands:
        raise RunError(
            f"{run.path} has no island {island!r}",
            f"one of {', '.join(run.header.islands)}"
            if run.header.islands
            else "a run with islands",
            "name one of the islands, or leave the island out",
        )
    recipe = run.provenance.get("recipe")
    if not isinstance(recipe, Mapping) or (island is None and run.header.islands):
        return None
    if island is None:
        return recipe.get("search")
    try:
        return next(one["search"] for one in recipe["islands"] if one["name"] == island)
    except (LookupError, TypeError, StopIteration) as error:
        raise _unknown_grid(run, error) from error


def _unknown_grid(run: RunLog, error: Exception) -> RunError:
    own = isinstance(error, RecipeError)
    reason = error.found if own else f"{type(error).__name__}: {error}"
    return damaged_provenance(run, f"lacks the run's grid ({reason})")


def _sources(run: RunLog) -> list[dict[str, float]]:
    columns = [f"fitness.{name}" for name in run.header.columns]
    rows = run.births(0, ["operator", *columns]).to_pylist()
    names = list(zip(run.header.columns, columns, strict=True))
    return [
        {name: row[column] for name, column in names if row[column] is not None}
        for row in rows
        if row["operator"] == "source"
    ]


def _limits(run: RunLog) -> dict[str, tuple[float, float]]:
    return {
        one["name"]: (
            -math.inf if one["low"] is None else float(one["low"]),
            math.inf if one["high"] is None else float(one["high"]),
        )
        for one in run.provenance["descriptors"]
    }
