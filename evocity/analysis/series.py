"""Columns with a value per generation: births, hypervolume, best and mean scores, diversity."""

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.likeness import Likeness

#: Keys of a generation's summary, in the order of tables.
_SUMMED = ("births", "failures", "hypervolume", "evaluations_per_second")


def series_of(births: Births) -> dict[str, np.ndarray]:
    """Return columns with a value per generation, as in `Run.series`; NaN for no value."""
    run, count = births.run, births.last + 1
    history = {one["generation"]: one for one in births.history}
    summaries = [history.get(generation, {}) for generation in range(count)]
    born, rows = births.lives
    columns: dict[str, np.ndarray] = {"generation": np.arange(count)}
    summed = {name: _numbers([one.get(name) for one in summaries]) for name in _SUMMED}
    living = np.bincount(born, minlength=count)
    columns |= {"births": _whole(summed["births"]), "failures": _whole(summed["failures"])}
    columns["living"] = living
    columns["feasible"] = np.bincount(born[births.feasible[rows]], minlength=count)
    columns |= {name: summed[name] for name in ("hypervolume", "evaluations_per_second")}
    for name in (aim.name for aim in births.sought):
        best = [one.get("best", {}).get(name) for one in summaries]
        columns[f"best.{name}"] = _numbers(best)
    for name in run.header.columns:
        values = births.value(name)[rows]
        known = ~np.isnan(values)
        sums = np.bincount(born[known], values[known], count)
        with np.errstate(invalid="ignore", divide="ignore"):
            columns[f"mean.{name}"] = sums / np.bincount(born[known], minlength=count)
    return columns


def diversity_of(
    births: Births, likeness: Likeness, by: str, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return at most ``count`` generations, and the mean distance between two of the living of
    each."""
    born, rows = births.lives
    chosen = np.unique(np.linspace(0, births.last, min(count, births.last + 1)).round().astype(int))
    means = []
    for generation in chosen:
        living = np.unique(rows[born == generation])
        living = living[births.ok[living]]
        matrix = likeness.matrix(births.ids[living], by)
        pairs = len(living) * (len(living) - 1)
        means.append(matrix.sum() / pairs if pairs else np.nan)
    return chosen, np.array(means)


def _numbers(values: list) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], float)


def _whole(values: np.ndarray) -> np.ndarray:
    """Whole numbers, where all are known."""
    return values if np.isnan(values).any() else values.astype(np.int64)
