"""Quarter fusion: streets of one parent, whole buildings of the others."""

import math
from functools import cache

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import ODD, district, odd_maps, town
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.fitness.heredity import integrity_of
from evocity.genome import VOID, unpacked
from evocity.operators.crossover import raw_heights
from evocity.operators.grid import common_grid
from evocity.operators.quarter_fusion import QuarterFusion, QuarterRefill
from evocity.operators.street_blocks import Filling, Room, best_place, street_blocks
from evocity.operators.street_blocks._kernels import (
    SPARE,
    best_fit,
    lay_cells,
    row_sums,
    stones_of_cells,
)
from evocity.operators.street_blocks.refill import Origins
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


def cells_of(heights):
    """Street blocks of a map whose pixels are its cells."""
    city = CityMap(heights.repeat(2, 0).repeat(2, 1), 1.0)
    return street_blocks(city, Pavement(*city.shape, 2))


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
    assert np.array_equal(found.covered, [(found.components == k).sum() for k in numbers])


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


def fresh(donor):
    """Nothing of a donor stands anywhere yet."""
    return np.zeros(donor.built.shape, np.float32)


def a_room(seed):
    """A street block of a small town, its host, and another town's street blocks."""
    rng = np.random.default_rng(seed)
    host, donor = (street_blocks(draw_town(k, side=40, buildings=14), Pavement(40, 40, 2))
                   for k in (seed, seed + 50))  # fmt: skip
    number = rng.choice(np.unique(host.labels))
    return Room.of(host, number, float(rng.choice([0, 0.25, 1])), int(rng.integers(2))), host, donor


@pytest.mark.parametrize("facades", [0.0, 0.25, 1.0])
@pytest.mark.parametrize("seed", range(6))
def test_rooms_against_their_naive_twin(seed, facades):
    host = street_blocks(draw_town(seed, side=40, buildings=14), Pavement(40, 40, 2))
    for number in np.unique(host.labels):
        room = Room.of(host, number, facades)
        corner, block, weights, density = naive.room(host.labels, host.built, number, facades)
        assert (room.top, room.left, room.density) == (*corner, density)
        assert np.array_equal(room.block, block)
        assert room.weights.tobytes() == weights.tobytes()
        assert not room.ring.any()


@pytest.mark.parametrize("itself", [False, True])
@pytest.mark.parametrize("seed", range(8))
def test_the_kernel_against_its_naive_twin(seed, itself):
    room, host, donor = a_room(seed)
    if itself:
        donor = host
    draws = np.random.default_rng(seed).random((8, 4))
    box = [room.top, room.left, room.top + room.block.shape[0], room.left + room.block.shape[1]]
    taken = np.array(box if itself else [0, 0, 0, 0])
    counts = 1 - np.random.default_rng(seed).random(donor.built.shape) * (seed % 2)
    stale = (donor.built * (1 - counts)).astype(np.float32)
    sums = np.zeros((2, 20, 11 + SPARE), np.float32)
    borders = np.pad(np.cumsum(donor.built - stale, axis=1), ((0, 0), (1, 0)))
    sums[0, :, :11], sums[1, :, :10] = borders[:, ::2], borders[:, 1::2]
    enough = 0.8 * (seed % 3)
    least = math.ceil(enough * room.density * room.area)
    iso, top, left, score = best_fit(
        sums, donor.components, donor.covered, stale, room.block, room.weights, room.density,
        least, 0.03, draws, isometries.AFFINE, taken,
    )  # fmt: skip
    twin = naive.best_fit(
        donor.built, donor.components, stale, room.block, room.weights, room.density, least,
        0.03, draws, taken,
    )  # fmt: skip
    assert (iso >= 0) == (twin is not None)
    if twin is None:
        return
    assert score == pytest.approx(twin.score, abs=1e-5)
    assert (iso, top, left) == twin.place
    fit = best_place(room, donor, stale, enough, 0.03, _Draws(draws), itself)
    assert ((fit.iso, fit.top, fit.left), fit.kept.tolist()) == (twin.place, twin.kept.tolist())


@pytest.mark.parametrize("shape", [(5, 7), (6, 8), (1, 1)])
def test_what_is_built_left_of_each_border(shape):
    rng = np.random.default_rng(shape)
    built, stale = rng.random(shape) < 0.6, rng.choice([0, 0.5], shape).astype(np.float32)
    stale[~built] = 0
    sums = np.zeros((2, shape[0], shape[1] // 2 + 1), np.float32)
    row_sums(built, stale, sums)
    for border in range(shape[1] + 1):
        left = (built - stale)[:, :border].sum(axis=1)
        assert np.array_equal(sums[border % 2, :, border // 2], left)


@pytest.mark.parametrize("seed", range(6))
def test_cells_are_laid_as_their_naive_twin_lays_them(seed):
    rng = np.random.default_rng(seed)
    rows, columns, cell = *rng.integers(1, 6, 2), int(rng.integers(1, 5))
    heights = rng.random((3, rows * cell, columns * cell)).astype(np.float32)
    whose, row, column, iso = (
        rng.integers(most, size=(rows, columns)) for most in (4, rows, columns, 8)
    )
    found = np.full(heights.shape[1:], -1, np.float32)
    lay_cells(heights, whose, row, column, iso.astype(np.uint8), isometries.AFFINE, cell, found)
    assert np.array_equal(found, naive.cells_laid(heights, whose, row, column, iso, cell))


@pytest.mark.parametrize("layout", LAYOUTS)
def test_stones_of_cells_are_those_of_their_pixels(layout):
    """A child of turned stones: each cell shows the square of the source that its pixels show."""
    parents, cell = towns(layout), 2 if layout == "leaves" else 4
    child = QuarterFusion(fill=0.5, density=0.1, repair=None)(parents, np.random.default_rng(3))
    assert np.unique(child.turn).size > 2
    found = np.empty((3, 96 // cell, 96 // cell), np.int32)
    row, column = unpacked(child.source)
    stones_of_cells(
        child.pavement.index, *child.pavement.corners, child.pavement.side, child.turn,
        child.parent.astype(np.int32), row, column, isometries.AFFINE, cell, found,
    )  # fmt: skip
    assert np.array_equal(found, naive.stones_of_cells(child, cell))


class _Draws:
    """A generator that draws what it was given."""

    def __init__(self, draws):
        self.draws = draws

    def random(self, shape):
        return np.resize(self.draws, shape)


@pytest.mark.parametrize("widened", [0.0, 8.0])
def test_fits_are_laid_as_their_views_show(widened):
    pair, rng = towns("leaves"), np.random.default_rng(1)
    grid = Pavement(96, 96, 2)
    options = {"spread": 0.03, "density": 0.1, "facades": 0.25, "repeats": 0.5}
    filling = Filling(pair, grid, **options, widened=widened)
    cells, turned = np.indices(filling.owner.shape), 0
    for number in filling.numbers(0.0):
        fit = filling.fit(number, 1, rng)
        if fit is None:
            continue
        room = filling._room(number)
        sources, bare = filling._sources.copy(), filling._bare.copy()
        counts = filling._origins.counts.copy()
        for axis in range(2):
            np.copyto(sources[axis][room.within], fit.view(cells[axis]), where=room.block)
        omitted = fit.view(filling._blocks[1].built) & ~fit.kept & room.block
        bare[room.within] |= room.ring | omitted
        np.add.at(counts, filling._origins.of[0][room.within][room.block | room.ring], -1)
        np.add.at(counts, fit.view(filling._origins.of[1])[fit.kept], 1)
        filling.lay(number, 1, fit)
        assert np.array_equal(filling._sources, sources)
        assert np.array_equal(filling._bare, bare)
        assert np.array_equal(filling._origins.counts, counts)
        assert (filling.owner[room.within][room.block | room.ring] == 1).all()
        assert (filling._iso[room.within][room.block] == fit.iso).all()
        turned += fit.iso > 0
    assert turned > 2


@pytest.mark.parametrize("seed", range(8))
def test_what_fits_is_whole_and_inside(seed):
    room, _, donor = a_room(seed)
    fit = best_place(room, donor, fresh(donor), 0.0, 0.03, np.random.default_rng(seed))
    if fit is None:
        return
    seen = fit.view(donor.components)
    assert seen.shape == room.block.shape
    assert not (fit.kept & ~room.block).any()
    for number in np.unique(seen[fit.kept]):
        assert np.count_nonzero(fit.kept & (seen == number)) == donor.covered[number]
    outside = np.unique(donor.components[~_window(donor.components, fit)])
    assert not np.isin(seen[fit.kept], outside).any()


def _window(raster, fit):
    tall, wide = isometries.apply(int(isometries.INVERSE[fit.iso]), fit.kept).shape
    window = np.zeros(raster.shape, bool)
    window[fit.top : fit.top + tall, fit.left : fit.left + wide] = True
    return window


def test_a_building_of_the_same_shape_is_found_wherever_it_stands_and_however_it_is_turned():
    shape = np.zeros((9, 12), bool)
    shape[1:8, 1:4] = shape[5:8, 1:11] = True
    host = np.zeros((40, 40))
    host[14:23, 12:24][shape] = 12
    for iso in range(8):
        turned = isometries.apply(iso, shape)
        donor = np.zeros((40, 40))
        donor[20 : 20 + turned.shape[0], 3 : 3 + turned.shape[1]][turned] = 12
        there, here = (cells_of(one) for one in (donor, host))
        # a donor as large as the block has one place; so the block is cut to what is built
        room = Room(14, 12, np.ones((9, 12), bool), np.zeros((9, 12), bool),
                    np.where(shape, 1, -1).astype(np.float32), float(shape.mean()))  # fmt: skip
        fit = best_place(room, there, fresh(there), 0.0, 0.0, np.random.default_rng(0))
        assert np.array_equal(fit.kept, shape)
        assert np.array_equal(fit.view(there.built), here.built[14:23, 12:24])


def test_weights_count_block_outline_and_facades():
    city = np.zeros((20, 20))
    city[4:12, 5:14] = 10
    city[7:9, 8:10] = 0  # a court is no street
    city[4:12, 18:] = 10
    host = cells_of(city)
    number = host.labels[5, 5]
    plain, lined = (Room.of(host, number, facades) for facades in (0, 0.5))
    block = plain.block
    assert plain.density == pytest.approx((8 * 9 - 4) / block.sum())
    # in all: 1 for the block, −2 for the outline, and the façades' gain is the street's loss
    assert plain.weights.sum() == pytest.approx(-1, abs=1e-5)
    assert lined.weights.sum() == pytest.approx(-1, abs=1e-5)
    gain = lined.weights - plain.weights
    own = host.built & (host.labels == number)
    assert ((gain > 0) <= own[plain.within]).all()
    assert np.count_nonzero(gain > 0) == 2 * (8 + 9) - 4
    assert (gain[7:9, 8:10] == 0).all()  # the court's ground
    assert gain[gain > 0].sum() == pytest.approx(0.5, abs=1e-5)


def test_the_maps_border_is_no_outline():
    city = np.zeros((16, 16))
    city[3:9, 3:9] = 10
    host = cells_of(city)
    room = Room.of(host, 1, 0.0)
    assert room.block.all()
    assert np.allclose(room.weights, 1 / 256)
    assert not Room.of(host, 1, 0.0, widened=2).ring.any()


def test_wider_streets_take_a_ring_of_the_block():
    city = np.zeros((20, 20))
    city[4:12, 2:7] = city[4:12, 13:18] = 10
    host = cells_of(city)
    room = Room.of(host, host.labels[5, 3], 0.0, widened=2)
    assert room.block.shape == (20, 10)
    assert np.array_equal(np.flatnonzero(room.ring.all(axis=0)), [8, 9])
    assert np.array_equal(room.block, ~room.ring)


def test_crumbs_have_no_block_and_are_in_one():
    city = draw_town(3, side=48, buildings=9).heights.copy()
    city[:, 22:30] = 0
    city[20:22, 25:27] = 8  # 16 m²
    labels = cells_of(city).labels
    large = cells_of(np.where(city == 8, 0, city)).labels
    assert len(np.unique(labels[20:22, 25:27])) == 1
    away = np.ones(labels.shape, bool)
    away[20:22, 25:27] = False
    assert len(np.unique(labels)) == len(np.unique(large[away]))


def test_what_is_larger_than_the_donor_fits_nowhere():
    donor = street_blocks(draw_town(3, side=24, buildings=5), Pavement(24, 24, 2))
    block = np.ones((13, 4), bool)
    room = Room(0, 0, block, ~block, np.full(block.shape, 1 / 52, np.float32), 0.5)
    assert best_place(room, donor, fresh(donor), 0.0, 0.0, np.random.default_rng(0)) is None


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


@pytest.mark.parametrize("layout", LAYOUTS)
def test_nothing_that_is_locked_is_laid_elsewhere(layout):
    """A tower locked in all parents stands where it is locked alone."""
    mask, heights = np.zeros((96, 96), bool), np.zeros((96, 96), np.float32)
    mask[36:60, 36:60] = True
    heights[40:56, 40:56] = 77
    held = Condensation(heights, mask)
    how = LAYOUTS[layout] | {"fit": False, "settle": False, "condensation": held}
    parents = [
        evocity.encode(draw_town(seed, side=96, buildings=22), **how).genome for seed in (31, 32)
    ]
    assert not any((decode(one).city.heights > 60)[~mask].any() for one in parents)
    fuse = QuarterFusion(fill=0.6, density=0.0, area_min=0)
    refill = QuarterRefill(street_blocks=6, density=0.0, area_min=0)
    changed = 0
    for seed in range(4):
        for operator in (fuse, refill):
            child = operator(parents[:: 1 if seed % 2 else -1], np.random.default_rng(seed))
            shown = decode(child).city.heights
            assert not (shown[~mask] > 60).any()
            assert (shown[mask] == heights[mask]).all()
            changed += child.made["street_blocks"]
    assert changed > 8


def test_what_stands_in_a_block_is_not_laid_there_again():
    """Siblings share most of their blocks, and exchange others all the same."""
    parents = towns(count=3)
    rng = np.random.default_rng(0)
    fuse = QuarterFusion(fill=0.4, density=0.1, area_min=0, repair=None)
    children = [fuse([parents[k % 3], parents[(k + 1) % 3]], rng) for k in range(6)]
    grid = Pavement(96, 96, 4)
    same = filled = 0
    for host, donor in [(0, 3), (3, 0), (1, 4), (4, 1), (2, 5), (5, 2), (0, 0), (1, 1)]:
        pair = [children[host], children[donor]]
        filling = Filling(pair, grid, spread=0.03, density=0.1, facades=0.25, repeats=0.5)
        before, built = Origins(pair[:1], grid).of[0], filling.host.built
        drawn = [n for n in filling.numbers(0.0) if filling.fill(n, 1, rng)]
        after = Origins([filling.genome()], grid).of[0]
        for number in drawn:
            here = (filling.host.labels == number) & built
            same += (after == before)[here].all()
        filled += len(drawn)
    assert filled > 40
    assert same < 0.05 * filled


def test_so_many_blocks_of_each_donor_as_its_share_says():
    parents = towns(count=3)
    fuse = QuarterFusion(
        fill=[0.0, 0.75, 0.25], street_blocks=8, density=0.0, area_min=0, repair=None
    )
    taken = np.zeros(3, int)
    for seed in range(3):
        draft = fuse.draft(parents, np.random.default_rng(seed))
        assert draft.made["street_blocks"] == 8
        reached = np.array(draft.made["fill_reached"])
        assert reached[1] > reached[2] > 0
        taken += (reached > 0).astype(int)
    assert (taken == 3).all()


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


@pytest.mark.parametrize("name", ODD)
def test_ends_well_on_any_map(name):
    odd = odd_maps()[name]
    other = town() if odd.pavement == town().pavement else odd
    for parents in ([odd, other], [other, odd], [odd, odd]):
        child = QuarterFusion(density=0, area_min=0)(parents, np.random.default_rng(0))
        assert decode(child).converged


@pytest.mark.parametrize("layout", LAYOUTS)
def test_stones_are_known_wherever_they_lie(layout):
    """Against what each pixel of a child shows, by the heights of the sources."""
    parents = towns(layout)
    grid = common_grid("test", parents, 0.0)
    child = QuarterFusion(fill=0.5, density=0.1, repair=None)(parents, np.random.default_rng(1))
    found = Origins([*parents, child], grid)
    cells = np.concatenate([one.ravel() for one in found.of[:2]])
    assert np.unique(cells).size == cells.size
    side = grid.block
    tops = [grid.blocks(raw_heights(parent)).max(axis=(1, 2)) for parent in parents]
    known = dict(zip(cells.tolist(), np.concatenate(tops).tolist(), strict=True))
    draft = QuarterFusion(fill=0.5, density=0.1).draft(parents, np.random.default_rng(1))
    meant = grid.blocks(draft.intended).max(axis=(1, 2)).reshape(found.of[2].shape)
    for stone, height in zip(found.of[2].ravel().tolist(), meant.ravel(), strict=True):
        assert height == (known[stone] if stone else 0)
    assert side == (2 if layout == "leaves" else 4)
    found.count(found.of[0], 1)
    every = np.ones(found.of[2].shape, bool)
    assert np.array_equal(found.stale(2, every, 1.0), np.isin(found.of[2], found.of[0]))
    assert not found.stale(2, ~every, 1.0).any()
    found.count(found.of[0], -1)
    assert not found.stale(2, every, 1.0).any()


def test_what_stands_already_is_seldom_laid_again():
    once = {}
    for repeats in (0.0, 1.0):
        rng = np.random.default_rng(0)
        child, *others = towns(count=3)
        refill = QuarterRefill(
            street_blocks=6, area_min=0, density=0.2, repeats=repeats, repair=None
        )
        for _ in range(6):
            child = refill([child, *others], rng)
        stones = Origins([child], Pavement(96, 96, 4)).of[0]
        built = stones[street_blocks(decode(child).city, Pavement(96, 96, 4)).built]
        once[repeats] = np.unique(built).size / built.size
    assert once[1.0] > once[0.0] + 0.1


@pytest.mark.parametrize("layout", LAYOUTS)
@settings(max_examples=6, deadline=None)
@given(seed=st.integers(0, 2**32), count=st.integers(1, 5))
def test_so_many_street_blocks_are_filled(layout, seed, count):
    parents = towns(layout)
    options = {"street_blocks": count, "density": 0.1, "area_min": 0}
    child = QuarterFusion(**options)(parents, np.random.default_rng(seed))
    assert child.made["street_blocks"] == count
    assert sum(child.made["fill_reached"]) == pytest.approx(1, abs=1e-3)
    refilled = QuarterRefill(**options, repair=None)(parents, np.random.default_rng(seed))
    assert refilled.made["street_blocks"] == sum(refilled.made["filled_by"]) == count
    assert integrity_of(refilled, [decode(parent).city for parent in parents]) == 1


def test_a_lone_parent_is_refilled_with_its_own_buildings():
    (parent,) = towns(count=1)
    changed = 0
    for seed in range(4):
        operator = QuarterRefill(density=0.1, repair=None)
        child = operator([parent], np.random.default_rng(seed))
        assert set(child.cities) <= {*parent.cities, VOID}
        assert integrity_of(child, [decode(parent).city]) == 1
        changed += child != parent
    assert changed == 4


def test_the_void_empties_blocks():
    parents = towns()
    operator = QuarterFusion(fill=(0.6, 0, 0.4), void=True)
    draft = operator.draft(parents, np.random.default_rng(2))
    blocks = street_blocks(decode(parents[0]).city, Pavement(96, 96, 4))
    apart = draft.intended != raw_heights(parents[0])
    assert not draft.intended[apart].any()
    emptied = np.unique(blocks.labels.repeat(4, 0).repeat(4, 1)[apart])
    assert emptied.size == draft.made["street_blocks"]
    assert draft.made["fill_reached"][2] == pytest.approx(0.4, abs=0.1)


def test_wider_streets_stay_free():
    parents = towns()
    host = street_blocks(decode(parents[0]).city, Pavement(96, 96, 4))
    options = {"fill": 1.0, "density": 0.05, "area_min": 0, "repair": None}
    narrow, wide = (
        QuarterFusion(**options, widened=metres).draft(parents, np.random.default_rng(1))
        for metres in (0.0, 8.0)
    )
    taken = np.zeros((24, 24), bool)
    for down, along in ((0, 1), (1, 0)):
        ahead = host.labels[down:, along:], host.labels[: 24 - down, : 24 - along]
        border = ahead[0] != ahead[1]
        taken[down:, along:] |= border
        taken[: 24 - down, : 24 - along] |= border
    own = np.array([city == parents[0].cities[0] for city in wide.genome.cities])
    mine = wide.genome.pavement.raster(own[wide.genome.parent])
    beside = taken.repeat(4, 0).repeat(4, 1) & ~mine
    assert beside.any()
    assert not wide.intended[beside].any()
    assert (wide.intended > 0).sum() < (narrow.intended > 0).sum()


def test_bare_or_built_all_over_nothing_is_exchanged():
    bare = uniformly(CityMap(np.zeros((64, 64)), 2.0, name="bare")).genome
    full = uniformly(CityMap(np.full((64, 64), 9.0), 2.0, name="full")).genome
    some = uniformly(draw_town(5, side=64)).genome
    for parents in ([bare, some], [some, bare], [full, some], [some, full]):
        assert QuarterFusion()(parents, np.random.default_rng(0)) == parents[0]


def test_all_faults_are_told_at_once():
    wrong = {
        "area_min": -1,
        "spread": -0.1,
        "density": -1,
        "facades": 11,
        "widened": -2,
        "repeats": 2,
    }
    wrong["street_blocks"] = 0
    with pytest.raises(OperatorError) as caught:
        QuarterFusion(fill=2, **wrong)
    assert set(caught.value.faults) == {"fill", *wrong}
    with pytest.raises(OperatorError) as caught:
        QuarterRefill(**wrong)
    assert set(caught.value.faults) == set(wrong)
    with pytest.raises(OperatorError, match="one share for each of 3 parents"):
        QuarterFusion(fill=(0.5, 0.5))(towns(count=3), np.random.default_rng(0))
    with pytest.raises(OperatorError, match="one share for each of 2 parents and the void"):
        QuarterFusion(fill=(0.5, 0.5), void=True)(towns(), np.random.default_rng(0))


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
    assert len(births) == 3 + 12  # of the first population, and of two generations
    assert {one["status"] for one in births} == {"ok"}
    whole = [one["fitness.integrity"] for one in run.births().to_pylist()[:2]]
    assert min(whole) == 1
    assert VOID in run.header.cities
    assert any(run.genome(one["id"]).made["street_blocks"] for one in births)


def test_a_run_refills_from_its_sources(tmp_path):
    for seed in (41, 42):
        np.save(tmp_path / f"{seed}.npy", draw_town(seed, side=96, buildings=22).heights)
    recipe = tmp_path / "refill.toml"
    recipe.write_text("""
    run = { seed = 5, population = 8, generations = 1 }
    map = { pixels = 96, metres_per_pixel = 2.0 }
    parents = [{ map = "41.npy" }, { map = "42.npy" }]
    genome = { fit = false }
    fitness = [{ name = "gsi", target = 0.4 }]
    [operators.quarter_refill]
    street_blocks = { from = 2, to = 4 }
    density = 0.1
    """)
    with evocity.Search(evocity.read_recipe(recipe), out=tmp_path / "run", workers=0) as search:
        for _ in search:
            pass
    births = evocity.open_run(tmp_path / "run").births(columns=["operator", "parents", "status"])
    births = births.to_pylist()
    assert {one["status"] for one in births} == {"ok"}
    # the fusions of the first population are the former ones where the mixture has none
    assert {one["operator"] for one in births[:8]} == {
        "source",
        "pavement_fusion",
        "quarter_refill",
    }
    for one in births[8:]:
        assert one["operator"] == "quarter_refill"
        assert one["parents"][1:] == [0, 1]
