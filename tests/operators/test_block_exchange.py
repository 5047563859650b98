"""Block exchange: two macro-blocks of one size, seamless at both places."""

from types import SimpleNamespace

import naive
import numpy as np
import pytest
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import (
    ODD,
    assert_genes_stay_as_they_are,
    assert_laws,
    assert_meant,
    district,
    odd_maps,
    town,
)

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import OperatorError
from evocity.operators._kernels import outline_sides, outline_step
from evocity.operators.groups import Rearrangement, square
from evocity.operators.rearrangements import BlockExchange

GROUPS = [
    square(1),
    square(3),
    np.array([[0, 0, 1, 2, 2, 2], [0, 1, 0, 0, 1, 2]]),  # it is no square, and not convex
    np.array([[0, 2], [1, 0]]),  # nor is this connected
]


@pytest.mark.parametrize(
    "operator",
    [BlockExchange(), BlockExchange(size_min=1, size_max=2, tolerance=None, change=0)],
    ids=str,
)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, seed):
    parent = town()
    child = assert_laws(operator, parent, seed)
    assert np.array_equal(np.sort(stones(child)), np.arange(len(parent)))
    draft = operator.draft([parent], np.random.default_rng(seed))
    assert_genes_stay_as_they_are(parent, draft.genome)
    assert_meant(parent, draft)


@pytest.mark.parametrize("seed", range(5))
def test_two_squares_of_one_size_change_places(seed):
    operator = BlockExchange(size_min=3, size_max=5, count=1, tolerance=8.0, change=3.0)
    parent = town()
    child = operator([parent], np.random.default_rng(seed))
    places = np.arange(256)
    moved = stones(child) != places
    offsets = np.stack(np.divmod(stones(child)[moved], 16)) - np.divmod(places[moved], 16)
    ways = np.unique(offsets, axis=1)
    assert np.array_equal(ways[:, 0], -ways[:, 1])
    assert ways.shape[1] == 2
    there = np.stack(np.divmod(places[moved][(offsets == ways[:, :1]).all(axis=0)], 16))
    side = round(there.shape[1] ** 0.5)
    assert 3 <= side <= 5
    corner = there.min(axis=1)
    assert np.array_equal(there - corner[:, None], square(side))
    # what was asked for holds at both places
    blocks = parent.pavement.blocks(decode(parent).city.heights)
    other = corner + ways[:, 0]
    for start, end in ((corner, other), (other, corner)):
        assert naive.outline_step(blocks, blocks, 16, square(side), start, end) <= 8 + 1e-6
    here = (there[0] + ways[0, 0]) * 16 + there[1] + ways[1, 0]
    assert np.abs(blocks[there[0] * 16 + there[1]] - blocks[here]).mean() > 3


@pytest.mark.parametrize("name", ["new-york-west-village", "lyon-1er"])
def test_real_districts_take_nearly_all_exchanges(name):
    made = [
        BlockExchange(repair=None)([district(name)], np.random.default_rng(s)).made["exchanged"]
        for s in range(10)
    ]
    assert np.mean(made) >= 3.6


def test_what_is_not_admissible_is_not_exchanged():
    for impossible in ({"change": 1000.0}, {"tolerance": 0.0, "change": 5.0}):
        child = BlockExchange(**impossible)([town()], np.random.default_rng(0))
        assert child == town()
        assert child.made["exchanged"] == 0


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("sizes", [(1, 1), (2, 8), (9, 99)])
def test_ends_well_on_any_map(name, sizes):
    operator = BlockExchange(size_min=sizes[0], size_max=sizes[1])
    child = assert_laws(operator, odd_maps()[name], 0)
    no_room = sizes[0] == 9 and name != "narrow"
    if name in ("empty", "one roof") or no_room:
        assert child.made["exchanged"] == 0


def test_faults_are_told():
    with pytest.raises(OperatorError, match="size_max = 1, count = 0"):
        BlockExchange(size_min=2, size_max=1, count=0)


# -- kernels ------------------------------------------------------------------------------------


@pytest.mark.parametrize("group", GROUPS, ids=["1", "9", "hooked", "apart"])
def test_outlines_against_their_naive_twins(group):
    sides = outline_sides(group)
    assert sides.shape[1] == len(naive.outline_sides(group))
    assert set(zip(*sides.tolist(), strict=True)) == naive.outline_sides(group)
    rng = np.random.default_rng(3)
    current, brought = (rng.random((2, 42, 4, 4)) * 10).astype(np.float32)
    reach = np.array([6, 7]) - group.max(axis=1)
    corners = np.stack(np.divmod(np.arange(reach.prod()), reach[1]), axis=1)
    for start, end in zip(corners, corners[::-1], strict=True):
        truth = naive.outline_step(current, brought, 7, group, start, end)
        for most in (0.5 * truth, 1.001 * truth, np.inf):
            step = outline_step(current, brought, 7, 7, sides, start, end, most)
            assert step == pytest.approx(truth) or (truth > most and step == np.inf)


def test_the_outline_of_the_whole_map_is_its_border():
    blocks = np.random.default_rng(0).random((2, 6, 4, 4)).astype(np.float32)
    whole = np.stack(np.divmod(np.arange(6), 3))
    origin = np.zeros(2, int)
    assert outline_step(*blocks, 3, 3, outline_sides(whole), origin, origin, np.inf) == 0


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("exchanged", [False, True])
@pytest.mark.parametrize("group", GROUPS, ids=["1", "9", "hooked", "apart"])
def test_best_move_against_its_naive_twin(group, exchanged, turned):
    rng = np.random.default_rng(11)
    moves = Rearrangement(uniformly(CityMap(np.zeros((24, 28)), 2.0), reach=None).genome, "test")
    blocks = np.repeat(rng.integers(0, 4, (42, 1, 1)) * 3, 16, 1).reshape(42, 4, 4)
    moves.blocks = blocks = (blocks + rng.random(blocks.shape)).astype(np.float32)
    if turned:
        starts = np.zeros(2, np.int64)
        isos, ends = moves.turned_ends(group, starts, rng)
        assert len(np.unique(isos)) > 3
    else:
        reach = np.array([6, 7]) - group.max(axis=1)
        corners = np.stack(np.divmod(np.arange(reach.prod()), reach[1]), axis=1)
        starts, ends, isos = rng.permutation(corners), rng.permutation(corners), None
    each = np.broadcast_to(starts, ends.shape)
    ways = np.zeros(len(ends), int) if isos is None else isos
    found = set()
    for tolerance in (1.0, 4.0, np.inf):
        for change in (0.0, 3.0, 99.0):
            for choice in (1, 3, 99):
                asked = {"exchanged": exchanged, "change": change, "choice": choice}
                asked["tolerance"] = tolerance
                truth = naive.best_move(blocks, 7, group, ways, each, ends, **asked)
                rules = SimpleNamespace(tolerance=tolerance, change=change, choice=choice)
                best = moves.find_move(group, starts, ends, rules, exchanged=exchanged, isos=isos)
                assert (-1 if best is None else best) == truth
                found.add(truth)
    assert len(found) > 2
    assert -1 in found
