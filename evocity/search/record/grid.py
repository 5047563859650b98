"""The grid of a run: the best of its births in each cell, from the log."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of
from evocity.errors import RecipeError, RunError
from evocity.search.record.aims import (
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
    """Lay all births of ``run`` up to the generation ``last`` in a ``grid``, by default its own,
    and keep the best of each cell: the least loss, then the first born. ``goal`` names the measure,
    or the sum, whose loss counts, if the run has several goals.

    Only births with status ``ok`` count that keep all constraints and have a value of each
    descriptor. The QD-score is that of `evocity.selection.cells.Quality`, by the run's first
    generation.

    Raises `RunError` if ``goal`` names none of several goals, if the run logs no such measure, if
    it has no grid and none is given, or if it is damaged.
    """
    aims = aims_of_run(run)
    grid = grid_of_run(run) if grid is None else grid
    if grid is None:
        raise RunError(
            f"{run.path} has no grid of its own",
            "a run of map_elites, or a grid for its births",
            "give a grid: evocity.selection.cells.Grid(descriptors, counts, ranges)",
        )
    if goal not in aims.names and (goal is not None or len(aims.names) > 1):
        raise RunError(
            f"{run.path} has {len(aims.names)} goals, but goal = {goal!r} is not one of these",
            "one goal, by which a cell keeps its best birth",
            f"set goal to one of {', '.join(aims.names)}",
        )
    missing = [name for name in grid.descriptors if name not in run.header.columns]
    if missing:
        raise RunError(
            f"{run.path} does not log {', '.join(missing)}",
            f"some of {', '.join(run.header.columns)}",
            "record the measure in the recipe: [run] record = [...]",
        )
    last = len(run.generations) - 1 if last is None else last
    births = measured_births(run, aims.bounds, grid.descriptors)
    births = births.filter(column_of(array_of(births["generation"]) <= last)).combine_chunks()
    losses, kept = judge_births(births, aims)
    losses = losses[:, aims.names.index(goal) if goal else 0]
    cells = grid.cells(_values(births, grid.descriptors))
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
    `RunError` if its provenance lacks the grid, if it has no such island, or no whole generation
    yet."""
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
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise _unknown_grid(run, f"{type(error).__name__}: {error}") from error
    except RecipeError as error:
        raise _unknown_grid(run, error.found) from error
    pairs = tuple((float(low), float(high)) for low, high in ranges)
    return Grid(tuple(keys.descriptors), tuple(keys.grid), pairs)


def _search(run: RunLog, island: str | None) -> object:
    """The selection of the run, or of an ``island``, in its provenance."""
    if island is not None and island not in run.header.islands:
        raise RunError(
            f"{run.path} has no island {island!r}",
            f"one of {', '.join(run.header.islands)}"
            if run.header.islands
            else "a run with islands",
            "leave it out, or name one of its islands",
        )
    recipe = run.provenance.get("recipe")
    if not isinstance(recipe, Mapping) or (island is None and run.header.islands):
        return None
    if island is None:
        return recipe.get("search")
    try:
        return next(one["search"] for one in recipe["islands"] if one["name"] == island)
    except (LookupError, TypeError, StopIteration) as error:
        raise _unknown_grid(run, f"{type(error).__name__}: {error}") from error


def _unknown_grid(run: RunLog, reason: str) -> RunError:
    return damaged_provenance(run, f"lacks the run's grid ({reason})")


def _sources(run: RunLog) -> list[dict[str, float]]:
    """The values of the source cities' own births."""
    columns = [f"fitness.{name}" for name in run.header.columns]
    rows = run.births(0, ["operator", *columns]).to_pylist()
    names = list(zip(run.header.columns, columns, strict=True))
    return [
        {name: row[column] for name, column in names if row[column] is not None}
        for row in rows
        if row["operator"] == "source"
    ]


def _limits(run: RunLog) -> dict[str, tuple[float, float]]:
    """The lowest and highest values that descriptors declare."""
    return {
        one["name"]: (
            -math.inf if one["low"] is None else float(one["low"]),
            math.inf if one["high"] is None else float(one["high"]),
        )
        for one in run.provenance["descriptors"]
    }


def _values(births: pa.Table, names: Sequence[str]) -> np.ndarray:
    """Values ``(n, d)``, NaN for none."""
    columns = [array_of(births[f"fitness.{name}"]) for name in names]
    return np.column_stack(columns).astype(np.float64)
