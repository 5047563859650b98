"""Laws of condensation: what it covers stands in every iteration, and nothing answers there."""

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from test_fit import draw_genome, draw_map
from towns import draw_town

from evocity.citymap import CityMap
from evocity.coding import CollageMap, decode, fit_attractor, psnr
from evocity.coding.fit import AttractorError
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.operators import collage_repair


def locked(genome, seed: int, share: float = 0.3):
    """``genome`` with random pixels kept, and a whole range block with them."""
    rng = np.random.default_rng(seed)
    p = genome.pavement
    mask = rng.random((p.height, p.width)) < share
    mask[: p.block, : p.block] = True
    return genome.replace(condensation=Condensation(rng.uniform(0, 30, mask.shape), mask))


def quarter(city: CityMap, rows=slice(9, 39), columns=slice(20, 53)) -> Condensation:
    """A quarter that does not lie on the range blocks' grid."""
    mask = np.zeros(city.shape, bool)
    mask[rows, columns] = True
    return Condensation.cut(city, mask)


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3, 4]))
def test_collage_map_against_the_naive_twin(seed, block):
    genome = locked(draw_genome(seed, block), seed)
    heights = draw_map(genome, seed).heights
    expected = genome.condensation.laid(naive.collage(genome, heights))
    laid = CollageMap(genome)(heights)
    assert laid == pytest.approx(expected, abs=1e-4)
    mask = genome.condensation.mask
    assert np.array_equal(laid[mask], genome.condensation.heights[mask])


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3, 4]))
def test_adjoint_law(seed, block):
    """⟨W(a) − W(0), b⟩ = ⟨a, Wᵀ(b)⟩."""
    genome = locked(draw_genome(seed, block), seed)
    collage = CollageMap(genome, dtype=np.float64)
    a, b = np.random.default_rng(seed).normal(size=(2, *collage.shape))
    pushed = collage(a) - collage(np.zeros(collage.shape))
    assert np.vdot(pushed, b) == pytest.approx(np.vdot(a, collage.transposed(b)), abs=1e-9)
    free = np.where(genome.condensation.mask, 0, b)
    assert collage.transposed(b) == pytest.approx(naive.collage_transposed(genome, free))


@pytest.mark.parametrize("start", [None, 0.0, 500.0])
@pytest.mark.parametrize("zoom", [0.5, 1, 2, 1.5])
def test_decoding_keeps_it_pixel_for_pixel(town, zoom, start):
    genome = uniformly(town, condensation=quarter(town)).genome
    side = int(64 * zoom)
    begun = None if start is None else np.full((side, side), start)
    found = decode(genome, zoom=zoom, start=begun)
    kept = genome.condensation.resampled(side, side)
    assert found.converged
    for heights in (found.city.heights, found.attractor):
        assert np.array_equal(heights[kept.mask], kept.heights[kept.mask])
    hasty = decode(genome, zoom=zoom, start=begun, max_iterations=1).city.heights
    assert np.array_equal(hasty[kept.mask], kept.heights[kept.mask])


def test_a_layer_too_fine_for_a_zoom_is_lost_without_harm(town):
    mask = np.zeros(town.shape, bool)
    mask[0, 0] = True
    genome = uniformly(town, condensation=Condensation.cut(town, mask)).genome
    assert decode(genome, zoom=0.5).converged


def test_a_code_without_a_layer_is_the_code_it_was(town):
    layer = quarter(town)
    plain, kept = uniformly(town).genome, uniformly(town, condensation=layer).genome
    free = ~kept.pavement.blocks(layer.mask).all(axis=(1, 2))
    for name in ("sigma", "beta", "x", "y", "dx", "dy", "iso"):
        assert np.array_equal(getattr(plain, name)[free], getattr(kept, name)[free])


def test_blocks_wholly_covered_are_not_searched(town):
    layer = quarter(town)
    coded = uniformly(town, condensation=layer)
    whole = coded.genome.pavement.blocks(layer.mask).all(axis=(1, 2))
    assert 0 < whole.sum() < len(whole)
    assert coded.genome.uniform[whole].all()
    means = coded.genome.pavement.blocks(town.heights)[whole].mean(axis=(1, 2))
    assert coded.genome.beta[whole] == pytest.approx(means)
    plain = uniformly(town)
    assert coded.pairs < plain.pairs
    assert coded.uniform > plain.uniform
    assert coded.psnr > plain.psnr


@pytest.mark.parametrize("options", [{}, {"topological": 0.01}, {"fit": True}])
def test_what_is_imported_is_coded_in_its_place(town, options):
    mask = quarter(town).mask
    layer = Condensation(np.full(town.shape, 17.5), mask)  # a new building
    coded = uniformly(town, condensation=layer, **options)
    assert np.array_equal(coded.city.heights, layer.laid(town.heights))
    collage = layer.laid(naive.collage(coded.genome, coded.city.heights))
    rmse = np.sqrt(np.mean((collage - coded.city.heights) ** 2))
    assert coded.collage_rmse == pytest.approx(rmse, rel=1e-3)
    decoded = decode(coded.genome).city.heights
    assert (decoded[mask] == 17.5).all()
    assert np.sqrt(np.mean((decoded - coded.city.heights)[~mask] ** 2)) < 4


def test_a_map_wholly_kept_is_decoded_as_it_is(town):
    everything = Condensation.cut(town, np.ones(town.shape, bool))
    coded = uniformly(town, condensation=everything)
    assert coded.pairs == 0
    assert coded.collage_rmse == 0
    assert np.array_equal(decode(coded.genome).city.heights, town.heights)


@pytest.mark.parametrize("wrong", ["river", np.ones((64, 64), bool)])
def test_what_is_no_condensation_is_refused(town, wrong):
    with pytest.raises(GenomeError, match=r"Condensation\.cut"):
        uniformly(town, condensation=wrong)
    with pytest.raises(GenomeError, match="32 × 32 px"):
        uniformly(draw_town(1, side=32), condensation=quarter(town))


# -- the fit ----------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(3))
def test_gradient_against_finite_differences(seed):
    genome = locked(draw_genome(seed, block=4, rows=4, columns=4, sigma_max=0.9), seed)
    error = AttractorError(genome, draw_map(genome, seed), tolerance=1e-14)
    start = np.concatenate([genome.sigma, genome.beta]).astype(np.float64)
    half = len(genome)
    _, *gradients = error(start[:half], start[half:])
    gradient = np.concatenate(gradients)
    able = np.concatenate([~genome.uniform, np.ones(half, bool)])
    for i in np.flatnonzero(able):
        step = 1e-5 if i < half else 1e-3
        push = step * (np.arange(2 * half) == i)
        ends = [error(*np.split(start + sign * push, 2))[0] for sign in (1, -1)]
        scale = 1e-4 * np.abs(gradient[:half] if i < half else gradient[half:]).max()
        assert gradient[i] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-3, abs=scale)
    covered = genome.pavement.blocks(genome.condensation.mask).all(axis=(1, 2))
    assert covered.any()
    assert (gradient.reshape(2, half)[:, covered] == 0).all()


def test_the_fit_keeps_it_and_brings_the_rest_closer(town):
    coded = uniformly(town, condensation=quarter(town))
    fitted = fit_attractor(coded.genome, coded.city)
    assert fitted.condensation is coded.genome.condensation
    assert psnr(coded.city, decode(fitted).city) > coded.psnr


# -- repair -----------------------------------------------------------------------------------


def test_repair_takes_what_is_kept_for_what_is_meant(town, other_town):
    layer = quarter(town)
    genome = uniformly(other_town, condensation=layer).genome
    meant = decode(genome).city.heights
    elsewhere = np.where(layer.mask, 99, meant).astype(np.float32)  # what nobody can lay there
    assert collage_repair(genome, elsewhere, threshold=0.5) == (genome, 0)
