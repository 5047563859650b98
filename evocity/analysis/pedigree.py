"""Who descends from whom, as arrays and as a graph."""

import gc
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.births import Told
from evocity.columns import lists_of
from evocity.errors import EvocityError, RunError, shown

if TYPE_CHECKING:
    import networkx as nx


class Pedigree:
    """The parents of all births that are ``told``."""

    def __init__(self, told: Told):
        self._told = told

    @cached_property
    def _links(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the parents of each row begin, ``(n + 1,)``, and their rows. Raises `RunError` if
        one is none of the births, or no older than its child."""
        told = self._told
        lengths, parents = lists_of(told.parents)
        starts, rows = np.concatenate([[0], np.cumsum(lengths)]), told.rows(parents)
        if (rows >= np.repeat(np.arange(len(told)), np.diff(starts))).any():
            raise RunError(
                f"{told.run.path}: the births are damaged: one descends from a later one",
                "births as `evocity run` writes them",
                "bring the folder back from a copy",
            )
        return starts, rows

    def parents(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Of the births in ``rows`` each parent's row, and the row of its child."""
        found, counts = self._of(rows)
        return found, np.repeat(rows, counts)

    def _of(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The rows of the parents of those in ``rows``, and how many each has."""
        starts, parents = self._links
        begin = starts[rows]
        counts = starts[rows + 1] - begin
        ends = counts.cumsum()
        return parents[np.repeat(begin - ends + counts, counts) + np.arange(counts.sum())], counts

    def ancestors(self, rows: np.ndarray, steps: int | None = None) -> np.ndarray:
        """The rows of all from whom those in ``rows`` descend, and their own, rising; back over so
        many ``steps``, all the way unless it is told."""
        found = np.zeros(len(self._told), bool)
        found[rows] = True
        further, gone = np.flatnonzero(found), 0
        last = np.zeros(len(found), int)  # where among the new ones each stands last
        while further.size and (steps is None or gone < steps):
            parents, gone = self._of(further)[0], gone + 1
            parents = parents[~found[parents]]
            found[parents] = True
            places = np.arange(len(parents))
            last[parents] = places
            further = parents[last[parents] == places]  # each once, which needs no sorting
        return np.flatnonzero(found)

    def edges(self, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Ids of parent and child of each link among the births in ``rows``."""
        parents, children = self.parents(rows)
        among = np.zeros(len(self._told), bool)
        among[rows] = True
        among = among[parents]
        return self._told.ids[parents[among]], self._told.ids[children[among]]


def graph_of(
    ids: np.ndarray, columns: Mapping[str, np.ndarray], parents: np.ndarray, children: np.ndarray
) -> "nx.DiGraph":
    """A node each of ``ids`` with what ``columns`` have of it, an edge from each of ``parents`` to
    its child."""
    import networkx

    graph, nodes = networkx.DiGraph(), ids.tolist()
    # as `add_nodes_from` and `add_edges_from` leave it, in a third of the time
    after, before = graph._succ, graph._pred
    with _uncollected():
        empty = dict.fromkeys(columns)
        told = [empty.copy() for _ in nodes]
        for name, column in columns.items():
            for one, value in zip(told, column.tolist(), strict=True):
                one[name] = value
        graph._node.update(zip(nodes, told, strict=True))
        after.update((node, {}) for node in nodes)
        before.update((node, {}) for node in nodes)
        for parent, child in zip(parents.tolist(), children.tolist(), strict=True):
            after[parent][child] = before[child][parent] = {}
    return graph


@contextmanager
def _uncollected() -> Iterator[None]:
    """Within, Python does not look for rings of garbage: among hundreds of thousands of new
    dictionaries that takes as long again as to make them."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


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


__all__ = ["Pedigree", "graph_of", "steps_of"]
