"""Bounds leave out only what cannot win."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity import isometries
from evocity.coding import search
from evocity.coding.search.domains import d4_matrix, domain_pool, domain_pools
from evocity.coding.search.matches import UNSURE
from evocity.coding.search.tiles import cut_tiles, distinct, range_shares, reach, used_parts
from evocity.pavement import Pavement


def codes_of(blocks):
    flat = blocks.reshape(len(blocks), -1).astype(float)
    centred = flat - flat.mean(axis=1, keepdims=True)
    return centred.astype(np.float32) @ d4_matrix(blocks.shape[-1]).T


def towns(draw, side, block):
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    heights = rng.choice([0, 3, 6.5, 12], (side, side)).astype(np.float32)
    smooth = rng.random((side, side)).astype(np.float32) * draw(st.sampled_from([0, 1, 30]))
    heights = np.repeat(np.repeat(heights, 3, 0), 3, 1)[:side, :side] + smooth
    return heights, Pavement(side, side, block).blocks(heights)[::7]


@settings(max_examples=15, deadline=None)
@given(st.data(), st.sampled_from([2, 3, 4, 5, 8]), st.sampled_from([0.5, 0.9, np.inf]))
def test_a_tile_reaches_what_its_best_block_explains(data, block, sigma_max):
    heights, blocks = towns(data.draw, {2: 16, 3: 18, 4: 24, 5: 25, 8: 32}[block], block)
    pool = domain_pool(heights, block, 2)
    places = distinct(pool)
    tiles = cut_tiles(pool.planes, pool.norms, places, sigma_max)
    codes = codes_of(blocks)
    energy = np.einsum("nk,nk->n", codes, codes)
    best = np.zeros(len(codes), np.float32)
    reached = reach(tiles, codes, np.float32(UNSURE) * energy, best)
    truth = np.zeros_like(reached)
    for n, (y, x) in enumerate(zip(tiles.y[: places.size], tiles.x[: places.size], strict=True)):
        domain = naive.shrunk(heights, int(y), int(x), 2, 2, block)
        for i, block_i in enumerate(blocks):
            gain = max(gain for gain, _ in naive.gains(block_i, domain, sigma_max))
            truth[i, n // 32] = max(truth[i, n // 32], gain)
    slack = 1e-5 * energy + 1e-6
    assert np.allclose(best, truth.max(axis=1, initial=0), rtol=1e-5, atol=slack.max())
    left_out = reached < 0
    hopeless = truth < (best - UNSURE * energy + slack)[:, None]
    assert hopeless[left_out].all()
    assert np.abs(reached - truth)[~left_out].max(initial=0) <= slack.max()


@pytest.mark.parametrize("block", [2, 3, 4, 5, 8])
def test_part_norms_are_the_blocks_own_under_every_isometry(block):
    blocks = np.random.default_rng(block).random((6, block, block)).astype(np.float32)
    shares = range_shares(codes_of(blocks))
    assert shares.shape == (6, len(used_parts(block)))
    energy = blocks.var(axis=(1, 2)) * block**2
    assert (shares**2).sum(axis=1) == pytest.approx(energy, rel=1e-4)
    for k in range(8):
        turned = isometries.apply(k, blocks)
        assert range_shares(codes_of(turned)) == pytest.approx(shares, abs=2e-3)


def test_of_domain_blocks_alike_the_first_is_kept(town):
    heights = np.tile(town.heights[:20, :20], (2, 2)) + np.float32(3)
    pool = domain_pool(heights, 4, 2)
    columns = pool.norms.shape[1]
    seen, truth = set(), []
    for y, x in np.argwhere(pool.norms):
        relief = naive.shrunk(heights, y, x, 2, 2, 4)
        relief = (relief - relief[0, 0] + 0.0).tobytes()
        if relief not in seen:
            seen.add(relief)
            truth.append(y * columns + x)
    assert np.array_equal(distinct(pool), truth)
    assert len(truth) < np.count_nonzero(pool.norms) / 2


def test_leaving_out_doubles_changes_nothing(town, monkeypatch):
    heights = np.tile(town.heights[:16, :16], (2, 3))
    pavement = Pavement(*heights.shape, 4)
    blocks = pavement.blocks(heights)

    def found():
        return search.best_matches(
            domain_pools(heights, 4, (2, 3)), blocks, pavement.corners, reach=None, sigma_max=0.9
        )

    one = found()
    monkeypatch.setattr(search, "distinct", lambda pool: np.flatnonzero(pool.norms))
    two = found()
    for name in ("multiple", "y", "x", "iso", "sigma", "beta"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


def test_flat_maps_have_no_tiles():
    pool = domain_pool(np.full((16, 16), 7, np.float32), 4, 2)
    tiles = cut_tiles(pool.planes, pool.norms, distinct(pool), 0.9)
    best = np.zeros(3, np.float32)
    assert reach(tiles, np.ones((3, 16), np.float32), best, best).shape == (3, 0)
    assert not best.any()
