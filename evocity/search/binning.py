"""The births of a run in the cells of a grid: the best of each, by the log alone."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, column_of
from evocity.errors import RecipeError, RunError
from evocity.search.algorithms import algorithms
from evocity.search.algorithms.map_elites import MapElites
from evocity.search.cells import Grid, Quality, ranges_around
from evocity.search.judging import aims_of_run, judged, measured
from evocity.store import Run


@dataclass(frozen=True)
class Binned:
    """The best birth of each filled cell of a ``grid``; made by `binned`.

    Attributes
    ----------
    births : Arrow table by cell: ``generation``, ``id``, ``fitness.<name>`` of each measure and of
        each descriptor, ``cell``, its number, and ``cell.<descriptor>``, where it lies along each
        descriptor, 0 the lowest.
    worth : of each of them what it adds to the QD-score, float ``(n,)``.
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
    run: Run, grid: Grid | None = None, last: int | None = None, goal: str | None = None
) -> Binned:
    """All births of ``run`` up to the generation ``last`` in the cells of a ``grid``, whatever the
    run selects by; those of its own grid unless one is given. Of each cell the best: the least
    loss, then the first born. ``goal`` names the measure, or the sum, that tells who is the best,
    where the run has several goals.

    What counts are births with status ``ok`` that keep all constraints and have a value of each
    descriptor. The QD-score is that of `evocity.search.cells.Quality`, by the run's own first
    generation.

    Raises `RunError` if the run has several goals and none of them is named, logs no such measure,
    has no grid of its own and none is given, or is damaged.
    """
    aims = aims_of_run(run)
    grid = grid_of_run(run) if grid is None else grid
    if grid is None:
        raise RunError(
            f"{run.path} has no grid of its own",
            "a run of map_elites, or a grid to lay its births in",
            "give a grid: evocity.search.cells.Grid(descriptors, counts, ranges)",
        )
    if goal not in aims.names and (goal is not None or len(aims.names) > 1):
        raise RunError(
            f"{run.path} has {len(aims.names)} goals, and goal = {goal!r}",
            "one goal, which is the quality of a cell",
            f"name one of {', '.join(aims.names)}",
        )
    strange = [name for name in grid.descriptors if name not in run.header.columns]
    if strange:
        raise RunError(
            f"{run.path} logs no {', '.join(strange)}",
            f"some of {', '.join(run.header.columns)}",
            "record it in the recipe: [run] record = [...]",
        )
    last = len(run.generations) - 1 if last is None else last
    births = measured(run, aims.bounds, grid.descriptors)
    births = births.filter(column_of(array_of(births["generation"]) <= last)).combine_chunks()
    losses, kept = judged(births, aims)
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


def grid_of_run(run: Run, island: str | None = None) -> Grid | None:
    """The grid that ``run``, or an ``island`` of it, selects by, None if it selects by none; raises
    `RunError` if it does not tell it, has no such island, or no whole generation yet."""
    noted = _search(run, island)
    name = noted.get("algorithm") if isinstance(noted, Mapping) else None
    kind = algorithms().get(name) if isinstance(name, str) else None
    if kind is None or not issubclass(kind, MapElites):
        return None
    try:
        given = {key: one for key, one in noted.items() if key in kind.Keys.model_fields}
        keys = kind.Keys.model_validate(given)
        if faults := keys.disagreements():
            raise ValueError("; ".join(map(": ".join, (fault[:2] for fault in faults))))
        ranges = keys.ranges or ranges_around(keys.descriptors, _sources(run), _limits(run))
    except (LookupError, TypeError, AttributeError, ValueError) as error:
        raise _unknown(run, f"{type(error).__name__}: {error}") from error
    except RecipeError as error:
        raise _unknown(run, error.found) from error
    pairs = tuple((float(low), float(high)) for low, high in ranges)
    return Grid(tuple(keys.descriptors), tuple(keys.grid), pairs)


def _search(run: Run, island: str | None) -> object:
    """What provenance notes of how the run, or an ``island`` of it, selects."""
    if island is not None and island not in run.header.islands:
        raise RunError(
            f"{run.path} has no island {island!r}",
            f"one of {', '.join(run.header.islands)}"
            if run.header.islands
            else "a run with islands",
            "leave it out, or name one that there is",
        )
    recipe = run.provenance.get("recipe")
    if not isinstance(recipe, Mapping) or (island is None and run.header.islands):
        return None
    if island is None:
        return recipe.get("search")
    try:
        return next(one["search"] for one in recipe["islands"] if one["name"] == island)
    except (LookupError, TypeError, StopIteration) as error:
        raise _unknown(run, f"{type(error).__name__}: {error}") from error


def _unknown(run: Run, reason: str) -> RunError:
    return RunError(
        f"{run.path}: provenance.json does not tell the run's grid ({reason})",
        "a provenance as `evocity run` writes it",
        "bring the file back from a copy",
    )


def _sources(run: Run) -> list[dict[str, float]]:
    """What the source cities' own births have of each measure."""
    columns = [f"fitness.{name}" for name in run.header.columns]
    rows = run.births(0, ["operator", *columns]).to_pylist()
    names = list(zip(run.header.columns, columns, strict=True))
    return [
        {name: row[column] for name, column in names if row[column] is not None}
        for row in rows
        if row["operator"] == "source"
    ]


def _limits(run: Run) -> dict[str, tuple[float, float]]:
    """The lowest and highest value that descriptors declare."""
    return {
        one["name"]: (
            -math.inf if one["low"] is None else float(one["low"]),
            math.inf if one["high"] is None else float(one["high"]),
        )
        for one in run.provenance["descriptors"]
    }


def _values(births: pa.Table, names: Sequence[str]) -> np.ndarray:
    """``(n, d)`` values, NaN where there is none."""
    columns = [array_of(births[f"fitness.{name}"]) for name in names]
    return np.column_stack(columns).astype(np.float64)


__all__ = ["Binned", "binned", "grid_of_run"]
