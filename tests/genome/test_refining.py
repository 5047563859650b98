"""Lifs split and merged decode alike; genomes laid of pieces show what the pieces say."""

import naive
import numpy as np
import pytest
from codes import draw_code
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_leaves, draw_pavement

from evocity import isometries
from evocity.coding import decode
from evocity.errors import GenomeError
from evocity.genome import FIELDS, Pieces, laid, merged, refined, split, unpacked
from evocity.genome.split_merge import _part
from evocity.pavement import Pavement, common_refinement

seeds = st.integers(0, 2**32)


@given(seeds, st.sampled_from([2, 4, 8]))
@settings(max_examples=30, deadline=None)
def test_a_split_changes_neither_map_nor_provenance(seed, side):
    genome = draw_leaves(seed)
    parts = split(genome, side)
    assert parts.pavement.coarsest <= max(side, 2)
    assert naive.shown_pixels(parts) == naive.shown_pixels(genome)
    apart = np.abs(decode(parts).attractor - decode(genome).attractor).max()
    assert apart <= 1e-4


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_what_was_split_is_merged_again(seed):
    genome = merged(draw_leaves(seed), 16)
    whole = merged(split(genome, 2), 16)
    assert whole == genome
    assert np.array_equal(whole.source, genome.source)
    assert np.array_equal(whole.turn, genome.turn)


@pytest.mark.slow
@given(seeds)
@settings(max_examples=30, deadline=None)
def test_merging_changes_no_pixel_and_leaves_nothing_to_merge(seed):
    rng = np.random.default_rng(seed)
    one = split(draw_leaves(seed), 2)
    # a code that continues here and there: some lifs of another
    other = split(draw_leaves(seed + 1), 2)
    take = rng.random(len(one)) < 0.2
    fields = FIELDS
    mixed = one.replace(
        **{name: np.where(take, getattr(other, name), getattr(one, name)) for name in fields}
    )
    whole = merged(mixed, 16)
    assert naive.shown_pixels(whole) == naive.shown_pixels(mixed)
    assert not naive.mergeable(whole, 16)
    assert naive.mergeable(mixed, 16) == (len(whole) < len(mixed))
    assert merged(whole, 16) is whole


def test_only_what_touches_a_place_is_split():
    genome = draw_leaves(1, Pavement(32, 32, 16))
    where = np.zeros((32, 32), bool)
    where[3, 17] = True
    parts = split(genome, 4, where)
    assert sorted(parts.pavement.levels) == [4, 8, 16]
    assert {side: which.size for side, which in parts.pavement.levels.items()} == {
        4: 4,
        8: 3,
        16: 3,
    }
    assert split(genome, 16) is genome
    assert split(genome, 4, np.zeros((32, 32), bool)) is genome


def test_splits_at_fault():
    genome = draw_leaves(1, Pavement(12, 12, 6))
    assert split(genome, 3).pavement.block == 3
    for side in (2, 1, 2.5, True, "4"):
        with pytest.raises(GenomeError):
            split(genome, side)
    with pytest.raises(GenomeError, match="where"):
        split(genome, 3, np.zeros((6, 6), bool))
    with pytest.raises(GenomeError, match="refinement"):
        refined(genome, Pavement(12, 12, 4))
    with pytest.raises(GenomeError, match="refinement"):
        refined(genome, Pavement(12, 24, 3))


@given(seeds, seeds)
@settings(max_examples=20, deadline=None)
def test_two_codes_have_a_common_refinement(one, other):
    genomes = [draw_leaves(seed, height=32, width=32) for seed in (one, other)]
    common = common_refinement([genome.pavement for genome in genomes])
    for genome in genomes:
        assert naive.shown_pixels(refined(genome, common)) == naive.shown_pixels(genome)


def draw_pieces(rng, genomes, cell, rows, columns, turned=True) -> Pieces:
    """Square patches of cells, from anywhere, under any isometry."""
    pieces = Pieces.in_place(np.zeros((rows, columns), int), cell)
    for _ in range(6):
        size = int(rng.integers(1, min(rows, columns)))
        y, x = rng.integers(0, rows - size + 1), rng.integers(0, columns - size + 1)
        v, u = rng.integers(0, rows - size + 1), rng.integers(0, columns - size + 1)
        iso = int(rng.integers(0, 8)) if turned else 0
        here = np.s_[y : y + size, x : x + size]
        grid = np.indices((size, size))
        pieces.whose[here] = rng.integers(0, len(genomes))
        pieces.row[here] = isometries.apply(iso, grid[0]) + v
        pieces.column[here] = isometries.apply(iso, grid[1]) + u
        pieces.iso[here] = iso
    return pieces


@given(seeds, st.sampled_from([2, 4, 8]))
@settings(max_examples=30, deadline=None)
def test_pieces_are_laid_as_they_say(seed, cell):
    rng = np.random.default_rng(seed)
    genomes = [draw_leaves(seed + k, height=32, width=32) for k in (0, 1)]
    pieces = draw_pieces(rng, genomes, cell, 32 // cell, 32 // cell)
    found = laid(genomes, pieces)
    shown = naive.shown_pixels(found.genome)
    models = [naive.shown_pixels(genome) for genome in genomes]
    for (y, x), (code, stone) in shown.items():
        i, j = y // cell, x // cell
        turn = int(pieces.iso[i, j])
        square = isometries.apply(turn, np.arange(cell * cell).reshape(cell, cell))
        v, u = divmod(int(square[y % cell, x % cell]), cell)
        place = pieces.row[i, j] * cell + v, pieces.column[i, j] * cell + u
        wanted, (city, row, column, before) = models[pieces.whose[i, j]][place]
        assert code == wanted
        assert stone == (city, row, column, int(isometries.COMPOSITION[turn, before]))
    # as large as can be: in place, a genome is laid of its own lifs
    assert (
        laid(genomes[:1], Pieces.in_place(np.zeros((32 // cell,) * 2, int), cell)).genome
        == (genomes[0])
    )


@pytest.mark.parametrize("iso", range(8))
def test_a_map_laid_turned_with_its_domains_decodes_turned(iso):
    genome = draw_leaves(iso, height=32, width=32)
    grid = np.indices((8, 8))
    pieces = Pieces(
        4,
        np.zeros((8, 8), int),
        isometries.apply(iso, grid[0]),
        isometries.apply(iso, grid[1]),
        np.full((8, 8), iso),
    )
    turned = laid([genome], pieces, carried=True).genome
    wanted = isometries.apply(iso, decode(genome).attractor)
    assert np.abs(decode(turned).attractor - wanted).max() < 0.05  # both stop within a tolerance
    assert (turned.turn == isometries.COMPOSITION[iso, turned.turn * 0 + genome.turn[0]]).any()
    row, column = unpacked(turned.source)
    assert row.min() >= 0 <= column.min()


@pytest.mark.parametrize("shape", [(8, 32), (32, 8), (16, 40)])
@pytest.mark.parametrize("iso", [1, 4, 6])
def test_domain_blocks_turned_in_a_map_that_is_not_square_stay_inside(shape, iso):
    """What was as long as the map would turned be longer than it is wide."""
    rows, columns = shape[0] // 4, shape[1] // 4
    genome = draw_code(iso, rows=rows, columns=columns, block=4)
    assert (genome.dx > shape[0]).any() or (genome.dy > shape[1]).any()
    tall = min(rows, columns)
    whose = np.zeros((rows, columns), int)
    row, column = np.indices((rows, columns))
    here = np.s_[:tall, :tall]
    turned = np.zeros((rows, columns), np.uint8)
    turned[here] = iso
    row[here], column[here] = (isometries.apply(iso, one[here]) for one in (row, column))
    child = laid([genome], Pieces(4, whose, row, column, turned), carried=True).genome
    has = child.dx > 0
    assert (child.y[has] + child.dy[has] <= shape[0]).all()
    assert (child.x[has] + child.dx[has] <= shape[1]).all()
    assert decode(child).attractor.shape == shape


def test_pieces_that_cut_what_cannot_be_halved_are_refused():
    genome = draw_leaves(1, Pavement(12, 12, 6))
    owner = np.zeros((3, 3), int)
    owner[1, 1] = 1
    with pytest.raises(GenomeError, match="halve"):
        laid([genome, draw_leaves(2, Pavement(12, 12, 4))], Pieces.in_place(owner, 4))


def test_shares_count_pixels():
    genome = draw_leaves(3, cities=2)
    pixels = genome.pavement.raster(genome.parent)
    part = genome.pavement.raster(genome.part).astype(float)
    others = genome.pavement.raster(genome.other)
    wanted = [np.where(pixels == k, part, 0) + np.where(others == k, 1 - part, 0) for k in (0, 1)]
    assert genome.shares == pytest.approx([one.mean() for one in wanted])
    assert genome.shares.sum() == pytest.approx(1)
    assert draw_pavement(3) == genome.pavement


# -- kernels ------------------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_parts_come_from_where_their_naive_twin_says(seed):
    genome, rng = draw_leaves(seed), np.random.default_rng(seed)
    p = genome.pavement
    lifs = rng.integers(0, len(p), 60)
    side = np.maximum(p.side[lifs] // rng.choice([1, 2, 4], 60), 1).astype(np.int64)
    down, along = (rng.integers(0, p.side[lifs] - side + 1) for _ in range(2))
    part = _part(genome, lifs, down, along, side)
    for name in ("sigma", "beta", "iso", "parent", "turn"):
        assert np.array_equal(part[name], getattr(genome, name)[lifs])
    for k, i in enumerate(lifs):
        whole, s = int(p.side[i]), int(side[k])
        square = whole, int(down[k]), int(along[k]), s
        row, column = divmod(int(genome.source[i]), 32768)
        v, u = naive.part_place(genome.turn[i], *square)
        assert int(part["source"][k]) == 32768 * (row + v) + column + u
        v, u = naive.part_place(genome.iso[i], *square)
        tall, wide = int(genome.dy[i]) // whole, int(genome.dx[i]) // whole
        assert (part["y"][k], part["x"][k]) == (genome.y[i] + tall * v, genome.x[i] + wide * u)
        assert (part["dy"][k], part["dx"][k]) == (tall * s, wide * s)


@given(seeds)
@settings(max_examples=60, deadline=None)
def test_bounds_are_those_of_their_naive_twin(seed):
    genome, rng = draw_leaves(seed), np.random.default_rng(seed)
    fields = {name: getattr(genome, name).copy() for name in FIELDS}
    wrong = {
        "sigma": [np.nan, np.inf, 0.9, 0.91, -0.91, 0],
        "beta": [np.nan, -np.inf, 7],
        "x": [-1, 0, 46, 32767],
        "y": [-1, 0, 30, 32767],
        "dx": [0, 2, 4, 5, 16, 48, 64, -4],
        "dy": [0, 2, 4, 5, 16, 32, 64, -4],
        "iso": [0, 7, 8, 255],
        "turn": [0, 7, 8],
        "parent": [0, 2, 3, 255],
        "other": [0, 2, 3, 255],
        "part": [0, 1, -0.1, 1.1, np.nan],
        "source": [0, -1, 2**31 - 1],
    }
    for name in rng.choice(list(wrong), rng.integers(0, 3), replace=False):
        fields[name][rng.integers(len(genome))] = rng.choice(wrong[name])
    told = {"pavement": genome.pavement, "sigma_max": 0.9, "cities": genome.cities}
    if naive.in_bounds(fields | told):
        genome.replace(**fields)
    else:
        with pytest.raises(GenomeError, match="lifs: "):
            genome.replace(**fields)
