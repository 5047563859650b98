"""Bounds leave out only what cannot win."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from evocity.accelerate.vectors import WIDTH
from evocity.coding import matching
from evocity.coding.matching._kernels import LANES, ROOM, hopeful, most_likely, promises
from evocity.coding.matching.candidates import RangeCodes, domain_blocks
from evocity.coding.matching.d4 import d4_matrix
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.matches import UNSURE
from evocity.coding.matching.tiles import cut_tiles, raise_best
from evocity.coding.parameters import Coding
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


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(st.data(), st.sampled_from([2, 3, 4, 5, 8]), st.sampled_from([0.5, 0.9, np.inf]))
def test_a_tile_reaches_what_its_best_block_explains(data, block, sigma_max):
    heights, blocks = towns(data.draw, {2: 16, 3: 18, 4: 24, 5: 25, 8: 32}[block], block)
    pool = naive.domain_pool(heights, block, 2)
    tiles = cut_tiles(domain_blocks(pool), sigma_max)
    codes = codes_of(blocks)
    energy = np.einsum("nk,nk->n", codes, codes)
    best = np.zeros(len(codes), np.float32)
    slack = np.float32(UNSURE) * energy
    listed = raise_best(tiles, RangeCodes.of(codes), slack, best)
    truth = np.zeros((len(tiles.tops), len(codes)))
    for n, (y, x) in enumerate(zip(*np.divmod(tiles.at, tiles.width), strict=True)):
        domain = naive.shrunk(heights, int(y), int(x), 2, 2, block)
        for i, block_i in enumerate(blocks):
            gain = max(gain for gain, _ in naive.gains(block_i, domain, sigma_max))
            truth[n // LANES, i] = max(truth[n // LANES, i], gain)
    rounding = 1e-5 * energy + 1e-6
    assert np.allclose(best, truth.max(axis=0, initial=0), rtol=1e-5, atol=rounding.max())
    tile, which, gains = listed
    assert np.abs(gains - truth[tile, which]).max(initial=0) <= rounding.max()
    assert (np.diff(tile) >= 0).all()
    assert len(set(zip(tile, which, strict=True))) == tile.size
    left_out = np.ones_like(truth, bool)
    left_out[tile, which] = False
    hopeless = truth < best - slack + rounding
    assert hopeless[left_out].all()


def test_no_end_of_equals_is_lost():
    """A chessboard's tiles all explain as much: more than there is room for at first."""
    heights = np.kron(np.indices((64, 64)).sum(axis=0) % 2, np.ones((4, 4))).astype(np.float32)
    heights += np.arange(256, dtype=np.float32)[:, None] * 3
    pool = naive.domain_pool(heights, 4, 2)
    tiles = cut_tiles(domain_blocks(pool, doubles=True), np.inf)
    blocks = Pavement(*heights.shape, 4).blocks(heights)
    codes = codes_of(blocks)[:300]
    best, slack = np.zeros(len(codes), np.float32), np.full(len(codes), 1e9, np.float32)
    tile, *_ = raise_best(tiles, RangeCodes.of(codes), slack, best)
    assert tile.size == len(tiles.tops) * len(codes) > ROOM


@njit
def run_hopeful(peaks, tops, shares, norms, near, which):
    return hopeful(5, peaks, 1, tops, shares, norms, near, which)


@njit
def run_promises(shares, ceilings, ours, norms, near, i):
    return promises(5, shares, 1, ceilings, ours, norms, near, i)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32), st.sampled_from([0.5, 1, 3, 20]))
def test_bounds_are_their_formula(seed, level):
    rng = np.random.default_rng(seed)
    ours = rng.random((3 * WIDTH, 5), dtype=np.float32)
    norms = rng.random(len(ours), dtype=np.float32) * 2
    near = rng.random(len(ours), dtype=np.float32) * np.float32(level)

    def gains(totals, limits):
        p = np.minimum(totals, norms[:, None])
        s = np.minimum(p, limits)
        return s * (2 * p - s)

    peaks, tops = rng.random((2, 5), dtype=np.float32), rng.random(2, dtype=np.float32)
    beside = np.ascontiguousarray(ours.reshape(3, WIDTH, 5).swapaxes(1, 2))
    which = np.full(len(ours) + WIDTH, -1, np.int32)
    found = which[: run_hopeful(peaks, tops, beside, norms, near, which)]
    bounds = gains(ours @ peaks[1, :, None], tops[1])[:, 0]
    clear = abs(bounds - near) > 1e-5
    assert np.array_equal(found[clear[found]], np.flatnonzero((bounds >= near) & clear))

    shares = rng.random((2, 5, LANES), dtype=np.float32)
    ceilings = rng.random((2, LANES), dtype=np.float32)
    bounds = gains(ours @ shares[1], ceilings[1]).max(axis=1)
    for i in np.flatnonzero(abs(bounds - near) > 1e-5):
        assert run_promises(shares, ceilings, ours, norms, near, i) == (bounds[i] >= near[i])


def test_a_search_begins_where_most_is_promised():
    """A fault there would be seen in the search's time alone."""
    rng = np.random.default_rng(1)
    peaks, tops = rng.random((5, 30), dtype=np.float32), rng.random(30, dtype=np.float32) * 2
    shares = rng.random((7, 5), dtype=np.float32)
    rows = np.empty((3, 7), np.int64)
    most_likely(peaks, tops, shares, rows)
    p = shares @ peaks
    s = np.minimum(p, tops)
    promised = s * (2 * p - s)
    assert np.array_equal(rows.T, np.argsort(-promised, axis=1)[:, :3])


def test_leaving_out_doubles_changes_nothing(town, monkeypatch):
    heights = np.tile(town.heights[:16, :16], (2, 3))
    pavement = Pavement(*heights.shape, 4)
    blocks = pavement.blocks(heights)

    def found():
        return matching.best_matches(
            domain_pools(heights, 4, (2, 3)), blocks, pavement.corners, Coding(None)
        )

    one = found()
    monkeypatch.setattr(matching, "domain_blocks", lambda pool, doubles: domain_blocks(pool, True))
    two = found()
    for name in ("multiple", "y", "x", "iso", "sigma", "beta"):
        assert np.array_equal(getattr(one, name), getattr(two, name))


def test_flat_maps_have_no_tiles():
    pool = naive.domain_pool(np.full((16, 16), 7, np.float32), 4, 2)
    tiles = cut_tiles(domain_blocks(pool), 0.9)
    best = np.zeros(3, np.float32)
    ranges = RangeCodes.of(np.ones((3, 16), np.float32))
    assert [column.size for column in raise_best(tiles, ranges, best, best)] == 3 * [0]
    assert not best.any()
