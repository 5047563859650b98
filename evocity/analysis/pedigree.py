"""Parents and ancestors of births, as arrays and as a graph."""

import gc
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.births import Births
from evocity.columns import lists_of
from evocity.errors import EvocityError, RunError, spell

if TYPE_CHECKING:
    import networkx as nx


class Pedigree:
    """The parents of all ``births`` of a run."""

    def __init__(self, births: Births):
        self._births = births

    @cached_property
    def _links(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the parents of each row begin, ``(n + 1,)``, and their rows. Raises `RunError` if
        one is not among the births, or no older than its child."""
        births = self._births
        lengths, parents = lists_of(births.parents)
        starts, rows = np.concatenate([[0], np.cumsum(lengths)]), births.rows(parents)
        if (rows >= np.repeat(np.arange(len(births)), np.diff(starts))).any():
            raise RunError(
                f"{births.run.path}: the births are damaged: a parent is younger than its child",
                "births as `evocity run` writes them",
                "bring the folder back from a copy",
            )
        return starts, rows

    def parents(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the row of each parent of the births in ``rows``, and the row of its child."""
        parents, counts = self._of(rows)
        return parents, np.repeat(rows, counts)

    def _of(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rows of the parents of those in ``rows``, and the number of each one's parents."""
        starts, parents = self._links
        begin = starts[rows]
        counts = starts[rows + 1] - begin
        ends = counts.cumsum()
        return parents[np.repeat(begin - ends + counts, counts) + np.arange(counts.sum())], counts

    def ancestors(self, rows: np.ndarray, steps: int | None = None) -> np.ndarray:
        """Return the rows of those in ``rows`` and of all their ancestors, over ``steps`` back,
        rising."""
        marked = np.zeros(len(self._births), bool)
        marked[rows] = True
        further, gone = np.flatnonzero(marked), 0
        last = np.zeros(len(marked), int)  # the last place of each among the new ones
        while further.size and (steps is None or gone < steps):
            parents, gone = self._of(further)[0], gone + 1
            parents = parents[~marked[parents]]
            marked[parents] = True
            places = np.arange(len(parents))
            last[parents] = places
            further = parents[last[parents] == places]  # each once, without sorting
        return np.flatnonzero(marked)

    def edges(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the ids of parent and child of each link among the births in ``rows``."""
        parents, children = self.parents(rows)
        among = np.zeros(len(self._births), bool)
        among[rows] = True
        among = among[parents]
        return self._births.ids[parents[among]], self._births.ids[children[among]]


def graph_of(
    ids: np.ndarray, columns: Mapping[str, np.ndarray], parents: np.ndarray, children: np.ndarray
) -> "nx.DiGraph":
    """Make a graph with a node for each of ``ids``, with its values of ``columns``, and an edge
    from each of ``parents`` to its child."""
    import networkx

    graph, nodes = networkx.DiGraph(), ids.tolist()
    # the same as `add_nodes_from` and `add_edges_from`, in a third of the time
    after, before = graph._succ, graph._pred
    with _uncollected():
        empty = dict.fromkeys(columns)
        values = [empty.copy() for _ in nodes]
        for name, column in columns.items():
            for one, value in zip(values, column.tolist(), strict=True):
                one[name] = value
        graph._node.update(zip(nodes, values, strict=True))
        after.update((node, {}) for node in nodes)
        before.update((node, {}) for node in nodes)
        for parent, child in zip(parents.tolist(), children.tolist(), strict=True):
            after[parent][child] = before[child][parent] = {}
    return graph


@contextmanager
def _uncollected() -> Iterator[None]:
    """Pause the garbage collector, which takes long among hundreds of thousands of new
    dictionaries."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def steps_of(generations: object) -> int | None:
    """Return the number of steps back. Raises `EvocityError` for a value that is not one."""
    if generations is None:
        return None
    whole = isinstance(generations, int | np.integer) and not isinstance(generations, bool)
    if not whole or generations < 0:
        raise EvocityError(
            f"generations = {spell(generations)}",
            "a whole number of steps from child to parent, 0 or more",
            "leave generations out to go back to the source cities",
        )
    return int(generations)
