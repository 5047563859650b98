"""Whose stone stands where, to any depth."""

import itertools

import naive
import numpy as np
import pytest
from codes import draw_code, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity import isometries
from evocity.coding import ancestry, decode
from evocity.coding.ancestry import LIMIT
from evocity.condensation import Condensation
from evocity.errors import GenomeError

codes = st.builds(
    draw_code,
    seed=st.integers(0, 10**6),
    rows=st.integers(2, 5),
    columns=st.integers(2, 5),
    block=st.sampled_from([2, 4]),
    cities=st.integers(1, 4),
)
depths = st.sampled_from([0, 1, 2, 5, None])


def own(genome):
    """Float ``(H, W, cities)``: all of each block to the city of its own lifs."""
    plain = np.eye(len(genome.cities))[genome.parent]
    return np.stack([genome.pavement.raster(column) for column in plain.T], axis=-1)


def mixed(genome, depth):
    """Slow twin: block by block, colours shrunk and turned as heights are."""
    p, plain = genome.pavement, own(genome)
    weights = plain
    for _ in range(depth):
        before, weights = weights, plain.copy()
        for i, (top, left) in enumerate(zip(*p.corners, strict=True)):
            if not genome.dx[i]:
                continue
            tall, wide = genome.dy[i] // p.block, genome.dx[i] // p.block
            for city in range(len(genome.cities)):
                block = naive.shrunk(
                    before[..., city], genome.y[i], genome.x[i], tall, wide, p.block
                )
                place = np.s_[top : top + p.block, left : left + p.block, city]
                weights[place] += isometries.apply(int(genome.iso[i]), block)
                weights[place] /= 2
    return weights


@settings(max_examples=30, deadline=None)
@given(codes, st.integers(0, 4))
def test_weights_are_those_of_blocks_pulled_one_by_one(genome, depth):
    np.testing.assert_allclose(ancestry(genome, depth=depth), mixed(genome, depth), atol=1e-5)


@settings(max_examples=30, deadline=None)
@given(codes, depths)
def test_weights_are_shares(genome, depth):
    weights = ancestry(genome, depth=depth)
    assert weights.shape == (genome.pavement.height, genome.pavement.width, len(genome.cities))
    assert weights.dtype == np.float32
    assert weights.min() >= 0
    assert weights.max() <= 1
    np.testing.assert_allclose(weights.sum(axis=-1), 1, atol=1e-5)


@settings(max_examples=20, deadline=None)
@given(codes, depths)
def test_half_of_each_pixel_is_its_own_citys(genome, depth):
    plain = own(genome)
    assert (ancestry(genome, depth=depth)[plain == 1] >= 0.5 - 1e-6).all()
    uniform = genome.pavement.raster(genome.uniform)
    np.testing.assert_array_equal(ancestry(genome, depth=depth)[uniform], plain[uniform])


@settings(max_examples=20, deadline=None)
@given(codes)
def test_each_iteration_halves_what_is_left(genome):
    steps = [ancestry(genome, depth=depth).astype(float) for depth in range(8)]
    for depth, (before, after) in enumerate(itertools.pairwise(steps)):
        assert np.abs(after - before).max() <= 2.0 ** -(depth + 1) + 1e-6
    limit = ancestry(genome, depth=60)
    assert np.abs(ancestry(genome) - limit).max() <= 2.0**-LIMIT + 1e-6
    np.testing.assert_array_equal(ancestry(genome), ancestry(genome, depth=LIMIT))


def test_depth_0_is_the_city_of_each_block():
    genome = draw_code(3)
    np.testing.assert_array_equal(ancestry(genome, depth=0), own(genome))


def test_a_code_of_one_city_is_its_own(town):
    weights = ancestry(uniformly(town).genome)
    assert weights.shape == (*town.shape, 1)
    np.testing.assert_allclose(weights, 1, atol=1e-6)


def test_a_city_that_no_lifs_is_from_has_no_part():
    genome = draw_code(4, cities=2)
    genome = genome.replace(cities=(*genome.cities, "another"))
    assert not ancestry(genome)[..., 2].any()


def test_a_block_made_of_another_citys_stone_is_half_its():
    """One block of the first city calls a domain block that lies in the second alone."""
    genome = draw_code(5, rows=4, columns=4, cities=2)
    n = len(genome)
    none = {name: np.zeros(n, int) for name in ("y", "x", "dy", "dx", "iso")}
    none["dy"][0] = none["dx"][0] = none["y"][0] = none["x"][0] = 8
    parent = np.ones(n, int)
    parent[0] = 0
    sigma = np.where(np.arange(n) == 0, 0.5, 0)
    weights = ancestry(genome.replace(sigma=sigma, parent=parent, **none))
    np.testing.assert_allclose(weights[:4, :4], 0.5, atol=1e-6)
    np.testing.assert_array_equal(weights[4:, :, 1], 1)


def test_what_is_kept_is_its_own_citys():
    genome = draw_code(6)
    mask = np.zeros((genome.pavement.height, genome.pavement.width), bool)
    mask[3:15, 2:20] = True
    locked = genome.replace(condensation=Condensation(np.full(mask.shape, 40.0), mask))
    weights = ancestry(locked)
    np.testing.assert_array_equal(weights[mask], own(genome)[mask])
    np.testing.assert_allclose(weights.sum(axis=-1), 1, atol=1e-5)
    assert (weights != ancestry(genome)).any()


def test_zoom_asks_for_as_many_weights_as_heights(town):
    genome = uniformly(town).genome
    for zoom in (0.5, 2):
        assert ancestry(genome, zoom=zoom).shape[:2] == decode(genome, zoom=zoom).city.shape


@pytest.mark.parametrize("depth", [-1, 1.5, "2", True, float("inf")])
def test_a_depth_that_is_none_is_refused(depth):
    with pytest.raises(GenomeError, match="whole number of iterations"):
        ancestry(draw_code(1), depth=depth)


def test_any_zoom_keeps_the_shares():
    with pytest.raises(GenomeError, match="zoom"):
        ancestry(draw_code(1), zoom=-1)
    code = draw_code(1)
    weights = ancestry(code, zoom=0.8)
    assert weights.shape == (16, 19, 3)
    assert np.abs(weights.sum(axis=2) - 1).max() < 1e-5
    whole = ancestry(code, zoom=1)
    assert weights.mean(axis=(0, 1)) == pytest.approx(whole.mean(axis=(0, 1)), abs=0.03)
