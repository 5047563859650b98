"""Credit of operators: how many births of each survived, entered the archive, have descendants."""

import numpy as np

from evocity.analysis.births import Births
from evocity.analysis.pedigree import Pedigree
from evocity.selection.fronts import not_dominated


def archive_entries(births: Births) -> np.ndarray:
    """Return which births entered the archive when born, bool ``(n,)``: no birth before them, or of
    their generation, dominated them; of equal ones the first. See
    `evocity.search.breeding.credit`."""
    entries = np.zeros(len(births), bool)
    front = np.empty((0, len(births.goals)))
    kept = np.flatnonzero(births.feasible)
    order = kept[np.argsort(births.generation[kept], kind="stable")]
    ends = np.flatnonzero(np.diff(births.generation[order], append=-1)) + 1
    for rows in np.split(order, ends[:-1]):
        together = np.vstack([front, births.losses[rows]])
        among = not_dominated(together)
        entries[rows] = among[len(front) :]
        front = together[among]
    return entries


def credit_of(births: Births, pedigree: Pedigree) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the names of operators, those with most births first, and columns: ``births``;
    ``failed`` of them; ``survived`` at least one generation; ``entered``, see `archive_entries`;
    ``ancestors``, its share of all ancestors of the living, the living among them; ``paid``, that
    share divided by its share of the births; ``seconds``, the mean of a birth."""
    names, which, counts = np.unique(births.operator, return_inverse=True, return_counts=True)

    def counted(rows: np.ndarray) -> np.ndarray:
        return np.bincount(which[rows], minlength=len(names))

    among = counted(pedigree.ancestors(np.flatnonzero(births.alive)))
    share = among / max(1, among.sum())
    columns = {
        "births": counts,
        "failed": counted(~births.ok),
        "survived": counted(births.lived > 0),
        "entered": counted(archive_entries(births)),
        "ancestors": share,
        "paid": share * len(births) / counts,
        "seconds": np.bincount(which, births.seconds, len(names)) / counts,
    }
    order = np.lexsort((np.arange(len(names)), -counts))
    return names[order], {name: column[order] for name, column in columns.items()}
