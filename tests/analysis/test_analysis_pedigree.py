"""Who descends from whom, against an obvious twin."""

from types import SimpleNamespace

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evocity.analysis.pedigree import Pedigree, graph_of
from evocity.errors import RunError

nx = pytest.importorskip("networkx")


class Births:
    """As much of `Births` as a pedigree asks for: lists of parents, by id; ids have gaps."""

    def __init__(self, parents: list[list[int] | None]):
        self.ids = 3 * np.arange(len(parents)) + 1
        told = [one if one is None else [int(self.ids[k]) for k in one] for one in parents]
        self.parents = pa.array(told, pa.list_(pa.int64()))
        self.run = SimpleNamespace(path="night")

    def __len__(self) -> int:
        return len(self.ids)

    def rows(self, ids) -> np.ndarray:
        return np.searchsorted(self.ids, ids)


@st.composite
def pedigrees(draw) -> list[list[int] | None]:
    """Of each birth the places of its parents, older ones: none, null, some, some twice."""
    found = [[]]
    for k in range(1, draw(st.integers(1, 25))):
        found.append(draw(st.none() | st.lists(st.integers(0, k - 1), max_size=4)))
    return found


def naive(parents, rows, steps) -> set[int]:
    found, further = set(rows), set(rows)
    while further and steps != 0:
        further = {p for one in further for p in parents[one] or ()} - found
        found |= further
        steps = None if steps is None else steps - 1
    return found


@given(pedigrees(), st.data(), st.none() | st.integers(0, 4))
def test_ancestors_are_those_that_a_walk_finds(parents, data, steps):
    rows = data.draw(st.lists(st.integers(0, len(parents) - 1), max_size=6))
    found = Pedigree(Births(parents)).ancestors(np.array(rows, int), steps)
    assert found.tolist() == sorted(naive(parents, rows, steps))


@given(pedigrees(), st.data())
def test_a_graph_is_as_networkx_makes_it(parents, data):
    births = Births(parents)
    rows = data.draw(st.sets(st.integers(0, len(parents) - 1)).map(sorted))
    rows = np.array(rows, int)
    columns = {"operator": np.array(["mutation", "fusion"], object)[rows % 2], "gsi": rows / 7}
    graph = graph_of(births.ids[rows], columns, *Pedigree(births).edges(rows))
    wanted = nx.DiGraph()
    for row, operator, gsi in zip(rows.tolist(), *columns.values(), strict=True):
        wanted.add_node(int(births.ids[row]), operator=operator, gsi=gsi)
    for row in rows.tolist():
        among = [one for one in parents[row] or () if one in rows]
        wanted.add_edges_from((int(births.ids[one]), int(births.ids[row])) for one in among)
    assert nx.utils.graphs_equal(graph, wanted)
    assert list(graph) == list(wanted)
    assert all(type(node) is int for node in graph)


def test_a_birth_that_descends_from_a_later_one_is_damage():
    with pytest.raises(RunError, match="younger than its child"):
        Pedigree(Births([[], [1]])).ancestors(np.array([1]))
