"""The measures against truth: closed forms, simulations, a real district measured elsewhere."""

import math

import naive
import numpy as np
import pytest
import shapely
from districts import HEIGHTS, bubenec, jittered, simulated
from scipy import stats
from scipy.optimize import minimize_scalar
from towns import draw_town

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import (
    autosimilarity,
    crumbs,
    fit_sizes,
    fsi,
    gsi,
    mean_height,
    salingaros,
    salingaros_buildings,
    slivers,
    small_buildings,
)

# -- density -----------------------------------------------------------------------------


def test_densities_of_bubenec_are_those_of_its_polygons():
    city = jittered(0, seed=0)
    areas = shapely.area(bubenec())
    ground = 407_353.6
    assert gsi(city) == pytest.approx(0.25738, rel=2e-3)
    assert fsi(city) == pytest.approx((areas * np.round(HEIGHTS / 3)).sum() / ground, rel=2e-3)
    assert mean_height(city) == pytest.approx((areas @ HEIGHTS) / areas.sum(), rel=2e-3)


@pytest.mark.parametrize(("height", "floors"), [(0, 0), (1.4, 0), (1.6, 1), (4.5, 2), (7.5, 3)])
def test_half_a_floor_counts_as_one(height, floors):
    assert fsi(CityMap(np.full((4, 4), height), 2.0)) == floors


# -- sizes -------------------------------------------------------------------------------


@pytest.mark.parametrize(("m", "spread"), [(0.5, 0.09), (1.0, 0.12), (2.0, 0.20)])
def test_simulated_exponents_are_found_with_the_error_the_fit_states(m, spread):
    rng = np.random.default_rng(5)
    fits = [fit_sizes(simulated(m, 100, rng), 1, np.e**4) for _ in range(400)]
    found = np.array([fit.m for fit in fits])
    assert found.mean() == pytest.approx(m, abs=4 * spread / math.sqrt(400))
    assert found.std() == pytest.approx(spread, rel=0.12)
    assert np.mean([fit.error for fit in fits]) == pytest.approx(found.std(), rel=0.12)
    assert np.median([fit.ks for fit in fits]) < 0.85  # a fitted law comes closer than a given


@pytest.mark.parametrize("m", [-2.0, -0.3, 1e-7, 0.4, 1.5, 6.0])
def test_the_fit_is_the_numeric_optimum_of_the_likelihood(m):
    a, b = 3.0, 200.0
    span = math.log(b / a)
    sizes = a * simulated(m, 300, np.random.default_rng(8), span)

    def surprise(slope):
        norm = span if abs(slope) < 1e-9 else -math.expm1(-slope * span) / slope
        return slope * np.log(sizes / a).mean() + math.log(norm)

    best = minimize_scalar(surprise, bounds=(-30, 30), method="bounded", options={"xatol": 1e-9})
    fit = fit_sizes(sizes, a, b)
    assert fit.m == pytest.approx(best.x, abs=1e-4)
    law = stats.truncpareto(fit.m, b / a, scale=a) if fit.m > 0 else None
    if law:
        oracle = stats.kstest(sizes, law.cdf)
        assert fit.ks == pytest.approx(oracle.statistic * math.sqrt(fit.n), abs=1e-9)


def test_bubenec_does_not_follow_the_law():
    sizes = np.sqrt(shapely.area(bubenec()))
    fit = fit_sizes(sizes, sizes.min(), sizes.max())
    assert fit.m == pytest.approx(0.31, abs=0.005)
    assert fit.error == pytest.approx(0.11, abs=0.005)
    assert fit.ks == pytest.approx(3.3, abs=0.05)


def test_sizes_beyond_the_bounds_do_not_count():
    sizes = simulated(1.2, 60, np.random.default_rng(1))
    with_strays = np.concatenate([sizes, [0.2, 0.9, 90.0, 4000.0]])
    assert fit_sizes(with_strays, 1, np.e**4) == fit_sizes(sizes, 1, np.e**4)


@pytest.mark.parametrize("size", [1.0, np.e**4])
def test_sizes_all_alike_at_a_bound_give_a_finite_exponent(size):
    fit = fit_sizes(np.full(40, size), 1, np.e**4)
    assert math.isfinite(fit.m)
    assert (fit.span, fit.occupancy) == (0, 0.25)


@pytest.mark.parametrize(("sizes", "a", "b"), [([5.0], 4, 4), ([5.0], 0, 9), ([1.0], 4, 9)])
def test_bounds_that_hold_nothing_are_refused(sizes, a, b):
    with pytest.raises(FitnessError):
        fit_sizes(np.array(sizes), a, b)


def city_of(areas, pixel):
    """Buildings of the given areas, in pixels, all but square, laid in rows a pixel apart."""
    rows, x = [[]], 0
    for area in areas:
        wide = int(math.sqrt(area))
        tall = round(area / wide)
        if x + wide > 1024:
            rows.append([])
            x = 0
        rows[-1].append((x, tall, wide))
        x += wide + 1
    deep = [max(tall for _, tall, _ in row) for row in rows]
    heights = np.zeros((sum(deep) + len(rows), 1024), np.float32)
    y = 0
    for row, depth in zip(rows, deep, strict=True):
        for x, tall, wide in row:
            heights[y : y + tall, x : x + wide] = 9
        y += depth + 1
    return CityMap(heights, pixel)


def test_salingaros_prefers_the_law_to_buildings_of_one_size():
    sizes = np.sort(5 * simulated(1.3, 200, np.random.default_rng(2)))[::-1]
    lawful = city_of((sizes / 0.5) ** 2, 0.5)
    assert len(lawful.areas) == 200
    assert salingaros(lawful) > 0.4
    assert salingaros(city_of([400 + i for i in range(200)], 1.0)) < 0.01


def test_salingaros_of_few_buildings_is_undefined_with_a_reason():
    assert math.isnan(salingaros(city_of([64] * 29, 1.0)))
    assert salingaros(city_of([64] * 29, 1.0)).reason.startswith("29 built components")
    assert not math.isnan(salingaros(city_of([64] * 30, 1.0)))


def test_salingaros_of_buildings_tells_houses_of_a_block_apart():
    apart = city_of([64 + i for i in range(40)], 1.0)
    assert salingaros_buildings(apart) == salingaros(apart)  # where gaps tell all apart
    sizes = 5 * np.random.default_rng(3).pareto(1.5, 4000) + 5
    heights, left = np.zeros((60, 4000)), 0  # one row, wall to wall
    for k, size in enumerate(sizes[sizes < 60][:60]):
        side = round(size)
        heights[:side, left : left + side] = 9 if k % 2 else 12
        left += side
    block = CityMap(heights[:, :left], 1.0)
    assert salingaros(block).reason.startswith("1 built components")
    assert 0 < salingaros_buildings(block) <= 1
    few = CityMap(heights[:, :100], 1.0)
    assert "buildings of 5 to 273 m" in salingaros_buildings(few).reason


def test_small_buildings_are_told_apart_by_steps_and_counted_on_the_whole_map():
    heights = np.zeros((100, 100))
    heights[10:14, 10:16] = 6  # 96 m² at 2 m
    heights[10:14, 16:19] = 12  # 48 m², wall to wall with it
    heights[40:44, 40:43] = 9  # 48 m²
    heights[60:65, 60:62] = 9  # 40 m²
    hectares = heights.size * 4 / 1e4
    assert small_buildings(CityMap(heights, 2.0)) == pytest.approx(3 / hectares)
    assert small_buildings(CityMap(heights, 4.0)) == 0
    assert small_buildings(CityMap(np.zeros((8, 8)), 2.0)) == 0


def test_slivers_are_less_than_5_m_wide_however_they_lie():
    heights = np.zeros((100, 100))
    heights[10:40, 10:12] = 6  # 4 m wide
    heights[10:40, 20:23] = 6  # 6 m wide
    heights[60:63, 10:30] = 9
    heights[63:65, 10:30] = 14  # a strip of its roof, told apart by a step
    assert slivers(CityMap(heights, 2.0)) == 2 / 4
    assert slivers(CityMap(heights.T, 2.0)) == 2 / 4
    assert slivers(CityMap(heights, 1.0)) == 1
    assert slivers(CityMap(heights, 4.0)) == 0
    assert slivers(CityMap(np.zeros((8, 8)), 2.0)).reason == "nothing is built"


def test_the_law_of_buildings_counts_none_less_than_5_m_wide():
    many = city_of([64 + i for i in range(40)], 1.0)
    strips = np.zeros((many.shape[0] + 40, many.shape[1]))
    strips[: many.shape[0]] = many.heights
    for row in range(many.shape[0] + 2, strips.shape[0] - 4, 6):
        strips[row : row + 4, 2:30] = 9  # 4 m by 28 m
    assert salingaros_buildings(CityMap(strips, 1.0)) == salingaros_buildings(many)
    assert salingaros(CityMap(strips, 1.0)) != salingaros(many)


def test_crumbs_are_counted_by_their_area_not_their_pixels():
    areas = [900, 900, 25, 16, 9, 4, 1]
    built = sum(areas)
    assert crumbs(city_of(areas, 1.0)) == pytest.approx(4 / (built / 1e4))
    assert crumbs(city_of(areas, 2.0)) == pytest.approx(2 / (4 * built / 1e4))
    assert crumbs(city_of(areas, 5.0)) == 0


# -- autosimilarity ----------------------------------------------------------------------


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("seed", [1, 2])
def test_autosimilarity_is_that_of_trying_every_pair(seed):
    heights = draw_town(seed, side=32, buildings=12).heights
    rho2, uniform = naive.best_correlations(heights, 4, (2,), 12)
    expected = 1 - (1 - rho2[~uniform]).mean()
    assert autosimilarity(CityMap(heights, 2.0)) == pytest.approx(expected, abs=1e-5)


def test_autosimilarity_ranks_a_town_above_its_shuffled_pixels_and_flat_ground_last():
    town = draw_town(7, side=128, buildings=150)
    pixels = np.random.default_rng(0).permutation(town.heights.ravel()).reshape(town.shape)
    shuffled, flat = town.replace(pixels), town.replace(np.full(town.shape, 9.0))
    assert autosimilarity(town) > autosimilarity(shuffled) + 0.15
    assert autosimilarity(shuffled) > autosimilarity(flat) == 0


def test_low_contrast_earns_nothing():
    town = draw_town(7, side=128, buildings=150)
    lower = town.replace(town.heights / 4)
    assert autosimilarity(lower) == pytest.approx(autosimilarity(town), abs=1e-4)
