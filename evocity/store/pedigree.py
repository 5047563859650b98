"""Who descends from whom, of births by the hundred thousand."""

import numpy as np
import pyarrow as pa

from evocity.columns import array_of, lists_of


def ancestry(births: pa.Table, identifier: int) -> np.ndarray | None:
    """Bool ``(n,)``: which rows of ``births``, with columns ``id`` and ``parents``, are the
    individual ``identifier`` or what it descends from; None if it is not among them.

    Parents that are not among the births are passed over. Of several rows of one id the last tells
    its parents, and all are marked.
    """
    ids = _array(births["id"])
    order = np.argsort(ids, kind="stable")
    ordered = ids[order]
    # where the parents of each row begin, and whose they are
    counts, parents = lists_of(births["parents"])
    starts = np.concatenate([[0], np.cumsum(counts)])

    def rows_of(wanted: np.ndarray) -> np.ndarray:
        """The last row of each id, -1 where it has none."""
        at = np.searchsorted(ordered, wanted, side="right") - 1
        return np.where((at >= 0) & (ordered[at] == wanted), order[at], -1)

    if not len(ids) or not ordered[0] <= identifier <= ordered[-1]:
        return None
    if (own := int(rows_of(np.array([identifier]))[0])) < 0:
        return None
    parents = rows_of(parents)
    marked, turn = np.zeros(len(ids), bool), np.empty(len(ids), np.int64)
    marked[own] = True
    further = np.array([own])
    while len(further):
        lengths = counts[further]
        within = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        found = parents[np.repeat(starts[further], lengths) + within]
        found = found[(found >= 0) & ~marked[found]]
        marked[found], turn[found] = True, np.arange(len(found))
        further = found[turn[found] == np.arange(len(found))]  # each once
    return np.isin(ids, ids[marked])


def _array(column: pa.ChunkedArray) -> np.ndarray:
    return array_of(column).astype(np.int64, copy=False)


__all__ = ["ancestry"]
