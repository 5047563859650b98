"""Correlations found before: the hashes of windows, and the table."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity.coding.matching import local_search
from evocity.coding.matching.known_windows import KnownWindows, window_keys
from evocity.coding.matching.known_windows._kernels import hash_blocks, hash_windows
from tests import naive


def draw_map(seed: int, rows: int = 40, columns: int = 48) -> np.ndarray:
    rng = np.random.default_rng(seed)
    heights = np.zeros((rows, columns), np.float32)
    for _ in range(12):
        y, x = rng.integers(0, rows), rng.integers(0, columns)
        tall, wide = rng.integers(3, 12, 2)
        heights[y : y + tall, x : x + wide] = rng.integers(3, 30)
    return heights


@pytest.mark.parametrize(("before", "after"), [(0, 0), (1, 2), (3, 4)])
def test_the_hashes_are_those_of_their_naive_twins(before, after):
    pixels = draw_map(1, 20, 28).view(np.uint32)
    about = np.array([3, 1 << 63], np.uint64)
    blocks, keys = np.empty((2, 5, 7, 2), np.uint64)
    hash_blocks(pixels, 4, about, blocks)
    assert np.array_equal(blocks, naive.hash_blocks(pixels, 4, about))
    hash_windows(blocks, before, after, keys)
    assert np.array_equal(keys, naive.hash_windows(blocks, before, after))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), y=st.integers(0, 39), x=st.integers(0, 47))
def test_a_pixel_changes_the_keys_of_the_blocks_that_may_read_it(seed, y, x):
    heights = draw_map(seed)
    changed = heights.copy()
    changed[y, x] += 0.5
    one, two = (window_keys(city, 4, (2,), 6, 0.005) for city in (heights, changed))
    differs = (one != two).any(axis=1).reshape(10, 12)
    assert np.array_equal(differs, (one != two).all(axis=1).reshape(10, 12))
    for i, j in np.ndindex(10, 12):
        # domain blocks of 8 px, at most 6 px away
        reads = -6 <= y - 4 * i < 14 and -6 <= x - 4 * j < 14
        assert differs[i, j] or not reads


def test_settings_and_minus_zero_change_all_keys():
    heights = draw_map(3)
    first = window_keys(heights, 4, (2,), 6, 0.005)
    for other in (
        window_keys(heights, 4, (2,), 7, 0.005),
        window_keys(heights, 4, (1, 2), 6, 0.005),
        window_keys(heights, 4, (2,), 6, 0.006),
        window_keys(np.where(heights == 0, np.float32(-0.0), heights), 4, (2,), 6, 0.005),
    ):
        assert (first != other).all()


def test_equal_surroundings_have_one_key_anywhere_within_the_map():
    heights = np.tile(draw_map(4, 24, 24), (3, 3))
    keys = window_keys(heights, 4, (2,), 6, 0.005).reshape(18, 18, 2)
    assert np.array_equal(keys[3:7, 3:7], keys[9:13, 9:13])
    assert (keys[0, 0] != keys[6, 6]).all()  # the map ends here


def test_correlations_are_the_same_with_a_memory(monkeypatch):
    """One map after another, each like the one before it but for a building."""
    heights, rng = draw_map(5, 64, 64), np.random.default_rng(5)
    memory = KnownWindows(1 << 12)
    monkeypatch.setattr(local_search, "_KNOWN", memory)
    for turn in range(6):
        y, x = rng.integers(0, 56, 2)
        heights[y : y + 8, x : x + 6] = 5 + turn
        found = local_search.best_correlations(heights)
        again = local_search.best_correlations(heights)
        monkeypatch.setattr(local_search, "_KNOWN", KnownWindows(1 << 12))
        alone = local_search.best_correlations(heights)
        monkeypatch.setattr(local_search, "_KNOWN", memory)
        for one, two, three in zip(found, again, alone, strict=True):
            assert one.tobytes() == two.tobytes() == three.tobytes()
    assert (memory._values > 0).any()


def test_a_full_table_forgets_and_never_confuses():
    memory, rng = KnownWindows(16), np.random.default_rng(6)
    keys = rng.integers(0, 1 << 63, (200, 2)).astype(np.uint64)
    values = rng.random(200, np.float32)
    memory.keep(keys, values)
    found, known = memory.look_up(keys)
    assert 0 < known.sum() <= 16
    assert np.array_equal(found[known], values[known])
    assert not found[~known].any()
    other = keys.copy()
    other[:, 1] += np.uint64(1)  # the same place, another window
    assert not memory.look_up(other)[1].any()
