"""Laws of coding: contraction, the collage bound, independence of start and units."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity.citymap import CityMap
from evocity.coding import CollageMap, decode, encode, psnr
from evocity.coding._kernels import box_means
from evocity.errors import GenomeError, MapError


@pytest.fixture(scope="module")
def encoding(town):
    return encode(town)


@pytest.mark.parametrize(("tall", "wide"), [(1, 1), (2, 2), (3, 2), (5, 1)])
def test_box_means_against_the_naive_twin(town, tall, wide):
    means = np.zeros_like(town.heights)
    box_means(town.heights, tall, wide, means)
    truth = naive.box_means(town.heights, tall, wide)
    assert means[: truth.shape[0], : truth.shape[1]] == pytest.approx(truth, rel=1e-5, abs=1e-5)


def test_collage_map_against_the_naive_twin(encoding, town):
    genome = encoding.genome
    busy = ~genome.uniform & (genome.x < 40) & (genome.y < 40)
    extents = genome.dx.copy()
    extents[busy] = 8 + 4 * (np.arange(busy.sum()) % 3)
    genome = genome.replace(dx=extents)
    assert CollageMap(genome)(town.heights) == pytest.approx(
        naive.collage(genome, town.heights), abs=1e-4
    )


def test_collage_error_is_what_encode_reports(encoding, town):
    collage = naive.collage(encoding.genome, town.heights)
    rmse = np.sqrt(np.mean((collage - town.heights) ** 2))
    assert encoding.collage_rmse == pytest.approx(rmse, rel=1e-4)


def test_collage_theorem(encoding, town):
    """‖A − I‖ ≤ ‖W(I) − I‖ / (1 − σ_max) in the largest pixel difference."""
    collage = np.abs(CollageMap(encoding.genome)(town.heights) - town.heights).max()
    decoded = decode(encoding.genome, tolerance=1e-4).city
    attractor = np.abs(decoded.heights - town.heights).max()
    assert attractor <= collage / (1 - encoding.genome.sigma_max) + 1e-2


@settings(max_examples=10, deadline=None)
@given(st.floats(0, 500), st.integers(0, 5))
def test_the_attractor_does_not_depend_on_the_start(level, seed):
    genome = encode(draw_town(seed, side=32, buildings=12)).genome
    start = np.full((32, 32), level)
    plain, started = decode(genome, tolerance=1e-4), decode(genome, tolerance=1e-4, start=start)
    assert plain.converged
    assert started.converged
    assert started.city.heights == pytest.approx(plain.city.heights, abs=5e-3)


def test_coding_does_not_depend_on_pixel_size_or_scale(town):
    plain = encode(town)
    coarse = encode(CityMap(town.heights, 7.0))
    tall = encode(CityMap(town.heights * 4, town.metres_per_pixel))
    for other in (coarse, tall):
        assert np.array_equal(other.genome.x, plain.genome.x)
        assert np.array_equal(other.genome.iso, plain.genome.iso)
        assert other.psnr == pytest.approx(plain.psnr, abs=0.02)


def test_a_wider_search_never_collages_worse(town):
    errors = [encode(town, reach=reach).collage_rmse for reach in (0, 4, 12, 24, None)]
    assert errors == sorted(errors, reverse=True)
    assert encode(town, domains=(2, 3)).collage_rmse <= encode(town).collage_rmse
    assert encode(town, sigma_max=np.inf).collage_rmse <= encode(town).collage_rmse


def test_pairs_are_counted(town):
    found = encode(town, reach=None)
    assert found.pairs == (256 - found.uniform) * 57 * 57 * 8


def test_description_travels(encoding, town):
    city = decode(encoding.genome).city
    assert city.attribution == town.attribution
    assert city.metres_per_pixel == town.metres_per_pixel
    assert city.name == town.name


@pytest.mark.parametrize("zoom", [0.5, 2, 3])
def test_zoom_keeps_the_city_at_another_scale(zoom):
    city = draw_town(5, side=128, buildings=60)
    genome = encode(city).genome
    plain, zoomed = decode(genome).city, decode(genome, zoom=zoom).city
    assert zoomed.shape == tuple(int(side * zoom) for side in city.shape)
    assert zoomed.metres_per_pixel == pytest.approx(city.metres_per_pixel / zoom)
    assert zoomed.area == pytest.approx(plain.area)
    assert zoomed.built.mean() == pytest.approx(plain.built.mean(), abs=0.03)


def test_divergence_names_the_lifs(town):
    genome = encode(town).genome.replace(sigma_max=np.inf)
    at = np.flatnonzero(~genome.uniform)[0]
    sigma, x, y, iso = (getattr(genome, name).copy() for name in ("sigma", "x", "y", "iso"))
    sigma[at], iso[at] = 9.0, 0
    top, left = (int(corner[at]) for corner in genome.pavement.corners)
    y[at], x[at] = min(top, 56), min(left, 56)  # the block reads itself
    with pytest.raises(GenomeError, match=rf"diverges.*lifs.*{at} \(σ = 9.00\)"):
        decode(genome.replace(sigma=sigma, x=x, y=y, iso=iso))


def test_a_decoding_cut_short_says_so(encoding):
    short = decode(encoding.genome, max_iterations=2)
    assert not short.converged
    assert short.iterations == 2
    assert short.change > 0.01
    assert short.blamed.size > 0
    assert decode(encoding.genome).blamed.size == 0


@pytest.mark.parametrize(
    ("parameters", "word"),
    [
        ({"block": 5}, "multiples of 5"),
        ({"block": 1}, "block = 1"),
        ({"domains": ()}, "domains"),
        ({"domains": (1,)}, "domains"),
        ({"domains": (20,)}, "80 px"),
        ({"reach": -1}, "reach"),
        ({"sigma_max": 0}, "sigma_max"),
        ({"domains": (1,), "reach": -1}, "domains.*reach"),
        ({"domains": 2}, "domains = 2"),
        ({"domains": (2.0,)}, "domains"),
        ({"block": 4.0}, "block = 4.0"),
        ({"block": "4"}, "block = '4'"),
        ({"reach": "all"}, "reach = 'all'"),
        ({"sigma_max": "0.9"}, "sigma_max"),
    ],
)
def test_parameters_at_fault_are_named(town, parameters, word):
    with pytest.raises(GenomeError, match=word):
        encode(town, **parameters)


@pytest.mark.parametrize("zoom", [0, -1, 0.3, 0.25, np.inf, np.nan])
def test_zooms_without_whole_blocks_are_refused(encoding, zoom):
    with pytest.raises(GenomeError, match="zoom"):
        decode(encoding.genome, zoom=zoom)


def test_psnr(town):
    assert psnr(town, town) == np.inf
    off = town.replace(town.heights + 1)
    assert psnr(town, off) == pytest.approx(20 * np.log10(town.heights.max()))
    with pytest.raises(MapError):
        psnr(town, CityMap(np.zeros((4, 4)), 2.0))


def test_names_in_place_of_maps_and_genomes_are_told_apart(town, encoding):
    with pytest.raises(GenomeError, match=r"a str to encode(.|\n)*read_map"):
        encode("lyon-1er")
    with pytest.raises(GenomeError, match=r"a CityMap to decode(.|\n)*encode"):
        decode(town)


def test_a_size_named_twice_is_searched_once(town, encoding):
    assert encode(town, domains=(2, 2)).pairs == encoding.pairs


@pytest.mark.parametrize("wrong", [{"tolerance": 0}, {"tolerance": np.nan}, {"max_iterations": 0}])
def test_decoding_without_an_end_is_refused(encoding, wrong):
    with pytest.raises(GenomeError, match="tolerance"):
        decode(encoding.genome, **wrong)


def test_many_extents_cost_no_more_memory(encoding, town):
    """Every lifs with an extent of its own: few layers, and the same map as block by block."""
    genome, rng = encoding.genome, np.random.default_rng(0)
    able = ~genome.uniform
    dx, dy = (np.where(able, 4 * rng.integers(2, 12, able.size), 0) for _ in range(2))
    x, y = np.minimum(genome.x, 64 - dx), np.minimum(genome.y, 64 - dy)
    mixed = genome.replace(dx=dx, dy=dy, x=x, y=y)
    collage = CollageMap(mixed)
    assert collage(town.heights) == pytest.approx(naive.collage(mixed, town.heights), abs=1e-4)
    assert len(collage._layers) <= 9
