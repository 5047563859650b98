"""Distances of births by structural similarity and by shifted correlation."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skimage.metrics import structural_similarity
from skimage.registration import phase_cross_correlation

from evocity.analysis.likeness import Likeness, phases, shift_distances, structure_distances
from evocity.errors import EvocityError

CELLS = st.integers(0, 99).map(
    lambda seed: np.random.default_rng(seed).choice([0.0, 9.0, 15.0], (3, 16, 16))
)


@settings(deadline=None, max_examples=20)
@given(CELLS)
def test_distances_are_symmetric_and_zero_for_equal_maps(cells):
    found = phases(cells)
    for i, j in itertools.product(range(3), repeat=2):
        structure = structure_distances(cells[i], cells[j : j + 1])[0]
        shift = shift_distances(found[i], found[j : j + 1])[0]
        assert structure == pytest.approx(structure_distances(cells[j], cells[i : i + 1])[0])
        assert shift == pytest.approx(shift_distances(found[j], found[i : i + 1])[0], abs=1e-9)
        assert 0 <= structure <= 1
        assert 0 <= shift <= 1
        if i == j:
            assert structure == pytest.approx(0, abs=1e-12)
            assert shift == pytest.approx(0, abs=0.05)  # empty frequencies have no phase
    true = (1 - structural_similarity(cells[0], cells[1], data_range=30.0)) / 2
    assert structure_distances(cells[0], cells[1:2])[0] == pytest.approx(true)


@settings(deadline=None, max_examples=20)
@given(CELLS, st.integers(-5, 5), st.integers(-5, 5))
def test_a_shifted_map_is_the_same_by_shift_alone(cells, down, along):
    one, moved = cells[0], np.roll(cells[0], (down, along), (0, 1))
    found = phases(np.stack([one, moved, cells[1]]))
    near, far = shift_distances(found[0], found[1:])
    assert near == pytest.approx(0, abs=0.05)
    assert far > near + 0.2
    shift, *_ = phase_cross_correlation(moved, one, normalization="phase")
    assert np.array_equal(np.roll(one, shift.astype(int), (0, 1)), moved)
    assert near == pytest.approx(naive_shift(one, moved), abs=1e-6)


@pytest.mark.parametrize("side", [58, 59])
def test_maps_of_odd_and_even_sides_are_compared_alike(side):
    cells = np.random.default_rng(side).choice([0.0, 9.0, 15.0], (2, side, side))
    moved = np.roll(cells[0], (3, -8), (0, 1))
    found = phases(np.stack([cells[0], moved, cells[1]]))
    near, far = shift_distances(found[0], found[1:])
    assert near == pytest.approx(1 / side**2, abs=1e-6)  # the mean has no phase
    assert far > 0.8


@pytest.mark.parametrize("height", [0.0, 9.3])
def test_level_ground_is_like_itself_and_unlike_a_town(height):
    town = np.random.default_rng(5).choice([0.0, 9.0], (1, 59, 59))
    found = phases(np.concatenate([np.full((2, 59, 59), height), town]))
    assert shift_distances(found[0], found).tolist() == [0, 0, 1]
    assert shift_distances(found[2], found[:2]).tolist() == [1, 1]


def naive_shift(one, other):
    """Phase correlation by sums over all shifts of the whitened maps."""
    whitened = [np.fft.ifft2(phase_of(cells)).real for cells in (one, other)]
    sums = [
        (np.roll(whitened[0], (down, along), (0, 1)) * whitened[1]).sum()
        for down in range(one.shape[0])
        for along in range(one.shape[1])
    ]
    return 1 - max(sums)


def phase_of(cells):
    spectrum = np.fft.fft2(cells - cells.mean())
    return spectrum / np.maximum(abs(spectrum), 1e-9)


def test_runs_are_compared_slowly(run):
    ids = run.columns.ids[run.columns.ok][:6]
    likeness = Likeness(run.columns)
    for by in ("structure", "shift"):
        matrix = likeness.matrix(ids, by)
        assert np.array_equal(matrix, matrix.T)
        np.testing.assert_allclose(likeness.from_one(int(ids[0]), ids[1:], by), matrix[0, 1:])
        assert set(run.clusters(2, by=by, of=ids.tolist())["cluster"]) == {0, 1}
    with pytest.raises(EvocityError, match="at most 500"):
        likeness.matrix(np.arange(501), "shift")
