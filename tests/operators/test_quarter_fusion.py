"""Quarter fusion: streets of one parent, whole buildings of the others."""

from functools import cache

import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import district, odd_maps, town
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.fitness.heredity import integrity_of
from evocity.genome import VOID
from evocity.operators.crossing import raw_heights
from evocity.operators.quarter_fusion import QuarterFusion
from evocity.operators.street_blocks import fits, outline, street_blocks
from evocity.pavement import Pavement

LAYOUTS = {"B = 4": {"block": 4}, "leaves": {"block": (2, 16)}}


@cache
def towns(layout="B = 4", count=2):
    how = LAYOUTS[layout] | {"fit": False, "settle": False}
    return [
        evocity.encode(draw_town(seed, side=96, buildings=22), **how).genome
        for seed in range(31, 31 + count)
    ]


def grid_of(city, side=2):
    return Pavement(*city.shape, side)


# -- street blocks --------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32), side=st.sampled_from([2, 3, 4]), buildings=st.integers(1, 12))
def test_each_cell_belongs_to_the_nearest_component(seed, side, buildings):
    city = draw_town(seed, side=24, buildings=buildings)
    found = street_blocks(city, grid_of(city, side))
    cells = city.labels.reshape(24 // side, side, 24 // side, side).max(axis=(1, 3))
    assert np.array_equal(found.built, cells > 0)
    where = np.argwhere(found.built)
    for place in np.ndindex(cells.shape):
        squares = ((where - place) ** 2).sum(axis=1)
        near = where[squares == squares.min()]
        assert found.labels[place] in {int(found.labels[tuple(one)]) for one in near}
    numbers = np.arange(found.labels.max() + 1)
    assert np.array_equal(found.area, [(found.labels == k).sum() for k in numbers])
    assert np.array_equal(
        found.covered, [(found.built & (found.labels == k)).sum() for k in numbers]
    )


@pytest.mark.parametrize("side", [2, 4, 8])
@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
def test_no_building_crosses_the_border_of_a_block(name, side):
    city = evocity.read_map(name)
    pixels = street_blocks(city, grid_of(city, side)).labels.repeat(side, 0).repeat(side, 1)
    lowest = np.full(city.labels.max() + 1, np.iinfo(np.int32).max)
    highest = np.zeros_like(lowest)
    np.minimum.at(lowest, city.labels, pixels)
    np.maximum.at(highest, city.labels, pixels)
    assert np.array_equal(lowest[1:], highest[1:])
    assert lowest[1:].min() > 0


def test_a_map_without_buildings_has_no_block():
    found = street_blocks(CityMap(np.zeros((16, 24)), 2.0), Pavement(16, 24, 2))
    assert not found.labels.any()
    assert found.area.tolist() == [8 * 12]


@pytest.mark.parametrize("seed", range(4))
def test_fits_are_the_best_of_all_places(seed):
    rng = np.random.default_rng(seed)
    donor = street_blocks(draw_town(seed, side=40, buildings=14), Pavement(40, 40, 2))
    block = rng.random((5, 8)) < 0.8
    whole = np.pad(block, 1)
    rim, density = outline(block, whole), rng.random()
    found = fits(block, rim, density, donor, 0.0, rng)
    assert [fit.iso for fit in found] == list(range(8))
    for fit in found:
        tall, wide = (5, 8) if fit.iso in (0, 2, 5, 7) else (8, 5)
        assert (fit.tall, fit.wide) == (tall, wide)

        def score(top, left, iso=fit.iso, tall=tall, wide=wide):
            seen = isometries.apply(iso, donor.built[top : top + tall, left : left + wide])
            inside, cut = seen[block].mean(), seen[rim].mean()
            return inside - 2 * cut - abs(inside - density) / 2

        best = max(score(y, x) for y in range(21 - tall) for x in range(21 - wide))
        assert score(fit.top, fit.left) == pytest.approx(best, abs=1e-4)


def test_outlines_leave_out_the_maps_border():
    block = np.ones((3, 4), bool)
    whole = np.ones((5, 6), bool)
    whole[4] = False  # others begin to the south
    assert np.array_equal(np.argwhere(outline(block, whole))[:, 0], [2] * 4)


def test_what_is_larger_than_the_donor_fits_nowhere_upright():
    donor = street_blocks(draw_town(3, side=24, buildings=5), Pavement(24, 24, 2))
    assert fits(np.ones((13, 4), bool), np.ones((13, 4), bool), 0.5, donor, 0.0, None) == []


# -- children -------------------------------------------------------------------------------------


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32), fill=st.sampled_from([0.2, 0.5, 1.0]))
def test_no_building_is_cut(layout, seed, fill):
    parents = towns(layout)
    child = QuarterFusion(fill=fill, density=0.1, repair=None)(parents, np.random.default_rng(seed))
    assert integrity_of(child, [decode(parent).city for parent in parents]) == 1
    assert set(child.cities) <= {parent.cities[0] for parent in parents} | {VOID}


@pytest.mark.parametrize("layout", LAYOUTS)
def test_what_no_block_was_filled_stays_as_it_was(layout):
    parents = towns(layout)
    draft = QuarterFusion(fill=0.4).draft(parents, np.random.default_rng(3))
    assert draft.made["street_blocks"] > 0
    own = draft.genome.pavement.raster(
        np.array([city == parents[0].cities[0] for city in draft.genome.cities])[
            draft.genome.parent
        ]
    )
    assert 0.3 < own.mean() < 1
    assert np.array_equal(draft.intended[own], raw_heights(parents[0])[own])
    assert not np.array_equal(draft.intended, raw_heights(parents[0]))


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("seed", range(3))
def test_a_child_decodes_to_what_is_meant(layout, seed):
    operator = QuarterFusion(fill=0.5)
    draft = operator.draft(towns(layout), np.random.default_rng(seed))
    child = operator(towns(layout), np.random.default_rng(seed))
    apart = raw_heights(child) - draft.intended
    assert np.sqrt(np.mean(apart**2)) < 0.5


def test_the_fill_reached_is_told():
    parents = towns(count=3)
    child = QuarterFusion(fill=(0.4, 0.3, 0.3), density=0)(parents, np.random.default_rng(1))
    told = child.made["fill_reached"]
    assert sum(told) == pytest.approx(1, abs=1e-3)
    assert all(0.15 < one < 0.45 for one in told[1:])
    by_city = {city: child.shares[k] for k, city in enumerate(child.cities)}
    void = by_city.pop(VOID, 0)
    for parent, share in zip(parents[1:], told[1:], strict=True):
        assert share - void - 1e-3 <= by_city[parent.cities[0]] <= share + 1e-3


@pytest.mark.parametrize("kept", [{"fill": 0}, {"area_min": 1e6}, {"density": 100}])
def test_blocks_that_keep_their_buildings(kept):
    assert QuarterFusion(**kept)(towns(), np.random.default_rng(0)) == towns()[0]


def test_blocks_that_hold_a_lock_keep_their_buildings():
    host, donor = towns()
    city = decode(host).city
    blocks = street_blocks(city, Pavement(96, 96, 4)).labels.repeat(4, 0).repeat(4, 1)
    mask = np.zeros(city.shape, bool)
    mask[40:44, 50:56] = True
    locked = host.replace(condensation=Condensation(city.heights, mask))
    touched = np.isin(blocks, np.unique(blocks[mask]))
    filled = False
    for seed in range(4):
        draft = QuarterFusion(fill=0.9, density=0.1).draft(
            [locked, donor], np.random.default_rng(seed)
        )
        own = np.array([name == host.cities[0] for name in draft.genome.cities])
        stays = draft.genome.pavement.raster(own[draft.genome.parent])
        assert stays[touched].all()
        filled |= not stays.all()
    assert filled


@pytest.mark.parametrize(
    "pair",
    [("lyon-1er", "new-york-west-village"), ("montpellier-pas-du-loup", "new-york-west-village")],
)
def test_real_districts_keep_their_buildings_whole(pair):
    parents = [district(name, 128) for name in pair]
    cities = [evocity.read_map(name, pixels=128) for name in pair]
    for seed in range(3):
        child = QuarterFusion(fill=0.4, density=0.2)(parents, np.random.default_rng(seed))
        assert integrity_of(child, cities) > 0.9


@pytest.mark.parametrize("name", list(odd_maps()))
def test_ends_well_on_any_map(name):
    odd = odd_maps()[name]
    other = town() if odd.pavement == town().pavement else odd
    for parents in ([odd, other], [other, odd], [odd, odd]):
        child = QuarterFusion(density=0, area_min=0)(parents, np.random.default_rng(0))
        assert decode(child).converged


def test_bare_or_built_all_over_nothing_is_exchanged():
    bare = uniformly(CityMap(np.zeros((64, 64)), 2.0, name="bare")).genome
    full = uniformly(CityMap(np.full((64, 64), 9.0), 2.0, name="full")).genome
    some = uniformly(draw_town(5, side=64)).genome
    for parents in ([bare, some], [some, bare], [full, some], [some, full]):
        assert QuarterFusion()(parents, np.random.default_rng(0)) == parents[0]


def test_all_faults_are_told_at_once():
    with pytest.raises(OperatorError) as caught:
        QuarterFusion(fill=2, area_min=-1, spread=-0.1, density=-1)
    assert set(caught.value.faults) == {"fill", "area_min", "spread", "density"}
    with pytest.raises(OperatorError, match="one share for each of 3 parents"):
        QuarterFusion(fill=(0.5, 0.5))(towns(count=3), np.random.default_rng(0))


def test_a_run_breeds_by_it_and_goes_on(tmp_path):
    for seed in (41, 42):
        np.save(tmp_path / f"{seed}.npy", draw_town(seed, side=96, buildings=22).heights)
    recipe = tmp_path / "quarters.toml"
    recipe.write_text("""
    run = { seed = 5, population = 6, generations = 2 }
    map = { pixels = 96, metres_per_pixel = 2.0 }
    parents = [{ map = "41.npy" }, { map = "42.npy" }]
    operators = { quarter_fusion = { weight = 1, density = 0.1 } }
    fitness = [{ name = "integrity" }, { name = "gsi", target = 0.4 }]
    """)
    with evocity.Search(evocity.read_recipe(recipe), out=tmp_path / "run", workers=0) as search:
        next(iter(search))
    with evocity.Search.resume(tmp_path / "run", workers=0) as search:
        for _ in search:
            pass
    run = evocity.open_run(tmp_path / "run")
    births = [one for one in run.births().to_pylist() if one["operator"] == "quarter_fusion"]
    assert len(births) == 12
    assert {one["status"] for one in births} == {"ok"}
    whole = [one["fitness.integrity"] for one in run.births().to_pylist()[:2]]
    assert min(whole) == 1
    assert VOID in run.header.cities
    assert any(run.genome(one["id"]).made["street_blocks"] for one in births)
