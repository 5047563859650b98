"""Places and footprints that stand twice: laws, naive twins, turned footprints."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from leaves import draw_leaves, draw_pavement
from scipy import ndimage
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.errors import FitnessError
from evocity.fitness import _kernels, repeated_footprints, repetition
from evocity.fitness.copies import equal_footprints, footprint_moments, repeated_places
from evocity.genome import VOID, Pieces, laid, packed

seeds = st.integers(0, 2**32)


def town(seed, side=64, **drawn):
    city = draw_town(seed, side, **drawn)
    return city.replace(city.heights, name=f"city-{seed}")


def own(city, seed=0):
    """A code on leaves whose stones are those of the ``city``, each in its place."""
    pavement = draw_pavement(seed, *city.shape)
    zero = np.zeros(len(pavement), np.uint8)
    return draw_leaves(seed, pavement).replace(
        source=packed(*pavement.corners), turn=zero, parent=zero, other=zero, cities=(city.name,)
    )


def copied(genomes, whose, row, column, iso, cell=8):
    return laid(genomes, Pieces(cell, whose, row, column, iso)).genome


def shown(genome, sources):
    """The map that stones alone would show."""
    heights = np.zeros((genome.pavement.height, genome.pavement.width))
    maps = {city.name: city.heights for city in sources}
    for at, (_, (name, row, column, _)) in naive.shown_pixels(genome).items():
        if name in maps:
            heights[at] = maps[name][row, column]
    return CityMap(heights, 2.0)


# -- places --------------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_places_elsewhere_as_their_naive_twin(seed):
    rng = np.random.default_rng(seed)
    count, room = int(rng.integers(1, 60)), int(rng.choice([3, 8, 40]))
    places = rng.integers(0, room, (3, count))
    places[0] %= 2
    pixels = rng.integers(0, 32, (2, count))
    heads, following = np.zeros((8, 8), np.int32), np.empty(count, np.int32)
    again = np.zeros(count, bool)
    _kernels.stand_elsewhere(places, pixels, 6, heads, following, again)
    assert again.tolist() == naive.stand_elsewhere(places, pixels, 6)


@pytest.mark.slow
@given(seeds)
@settings(max_examples=10, deadline=None)
def test_repeated_places_pixel_by_pixel(seed):
    rng = np.random.default_rng(seed)
    sources = [town(1), town(2)]
    whose, iso = rng.integers(0, 2, (8, 8)), rng.integers(0, 8, (8, 8))
    row, column = rng.integers(0, 8, (2, 8, 8))
    child = copied([own(city, seed % 7) for city in sources], whose, row, column, iso)
    city = shown(child, sources)
    told = {at: stone for at, (_, stone) in naive.shown_pixels(child).items() if city.built[at]}
    pixels = np.array(sorted(told)).T
    names = [told[tuple(at)] for at in pixels.T.tolist()]
    places = np.array([[int(name[5:]), row, column] for name, row, column, _ in names]).T
    marked = repeated_places(city, child)[tuple(pixels)]
    assert marked.tolist() == naive.stand_elsewhere(places, pixels, 6)


@given(seeds)
@settings(max_examples=10, deadline=None)
def test_a_code_and_its_turns_repeat_nothing(seed):
    city = town(seed % 50)
    code = own(city, seed)
    assert repetition(city, code) == 0
    grid = np.indices((8, 8))
    for iso in range(8):
        row, column = (isometries.apply(iso, one) for one in grid)
        turned = copied([code], np.zeros((8, 8), int), row, column, np.full((8, 8), iso))
        assert repetition(shown(turned, [city]), turned) == 0


def test_a_half_that_is_copied_stands_twice():
    city = town(3)
    grid, zero = np.indices((8, 8)), np.zeros((8, 8), int)
    column = grid[1] % 4  # the western half, twice
    child = copied([own(city)], zero, grid[0], column, zero)
    twice = shown(child, [city])
    assert repetition(twice, child) == 1
    # a mirror image too, but for what is nearer to the axis than 12 m
    mirrored = np.where(grid[1] < 4, grid[1], 7 - grid[1])
    iso = np.where(grid[1] < 4, 0, _mirror())
    child = copied([own(city)], zero, grid[0], mirrored, iso)
    twice = shown(child, [city])
    assert np.array_equal(twice.heights, twice.heights[:, ::-1])
    marked = repeated_places(twice, child)
    away = abs(np.arange(64) - 31.5) > 4
    assert marked[:, away].sum() == twice.built[:, away].sum()
    assert not marked[:, 30:34].any()


def _mirror():
    """The isometry that mirrors east and west."""
    square = np.arange(4).reshape(2, 2)
    return next(k for k in range(8) if (isometries.apply(k, square) == square[:, ::-1]).all())


def test_lineages_do_not_matter_and_cities_do():
    one, other = town(3), town(4)
    grid, zero = np.indices((8, 8)), np.zeros((8, 8), int)
    west = grid[1] < 4
    halves = [own(one), own(other)]
    child = copied(halves, np.where(west, 0, 1), *grid, zero)
    assert repetition(shown(child, [one, other]), child) == 0
    # the other half comes from the same city, by a child and another pavement
    middle = copied([own(one, 5)], zero, *grid, zero)
    again = copied([child, middle], np.where(west, 0, 1), grid[0], grid[1] % 4, zero)
    assert repetition(shown(again, [one, other]), again) == 1


def test_open_ground_that_was_added_has_no_place():
    city = town(3)
    code = own(city).replace(cities=(VOID,))
    assert repetition(city, code) == 0


def test_a_source_s_own_code_repeats_nothing_when_decoded():
    lyon = evocity.read_map("lyon-1er", pixels=128)
    code = evocity.encode(lyon, fit=False).genome
    assert repetition(evocity.decode(code).city, code) == 0


def test_a_map_of_another_size_is_refused():
    with pytest.raises(FitnessError, match="64 × 64 px, but its genome has 32 × 32 px"):
        repeated_places(town(1), own(town(1, 32, buildings=6)))


def test_nothing_built_has_no_share():
    bare = CityMap(np.zeros((64, 64)), 2.0)
    assert repetition(bare, own(town(1))).reason == "nothing is built"
    assert repeated_footprints(bare).reason == "no building of 100 m² and 25 pixels or more"


# -- footprints ----------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=15, deadline=None)
def test_moments_as_their_naive_twin(seed):
    table = town(seed).buildings
    sums = np.zeros((len(table), 12))
    y, x = table.y / 2 - 0.5, table.x / 2 - 0.5
    _kernels.add_moments(table.labels, y, x, sums)
    expected = np.array(naive.add_moments(table.labels, y, x)).reshape(-1, 12)
    np.testing.assert_allclose(sums, expected, rtol=1e-9, atol=1e-6)


@given(seeds)
@settings(max_examples=30, deadline=None)
def test_columns_that_come_again_as_their_naive_twin(seed):
    rng = np.random.default_rng(seed)
    table, slack = rng.integers(0, 4, (3, 12)) / 4, rng.uniform(0, 0.6, (3, 12))
    order = np.argsort(table[0])
    table, slack = table[:, order].copy(), slack[:, order].copy()
    again = np.zeros(12, bool)
    _kernels.come_again(table, slack, again)
    assert again.tolist() == naive.come_again(table, slack)


def house(rng, side=40, parts=3):
    """A building of a few wings, bool, in the middle of nothing."""
    mask = np.zeros((side, side), bool)
    for _ in range(parts):
        top, left = rng.integers(8, 16, 2)
        tall, wide = rng.integers(8, 18, 2)
        mask[top : top + tall, left : left + wide] = True
    return mask


def turned(mask, degrees, mirror, pixels=2):
    """``mask`` under an angle, by ``pixels`` finer pixels a side."""
    fine = np.kron(np.pad(mask, 12), np.ones((pixels, pixels)))
    fine = ndimage.rotate(fine[:, ::-1] if mirror else fine, degrees, reshape=False, order=1)
    return fine[pixels // 2 :: pixels, pixels // 2 :: pixels] > 0.5


def beside(*masks):
    return CityMap(9.0 * np.concatenate(masks, axis=1), 2.0)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_a_small_house_comes_again_turned_or_mirrored(seed):
    rng = np.random.default_rng(seed)
    mask = house(rng, side=40)[::2, ::2]
    copy = isometries.apply(int(rng.integers(8)), mask)
    other = mask.copy()
    other[np.argwhere(mask)[0][0] - 1, np.argwhere(mask)[0][1]] = True  # a pixel more
    assert equal_footprints(beside(mask, copy)).all()
    assert not equal_footprints(beside(mask, other)).any() or mask.sum() >= 100


def test_large_houses_come_again_under_any_angle():
    rng = np.random.default_rng(5)
    again = []
    for degrees in range(3, 90, 6):
        mask = house(rng)
        again += [equal_footprints(beside(np.pad(mask, 12), turned(mask, degrees, degrees % 2)))]
    assert np.mean(again) > 0.85


def test_different_houses_do_not_come_again():
    rng = np.random.default_rng(6)
    houses = [house(rng) for _ in range(30)]
    assert equal_footprints(beside(*houses)).mean() < 0.25


def test_moments_of_a_square_and_of_a_long_house():
    heights = np.zeros((64, 64))
    heights[4:24, 4:24] = heights[30:40, 4:44] = 9
    pixels, moments = footprint_moments(CityMap(heights, 2.0))
    assert pixels.tolist() == [400, 400]
    assert moments[0] == pytest.approx([1 / 6, (4 + 1 / 4) / 12], rel=0.01)
    assert moments[1] == pytest.approx([0, (4 - 1 / 4) / 12], rel=0.01)
    assert moments[2:4] == pytest.approx(0)


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village", "cape-town-salt-river"])
def test_real_cities_have_few_equal_footprints_and_two_of_them_only_such(name):
    city = evocity.read_map(name)
    assert repeated_footprints(city) < 0.06
    twice = city.replace(np.concatenate([city.heights, city.heights[::-1].T]))
    assert repeated_footprints(twice) > 0.9
    far = equal_footprints(city.replace(np.pad(city.heights, 3)))
    assert far.mean() < 0.06


def test_a_coarse_raster_shows_no_small_footprint():
    heights = np.zeros((64, 64))
    heights[4:10, 4:8] = heights[20:26, 30:34] = heights[40:46, 4:9] = heights[50:56, 30:35] = 9
    assert repeated_footprints(CityMap(heights, 2.0)) == 1  # two of 120 m²; those of 96 m² do not
    assert equal_footprints(CityMap(heights, 4.0)).tolist() == [False, False, True, True]
    assert repeated_footprints(CityMap(heights[:30], 4.0)).reason.startswith("no building")
