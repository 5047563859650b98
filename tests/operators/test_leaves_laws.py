"""Laws every operator obeys on leaves of many sides, alone or with blocks of one side."""

import dataclasses
from functools import cache

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from test_breeding_laws import VARIANTS as IN_BLOCKS
from test_breeding_laws import lays_void, moves, parents_for, renews
from towns import draw_town

from evocity.coding import decode, encode
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.genome import Genome, merged, refined, unpacked
from evocity.operators import (
    OPERATORS,
    DirectFusion,
    Interpolation,
    LambdaCrossover,
    Mutation,
    PavementFusion,
    RegionFusion,
    make,
)
from evocity.operators.grid import METRES, common_grid
from evocity.operators.pavement_fusion import VOID
from evocity.pavement import Pavement, common_refinement


def in_metres(operator):
    """The operator with its sizes, told in range blocks of 4 px at 2 m, in metres: so that they
    mean the same on any grid."""
    given = {key: getattr(operator, key, None) for key in METRES}
    given = {key: size for key, size in given.items() if size is not None}
    metric = {METRES[key]: 8.0 * size for key, size in given.items()}
    return dataclasses.replace(operator, **dict.fromkeys(given), **metric)


VARIANTS = [in_metres(operator) for operator in IN_BLOCKS]
#: Which partitions the parents have.
PAIRS = ("leaves", "leaves and blocks", "blocks and leaves")
#: Variants with pairs: the first variant of an operator with each pair, the others in turn.
PAIRED = [
    (operator, kind)
    for number, operator in enumerate(VARIANTS)
    for kind in PAIRS
    if operator.name not in {one.name for one in VARIANTS[:number]}
    or kind == PAIRS[number % len(PAIRS)]
]


@cache
def on_leaves(seed: int, lifs: int = 260) -> Genome:
    how = {"block": (2, 16), "lifs": lifs, "fit": False, "settle": False}
    genome = encode(draw_town(seed), **how).genome
    assert not genome.pavement.uniform
    return genome


@cache
def on_blocks(seed: int, block: int = 4) -> Genome:
    return uniformly(draw_town(seed), block=block).genome


@cache
def three(kind: str) -> tuple[Genome, ...]:
    """Three parents; leaves are of other sides at other places in each."""
    leaves, blocks = [on_leaves(1), on_leaves(2, 200), on_leaves(3)], [on_blocks(4), on_blocks(5)]
    if kind == "leaves":
        return tuple(leaves)
    first, second = (leaves, blocks) if kind == "leaves and blocks" else (blocks, leaves)
    return first[0], second[0], first[1]


@cache
def stones_of(kind: str, count: int) -> set[tuple]:
    """(city, row, column) of all pixels that the first ``count`` parents show."""
    shown = (naive.shown_pixels(parent) for parent in three(kind)[:count])
    return {stone[:3] for one in shown for _, stone in one.values()}


def most_of(parents) -> int:
    return max(parent.pavement.coarsest for parent in parents)


def common_of(parents) -> Pavement:
    """The coarsest partition along which parents and cells of the grid can be told apart."""
    grid = common_grid("test", parents)
    return common_refinement([grid, *(parent.pavement for parent in parents)])


# -- every operator ---------------------------------------------------------------------------


def test_every_operator_is_held_to_the_laws():
    assert {operator.name for operator in VARIANTS} == set(OPERATORS)


@pytest.mark.parametrize(("operator", "kind"), PAIRED, ids=str)
@settings(max_examples=2, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, kind, seed):
    parents = parents_for(operator, three(kind))
    before = [parent.digest for parent in parents]
    child = operator(parents, np.random.default_rng(seed))  # bounds are checked by Genome
    assert [parent.digest for parent in parents] == before
    again = operator(parents, np.random.default_rng(seed))
    assert again == child
    for name in ("parent", "source", "turn"):
        assert np.array_equal(getattr(again, name), getattr(child, name))
    assert child.made["operator"] == operator.name
    assert decode(child).converged
    for parent in parents:
        for line in parent.attribution.split("; "):
            assert line in child.attribution
    finest = min(parent.pavement.finest for parent in parents)
    assert finest <= child.pavement.finest <= child.pavement.coarsest <= most_of(parents)
    assert not naive.mergeable(child, most_of(parents)) or operator.name == "interpolation"


@pytest.mark.parametrize(("operator", "kind"), PAIRED, ids=str)
def test_every_pixel_is_a_stone_of_the_parents(operator, kind):
    parents = parents_for(operator, three(kind))
    child = operator(parents, np.random.default_rng(7))
    stones = naive.shown_pixels(child)
    known = stones_of(kind, len(parents))
    for (y, x), (_, stone) in stones.items():
        if stone[0] == VOID:
            assert lays_void(operator)
            continue
        assert stone[:3] in known
        if not moves(operator):
            assert stone[1:] == (y, x, 0)
    row, column = unpacked(child.source)
    assert (np.minimum(row, column) >= 0).all()
    assert (np.maximum(row, column) + child.pavement.side <= 64).all()


@pytest.mark.parametrize(
    ("operator", "kind"), [one for one in PAIRED if one[0].repair is None], ids=str
)
def test_range_blocks_are_split_no_more_than_the_parents_ask_for(operator, kind):
    parents = parents_for(operator, three(kind))
    finest = common_of(parents)
    for seed in range(3):
        draft = operator.draft(parents, np.random.default_rng(seed)).genome
        child = operator(parents, np.random.default_rng(seed))
        assert len(child) <= len(draft)
        if not moves(operator):
            assert len(draft) <= len(finest)
            assert common_refinement([finest, draft.pavement]) == finest
        cells = common_grid("test", parents)
        within = np.bincount(cells.index[finest.corners], minlength=len(cells))
        assert len(draft) <= within.max() * len(cells)


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
def test_a_city_bred_with_itself_gives_itself(operator):
    if renews(operator):
        pytest.skip("changes a lone parent by design")
    for city in (on_leaves(1), on_leaves(2, 200)):
        whole = merged(city)
        child = operator([city] * operator.parents[0], np.random.default_rng(0))
        assert child == whole
        for name in ("parent", "source", "turn"):
            assert np.array_equal(getattr(child, name), getattr(whole, name))


@pytest.mark.parametrize(("operator", "kind"), PAIRED, ids=str)
def test_what_is_condensed_stands_in_the_child(operator, kind):
    mask = np.zeros((64, 64), bool)
    mask[9:39, 20:53] = True
    layer = Condensation.cut(draw_town(7), mask)
    parents = [one.replace(condensation=layer) for one in three(kind)]
    parents = parents_for(operator, parents)
    draft = operator.draft(parents, np.random.default_rng(3))
    assert np.array_equal(draft.intended[mask], layer.heights[mask])
    child = operator(parents, np.random.default_rng(3))
    assert child.condensation == layer
    assert np.array_equal(decode(child).city.heights[mask], layer.heights[mask])


# -- special cases ------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", PAIRS)
@pytest.mark.parametrize("kind_of", [PavementFusion, RegionFusion, DirectFusion])
@pytest.mark.parametrize("fill", [0, 1])
def test_fill_of_nothing_or_all_gives_a_parent(kind_of, kind, fill):
    parents = three(kind)[:2]
    child = kind_of(fill=fill)(parents, np.random.default_rng(0))
    assert child == merged(parents[fill], most_of(parents))


@pytest.mark.parametrize("kind", PAIRS)
@pytest.mark.parametrize("blend", [0, 0.5, 1])
@pytest.mark.parametrize("share", [0, 1])
def test_lambda_zero_and_one_give_a_parent(kind, blend, share):
    parents = three(kind)[:2]
    child = LambdaCrossover(share=share, blend=blend)(parents, np.random.default_rng(0))
    assert child == merged(parents[1 - share], most_of(parents))
    for stepwise in (False, True):
        end = Interpolation(share=share, stepwise=stepwise)(parents, np.random.default_rng(0))
        assert end == merged(parents[1 - share])  # on its own partition


def test_mutation_at_rate_zero_changes_nothing():
    still = dict.fromkeys(("sigma", "beta", "x", "y", "dx", "dy", "iso"), 0)
    child = Mutation(**still)([on_leaves(1)], np.random.default_rng(0))
    assert child == merged(on_leaves(1))


@pytest.mark.parametrize("name", ["sigma", "beta", "x", "y", "dx", "dy", "iso"])
def test_each_nucleotide_of_leaves_mutates_by_its_own_rate(name):
    rates = {one: float(one == name) for one in ("sigma", "beta", "x", "y", "dx", "dy", "iso")}
    parent = on_leaves(1, 120)
    draft = Mutation(**rates, group_side=8).draft([parent], np.random.default_rng(0)).genome
    assert draft.pavement == parent.pavement
    changed = {
        one for one in rates if not np.array_equal(getattr(draft, one), getattr(parent, one))
    }
    assert changed - {"dx": {"x"}, "dy": {"y"}}.get(name, set()) == {name}
    for side in (4, 8):  # of every side
        level = (parent.pavement.side == side) & ~parent.uniform
        assert level.any()
        assert (getattr(draft, name) != getattr(parent, name))[level].any()


def test_lifs_of_one_group_mutate_alike():
    parent = on_leaves(1)
    mutation = Mutation(sigma=0, beta=0.5, x=0, y=0, dx=0, dy=0, iso=0, group_side=32)
    draft = mutation.draft([parent], np.random.default_rng(1)).genome
    step = (draft.beta - parent.beta)[~parent.uniform]
    assert len(np.unique(np.round(step, 3))) <= 5 * 5 + 1
    assert 0 < (step != 0).mean() < 1


def test_stepwise_takes_sides_that_do_not_halve_and_others_tell_what_would():
    town = draw_town(6, side=48)
    leaves = encode(town, block=(2, 16), lifs=150, fit=False, settle=False).genome
    six = uniformly(draw_town(7, side=48), block=6).genome
    four = uniformly(draw_town(7, side=48), block=4).genome
    for parents in ([leaves, six], [six, leaves], [four, six]):
        for repair in (None, 0.5):
            mix = Interpolation(stepwise=True, repair=repair)
            child = mix(parents, np.random.default_rng(0))
            assert decode(child).converged
            draft = mix.draft(parents, np.random.default_rng(0))
            assert draft.genome.pavement == parents[0].pavement
            assert {child.cities[p] for p in child.parent} == set(parents[0].cities)
        for name, kind in OPERATORS.items():
            if kind.parents[0] == 2:
                with pytest.raises(OperatorError, match=rf"(?s){name}.*range blocks of.*halve"):
                    make(name)(parents, np.random.default_rng(0))


@pytest.mark.parametrize("share", [0.25, 0.75])
def test_interpolation_meets_on_what_both_have_in_common(share):
    first, second = three("leaves")[:2]
    draft = Interpolation(share=share).draft([first, second], np.random.default_rng(2))
    common = common_refinement([first.pavement, second.pavement])
    ours, theirs, child = refined(first, common), refined(second, common), draft.genome
    assert child.pavement == common
    assert child.beta == pytest.approx(share * ours.beta + (1 - share) * theirs.beta, abs=1e-4)
    assert child.sigma == pytest.approx(share * ours.sigma + (1 - share) * theirs.sigma, abs=1e-6)
    larger = ours if share > 0.5 else theirs
    assert np.array_equal(child.source, larger.source)
    heights = [decode(parent).city.heights for parent in (first, second)]
    mixture = share * heights[0] + (1 - share) * heights[1]
    assert draft.intended == pytest.approx(mixture, abs=1e-4)


def test_the_stitched_map_is_cut_from_the_parents_along_cells():
    parents = three("leaves and blocks")
    for operator in (
        PavementFusion(tolerance=50),
        RegionFusion(tolerance=1000, cut=1, side_min=8),
        DirectFusion(),
    ):
        draft = operator.draft(parents, np.random.default_rng(3))
        owner = draft.genome.pavement.raster(draft.genome.parent)
        assert len(np.unique(owner)) > 1
        grid = common_grid("test", parents)
        cells = grid.blocks(owner)
        assert (cells == cells[:, :1, :1]).all()
        maps = np.stack([decode(parent).city.heights for parent in parents])
        wanted = np.take_along_axis(maps, owner[None].astype(int), axis=0)[0]
        assert np.array_equal(draft.intended, wanted)
        reached = np.bincount(owner.ravel(), minlength=3) / owner.size
        assert draft.made["fill_reached"] == pytest.approx(reached, abs=1e-4)


def test_a_child_settles_if_a_parent_does():
    calm = on_leaves(1).replace(settle=True)
    for parents in ([calm, on_leaves(2, 200)], [on_blocks(4), calm]):
        for kind in (PavementFusion, RegionFusion, LambdaCrossover, Interpolation, DirectFusion):
            draft = kind().draft(parents, np.random.default_rng(0))
            assert draft.genome.settle
            raw = [np.maximum(decode(one).attractor, 0) for one in parents]
            low, high = np.minimum(*raw), np.maximum(*raw)  # of raw maps, not of settled ones
            assert (draft.intended >= low - 1e-3).all()
            assert (draft.intended <= high + 1e-3).all()
