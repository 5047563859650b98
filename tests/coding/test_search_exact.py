"""The search finds what trying everything finds, on awkward maps too."""

from dataclasses import fields

import naive
import numpy as np
import pytest
import skimage.data
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from evocity import isometries
from evocity.coding import best_correlations
from evocity.coding.matching import best_matches
from evocity.coding.matching._kernels import window_kernels
from evocity.coding.matching.candidates import Shapes
from evocity.coding.matching.d4 import d4_codes, d4_matrix
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.exact_scores._kernels import keep
from evocity.coding.matching.local_search import _windows
from evocity.coding.matching.matches import Search
from evocity.coding.parameters import Coding
from evocity.errors import MapError
from evocity.pavement import Pavement

SIDE = 16


def checkerboard(period):
    y, x = np.mgrid[:SIDE, :SIDE] // period
    return 10.0 * ((y + x) % 2)


def circles():
    y, x = np.mgrid[:SIDE, :SIDE] - 7.3
    return 10 + 10 * np.sin(np.hypot(y, x))


MAPS = {
    "checkerboard of period B": np.roll(checkerboard(4), (1, 2), axis=(0, 1)),
    "checkerboard of period 2": checkerboard(2),
    "circles": circles(),
    "millimetres": circles() * 1e-4,
    "ten kilometres": circles() * 1e3,
    "exact ties": np.tile(np.random.default_rng(3).integers(0, 3, (4, 4)) * 3.0, (4, 4)),
    "noise": np.random.default_rng(4).random((SIDE, SIDE)) * 30,
    "slight relief on a plateau": 300 + 0.02 * np.random.default_rng(5).random((SIDE, SIDE)),
    "camera": skimage.data.camera()[100 : 100 + 4 * SIDE : 4, 180 : 180 + 4 * SIDE : 4],
    "low relief beside a tower": 1e-3 * np.random.default_rng(6).integers(0, 9, (SIDE, SIDE))
    + np.pad(np.full((3, 3), 1e4), ((2, 11), (9, 4))),
    "relief on a high plateau": 4096 + np.random.default_rng(7).integers(0, 9, (SIDE, SIDE)) / 32,
    "one pixel": np.pad(np.full((1, 1), 9.0), ((6, 9), (9, 6))),
}


def compare_with_naive(heights, block, domains, reach, sigma_max):
    heights = np.asarray(heights, np.float32)
    highest = float(heights.max())
    sigma_max = float(np.float32(sigma_max))  # as the genome stores it
    pavement = Pavement(*heights.shape, block)
    blocks = pavement.blocks(heights)
    busy = np.flatnonzero(np.ptp(blocks.reshape(len(pavement), -1), axis=1) > 0)
    corners = tuple(corner[busy] for corner in pavement.corners)
    found = best_matches(
        domain_pools(heights, block, domains),
        blocks[busy],
        corners,
        Coding(reach, sigma_max=sigma_max),
    )
    for k, i in enumerate(busy):
        corner = (corners[0][k], corners[1][k])
        truth = naive.best_match(heights, block, corner, domains, reach, blocks[i], sigma_max)
        if truth is None:
            assert found.multiple[k] == 0 == found.sigma[k]
            assert found.beta[k] == pytest.approx(blocks[i].mean(dtype=float))
            continue
        gain, place, sigma, beta = truth
        assert (found.multiple[k], found.y[k], found.x[k], found.iso[k]) == place
        assert found.sigma[k] == pytest.approx(sigma, rel=1e-9)
        assert found.beta[k] == pytest.approx(beta, rel=1e-6, abs=1e-6 * highest)
        assert found.gain[k] == pytest.approx(gain, rel=1e-8)


@pytest.mark.parametrize("sigma_max", [0.9, np.inf])
@pytest.mark.parametrize("name", MAPS)
def test_same_optimum_as_exhaustive_search(name, sigma_max):
    compare_with_naive(MAPS[name], 4, (2,), None, sigma_max)


@pytest.mark.parametrize("reach", [0, 3, None])
def test_several_domain_sizes_and_reach(reach):
    compare_with_naive(MAPS["circles"], 4, (2, 3), reach, 0.9)


@pytest.mark.parametrize("block", [2, 3, 5, 8])
def test_any_block_size(block):
    side = {2: 12, 3: 15, 5: 20, 8: 24}[block]
    heights = np.random.default_rng(block).integers(0, 4, (side, side)) * 3.0
    compare_with_naive(heights, block, (2,), 4, 0.9)


@settings(max_examples=20, deadline=None)
@given(arrays(np.float32, (12, 12), elements=st.sampled_from([0, 0, 3, 3, 6, 7.5])))
def test_towns_of_few_heights(heights):
    compare_with_naive(heights, 4, (2,), None, 0.9)


def test_flat_maps_have_nothing_to_search(town):
    for level in (0, 12.5):
        found = uniformly(town.replace(np.full((16, 16), level)))
        assert found.uniform == len(found.genome) == 16
        assert found.genome.uniform.all()
        assert found.collage_rmse == 0


@pytest.mark.parametrize("reach", [6, None])
@pytest.mark.parametrize("name", ["camera", "checkerboard of period B", "exact ties"])
def test_the_order_of_range_blocks_does_not_change_their_matches(name, reach):
    heights = np.asarray(MAPS[name], np.float32)
    pavement = Pavement(*heights.shape, 4)
    blocks = pavement.blocks(heights)
    order = np.random.default_rng(1).permutation(len(blocks))
    coding = Coding(reach)
    plain = best_matches(domain_pools(heights, 4, (2,)), blocks, pavement.corners, coding)
    corners = tuple(corner[order] for corner in pavement.corners)
    mixed = best_matches(domain_pools(heights, 4, (2,)), blocks[order], corners, coding)
    for field in ("multiple", "y", "x", "iso", "sigma", "beta"):
        assert np.array_equal(getattr(mixed, field), getattr(plain, field)[order])


@pytest.mark.parametrize("reach", [4, None])
def test_the_level_of_a_map_does_not_change_its_matches(reach):
    relief = np.random.default_rng(8).integers(0, 64, (32, 32)).astype(np.float32) / 64
    pavement = Pavement(32, 32, 4)
    low, high = (
        best_matches(
            domain_pools(heights, 4, (2, 3)),
            pavement.blocks(heights),
            pavement.corners,
            Coding(reach, sigma_max=np.inf),
        )
        for heights in (relief, relief + np.float32(4096))
    )
    for field in ("multiple", "y", "x", "iso"):
        assert np.array_equal(getattr(low, field), getattr(high, field))


def test_range_blocks_whose_windows_are_empty_find_nothing(town):
    heights = np.zeros((64, 64), np.float32)
    heights[1, 61] = 9
    for options in ({"reach": 3}, {"reach": 24, "domains": (8,)}):
        genome = uniformly(town.replace(heights), **options).genome
        assert genome.uniform.all()


@pytest.mark.parametrize("block", [16, pytest.param(32, marks=pytest.mark.long)])
def test_large_blocks(block):
    rng = np.random.default_rng(block)
    side = 3 * block
    heights = rng.random((side, side)).cumsum(axis=0).cumsum(axis=1) / side
    compare_with_naive(heights, block, (2,), 6, 0.9)
    pavement = Pavement(side, side, block)
    blocks = pavement.blocks(heights.astype(np.float32))
    everywhere, windowed = (
        best_matches(
            domain_pools(heights.astype(np.float32), block, (2,)),
            blocks,
            pavement.corners,
            Coding(reach),
        )
        for reach in (None, side)
    )
    for field in ("multiple", "y", "x", "iso", "sigma", "beta"):
        assert np.array_equal(getattr(everywhere, field), getattr(windowed, field))


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_heights_that_are_no_numbers_are_refused(town, wrong):
    heights = town.heights.copy()
    heights[3, 5] = wrong
    with pytest.raises(MapError):
        uniformly(town.replace(heights))


def test_threads_and_chunks_do_not_change_the_genome(town, monkeypatch):
    one = uniformly(town, threads=1, reach=None).genome
    several = uniformly(town, threads=1, reach=None, domains=(2, 3)).genome
    for few in (0, 1 << 20):  # threads share the range blocks, or the domain blocks
        monkeypatch.setattr("evocity.coding.matching.FEW", few)
        assert uniformly(town, threads=3, reach=None).genome == one
        assert uniformly(town, threads=2, reach=None, domains=(2, 3)).genome == several
    monkeypatch.setattr("evocity.coding.matching.FEW", 0)
    monkeypatch.setattr("evocity.coding.matching.CHUNK", 7)
    assert uniformly(town, threads=2, reach=None).genome == one
    near = uniformly(town, threads=1, reach=9).genome
    assert uniformly(town, threads=3, reach=9).genome == near
    monkeypatch.setattr("evocity.coding.matching.chunk_size", lambda reach: 7)
    assert uniformly(town, threads=2, reach=9).genome == near


@pytest.mark.parametrize("block", [2, 3, 4, 5, 8])
def test_d4_coordinates_keep_inner_products(block):
    rng = np.random.default_rng(block)
    a, b = rng.random((2, block * block))
    matrix = d4_matrix(block).astype(float)
    ours = (matrix @ a) @ (matrix @ b)
    assert ours == pytest.approx((a - a.mean()) @ (b - b.mean()), rel=1e-5)


@pytest.mark.parametrize(("block", "multiple"), [(2, 2), (3, 2), (4, 2), (4, 3), (8, 2)])
def test_folded_domains_against_the_naive_twin(town, block, multiple):
    heights = town.heights[:40, :37]
    pool = naive.domain_pool(heights, block, multiple)
    rows, columns = pool.shape
    assert (rows, columns) == (41 - block * multiple, 38 - block * multiple)
    for y, x in np.ndindex(rows, columns):
        domain = naive.shrunk(heights, y, x, multiple, multiple, block)
        truth = d4_matrix(block).astype(float) @ domain.ravel()
        assert pool.folded[0][y, :, x] * pool.folded[1][y, x] == pytest.approx(truth, abs=1e-4)
    assert (pool.folded[0][:, :, columns:] == 0).all()
    assert (pool.folded[1][:, columns:] == 0).all()


def test_a_pools_norms_are_the_blocks_own(town):
    pool = naive.domain_pool(town.heights, 4, 2)
    rows, columns = pool.shape
    assert (rows, columns) == (57, 57)
    for y, x in [(0, 0), (10, 31), (56, 56)]:
        block = naive.shrunk(town.heights, y, x, 2, 2, 4)
        assert pool.folded[1][y, x] == pytest.approx(4 * block.std(), rel=1e-4, abs=1e-3)


@pytest.mark.parametrize("reach", [3, 12, None])
def test_correlations_against_the_naive_twin(other_town, reach):
    heights = other_town.heights[:24, :28]
    rho2, uniform = best_correlations(heights, reach=reach)
    true_rho2, true_uniform = naive.best_correlations(heights, reach=reach)
    assert np.array_equal(uniform, true_uniform)
    assert rho2 == pytest.approx(true_rho2, abs=1e-5)


@pytest.mark.parametrize("reach", [5, None])
def test_correlations_of_walls_against_the_naive_twin(reach):
    heights = np.zeros((28, 32), np.float32)
    heights[6:20, 10:] = 12.0  # long walls, whose continuation ends the search
    heights[9:14, 3:8] = 7.5
    rho2, uniform = best_correlations(heights, reach=reach)
    true_rho2, true_uniform = naive.best_correlations(heights, reach=reach)
    assert np.array_equal(uniform, true_uniform)
    assert rho2 == pytest.approx(true_rho2, abs=1e-5)
    assert (rho2 == 1).any()


def test_a_search_that_ends_early_has_found_enough(town):
    heights = town.heights[:48, :48]
    rho2, _ = best_correlations(heights)
    blocks = [
        heights[y : y + 4, x : x + 4].reshape(1, 16)
        for y in range(0, 48, 4)
        for x in range(0, 48, 4)
    ]
    codes = d4_codes(np.concatenate(blocks).astype(np.float32))
    (pool,) = domain_pools(heights, 4, (2,), 0.1, exact=False)
    corners = tuple(4 * np.indices((12, 12)).reshape(2, -1))
    window = _windows(pool.top, *pool.shape, corners, 12)
    *_, most_gains = window_kernels(4)
    best = np.zeros((2, len(codes)), np.float32)
    energy = np.einsum("nk,nk->n", codes, codes)
    for enough, gain in zip((energy, np.full_like(energy, np.inf)), best, strict=True):
        most_gains(*pool.folded, codes, window, np.float32(1e18), enough, gain)
    assert ((best[0] == best[1]) | ((best[0] >= energy) & (best[1] >= best[0]))).all()
    busy = rho2 > 0
    assert np.array_equal(np.clip(best[1][busy] / energy[busy], 0, 1), rho2[busy])


def test_blocks_of_one_shape_are_grouped():
    rng = np.random.default_rng(8)
    shapes = rng.integers(0, 3, (5, 4, 4)) * 3.3
    images = [
        sign * isometries.apply(int(rng.integers(8)), shape) + level
        for shape in shapes
        for sign, level in ((1, 0), (1, 3), (-1, 12))
    ]
    found = Shapes.of_blocks(np.array(images))
    of = found.of
    assert np.array_equal(of[found.first], np.arange(len(found.first)))
    for image, shape, iso, sign in zip(
        images, found.pixels[of], found.iso, found.sign, strict=True
    ):
        made = sign * isometries.apply(int(iso), shape.reshape(4, 4))
        assert np.ptp(image - made) < 1e-12
    truth = np.arange(len(images)) // 3
    for i, j in np.ndindex(len(of), len(of)):
        if of[i] == of[j]:  # rounding may keep equal shapes apart, but never joins others
            assert truth[i] == truth[j]
    whole = Shapes.of_blocks(np.round(np.array(images) / 3.3).astype(int))
    assert len(whole.pixels) == len(np.unique(whole.of)) == 5
    mixed = rng.permutation(len(images))
    again = Shapes.of_blocks(np.round(np.array(images)[mixed] / 3.3).astype(int))
    assert np.array_equal(again.pixels[again.of], whole.pixels[whole.of][mixed])


@pytest.mark.parametrize("memory", [1, 30_000, 1 << 30])
def test_bands_of_domains_do_not_change_the_matches(town, memory):
    heights, pavement = town.heights, Pavement(*town.shape, 4)
    blocks = pavement.blocks(heights)
    found = [
        best_matches(
            domain_pools(heights, 4, (2, 3), memory=size),
            blocks,
            pavement.corners,
            Coding(reach),
        )
        for reach in (10, None)
        for size in (memory, 1 << 40)
    ]
    for banded, whole in (found[:2], found[2:]):
        for name in ("multiple", "y", "x", "iso", "sigma", "beta", "gain"):
            assert np.array_equal(getattr(banded, name), getattr(whole, name))


@pytest.mark.long  # a size of its own is compiled
def test_large_blocks_are_summed_in_runs(town):
    """Above B = 16 the sums are loops of the compiled code, not written out."""
    heights = np.tile(town.heights, (2, 2))[:50, :46]
    blocks = np.stack([heights[y : y + 18, x : x + 18] for y, x in ((5, 3), (9, 7), (20, 12))])
    corners = np.array([5, 9, 20]), np.array([3, 7, 12])
    for reach in (None, 12):
        pools = domain_pools(heights, 18, (2,))
        found = best_matches(pools, blocks, corners, Coding(reach))
        for i, block in enumerate(blocks):
            window = reach if reach is None else (corners[0][i], corners[1][i], reach)
            place, gain = best_of_all(heights, block, window)
            assert (found.y[i], found.x[i], found.iso[i]) == place
            assert found.gain[i] == pytest.approx(gain, rel=1e-9)


def best_of_all(heights, block, window):
    """(y, x, iso) of the best domain block of twice the side, and what it explains."""
    best, where = 0.0, None
    side = 2 * len(block)
    for y in range(heights.shape[0] - side + 1):
        for x in range(heights.shape[1] - side + 1):
            if window and max(abs(y - window[0]), abs(x - window[1])) > window[2]:
                continue
            domain = naive.shrunk(heights, y, x, 2, 2, len(block))
            for iso, (gain, _) in enumerate(naive.gains(block, domain, 0.9)):
                if gain > best * (1 + 1e-9):
                    best, where = gain, (y, x, iso)
    return where, best


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32), st.integers(1, 60), st.sampled_from([1e-12, 1e-10, 1e-8]))
def test_the_first_of_many_near_ties_is_kept(seed, count, step):
    rng = np.random.default_rng(seed)
    gains = 1 + rng.integers(0, 12, count) * step
    slack = 1e-9
    truth = np.flatnonzero(gains >= gains.max() - slack)[0]
    rising = 1 + np.arange(count) * slack / 80  # more than there is room for
    for values, first in ((gains, truth), (rising, 0)):
        records, places, used = np.zeros(16), np.zeros(16, np.int64), 0
        for place in rng.permutation(count):
            used = keep(values[place], place, slack, records, places, used)
        near = records[:used] >= records[:used].max() - slack
        assert places[:used][near].min() == first


@given(st.integers(0, 10**6), st.sampled_from([None, 0, 6]), st.sampled_from([2, 4]))
@settings(max_examples=25, deadline=None)
def test_one_pool_is_concluded_as_several_are(seed, reach, side):
    rng = np.random.default_rng(seed)
    heights = rng.choice([0.0, 3.0, 6.5, 9.0], (24, 32)).astype(np.float32)
    heights[:8] = 4.0
    pavement, compared = Pavement(24, 32, side), []

    def conclude_twice(search, blocks, shapes):
        compared.append(
            (search._matches_in_one_pool(blocks, shapes), search._matches(blocks, shapes))
        )
        return compared[-1][0]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Search, "matches", conclude_twice)
        blocks = pavement.blocks(heights)
        best_matches(domain_pools(heights, side, (2,)), blocks, pavement.corners, Coding(reach))
    ((fast, slow),) = compared
    for field in fields(fast):
        one, other = (np.asarray(getattr(matches, field.name)) for matches in (fast, slow))
        assert (one.dtype, one.tobytes()) == (other.dtype, other.tobytes()), field.name
