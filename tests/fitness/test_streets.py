"""How far plans of streets are apart: laws, a naive twin, and what real cities and rows tell."""

import itertools

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.fitness import Reference, _kernels, street_distance
from evocity.fitness.streets import FEATURES, edge_features

seeds = st.integers(0, 2**32)


@pytest.fixture(scope="module")
def districts():
    names = ("lyon-1er", "montpellier-pas-du-loup", "new-york-west-village")
    return [evocity.read_map(name) for name in names]


def grid(side=240, block=24, street=6, height=9.0, name="grid"):
    """Square blocks, px, between streets that go from frame to frame."""
    at = (np.arange(side) + street + block // 2) % (block + street) >= street
    return CityMap(np.where(at[:, None] & at, height, 0), 2.0, name=name)


# -- twins and features --------------------------------------------------------------------


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_order_nearby_as_its_naive_twin(seed):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 30))
    middles = rng.uniform(0, 200, (2, count))
    length, turn = rng.uniform(1, 90, count), rng.uniform(0, 7, count)
    sums = np.stack([length * np.cos(turn), length * np.sin(turn), length])
    order = np.empty(count)
    _kernels.order_nearby(middles, sums, 80.0, order)
    np.testing.assert_allclose(order, naive.order_nearby(middles, sums, 80.0), rtol=1e-12)


def test_features_of_a_grid():
    length, width, neck, street, dead, straight, order = edge_features(grid())
    assert len(FEATURES) == 7
    assert np.exp(width) - 2 == pytest.approx(12, abs=1.5)  # streets of 6 px of 2 m
    assert neck.min() > 0.8
    assert not dead.any()
    assert straight.min() > 0.95
    assert order.min() > 0.97
    inner = np.exp(length) - 2
    assert np.median(inner) == pytest.approx(60, abs=2)
    assert np.median(np.exp(street) - 2) == pytest.approx(480, abs=15)


def test_a_way_that_ends_is_a_dead_end_and_an_exit_is_not():
    heights = np.full((128, 128), 9.0)
    heights[60:65] = 0  # from frame to frame
    heights[20:62, 60:65] = 0  # ends in front of a house
    city = CityMap(heights, 2.0)
    table = edge_features(city)
    assert len(city.alley_graph) == 3
    assert sorted(table[4]) == [0, 0, 1]


def test_alleys_of_4_metres_count():
    assert edge_features(grid(street=3)).shape[1] > 20
    assert len(grid(street=3).street_graph) == 0


# -- laws ----------------------------------------------------------------------------------


def test_the_value_is_the_textbook_s(districts):
    lyon, montpellier, york = districts
    tables = [edge_features(city) for city in (lyon, montpellier)]
    centre = np.mean([table.mean(axis=1) for table in tables], axis=0)
    variance = np.mean([((table.T - centre) ** 2).mean(axis=0) for table in tables], axis=0)
    scale = np.maximum(np.sqrt(variance), 0.1)
    x, *ys = [(table.T / scale) for table in (edge_features(york), *tables)]

    def mean(one, other):
        sums = cdist(one, other).sum()
        return sums / (len(one) * (len(one) - 1) if one is other else len(one) * len(other))

    each = [2 * mean(x, y) - mean(x, x) - mean(y, y) for y in ys]
    for weights in ((0.5, 0.5), (0.97, 0.03), (0.2, 0.8)):
        both = sum(2 * w * mean(x, y) for w, y in zip(weights, ys, strict=True)) - mean(x, x)
        both -= sum(
            weights[i] * weights[j] * mean(ys[i], ys[j]) for i in range(2) for j in range(2)
        )
        value = street_distance(york, list(zip((lyon, montpellier), weights, strict=True)))
        assert value == pytest.approx(min(*each, both), abs=1e-4)


def test_a_map_is_about_0_from_itself_and_far_from_others(districts):
    for one, other in itertools.permutations(districts, 2):
        assert -0.1 < street_distance(one, one) < 0.01
        assert street_distance(one, other) > 0.1


def test_halves_of_one_real_city_are_near(districts):
    for city in districts:
        west, east = (city.replace(part) for part in np.split(city.heights, 2, axis=1))
        assert -0.1 < street_distance(west, east) < 0.35


def test_of_several_cities_the_nearest_counts(districts):
    lyon, montpellier, york = districts
    assert street_distance(lyon, [lyon, montpellier]) < 0.01
    assert street_distance(montpellier, [lyon, montpellier]) < 0.01
    assert street_distance(york, [lyon, montpellier]) > 0.1


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_heights_of_what_is_built_do_not_count(seed):
    city = draw_town(3, side=128, buildings=150)
    floors = np.random.default_rng(seed).uniform(3, 60, city.shape)
    other = city.replace(np.where(city.built, floors, 0))
    # quarters and walls may differ, lines do not
    assert np.array_equal(edge_features(other), edge_features(city))


@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_the_map_changes_little(districts, iso):
    lyon, york = districts[0], districts[2]
    turned = york.replace(isometries.apply(iso, york.heights))
    assert street_distance(turned, lyon) == pytest.approx(street_distance(york, lyon), abs=0.05)


def test_streets_that_are_all_alike_are_a_reference_too(districts):
    reference = Reference.of(grid())
    assert abs(street_distance(grid(height=30.0), reference)) < 0.03
    assert street_distance(grid(block=40), reference) > 0.1
    assert street_distance(districts[0], reference) > 1


def test_an_archipelago_is_far_from_its_streets():
    """The same blocks, each shifted and turned by chance: streets dissolve."""
    rng = np.random.default_rng(1)
    heights = np.zeros((256, 256))
    for y, x in itertools.product(range(6, 240, 30), repeat=2):
        down, along = rng.integers(-4, 5, 2)
        tall, wide = rng.integers(12, 25, 2)
        heights[max(y + down, 0) : y + down + tall, max(x + along, 0) : x + along + wide] = 9
    assert street_distance(CityMap(heights, 2.0), grid()) > 0.5


def test_sources_take_their_shares_from_the_genome(districts):
    lyon, montpellier, _ = districts
    reference = Reference.sources([lyon, montpellier])
    code = evocity.encode(lyon, fit=False).genome
    city = evocity.decode(code).city
    assert street_distance(city, reference, code) < 0.05
    swapped = code.replace(cities=("montpellier-pas-du-loup",))
    assert street_distance(city, reference, swapped) > 0.2


# -- what has no meaning -------------------------------------------------------------------


def test_fewer_than_20_edges_tell_nothing(districts):
    few = CityMap(grid().heights[:60, :60], 2.0, name="few")
    count = edge_features(few).shape[1]
    assert 0 < count < 20
    text = f"{count} edges of the street graph in "
    assert street_distance(few, districts[0]).reason.startswith(text + "few")
    assert street_distance(districts[0], few).reason.startswith(text + "the reference")
    bare = CityMap(np.zeros((64, 64)), 2.0, name="bare")
    assert "the comparison needs" in street_distance(bare, districts[0]).reason
    assert street_distance(districts[0], [districts[0], bare]) < 0.05
    full = CityMap(np.full((64, 64), 9.0), 2.0)
    assert street_distance(districts[0], full).reason.startswith("0 edges")
