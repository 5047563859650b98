"""Which operators paid: how many of each were born, lived, entered the archive, left a trace."""

import numpy as np

from evocity.analysis.births import Told
from evocity.analysis.pedigree import Pedigree
from evocity.search.fronts import not_dominated


def entered(told: Told) -> np.ndarray:
    """Bool ``(n,)``: no birth of the run before it, or of its generation, dominated it; of those
    equal in all goals the first alone. What `evocity.search.credit` counts."""
    found = np.zeros(len(told), bool)
    front = np.empty((0, len(told.goals)))
    kept = np.flatnonzero(told.feasible)
    order = kept[np.argsort(told.generation[kept], kind="stable")]
    ends = np.flatnonzero(np.diff(told.generation[order], append=-1)) + 1
    for rows in np.split(order, ends[:-1]):
        together = np.vstack([front, told.losses[rows]])
        among = not_dominated(together)
        found[rows] = among[len(front) :]
        front = together[among]
    return found


def credit_of(told: Told, pedigree: Pedigree) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Operators, those of most births first, and columns of one value each: ``births``; ``failed``
    of them; ``survived``, lived in one generation at least; ``entered``, see `entered`;
    ``ancestors``, the share it has of all from whom the living descend, the living among them;
    ``paid``, that share by its share of the births; ``seconds``, the mean of a birth."""
    names, which, births = np.unique(told.operator, return_inverse=True, return_counts=True)

    def counted(rows: np.ndarray) -> np.ndarray:
        return np.bincount(which[rows], minlength=len(names))

    among = counted(pedigree.ancestors(np.flatnonzero(told.alive)))
    share = among / max(1, among.sum())
    columns = {
        "births": births,
        "failed": counted(~told.ok),
        "survived": counted(told.lived > 0),
        "entered": counted(entered(told)),
        "ancestors": share,
        "paid": share * len(told) / births,
        "seconds": np.bincount(which, told.seconds, len(names)) / births,
    }
    order = np.lexsort((np.arange(len(names)), -births))
    return names[order], {name: column[order] for name, column in columns.items()}


__all__ = ["credit_of", "entered"]
