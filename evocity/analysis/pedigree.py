"""Who descends from whom, as arrays and as a graph."""

from functools import cached_property

import numpy as np

from evocity.analysis.births import Told
from evocity.errors import EvocityError, RunError, shown


class Pedigree:
    """The parents of all births that are ``told``."""

    def __init__(self, told: Told):
        self._told = told

    @cached_property
    def _links(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the parents of each row begin, ``(n + 1,)``, and their rows. Raises `RunError` if
        one is none of the births, or no older than its child."""
        told = self._told
        column = told.parents
        starts = np.concatenate([[0], np.cumsum(column.value_lengths().fill_null(0).to_numpy())])
        rows = told.rows(column.flatten().to_numpy())
        if (rows >= np.repeat(np.arange(len(told)), np.diff(starts))).any():
            raise RunError(
                f"{told.run.path}: the births are damaged: one descends from a later one",
                "births as `evocity run` writes them",
                "bring the folder back from a copy",
            )
        return starts, rows

    def parents(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the births in ``rows`` each parent's row, and the row of its child."""
        starts, parents = self._links
        counts = starts[rows + 1] - starts[rows]
        first = np.repeat(starts[rows] - np.concatenate([[0], np.cumsum(counts)[:-1]]), counts)
        return parents[first + np.arange(counts.sum())], np.repeat(rows, counts)

    def ancestors(self, rows: np.ndarray, steps: int | None = None) -> np.ndarray:
        """The rows of all from whom those in ``rows`` descend, and their own, rising; back over so
        many ``steps``, all the way unless it is told."""
        found = np.zeros(len(self._told), bool)
        found[rows] = True
        further, gone = np.unique(rows), 0
        while further.size and (steps is None or gone < steps):
            parents = np.unique(self.parents(further)[0])
            further, gone = parents[~found[parents]], gone + 1
            found[further] = True
        return np.flatnonzero(found)

    def edges(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ids of parent and child of each link among the births in ``rows``."""
        parents, children = self.parents(rows)
        among = np.isin(parents, rows)
        return self._told.ids[parents[among]], self._told.ids[children[among]]


def steps_of(generations: object) -> int | None:
    """How many steps back are asked for. Raises `EvocityError` for what is no number of them."""
    if generations is None:
        return None
    whole = isinstance(generations, int | np.integer) and not isinstance(generations, bool)
    if not whole or generations < 0:
        raise EvocityError(
            f"generations = {shown(generations)}",
            "a whole number of steps from child to parent, 0 or more",
            "leave it out for all the way back to the source cities",
        )
    return int(generations)


__all__ = ["Pedigree", "steps_of"]
