"""Whole buildings and true maps: what a child keeps."""

import math
from pathlib import Path

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_leaves, draw_pavement
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.condensation import Condensation
from evocity.errors import FitnessError
from evocity.fitness import fitness
from evocity.fitness.heredity import (
    heritability,
    integrity,
    integrity_of,
    smallest_share,
    source_shares,
    whole_buildings,
)
from evocity.genome import VOID, Pieces, laid, merged, packed, split
from evocity.operators import make
from evocity.operators.crossover import assemble as laid_by_cells
from evocity.pavement import Pavement
from evocity.store import RunLog

OLD = Path(__file__).parents[1] / "old"
seeds = st.integers(0, 2**32)


def town(seed, side=64, **drawn):
    city = draw_town(seed, side, **drawn)
    return city.replace(city.heights, name=f"city-{seed}")


def own(city, pavement=None, seed=0):
    """A code on leaves, its stones those of the ``city``, each in its place."""
    pavement = pavement or draw_pavement(seed, *city.shape)
    stones = np.zeros(len(pavement), np.uint8)
    return draw_leaves(seed, pavement).replace(
        source=packed(*pavement.corners),
        turn=stones,
        parent=stones,
        other=stones,
        cities=(city.name,),
    )


def turned(genome, iso, cell=4):
    """The whole of a square ``genome`` laid under an isometry."""
    side = genome.pavement.height // cell
    row, column = (isometries.apply(iso, grid) for grid in np.indices((side, side)))
    still = np.zeros((side, side), int)
    return laid([genome], Pieces(cell, still, row, column, still + iso)).genome


def shuffled(genomes, seed, cell=8):
    """Squares of cells of all ``genomes`` laid over the first, moved and turned."""
    rng = np.random.default_rng(seed)
    side = genomes[0].pavement.height // cell
    pieces = Pieces.in_place(np.zeros((side, side), int), cell)
    for _ in range(5):
        size, iso = int(rng.integers(1, side)), int(rng.integers(0, 8))
        y, x, v, u = rng.integers(0, side - size + 1, 4)
        here, grid = np.s_[y : y + size, x : x + size], np.indices((size, size))
        pieces.whose[here] = rng.integers(0, len(genomes))
        pieces.row[here] = isometries.apply(iso, grid[0]) + v
        pieces.column[here] = isometries.apply(iso, grid[1]) + u
        pieces.iso[here] = iso
    return laid(genomes, pieces).genome


def assert_as_the_slow_twin(genome, sources):
    labels = {city.name: city.buildings.labels for city in sources}
    wanted, built = naive.whole_buildings(genome, labels)
    found = whole_buildings(genome, sources)
    entries = zip(
        found.city, found.building, found.iso, (np.argwhere(found.labels == k + 1)
        for k in range(len(found))), strict=True,
    )  # fmt: skip
    told = [(str(c), int(b), int(k), [tuple(p) for p in at.tolist()]) for c, b, k, at in entries]
    assert sorted(told) == sorted(wanted)
    assert [int(c[5:]) for c in found.city] == sorted(int(c[5:]) for c in found.city)
    for (*_, pixels), top, left, area in zip(told, found.top, found.left, found.area, strict=True):
        assert (top, left) == (min(y for y, _ in pixels), min(x for _, x in pixels))
        assert area == 4 * len(pixels)
    whole = sum(len(pixels) for *_, pixels in wanted)
    assert integrity_of(genome, sources) == pytest.approx(whole / built)
    return len(told)


@pytest.mark.slow
@given(seeds)
@settings(max_examples=15, deadline=None)
def test_copies_are_found_as_one_by_one(seed):
    sources = [town(1), town(2)]
    parents = [own(city, seed=seed + k) for k, city in enumerate(sources)]
    child = shuffled(parents, seed)
    assert_as_the_slow_twin(child, sources)
    assert_as_the_slow_twin(shuffled([child, parents[1]], seed + 1, cell=4), sources)


def test_stones_from_anywhere_hold_what_is_whole_in_one_of_them():
    sources = [town(k, 216, buildings=400) for k in range(3)]
    whole = [assert_as_the_slow_twin(draw_leaves(seed), sources) for seed in range(6)]
    assert sum(whole) > 0


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_splits_and_merges_change_nothing(seed):
    sources = [town(1), town(2)]
    child = shuffled([own(city, seed=seed + k) for k, city in enumerate(sources)], seed)
    before = whole_buildings(child, sources)
    for same in (split(child, 2), merged(split(child, 2), 16)):
        after = whole_buildings(same, sources)
        assert np.array_equal(after.labels, before.labels)
        for name, column in before.as_dict().items():
            assert np.array_equal(after.as_dict()[name], column)
        assert integrity_of(same, sources) == integrity_of(child, sources)


@pytest.mark.parametrize("iso", range(8))
def test_a_map_laid_whole_is_whole_turned_or_mirrored_or_not(iso):
    city = town(3)
    child = turned(own(city), iso)
    found = whole_buildings(child, [city])
    assert integrity_of(child, [city]) == 1
    assert set(found.iso) == {iso}
    assert np.array_equal(found.building, np.arange(1, len(city.buildings) + 1))
    wanted = isometries.apply(iso, city.buildings.labels)
    assert np.array_equal(found.labels, wanted)
    assert found.area == pytest.approx(city.buildings.area)
    # through generations: turned again, and back
    again = whole_buildings(turned(child, 5), [city])
    assert set(again.iso) == {isometries.COMPOSITION[5, iso]}
    back = turned(child, int(isometries.INVERSE[iso]))
    assert set(whole_buildings(back, [city]).iso) == {0}
    assert integrity_of(back, [city]) == 1


def hamlet(name, *footprints, side=32):
    """A map with buildings (top, left, tall, wide, height), px and m."""
    heights = np.zeros((side, side), np.float32)
    for top, left, tall, wide, height in footprints:
        heights[top : top + tall, left : left + wide] = height
    return CityMap(heights, 2.0, name=name)


def coded(city):
    return encode(city, block=4, fit=False, settle=False).genome


def assembled(parents, owner):
    return laid_by_cells(parents, owner, parents[0].pavement)


TWO_HOUSES = hamlet("a", (4, 4, 8, 8, 9), (20, 8, 4, 8, 12))
ONE_HOUSE = hamlet("b", (8, 20, 8, 4, 6))


def test_a_code_keeps_all_buildings_of_its_map():
    for code in (coded(TWO_HOUSES), encode(TWO_HOUSES).genome):
        assert integrity_of(code, [TWO_HOUSES]) == 1
        assert integrity_of(code, [ONE_HOUSE, TWO_HOUSES]) == 1
        assert len(whole_buildings(code, TWO_HOUSES)) == 2


def test_cut_buildings_are_not_whole():
    parents, sources = [coded(TWO_HOUSES), coded(ONE_HOUSE)], [ONE_HOUSE, TWO_HOUSES]
    owner = np.zeros((8, 8), int)
    owner[:2] = 1  # takes away the upper half of the larger house
    child = assembled(parents, owner)
    # left: lower half of the large house (32 px), the small one (32 px), nothing of b
    assert integrity_of(child, sources) == pytest.approx(32 / 64)
    owner[2:4, 5:] = 1  # half of b's house, rows 8…16
    child = assembled(parents, owner)
    assert integrity_of(child, sources) == pytest.approx((32 + 32) / (64 + 32))
    found = whole_buildings(child, sources)
    assert found.city.tolist() == ["a", "b"]
    assert (found.building.tolist(), found.iso.tolist()) == ([2, 1], [0, 0])
    assert (found.top.tolist(), found.left.tolist()) == ([20, 8], [8, 20])
    assert found.area.tolist() == [128, 128]


def test_a_wall_between_roofs_parts_buildings():
    row = hamlet("row", (4, 4, 8, 8, 9), (4, 12, 8, 8, 15))
    owner = np.zeros((8, 8), int)
    owner[:, 3:] = 1
    child = assembled([coded(row), coded(hamlet("bare"))], owner)
    assert integrity_of(child, [row, hamlet("bare")]) == 1  # the lower one is there alone
    assert whole_buildings(child, [row, hamlet("bare")]).building.tolist() == [1]


def test_halves_that_came_apart_are_not_whole_nor_are_turned_ones():
    genome = coded(TWO_HOUSES)
    for rows, iso, whole in (((2, 1), 0, 32), ((1, 2), 0, 96), ((1, 2), 2, 32)):
        pieces = Pieces.in_place(np.zeros((8, 8), int), 4)
        pieces.row[1:3] = np.array(rows)[:, None]  # where the larger house's halves come from
        pieces.iso[1] = iso
        child = laid([genome], pieces).genome
        assert integrity_of(child, [TWO_HOUSES]) == pytest.approx(whole / 96)


def test_a_part_turned_in_place_is_another():
    # the square house lies on the diagonal: two of its quarters change places, transposed
    pieces = Pieces.in_place(np.zeros((8, 8), int), 4)
    for row, column in ((1, 2), (2, 1)):
        pieces.row[row, column], pieces.column[row, column] = column, row
        pieces.iso[row, column] = 4
    child = laid([coded(TWO_HOUSES)], pieces).genome
    assert integrity_of(child, [TWO_HOUSES]) == pytest.approx(32 / 96)


def test_each_copy_counts():
    genome, grid = coded(TWO_HOUSES), np.indices((8, 16))
    still = np.zeros((8, 16), int)
    twice = laid([genome], Pieces(4, still, grid[0], grid[1] % 8, still)).genome
    assert integrity_of(twice, [TWO_HOUSES]) == 1
    found = whole_buildings(twice, [TWO_HOUSES])
    assert (found.building.tolist(), found.left.tolist()) == ([1, 1, 2, 2], [4, 36, 8, 40])
    assert found.labels.max() == 4
    keeps = make("relocation", mode="copy", shape="square", repair=None, tolerance=None)
    city = draw_town(1)
    copied = keeps([coded(city)], np.random.default_rng(0))
    assert 0 < integrity_of(copied, [city]) <= 1


def test_many_buildings_in_few_leaves():
    heights = np.zeros((128, 128))
    heights[::2, ::2] = 9
    city = CityMap(heights, 2.0, name="posts")
    genome = own(city, Pavement(128, 128, 64))
    assert integrity_of(genome, [city]) == 1
    assert len(whole_buildings(genome, [city])) == 64 * 64


def test_the_measure_is_what_the_function_tells():
    sources, owner = [TWO_HOUSES, ONE_HOUSE], np.zeros((8, 8), int)
    owner[:2] = 1
    child = assembled([coded(TWO_HOUSES), coded(ONE_HOUSE)], owner)
    city = decode(child).city
    assert integrity(city, genome=child, sources=sources) == integrity_of(child, sources)
    assert integrity(city, child, sources) == integrity_of(child, sources)
    bare = hamlet("bare")
    assert integrity(bare, genome=coded(bare), sources=bare).reason


def test_bare_ground_has_no_integrity():
    bare = hamlet("bare")
    assert math.isnan(integrity_of(coded(bare), [bare]))
    found = whole_buildings(coded(bare), [bare])
    assert len(found) == 0
    assert not found.labels.any()
    void = coded(bare).replace(cities=(VOID,))  # its stones are bare, wherever they are from
    assert math.isnan(integrity_of(void, []))
    assert len(whole_buildings(void, [])) == 0


def test_the_void_takes_buildings_away():
    sources = [town(1), town(2)]
    fuse = make("pavement_fusion", void=True, tolerance=50.0)
    child = fuse([coded(city) for city in sources], np.random.default_rng(0))
    assert VOID in np.array(child.cities)[child.parent]
    assert 0 < integrity_of(child, sources) < 1


@pytest.mark.parametrize(
    ("sources", "found"),
    [
        (
            [ONE_HOUSE],
            "64 lifs .codes of one range block. come from a, but the sources are maps of b",
        ),
        ([], "64 lifs .codes of one range block. come from a, but the sources are maps of no city"),
        (
            [hamlet("a", side=16)],
            "lifs .codes of one range block. come from outside the map of a, which has 16 ×",
        ),
        ([TWO_HOUSES, hamlet("a")], "two source cities have the name a"),
        ([coded(TWO_HOUSES)], "sources ="),
        ("a", "sources ="),
    ],
)
def test_sources_at_fault(sources, found):
    with pytest.raises(FitnessError, match=found):
        integrity_of(coded(TWO_HOUSES), sources)
    with pytest.raises(FitnessError, match=found):
        integrity(TWO_HOUSES, genome=coded(TWO_HOUSES), sources=sources)


def test_numbers_of_one_function_are_those_of_their_sources():
    @fitness(numbers=("cities", "pixels"))
    def made_of(city, sources):
        return {"cities": len(sources), "pixels": sum(one.heights.size for one in sources)}

    first, second = made_of.measures
    assert (first.needs, first.takes) == (("sources",), ("sources",))
    city = hamlet("c")
    assert first(city, sources=[TWO_HOUSES]) == 1
    assert first(city, sources=[TWO_HOUSES, ONE_HOUSE]) == 2
    assert second(city, sources=[ONE_HOUSE]) == 32 * 32
    with pytest.raises(FitnessError, match="without its sources"):
        first(city)


def test_smaller_macro_blocks_cut_more():
    sources = [draw_town(seed, side=128) for seed in (1, 2)]
    parents = [coded(city) for city in sources]
    kept = {
        size: np.mean(
            [
                integrity_of(fusion(parents, np.random.default_rng(seed)), sources)
                for seed in range(3)
            ]
        )
        for size in (2, 12)
        for fusion in [
            make("pavement_fusion", side_min=8.0 * size, side_max=8.0 * size, tolerance=50.0)
        ]
    }
    assert kept[2] < kept[12] < 1


@pytest.mark.parametrize("name", ["run-1", "run-2"])
def test_runs_of_older_releases_are_traced_to_their_sources(name):
    run = RunLog(OLD / name)
    sources = [source.city for source in run.sources()]
    births = run.births(columns=["id", "parents"]).to_pylist()
    shares = {row["id"]: integrity_of(run.genome(row["id"]), sources) for row in births}
    founders = [row["id"] for row in births if not row["parents"]]
    assert {shares[one] for one in founders} == {1.0}
    assert all(0 <= share <= 1 for share in shares.values())
    assert min(shares.values()) < 0.9


def test_repair_makes_children_true_to_what_was_meant():
    parents = [coded(draw_town(seed)) for seed in (1, 2)]
    fusion = make("pavement_fusion", tolerance=50.0)
    draft = fusion.draft(parents, np.random.default_rng(3))
    crumbled = heritability(draft.genome, draft.intended)
    repaired = heritability(fusion(parents, np.random.default_rng(3)), draft.intended)
    assert repaired.distance < crumbled.distance
    own = heritability(parents[0], decode(parents[0]).city.heights)
    assert (own.distance, own.crumbs) == (0, 0)


# -- shares of the source cities -----------------------------------------------------------


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_shares_pixel_by_pixel(seed):
    sources = [town(1), town(2), town(3)]
    child = shuffled([own(city, seed=seed + k) for k, city in enumerate(sources)], seed)
    city = town(seed % 40)
    shown = naive.shown_pixels(child)
    names = [shown[y, x][1][0] for y, x in np.argwhere(city.built).tolist()]
    shares = source_shares(city, child)
    expected = {name: names.count(name) / len(names) for name in child.cities}
    assert shares == pytest.approx(expected)
    assert sum(shares.values()) == pytest.approx(1)
    assert smallest_share(city, genome=child) == min(shares.values())
    for same in (split(child, 2), merged(split(child, 2), 16)):
        assert source_shares(city, same) == shares


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_locked_pixels_do_not_count_in_shares(seed):
    """Only free pixels count; the parents of range blocks below the lock do not matter."""
    rng = np.random.default_rng(seed)
    child = shuffled([own(town(k), seed=seed) for k in (1, 2)], seed)
    city = town(seed % 40)
    mask = np.zeros(city.shape, bool)
    top, left = rng.integers(0, 40, 2)
    mask[top : top + 24, left : left + 24] = True
    locked = child.replace(condensation=Condensation.cut(city, mask))
    shown = naive.shown_pixels(child)
    names = [shown[y, x][1][0] for y, x in np.argwhere(city.built & ~mask).tolist()]
    expected = {name: names.count(name) / len(names) for name in child.cities}
    assert source_shares(city, locked) == pytest.approx(expected)
    hidden = child.pavement.sums(mask.astype(np.float32)) == child.pavement.area
    swapped = locked.replace(parent=np.where(hidden, 1 - locked.parent, locked.parent))
    assert source_shares(city, swapped) == source_shares(city, locked)
    every = child.replace(condensation=Condensation.cut(city, mask | True))
    assert "locked pixels" in smallest_share(city, genome=every).reason


def test_a_city_of_the_run_that_is_missing_has_nothing():
    one, other = town(1), town(2)
    code = own(one)
    assert smallest_share(one, genome=code) == 1
    assert smallest_share(one, genome=code, sources=[one]) == 1
    assert smallest_share(one, genome=code, sources=[other, one]) == 0
    assert source_shares(one, code, [other, one]) == {one.name: 1, other.name: 0}
    halves = assembled([coded(TWO_HOUSES), coded(ONE_HOUSE)], np.indices((8, 8))[1] // 4)
    city = hamlet("child", (4, 4, 8, 8, 9), (4, 20, 4, 4, 9))
    assert source_shares(city, halves) == {"a": 64 / 80, "b": 16 / 80}
    assert smallest_share(city, genome=halves) == 0.2


def test_added_ground_belongs_to_no_city():
    one = town(1)
    code = own(one)
    west = (np.arange(len(code)) % 2).astype(np.uint8)
    child = code.replace(parent=west, cities=(VOID, one.name))
    assert source_shares(one, child) == {one.name: 1}
    ground = code.replace(cities=(VOID,))
    assert "source city" in smallest_share(one, genome=ground).reason
    assert "source city" in smallest_share(one.replace(0 * one.heights), genome=code).reason
