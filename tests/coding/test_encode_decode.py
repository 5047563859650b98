"""Laws of coding: contraction, the collage bound, independence of start and units."""

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import CollageMap, decode, psnr
from evocity.coding._kernels import box_means, moved
from evocity.errors import GenomeError, MapError
from evocity.io import read_map


@pytest.fixture(scope="module")
def encoding(town):
    return uniformly(town)


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
    genome = uniformly(draw_town(seed, side=32, buildings=12)).genome
    start = np.full((32, 32), level)
    plain, started = decode(genome, tolerance=1e-4), decode(genome, tolerance=1e-4, start=start)
    assert plain.converged
    assert started.converged
    assert started.city.heights == pytest.approx(plain.city.heights, abs=5e-3)


def test_coding_does_not_depend_on_pixel_size_or_scale(town):
    plain = uniformly(town)
    coarse = uniformly(CityMap(town.heights, 7.0))
    tall = uniformly(CityMap(town.heights * 4, town.metres_per_pixel))
    for other in (coarse, tall):
        assert np.array_equal(other.genome.x, plain.genome.x)
        assert np.array_equal(other.genome.iso, plain.genome.iso)
        assert other.psnr == pytest.approx(plain.psnr, abs=0.02)


@pytest.mark.parametrize("reach", [None, 24])
@pytest.mark.parametrize("topological", [None, 0.01])
def test_level_ground_is_coded_with_nothing_to_search(reach, topological):
    told = []
    ground = CityMap(np.full((16, 16), 5.0), 2.0)
    found = uniformly(
        ground, reach=reach, topological=topological, progress=lambda *how: told.append(how)
    )
    assert found.uniform == 16
    assert found.collage_rmse == 0
    assert all(done <= total for done, total in told)


def test_the_error_of_a_slope_is_that_of_any_number_of_threads():
    """Its domain blocks are all as good as each other, but for rounding."""
    y, x = np.mgrid[:32, :32]
    for seed in range(10):
        down, across = np.random.default_rng(seed).random(2)
        slope = CityMap(down * y + across * x, 2.0)
        asked = {"block": 8, "domains": (3,), "reach": None, "sigma_max": 0.5}
        errors = {uniformly(slope, threads=threads, **asked).collage_rmse for threads in (1, 2, 3)}
        assert len(errors) == 1


def test_a_wider_search_never_collages_worse(town):
    errors = [uniformly(town, reach=reach).collage_rmse for reach in (0, 4, 12, 24, None)]
    assert errors == sorted(errors, reverse=True)
    assert uniformly(town, domains=(2, 3)).collage_rmse <= uniformly(town).collage_rmse
    assert uniformly(town, sigma_max=np.inf).collage_rmse <= uniformly(town).collage_rmse


def test_pairs_are_counted(town):
    found = uniformly(town, reach=None)
    assert found.pairs == (256 - found.uniform) * 57 * 57 * 8


def test_description_travels(encoding, town):
    city = decode(encoding.genome).city
    assert city.attribution == town.attribution
    assert city.metres_per_pixel == town.metres_per_pixel
    assert city.name == town.name


@pytest.mark.parametrize("zoom", [0.5, 2, 3])
def test_zoom_keeps_the_city_at_another_scale(zoom):
    city = draw_town(5, side=128, buildings=60)
    genome = uniformly(city).genome
    plain, zoomed = decode(genome).city, decode(genome, zoom=zoom).city
    assert zoomed.shape == tuple(int(side * zoom) for side in city.shape)
    assert zoomed.metres_per_pixel == pytest.approx(city.metres_per_pixel / zoom)
    assert zoomed.area == pytest.approx(plain.area)
    assert zoomed.built.mean() == pytest.approx(plain.built.mean(), abs=0.03)


def test_divergence_names_the_lifs(town):
    genome = uniformly(town).genome.replace(sigma_max=np.inf)
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
        ({"threads": 0}, "threads = 0"),
        ({"threads": -1}, "threads = -1"),
        ({"threads": "2"}, "threads = '2'"),
    ],
)
def test_parameters_at_fault_are_named(town, parameters, word):
    with pytest.raises(GenomeError, match=word):
        uniformly(town, **parameters)


def test_moved_against_its_naive_twin():
    rng = np.random.default_rng(3)
    before, after = rng.normal(0, 2, (2, 500)).astype("f4")
    after[:40], after[40:60], after[60:70] = before[:40], np.inf, np.nan
    after[70] = before[70] + np.float32(1)
    limits = np.float32(1), np.float32(5)
    assert moved(before, after, *limits) == naive.moved(before, after, *limits)
    assert moved(before, before, *limits) == (0, 0)


@pytest.mark.parametrize("height", [np.nan, np.inf, -1e9])
def test_a_start_that_is_not_finite_is_no_start(town, height):
    start = town.heights.copy()
    start[3, 4] = height
    with pytest.raises(GenomeError, match="heights in the array 'start' go"):
        decode(uniformly(town).genome, start=start)


@pytest.mark.parametrize("zoom", [0, -1, 1e-3, np.inf, np.nan, 1e9, "2", True])
def test_what_is_no_zoom_is_refused(encoding, zoom):
    with pytest.raises(GenomeError, match="zoom"):
        decode(encoding.genome, zoom=zoom)


@pytest.mark.parametrize("zoom", [0.3, 0.4, 0.7, 1.1, np.sqrt(2), 2.3])
def test_zooms_between_those_of_whole_blocks_are_means_by_area(encoding, zoom):
    next_legal = max(2, np.ceil(4 * zoom)) / 4
    found = decode(encoding.genome, zoom=zoom)
    wanted = decode(encoding.genome, zoom=next_legal).attractor
    step = next_legal / zoom
    rows, columns = (int(side * zoom + 1e-9) for side in encoding.city.shape)
    assert found.city.shape == found.attractor.shape == (rows, columns)
    assert found.city.metres_per_pixel == pytest.approx(encoding.city.metres_per_pixel / zoom)
    for i, j in ((0, 0), (rows - 1, columns - 1), (rows // 2, columns // 3)):
        share = naive.shares_of_square(i * step, j * step, step, wanted.shape)
        assert found.attractor[i, j] == pytest.approx((share * wanted).sum(), abs=1e-3)


def test_a_collage_map_needs_whole_blocks(encoding):
    with pytest.raises(GenomeError, match="whole number"):
        CollageMap(encoding.genome, 0.3)


def test_psnr(town):
    assert psnr(town, town) == np.inf
    off = town.replace(town.heights + 1)
    assert psnr(town, off) == pytest.approx(20 * np.log10(town.heights.max()))
    with pytest.raises(MapError):
        psnr(town, CityMap(np.zeros((4, 4)), 2.0))


def test_names_in_place_of_maps_and_genomes_are_told_apart(town, encoding):
    with pytest.raises(GenomeError, match=r"of the class str cannot be encoded(.|\n)*read_map"):
        uniformly("lyon-1er")
    with pytest.raises(GenomeError, match=r"of the class CityMap cannot be decoded(.|\n)*encode"):
        decode(town)


def test_a_size_named_twice_is_searched_once(town, encoding):
    assert uniformly(town, domains=(2, 2)).pairs == encoding.pairs


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


def shrunk_by(heights, step):
    """Means of ``step`` × ``step`` pixels."""
    height, width = heights.shape
    return heights.reshape(height // step, step, width // step, step).mean(axis=(1, 3))


@pytest.mark.parametrize("reach", [24, None])
@pytest.mark.parametrize("domains", [(2,), (2, 3)])
def test_zoom_two_is_the_attractor_with_detail_added(town, domains, reach):
    """Means over 2 × 2 pixels of the zoomed attractor satisfy the equation of the attractor."""
    genome = uniformly(town, reach=reach, domains=domains).genome
    plain = decode(genome, tolerance=1e-4).attractor
    zoomed = decode(genome, zoom=2, tolerance=1e-4).attractor
    assert shrunk_by(zoomed, 2) == pytest.approx(plain, abs=5e-3)


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "montpellier-pas-du-loup"])
def test_zoomed_cities_agree_with_the_city_within_the_coding_error(name):
    city = read_map(name)
    genome = uniformly(city).genome

    def distance(heights, truth):
        return np.sqrt(np.mean((heights - truth) ** 2, dtype=float))

    error = distance(decode(genome).city.heights, city.heights)
    plain, finer = (decode(genome, zoom=zoom, tolerance=1e-3).attractor for zoom in (1, 2))
    assert distance(shrunk_by(finer, 2), city.heights) <= distance(plain, city.heights) + 1e-3
    twice, half = (decode(genome, zoom=zoom).city for zoom in (2, 0.5))
    assert twice.metres_per_pixel == 1
    assert half.metres_per_pixel == 4
    assert distance(half.heights, shrunk_by(city.heights, 2)) <= error
    # nearer to the true map of 1 m a pixel than pixels merely repeated
    true = read_map(name, pixels=2 * city.shape[0], metres_per_pixel=1).heights
    repeated = city.heights.repeat(2, axis=0).repeat(2, axis=1)
    assert distance(twice.heights, true) < distance(repeated, true)


@pytest.mark.parametrize("zoom", [0.5, 0.75, 1, 1.25, 2])
@pytest.mark.parametrize("domains", [(2,), (2, 3, 4)])
def test_the_transposed_zoomed_map_is_its_adjoint(town, zoom, domains):
    genome = uniformly(town, domains=domains, reach=None).genome
    extents = genome.dx.copy()
    odd = np.flatnonzero(~genome.uniform & (genome.x < 30))[::9]
    extents[odd] = 12 + 4 * (np.arange(odd.size) % 6)  # rare ones
    collage = CollageMap(genome.replace(dx=extents), zoom, np.float64)
    rng = np.random.default_rng(0)
    a, b = rng.random(collage.shape), rng.random(collage.shape)
    ahead = ((collage(a) - collage(np.zeros(collage.shape))) * b).sum()
    assert (a * collage.transposed(b)).sum() == pytest.approx(ahead, rel=1e-9)


@pytest.mark.parametrize("zoom", [0.5, 0.75, 1.5])
def test_domain_blocks_that_begin_within_a_pixel_take_their_share_of_it(town, zoom):
    """Every block by itself: area-weighted means, as an integral of a step function."""
    genome = uniformly(town, domains=(2, 3)).genome
    collage = CollageMap(genome, zoom, np.float64)
    heights = np.random.default_rng(1).random(collage.shape)
    found = collage.pavement.blocks(collage(heights))
    block = collage.pavement.block
    total = np.zeros([side + 1 for side in collage.shape])
    total[1:, 1:] = heights.cumsum(axis=0).cumsum(axis=1)
    for i in np.flatnonzero(~genome.uniform)[::7]:
        multiple = genome.dx[i] // genome.pavement.block
        rows = genome.y[i] * zoom + multiple * np.arange(block + 1)
        columns = genome.x[i] * zoom + multiple * np.arange(block + 1)
        sums = bilinear(total, rows, columns)
        cells = np.diff(np.diff(sums, axis=0), axis=1) / multiple**2
        truth = genome.sigma[i] * isometries.apply(int(genome.iso[i]), cells) + genome.beta[i]
        assert found[i] == pytest.approx(truth, abs=1e-6)


def bilinear(values, rows, columns):
    y, x = (
        np.minimum(np.floor(at + 1e-9), values.shape[0] - 2).astype(int) for at in (rows, columns)
    )
    v, u = (rows - y)[:, None], (columns - x)[None]
    below, right = values[y + 1], values[y]
    return (1 - v) * ((1 - u) * right[:, x] + u * right[:, x + 1]) + v * (
        (1 - u) * below[:, x] + u * below[:, x + 1]
    )


def test_a_lifs_beyond_the_sky_is_blamed_itself(town):
    genome = uniformly(town).genome
    beta = genome.beta.copy()
    flat = int(np.flatnonzero(genome.uniform)[3])
    beta[flat] = 2e7
    with pytest.raises(GenomeError, match=f"β = 2e\\+07 m in lifs {flat}"):
        decode(genome.replace(beta=beta))
