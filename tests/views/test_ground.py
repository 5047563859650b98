"""Ground: distances against SciPy, nesting against filled holes, streets of known width."""

import math

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from skimage.measure import euler_number
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.views.ground import WIDEST, distance_to_built, open_space, streets
from evocity.views.ground._kernels import link_lengths, nest, thin, widths_across
from evocity.views.ground.lines import DENT
from evocity.views.ground.space import nearest_built

BOTH = np.ones((3, 3))


@st.composite
def masks(draw, smallest=1):
    shape = draw(st.integers(smallest, 14)), draw(st.integers(smallest, 14))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    return rng.random(shape) < draw(st.sampled_from([0.0, 0.05, 0.3, 0.6, 0.9, 1.0]))


def town(side=128):
    return draw_town(7, side=side, buildings=150)


# -- distance ----------------------------------------------------------------------------


@settings(deadline=None)
@given(masks())
def test_distances_are_those_of_the_nearest_of_all_built_pixels(built):
    squares, nearest = nearest_built(built)
    assert np.array_equal(squares, naive.squared_distances(built))
    if built.any():
        assert built[tuple(nearest)].all()
        offset = nearest - np.indices(built.shape)
        assert np.array_equal((offset**2).sum(axis=0), squares)
    else:
        assert np.all(nearest == -1)


@pytest.mark.parametrize("shape", [(200, 300), (1, 400), (400, 1), (97, 61)])
@pytest.mark.parametrize("share", [1e-4, 1e-2, 0.5])
def test_distances_are_those_of_scipy(shape, share):
    rng = np.random.default_rng(11)
    built = rng.random(shape) < share
    built[rng.integers(shape[0]), rng.integers(shape[1])] = True
    truth = ndimage.distance_transform_edt(~built, sampling=0.7)
    ours = distance_to_built(built, 0.7)
    assert ours.dtype == np.float32
    assert ours == pytest.approx(truth, rel=1e-6)


def test_distance_of_the_bundled_views():
    city = town()
    assert np.all(city.distance_to_built[city.built] == 0)
    assert np.all(city.distance_to_built[~city.built] >= city.metres_per_pixel)
    empty = CityMap(np.zeros((5, 7)), 2.0)
    assert np.all(np.isinf(empty.distance_to_built))


# -- open space --------------------------------------------------------------------------


@settings(deadline=None)
@given(masks())
def test_nesting_is_that_of_filled_holes(built):
    buildings, builts = ndimage.label(built)
    grounds, count = ndimage.label(~built, structure=BOTH)
    pixels, enclosed_by = np.empty(count, np.int64), np.empty(count, np.int32)
    enclosed = np.empty(builts, np.int64)
    nest(grounds, buildings, pixels, enclosed_by, enclosed)
    expected = naive.nest(grounds, buildings)
    assert (pixels.tolist(), enclosed_by.tolist(), enclosed.tolist()) == expected


def test_rings_within_rings():
    distance = np.maximum(*np.abs(np.mgrid[-10:11, -10:11]))
    built = (distance % 4 == 0) & (distance > 0)  # rings at 4 and 8
    space = open_space(ndimage.label(built)[0].astype(np.int32), 2.0)
    assert space.labels[0, 0] == 1
    assert space.enclosed_by.tolist() == [-1, 0, 1]
    assert space.area.tolist() == [4 * (21**2 - 17**2), 4 * (15**2 - 9**2), 4 * 7**2]
    assert space.enclosed.tolist() == [4 * 15**2, 4 * 7**2]


def test_a_courtyard_opens_at_a_corner_and_at_the_border():
    ring = np.zeros((9, 9))
    ring[2:7, 2:7] = 9
    ring[3:6, 3:6] = 0
    assert CityMap(ring, 1.0).open_space.enclosed.tolist() == [9]
    assert CityMap(ring[3:], 1.0).open_space.enclosed_by.tolist() == [-1, -1]
    ring[2, 2] = 0  # now the yard touches the ground outside by a corner
    space = CityMap(ring, 1.0).open_space
    assert (space.enclosed_by.tolist(), space.enclosed.tolist()) == ([-1], [0])


@settings(deadline=None)
@given(masks())
def test_the_pieces_are_all_the_ground(built):
    city = CityMap(9.0 * built, 2.0)
    space = city.open_space
    assert np.array_equal(space.labels > 0, ~built)
    assert space.area.sum() == 4 * np.count_nonzero(~built)
    assert space.labels.max(initial=0) == space.area.size == space.enclosed_by.size
    assert space.enclosed.size == city.areas.size
    assert space.labels.dtype == space.enclosed_by.dtype == np.int32


# -- streets -----------------------------------------------------------------------------


def around(built, widest):
    """What `thin` is given by `streets`."""
    squares, nearest = nearest_built(built)
    border = ndimage.distance_transform_cdt(np.pad(np.ones(built.shape), 1))[1:-1, 1:-1] - 1
    solid = (squares < 0) | (squares >= border.astype(int) ** 2) | (4 * squares > widest**2)
    return squares, nearest, solid


@settings(deadline=None, max_examples=60)
@given(masks(smallest=5), st.sampled_from([3.0, 8.0, 100.0]), st.sampled_from([0.0, 1.0, 2.0]))
def test_thinning_is_that_of_its_twin(built, widest, depth):
    squares, nearest, solid = around(built, widest)
    lines = ~built
    thin(built, squares, nearest, solid, depth, lines)
    expected = naive.thin(built, squares, nearest, solid, depth)
    assert np.array_equal(lines, expected)
    lines &= ~solid
    widths = np.empty(built.shape, np.float32)
    widths_across(squares, lines, widths)
    assert widths == pytest.approx(naive.widths_across(squares, lines), rel=1e-6)
    lengths = np.empty(np.count_nonzero(lines), np.float32)
    link_lengths(lines, lengths)
    assert lengths == pytest.approx(naive.link_lengths(lines), rel=1e-6)


def test_thinning_a_town_is_that_of_its_twin():
    built = draw_town(3, buildings=25).built
    squares, nearest, solid = around(built, 30.0)
    lines = ~built
    thin(built, squares, nearest, solid, DENT, lines)
    assert np.array_equal(lines, naive.thin(built, squares, nearest, solid, DENT))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("widest", [20.0, 1000.0])
def test_thinning_keeps_the_topology(seed, widest):
    built = draw_town(seed, side=96, buildings=60).built
    squares, nearest, solid = around(built, widest)
    lines = ~built
    thin(built, squares, nearest, solid, DENT, lines)
    pieces = [ndimage.label(one, structure=BOTH)[1] for one in (lines, ~built)]
    assert pieces[0] == pieces[1]
    assert euler_number(lines, connectivity=2) == euler_number(~built, connectivity=2)
    assert np.all(lines <= ~built)
    thinned = lines & ~solid
    squares_of_four = thinned[:-1, :-1] & thinned[1:, :-1] & thinned[:-1, 1:] & thinned[1:, 1:]
    assert not squares_of_four.any()


@pytest.mark.parametrize(
    ("gap", "turned"), [(1, False), (2, True), *((gap, gap % 2 == 1) for gap in range(1, 13))]
)
def test_a_street_of_so_many_pixels_reads_so_many(gap, turned):
    built = np.ones((90, 60), bool)
    built[:, 20 : 20 + gap] = False
    found = streets(built.T if turned else built, 0.5)
    assert set(found.widths.tolist()) == {0.5 * gap}
    assert np.all(found.skeleton.sum(axis=0 if turned else 1) <= 1)
    cut = (gap + 1) // 2 + 1  # pixels at either end whose disc the border cuts
    assert found.length == pytest.approx(0.5 * (90 - 2 * cut - 1))


@pytest.mark.parametrize("degrees", [10, 22.5, 30, 45, 60, 80])
def test_a_slanting_street_is_as_wide_within_a_pixel(degrees):
    y, x = np.mgrid[-80:80, -80:80] + 0.5
    angle = math.radians(degrees)
    built = np.abs(x * math.sin(angle) - y * math.cos(angle)) > 6
    found = streets(built, 1.0)
    mean = (found.widths * found.lengths).sum() / found.length
    assert mean == pytest.approx(12, abs=0.5)
    assert np.abs(found.widths - 12).max() <= 1.2
    assert found.length == pytest.approx(found.skeleton.sum(), rel=0.45)
    across = 160 / max(math.sin(angle), math.cos(angle))
    assert found.length == pytest.approx(across, rel=0.15)


def test_a_crossing_has_four_arms_and_corners_have_none():
    built = np.ones((81, 81), bool)
    built[36:45] = built[:, 36:45] = False
    found = streets(built, 2.0)
    ends = [
        len(naive.neighbours(found.skeleton, y, x)) == 1 for y, x in np.argwhere(found.skeleton)
    ]
    assert sum(ends) == 4
    dead_end = np.ones((61, 81), bool)
    dead_end[26:35, 20:] = False
    lines = streets(dead_end, 2.0).skeleton
    assert np.flatnonzero(lines.any(axis=1)).tolist() == [30]


def test_a_dent_has_no_street_and_an_alley_has():
    built = np.ones((80, 80), bool)
    built[30:40] = False
    built[40:42, 30:33] = False
    lines = streets(built, 2.0).skeleton
    assert lines.sum(axis=0).max() == 1
    assert not lines[38:].any()
    built[40:60, 30:33] = False
    assert streets(built, 2.0).skeleton[42:58, 31].all()


def test_what_the_border_cuts_and_what_is_too_wide_is_no_street():
    strip = np.zeros((60, 60), bool)
    strip[20:30] = True  # ground above and below reaches the border
    assert not streets(strip, 2.0).skeleton.any()
    built = np.ones((200, 200), bool)
    built[:, 60:140] = False
    assert streets(built, 60 / 80).widths.max() == pytest.approx(WIDEST)
    assert streets(built, 61 / 80).widths.size == 0
    one = np.zeros((64, 64), bool)
    one[20:30, 24:40] = True
    assert not streets(one, 2.0).skeleton.any()


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 3), (5, 5)])
@pytest.mark.parametrize("built", [False, True])
def test_maps_without_streets(shape, built):
    found = streets(np.full(shape, built), 2.0)
    assert found.widths.size == found.lengths.size == 0
    assert found.length == 0
    assert not found.skeleton.any()
    assert not found.width.any()


def test_streets_agree_with_themselves():
    city = town()
    found = city.streets
    assert np.array_equal(found.width > 0, found.skeleton)
    assert np.array_equal(found.width[found.skeleton], found.widths)
    assert not (found.skeleton & city.built).any()
    assert found.widths.min() >= city.metres_per_pixel
    assert found.widths.max() <= WIDEST
    assert found.length == pytest.approx(found.lengths.sum(), rel=1e-5)
    twice = 2 * city.distance_to_built[found.skeleton]  # wall to wall, but for a pixel
    assert np.abs(twice - found.widths).max() <= 1.5 * city.metres_per_pixel


# -- all of them -------------------------------------------------------------------------


@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_the_city_turns_its_ground(iso):
    city = town()
    turned = city.replace(isometries.apply(iso, city.heights))
    expected = isometries.apply(iso, city.distance_to_built)
    assert np.array_equal(turned.distance_to_built, expected)
    for key in ("area", "enclosed"):
        ours, theirs = getattr(turned.open_space, key), getattr(city.open_space, key)
        assert np.sort(ours).tolist() == np.sort(theirs).tolist()
    assert turned.streets.length == pytest.approx(city.streets.length, rel=0.02)
    # which of two pixels beside the middle stays depends on the order, and little else
    near = ndimage.binary_dilation(turned.streets.skeleton, BOTH, iterations=2)
    line = isometries.apply(iso, city.streets.skeleton)
    assert (near & line).sum() > 0.97 * line.sum()


def test_larger_pixels_are_only_a_unit():
    built = town().built
    assert distance_to_built(built, 6.0) == pytest.approx(3 * distance_to_built(built, 2.0))
    small, large = streets(built, 2.0, widest=30), streets(built, 6.0, widest=90)
    assert np.array_equal(small.skeleton, large.skeleton)
    assert large.widths == pytest.approx(3 * small.widths)
    assert large.length == pytest.approx(3 * small.length)


def test_views_are_kept_and_read_only():
    city = town()
    space, lines = city.open_space, city.streets
    assert city.streets is lines
    assert city.open_space is space
    arrays = [city.distance_to_built, space.labels, space.area, space.enclosed_by]
    arrays += [space.enclosed, lines.skeleton, lines.width, lines.widths, lines.lengths]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
