"""Whole buildings and cuts along fronts: laws, and children of crossings."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_copies import copied, own, shown, town

import evocity
from evocity import operators
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import integrity, integrity_along_fronts
from evocity.fitness.cuts import LOOSE, cut_pieces

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
