"""Region fusion: what it injects stands whole, and what it may cut is told."""

from functools import cache

import naive
import numpy as np
import pytest
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import ODD, district, odd_maps, town
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.coding.collage_map import CollageMap
from evocity.errors import OperatorError
from evocity.fitness.heredity import integrity_of, whole_buildings
from evocity.genome import NUCLEOTIDES, Genome, unpacked
from evocity.operators._kernels import (
    fill_courts,
    give_back,
    grown,
    inject_regions,
    tallied,
)
from evocity.operators.groups import footings_of
from evocity.operators.pavement_fusion import VOID, PavementFusion
from evocity.operators.region_fusion import RegionFusion

ANY = RegionFusion(size_min=1, tolerance=1000.0, repair=None)


def owner_of(child, parents) -> np.ndarray:
    """Which parent each block of a child is of, by the cities' names."""
    names = [parent.cities[0] for parent in parents]
    return np.array([names.index(city) for city in child.cities])[child.parent]


def open_town(seed: int):
    return uniformly(draw_town(seed, side=96, buildings=22)).genome


@cache
def open_towns(count: int = 3):
    return [open_town(seed) for seed in range(11, 11 + count)]


def injected(parents, owner: np.ndarray, labels_of=lambda city: city.buildings.labels):
    """(parent, label, blocks it stands on, is it whole) of each building of the parents but the
    first of which a block came to the child."""
    pavement = parents[0].pavement
    for donor, parent in enumerate(parents):
        labels = pavement.blocks(labels_of(decode(parent).city)).reshape(len(pavement), -1)
        for label in np.unique(labels[(owner == donor)[:, None] & (labels > 0)]):
            blocks = (labels == label).any(axis=1)
            if donor > 0:
                yield donor, label, blocks, (owner[blocks] == donor).all()


def likeness(parents, child) -> list[tuple[int, float]]:
    """(pixels, intersection over union with the child) of each built component injected that no
    later region took a building of; on the blocks it stands on, and where no other component of
    its city stands."""
    decoded, pavement, found = decode(child).city.built, child.pavement, []
    maps = [decode(parent).city for parent in parents]
    owner = owner_of(child, parents)
    for donor, label, blocks, whole in injected(parents, owner, lambda city: city.labels):
        if not whole:
            continue
        labels = maps[donor].labels
        area = pavement.raster(blocks) & ((labels == 0) | (labels == label))
        before, after = (labels == label) & area, decoded & area
        found.append((before.sum(), (before & after).sum() / (before | after).sum()))
    return found


# -- laws ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "operator",
    [RegionFusion(), ANY, RegionFusion(void=True, cut=0, fill=(0.4, 0.3, 0.3), limit=60)],
    ids=str,
)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, seed):
    parents = open_towns(2)
    before = [parent.digest for parent in parents]
    child = operator(parents, np.random.default_rng(seed))
    assert [parent.digest for parent in parents] == before
    assert operator(parents, np.random.default_rng(seed)) == child
    assert decode(child).converged
    assert np.array_equal(stones(child), np.arange(len(child)))
    assert set(child.cities) <= {parent.cities[0] for parent in parents} | {VOID}


@pytest.mark.parametrize("seed", range(3))
def test_lifs_and_map_are_cut_from_the_parents(seed):
    parents = open_towns()
    draft = ANY.draft(parents, np.random.default_rng(seed))
    owner = owner_of(draft.genome, parents)
    assert len(np.unique(owner)) > 1
    for name in NUCLEOTIDES:
        columns = np.stack([getattr(parent, name) for parent in parents])
        assert np.array_equal(getattr(draft.genome, name), columns[owner, np.arange(owner.size)])
    maps = np.stack([decode(parent).city.heights for parent in parents])
    every = parents[0].pavement.raster(owner)
    assert np.array_equal(draft.intended, np.take_along_axis(maps, every[None], axis=0)[0])


def test_a_city_bred_with_itself_gives_itself():
    assert ANY([town(), town()], np.random.default_rng(0)) == town()


@pytest.mark.parametrize("fill", [0, 1])
def test_fill_of_nothing_or_all_gives_a_parent(fill):
    child = RegionFusion(fill=fill)(open_towns(2), np.random.default_rng(0))
    assert child == open_towns(2)[fill]


def test_the_fill_reached_is_told():
    reached = []
    for seed in range(4):
        child = RegionFusion(fill=0.4)(open_towns(2), np.random.default_rng(seed))
        shares = np.bincount(owner_of(child, open_towns(2)), minlength=2) / len(child)
        assert child.made["fill_reached"] == pytest.approx(shares, abs=1e-4)
        reached.append(shares[1])
    assert max(reached) <= 0.5
    assert np.mean(reached) > 0.3


# -- turned -------------------------------------------------------------------------------------


def rectangle(seed: int) -> Genome:
    how = {"block": (2, 16), "lifs": 500, "fit": False, "settle": False}
    heights = draw_town(seed, side=96, buildings=20).heights[:64]
    return encode(CityMap(heights, 2.0, name=f"wide {seed}"), **how).genome


def shown(parents, code: Genome) -> np.ndarray:
    """The map that a ``code`` shows: of every lifs its stone, turned."""
    maps = {parent.cities[0]: np.maximum(decode(parent).attractor, 0) for parent in parents}
    found = np.zeros((code.pavement.height, code.pavement.width), np.float32)
    places = zip(*code.pavement.corners, code.pavement.side, *unpacked(code.source), strict=True)
    for i, (y, x, s, row, column) in enumerate(places):
        city = code.cities[code.parent[i]]
        if city != VOID:
            stone = maps[city][row : row + s, column : column + s]
            found[y : y + s, x : x + s] = isometries.apply(int(code.turn[i]), stone)
    return found


@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32), void=st.booleans(), square=st.booleans())
def test_turned_regions_show_the_stones_of_the_donor_turned(seed, void, square):
    parents = open_towns(2) if square else [rectangle(31), rectangle(32)]
    operator = RegionFusion(isometries=True, void=void, tolerance=1000.0)
    child = operator(parents, np.random.default_rng(seed))
    assert operator(parents, np.random.default_rng(seed)) == child
    assert decode(child).converged
    draft = operator.draft(parents, np.random.default_rng(seed))
    assert np.array_equal(draft.intended, shown(parents, draft.genome))
    reached = draft.genome.shares
    order = [draft.genome.cities.index(parent.cities[0]) for parent in parents]
    assert child.made["fill_reached"][:2] == pytest.approx(reached[order], abs=1e-4)
    if not square:
        assert set(draft.genome.turn.tolist()) <= {0, 2, 5, 7}


def test_donors_are_laid_under_every_isometry_and_who_fills_the_map_as_it_lies():
    parents, found = open_towns(2), set()
    for seed in range(24):
        operator = RegionFusion(isometries=True, tolerance=1000.0, repair=None, fill=0.3)
        child = operator(parents, np.random.default_rng(seed))
        found |= set(child.turn.tolist())
        assert not child.turn[owner_of(child, parents) == 0].any()
    assert found == set(range(8))


@pytest.mark.parametrize("seed", range(4))
def test_turned_regions_cut_no_building_and_count_as_whole(seed):
    parents = open_towns()
    maps = [decode(parent).city for parent in parents]
    operator = RegionFusion(cut=0, isometries=True, size_min=1, tolerance=1000.0)
    child = operator(parents, np.random.default_rng(seed))
    assert (child.parent > 0).any()
    assert integrity_of(child, maps) == 1
    assert (whole_buildings(child, maps).iso > 0).any()


@pytest.mark.parametrize("kind", ["square", "rectangle"])
def test_turned_domain_blocks_come_along(kind):
    """A lifs that calls a domain block of its own donor, under its own isometry, lays what it laid
    there."""
    parents = open_towns(2) if kind == "square" else [rectangle(31), rectangle(32)]
    count = 0
    for seed in range(4):
        operator = RegionFusion(isometries=True, tolerance=1000.0)
        draft = operator.draft(parents, np.random.default_rng(seed))
        code = draft.genome
        side = code.pavement.raster(8 * code.parent.astype(int) + code.turn)
        gaps = np.abs(CollageMap(code)(draft.intended) - draft.intended)
        for i in np.flatnonzero(code.dx > 0):
            called = side[code.y[i] : code.y[i] + code.dy[i], code.x[i] : code.x[i] + code.dx[i]]
            if (called == 8 * int(code.parent[i]) + code.turn[i]).all() and code.turn[i] > 0:
                assert gaps[code.pavement.index == i].mean() < 0.15  # no height is below ground
                count += 1
    assert count > 100


# -- whole buildings ------------------------------------------------------------------------------


@pytest.mark.parametrize("cut", [0, 0.2, 1])
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32), count=st.integers(2, 3))
def test_no_injected_building_is_cut(cut, seed, count):
    parents = open_towns(count)
    operator = RegionFusion(cut=cut, tolerance=1000.0, size_min=1, repair=None)
    child = operator(parents, np.random.default_rng(seed))
    assert all(whole for *_, whole in injected(parents, owner_of(child, parents)))


@pytest.mark.parametrize("seed", range(5))
def test_cut_of_nothing_cuts_no_building_at_all(seed):
    parents = open_towns()
    child = RegionFusion(cut=0, size_min=1, tolerance=1000.0)(parents, np.random.default_rng(seed))
    assert (child.parent > 0).any()
    assert integrity_of(child, [decode(parent).city for parent in parents]) == 1


@pytest.mark.parametrize("cut", [0.1, 0.4])
def test_standing_buildings_lose_the_cut_at_most(cut):
    parents = [district("new-york-west-village", 128), district("montpellier-pas-du-loup", 128)]
    labels = decode(parents[0]).city.buildings.labels
    lost = []
    for seed in range(6):
        operator = RegionFusion(cut=cut, tolerance=1000.0, repair=None)
        owner = owner_of(operator(parents, np.random.default_rng(seed)), parents)
        stands = parents[0].pavement.raster(owner == 0)
        share = 1 - np.bincount(labels[stands], minlength=labels.max() + 1) / np.bincount(
            labels.ravel()
        )
        lost += [one for one in share[1:] if 0 < one < 1]
    assert lost
    assert max(lost) <= cut + 1e-9


def test_components_of_the_donor_come_together():
    """What stands side by side shares range blocks; with one size there is one donor."""
    parents = [open_town(21), district("lyon-1er", 96)]
    labels = decode(parents[1]).city.labels
    assert len(decode(parents[1]).city.buildings) > labels.max()
    came = 0
    for seed in range(8):
        operator = RegionFusion(size_min=3, size_max=3, cut=1, tolerance=1000.0, repair=None)
        owner = owner_of(operator(parents, np.random.default_rng(seed)), parents)
        taken = parents[1].pavement.raster(owner == 1)
        for one in np.unique(labels[taken & (labels > 0)]):
            assert taken[labels == one].all()
            came += 1
    assert came > 0


def test_regions_that_cut_nothing_come_first():
    parents = open_towns(2)
    maps = [decode(parent).city for parent in parents]
    operator = RegionFusion(size_min=2, size_max=2, cut=1, tolerance=1000.0, fill=0.25, tries=None,
                            margin=0.05, repair=None)  # fmt: skip
    for seed in range(6):
        child = operator(parents, np.random.default_rng(seed))
        assert child.made["fill_reached"][1] > 0.15
        assert integrity_of(child, maps) == 1


def test_each_region_holds_a_building():
    heights = np.zeros((64, 64), np.float32)
    heights[40:50, 8:30] = 9
    lone = uniformly(CityMap(heights, 2.0, name="lone")).genome
    bare = uniformly(CityMap(np.zeros((64, 64)), 2.0, name="bare")).genome
    child = RegionFusion(size_min=1, size_max=3, fill=0.2)([bare, lone], np.random.default_rng(0))
    taken = child.pavement.raster(owner_of(child, [bare, lone]) == 1)
    assert taken[40:50, 8:30].all()
    assert np.abs(decode(child).city.heights - heights).max() < 1
    # what has no building at all, the void, may still be injected
    child = RegionFusion(fill=0.5, tolerance=1000.0)([lone, bare], np.random.default_rng(0))
    assert child.made["fill_reached"][1] > 0.3


def test_regions_beyond_the_limit_are_refused():
    parents = open_towns(2)
    small = RegionFusion(limit=6, size_max=3, size_min=1, tolerance=1000.0, repair=None)
    child = small(parents, np.random.default_rng(0))
    assert 0 < child.made["fill_reached"][1] < 0.3
    none = RegionFusion(limit=1, size_min=2, tolerance=1000.0)(parents, np.random.default_rng(0))
    assert none == parents[0]


@pytest.mark.parametrize("pair", [("new-york-west-village", "montpellier-pas-du-loup"),
                                  ("lyon-1er", "cape-town-salt-river")])  # fmt: skip
def test_injected_buildings_of_real_districts_stand_in_the_child(pair):
    parents = [district(name, 128) for name in pair]
    found = []
    for seed in range(4):
        found += likeness(parents, RegionFusion()(parents, np.random.default_rng(seed)))
    check_likeness(found)


@pytest.mark.long
@pytest.mark.parametrize("pair", [("new-york-west-village", "montpellier-pas-du-loup"),
                                  ("lyon-1er", "cape-town-salt-river")])  # fmt: skip
def test_injected_buildings_over_20_seeds(pair):
    parents = [district(name, 256) for name in pair]
    for couple in (parents, parents[::-1]):
        found = []
        for seed in range(20):
            found += likeness(couple, RegionFusion()(couple, np.random.default_rng(seed)))
        check_likeness(found)


def check_likeness(found) -> None:
    """None was cut, see `likeness`; as far as a code renders what stands on a few pixels, all
    are there in the decoded child."""
    pixels, like = np.array(found).T
    houses = pixels >= 6  # less is a crumb
    assert houses.sum() > 10
    assert like[houses].min() > 0.7
    assert np.average(like > 0.9, weights=pixels) > 0.97


def test_it_keeps_more_buildings_whole_than_squares_do():
    parents = open_towns(2)
    maps = [decode(parent).city for parent in parents]
    kept = {
        kind: np.mean(
            [
                integrity_of(kind(tolerance=12.0)(parents, np.random.default_rng(seed)), maps)
                for seed in range(4)
            ]
        )
        for kind in (RegionFusion, PavementFusion)
    }
    assert kept[RegionFusion] > 0.8
    assert kept[RegionFusion] > kept[PavementFusion] + 0.1


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("void", [False, True])
def test_ends_well_on_any_map(name, void):
    odd = odd_maps()[name]
    other = town() if odd.pavement == town().pavement else odd
    for parents in ([odd, other], [other, odd]):
        child = RegionFusion(void=void)(parents, np.random.default_rng(0))
        assert decode(child).converged


def test_all_faults_are_told_at_once():
    with pytest.raises(OperatorError) as caught:
        RegionFusion(size_min=2, size_max=1, cut=2, margin=3, tries=0, limit=0.5)
    assert set(caught.value.faults) == {"size_max", "cut", "margin", "tries", "limit"}
    assert "region_fusion" in str(caught.value)


# -- kernels ------------------------------------------------------------------------------------


def table(seeds, side=32):
    cities = [draw_town(seed, side=side, buildings=9) for seed in seeds]
    return cities, uniformly(cities[0]).genome.pavement


def footings(pavement, cities):
    """Of the built components, and of the buildings."""
    return (
        footings_of(pavement, [city.labels for city in cities]),
        footings_of(pavement, [city.buildings.labels for city in cities]),
    )


@pytest.mark.parametrize("kind", ["components", "buildings"])
def test_footings_are_those_of_the_maps(kind):
    cities, pavement = table((1, 2))
    maps = [city.labels if kind == "components" else city.buildings.labels for city in cities]
    buildings = footings_of(pavement, maps)
    first = maps[0].max()
    assert buildings.whose.tolist() == [0] * first + [1] * maps[1].max()
    for one in range(buildings.whole.size):
        mask = maps[buildings.whose[one]] == one + 1 - first * buildings.whose[one]
        places = buildings.places[buildings.spans[one] : buildings.spans[one + 1]]
        touched = pavement.blocks(mask).any(axis=(1, 2))
        assert sorted(places) == np.flatnonzero(touched).tolist()
        assert buildings.whole[one] == mask.sum()


def test_tallies_against_their_naive_twin():
    rows = np.random.default_rng(0).integers(-1, 3, (20, 9))
    starts, labels, counts = tallied(rows)
    for row, truth in enumerate(naive.tallied(rows)):
        part = slice(starts[row], starts[row + 1])
        assert dict(zip(labels[part].tolist(), counts[part].tolist(), strict=True)) == truth
    assert tallied(np.full((3, 4), -1))[0].tolist() == [0, 0, 0, 0]


def test_courts_are_filled():
    mask = np.array(
        [[1, 1, 1, 0, 1], [1, 0, 1, 0, 1], [1, 1, 0, 1, 1], [0, 1, 1, 0, 1], [0, 0, 0, 1, 0]], bool
    )
    (places,) = np.nonzero(mask.ravel())
    region, inside = np.empty(25, np.int64), mask.ravel().copy()
    region[: places.size] = places
    count = fill_courts(region, places.size, inside, 5)
    filled = mask.ravel().copy()
    filled[[6, 12, 18]] = True  # diagonals are no way out
    assert sorted(region[:count]) == np.flatnonzero(filled).tolist()
    assert np.array_equal(inside, filled)


@pytest.mark.parametrize("cut", [0.0, 0.3, 1.0])
def test_growth_against_its_naive_twin(cut):
    rng = np.random.default_rng(5)
    sizes = set()
    for trial in range(12):
        cities, pavement = table((3 * trial, 3 * trial + 1, 3 * trial + 2))
        components, buildings = footings(pavement, cities)
        owner = rng.integers(0, 3, (4, 4)).repeat(2, 0).repeat(2, 1).ravel()
        standing = standing_of(cities, pavement, owner, buildings)
        kept = rng.random(standing.size) < 0.2
        for limit in (12, 40, 64):
            seed = np.unique(rng.integers(0, 64, 2))
            asked = owner, trial % 3, components, buildings, standing, kept, cut, limit
            region, held = grown(seed, 8, *asked)
            truth = naive.grown(seed, 8, *asked)
            assert (set(region.tolist()), held if region.size else 0) == truth
            assert len(set(region.tolist())) == region.size
            sizes.add(region.size)
    assert 0 in sizes
    assert len(sizes) > 5


@pytest.mark.parametrize("cut", [0.0, 0.3, 1.0])
def test_injection_against_its_naive_twin(cut):
    rng = np.random.default_rng(9)
    injections = 0
    kin = np.array([0, 1, 1])
    for trial in range(6):
        cities, pavement = table((2 * trial + 50, 2 * trial + 51))
        cities.append(cities[1].replace(isometries.apply(1, cities[1].heights)))
        components, buildings = footings(pavement, cities)
        maps = [pavement.blocks(city.heights) for city in cities]
        owner, kept = np.zeros(64, np.int64), np.zeros(buildings.whole.size, bool)
        standing = np.where(buildings.whose == 0, buildings.whole, 0)
        current = maps[0].copy()
        for donor, tolerance, limit, least, most in [
            (1, 9.0, 40, 30, 50),
            (2, 30.0, 40, 45, 50),
            (0, 99.0, 64, 45, 64),
            (1, 99.0, 30, 64, 60),
        ]:
            corners = np.stack(np.divmod(rng.permutation(49), 7), axis=1)
            asked = kin, 2, corners, 8, components, buildings
            told = tolerance, cut, limit, float(least), float(most)
            truth = naive.inject_regions(current, maps[donor], owner, donor, *asked, kept, *told)
            before = owner.copy()
            owned = inject_regions(
                current, maps[donor], owner, donor, *asked, standing, kept, *told
            )
            assert np.array_equal(current, truth[0])
            assert np.array_equal(owner, truth[1])
            assert np.array_equal(kept, truth[2])
            assert owned == (kin[owner] == kin[donor]).sum()
            injections += not np.array_equal(owner, before)
            assert np.array_equal(standing, standing_of(cities, pavement, owner, buildings))
    assert injections > 3


def test_giving_back_against_its_naive_twin():
    rng = np.random.default_rng(4)
    found = 0
    for trial in range(12):
        cities, pavement = table((2 * trial + 90, 2 * trial + 91))
        _, buildings = footings(pavement, cities)
        maps = np.stack([pavement.blocks(city.heights) for city in cities])
        owner = rng.integers(0, 2, (4, 4)).repeat(2, 0).repeat(2, 1).ravel()
        owner[rng.random(64) < 0.1] ^= 1
        current = maps[owner, np.arange(64)]
        truth = naive.give_back(current, maps, owner, buildings)
        standing = standing_of(cities, pavement, owner, buildings)
        mended = give_back(current, maps, owner, buildings, standing)
        assert np.array_equal(current, truth[0])
        assert np.array_equal(owner, truth[1])
        assert mended == truth[2]
        assert np.array_equal(standing, standing_of(cities, pavement, owner, buildings))
        found += mended
    assert found > 0


def standing_of(cities, pavement, owner, buildings) -> np.ndarray:
    """How many pixels of each building stand where ``owner`` says whose each block is."""
    standing = np.zeros(buildings.whole.size, np.int64)
    for one, mine in enumerate(buildings.whose):
        labels = pavement.blocks(cities[mine].buildings.labels)[owner == mine]
        standing[one] = (labels == one + 1 - (buildings.whose < mine).sum()).sum()
    return standing
