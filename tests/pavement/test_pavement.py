"""Pavements: squares that tile a map, of one side or of many."""

import pickle

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_pavement

from evocity.errors import GenomeError
from evocity.pavement import (
    Pavement,
    common_refinement,
    fitting_sides,
    halved_sides,
    quartered,
    read_sides,
    touched,
)

seeds = st.integers(0, 2**32)


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_leaves_tile_the_map_and_lie_where_their_sides_say(seed):
    pavement = draw_pavement(seed)
    index, corners = naive.tile(pavement.side, pavement.height, pavement.width)
    assert np.array_equal(pavement.index, index)
    assert list(zip(*pavement.corners, strict=True)) == corners
    assert pavement.area.sum() == pavement.height * pavement.width
    assert pickle.loads(pickle.dumps(pavement)) == pavement


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_what_is_cut_is_what_lies_there(seed):
    pavement = draw_pavement(seed)
    rng = np.random.default_rng(seed)
    raster = rng.normal(size=(pavement.height, pavement.width))
    top, left = pavement.corners
    for side, which in pavement.levels.items():
        for block, i in zip(pavement.blocks(raster, side), which, strict=True):
            here = raster[top[i] : top[i] + side, left[i] : left[i] + side]
            assert np.array_equal(block, here)
            assert pavement.sums(raster)[i] == pytest.approx(here.sum())
            assert pavement.maxima(raster)[i] == here.max()
    assert np.array_equal(pavement.raster(np.arange(len(pavement))), pavement.index)


def test_a_uniform_pavement_is_one_case():
    uniform, told = Pavement(12, 20, 4), Pavement(12, 20, np.full(15, 4))
    assert uniform == told
    assert told.uniform
    assert (told.block, told.rows, told.columns) == (4, 3, 5)
    assert hash(uniform) == hash(told)
    assert np.array_equal(uniform.side, told.side)
    assert np.array_equal(uniform.index, told.index)
    assert uniform.levels.keys() == {4}


def test_leaves_have_no_one_side():
    leaves = Pavement(8, 8, [4, 4, 4, 2, 2, 2, 2])
    assert (leaves.finest, leaves.coarsest, len(leaves)) == (2, 4, 7)
    for ask in ("block", "rows", "columns"):
        with pytest.raises(GenomeError, match="2 to 4 px"):
            getattr(leaves, ask)
    assert leaves != Pavement(8, 8, 4)


@pytest.mark.parametrize(
    ("sides", "word"),
    [
        ([4, 4, 4], "leave gaps"),
        ([4, 4, 4, 4, 4], "overlap"),
        ([4, 8], "overlap"),
        ([16], "leave the map"),
        ([], "sides"),
        ([1] * 64, "sides"),
        ([4.0] * 4, "sides"),
    ],
)
def test_squares_that_do_not_tile_are_refused(sides, word):
    assert len(sides) == 0 or naive.tile(np.array(sides, int), 8, 8) is None or word == "sides"
    with pytest.raises(GenomeError, match=word):
        Pavement(8, 8, sides)


@given(seeds, seeds)
@settings(max_examples=40, deadline=None)
def test_the_common_refinement_is_the_finer_of_both_everywhere(one, other):
    both = [draw_pavement(seed, height=32, width=32) for seed in (one, other)]
    common = common_refinement(both)
    sides = [pavement.raster(pavement.side) for pavement in both]
    assert np.array_equal(common.raster(common.side), np.minimum(*sides))
    assert common_refinement(both[::-1]) == common
    assert common_refinement([common, *both]) == common


def test_partitions_that_do_not_divide_each_other_have_none():
    with pytest.raises(GenomeError, match="halve, 4 and 2, not 6 and 4"):
        common_refinement([Pavement(12, 12, 6), Pavement(12, 12, 4)])
    with pytest.raises(GenomeError):
        common_refinement([Pavement(12, 12, 4), Pavement(16, 16, 4)])


def test_sides_that_halve():
    assert halved_sides(2, 16) == (16, 8, 4, 2)
    assert halved_sides(3, 12) == (12, 6, 3)
    assert halved_sides(4, 4) == (4,)
    for finest, root in ((3, 16), (1, 16), (16, 2), (2, 0), (4, 18)):
        with pytest.raises(GenomeError, match="times the finest side"):
            halved_sides(finest, root)
    assert fitting_sides(256, 256) == (2, 16)
    assert fitting_sides(200, 256) == (2, 8)
    assert fitting_sides(250, 256) == (2, 2)
    with pytest.raises(GenomeError, match="an even height"):
        fitting_sides(255, 256)


def test_sides_as_users_write_them():
    assert read_sides("4") == 4
    assert read_sides(" 2-16 ") == (2, 16)
    for text in ("", "four", "2-", "2-16-32", "-4", "2,16", "²", "1e3"):
        with pytest.raises(GenomeError, match=r"2-16|halv"):
            read_sides(text)


# -- kernels ------------------------------------------------------------------------------------


@given(st.integers(0, 2**32))
@settings(max_examples=20, deadline=None)
def test_squares_are_cut_summed_spread_and_touched_as_their_naive_twins(seed):
    p, rng = draw_pavement(seed), np.random.default_rng(seed)
    for raster in (
        rng.random((32, 48)),
        rng.random((32, 48)).astype("f4"),
        rng.integers(0, 99, (32, 48)),
        rng.random((32, 48)) < 0.1,
    ):
        every = list(naive.squares(raster, *p.corners, p.side))
        for side, which in p.levels.items():
            blocks = p.blocks(raster, side)
            assert blocks.dtype == raster.dtype
            assert np.array_equal(blocks, [every[i] for i in which])
            some = rng.permutation(which)[: 1 + which.size // 2]
            assert np.array_equal(p.squares(raster, some, side), [every[i] for i in some])
        sums = [float(one.sum(dtype=np.float64)) for one in every]
        assert p.sums(raster) == pytest.approx(sums, rel=1e-12, abs=0)
        assert p.sums(raster).dtype == np.float64
    found = touched(raster, *p.corners, p.side)
    assert np.array_equal(found, [one.any() for one in every])
    for values in (rng.random(len(p)), rng.random(len(p)) < 0.5):
        spread = p.raster(values)
        assert spread.dtype == values.dtype
        for value, one in zip(values, naive.squares(spread, *p.corners, p.side), strict=True):
            assert (one == value).all()


def test_a_transposed_raster_is_cut_too():
    p = draw_pavement(3, height=32, width=32)
    raster = np.random.default_rng(0).random((32, 32)).T
    for side, which in p.levels.items():
        wanted = list(
            naive.squares(raster, *(corner[which] for corner in p.corners), [side] * which.size)
        )
        assert np.array_equal(p.blocks(raster, side), wanted)


def test_quartered_partitions_have_a_common_refinement():
    for seed in range(8):
        pavements = [draw_pavement(seed), draw_pavement(seed + 50, finest=4), Pavement(32, 48, 8)]
        assert quartered(pavements)
        assert common_refinement(pavements).finest >= 2
    assert not quartered([Pavement(48, 48, 6), Pavement(48, 48, 4)])
    assert not quartered([Pavement(48, 48, 12), Pavement(48, 48, 4)])
    assert quartered([Pavement(48, 48, 12), Pavement(48, 48, 3)])
    shifted = Pavement(8, 8, [2, 2, 2, 2, 2, 4, 2, 2, 2, 2, 2, 2, 2])  # 4 px at (2, 2)
    assert not quartered([shifted])
    with pytest.raises(GenomeError, match="halve"):
        common_refinement([shifted, Pavement(8, 8, 4)])
