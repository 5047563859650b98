"""What happened generation by generation, as columns."""

import numpy as np

from evocity.analysis.births import Told

#: What a generation's summary may tell, in the order of tables.
_SUMMED = ("births", "failures", "hypervolume", "evaluations_per_second")


def series_of(told: Told) -> dict[str, np.ndarray]:
    """Columns of one value a generation: ``generation``, births, failures, living, feasible,
    hypervolume, evaluations_per_second, ``best.<measure>`` and ``mean.<measure>`` of the living;
    NaN where the log does not tell."""
    run, count = told.run, told.last + 1
    history = {one["generation"]: one for one in told.history}
    summaries = [history.get(generation, {}) for generation in range(count)]
    born, rows = told.lives
    columns: dict[str, np.ndarray] = {"generation": np.arange(count)}
    summed = {name: _numbers([one.get(name) for one in summaries]) for name in _SUMMED}
    living = np.bincount(born, minlength=count)
    columns |= {"births": _whole(summed["births"]), "failures": _whole(summed["failures"])}
    columns["living"] = living
    columns["feasible"] = np.bincount(born[told.feasible[rows]], minlength=count)
    columns |= {name: summed[name] for name in ("hypervolume", "evaluations_per_second")}
    for name in (aim.name for aim in told.aims if aim.sought):
        best = [one.get("best", {}).get(name) for one in summaries]
        columns[f"best.{name}"] = _numbers(best)
    for name in run.header.columns:
        values = told.value(name)[rows]
        known = ~np.isnan(values)
        sums = np.bincount(born[known], values[known], count)
        with np.errstate(invalid="ignore", divide="ignore"):
            columns[f"mean.{name}"] = sums / np.bincount(born[known], minlength=count)
    return columns


def _numbers(values: list) -> np.ndarray:
    return np.array([np.nan if value is None else value for value in values], float)


def _whole(values: np.ndarray) -> np.ndarray:
    """Whole numbers, where all are known."""
    return values if np.isnan(values).any() else values.astype(np.int64)


__all__ = ["series_of"]
