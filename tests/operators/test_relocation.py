"""Relocation: groups go elsewhere, their inner domain blocks with them, and no seam is seen."""

import dataclasses
from functools import cache

import naive
import numpy as np
import pytest
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from rearranged import ODD, assert_laws, district, odd_maps, town
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode, encode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.fitness.heredity import integrity_of, whole_buildings
from evocity.genome import Genome, unpacked
from evocity.operators.grid import swaps_axes, turn_places
from evocity.operators.groups import Rearrangement, square
from evocity.operators.rearrangements import Relocation

VARIANTS = [
    Relocation(),
    Relocation(mode="copy"),
    Relocation(shape="square", size_max=6, count=3),
    Relocation(mode="copy", shape="square", size_min=1, tolerance=None, change=0),
]
TURNED = [dataclasses.replace(operator, isometries=True) for operator in VARIANTS]
KEPT = ("sigma", "beta", "dx", "dy", "iso", "parent")


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
@settings(max_examples=5, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, seed):
    parent = town()
    child = assert_laws(operator, parent, seed)
    if operator.mode == "move":
        assert np.array_equal(np.sort(stones(child)), np.arange(len(parent)))
    draft = operator.draft([parent], np.random.default_rng(seed))
    code, heights = draft.genome, decode(parent).city.heights
    for name in KEPT:
        assert np.array_equal(getattr(code, name), getattr(parent, name)[stones(code)])
    assert ((code.x - parent.x[stones(code)]) % 4 == 0).all()
    assert ((code.y - parent.y[stones(code)]) % 4 == 0).all()
    pavement = parent.pavement
    wanted = pavement.raster(pavement.blocks(heights)[stones(code)])
    assert np.array_equal(draft.intended, wanted)


def domain_blocks(genome, lifs: int) -> list[tuple[int, int]]:
    b = genome.pavement.block
    rows = range(genome.y[lifs] // b, -(-(genome.y[lifs] + genome.dy[lifs]) // b))
    columns = range(genome.x[lifs] // b, -(-(genome.x[lifs] + genome.dx[lifs]) // b))
    return [(i, j) for i in rows for j in columns]


@pytest.mark.parametrize("shape", ["square", "buildings"])
@pytest.mark.parametrize("mode", ["move", "copy"])
def test_domain_blocks_inside_a_group_go_with_it_and_no_others(mode, shape):
    operator = Relocation(
        mode=mode, shape=shape, count=1, size_min=4, size_max=7, tolerance=None, change=0
    )
    parent = uniformly(draw_town(2, side=96, buildings=16), reach=12).genome
    columns = parent.pavement.columns
    carried = kept = 0
    for seed in range(6):
        code = operator.draft([parent], np.random.default_rng(seed)).genome
        gone = {}  # block of the parent -> how far it, or its copy, went
        for place in np.flatnonzero(stones(code) != np.arange(len(parent))):
            row, column = divmod(stones(code)[place], columns)
            gone[row, column] = place // columns - row, place % columns - column
        assert gone
        for place, stone in enumerate(stones(code)):
            ways = {gone.get(one, (0, 0)) for one in domain_blocks(parent, stone)}
            down, along = ways.pop() if len(ways) == 1 else (0, 0)
            if mode == "copy" and place == stone:
                down, along = 0, 0  # what has not come calls what it called
            assert code.y[place] == parent.y[stone] + 4 * down
            assert code.x[place] == parent.x[stone] + 4 * along
            carried += (down, along) != (0, 0)
            kept += place != stone and not parent.uniform[stone] and (down, along) == (0, 0)
    assert carried
    assert kept


def test_a_group_of_its_own_kind_needs_no_repair():
    """Two houses far apart whose lifs call their own domain blocks: they come out elsewhere as
    they were, code alone."""
    heights = np.zeros((64, 64), np.float32)
    rng = np.random.default_rng(0)
    for y, x in ((10, 10), (42, 42)):
        heights[y : y + 16, x : x + 16] = 3 * rng.integers(1, 6, (4, 4)).repeat(4, 0).repeat(4, 1)
    parent = uniformly(CityMap(heights, 2.0), reach=4).genome
    before = decode(parent).city.heights
    moves = Rearrangement(parent, "test")
    moves.exchange(square(8), np.array([0, 0]), np.array([8, 8]), carried=True)
    draft = moves.draft({})
    assert not np.allclose(draft.intended, before, atol=1)
    assert np.abs(decode(draft.genome).city.heights - draft.intended).max() < 0.1


# -- turned ------------------------------------------------------------------------------------


def shown(parent: Genome, code: Genome, heights: np.ndarray) -> np.ndarray:
    """The map that a ``code`` of one city shows: of every lifs its stone, turned."""
    found = np.empty_like(heights)
    row, column = unpacked(code.source)
    for i, (y, x, s) in enumerate(zip(*code.pavement.corners, code.pavement.side, strict=True)):
        stone = heights[row[i] : row[i] + s, column[i] : column[i] + s]
        found[y : y + s, x : x + s] = isometries.apply(int(code.turn[i]), stone)
    return found


@cache
def on_leaves() -> Genome:
    how = {"block": (2, 16), "lifs": 400, "fit": False, "settle": False}
    return encode(draw_town(2, side=96, buildings=16), **how).genome


@pytest.mark.parametrize("operator", TURNED, ids=str)
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_what_is_turned_shows_its_stones_turned(operator, seed):
    for parent in (town(), on_leaves()):
        operator = dataclasses.replace(operator, size_min=None, size_max=None, side_max=64.0)
        assert_laws(operator, parent, seed)
        draft = operator.draft([parent], np.random.default_rng(seed))
        heights = np.maximum(decode(parent).attractor, 0)
        assert np.array_equal(draft.intended, shown(parent, draft.genome, heights))
        pixels = np.sort(
            shown(parent, draft.genome, np.arange(heights.size).reshape(heights.shape))
        )
        if operator.mode == "move":
            assert np.array_equal(np.unique(pixels), np.arange(heights.size))


def test_every_isometry_is_laid():
    found = set()
    for seed in range(12):
        operator = Relocation(isometries=True, tolerance=None, change=0, shape="square")
        found |= set(operator.draft([town()], np.random.default_rng(seed)).genome.turn.tolist())
    assert found == set(range(8))


@pytest.mark.parametrize("iso", range(8))
def test_places_are_turned_as_the_blocks_are(iso):
    table = np.arange(15).reshape(3, 5)
    row, column = turn_places(np.indices((3, 5)).reshape(2, -1), (3, 5), iso)
    turned = isometries.apply(iso, table)
    assert turned.shape == ((5, 3) if swaps_axes(iso) else (3, 5))
    assert np.array_equal(turned[row, column], np.arange(15))


@pytest.mark.parametrize("mode", ["move", "copy"])
@pytest.mark.parametrize("iso", range(8))
def test_a_turned_group_of_its_own_kind_needs_no_repair(iso, mode):
    """Two houses on ground, whose lifs call their own domain blocks: laid turned, they come out as
    they were, code alone; also where rows become columns."""
    heights = np.zeros((64, 96), np.float32)
    rng = np.random.default_rng(0)
    for y, x, tall, wide in ((8, 8, 16, 24), (36, 60, 24, 16)):
        plots = 3 * rng.integers(1, 6, (tall // 4, wide // 4))
        heights[y : y + tall, x : x + wide] = plots.repeat(4, 0).repeat(4, 1)
    parent = uniformly(CityMap(heights, 2.0), reach=4).genome
    group = np.indices((6, 8)).reshape(2, -1)  # rows × columns of the first house's ground
    end = np.array([8, 14]) if swaps_axes(iso) else np.array([9, 14])
    moves = Rearrangement(parent, "test")
    lay = moves.copy if mode == "copy" else moves.exchange
    lay(group, np.array([1, 1]), end, carried=True, iso=iso)
    draft = moves.draft({})
    before = decode(parent).city.heights
    window = np.s_[4 * end[0] : 4 * end[0] + (32 if swaps_axes(iso) else 24)]
    across = np.s_[4 * end[1] : 4 * end[1] + (24 if swaps_axes(iso) else 32)]
    laid = isometries.apply(iso, before[4:28, 4:36])
    assert np.array_equal(draft.intended[window, across], laid)
    gave = isometries.apply(isometries.INVERSE[iso], before[window, across])
    assert np.array_equal(
        draft.intended[4:28, 4:36], gave if mode == "move" else before[4:28, 4:36]
    )
    error = np.abs(decode(draft.genome).attractor - draft.intended)
    assert error[window, across].max() < 0.1


def test_turned_buildings_count_as_whole():
    parent = district("new-york-west-village", 256)
    maps = [decode(parent).city]
    operator, found = Relocation(isometries=True, repair=None), []
    for seed in range(4):
        child = operator([parent], np.random.default_rng(seed))
        found.append(integrity_of(child, maps))
        whole = whole_buildings(child, maps)
        for k in np.flatnonzero(whole.iso > 0)[:20]:
            mask = whole.labels == k + 1
            rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            here = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
            own = np.argwhere(maps[0].building_labels == whole.building[k])
            (top, left), (bottom, right) = own.min(axis=0), own.max(axis=0) + 1
            stands = maps[0].building_labels[top:bottom, left:right] == whole.building[k]
            assert np.array_equal(here, isometries.apply(int(whole.iso[k]), stands))
        assert (whole.iso > 0).any()
    assert np.mean(found) > 0.9


# -- real districts ------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "cape-town-salt-river"])
@pytest.mark.parametrize("mode", ["move", "copy"])
def test_real_districts_change_visibly_and_without_a_seam(name, mode):
    parent, operator = district(name, 256), Relocation(mode=mode, repair=None)
    before = decode(parent).city.heights
    made, changed = [], []
    for seed in range(6):
        draft = operator.draft([parent], np.random.default_rng(seed))
        made.append(draft.made["relocated"])
        changed.append((np.abs(draft.intended - before) > 2).mean())
    assert np.mean(made) >= 1.5
    assert np.mean(changed) > 0.02


@pytest.mark.parametrize("seed", range(4))
def test_outlines_step_by_the_tolerance_at_most(seed):
    parent = district("new-york-west-village", 128)
    operator = Relocation(count=1, size_min=2, size_max=10, tolerance=3.0, change=1.0)
    code = operator.draft([parent], np.random.default_rng(seed)).genome
    columns = parent.pavement.columns
    (places,) = np.nonzero(stones(code) != np.arange(len(parent)))
    assert places.size
    there = np.stack(np.divmod(places, columns))
    offsets = np.stack(np.divmod(stones(code)[places], columns)) - there
    group = there[:, (offsets == offsets[:, :1]).all(axis=0)]
    corner = group.min(axis=1)
    blocks = parent.pavement.blocks(decode(parent).city.heights)
    for start, end in ((corner + offsets[:, 0], corner), (corner, corner + offsets[:, 0])):
        step = naive.outline_step(blocks, blocks, columns, group - corner[:, None], start, end)
        assert step <= 3 + 1e-6


@pytest.mark.parametrize("mode", ["move", "copy"])
def test_buildings_that_are_moved_are_not_cut(mode):
    for name in ("new-york-west-village", "lyon-1er"):
        parent = district(name, 256)
        labels = decode(parent).city.labels
        for seed in range(4):
            operator = Relocation(mode=mode, count=1, repair=None)
            code = operator.draft([parent], np.random.default_rng(seed)).genome
            arrived = np.flatnonzero(stones(code) != np.arange(len(parent)))
            if not arrived.size:
                continue
            offsets = stones(code)[arrived] - arrived
            whole = []
            for way in np.unique(offsets):
                group = np.zeros(len(parent), bool)
                group[stones(code)[arrived[offsets == way]]] = True
                inside = parent.pavement.raster(group)
                held = np.unique(labels[inside & (labels > 0)])
                whole.append(not np.isin(labels[~inside], held).any())
            assert any(whole)  # the group's own way; the other is that of what gave way
            assert mode == "move" or all(whole)


def test_relocated_buildings_count_as_whole():
    parent = district("new-york-west-village", 256)
    maps = [decode(parent).city]
    cut, whole = (
        np.mean(
            [integrity_of(moving([parent], np.random.default_rng(seed)), maps) for seed in range(3)]
        )
        for moving in (Relocation(shape="square"), Relocation(shape="buildings"))
    )
    assert whole > 0.9
    assert whole > cut


def test_copies_leave_the_group_where_it_is():
    parent = town()
    code = (
        Relocation(mode="copy", shape="square", tolerance=None, change=0, count=1)
        .draft([parent], np.random.default_rng(1))
        .genome
    )
    copies = np.flatnonzero(stones(code) != np.arange(len(parent)))
    assert copies.size
    assert (stones(code)[stones(code)[copies]] == stones(code)[copies]).all()


def test_what_is_not_admissible_stays():
    for impossible in ({"change": 1000.0}, {"tolerance": 0.0, "change": 5.0}):
        child = Relocation(**impossible)([town()], np.random.default_rng(0))
        assert child == town()
        assert child.made["relocated"] == 0


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("mode", ["move", "copy"])
@pytest.mark.parametrize("shape", ["square", "buildings"])
def test_ends_well_on_any_map(name, mode, shape):
    for turned in (False, True):
        operator = Relocation(mode=mode, shape=shape, size_max=99, isometries=turned)
        child = assert_laws(operator, odd_maps()[name], 0)
        if name in ("empty", "one roof"):
            assert child.made["relocated"] == 0


def test_faults_are_told():
    with pytest.raises(OperatorError, match="mode = 'jump', shape = 'round'"):
        Relocation(mode="jump", shape="round")
    with pytest.raises(OperatorError, match="move or copy"):
        Relocation(mode="jump")


@pytest.mark.parametrize("mode", ["move", "copy"])
@pytest.mark.parametrize("turned", [False, True])
def test_what_is_locked_is_laid_nowhere_else(mode, turned):
    mask, heights = np.zeros((96, 96), bool), np.zeros((96, 96), np.float32)
    mask[40:52, 40:52] = True
    heights[42:50, 42:50] = 77
    town = draw_town(31, side=96, buildings=22)
    parent = evocity.encode(
        town, block=4, fit=False, condensation=Condensation(heights, mask)
    ).genome
    move = Relocation(mode=mode, isometries=turned, count=6, side_min=24, side_max=48)
    moved = 0
    for seed in range(6):
        child = move([parent], np.random.default_rng(seed))
        assert not (decode(child).city.heights > 60)[~mask].any()
        moved += child.made["relocated"]
    assert moved > 6
