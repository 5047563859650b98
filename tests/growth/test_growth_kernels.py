"""The compiled loops of growth against slow twins."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.lib.stride_tricks import sliding_window_view

from evocity.growth import WINDOW, _kernels
from evocity.isometries import AFFINE

RNG = np.random.default_rng


# Two originals, of 6 × 8 and of 3 × 5 cells: rows, columns, first cell.
SIDES = np.array([(6, 8, 0), (3, 5, 48)])


def test_windows_of_stones_against_the_twin():
    rng = RNG(1)
    originals = [rng.random((12, 20)).astype("f4"), rng.random((8, 4)).astype("f4")]
    sides = np.array([(3, 5, 0), (2, 1, 15)])
    brought = np.concatenate([one.ravel() for one in originals])
    stones = rng.integers(-8, 8 * 17, (6, 5)).astype(np.int32)
    stones[stones < 0] = -1
    shown = naive.fabric(stones, originals, 4)
    assert (stones >= 8 * 15).any()
    for top, left, tall, wide in [(0, 0, 24, 20), (3, 5, 14, 11), (7, 6, 1, 1), (4, 4, 4, 16)]:
        out = np.empty((tall, wide), np.float32)
        _kernels.fabric_window(stones, brought, sides, AFFINE, 4, top, left, out)
        assert np.array_equal(out, shown[top : top + tall, left : left + wide])


@pytest.mark.parametrize("one", [0, 1])
@pytest.mark.parametrize("iso", range(8))
def test_candidates_against_the_twin(iso, one):
    rng = RNG(iso)
    rows, columns, first = SIDES[one]
    heights = [rng.random((24, 32)).astype("f4"), rng.random((12, 20)).astype("f4")]
    brought = np.concatenate([values.ravel() for values in heights])
    index = np.arange(first, first + rows * columns).reshape(rows, columns)
    seen = set()
    for draw in rng.integers(0, 1 << 62, 50):
        chosen = _kernels.candidate(draw, one, np.array([iso]), 2, 3, SIDES, AFFINE)
        seen.add(chosen[2:])
        assert chosen[:2] == (one, iso)
        for cell, values, flat in ((4, heights[one], brought), (1, index, np.arange(63))):
            start, down, along = _kernels.strides(chosen, 2, 3, cell, SIDES, AFFINE)
            at = [[start + y * down + x * along for x in range(3 * cell)] for y in range(2 * cell)]
            scaled = (cell * part for part in (*chosen[2:], 2, 3))
            assert np.array_equal(flat[at], naive.rectangle(values, iso, *scaled))
    assert len(seen) > (5 if one == 0 else 2)


def test_stones_name_where_they_come_from():
    for index in range(63):
        one = int(index >= 48)
        row, column = divmod(index - SIDES[one, 2], SIDES[one, 1])
        assert _kernels.origin(8 * index + 5, SIDES) == (one, 5, row, column)


@pytest.mark.parametrize("iso", range(8))
def test_what_a_group_uses_and_changes_against_the_twin(iso):
    rng = RNG(iso)
    uses, surplus = rng.integers(1, 9, 63), rng.normal(size=63)
    stones = rng.integers(-100, 8 * 63, (9, 9)).astype(np.int32)
    stones[stones < 0] = -1
    for draw in rng.integers(0, 1 << 62, 20):
        chosen = _kernels.candidate(draw, 0, np.array([iso]), 4, 3, SIDES, AFFINE)
        brought = naive.rectangle(np.arange(48).reshape(6, 8), iso, *chosen[2:], 4, 3)
        laid = rng.random((4, 3)) < 0.6
        laid[0, 0] = True
        place = np.array([2, 5, 4, 3])
        covered = stones[2:6, 5:8][laid]
        told = _kernels.laid_use(stones, place, uses, surplus, laid, chosen, SIDES, AFFINE)
        change = surplus[brought[laid]].sum() - surplus[covered[covered >= 0] // 8].sum()
        assert told == pytest.approx((uses[brought[laid]].mean(), change))
        after, counted = stones.copy(), uses.copy()
        _kernels.lay_stones(after, counted, 2, 5, laid, chosen, SIDES, AFFINE)
        expected = stones.copy()
        expected[2:6, 5:8][laid] = 8 * brought[laid] + iso
        assert np.array_equal(after, expected)
        assert counted.sum() == uses.sum() + (covered < 0).sum()


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_the_least_cut_against_all_cuts(data):
    shape = data.draw(st.sampled_from([(1, 1), (1, 5), (3, 3), (2, 5), (4, 3)]))
    cost = st.integers(0, 4)
    count = shape[0] * shape[1]
    costs = np.array(data.draw(st.lists(cost, min_size=2 * count, max_size=2 * count)), float)
    rims = np.array(data.draw(st.lists(cost, min_size=count, max_size=count)), float)
    kinds = data.draw(st.lists(st.integers(0, 3), min_size=count, max_size=count))
    must, never = (np.array(kinds).reshape(shape) == kind for kind in (0, 1))
    costs, rims = costs.reshape(*shape, 2), rims.reshape(shape)
    laid = np.zeros(shape, bool)
    _kernels.least_cut(costs, rims, must, never, laid)
    assert laid[must].all()
    assert not laid[never].any()
    # an edge costs 1/1024 m more, which decides between equal cuts alone
    assert naive.cut_cost(costs, rims, laid) == pytest.approx(
        naive.least_cut(costs, rims, must, never), abs=0.05
    )


@pytest.mark.parametrize("side", [1, 3, 8])
def test_window_keys_tell_equal_from_different(side):
    values = RNG(side).integers(-1, 2, (14, 17)).astype("f4")
    values[3:9, 2:9] = values[8:14, 9:16] = 1
    values[(values < 0) & (RNG(0).random(values.shape) < 0.9)] = 0
    keys = _kernels.window_keys(values, side)
    found = naive.windows(values, side)
    assert set(found) == set(np.ndindex(keys.shape))
    for corner, content in found.items():
        assert (keys[corner] == 0) == (content is None)
    pairs = {(content, keys[c]) for c, content in found.items() if content is not None}
    assert len(pairs) == len({k for k, _ in pairs}) == len({k for _, k in pairs})
    assert _kernels.window_keys(values, 18).size == 0


def test_window_keys_against_each_window_alone():
    values = RNG(0).random((70, 68)).astype("f4")
    keys = _kernels.window_keys(values, WINDOW)
    each = sliding_window_view(values, (WINDOW, WINDOW))
    for corner in np.ndindex(keys.shape):
        alone = _kernels.window_keys(np.ascontiguousarray(each[corner]), WINDOW)
        assert keys[corner] == alone[0, 0]


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_windows_that_come_twice_against_the_twin(seed):
    rng = RNG(seed)
    side, apart, across = 4, 3, 8
    values = rng.choice(np.array([0, 1, 9], "f4"), (20, 22), p=[0.45, 0.1, 0.45])
    values[15:, 12:] = -1
    elsewhere = values[1:9, 2:10].copy() if rng.random() < 0.5 else rng.random((8, 8)) + 2
    known, table = {}, (np.zeros(64, np.uint64), np.full(64, _kernels.FREE, np.int64))
    for y, x in np.ndindex(2, 2):  # anchors south of what is looked at
        content = np.ascontiguousarray(elsewhere[y : y + side, x : x + side], np.float32)
        known[90 + 3 * y, 3 * x] = content.tobytes()
        key = _kernels.window_keys(content, side)[0, 0]
        _kernels.remember(*table, key, (30 + y) * across + x)
    found = _kernels.window_keys(values, side)
    flat = _kernels.window_keys(np.zeros((side, side), np.float32), side).ravel()
    box = (*rng.integers(0, 10, 2), *rng.integers(11, 20, 2))
    for exempt, content in ((flat, {bytes(4 * side * side)}), (flat[:0], set())):
        assert _kernels.comes_twice(
            *table, found, exempt, side, 0, 0, apart, across, box
        ) == naive.comes_twice(values, known, content, side, apart, box)


def test_common_windows_are_those_that_hold_one():
    values = RNG(0).random((80, 90)).astype("f4")
    values[5:75, 12:82] = 0
    found = _kernels.window_keys(values, _kernels.ANCHORED)
    common = _kernels.window_keys(np.zeros((57, 57), np.float32), 57).ravel()
    flat = _kernels.window_keys(np.zeros((64, 64), np.float32), 64).ravel()
    every = _kernels.window_keys(values, WINDOW)
    kept = _kernels.common_windows(values, found, common, flat)
    for (y, x), key in np.ndenumerate(kept):
        window = values[y : y + 64, x : x + 64]
        holds = (sliding_window_view(window, (57, 57)) == 0).all(axis=(2, 3)).any()
        assert key == (every[y, x] if holds and window.any() else 0)
    assert 0 < np.count_nonzero(kept) < kept.size
    assert _kernels.common_windows(values, found, common[:0], flat).size == 0


def test_the_table_of_windows_against_a_dictionary():
    rng = RNG(0)
    keys, anchors = np.zeros(32, np.uint64), np.full(32, _kernels.FREE, np.int64)
    truth, filled = {}, 0
    for _ in range(400):
        key, anchor = np.uint64(rng.integers(1, 12) << 40), int(rng.integers(0, 5))
        if rng.random() < 0.6:
            filled += _kernels.remember(keys, anchors, key, anchor)
            truth[key] = anchor if truth.get(key, anchor) == anchor else "many"
        else:
            image = np.full((1, 1), key)
            _kernels.forget(keys, anchors, image, image * 0, anchor, 0, 1, 1)
            if truth.get(key) == anchor:
                del truth[key]
        if rng.random() < 0.05:
            keys, anchors, filled = _kernels.rehashed(keys, anchors, 64)
            assert filled == len(truth)
        for key in map(np.uint64, np.arange(1, 12) << 40):
            for anchor in range(5):
                elsewhere = _kernels.stands_elsewhere(keys, anchors, key, anchor)
                assert elsewhere == (key in truth and truth[key] != anchor)
