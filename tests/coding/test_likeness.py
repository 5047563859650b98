"""Domain blocks that are one, norms of their parts, and their order."""

import naive
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evocity import isometries
from evocity.coding.matching._kernels import LANES, products
from evocity.coding.matching.candidates import RangeCodes, domain_blocks
from evocity.coding.matching.d4 import (
    d4_basis,
    d4_codes,
    d4_matrix,
    lowest,
    part_sizes,
    used_parts,
)
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.equivalence._kernels import kind_kernels, z_order
from evocity.coding.matching.tiles import cut_tiles


def codes_of(blocks):
    flat = blocks.reshape(len(blocks), -1).astype(float)
    centred = flat - flat.mean(axis=1, keepdims=True)
    return centred.astype(np.float32) @ d4_matrix(blocks.shape[-1]).T


@pytest.mark.parametrize("block", [2, 3, 8])
@pytest.mark.parametrize("count", [0, 1, 70])
def test_coordinates_are_products_of_matrices(block, count):
    blocks = np.random.default_rng(1).normal(size=(count, block, block)).astype(np.float32)
    exact = blocks.reshape(count, block**2).astype(float)
    truth = naive.products(exact, d4_matrix(block).astype(float).T)
    assert d4_codes(blocks.reshape(count, block**2)) == pytest.approx(truth, abs=1e-5)
    wide, out = np.ones((block**2, 2 * block)), np.empty((count, 2 * block))
    products(exact, wide, out)
    assert out == pytest.approx(naive.products(exact, wide), abs=1e-9)


@pytest.mark.parametrize("block", [2, 3, 4, 5, 8])
def test_part_norms_are_the_blocks_own_under_every_isometry(block):
    blocks = np.random.default_rng(block).random((6, block, block)).astype(np.float32)
    shares = RangeCodes.of(codes_of(blocks)).shares
    assert shares.shape == (6, len(used_parts(block)))
    energy = blocks.var(axis=(1, 2)) * block**2
    assert (shares**2).sum(axis=1) == pytest.approx(energy, rel=1e-4)
    for k in range(8):
        turned = isometries.apply(k, blocks)
        assert RangeCodes.of(codes_of(turned)).shares == pytest.approx(shares, abs=2e-3)


@pytest.mark.parametrize(
    ("block", "multiple"), [(2, 2), (3, 2), (4, 2), (4, 3), (5, 2), (8, 2), (16, 2), (17, 2)]
)
def test_tiles_hold_unit_blocks_as_the_naive_twin_has_them(town, block, multiple):
    heights = np.repeat(np.repeat(town.heights[:20, :19], 2, 0), 2, 1) + np.float32(4096)
    pools = list(domain_pools(heights, block, [multiple], memory=(1 << 10) * block**2))
    assert len(pools) > 1
    for part in pools:
        tiles = cut_tiles(domain_blocks(part, doubles=True), 1.0)
        codes = tiles.planes.swapaxes(1, 2).reshape(-1, block * block)
        norms, shares = tiles.ceilings.ravel(), tiles.shares.swapaxes(1, 2)
        shares = shares.reshape(len(codes), shares.shape[2])
        y, x = np.divmod(tiles.at, tiles.width)
        assert len(codes) == -(-y.size // LANES) * LANES
        for code, norm, top, left in zip(codes, norms, y, x, strict=False):
            domain = naive.shrunk(heights, int(top), int(left), multiple, multiple, block)
            truth = d4_matrix(block).astype(float) @ (domain - domain[0, 0]).ravel()
            assert code * norm == pytest.approx(truth, abs=1e-6 * np.abs(truth).max())
        energy = np.einsum("nk,nk->n", codes, codes, dtype=float)
        assert energy[: y.size] == pytest.approx(1, abs=1e-6 * max(1, block / 8))
        assert RangeCodes.of(codes).shares == pytest.approx(shares, abs=2e-3)
        assert tiles.tops == pytest.approx(tiles.ceilings.max(axis=1))
        assert tiles.peaks == pytest.approx(tiles.shares.max(axis=2))
        for left_over in (codes, norms, shares):
            assert not left_over[y.size :].any()
        # the same blocks, folded row by row
        assert np.array_equal(
            np.sort(tiles.at),
            np.flatnonzero(
                np.pad(
                    part.folded[1][:, : part.shape[1]] > 0,
                    ((part.top, 0), (0, tiles.width - part.shape[1])),
                )
            ),
        )
        assert norms[: y.size] == pytest.approx(part.folded[1][y - part.top, x], rel=1e-5)
        assert codes[: y.size] == pytest.approx(part.folded[0][y - part.top, :, x], abs=1e-5)


def test_of_domain_blocks_alike_the_first_is_kept(town):
    heights = np.tile(town.heights[:20, :20], (2, 2)) + np.float32(3)
    pool = naive.domain_pool(heights, 4, 2)
    seen, truth = set(), []
    for y, x in np.argwhere(pool.folded[1]):
        relief = naive.shrunk(heights, y, x, 2, 2, 4)
        relief = (relief - relief[0, 0] + 0.0).tobytes()
        if relief not in seen:
            seen.add(relief)
            truth.append((y, x))
    found = domain_blocks(pool)
    assert (np.diff(found.at) > 0).all()
    places = set(zip(*np.divmod(found.at, pool.shrunk.shape[1]), strict=True))
    assert places >= set(truth)
    assert len(places) < 1.1 * len(truth) < np.count_nonzero(pool.folded[1]) / 2


@pytest.mark.parametrize("count", [1, 3, 9])
def test_blocks_are_ordered_along_the_z_curve(count):
    rng = np.random.default_rng(count)
    values = rng.random((count, 4000)).astype(np.float32) * np.arange(1, count + 1)[:, None]
    values = values.astype(np.float32)
    most = values[np.argsort(-values.std(axis=1))][:5]
    seen = most[:, ::3]  # a thousand tell enough
    low, span = seen.min(axis=1, keepdims=True), np.ptp(seen, axis=1, keepdims=True)
    keys = np.zeros(4000, int)
    for bit in (4, 2, 1):
        for row in ((most - low) / span * 7.99).astype(int).clip(0, 7):
            keys = 2 * keys + (row & bit > 0)
    order = np.empty(4000, np.int64)
    z_order(values, order)
    assert np.array_equal(order, np.argsort(keys, kind="stable"))
    z_order(values[:, :0], order[:0])


@pytest.mark.parametrize("high", [0, 1000, 1 << 20])
def test_the_faintest_relief_counts_on_any_level(high):
    """A slope of 1/8 m, exact in float32 on every level: blocks are one, none is flat."""
    slope = np.arange(24, dtype=np.float32)[:, None] / 8 + np.zeros(20, np.float32)
    tiles = cut_tiles(domain_blocks(naive.domain_pool(slope + np.float32(high), 4, 2)), 1.0)
    assert tiles.at == [0]
    assert tiles.tops == pytest.approx(np.float32(4 * np.std([0, 1 / 4, 2 / 4, 3 / 4])))
    pool = naive.domain_pool(slope + np.float32(high), 4, 2)
    every = cut_tiles(domain_blocks(pool, doubles=True), 1.0)
    assert every.at.size == 17 * 13
    codes = every.planes.swapaxes(1, 2).reshape(-1, 16)[: 17 * 13]
    assert np.array_equal(codes, np.repeat(tiles.planes[0, :, :1].T, 17 * 13, axis=0))


@pytest.mark.parametrize("places", [2, 8, 1024])
@pytest.mark.parametrize("block", [2, 4])
def test_kinds_are_told_apart_whatever_their_keys(town, block, places):
    """Under weights of 1 and in little room, kinds have keys in common and forget each other."""
    heights = np.tile(town.heights[:16, :16], (2, 2))
    pool = naive.domain_pool(heights, block, 2)
    (rows, columns), width = pool.shape, pool.shrunk.shape[1]
    at, table = np.empty(rows * columns + 1, np.int64), np.zeros(places, np.int32)
    first_of_kinds, _ = kind_kernels(block)
    where = (pool.shrunk, 2, 0, rows, np.ones(block * block), pool.least)
    found = set(at[: first_of_kinds(*where, table, at)].tolist())
    kinds = {}
    for y, x in np.argwhere(pool.folded[1]):
        relief = naive.shrunk(heights, y, x, 2, 2, block)
        kinds.setdefault((relief - relief[0, 0] + 0.0).tobytes(), y * width + x)
    assert set(kinds.values()) <= found
    assert places < 1024 or len(found) < np.count_nonzero(pool.folded[1])


@pytest.mark.parametrize("flat", [0.5, 2.0, 6.0])
def test_domains_flatter_than_asked_are_in_no_tile(town, flat):
    pool = naive.domain_pool(town.heights + np.float32(100), 4, 2, flat)
    energy = {
        y * pool.shrunk.shape[1] + x: naive.shrunk(town.heights, y, x, 2, 2, 4).var() * 16
        for y, x in np.ndindex(pool.shape)
    }
    clear = {at for at, e in energy.items() if abs(e - pool.least) > 1e-5 * pool.least}
    truth = {at for at in clear if energy[at] > pool.least}
    assert 0 < len(truth) < len(clear)
    every = cut_tiles(domain_blocks(pool, doubles=True), 1.0)
    assert set(every.at.tolist()) & clear == truth
    assert (every.ceilings.ravel()[: every.at.size] > 0).all()
    assert set(cut_tiles(domain_blocks(pool), 1.0).at.tolist()) & clear <= truth


@pytest.mark.parametrize("block", [4, 8, 32])
def test_norms_of_parts_are_not_too_small(block):
    """Where next to nothing is left of a part across its lowest frequency, rounding decides."""
    y, x = np.mgrid[:88, :90]
    wave = 100 + np.cos(y / 30) + np.cos(x / 20 + y / 50)
    pool = naive.domain_pool(wave.astype(np.float32), block, 2)
    tiles = cut_tiles(domain_blocks(pool, doubles=True), 1.0)
    found = tiles.shares.swapaxes(1, 2).reshape(-1, tiles.shares.shape[1])[:: block**2 // 4]
    basis = d4_basis(block) - d4_basis(block).mean(axis=1, keepdims=True)
    top, left = np.divmod(tiles.at[:: block**2 // 4], tiles.width)
    for shares, row, column in zip(found, top, left, strict=False):
        domain = pool.shrunk[row:, column:][: 2 * block : 2, : 2 * block : 2].ravel()
        code = basis @ (domain - domain.mean())
        code /= np.linalg.norm(code)
        start, true = 0, []
        for part, size in enumerate(part_sizes(block)):
            inside = code[start:].reshape(2, size) if part == 4 else code[None, start:][:, :size]
            low = inside @ lowest(block)[start : start + size].astype(float)
            rest = inside - low[:, None] * lowest(block)[start : start + size]
            true += [(low**2).sum(), (rest**2).sum()]
            start += size
        true = np.sqrt(true)[list(used_parts(block))]
        assert (shares >= true - 3e-7 * max(1, block / 4)).all()


def test_relief_that_is_rounding_counts_as_flat():
    heights = np.tile(np.float32([1e4, 1.2345e-7, 3333.3]), (32, 11))
    pool = naive.domain_pool(heights, 4, 3)  # every mean of 3 × 3 px is that of the three
    assert np.ptp(pool.shrunk) > 0
    assert cut_tiles(domain_blocks(pool, doubles=True), 1.0).at.size == 0
    assert not pool.folded[1].any()


@given(st.integers(1, 40), st.integers(1, 6), st.sampled_from([0.3, 0.8, 1.0]))
def test_bands_of_a_pool_are_the_pool(rows, count, last):
    heights = np.random.default_rng(rows).random((rows + 7, 9)).astype(np.float32)
    pool = naive.domain_pool(heights, 4, 2)
    bands = pool.split(count, last)
    assert 1 <= len(bands) <= count
    assert bands[0].top == pool.top
    assert [band.top + band.rows for band in bands] == [b.top for b in bands[1:]] + [pool.rows]
    assert all(band.rows > 0 for band in bands)
    planes = np.concatenate([band.folded[0] for band in bands])
    assert np.array_equal(planes, pool.folded[0])
