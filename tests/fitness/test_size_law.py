"""Salingaros' law on a map's own range: exact towns, invariances, powerlaw, a slow twin."""

import math

import naive
import numpy as np
import powerlaw
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats
from test_fitness_measures import city_of

from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import _kernels, fit_size_law, get, salingaros_buildings, salingaros_law

TENFOLD = math.log(10)


def town_of(areas, pixel):
    """Buildings of ``areas`` in pixels, exactly: nearly square, the last row not always whole."""
    x = y = deep = 0
    placed = []
    for area in areas.tolist():
        wide = math.ceil(math.sqrt(area))
        if x + wide > 1024:
            x, y, deep = 0, y + deep + 1, 0
        placed.append((y, x, wide, area))
        x, deep = x + wide + 1, max(deep, -(-area // wide))
    heights = np.zeros((y + deep + 1, 1024), np.float32)
    for y, x, wide, area in placed:
        heights[y : y + area // wide, x : x + wide] = 9
        heights[y + area // wide, x : x + area % wide] = 9
    return CityMap(heights, pixel)


def at_ranks(m, ranks, span=TENFOLD):
    """Sizes of the law on [1, e^span] at ``ranks`` of its distribution, from 0 to 1."""
    if abs(m) < 1e-9:
        return np.exp(span * ranks)
    return np.exp(-np.log1p(ranks * np.expm1(-m * span)) / m)


def exact(m, count, span=TENFOLD):
    return at_ranks(m, (np.arange(count) + 0.5) / count, span)


exponents = st.floats(1, 2)
counts = st.integers(30, 400)


@settings(deadline=None, max_examples=60)
@given(exponents, counts, st.floats(-7, 7), st.floats(TENFOLD, 5))
def test_exact_towns_on_any_range_score_one(m, count, start, span):
    law = fit_size_law(math.exp(start) * exact(m, count, span))
    assert law.score == pytest.approx(1, abs=0.02)
    assert law.n == count
    assert law.p == pytest.approx(1, abs=0.05)


@pytest.mark.parametrize("m", [1.0, 1.3, 1.5, 2.0])
@pytest.mark.parametrize("count", [30, 60, 300])
def test_range_and_exponent_of_exact_towns_are_those_they_were_drawn_from(m, count):
    law = fit_size_law(8 * exact(m, count))
    assert law.m == pytest.approx(m, rel=0.01)
    assert law.smallest == pytest.approx(8, rel=1e-3)
    assert law.largest == pytest.approx(80, rel=0.03)


@pytest.mark.parametrize("ranks", ["from 0 to 1", "between"])
@pytest.mark.parametrize("m", [1.0, 1.5, 2.0])
def test_other_ways_to_draw_exactly_score_one_too(ranks, m):
    drawn = np.linspace(0, 1, 150) if ranks == "from 0 to 1" else np.arange(1, 151) / 151
    assert fit_size_law(8 * at_ranks(m, drawn)).score == pytest.approx(1, abs=0.02)


@pytest.mark.parametrize("m", [1.0, 1.5, 2.0])
def test_random_towns_of_the_law_hardly_score_less(m):
    rng = np.random.default_rng(11)
    scores = [fit_size_law(at_ranks(m, rng.uniform(size=400))).score for _ in range(60)]
    assert np.median(scores) > 0.98
    assert np.quantile(scores, 0.1) > 0.9


@pytest.mark.parametrize(
    ("low", "high", "pixel", "count"),
    [
        (8, 80, 2.0, 150),
        (8, 80, 1.0, 150),
        (5, 50, 1.0, 200),
        (20, 200, 4.0, 60),
        (3, 30, 1.0, 100),
    ],
)
@pytest.mark.parametrize("m", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("drawn", ["areas", "sides"])  # rounded to pixels
def test_exact_towns_on_maps_score_one_where_the_fixed_range_refuses_them(
    low, high, pixel, count, m, drawn
):
    sides = low * exact(m, count, math.log(high / low)) / pixel
    if drawn == "areas":
        city = town_of(np.rint(sides**2).astype(int), pixel)
    else:
        city = city_of(np.rint(sides).astype(int) ** 2, pixel)
    assert salingaros_law(city) == pytest.approx(1, abs=0.02)
    assert get("salingaros_law.sizes")(city) >= 0.98 * count
    assert get("salingaros_law.exponent")(city) == pytest.approx(m, abs=0.1)
    assert get("salingaros_law.smallest")(city) == pytest.approx(low, rel=0.06)
    assert get("salingaros_law.largest")(city) == pytest.approx(high, rel=0.25)
    if low >= 5:
        assert salingaros_buildings(city) < 0.5


sizes_of_any_sort = st.builds(
    lambda seed, count, deviation: np.exp(np.random.default_rng(seed).normal(3, deviation, count)),
    st.integers(0, 2**32 - 1),
    st.integers(30, 250),
    st.floats(0.01, 2),
)


@settings(deadline=None, max_examples=60)
@given(sizes_of_any_sort, st.floats(1e-3, 1e3))
def test_the_unit_of_length_changes_nothing(sizes, unit):
    law, scaled = fit_size_law(sizes, 0.1), fit_size_law(unit * sizes, unit * 0.1)
    assert scaled.score == pytest.approx(law.score, rel=1e-6)


@settings(deadline=None, max_examples=60)
@given(sizes_of_any_sort, st.randoms(use_true_random=False))
def test_the_order_of_the_sizes_changes_nothing(sizes, random):
    other = sizes.tolist()
    random.shuffle(other)
    assert fit_size_law(np.array(other)) == fit_size_law(sizes)


@settings(deadline=None, max_examples=60)
@given(sizes_of_any_sort)
def test_every_score_lies_between_0_and_1_and_says_what_it_fitted(sizes):
    law = fit_size_law(sizes)
    assert 0 <= law.score <= 1
    assert 30 <= law.n <= np.count_nonzero((sizes >= law.smallest) & (sizes <= law.largest))
    assert law.share == law.n / sizes.size
    assert 0.001 <= law.p <= 1
    assert all(map(math.isfinite, (law.m, law.error, law.ks)))


def test_a_scaled_map_measures_the_same():
    city = city_of(np.rint(exact(1.2, 90) ** 2 * 16).astype(int), 2.0)
    larger = CityMap(city.heights, 10.0)
    assert salingaros_law(larger) == pytest.approx(salingaros_law(city), abs=1e-9)
    ends = get("salingaros_law.largest")
    assert ends(larger) == pytest.approx(5 * ends(city), rel=1e-9)


@settings(deadline=None, max_examples=40)
@given(st.floats(1, 200), st.floats(0, 0.15), st.integers(60, 400), st.integers(0, 99))
def test_towns_of_nearly_equal_sizes_score_low(size, spread, count, seed):
    rng = np.random.default_rng(seed)
    sizes = size * (1 + spread * rng.uniform(-1, 1, count))
    sizes[0] *= 1.001
    assert fit_size_law(sizes).score < 0.2


def test_towns_of_equal_sizes_have_0_and_no_exponent():
    city = city_of([64] * 40, 2.0)
    assert salingaros_law(city) == 0
    assert get("salingaros_law.sizes")(city) == 0
    assert get("salingaros_law.exponent")(city).reason.startswith("all 40 buildings")
    mostly = city_of([64] * 285 + list(range(100, 1600, 100)), 2.0)
    assert salingaros_law(mostly) < 0.02


@pytest.mark.parametrize("sizes", [[8, 80], [8, 20, 54]])
def test_a_few_sizes_that_repeat_are_not_a_law(sizes):
    assert fit_size_law(np.repeat(np.array(sizes, float), 80)).score < 0.02


@pytest.mark.parametrize("form", ["log-normal", "cubic"])  # far from the law below, and above
def test_large_pixels_do_not_excuse_sizes_that_lie_closer(form):
    ranks = (np.arange(300) + 0.5) / 300
    sizes = np.exp(3 + 0.6 * stats.norm.ppf(ranks)) if form == "log-normal" else 10 + 50 * ranks**3
    coarsely = fit_size_law(sizes, sizes.min() / 1.5)
    assert coarsely.score == pytest.approx(fit_size_law(sizes).score, abs=0.03)


def test_few_buildings_are_undefined_with_a_reason():
    few = salingaros_law(city_of([64] * 29, 2.0))
    assert math.isnan(few)
    assert few.reason == "29 buildings count; fewer than 30 have no distribution"
    assert get("salingaros_law.p")(CityMap(np.zeros((9, 9)), 2.0)).reason.startswith(
        "0 buildings count"
    )


def test_crumbs_and_strips_of_roof_do_not_count():
    areas = np.rint(exact(1.5, 60) ** 2 * 16).astype(int)
    town = city_of(areas, 2.0)
    littered = np.zeros((town.shape[0] + 40, town.shape[1]), np.float32)
    littered[:-40] = town.heights
    littered[-38:-36, ::15] = 9  # 2 × 1 px
    for column in range(0, 1000, 10):
        littered[-30:-20, column : column + 2] = 9  # 20 × 4 m
    city = CityMap(littered, 2.0)
    assert len(city.buildings) > len(town.buildings) + 150
    assert salingaros_law(city) == salingaros_law(town)


@pytest.mark.parametrize(
    "sizes", [np.ones(29), np.full(40, 5.0), np.r_[np.ones(40), 0.0], [np.nan] * 50]
)
def test_sizes_without_a_law_are_refused(sizes):
    with pytest.raises(FitnessError):
        fit_size_law(np.array(sizes))


def test_an_unknown_choice_is_refused():
    with pytest.raises(FitnessError, match="choose"):
        fit_size_law(exact(1, 40), choose="widest")


def test_a_negative_step_is_refused():
    with pytest.raises(FitnessError, match="step"):
        fit_size_law(exact(1, 40), -1.0)


# -- other programs ----------------------------------------------------------------------


@pytest.mark.parametrize("m", [0.5, 1.0, 1.5, 2.5])
@pytest.mark.parametrize("count", [60, 300])
def test_exponent_and_distance_on_a_range_are_powerlaws(m, count):
    sizes = np.sort(8 * at_ranks(m, np.random.default_rng(count).uniform(size=count)))
    fits = np.empty((5, 1, 1))
    logs = np.log(sizes)
    _kernels.fit_ranges(logs, logs, logs, np.array([0]), np.array([count]), 30, fits)
    found, _, low, high, distance = fits[:, 0, 0]
    oracle = powerlaw.Power_Law(
        data=sizes,
        xmin=math.exp(low),
        xmax=math.exp(high),
        force_numerical_fit=True,
        parameter_ranges={"alpha": [0, 8]},
    )
    assert found == pytest.approx(oracle.alpha - 1, abs=1e-3)
    # on one side of each step only
    assert oracle.D - 1e-3 <= distance <= oracle.D + 1 / count + 1e-3


@pytest.mark.filterwarnings("ignore:Standard error:DeprecationWarning")
@pytest.mark.parametrize("m", [1.2, 1.8])
def test_where_the_law_begins_is_what_powerlaw_finds(m):
    rng = np.random.default_rng(4)
    tail = 12 * at_ranks(m, rng.uniform(size=200), span=4)
    sizes = np.concatenate([tail, rng.uniform(2, 12, 150)])
    law = fit_size_law(sizes, choose="distance")
    oracle = powerlaw.Fit(sizes, verbose=0)
    assert law.smallest == pytest.approx(oracle.xmin, rel=0.05)
    assert law.m == pytest.approx(oracle.alpha - 1, abs=law.error)
    assert law.ks == pytest.approx(oracle.D * math.sqrt(law.n), abs=0.3)


@pytest.mark.parametrize(("m", "count"), [(1.0, 100), (1.5, 300), (2.0, 200)])
def test_p_is_uniform_for_a_law_on_a_given_range(m, count):
    rng = np.random.default_rng(2)
    chances = []
    for _ in range(400):
        law = fit_size_law(at_ranks(m, rng.uniform(size=count)))
        if law.share == 1:  # else the range was chosen by its fit
            chances.append(law.p)
    chances = np.array(chances)
    assert chances.size > 200
    assert np.quantile(chances, 0.5) == pytest.approx(0.5, abs=0.16)


# -- the kernel --------------------------------------------------------------------------


@settings(deadline=None, max_examples=25)
@given(
    st.floats(-2, 4),
    st.integers(30, 80),
    st.floats(0.1, 4),
    st.integers(0, 2**32 - 1),
    st.floats(0, 0.02),
)
def test_fitted_ranges_are_those_of_the_naive_fit(m, count, span, seed, blur):
    rng = np.random.default_rng(seed)
    logs = np.sort(np.log(at_ranks(m, rng.uniform(size=count), span)))
    starts, stops = np.array([0, count - 29, count - 1]), np.array([count - 1, count])
    fits = np.empty((5, starts.size, stops.size))
    _kernels.fit_ranges(logs, logs - blur, logs + blur, starts, stops, 29, fits)
    assert np.isnan(fits[:, 2]).all()
    for i, start in enumerate(starts[:2]):
        for j, stop in enumerate(stops):
            if stop - start < 29:
                assert np.isnan(fits[:, i, j]).all()
                continue
            part = logs[start:stop]
            slow = naive.fit_range(part, part - blur, part + blur)
            wide = part[-1] - part[0]
            assert fits[0, i, j] * wide == pytest.approx(slow[0] * wide, abs=1e-4)
            assert fits[1:, i, j] == pytest.approx(slow[1:], rel=1e-3, abs=1e-4 * max(wide, 1))
