"""Which of many is the best compromise: by an achievement scalarising function.

Wierzbicki 1980: the reference is what is best of each goal among them, one beside the other; the
compromise is the one that is farthest behind it, in the goal where it is farthest behind, by the
least. What pymoo's ``ASF`` divides by is here what the weights multiply by: the more a goal counts,
the heavier it is.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from evocity.errors import EvocityError, near_miss, shown
from evocity.search.fronts import Scale


def achievement(losses: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Float64 ``(n,)``, the lower the better: of ``(n, goals)`` losses, in units of their ranges
    above the best of each, the largest of those weighted by ``weights`` (goals,)."""
    return (np.asarray(weights) * Scale(losses)(losses)).max(axis=1)


def best_compromise(losses: np.ndarray, weights: np.ndarray) -> int:
    """The row of ``(n, goals)`` losses with the least `achievement`; of equal ones that of the
    least weighted sum, then the first. At least one row."""
    together = (np.asarray(weights) * Scale(losses)(losses)).sum(axis=1)
    return int(np.lexsort((np.arange(len(losses)), together, achievement(losses, weights)))[0])


def weights_of(told: Mapping[str, float] | None, goals: Sequence[str]) -> np.ndarray:
    """How much each of the ``goals`` counts, by what is ``told``: 1 where nothing is, 0 for one
    that shall not count. Raises `EvocityError` for another name, and for what is no weight."""
    found = dict.fromkeys(goals, 1.0)
    if told is not None and not isinstance(told, Mapping):
        raise _fault(told, f'write weights={{"{goals[0]}": 2}}')
    for name, weight in (told or {}).items():
        if name not in found:
            raise _fault(told, near_miss(str(name), goals) or f"the goals are {', '.join(goals)}")
        number = isinstance(weight, int | float | np.number) and not isinstance(weight, bool)
        if not (number and 0 <= weight < np.inf):
            raise _fault(told, f"{name} = {shown(weight)} is none")
        found[name] = float(weight)
    if not any(found.values()):
        raise _fault(told, "let one of the goals count")
    return np.array(list(found.values()))


def _fault(told: object, remedy: str) -> EvocityError:
    return EvocityError(
        f"weights = {shown(told)}", "a number of 0 or more for each goal that is named", remedy
    )


__all__ = ["achievement", "best_compromise", "weights_of"]
