"""Whole buildings and cuts along fronts: laws, and children of crossings."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_copies import copied, own, shown, town

import evocity
from evocity import operators
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import _kernels, integrity, integrity_along_fronts
from evocity.fitness.cuts import LOOSE, cut_pieces
from evocity.isometries import AFFINE

seeds = st.integers(0, 2**32)


def rows_of_houses(depth=16, street=8):
    """Two rows of houses, 24 m wide, on both sides of a street that runs east."""
    heights = np.zeros((64, 64))
    top = 32 - street // 2
    for left in range(0, 64, 12):
        storeys = 6 + 3 * (left // 12 % 2)
        heights[top - depth : top, left : left + 12] = storeys
        heights[top + street : top + street + depth, left : left + 12] = storeys + 9
    return CityMap(heights, 2.0, name="rows")


@given(seeds)
@settings(max_examples=8, deadline=None)
def test_a_source_city_is_whole_and_whole_buildings_always_count(seed):
    city = town(seed % 1000)
    code = own(city, seed % 7)
    assert integrity_along_fronts(shown(code, [city]), code, [city]) == 1
    pieces, counts, loose = cut_pieces(shown(code, [city]), code, [city])
    assert counts.sum() == np.count_nonzero(city.built)
    assert loose.sum() == 0
    assert np.bincount(pieces.ravel(), minlength=counts.size + 1)[1:].tolist() == counts.tolist()


def child_of(city, keep):
    """The map of a city with cells of 8 px that stand where ``keep`` says, bare elsewhere."""
    bare = CityMap(np.zeros(city.shape), 2.0, name="bare")
    whose = np.where(keep, 0, 1)
    row, column = np.indices(keep.shape)
    child = copied([own(city), own(bare)], whose, row, column, np.zeros(keep.shape, int))
    return shown(child, [city, bare]), child, [city, bare]


def test_houses_cut_along_the_street_count():
    city = rows_of_houses(street=16)  # the south row begins in row 40
    keep = np.ones((8, 8), bool)
    keep[5] = False  # the street takes 8 px of the south row
    along = child_of(city, keep)
    assert integrity(along[0], genome=along[1], sources=along[2]) < 0.7
    assert integrity_along_fronts(*along) == 1


def test_a_house_that_ends_in_another_house_does_not_count():
    city = rows_of_houses()
    other = CityMap(np.full((64, 64), 30.0), 2.0, name="slab")
    whose = np.zeros((8, 8), int)
    whose[:, 3] = 1  # a slab through both rows
    row, column = np.indices(whose.shape)
    child = copied([own(city), own(other)], whose, row, column, np.zeros((8, 8), int))
    map_ = shown(child, [city, other])
    pieces, counts, loose = cut_pieces(map_, child, [city, other])
    cut, whole = pieces[20, 33] - 1, pieces[20, 23] - 1
    assert loose[cut] > LOOSE * 4 * np.sqrt(counts[cut])
    assert loose[whole] == 0
    assert integrity_along_fronts(map_, child, [city, other]) < 0.8


def turned(city, angle):
    """A child on cells of 2 px that shows a city turned around its middle by any ``angle``, as far
    as eight isometries and whole pixels can."""
    cells = np.indices((city.shape[0] // 2, city.shape[1] // 2))
    at = cells * 2 + 0.5
    middle = (np.array(city.shape) - 1)[:, None, None] / 2
    down, along = at - middle
    sine, cosine = np.sin(angle), np.cos(angle)
    row = middle[0] + cosine * down - sine * along
    column = middle[1] + sine * down + cosine * along
    turn = int(np.abs(AFFINE[:, 2:] - (cosine, sine, -sine, cosine)).sum(axis=1).argmin())
    row, column = (np.rint((one - 0.5) / 2).astype(int) for one in (row, column))
    inside = (np.minimum(row, column) >= 0) & (row < cells.shape[1]) & (column < cells.shape[2])
    return inside, np.where(inside, row, 0), np.where(inside, column, 0), np.full(row.shape, turn)


@given(seeds, st.integers(1, 4))
@settings(max_examples=10, deadline=None)
def test_fitted_places_as_their_naive_twin(seed, reach):
    rng = np.random.default_rng(seed)
    number = rng.integers(-1, 2, (10, 12))
    y, x = np.indices(number.shape)
    angle = rng.uniform(0, 2 * np.pi)
    turn = np.array([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)])
    row = np.rint(turn[0] * y + turn[2] * x + rng.integers(0, 2, number.shape) * rng.integers(9))
    column = np.rint(turn[1] * y + turn[3] * x)
    turns = np.broadcast_to(np.rint(turn)[:, None, None], (4, *number.shape)).copy()
    places, slopes = np.zeros((2, *number.shape)), np.zeros((4, *number.shape))
    _kernels.fit_places(number, row, column, turns, reach, places, slopes)
    expected = naive.fit_places(number, row, column, turns, reach)
    np.testing.assert_allclose(places, expected[0], atol=1e-8)
    np.testing.assert_allclose(slopes, expected[1], atol=1e-8)


@given(st.floats(0, 2 * np.pi), seeds)
@settings(max_examples=8, deadline=None)
def test_whole_buildings_count_at_any_angle(angle, seed):
    rng = np.random.default_rng(seed)
    heights = np.zeros((96, 96))
    for top in range(20, 70, 16):
        for left in range(20, 70, 16):
            size = rng.integers(7, 12, 2)
            heights[top : top + size[0], left : left + size[1]] = 6 + 3 * rng.integers(4)
    city = CityMap(heights, 2.0, name="houses")
    bare = CityMap(np.zeros(city.shape), 2.0, name="bare")
    inside, row, column, turn = turned(city, angle)
    whose = np.where(inside, 0, 1)
    child = copied([own(city), own(bare)], whose, row, column, turn, cell=2)
    assert integrity_along_fronts(shown(child, [city, bare]), child, [city, bare]) >= 0.95


@pytest.mark.slow
def test_children_of_plans_keep_buildings_that_pavement_fusion_cuts():
    names = "montpellier-pas-du-loup", "villeurbanne-gratte-ciel"
    sources = [evocity.read_map(name) for name in names]
    codes = [evocity.encode(city).genome for city in sources]
    found = {}
    for operator in (operators.PlanFusion(faces=2), operators.PavementFusion()):
        child = operator(codes, np.random.default_rng(1))
        city = evocity.decode(child).city
        found[operator.name] = integrity_along_fronts(city, genome=child, sources=sources)
    assert found["plan_fusion"] >= 0.9
    assert found["pavement_fusion"] < found["plan_fusion"] - 0.05


def test_nothing_built_and_missing_sources():
    city = town(1)
    code = own(city)
    bare = city.replace(np.zeros(city.shape, np.float32))
    assert "no built ground" in integrity_along_fronts(bare, code, [city]).reason
    with pytest.raises(FitnessError, match="come from city-1"):
        integrity_along_fronts(city, code, [town(2)])
