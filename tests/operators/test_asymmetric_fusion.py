"""Pairing by content, and the fusion that gives one city the stones of another."""

import naive
import numpy as np
import pytest
from codes import stones, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import NUCLEOTIDES, Genome, laid
from evocity.operators import with_older_values
from evocity.operators.content_fusion import AsymmetricFusion
from evocity.operators.pairing import (
    _closest_level,
    _group_blocks,
    _traits,
    level_cells,
    mosaic,
    pair_blocks,
    pair_cells,
    pieces_of,
    squares,
)
from evocity.operators.pairing._kernels import LANES, alike_blocks, square_costs
from evocity.operators.pairing.squares import pair_squares
from evocity.pavement import Pavement
from evocity.recipe.reader import recipe_of
from evocity.towns.patterns import chessboard_town, concentric_town


def generator() -> np.random.Generator:
    return np.random.default_rng(0)


def map_of(genome: Genome) -> np.ndarray:
    return decode(genome).city.heights


def level_of(genome: Genome) -> np.ndarray:
    """Range blocks of the genome that are level and coded so."""
    pavement = genome.pavement
    cut = pavement.blocks(map_of(genome)).reshape(len(pavement), -1)
    return level_cells(pavement, genome, cut)


def town_of(heights, name: str) -> CityMap:
    return CityMap(np.asarray(heights, np.float32), 2.0, name=name, attribution=f"by {name}")


@pytest.fixture(scope="module")
def genomes() -> list[Genome]:
    return [uniformly(draw_town(seed)).genome for seed in (1, 2)]


# -- pairing ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("block", "count", "turns"), [(2, 70, 8), (3, 40, 1), (4, 33, 8), (5, 1, 1)]
)
@pytest.mark.parametrize("slack", [0, 1.7, 60])
def test_kernel_against_its_naive_twin(block, count, turns, slack):
    rng = np.random.default_rng(block)
    ours, others = rng.integers(0, 9, (2, 80, block, block)).astype("f4")
    ours = ours[:50]
    ours[::7], others[::5] = 4, others[0]  # level blocks, and blocks alike
    others = others[:count]
    members = np.sort(rng.choice(90, count, replace=False))
    here = rng.choice(90, 50, replace=False)
    flat, flat_here = rng.integers(0, 30, 50).astype("f4"), rng.random(50) < 0.5
    flat[::4] = np.inf
    images = np.stack([isometries.apply(k, others) for k in range(turns)])
    flat[1::4] = ((ours[1::4, None, None] - images) ** 2).sum(axis=(3, 4)).min(axis=(1, 2))
    keys, found = np.empty((50, 8), np.int64), np.empty(50, np.int64)
    traits = _traits(ours.reshape(50, -1))
    assert traits == pytest.approx(naive.block_traits(ours.reshape(50, -1)), rel=1e-5, abs=1e-5)
    groups = _group_blocks(members, others.reshape(count, -1))
    assert groups[0].shape[1] % LANES == 0
    images = isometries.sources(block)[:turns].astype(np.int64)
    alike_blocks(
        ours.reshape(50, -1), here, traits, flat, flat_here, *groups, images,
        np.float32(slack), keys, found,
    )  # fmt: skip
    truth = naive.alike_blocks(ours, here, flat, flat_here, others, members, turns, slack, 8)
    assert [sorted(line[:k].tolist()) for line, k in zip(keys, found, strict=True)] == truth
    assert any(truth) or slack == 0
    assert [] in truth
    assert [] in truth[1::4] != [[]] * len(truth[1::4])  # ties go either way


def test_the_closest_level_is_that_of_the_most_like_flat_block():
    rng = np.random.default_rng(5)
    levels = rng.integers(0, 30, 40).astype("f4")
    levels[-3] = 12  # and two levels next to it
    levels[-2] = np.nextafter(levels[-3], np.float32(13))
    levels[-1] = np.nextafter(levels[-2], np.float32(13))
    theirs = levels.repeat(16).reshape(40, 16)
    flat = rng.random(40) < 0.6
    flat[-3:] = True
    blocks = np.concatenate([rng.random((30, 16)) * 30, theirs[-10:]]).astype("f4")
    here = np.arange(40)
    index, gap = _closest_level(_traits(blocks), theirs, flat, here)
    every = ((blocks[:, None] - theirs[None, flat]) ** 2).sum(axis=2)
    assert gap == pytest.approx(every.min(axis=1), rel=1e-4, abs=1e-6)
    assert flat[index].all()
    own = flat & (np.arange(40) >= 30)
    assert np.array_equal(index[own], here[own])  # level blocks stand where they stood
    nothing, far = _closest_level(_traits(blocks), theirs, np.zeros(40, bool), here)
    assert np.array_equal(nothing, here)
    assert np.isinf(far).all()


@pytest.mark.parametrize("turned", [False, True])
def test_no_block_is_closer_than_the_paired_one(genomes, turned):
    pavement = genomes[0].pavement
    maps = [map_of(genome) for genome in genomes]
    ours, theirs = (pavement.blocks(heights).astype(float) for heights in maps)
    everywhere = np.arange(len(pavement))
    flat = level_of(genomes[1])
    index, iso = pair_blocks(*maps, pavement, flat, everywhere, isometries=turned)
    images = np.stack([isometries.apply(k, theirs) for k in range(8 if turned else 1)])
    rms = np.sqrt(((ours[:, None, None] - images) ** 2).mean(axis=(3, 4)))
    assert (rms[everywhere, iso, index] <= rms.min(axis=(1, 2)) + 0.01 + 1e-4).all()
    assert rms.min() < rms[everywhere, iso, index].max()
    some = everywhere[::3]
    part = pair_blocks(*maps, pavement, flat, some, isometries=turned)
    assert np.array_equal(part, (index[some], iso[some]))


def test_surroundings_decide_among_equal_contents():
    courtyard, street = np.zeros((2, 12, 12))
    courtyard[:6], street[:6] = 9, 9
    courtyard[10:] = 9  # the same wall, but something stands opposite
    pavement = Pavement(12, 24, 4)
    both = np.concatenate([courtyard, street], axis=1).astype("f4")
    flat = np.zeros(len(pavement), bool)
    walls = np.arange(6, 12)  # the middle row
    index, _ = pair_blocks(np.roll(both, 12, axis=1), both, pavement, flat, walls, alike=0.01)
    assert np.array_equal(index >= 9, [True, True, True, False, False, False])
    index, _ = pair_blocks(both, both, pavement, flat, walls)
    assert np.array_equal(index, walls)


def test_a_turned_city_is_found_under_isometries_alone():
    city = draw_town(3)
    first, second = (
        uniformly(town_of(heights, name)).genome
        for heights, name in ((np.rot90(city.heights), "turned"), (city.heights, "city"))
    )
    how = {"side": 0.0, "repair": None}
    turned = AsymmetricFusion(isometries=True, **how).draft([first, second], generator())
    plain = AsymmetricFusion(**how).draft([first, second], generator())
    truth = np.rot90(map_of(second))
    errors = [np.sqrt(np.mean((map_of(first) - one.intended) ** 2)) for one in (turned, plain)]
    assert errors[0] < 0.5 * errors[1]
    coded = np.sqrt(np.mean((map_of(first) - truth) ** 2))
    assert errors[0] <= coded


# -- pairing of squares ------------------------------------------------------------------------


def test_kernel_of_squares_against_its_naive_twin():
    rng = np.random.default_rng(3)
    heights = rng.random((24, 32)).astype("f4")
    phases = np.ascontiguousarray(heights.reshape(6, 4, 8, 4).transpose(1, 3, 0, 2))
    patch, weight = rng.random((2, 12, 12)).astype("f4")
    weight[::3] = 0
    costs = np.zeros((4, 6), "f4")
    square_costs(phases, patch, weight, costs)
    assert costs == pytest.approx(naive.square_costs(heights, patch, weight, 4), rel=1e-5)


@settings(max_examples=6, deadline=None)
@given(
    seeds=st.tuples(st.integers(0, 99), st.integers(0, 99)),
    count=st.sampled_from([1, 2, 3, 5, 8]),
    turned=st.booleans(),
)
def test_squares_are_the_cheapest_of_all(seeds, count, turned):
    grid = Pavement(16, 24, 4)
    maps = [draw_town(seed, side=24, buildings=6).heights[:16] for seed in seeds]
    index, iso = pair_squares(grid, maps, count, turned=turned, alike=0.0)
    assert iso.max() < (8 if turned else 1)
    truth = naive.pair_squares(grid, maps, count, turned, index, iso)
    for chosen, least in truth:
        assert chosen <= least + 1e-3 * (1 + least)


@pytest.mark.parametrize(("most", "stride"), [(24, 1), (6, 2), (3, 3)])
@pytest.mark.parametrize("turned", [False, True])
def test_squares_of_large_maps_begin_on_a_lattice(monkeypatch, most, stride, turned):
    monkeypatch.setattr(squares, "MOST_PLACES", most)
    grid = Pavement(16, 24, 4)
    maps = [draw_town(seed, side=24, buildings=6).heights[:16] for seed in (5, 6)]
    for count in (2, 3):
        index, iso = pair_squares(grid, maps, count, turned=turned, alike=0.0)
        truth = naive.pair_squares(grid, maps, count, turned, index, iso, stride)
        for chosen, least in truth:
            assert chosen <= least + 1e-3 * (1 + least)
        index, _ = pair_squares(grid, [maps[0]] * 2, count, turned=turned)
        assert np.array_equal(index, np.arange(len(grid)))  # its own place is always among them


@pytest.mark.slow_cases("4")
@pytest.mark.parametrize("block", [4, 8])
def test_a_town_in_the_squares_of_another_is_neither(block):
    # the towns and the share of docs/sheets/asymmetric_fusion.py and of issue T
    towns = [draw(256, 1.0) for draw in (concentric_town, chessboard_town)]
    parents = [uniformly(town, block=block).genome for town in towns]
    for frame, other in ((0, 1), (1, 0)):
        child = AsymmetricFusion()([parents[frame], parents[other]], generator())
        ours, framed, others = map(map_of, (child, parents[frame], parents[other]))
        assert (np.abs(ours - framed) > 1.5).mean() >= 0.25
        assert (np.abs(ours - others) > 1.5).mean() >= 0.25
        # repair goes to the picture of the pairs, not back to the frame
        intended = AsymmetricFusion().draft([parents[frame], parents[other]], generator()).intended
        far, near = (np.abs(ours - one).mean() for one in (framed, intended))
        assert near < 0.35 * far
        # and it is a picture of the plan: it resembles its own frame more than any shifted one
        shifted = np.roll(framed, 128, axis=(0, 1))
        alike = [np.corrcoef(ours.ravel(), one.ravel())[0, 1] for one in (framed, shifted)]
        assert alike[0] > alike[1]


def test_recipes_and_logs_without_squares_pair_single_blocks(genomes, tmp_path):
    assert with_older_values("asymmetric_fusion", {"alike": 1}) == {"side": 0.0, "alike": 1}
    assert with_older_values("asymmetric_fusion", {"side": "none"}) == {"side": "none"}
    assert with_older_values("mutation", {}) == with_older_values("nobody", {}) == {}
    recipe = recipe_of(
        "[[parents]]\nmap = 'lyon-1er'\n[[parents]]\nmap = 'new-york-west-village'\n"
        "[[fitness]]\nname = 'gsi'\ngoal = 'max'\n[operators]\nasymmetric_fusion = 1\n",
        tmp_path, {}, "a recipe",
    )  # fmt: skip
    assert recipe.operator("asymmetric_fusion").side == 0
    assert recipe.operator("symmetric_fusion").share == 0.5


# -- the operator ----------------------------------------------------------------------------


@settings(max_examples=8, deadline=None)
@given(
    isometries=st.booleans(),
    alike=st.sampled_from([0, 0.01, 2.0]),
    repair=st.sampled_from([None, 0.5]),
    seed=st.integers(0, 50),
    block=st.sampled_from([2, 4, 8]),
    side=st.sampled_from([None, 0.0, 24.0, 1e4]),
)
def test_a_city_in_its_own_stones_is_itself(isometries, alike, repair, seed, block, side):
    genome = uniformly(draw_town(seed, side=32, buildings=12), block=block).genome
    fusion = AsymmetricFusion(isometries, alike, side, repair=repair)
    child = fusion([genome, genome], generator())
    assert child == genome
    assert np.array_equal(stones(child), stones(genome))


@pytest.mark.parametrize("side", [0.0, None])
@pytest.mark.parametrize("turned", [False, True])
def test_every_lifs_is_that_of_its_source_turned_at_most(genomes, turned, side):
    first, second = genomes
    fuse = AsymmetricFusion(isometries=turned, repair=None, side=side)
    draft = fuse.draft(genomes, generator())
    child = draft.genome
    assert {child.cities[p] for p in child.parent} == {second.cities[0]}
    for name in NUCLEOTIDES:
        same = getattr(child, name) == getattr(second, name)[stones(child)]
        assert same.all() if name != "iso" or not turned else 0 < same.mean() < 1
    content = first.pavement.blocks(map_of(second))
    laid = first.pavement.blocks(draft.intended)
    back = isometries.COMPOSITION[child.iso, isometries.INVERSE[second.iso[stones(child)]]]
    for i in np.flatnonzero(~child.uniform):
        assert np.array_equal(laid[i], isometries.apply(int(back[i]), content[stones(child)[i]]))
    flat = child.uniform
    assert np.array_equal(laid[flat], content[stones(child)[flat]])


def test_the_order_of_the_parents_says_whose_plan_it_is(genomes):
    maps = [map_of(genome) for genome in genomes]
    for order in ([0, 1], [1, 0]):
        child = AsymmetricFusion(side=0.0)([genomes[i] for i in order], generator())
        decoded = map_of(child)
        near, far = (np.sqrt(np.mean((decoded - maps[i]) ** 2)) for i in order)
        assert near < 0.5 * far
        assert child.cities == tuple(genomes[i].cities[0] for i in order)
        assert set(child.attribution.split("; ")) == {"drawn by seed 1", "drawn by seed 2"}
        assert child.made["distance"] == pytest.approx(near, abs=0.3)


def test_repair_brings_the_child_to_the_mosaic(genomes):
    mosaic = AsymmetricFusion().draft(genomes, generator()).intended
    errors = [
        np.abs(map_of(AsymmetricFusion(repair=repair)(genomes, generator())) - mosaic).mean()
        for repair in (None, 0.5)
    ]
    assert errors[1] < 0.2 * errors[0]


def test_provenance_reaches_back_over_generations(genomes):
    first, second = genomes
    child = AsymmetricFusion(repair=None)([first, second], generator())
    third = uniformly(draw_town(9)).genome
    grandchild = AsymmetricFusion(repair=None)([third, child], generator())
    assert grandchild.cities[:1] == third.cities
    assert {grandchild.cities[p] for p in grandchild.parent} == set(second.cities)
    assert np.array_equal(grandchild.sigma, second.sigma[stones(grandchild)])


@pytest.mark.parametrize("bare", [0, 1])
def test_a_bare_city_has_but_one_stone(genomes, bare):
    parents = [genomes[0], uniformly(town_of(np.zeros((64, 64)), "bare")).genome]
    child = AsymmetricFusion(isometries=True, side=0.0)(parents[:: 1 if bare else -1], generator())
    if bare:
        assert child.uniform.all()
        assert (child.beta == 0).all()
    else:
        assert child.uniform.all()  # the plan is bare ground, and the other has some
        assert (map_of(child) == 0).all()


def test_a_city_without_a_level_block_still_gives_its_closest():
    rng = np.random.default_rng(1)
    rough = uniformly(town_of(rng.random((32, 32)) * 20, "rough")).genome
    assert not rough.uniform.any()
    bare = uniformly(town_of(np.zeros((32, 32)), "bare")).genome
    child = AsymmetricFusion(side=0.0)([bare, rough], rng)
    assert not child.uniform.any()
    assert len(set(stones(child).tolist())) <= 2  # that of least height, and what ties with it


def test_what_is_condensed_is_kept_and_is_no_level_block(genomes):
    mask = np.zeros((64, 64), bool)
    mask[10:20, 10:20] = True
    kept = Condensation(np.full((64, 64), 5.0), mask)
    river = uniformly(draw_town(2), condensation=kept).genome
    level = level_of(river)
    cut = genomes[0].pavement.blocks(mask).mean(axis=(1, 2))
    assert not level[(cut > 0) & (cut < 1)].any()
    bare = uniformly(town_of(np.zeros((64, 64)), "bare"), condensation=kept).genome
    assert np.array_equal(level_of(bare), bare.uniform & ((cut == 0) | (cut == 1)))
    wet = bare.replace(
        sigma=0 * bare.sigma, **dict.fromkeys(("x", "y", "dx", "dy", "iso"), 0 * bare.x)
    )
    assert wet.uniform.all()
    assert np.array_equal(level_of(wet), (cut == 0) | (cut == 1))
    child = AsymmetricFusion()([genomes[0], river], generator())
    assert (map_of(child)[mask] == 5).all()


def test_blocks_may_be_paired_in_part(genomes):
    maps = [map_of(genome) for genome in genomes]
    where = np.arange(len(genomes[0])) % 2 == 0
    grid, how = genomes[0].pavement, {"isometries": False, "alike": 0.01}
    found = [
        pair_cells(grid, genomes[1], maps, **how),
        pair_cells(grid, genomes[1], maps, **how, where=where),
    ]
    every, some = (laid(genomes, pieces_of(grid, 1, *one)).genome for one in found)
    full, partial = (mosaic(grid, maps[1], *one) for one in found)
    assert np.array_equal(stones(some)[where], stones(every)[where])
    assert np.array_equal(stones(some)[~where], np.flatnonzero(~where))
    blocks = grid.blocks
    assert np.array_equal(blocks(partial)[where], blocks(full)[where])
    assert np.array_equal(blocks(partial)[~where], blocks(maps[1])[~where])


def test_parameters_at_fault_are_told():
    with pytest.raises(OperatorError, match=r"(?s)isometries = 1, .*alike = -1.*0 m or more"):
        AsymmetricFusion(isometries=1, alike=-1)
    with pytest.raises(OperatorError, match=r"(?s)side = -8.*none for 5 range blocks"):
        AsymmetricFusion(side=-8)
