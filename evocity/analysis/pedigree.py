"""Parents and ancestors of births, as arrays and as a graph."""

import gc
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from evocity.analysis.births import Births
from evocity.columns import lists_of
from evocity.errors import RunError, check_number
from evocity.selection.fronts import not_dominated

if TYPE_CHECKING:
    import networkx as nx


class Pedigree:
    def __init__(self, births: Births):
        self._births = births

    @cached_property
    def _links(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the parents of each row begin, ``(n + 1,)``, and their rows."""
        births = self._births
        lengths, parents = lists_of(births.parents)
        starts, rows = np.concatenate([[0], np.cumsum(lengths)]), births.rows(parents)
        if (rows >= np.repeat(np.arange(len(births)), np.diff(starts))).any():
            raise RunError(
                f"{births.run.path}: the log is damaged: a parent is younger than its child",
                "a log of births as `evocity run` writes it",
                "restore the run folder from a backup",
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
        """Return the rows of ``rows`` and their ancestors, over ``steps`` back, rising."""
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
    """Make a graph: a node for each of ``ids``, with its ``columns``, and an edge per parent."""
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
    """Pause the garbage collector, which takes long among very many new dictionaries."""
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
    expected = "a whole number of steps from child to parent, 0 or more"
    remedy = "leave generations out to go back to the source cities"
    check_number("generations", generations, 0, np.inf, expected, remedy=remedy, whole=True)
    return int(generations)


def archive_entries(births: Births) -> np.ndarray:
    """Return which births entered the archive when born, bool ``(n,)``; of equal ones the first.
    See `evocity.search.breeding.credit`."""
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
    """Return the names of operators, those with most births first, and columns as in
    `Run.credit`."""
    names, which, counts = np.unique(births.operator, return_inverse=True, return_counts=True)

    def counted(rows: np.ndarray) -> np.ndarray:
        return np.bincount(which[rows], minlength=len(names))

    among = counted(pedigree.ancestors(np.flatnonzero(births.alive)))
    share = among / max(1, among.sum())
    rejected = Counter(name for one in births.redrawn for name in one)
    columns = {
        "births": counts,
        "failed": counted(~births.ok),
        "copies": counted(births.copies),
        "redrawn": np.array([rejected[name] for name in names.tolist()], np.int64),
        "survived": counted(births.lived > 0),
        "entered": counted(archive_entries(births)),
        "ancestors": share,
        "paid": share * len(births) / counts,
        "seconds": np.bincount(which, births.seconds, len(names)) / counts,
    }
    order = np.lexsort((np.arange(len(names)), -counts))
    return names[order], {name: column[order] for name, column in columns.items()}
