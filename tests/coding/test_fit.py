"""Laws of the attractor fit: the adjoint, the gradient, never worse, within bounds."""

import signal

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import io
from evocity.citymap import CityMap
from evocity.coding import CollageMap, decode, fit_attractor, psnr
from evocity.coding._kernels import spread_means
from evocity.coding.fit import AttractorError
from evocity.errors import GenomeError, MapError
from evocity.genome import Genome, read_genome
from evocity.pavement import Pavement


def draw_genome(seed: int, block: int = 4, rows: int = 5, columns: int = 7, sigma_max=0.8):
    """A random code: domains of several extents, tall and wide, all isometries, some uniform."""
    rng = np.random.default_rng(seed)
    pavement = Pavement(rows * block, columns * block, block)
    count = len(pavement)
    tall, wide = rng.integers(2, 5, (2, count)) * block * (rng.random(count) > 0.2)
    busy = tall > 0
    return Genome(
        pavement,
        sigma=rng.uniform(-sigma_max, sigma_max, count) * busy,
        beta=rng.uniform(0, 20, count),
        x=rng.integers(0, pavement.width - wide + 1) * busy,
        y=rng.integers(0, pavement.height - tall + 1) * busy,
        dx=wide,
        dy=tall,
        iso=(rng.integers(0, 8, count) * busy).astype(np.uint8),
        parent=np.zeros(count, np.uint8),
        source=np.arange(count),
        metres_per_pixel=2.0,
        cities=("random",),
        sigma_max=sigma_max,
    )


def draw_map(genome: Genome, seed: int) -> CityMap:
    p = genome.pavement
    return CityMap(np.random.default_rng(seed).uniform(0, 30, (p.height, p.width)), 2.0)


@pytest.fixture(scope="module")
def coded(town):
    return uniformly(town).genome


@pytest.fixture(scope="module")
def fitted(coded, town):
    return fit_attractor(coded, town)


# -- the adjoint ------------------------------------------------------------------------------


@pytest.mark.parametrize(("tall", "wide"), [(1, 1), (2, 2), (3, 2), (1, 5), (9, 11)])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_spread_means_against_the_naive_twin(tall, wide, dtype):
    means = np.random.default_rng(3).normal(size=(9, 11)).astype(dtype)
    heights = np.zeros((9, 11), dtype)
    spread_means(means, tall, wide, heights)
    truth = naive.spread_means(means, tall, wide, 9, 11)
    assert heights == pytest.approx(truth, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("block", [2, 3, 4])
def test_transposed_collage_against_the_naive_twin(block):
    genome = draw_genome(block, block)
    values = np.random.default_rng(1).normal(size=(5 * block, 7 * block))
    expected = naive.collage_transposed(genome, values)
    assert CollageMap(genome, dtype=np.float64).transposed(values) == pytest.approx(expected)
    single = CollageMap(genome).transposed(values.astype(np.float32))
    assert single == pytest.approx(expected, rel=1e-4, abs=1e-4)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([2, 3, 4]))
def test_adjoint_law(seed, block):
    """⟨W x, y⟩ = ⟨x, Wᵀ y⟩, W without β."""
    genome = draw_genome(seed, block)
    linear = CollageMap(genome, dtype=np.float64).recoded(genome.sigma, np.zeros(len(genome)))
    x, y = np.random.default_rng(seed).normal(size=(2, *linear.shape))
    assert np.vdot(linear(x), y) == pytest.approx(np.vdot(x, linear.transposed(y)), abs=1e-9)


def test_float64_and_recoded_collage_maps_agree_with_the_naive_twin():
    genome, other = draw_genome(5), draw_genome(6)
    heights = draw_map(genome, 7).heights.astype(np.float64)
    wide = CollageMap(genome, dtype=np.float64)
    assert wide(heights) == pytest.approx(naive.collage(genome, heights))
    sigma = np.where(genome.uniform, 0, other.sigma)
    recoded = genome.replace(sigma=sigma, beta=other.beta)
    assert wide.recoded(sigma, other.beta)(heights) == pytest.approx(
        naive.collage(recoded, heights)
    )
    assert wide(heights) == pytest.approx(naive.collage(genome, heights)), "as it was"


# -- the gradient -----------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_gradient_against_finite_differences(seed):
    genome = draw_genome(seed, block=4, rows=4, columns=4, sigma_max=0.9)
    error = AttractorError(genome, draw_map(genome, seed), tolerance=1e-14)
    sigma, beta = genome.sigma.astype(np.float64), genome.beta.astype(np.float64)
    lost, by_sigma, by_beta = error(sigma, beta)
    heights = CollageMap(genome, dtype=np.float64)
    attractor = np.zeros(heights.shape)
    for _ in range(400):
        attractor = heights(attractor)
    assert lost == pytest.approx(np.sum((attractor - draw_map(genome, seed).heights) ** 2))

    def central(of_sigma: bool, i: int, step: float) -> float:
        sides = []
        for sign in (1, -1):
            moved = [sigma.copy(), beta.copy()]
            moved[0 if of_sigma else 1][i] += sign * step
            sides.append(error(*moved)[0])
        return (sides[0] - sides[1]) / (2 * step)

    for i in range(len(genome)):
        assert by_beta[i] == pytest.approx(
            central(False, i, 1e-3), rel=1e-3, abs=1e-4 * np.abs(by_beta).max()
        )
        if not genome.uniform[i]:
            assert by_sigma[i] == pytest.approx(
                central(True, i, 1e-5), rel=1e-3, abs=1e-4 * np.abs(by_sigma).max()
            )


def test_no_attractor_is_told_not_raised():
    genome = draw_genome(1)
    error = AttractorError(genome, draw_map(genome, 1))
    assert error(5.0 * ~genome.uniform, genome.beta) is None
    assert error(genome.sigma, genome.beta) is not None, "it recovers"


# -- the fit ----------------------------------------------------------------------------------


def attractor_error(genome: Genome, city: CityMap) -> float:
    return np.sum((decode(genome, tolerance=1e-4).attractor - city.heights) ** 2, dtype=float)


def test_fit_lowers_the_attractor_error_and_moves_only_sigma_and_beta(coded, fitted, town):
    assert attractor_error(fitted, town) < 0.95 * attractor_error(coded, town)
    for name in ("x", "y", "dx", "dy", "iso", "parent", "source"):
        assert np.array_equal(getattr(fitted, name), getattr(coded, name)), name
    assert np.all(fitted.sigma[fitted.uniform] == 0)
    told = fitted.made["fit"]
    assert told["psnr_before"] == psnr(town, decode(coded).city)
    assert told["psnr_after"] == psnr(town, decode(fitted).city)
    assert {**fitted.made, "fit": None} == {**coded.made, "fit": None}


@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
@pytest.mark.parametrize(("block", "gain"), [(4, 0.75), (8, 0.45)])
def test_fit_gains_on_real_cities(name, block, gain):
    city = io.read_map(name, pixels=128, metres_per_pixel=2.0)
    plain, better = (uniformly(city, block=block, fit=fit).psnr for fit in (False, True))
    assert better > plain + gain


def test_the_same_arguments_give_the_same_genome(coded, fitted, town):
    again = fit_attractor(coded, town)
    assert again == fitted
    assert again.made == fitted.made


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([0.3, 0.6, 0.9, 0.99]), st.integers(1, 25))
def test_never_worse_and_within_bounds(seed, sigma_max, evaluations):
    """For any code of any map, not only those an encoder would make."""
    genome = draw_genome(seed, sigma_max=sigma_max)
    city = draw_map(genome, seed + 1)
    fitted = fit_attractor(genome, city, evaluations=evaluations)
    assert psnr(city, decode(fitted).city) >= psnr(city, decode(genome).city)
    assert np.abs(fitted.sigma).max() <= np.float32(sigma_max)
    assert fitted.sigma_max == genome.sigma_max


def test_never_worse_where_only_the_part_below_ground_gets_better():
    """Decoding cuts at the ground, so an attractor below it can be far off and yet decode well."""
    heights = np.zeros((16, 16))
    heights[:4, :4] = 20
    city = CityMap(heights, 2.0)
    flat = uniformly(CityMap(np.zeros((16, 16)), 2.0)).genome
    sunk = flat.replace(beta=np.where(np.arange(16) == 0, 19.9, -20))
    before = psnr(city, decode(sunk).city)
    for evaluations in range(1, 9):
        fitted = fit_attractor(sunk, city, evaluations=evaluations)
        assert psnr(city, decode(fitted).city) >= before


def test_the_cap_is_reached_and_kept(coded, fitted):
    """A fit that no bound held would tell nothing about bounds."""
    assert np.count_nonzero(np.abs(fitted.sigma) == np.float32(0.9)) > 0
    assert np.abs(fitted.sigma).max() <= np.float32(coded.sigma_max)


@pytest.mark.parametrize("sigma_max", [1.5, np.inf])
def test_codes_without_a_cap(town, sigma_max):
    coded = uniformly(town, block=8, sigma_max=sigma_max).genome
    fitted = fit_attractor(coded, town)
    assert psnr(town, decode(fitted).city) > psnr(town, decode(coded).city)


@pytest.mark.parametrize("scale", [1e-3, 1e3])
def test_heights_of_any_scale(scale):
    """Never worse, even where the decoder's tolerance in metres is coarser than the heights."""
    city = draw_town(4, side=32, buildings=12)
    scaled = city.replace(city.heights * scale)
    plain, other = uniformly(city, fit=True), uniformly(scaled, fit=True)
    assert other.psnr >= uniformly(scaled).psnr
    if scale > 1:
        assert other.psnr == pytest.approx(plain.psnr, abs=0.1)


@pytest.mark.parametrize("level", [0.0, 12.0])
def test_nothing_to_gain_gives_the_genome_back(level):
    city = CityMap(np.full((32, 32), level), 2.0)
    genome = uniformly(city).genome
    assert genome.uniform.all()
    assert fit_attractor(genome, city) is genome


def test_uniform_lifs_find_their_level():
    city = CityMap(np.repeat(np.arange(64.0).reshape(8, 8), 4, 0).repeat(4, 1), 2.0)
    genome = uniformly(city).genome
    off = genome.replace(beta=genome.beta + np.where(np.arange(len(genome)) % 2, 3, -2))
    fitted = fit_attractor(off, city)
    assert fitted.beta == pytest.approx(genome.beta, abs=0.05)
    assert np.all(fitted.sigma == 0)


def test_a_perfect_fit_can_be_kept_in_a_file(tmp_path):
    city = CityMap(np.full((16, 16), 16.0), 2.0)
    genome = uniformly(city).genome
    fitted = fit_attractor(genome.replace(beta=genome.beta - 2), city)
    assert psnr(city, decode(fitted).city) == np.inf
    assert fitted.made["fit"]["psnr_after"] is None
    fitted.write(tmp_path / "g.parquet")
    assert read_genome(tmp_path / "g.parquet").made == fitted.made


def test_one_evaluation_tells_nothing_new(coded, town):
    assert fit_attractor(coded, town, evaluations=1) is coded


# -- faults -----------------------------------------------------------------------------------


@pytest.mark.parametrize("fault", [ZeroDivisionError, MemoryError, KeyboardInterrupt, SystemExit])
def test_exceptions_pass_through(coded, town, fault):
    seen = []

    def failing(done, total):
        seen.append(done)
        if done == 3:
            raise fault("from within")

    with pytest.raises(fault, match="from within"):
        fit_attractor(coded, town, progress=failing)
    assert seen == [1, 2, 3], "no evaluation after it"


def test_ctrl_c_leaves_at_once(coded, town):
    seen = []

    def pressed(done, total):
        seen.append(done)
        if done == 2:
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        fit_attractor(coded, town, progress=pressed)
    assert seen == [1, 2]


def test_progress_counts_to_the_end(coded, town):
    seen = []
    fit_attractor(coded, town, evaluations=7, progress=lambda *told: seen.append(told))
    assert seen == [(n, 7) for n in range(1, 8)]


@pytest.mark.parametrize("evaluations", [0, -1, 1.5, np.nan, np.inf])
def test_evaluations_at_fault(coded, town, evaluations):
    with pytest.raises(GenomeError, match="evaluations"):
        fit_attractor(coded, town, evaluations=evaluations)


def test_another_grid_is_refused(coded, town):
    for other in (draw_town(1, side=32, buildings=5), CityMap(town.heights, 3.0)):
        with pytest.raises(MapError, match="the same number and size of pixels"):
            fit_attractor(coded, other)


def test_a_code_that_diverges_is_refused():
    genome = draw_genome(1).replace(sigma_max=np.inf)
    genome = genome.replace(sigma=np.where(genome.uniform, 0, 5.0))
    with pytest.raises(GenomeError, match="diverges"):
        fit_attractor(genome, draw_map(genome, 1))


# -- as an option of encode -------------------------------------------------------------------


def test_encode_fits_on_demand(coded, fitted, town):
    plain, better = uniformly(town), uniformly(town, fit=True)
    assert plain.genome == coded
    assert better.genome == fitted
    assert better.psnr > plain.psnr
    assert (better.uniform, better.pairs) == (plain.uniform, plain.pairs)
    collage = naive.collage(better.genome, town.heights)
    rmse = np.sqrt(np.mean((collage - town.heights) ** 2))
    assert better.collage_rmse == pytest.approx(rmse, rel=1e-4)
    assert better.collage_rmse > plain.collage_rmse, "the search had the least of these"
