"""Values of a run by generation, as plain curves."""

from typing import Any

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.series import series_of

#: Points of a curve, at most: evenly of all generations.
MOST_POINTS = 800


def curves_of(run: Any) -> list[dict]:
    """Return the curves of a run. The key ``group`` is "hypervolume"; "goal" for the best of each
    goal; "guard" for the share of births that broke each bound; "figure" for the algorithm's
    figures; "island" for the hypervolume of each island."""
    births = run.columns
    series, history = series_of(births), {one["generation"]: one for one in births.history}
    listed = [("hypervolume", "hypervolume", "", "hypervolume", None, series["hypervolume"])]
    for aim in births.sought:
        values = series[f"best.{aim.name}"]
        listed.append((aim.name, f"best {aim.name}", aim.unit, "goal", aim.target, values))
    for aim in [one for one in births.aims if one.bounds]:
        title = f"births that break {aim.name} ({aim.bounds})"
        broken = births.ok & ~aim.within(births.value(aim.name))
        listed.append((aim.name, title, "share", "guard", None, _share(births, broken)))
    for name in run.header.figures:
        values = _noted(history, births.last, "algorithm", name)
        listed.append((name, name.replace("_", " "), "", "figure", None, values))
    for name in run.header.islands:
        values = _noted(history, births.last, "islands", name, "hypervolume")
        listed.append((name, f"hypervolume of {name}", "", "island", None, values))
    places = np.linspace(0, births.last, min(MOST_POINTS, births.last + 1)).round().astype(int)
    keys = ("name", "title", "unit", "group", "target")
    return [
        dict(zip(keys, about, strict=True))
        | {
            "generations": places.tolist(),
            "values": [
                float(one) if np.isfinite(one) else None
                for one in np.asarray(values, float)[places]
            ],
        }
        for *about, values in listed
    ]


def _share(births: Births, broken: np.ndarray) -> np.ndarray:
    """Return the share of ``broken`` births among the measured births of each generation."""
    born, count = births.generation, births.last + 1
    measured = np.bincount(born[births.ok], minlength=count)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.bincount(born[broken], minlength=count) / measured


def _noted(history: dict[int, dict], last: int, *keys: str) -> np.ndarray:
    """Return a value of each generation's summary; NaN for no number."""
    values = np.full(last + 1, np.nan)
    for generation in range(last + 1):
        value: Any = history.get(generation)
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if isinstance(value, int | float):
            values[generation] = value
    return values
