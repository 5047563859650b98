"""How W is laid, on range blocks of any sides, against the slow twin; and where iteration ends."""

import copy

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_leaves, draw_pavement
from towns import draw_town

from evocity.coding import CollageMap, decode
from evocity.coding._kernels import shared_extents
from evocity.coding.fixed_point import fixed_point
from evocity.coding.matching import best_correlations, best_matches
from evocity.coding.matching.domains import domain_pools
from evocity.coding.matching.local_search import chunk_size
from evocity.coding.parameters import Coding
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.operators import collage_repair
from evocity.pavement import Pavement

#: Uniform sides of every kind the kernel tells apart, and leaves.
PAVEMENTS = {
    **{f"B = {side}": Pavement(2 * side, 4 * side, side) for side in (2, 3, 4, 5, 6, 8, 12, 16)},
    "leaves 2-16": draw_pavement(3),
    "leaves 4-16": draw_pavement(4, finest=4),
    "leaves 3-12": draw_pavement(5, 24, 36, finest=3, root=12),
}


@pytest.mark.parametrize("name", PAVEMENTS)
@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_laying_and_its_adjoint_against_their_naive_twins(name, kind):
    pavement = PAVEMENTS[name]
    genome = draw_leaves(7, pavement)
    rng = np.random.default_rng(1)
    heights, values = rng.uniform(0, 30, (2, pavement.height, pavement.width)).astype(kind)
    collage = CollageMap(genome, dtype=kind)
    expected = naive.collage(genome, heights)
    assert collage(heights) == pytest.approx(expected, abs=1e-4)
    target = collage.flat_start
    collage.lay_again(heights, target)  # what is uniform stands there already
    assert np.array_equal(target, collage(heights))
    transposed = naive.collage_transposed(genome, values)
    assert collage.transposed(values) == pytest.approx(transposed, abs=1e-3)
    other = collage.recoded(genome.sigma / 2, genome.beta)
    assert other.transposed(values) == pytest.approx(transposed / 2, abs=1e-3)


@pytest.mark.parametrize("name", PAVEMENTS)
@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("most", [1, 2, 3, 500])
def test_the_compiled_iteration_is_that_of_single_steps(name, kind, most):
    genome = draw_leaves(7, PAVEMENTS[name])
    collage = CollageMap(genome, dtype=kind)
    start = np.random.default_rng(2).uniform(0, 30, collage.shape).astype(kind)
    steps = {"tolerance": 0.01, "most": most}
    slow = fixed_point(collage.lay, start, **steps, repeat=collage.lay_again)
    fast = collage.fixed_point(start, **steps)
    for one, other in ((slow.values, fast.values), (slow.before, fast.before)):
        assert one.tobytes() == other.tobytes()
    ends = [(end.steps, end.converged, end.diverged) for end in (slow, fast)]
    assert ends[0] == ends[1]


def test_the_compiled_iteration_keeps_a_condensation():
    genome = draw_leaves(3, PAVEMENTS["leaves 2-16"])
    p = genome.pavement
    mask = np.zeros((p.height, p.width), bool)
    mask[3:9, 2:20] = True
    genome = genome.replace(condensation=Condensation(np.where(mask, 7.5, 0), mask))
    collage = CollageMap(genome)
    start = np.zeros(collage.shape, np.float32)
    slow = fixed_point(collage.lay, start, tolerance=0.01, repeat=collage.lay_again)
    assert slow.values.tobytes() == collage.fixed_point(start, tolerance=0.01).values.tobytes()


def test_without_domain_blocks_there_is_nothing_to_lay():
    genome = draw_leaves(1)
    nothing = np.zeros(len(genome))
    names = ("sigma", "x", "y", "dx", "dy", "iso")
    kinds = {name: nothing.astype(getattr(genome, name).dtype) for name in names}
    flat = genome.replace(**kinds)
    assert np.array_equal(decode(flat).attractor, flat.pavement.raster(flat.beta))


@given(st.integers(0, 10**6), st.floats(1, 9))
@settings(max_examples=40, deadline=None)
def test_shared_extents_against_their_naive_twin(seed, least):
    rng = np.random.default_rng(seed)
    side = rng.choice([2, 4, 8], 20).astype(np.int32)
    dy, dx = (side * rng.integers(0, 4, (2, 20))).astype(np.int16)
    dy, dx = np.where(dx > 0, dy, 0).astype("i2"), np.where(dy > 0, dx, 0).astype("i2")
    tall, wide, layer = np.empty((3, 20), np.int64)
    kinds = shared_extents(dy, dx, side, least, tall, wide, layer)
    expected = naive.shared_extents(dy, dx, side, least)
    assert (tuple(tall), tuple(wide), list(layer)) == expected[:3]
    assert [tuple(one) for one in kinds.tolist()] == expected[3]


def test_a_leap_to_the_sky_is_no_convergence():
    genome = uniformly(draw_town(1, side=128)).genome
    busy = int(np.flatnonzero(~genome.uniform)[-1])  # far from where the first pixels are
    sigma, beta = genome.sigma.copy(), genome.beta.copy()
    sigma[busy], beta[genome.uniform] = 10, 5e6
    steep = genome.replace(sigma=sigma, beta=beta, sigma_max=np.inf)
    with pytest.raises(GenomeError, match="diverges"):
        decode(steep)


def test_repair_takes_what_is_meant_in_any_layout():
    genome = uniformly(draw_town(2), fit=True).genome
    meant = np.maximum(decode(genome).attractor, 0)
    for layout in (np.ascontiguousarray, np.asfortranarray, np.float64):
        assert collage_repair(genome, layout(meant), threshold=0.5)[1] == 0


def test_a_decoding_makes_its_city_once_and_cannot_be_changed_before():
    decoding = decode(uniformly(draw_town(3)).genome)
    with pytest.raises(ValueError, match="read-only"):
        decoding.attractor[0, 0] = 9
    assert decoding.city is decoding.city
    again = copy.copy(decoding)
    assert np.array_equal(again.city.heights, decoding.city.heights)


@pytest.mark.slow_cases("20-17", "40-51")
@pytest.mark.parametrize(("reach", "every"), [(16, 51), (20, 17), (40, 51)])
def test_the_best_within_reach_is_found_in_any_band_of_rows(reach, every):
    heights = draw_town(6, side=64).heights
    pavement = Pavement(64, 64, 4)
    blocks = pavement.blocks(heights)
    uneven = np.flatnonzero(np.ptp(blocks, axis=(1, 2)) > 0)[::every]
    corners = tuple(corner[uneven] for corner in pavement.corners)
    pools = domain_pools(heights, 4, (2,))
    found = best_matches(pools, blocks[uneven], corners, Coding(reach))
    for k, (y, x) in enumerate(zip(*corners, strict=True)):
        block = blocks[uneven[k]]
        best = naive.best_match(heights, 4, (int(y), int(x)), (2,), reach, block, 0.9)
        assert found.gain[k] == pytest.approx(best[0], rel=1e-6)


def test_so_many_range_blocks_are_searched_together_that_room_stays_small():
    for reach in (3, 24, 400, 4000):
        side = 2 * reach + 1
        assert chunk_size(reach) * side * min(-(-side // 16), 32) <= max(1 << 19, 64 * 32 * side)


def test_correlations_do_not_depend_on_how_many_are_searched_together(monkeypatch):
    heights = draw_town(8, side=48).heights
    whole = best_correlations(heights, reach=20)
    monkeypatch.setattr("evocity.coding.matching.local_search.chunk_size", lambda reach: 5)
    for one, other in zip(whole, best_correlations(heights, reach=20), strict=True):
        assert np.array_equal(one, other)
