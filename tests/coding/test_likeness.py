"""Domain blocks that are one, norms of their parts, and their order."""

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evocity import isometries
from evocity.coding.search.domains import d4_matrix, domain_pool, domain_pools
from evocity.coding.search.likeness import range_shares, unit_blocks, used_parts, z_order


def codes_of(blocks):
    flat = blocks.reshape(len(blocks), -1).astype(float)
    centred = flat - flat.mean(axis=1, keepdims=True)
    return centred.astype(np.float32) @ d4_matrix(blocks.shape[-1]).T


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


@pytest.mark.parametrize(("block", "multiple"), [(2, 2), (3, 2), (4, 2), (4, 3), (5, 2), (8, 2)])
def test_unit_blocks_against_the_naive_twin(town, block, multiple):
    heights = np.repeat(np.repeat(town.heights[:20, :19], 2, 0), 2, 1) + np.float32(4096)
    pools = list(domain_pools(heights, block, [multiple], memory=(1 << 12) * block**2))
    assert len(pools) > 1
    for part in pools:
        found = unit_blocks(part, doubles=True)
        for code, norm, y, x in zip(found.codes, found.norms, found.y, found.x, strict=True):
            domain = naive.shrunk(heights, int(y), int(x), multiple, multiple, block)
            truth = d4_matrix(block).astype(float) @ (domain - domain[0, 0]).ravel()
            assert code * norm == pytest.approx(truth, abs=1e-6 * np.abs(truth).max())
        assert np.einsum("nk,nk->n", found.codes, found.codes) == pytest.approx(1, abs=1e-6)
        assert range_shares(found.codes) == pytest.approx(found.shares.T, abs=2e-3)
        y, x = np.nonzero(part.norms)  # the same blocks, folded row by row
        assert np.array_equal(found.y, y + part.top)
        assert np.array_equal(found.x, x)
        assert found.norms == pytest.approx(part.norms[y, x], rel=1e-5)
        assert found.codes == pytest.approx(part.planes[y, :, x], abs=1e-5)


def test_of_domain_blocks_alike_the_first_is_kept(town):
    heights = np.tile(town.heights[:20, :20], (2, 2)) + np.float32(3)
    pool = domain_pool(heights, 4, 2)
    seen, truth = set(), []
    for y, x in np.argwhere(pool.norms):
        relief = naive.shrunk(heights, y, x, 2, 2, 4)
        relief = (relief - relief[0, 0] + 0.0).tobytes()
        if relief not in seen:
            seen.add(relief)
            truth.append((y, x))
    found = unit_blocks(pool)
    assert np.array_equal(np.stack([found.y, found.x], axis=1), truth)
    assert len(truth) < np.count_nonzero(pool.norms) / 2


@pytest.mark.parametrize("count", [1, 3, 9])
def test_blocks_are_ordered_along_the_z_curve(count):
    rng = np.random.default_rng(count)
    values = rng.random((count, 4000)).astype(np.float32) * np.arange(1, count + 1)[:, None]
    values = values.astype(np.float32)
    most = values[np.argsort(-values.std(axis=1))][:5]
    low, span = most.min(axis=1, keepdims=True), np.ptp(most, axis=1, keepdims=True)
    keys = np.zeros(4000, int)
    for bit in (4, 2, 1):
        for row in ((most - low) / span * 7.99).astype(int):
            keys = 2 * keys + (row & bit > 0)
    assert np.array_equal(z_order(values), np.argsort(keys, kind="stable"))
    assert z_order(values[:, :0]).size == 0


@pytest.mark.parametrize("high", [0, 1000, 1 << 20])
def test_the_faintest_relief_counts_on_any_level(high):
    """A slope of 1/8 m, exact in float32 on every level: blocks are one, none is flat."""
    slope = np.arange(24, dtype=np.float32)[:, None] / 8 + np.zeros(20, np.float32)
    blocks = unit_blocks(domain_pool(slope + np.float32(high), 4, 2))
    assert (blocks.y, blocks.x) == (0, 0)
    assert blocks.norms == pytest.approx(np.float32(4 * np.std([0, 1 / 4, 2 / 4, 3 / 4])))
    every = unit_blocks(domain_pool(slope + np.float32(high), 4, 2), doubles=True)
    assert len(every.codes) == 17 * 13
    assert np.array_equal(every.codes, np.repeat(blocks.codes, 17 * 13, axis=0))


def test_relief_that_is_rounding_counts_as_flat():
    heights = np.tile(np.float32([1e4, 1.2345e-7, 3333.3]), (32, 11))
    pool = domain_pool(heights, 4, 3)  # every mean of 3 × 3 px is that of the three
    assert np.ptp(pool.shrunk) > 0
    assert unit_blocks(pool, doubles=True).norms.size == 0
    assert not pool.norms.any()


@given(st.integers(1, 40), st.integers(1, 6), st.sampled_from([0.3, 0.8, 1.0]))
def test_bands_of_a_pool_are_the_pool(rows, count, last):
    heights = np.random.default_rng(rows).random((rows + 7, 9)).astype(np.float32)
    pool = domain_pool(heights, 4, 2)
    bands = pool.split(count, last)
    assert 1 <= len(bands) <= count
    assert bands[0].top == pool.top
    assert [band.top + band.rows for band in bands] == [b.top for b in bands[1:]] + [pool.rows]
    assert all(band.rows > 0 for band in bands)
    planes = np.concatenate([band.planes for band in bands])
    assert np.array_equal(planes, pool.planes)
