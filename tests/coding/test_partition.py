"""Leaves that follow the city: which are chosen, and what codes on them keep."""

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.coding import CollageMap, ancestry, decode, encode, psnr, usage
from evocity.coding.partition import chosen_leaves, coarsest_leaves, leaves_within
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.genome import split, unpacked

RAW = {"fit": False, "settle": False}
seeds = st.integers(0, 2**32)


def draw_errors(seed, rows=3, columns=4, levels=4):
    """Collage errors of all blocks, the finest side first, as a search finds them: more or less."""
    rng = np.random.default_rng(seed)
    return [
        rng.exponential(3.0, (rows << k, columns << k)) * 4.0 ** (levels - k)
        for k in range(levels)[::-1]
    ]


def price_of(errors, leaves, price):
    return sum(
        error[leaf].sum() + price * leaf.sum() for error, leaf in zip(errors, leaves, strict=True)
    )


def tiles(leaves):
    """How often each block of the finest side is covered."""
    covered = np.zeros(leaves[0].shape, int)
    for k, one in enumerate(leaves):
        covered += one.repeat(1 << k, 0).repeat(1 << k, 1)
    return covered


def cheapest(errors, price, level, i, j):
    """The least price of a block, by trying whether to split it."""
    own = errors[level][i, j] + price
    if level == 0:
        return own
    parts = sum(
        cheapest(errors, price, level - 1, 2 * i + a, 2 * j + b) for a in (0, 1) for b in (0, 1)
    )
    return min(own, parts)


@given(seeds, st.floats(0, 200))
@settings(max_examples=60, deadline=None)
def test_the_leaves_chosen_are_the_cheapest(seed, price):
    errors = draw_errors(seed)
    leaves = chosen_leaves(errors, price)
    assert (tiles(leaves) == 1).all()
    least = sum(cheapest(errors, price, 3, i, j) for i, j in np.ndindex(errors[-1].shape))
    assert price_of(errors, leaves, price) == pytest.approx(least)


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_the_number_of_leaves_falls_with_their_price(seed):
    errors = draw_errors(seed)
    counts = [
        sum(one.sum() for one in chosen_leaves(errors, price))
        for price in (0, 0.1, 1, 3, 10, 30, 100, 1e9)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] == errors[-1].size
    free = chosen_leaves(errors, 0)
    assert price_of(errors, free, 0) <= errors[0].sum() * (1 + 1e-12)


@given(seeds, st.integers(12, 800))
@settings(max_examples=40, deadline=None)
def test_a_budget_is_kept_and_used(seed, budget):
    errors = draw_errors(seed)
    leaves = leaves_within(errors, budget, 1e-9)
    count = sum(one.sum() for one in leaves)
    assert count <= budget
    assert (tiles(leaves) == 1).all()
    finer = leaves_within(errors, budget + 60, 1e-9)
    assert price_of(errors, finer, 0) <= price_of(errors, leaves, 0) * (1 + 1e-12)


@given(seeds, st.floats(0, 20))
@settings(max_examples=40, deadline=None)
def test_no_leaf_errs_more_than_allowed_but_the_finest(seed, most):
    errors, sides = draw_errors(seed), (2, 4, 8, 16)
    leaves = coarsest_leaves(errors, sides, most)
    assert (tiles(leaves) == 1).all()
    for error, leaf, side in zip(errors[1:], leaves[1:], sides[1:], strict=True):
        assert (np.sqrt(error[leaf]) / side <= most * (1 + 1e-12)).all()
    for k, leaf in enumerate(leaves[:-1]):  # no four of them could be one
        parent = errors[k + 1]
        rows, columns = parent.shape
        split_here = leaf.reshape(rows, 2, columns, 2).any(axis=(1, 3))
        assert (np.sqrt(parent[split_here]) / sides[k + 1] > most).all()


@pytest.fixture(scope="module")
def coded(town):
    return encode(town, **RAW)


def test_leaves_follow_the_city(town, coded):
    genome = coded.genome
    assert genome.pavement.finest == 2
    assert genome.pavement.coarsest >= 8
    assert len(genome) <= town.heights.size // 8
    assert coded.psnr > uniformly(town).psnr
    collage = CollageMap(genome)(town.heights)
    rms = np.sqrt(np.mean((collage - town.heights) ** 2, dtype=np.float64))
    assert coded.collage_rmse == pytest.approx(rms, rel=1e-4)
    assert np.array_equal(unpacked(genome.source), genome.pavement.corners)
    assert genome.made["sides"] == [2, 4, 8, 16]
    assert encode(town, **RAW, threads=1).genome == genome


def test_more_lifs_err_less_and_enough_are_as_good_as_the_finest(town):
    errors = [encode(town, block=(2, 16), lifs=lifs, **RAW) for lifs in (64, 128, 256, 1024)]
    assert [len(one.genome) <= lifs for one, lifs in zip(errors, (64, 128, 256, 1024), strict=True)]
    rms = [one.collage_rmse for one in errors]
    assert rms == sorted(rms, reverse=True)
    finest = uniformly(town, block=2)
    assert errors[-1].collage_rmse <= finest.collage_rmse + 0.01
    assert len(errors[-1].genome) < len(finest.genome) / 2
    coarsest = encode(town, block=(2, 16), lifs=16, **RAW).genome
    assert coarsest.pavement.block == 16
    assert coarsest == uniformly(town, block=16).genome


@pytest.mark.parametrize("most", [0.2, 1.0, 4.0])
def test_no_leaf_is_above_the_largest_error(town, most):
    coded = encode(town, block=(2, 16), max_error=most, **RAW)
    p = coded.genome.pavement
    collage = CollageMap(coded.genome)(town.heights)
    rms = np.sqrt(p.sums((collage - town.heights).astype(float) ** 2) / p.area)
    assert (rms[p.side > 2] <= most + 1e-3).all()
    assert coded.above == pytest.approx(np.count_nonzero(rms[p.side == 2] > most), abs=2)


def test_a_range_of_one_side_is_that_side(town):
    assert encode(town, block=(4, 4), **RAW).genome == uniformly(town).genome


def test_scale_and_pixel_size_change_no_leaf(town):
    one = encode(town, **RAW).genome.pavement
    assert encode(CityMap(town.heights, 7.0), **RAW).genome.pavement == one
    assert encode(CityMap(town.heights * 4, 2.0), **RAW).genome.pavement == one


def test_codes_on_leaves_zoom_fit_and_tell_their_usage_and_ancestry(town, coded):
    genome = coded.genome
    doubled = decode(genome, zoom=2, tolerance=1e-4).attractor
    means = doubled.reshape(64, 2, 64, 2).mean(axis=(1, 3))
    assert np.abs(means - decode(genome, tolerance=1e-4).attractor).max() < 0.01
    assert encode(town, settle=False).psnr > coded.psnr + 0.5
    parts = split(genome, 2)
    assert np.abs(ancestry(parts) - ancestry(genome)).max() < 1e-5
    found = usage(genome)
    assert found.pixels.sum() == (genome.dy.astype(int) * genome.dx).sum()
    assert np.array_equal(found.ranges, genome.pavement.raster(found.calls))


@pytest.mark.parametrize("settle", [False, True])
def test_what_is_locked_stays_bit_for_bit(town, settle, tmp_path):
    mask = np.zeros(town.shape, bool)
    mask[10:31, 17:40] = True
    heights = town.heights + np.random.default_rng(0).random(town.shape, np.float32)
    layer = Condensation(heights, mask)
    genome = encode(town, condensation=layer, settle=settle).genome
    assert np.array_equal(decode(genome).city.heights[mask], heights[mask])
    covered = genome.pavement.maxima(~mask) == 0
    assert genome.uniform[covered].all()
    genome.write(tmp_path / "locked.parquet")
    again = evocity.read_genome(tmp_path / "locked.parquet")
    assert again == genome
    assert again.condensation == layer
    assert again.settle is settle


def test_topological_collage_costs_no_more_than_its_tolerance(town, coded):
    chosen = encode(town, topological=0, **RAW)
    assert chosen.genome.pavement == coded.genome.pavement
    assert chosen.collage_rmse == pytest.approx(coded.collage_rmse, rel=1e-4)
    loose = encode(town, topological=0.05, **RAW)
    assert loose.genome != coded.genome
    assert loose.collage_rmse >= coded.collage_rmse


def test_settled_roofs_are_flat_and_raw_ones_the_papers(town):
    coded = encode(town)
    settled, raw = decode(coded.genome).city, decode(coded.genome, settle=False)
    assert np.array_equal(raw.city.heights, np.maximum(raw.attractor, 0))
    labels = settled.buildings.labels
    for building in range(1, labels.max() + 1):
        assert np.ptp(settled.heights[labels == building]) <= 1.5  # crumbs may lean on it
    assert coded.genome.settle
    assert not uniformly(town).genome.settle
    assert np.array_equal(decode(coded.genome, settle=True).city.heights, settled.heights)
    assert psnr(town, settled) == coded.psnr


@pytest.mark.parametrize(
    ("how", "word"),
    [
        ({"lifs": 100, "max_error": 1.0}, "not both"),
        ({"lifs": 3}, r"16 or more"),
        ({"lifs": 0}, "whole number of lifs"),
        ({"lifs": 2.5}, "whole number of lifs"),
        ({"max_error": -1}, "0 or more"),
        ({"max_error": np.nan}, "0 or more"),
        ({"block": 4, "lifs": 100}, "one side"),
        ({"block": 4, "max_error": 1}, "one side"),
        ({"block": (3, 16)}, "times the finest side"),
        ({"block": (16, 2)}, "times the finest side"),
        ({"block": (2, 128)}, "multiples of 128"),
        ({"block": (2, 4, 8)}, "two numbers, the smallest"),
        ({"block": "2-16"}, "two numbers, the smallest"),
    ],
)
def test_choices_at_fault_are_told(town, how, word):
    with pytest.raises(GenomeError, match=word):
        encode(town, **how)


def test_maps_that_16_does_not_divide_take_smaller_roots():
    city = draw_town(3, side=72)
    assert encode(city, **RAW).genome.pavement.coarsest == 8
    assert uniformly(draw_town(3, side=40), block=5).genome.pavement.block == 5
    with pytest.raises(GenomeError, match="an even height"):
        encode(CityMap(np.ones((33, 32)), 2.0))
