"""The best compromise of many goals, by an achievement scalarising function.

Wierzbicki 1980: the reference point is the best of each goal. The compromise is the one whose
largest distance from it is the smallest. Weights multiply distances, so that a heavier goal counts
more; pymoo's ``ASF`` divides by its weights.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from evocity.errors import EvocityError, near_miss, spell
from evocity.selection.fronts import Scale


def achievement(losses: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return the achievement of ``(n, goals)`` losses, float64 ``(n,)``, lower is better: the
    largest distance above the best of each goal, in units of their ranges, times ``weights``
    (goals,)."""
    return (np.asarray(weights) * Scale(losses)(losses)).max(axis=1)


def best_compromise(losses: np.ndarray, weights: np.ndarray) -> int:
    """Return the row of ``(n, goals)`` losses with the least `achievement`; of equal ones the least
    weighted sum, then the first. At least one row."""
    together = (np.asarray(weights) * Scale(losses)(losses)).sum(axis=1)
    return int(np.lexsort((np.arange(len(losses)), together, achievement(losses, weights)))[0])


def weights_of(given: Mapping[str, float] | None, goals: Sequence[str]) -> np.ndarray:
    """Return the weight of each of the ``goals``: 1, unless ``given`` says otherwise, 0 to leave a
    goal out. Raises `EvocityError` for another name, and for a value that is not a weight."""
    weights = dict.fromkeys(goals, 1.0)
    if given is not None and not isinstance(given, Mapping):
        raise _fault(given, f'write weights={{"{goals[0]}": 2}}')
    for name, weight in (given or {}).items():
        if name not in weights:
            raise _fault(given, near_miss(str(name), goals) or f"the goals are {', '.join(goals)}")
        number = isinstance(weight, int | float | np.number) and not isinstance(weight, bool)
        if not (number and 0 <= weight < np.inf):
            raise _fault(given, f"replace {name} = {spell(weight)}")
        weights[name] = float(weight)
    if not any(weights.values()):
        raise _fault(given, "give at least one goal a weight above 0")
    return np.array(list(weights.values()))


def _fault(given: object, remedy: str) -> EvocityError:
    return EvocityError(
        f"weights = {spell(given)}", "a number of 0 or more for each goal that is named", remedy
    )
