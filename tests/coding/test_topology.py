"""Topological collage chooses by what stands around the blocks."""

from dataclasses import fields, replace

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st

from evocity import isometries
from evocity.coding.matching import best_matches, near_best
from evocity.coding.matching.domains import domain_pools
from evocity.coding.parameters import Coding
from evocity.coding.topology import Candidates, closest_neighbourhood
from evocity.errors import GenomeError
from evocity.pavement import Pavement

isos = pytest.mark.parametrize("iso", range(8))
multiples = pytest.mark.parametrize("multiple", [1, 2, 3])


def candidates_of(*groups):
    """`Candidates` of lists, one a range block, of (multiple, y, x, iso, σ, β)."""
    columns = list(zip(*(row for group in groups for row in group), strict=True)) or [()] * 6
    starts = np.cumsum([0] + [len(group) for group in groups])
    whole = [np.array(column, np.int64) for column in columns[:4]]
    return Candidates(starts, *whole, *(np.array(column, float) for column in columns[4:]))


def chosen_of(heights, block, corner, rows, **options):
    """Which of the ``rows`` the one range block at ``corner`` gets."""
    corners = np.array([corner[0]]), np.array([corner[1]])
    (chosen,) = closest_neighbourhood(heights, block, corners, candidates_of(rows), **options)
    return int(chosen)


def every_place(shape, block, multiple, sigma=1.0, beta=0.0):
    return [
        (multiple, y, x, iso, sigma, beta)
        for y in range(shape[0] - multiple * block + 1)
        for x in range(shape[1] - multiple * block + 1)
        for iso in range(8)
    ]


def rows_of(candidates, i):
    part = slice(candidates.starts[i], candidates.starts[i + 1])
    names = [field.name for field in fields(candidates)][1:]
    return list(zip(*(getattr(candidates, name)[part].tolist() for name in names), strict=True))


def random_case(seed, shape, block, most, levels=3):
    """A map of few heights, some range blocks, and up to ``most`` candidates for each."""
    rng = np.random.default_rng(seed)
    heights = (3.5 * rng.integers(0, levels, shape)).astype(np.float32)
    count = 6
    corners = tuple(rng.integers(0, side - block + 1, count) for side in shape)
    groups = []
    for _ in range(count):
        rows = set()
        for _ in range(rng.integers(0, most + 1)):
            multiple = int(rng.integers(1, min(shape) // block + 1))
            y, x = (int(rng.integers(0, side - multiple * block + 1)) for side in shape)
            flat = bool(rng.integers(2))  # blocks that show nothing tie
            sigma, beta = (0.0, 3.5) if flat else (float(rng.choice([-0.9, 0.3, 0.7])), 1.1)
            rows.add((multiple, y, x, int(rng.integers(8)), sigma, beta))
        groups.append(sorted(rows))
    return heights, corners, candidates_of(*groups)


@pytest.mark.parametrize("block", [2, 3, 4, 5])
@pytest.mark.parametrize("rings", [0, 1, 3, 16])
def test_same_choice_as_the_naive_twin(block, rings):
    for seed in range(3):
        heights, corners, candidates = random_case(seed, (19, 16), block, 30)
        found = closest_neighbourhood(heights, block, corners, candidates, rings=rings)
        truth = naive.closest_neighbourhood(heights, block, corners, candidates, rings)
        assert found.tolist() == truth.tolist()


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10**6), st.sampled_from([1, 2, 3]), st.integers(6, 14), st.integers(6, 14))
def test_same_choice_on_maps_of_few_heights(seed, levels, height, width):
    heights, corners, candidates = random_case(seed, (height, width), 3, 12, levels)
    other = np.ascontiguousarray(heights[::-1])
    for options in ({}, {"domain_heights": other}):
        found = closest_neighbourhood(heights, 3, corners, candidates, **options)
        truth = naive.closest_neighbourhood(heights, 3, corners, candidates, **options)
        assert found.tolist() == truth.tolist()


def neighbourhoods(iso, multiple, block=3, margin=4, seed=5):
    """A map whose range block, with ``margin`` px around it, is σ · iso(shrunk domain) + β of
    a domain block; a copy of that domain block stands beside, in the same surroundings.

    Returns heights, corner of the range block, corners of both domain blocks, σ, β.
    """
    rng = np.random.default_rng(seed)
    side, sigma, beta = block + 2 * margin, 0.5, 3.0
    fabric = rng.integers(0, 9, (side, side)) * 4.0
    large = np.kron(fabric, np.ones((multiple, multiple)))
    extent = len(large)
    heights = np.zeros((2 * extent + side, max(extent, side)))
    heights[:extent, :extent] = heights[extent : 2 * extent, :extent] = large
    heights[2 * extent :, :side] = sigma * isometries.apply(iso, fabric) + beta
    inset = multiple * margin
    places = (inset, inset), (extent + inset, inset)
    return heights.astype(np.float32), (2 * extent + margin, margin), places, sigma, beta


@isos
@multiples
@pytest.mark.parametrize("ring", [1, 2, 4])
@pytest.mark.parametrize("stranger", [0, 1])
def test_of_two_equal_blocks_the_one_in_equal_surroundings(iso, multiple, ring, stranger):
    heights, corner, places, sigma, beta = neighbourhoods(iso, multiple)
    rows = [(multiple, y, x, iso, sigma, beta) for y, x in places]
    y, x = places[stranger]
    off = multiple * ring
    heights[y - off, x - off] += 5  # one pixel of ring `ring` makes it a stranger
    assert chosen_of(heights, 3, corner, rows, rings=ring) == 1 - stranger
    assert chosen_of(heights, 3, corner, rows, rings=ring - 1) == 0  # not seen yet: a tie


@isos
@multiples
def test_only_the_right_isometry_fits_the_surroundings(iso, multiple):
    heights, corner, places, sigma, beta = neighbourhoods(iso, multiple)
    y, x = places[0]
    rows = [(multiple, y, x, k, sigma, beta) for k in range(8)]
    assert chosen_of(heights, 3, corner, rows, rings=1) == iso


@isos
def test_the_same_place_on_a_turned_map_wins_over_all_others(iso):
    heights = np.random.default_rng(iso).integers(0, 4, (13, 13)) * 3.0
    turned = np.ascontiguousarray(isometries.apply(iso, heights))
    where = isometries.apply(iso, np.arange(169).reshape(13, 13))
    rows = every_place((13, 13), 3, 1)
    for top, left in ((0, 0), (4, 7), (10, 3)):
        block = np.arange(169).reshape(13, 13)[top : top + 3, left : left + 3]
        y, x = (int(side.min()) for side in np.nonzero(np.isin(where, block)))
        truth = rows.index((1, y, x, int(isometries.INVERSE[iso]), 1.0, 0.0))
        assert chosen_of(heights, 3, (top, left), rows, domain_heights=turned) == truth


def test_turning_map_and_isometries_together_changes_nothing():
    heights, corners, candidates = random_case(11, (14, 14), 3, 40, levels=50)
    found = closest_neighbourhood(heights, 3, corners, candidates)
    turned = np.ascontiguousarray(np.rot90(heights))
    extent = 3 * candidates.multiple
    moved = replace(
        candidates,
        y=14 - extent - candidates.x,
        x=candidates.y,
        iso=isometries.COMPOSITION[isometries.COMPOSITION[1, candidates.iso], 3],
    )
    again = closest_neighbourhood(turned, 3, (11 - corners[1], corners[0]), moved)
    assert found.tolist() == again.tolist()


@pytest.mark.parametrize("scale", [1e-3, 0.1, 300])
def test_neither_the_unit_of_height_nor_sea_level_matters(scale):
    heights, corners, candidates = random_case(12, (18, 18), 4, 40)
    found = closest_neighbourhood(heights, 4, corners, candidates)
    scaled = replace(candidates, beta=scale * candidates.beta)
    again = closest_neighbourhood(scale * heights.astype(float), 4, corners, scaled)
    assert found.tolist() == again.tolist()
    raised = replace(candidates, beta=candidates.beta + 10 * (1 - candidates.sigma))
    again = closest_neighbourhood(heights + 10, 4, corners, raised)
    assert found.tolist() == again.tolist()


def test_order_and_copies_of_candidates_do_not_matter():
    heights, corners, candidates = random_case(13, (18, 18), 4, 40, levels=1000)
    keep = [rows_of(candidates, i) for i in range(6)]
    keep = [[row for row in rows if row[4]] for rows in keep]  # without ties
    found = closest_neighbourhood(heights, 4, corners, candidates_of(*keep))
    shuffled = [list(np.random.default_rng(i).permutation(rows)) for i, rows in enumerate(keep)]
    again = closest_neighbourhood(heights, 4, corners, candidates_of(*shuffled))
    twice = [[row for row in rows for _ in range(2)] for rows in keep]
    doubled = closest_neighbourhood(heights, 4, corners, candidates_of(*twice))
    every = [row for rows in keep for row in rows]
    mixed = [tuple(row) for rows in shuffled for row in rows]
    assert (found >= 0).sum() > 3
    for one, other, double in zip(found, again, doubled, strict=True):
        assert (one < 0) == (other < 0)
        assert one < 0 or every[one] == mixed[other]
        assert double == (2 * one if one >= 0 else -1)


def test_true_ties_go_to_the_first_of_the_least():
    tile = np.random.default_rng(3).integers(0, 3, (6, 6)) * 3.3
    heights = np.tile(tile, (5, 5)).astype(np.float32)
    rows = [(1, y, x, iso, 1.0, 0.0) for y, x, iso in [(7, 6, 0), (12, 12, 0), (18, 12, 0)]]
    assert chosen_of(heights, 3, (12, 12), rows, rings=6) == 1  # the first is one row off
    assert chosen_of(heights, 3, (12, 12), rows[::-1], rings=6) == 0


@isos
@pytest.mark.parametrize("apart", [0, 2])
def test_rounding_breaks_no_tie(iso, apart):
    heights, corner, places, sigma, beta = neighbourhoods(iso, 3)
    heights, beta = heights / np.float32(7), beta / 7 + apart
    for towards in (-1, 1):  # as if σ had been summed in another order
        nearly = np.nextafter(sigma, towards)
        rows = [(3, *places[0], iso, sigma, beta), (3, *places[1], iso, nearly, beta)]
        for order in (rows, rows[::-1]):
            assert chosen_of(heights, 3, corner, order, rings=4) == 0


def test_always_one_of_the_range_blocks_own_candidates():
    heights, corners, candidates = random_case(14, (18, 18), 3, 4)
    found = closest_neighbourhood(heights, 3, corners, candidates)
    none = np.diff(candidates.starts) == 0
    assert none.any()
    assert not none.all()
    assert (found[none] == -1).all()
    assert (candidates.starts[:-1][~none] <= found[~none]).all()
    assert (found[~none] < candidates.starts[1:][~none]).all()


def test_one_candidate_needs_no_comparison():
    heights = np.random.default_rng(15).random((12, 12))
    for row in every_place((12, 12), 4, 2):
        assert chosen_of(heights, 4, (4, 8), [row]) == 0


def test_without_range_blocks_or_candidates_there_is_nothing_to_choose():
    heights, nowhere = np.ones((8, 8), np.float32), (np.zeros(0, int), np.zeros(0, int))
    assert closest_neighbourhood(heights, 4, nowhere, candidates_of()).shape == (0,)
    assert chosen_of(heights, 4, (0, 4), []) == -1


def test_the_border_alone_is_neither_gain_nor_loss():
    """On a flat map all differ by β everywhere, whatever part of a ring they have."""
    heights = np.full((20, 20), 6.0, np.float32)
    places = [(0, 0), (0, 12), (3, 7), (6, 6), (12, 0), (12, 12)]
    rows = [(2, y, x, 0, 1.0, 2.0) for y, x in places]
    for order in (rows, rows[::-1]):
        assert chosen_of(heights, 4, (8, 8), order, rings=3) == 0
    for k in range(len(rows)):  # and the one that differs less wins wherever it lies
        nearer = [(2, y, x, 0, 1.0, 1.9 if j == k else 2.0) for j, (y, x) in enumerate(places)]
        assert chosen_of(heights, 4, (8, 8), nearer) == k


@pytest.mark.parametrize(("cells", "choice"), [(1, 1), (2, 1), (3, 0)])
def test_what_a_candidate_lacks_is_taken_to_be_like_what_it_has(cells, choice):
    heights = np.zeros((24, 24), np.float32)
    at_corner, inside = (2, 0, 16, 0, 1.0, 0.0), (2, 12, 4, 0, 1.0, 0.0)
    heights[8:10, 20:22] = 8  # one of the nine cells that are there of twenty
    heights[20:22, 8 : 8 + 2 * cells] = 8  # so many of all twenty
    assert chosen_of(heights, 4, (10, 14), [at_corner, inside], rings=1) == choice


def test_what_has_left_the_map_gives_way():
    heights = np.random.default_rng(16).random((20, 20)).astype(np.float32)
    gone = (2, 12, 12, 0, 0.9, 0.0)  # has north and west; the range block has south and east
    awful = (2, 0, 0, 0, 0.9, 500.0)
    turned = (2, 12, 12, 2, 0.9, 900.0)  # the same block, turned to have south and east
    assert chosen_of(heights, 4, (0, 0), [gone, awful]) == 1
    assert chosen_of(heights, 4, (0, 0), [gone, turned]) == 1
    assert chosen_of(heights, 4, (0, 0), [gone, gone]) == 0
    assert chosen_of(heights, 4, (0, 0), [turned, awful]) == 1


def test_growth_ends_when_all_have_left_the_map():
    heights = np.random.default_rng(17).random((8, 8)).astype(np.float32)
    rows = [(2, 0, 0, iso, 0.5, 0.1) for iso in range(8)]  # domain blocks as large as the map
    assert chosen_of(heights, 4, (4, 0), rows, rings=1000) == 0
    flat = np.full((16, 16), 3, np.float32)
    tied = [(2, y, x, 0, 0.5, 1.5) for y, x in [(0, 0), (2, 5), (8, 8)]]
    # north and west of the range block: 0, 2 and 4 rings of the three are on the map
    assert chosen_of(flat, 4, (12, 12), tied, rings=2) == 1
    assert chosen_of(flat, 4, (12, 12), tied, rings=1000) == 2


def test_what_is_given_stays_as_it_was():
    heights, corners, candidates = random_case(18, (18, 18), 3, 20)
    before = heights.copy(), [getattr(candidates, f.name).copy() for f in fields(candidates)]
    closest_neighbourhood(heights, 3, corners, candidates)
    assert np.array_equal(heights, before[0])
    for field, values in zip(fields(candidates), before[1], strict=True):
        assert np.array_equal(getattr(candidates, field.name), values)


def test_narrow_types_give_the_same_choice():
    heights, corners, candidates = random_case(19, (18, 18), 3, 20)
    found = closest_neighbourhood(heights, 3, corners, candidates)
    narrow = replace(
        candidates,
        y=candidates.y.astype(np.int16),
        x=candidates.x.astype(np.int16),
        multiple=candidates.multiple.astype(np.int16),
        iso=candidates.iso.astype(np.uint8),
    )
    corners = tuple(corner.astype(np.int32) for corner in corners)
    assert closest_neighbourhood(heights, 3, corners, narrow).tolist() == found.tolist()


@pytest.mark.slow_cases("0-None", "0.02-None")
@pytest.mark.parametrize("reach", [5, None])
@pytest.mark.parametrize("tolerance", [0, 0.02])
def test_candidates_are_all_that_come_near_the_best(town, reach, tolerance):
    heights, pavement = town.heights[:24, :28], Pavement(24, 28, 4)
    blocks = pavement.blocks(heights)
    busy = np.flatnonzero(np.ptp(blocks.reshape(len(blocks), -1), axis=1) > 0)
    corners = tuple(corner[busy] for corner in pavement.corners)
    coding = Coding(reach, sigma_max=0.5)

    def pools():
        return domain_pools(heights, 4, (2, 3), memory=1 << 17)

    matches = best_matches(pools(), blocks[busy], corners, coding)
    seen = 0
    for part, found in near_best(pools(), blocks[busy], corners, matches, tolerance, coding):
        for k, i in enumerate(part):
            block = blocks[busy[i]]
            corner = (corners[0][i], corners[1][i])
            truth = list(naive.candidates(heights, 4, corner, (2, 3), reach, block, 0.5))
            energy = 16 * block.astype(float).var()
            least = max((gain for gain, *_ in truth), default=0) - (tolerance + 1e-9) * energy
            near = [place for gain, place, *_ in truth if gain >= least]
            mine = slice(found.starts[k], found.starts[k + 1])
            columns = (found.multiple, found.y, found.x, found.iso)
            assert list(zip(*(column[mine].tolist() for column in columns), strict=True)) == near
            seen += len(near)
    assert seen > busy.size


@pytest.mark.parametrize("reach", [24, None])
def test_surroundings_decide_ties_at_no_cost(town, reach):
    plain = uniformly(town, reach=reach)
    chosen = uniformly(town, reach=reach, topological=0, threads=1)
    assert chosen.collage_rmse == pytest.approx(plain.collage_rmse, rel=1e-5)
    assert chosen.genome != plain.genome
    assert uniformly(town, reach=reach, topological=0, threads=3).genome == chosen.genome


def test_a_larger_share_trades_collage_error_for_surroundings(town):
    errors = [uniformly(town, topological=share).collage_rmse for share in (0, 0.02, 0.1)]
    assert errors == sorted(errors)
    assert errors[0] < errors[2]


@pytest.mark.parametrize("share", [-0.1, 1.5, float("nan"), "much"])
def test_shares_that_are_none_are_refused(town, share):
    with pytest.raises(GenomeError, match="topological"):
        uniformly(town, topological=share)
