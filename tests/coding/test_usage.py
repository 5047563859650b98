"""How often a code calls its blocks and pixels, and what a filter by that leaves."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
import shapely
from codes import draw_code, uniformly
from hypothesis import given, settings
from hypothesis import strategies as st

import evocity
from evocity.coding import CollageMap, decode, high_pass, low_pass, usage
from evocity.coding.usage import COUNTS, PARTS
from evocity.condensation import Condensation
from evocity.errors import GenomeError
from evocity.fitness import crumbs

codes = st.builds(
    draw_code,
    seed=st.integers(0, 10**6),
    rows=st.integers(2, 6),
    columns=st.integers(2, 6),
    block=st.sampled_from([2, 4]),
    few=st.sampled_from([0, 0, 1, 3]),
)


def counted(genome):
    """Slow twin: every lifs walks over its own domain block."""
    p, called = genome.pavement, {}
    pixels, domains, ranges = (np.zeros((p.height, p.width), int) for _ in range(3))
    blocks = [
        tuple(int(getattr(genome, name)[i]) for name in ("y", "x", "dy", "dx"))
        for i in range(len(genome))
    ]
    for block, dx in zip(blocks, genome.dx, strict=True):
        if dx:
            called[block] = called.get(block, 0) + 1
    for block, corner in zip(blocks, zip(*p.corners, strict=True), strict=True):
        if block in called:
            y, x, dy, dx = block
            pixels[y : y + dy, x : x + dx] += 1
            held = domains[y : y + dy, x : x + dx]
            np.maximum(held, called[block], out=held)
            top, left = corner
            ranges[top : top + p.block, left : left + p.block] = called[block]
    return called, {"pixels": pixels, "domains": domains, "ranges": ranges}


@settings(max_examples=40, deadline=None)
@given(codes)
def test_counts_are_those_of_a_walk_over_all_lifs(genome):
    found = usage(genome)
    called, maps = counted(genome)
    rows = [tuple(row) for row in found.domain_blocks.tolist()]
    assert dict(zip(rows, found.domain_calls.tolist(), strict=True)) == called
    assert (np.diff(found.domain_calls) <= 0).all()
    for count in COUNTS:
        np.testing.assert_array_equal(getattr(found, count), maps[count])
        assert getattr(found, count).dtype == np.int32


@settings(max_examples=40, deadline=None)
@given(codes)
def test_all_calls_are_counted_once(genome):
    found = usage(genome)
    served = ~genome.uniform
    assert found.domain_calls.sum() == served.sum() == (found.calls > 0).sum()
    area = genome.dx.astype(int) * genome.dy
    assert found.pixels.sum(dtype=int) == area.sum()
    assert (found.domains <= found.pixels).all()
    assert ((found.domains > 0) == (found.pixels > 0)).all()


def test_a_code_without_domains_calls_nothing():
    genome = draw_code(1)
    none = {name: np.zeros(len(genome), int) for name in ("y", "x", "dy", "dx", "iso")}
    genome = genome.replace(sigma=np.zeros(len(genome)), **none)
    found = usage(genome)
    assert found.domain_blocks.shape == (0, 4)
    assert not any(getattr(found, count).any() for count in (*COUNTS, "calls"))
    assert low_pass(genome, 0) is genome


FILTERS = {low_pass: np.greater, high_pass: np.less}
either_filter = pytest.mark.parametrize("filtering", FILTERS)


@either_filter
@settings(max_examples=25, deadline=None)
@given(codes, st.sampled_from(COUNTS), st.sampled_from([0, 1, 2.5, 6]))
def test_what_is_called_more_or_less_often_goes_to_ground_and_stays_there(
    filtering, genome, count, f_c
):
    bare = FILTERS[filtering](counted(genome)[1][count], f_c)
    filtered = filtering(genome, f_c, count=count)
    if not bare.any():
        assert filtered is genome
        return
    np.testing.assert_array_equal(filtered.condensation.mask, bare)
    attractor = decode(filtered, tolerance=1e-4).attractor
    assert (attractor[bare] == 0).all()
    # elsewhere it is the fixed point of the map with that ground in it, not a map painted over
    collage = CollageMap(genome)
    np.testing.assert_allclose(collage(attractor)[~bare], attractor[~bare], atol=1e-3)


@pytest.mark.parametrize("count", COUNTS)
def test_infinity_changes_nothing_and_0_takes_all_that_is_called(town, count):
    genome = uniformly(town).genome
    assert low_pass(genome, math.inf, count=count) is genome
    counts = getattr(usage(genome), count)
    assert low_pass(genome, counts.max(), count=count) is genome
    city = decode(low_pass(genome, 0, count=count)).city
    assert (city.heights[counts > 0] == 0).all()


@pytest.mark.parametrize("count", COUNTS)
def test_high_pass_of_0_changes_nothing_and_of_infinity_takes_all(town, count):
    genome = uniformly(town).genome
    counts = getattr(usage(genome), count)
    assert high_pass(genome, 0, count=count) is genome
    assert high_pass(genome, counts.min(), count=count) is genome
    assert not decode(high_pass(genome, math.inf, count=count)).city.heights.any()
    assert not decode(high_pass(genome, counts.max() + 1, count=count)).city.heights.any()
    never = decode(high_pass(genome, 1, count=count)).city.heights[counts == 0]
    assert never.size
    assert not never.any()


@pytest.mark.parametrize("f_c", [1, 3])
@pytest.mark.parametrize("count", COUNTS)
def test_each_pixel_outlives_one_of_the_filters(town, count, f_c):
    genome = uniformly(town, reach=None).genome
    high, low = (one(genome, f_c, count=count).condensation.mask for one in (high_pass, low_pass))
    counts = getattr(usage(genome), count)
    assert not (high & low).any()
    np.testing.assert_array_equal(~high & ~low, counts == f_c)


def test_one_filter_after_the_other_leaves_a_band(town):
    genome = uniformly(town, reach=None).genome
    bands = [low_pass(high_pass(genome, 2), 5), high_pass(low_pass(genome, 5), 2)]
    calls = usage(genome).pixels
    for band in bands:
        np.testing.assert_array_equal(~band.condensation.mask, (calls >= 2) & (calls <= 5))
        assert band.made["high_pass"] == {"f_c": 2.0, "count": "pixels"}
        assert band.made["low_pass"] == {"f_c": 5.0, "count": "pixels"}
    np.testing.assert_array_equal(*(decode(band).city.heights for band in bands))


def test_by_ranges_0_leaves_the_uniform_range_blocks(town):
    genome = uniformly(town).genome
    heights = decode(low_pass(genome, 0, count="ranges")).city.heights
    uniform = genome.pavement.raster(np.where(genome.uniform, genome.beta, 0))
    np.testing.assert_array_equal(heights, np.maximum(uniform, 0))


def test_a_lower_frequency_takes_more(town):
    genome = uniformly(town, reach=None).genome
    bare = [low_pass(genome, f_c).condensation.mask for f_c in (0, 1, 3, 10)]
    assert all((fewer <= more).all() for more, fewer in itertools.pairwise(bare))
    assert bare[0].sum() > bare[-1].sum() > 0


def test_the_lifs_stay_and_the_filter_is_told(town):
    genome = uniformly(town).genome
    filtered = low_pass(genome, 2, count="domains")
    assert usage(filtered).domain_calls.sum() == usage(genome).domain_calls.sum()
    assert filtered.replace(condensation=None) == genome
    assert filtered.made == {**genome.made, "low_pass": {"f_c": 2.0, "count": "domains"}}


@either_filter
def test_what_was_kept_before_is_kept(filtering, town):
    mask = np.zeros(town.shape, bool)
    mask[:20, :20] = True
    locked = Condensation(np.full(town.shape, 9.0), mask)
    genome = uniformly(town).genome.replace(condensation=locked)
    heights = decode(filtering(genome, 1)).city.heights
    assert (heights[mask] == 9).all()
    bare = FILTERS[filtering](usage(genome).pixels, 1) & ~mask
    assert bare.any()
    assert (heights[bare] == 0).all()


def test_the_ground_is_as_large_at_another_zoom(town):
    genome = uniformly(town).genome
    bare = usage(genome).pixels > 1
    heights = decode(low_pass(genome, 1), zoom=2).city.heights
    assert (heights[bare.repeat(2, axis=0).repeat(2, axis=1)] == 0).all()


@either_filter
@pytest.mark.parametrize("f_c", [-1, math.nan, "10", None, True])
def test_a_frequency_that_is_none_is_refused(filtering, f_c):
    with pytest.raises(GenomeError, match="0 or more"):
        filtering(draw_code(1), f_c)


@either_filter
@pytest.mark.parametrize("count", ["pixel", "calls", 3, None])
def test_a_count_that_is_none_is_refused(filtering, count):
    with pytest.raises(GenomeError, match="pixels, domains, ranges"):
        filtering(draw_code(1), 1, count=count)


def test_values_told_of_lyon_are_true():
    text = (Path(__file__).parents[2] / "docs" / "pictures.md").read_text("utf-8")
    words = " ".join(text.split())
    lyon = evocity.read_map("lyon-1er")
    near, whole = (usage(uniformly(lyon, reach=reach).genome) for reach in (24, None))
    most, served = near.domain_calls.max(), (near.calls > 0).sum()
    called = len(near.domain_calls)
    assert (
        f"{served} lifs of Lyon's code call {called} domain blocks, and each block at most {most} "
        in words
    )
    called, most = len(whole.domain_calls), whole.domain_calls.max()
    assert f"only {called} domain blocks, and call one block {most} times" in words
    assert (whole.pixels == 0).mean() == pytest.approx(2 / 3, abs=0.05)
    assert "lifs copy only one in three pixels of Lyon" in words


# -- range blocks and buildings as wholes ----------------------------------------------------


@either_filter
@settings(max_examples=15, deadline=None)
@given(codes, st.sampled_from(COUNTS), st.sampled_from([0, 1, 2.5, 6]))
def test_filtered_range_blocks_are_flat_at_the_height_of_most_pixels(filtering, genome, count, f_c):
    p, calls = genome.pavement, counted(genome)[1][count]
    level = FILTERS[filtering](p.blocks(calls).mean(axis=(1, 2)), f_c)
    filtered = filtering(genome, f_c, count=count, part="blocks")
    if not level.any():
        assert filtered is genome
        return
    before = set()
    while before != set(np.flatnonzero(level)):  # what copies mostly flat blocks is flat
        before, flat = set(np.flatnonzero(level)), p.raster(level)
        for i in np.flatnonzero(~genome.uniform):
            y, x, dy, dx = (int(getattr(genome, name)[i]) for name in ("y", "x", "dy", "dx"))
            level[i] |= flat[y : y + dy, x : x + dx].mean() > 0.5
    city = decode(genome).city
    for i in np.flatnonzero(level):
        labels = p.blocks(city.building_labels)[i].ravel().tolist()
        most = min(set(labels), key=lambda one: (-labels.count(one), one))
        assert filtered.beta[i] == np.float32(city.buildings.height[most - 1] if most else 0)
    assert filtered.uniform[level].all()
    for name in ("sigma", "beta", "x", "y", "dx", "dy", "iso"):
        assert np.array_equal(getattr(filtered, name)[~level], getattr(genome, name)[~level])
    # what is left is a fixed point of the filtered code, not a painted picture
    attractor = decode(filtered, tolerance=1e-4).attractor
    np.testing.assert_allclose(CollageMap(filtered)(attractor), attractor, atol=1e-3)


def test_leaves_become_flat_too(town):
    genome = evocity.encode(town, reach=None).genome
    filtered = low_pass(genome, 0, count="ranges", part="blocks")
    assert filtered.pavement == genome.pavement
    assert filtered.uniform.all()


@either_filter
@pytest.mark.parametrize("f_c", [2, 4])
def test_filtered_buildings_go_as_wholes_and_others_stay(filtering, town, f_c):
    genome = uniformly(town, reach=None).genome
    before = decode(genome).city
    labels, calls = before.labels, usage(genome).pixels
    means = [calls[labels == number].mean() for number in range(1, labels.max() + 1)]
    gone = np.flatnonzero(FILTERS[filtering](np.array(means), f_c)) + 1
    filtered = filtering(genome, f_c, part="buildings")
    assert 0 < gone.size < labels.max()
    after = decode(filtered).city
    bare = np.isin(labels, gone)
    assert (after.heights[bare] == 0).all()
    np.testing.assert_allclose(after.heights[~bare], before.heights[~bare], atol=0.1)
    assert len(after.areas) == labels.max() - gone.size
    assert filtered.made[filtering.__name__] == {
        "f_c": float(f_c), "count": "pixels", "part": "buildings",
    }  # fmt: skip


@pytest.mark.parametrize("part", PARTS)
def test_infinity_changes_no_part(town, part):
    genome = uniformly(town).genome
    assert low_pass(genome, math.inf, part=part) is genome
    assert high_pass(genome, 0, part=part) is genome


def test_an_unknown_part_is_refused():
    with pytest.raises(GenomeError, match=r"(?s)'quarters'.*pixels.*blocks.*buildings"):
        low_pass(draw_code(1), 1, part="quarters")


@pytest.mark.parametrize(
    ("name", "block", "how"),
    [
        ("lyon-1er", 8, {}),  # pixels to ground, Marsault 2002 §5.5
        ("new-york-west-village", 16, {}),  # range blocks as wide as buildings, §6.1
        ("lyon-1er", 8, {"count": "ranges", "part": "blocks"}),  # range blocks, 2005 §2.4
        ("lyon-1er", 4, {"count": "ranges", "part": "blocks"}),
        ("new-york-west-village", 4, {"count": "ranges", "part": "blocks"}),
    ],
)
def test_a_low_pass_at_1_simplifies_a_real_city_as_in_the_papers(name, block, how):
    city = evocity.read_map(name, pixels=192)
    genome = uniformly(city, block=block, reach=None).genome
    plain, simple = (decode(one).city for one in (genome, low_pass(genome, 1, **how)))
    for told in (crumbs, vertices):
        assert told(simple) <= 0.5 * told(plain)
    assert simple.built.any()


def vertices(city) -> int:
    return int(shapely.get_num_coordinates(np.array(city.outline, dtype=object)).sum())
