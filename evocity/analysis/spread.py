"""How far apart many are: those that differ most, and how diverse the living were."""

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.likeness import Likeness


def farthest_first(distances: np.ndarray, count: int) -> np.ndarray:
    """Rows of ``count`` of those of ``(n, n)`` distances: the two farthest from each other, then
    each time the one farthest from all before it; of equal ones the first."""
    if not len(distances):
        return np.zeros(0, np.intp)
    chosen = list(np.unravel_index(int(distances.argmax()), distances.shape))
    chosen = list(dict.fromkeys(int(one) for one in chosen))[:count]
    near = distances[:, chosen].min(axis=1) if chosen else np.zeros(0)
    while 0 < len(chosen) < min(count, len(distances)):
        near[chosen] = -1
        chosen.append(int(near.argmax()))
        near = np.minimum(near, distances[:, chosen[-1]])
    return np.array(chosen, np.intp)


def diversity_of(
    told: Told, likeness: Likeness, by: str, count: int
) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of ``count`` generations at most, evenly from the first to the last, and of each how
    far two of those who lived then are from each other in the mean; NaN of fewer than two."""
    born, rows = told.lives
    chosen = np.unique(np.linspace(0, told.last, min(count, told.last + 1)).round().astype(int))
    found = []
    for generation in chosen:
        living = np.unique(rows[born == generation])
        living = living[told.ok[living]]
        matrix = likeness.matrix(told.ids[living], by)
        pairs = len(living) * (len(living) - 1)
        found.append(matrix.sum() / pairs if pairs else np.nan)
    return chosen, np.array(found)


__all__ = ["diversity_of", "farthest_first"]
