"""Autosimilarity: laws first, then the slow twin that tries everything."""

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.coding import autosimilarity, autosimilarity_maps, free_block_maps
from evocity.coding.autosimilarity import RESOLUTION
from evocity.errors import GenomeError


def city_of(heights) -> CityMap:
    return CityMap(np.asarray(heights, np.float32), 2.0, name="town")


def town_heights(seed: int, side: int = 24) -> np.ndarray:
    return draw_town(seed, side=side, buildings=side // 2).heights


def rough_heights(seed: int, side: int = 24) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (town_heights(seed, side) + 2 * rng.random((side, side))).astype(np.float32)


def circles(side: int = 20) -> np.ndarray:
    y, x = np.mgrid[:side, :side] - side / 2
    return 10 + 10 * np.sin(np.hypot(y, x))


def checkerboard(period: int, side: int = 20) -> np.ndarray:
    y, x = np.mgrid[:side, :side] // period
    return 10.0 * ((y + x) % 2)


MAPS = {
    "town": town_heights(1),
    "rough town": rough_heights(2),
    "not square": rough_heights(3)[:17, :23],
    "circles": circles(),
    "checkerboard of period B": checkerboard(4),
    "millimetres": circles() * 1e-4,
    "ten kilometres": circles() * 1e3,
    "exact ties": np.tile(np.random.default_rng(3).integers(0, 3, (4, 4)) * 3.0, (5, 5)),
    "slight relief on a plateau": 300 + 0.02 * np.random.default_rng(5).random((18, 18)),
    "one pixel": np.pad(np.full((1, 1), 9.0), ((6, 11), (9, 8))),
}


def assert_like(found, truth):
    mean, least, curve = truth
    np.testing.assert_allclose(found.mean, mean, atol=RESOLUTION)
    np.testing.assert_allclose(found.least, least, atol=RESOLUTION)
    assert list(found.curve) == sorted(curve)
    for extent, value in curve.items():
        assert found.curve[extent] == pytest.approx(value, abs=RESOLUTION)


# -- laws -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", MAPS)
def test_errors_lie_between_0_and_1_and_the_least_below_the_mean(name):
    found = autosimilarity_maps(city_of(MAPS[name]), block=4, domains=(7, 8))
    assert found.mean.dtype == found.least.dtype == np.float32
    assert found.mean.shape == found.least.shape == MAPS[name].shape
    assert found.least.min() >= 0
    assert found.mean.max() <= 1
    assert (found.least <= found.mean).all()


@pytest.mark.parametrize("iso", range(8))
def test_a_turned_map_has_turned_errors(iso):
    heights = rough_heights(4)
    plain = autosimilarity_maps(city_of(heights), block=4, domains=(7, 9))
    turned = autosimilarity_maps(city_of(isometries.apply(iso, heights)), block=4, domains=(7, 9))
    np.testing.assert_allclose(turned.mean, isometries.apply(iso, plain.mean), atol=RESOLUTION)
    np.testing.assert_allclose(turned.least, isometries.apply(iso, plain.least), atol=RESOLUTION)


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 99), st.floats(1e-4, 1e3), st.floats(0, 10))
def test_neither_unit_nor_level_of_heights_matters(seed, scale, level):
    heights = rough_heights(seed, side=14).astype(float)
    plain = autosimilarity_maps(city_of(heights), block=4, domains=6)
    other = autosimilarity_maps(city_of((heights + level) * scale), block=4, domains=6)
    np.testing.assert_allclose(other.mean, plain.mean, atol=RESOLUTION)
    np.testing.assert_allclose(other.least, plain.least, atol=RESOLUTION)


def test_more_domains_explain_no_less():
    city = city_of(rough_heights(6))
    free = autosimilarity_maps(city, block=4, domains=range(5, 13))
    for extent in free.curve:
        fixed = autosimilarity_maps(city, block=4, domains=extent)
        assert (free.mean <= fixed.mean).all()
        assert (free.least <= fixed.least).all()
        assert fixed.curve == {extent: free.curve[extent]}


def test_a_plane_is_like_itself_everywhere():
    y, x = np.mgrid[:30, :26]
    found = autosimilarity_maps(city_of(x + 2 * y), block=6, domains=(12, 18))
    assert found.mean.max() <= RESOLUTION
    assert max(found.curve.values()) <= RESOLUTION


@pytest.mark.parametrize("iso", range(8))
def test_a_block_with_its_enlargement_is_found(iso):
    rng = np.random.default_rng(7)
    heights = 30 * rng.random((24, 24))
    heights[8:20, 10:22] = np.kron(20 - 0.5 * heights[1:7, 2:8], np.ones((2, 2)))
    heights[8:20, 10:22] = isometries.apply(iso, heights[8:20, 10:22])
    found = autosimilarity_maps(city_of(heights), block=6, domains=12)
    assert found.least[1:7, 2:8].max() <= RESOLUTION
    assert found.mean[1:7, 2:8].min() > 100 * RESOLUTION
    assert found.least[22:, :8].min() > 100 * RESOLUTION


@pytest.mark.parametrize("height", [0.0, 12.5])
def test_one_height_everywhere_has_no_error(height):
    found = autosimilarity_maps(city_of(np.full((20, 22), height)), block=4, domains=(6, 8))
    assert not found.mean.any()
    assert not found.least.any()
    assert found.curve == {6: 0, 8: 0}
    free = free_block_maps(city_of(np.full((20, 22), height)), blocks=(4, 5))
    assert (free.largest == 5).all()
    assert (free.likeness == 5).all()


def test_threads_and_bands_change_nothing(monkeypatch):
    city = city_of(rough_heights(8, side=40))
    options = {"block": 4, "domains": (7, 8)}
    one, several = (autosimilarity_maps(city, threads=n, **options) for n in (1, 3))
    np.testing.assert_array_equal(one.mean, several.mean)
    np.testing.assert_array_equal(one.least, several.least)
    assert one.curve == several.curve
    monkeypatch.setattr(autosimilarity, "_BAND", 16 * 8 * 40 * 5)  # five rows
    banded = autosimilarity_maps(city, **options)
    np.testing.assert_allclose(banded.mean, one.mean, atol=RESOLUTION)
    np.testing.assert_allclose(banded.least, one.least, atol=RESOLUTION)
    assert banded.curve == pytest.approx(one.curve, abs=RESOLUTION)


@pytest.mark.parametrize("heights", [rough_heights(9), np.zeros((24, 24))], ids=["town", "ground"])
def test_progress_grows_to_the_whole(heights):
    told = []
    free_block_maps(
        city_of(heights), blocks=(4, 6), progress=lambda done, total: told.append((done, total))
    )
    done, totals = zip(*told, strict=True)
    assert len(set(totals)) == 1
    assert list(done) == sorted(done)
    assert done[-1] == totals[0] == 21**2 * 17**2 + 19**2 * 13**2


# -- the slow twin ----------------------------------------------------------------------------


@pytest.mark.parametrize("domains", [8, 7, (5, 11), range(5, 10)], ids=str)
@pytest.mark.parametrize("name", MAPS)
def test_same_as_trying_everything(name, domains):
    heights = np.asarray(MAPS[name], np.float32)
    found = autosimilarity_maps(city_of(heights), block=4, domains=domains)
    extents = [domains] if isinstance(domains, int) else domains
    assert_like(found, naive.autosimilarity_maps(heights, 4, extents))


@pytest.mark.parametrize(("block", "domain"), [(2, 3), (3, 7), (5, 6), (7, 16), (8, 20)])
def test_same_as_trying_everything_for_other_blocks(block, domain):
    heights = rough_heights(10)
    found = autosimilarity_maps(city_of(heights), block=block, domains=domain)
    assert_like(found, naive.autosimilarity_maps(heights, block, [domain]))


def test_same_as_trying_everything_at_48():
    heights = town_heights(11, side=48)
    found = autosimilarity_maps(city_of(heights), block=8, domains=20)
    assert_like(found, naive.autosimilarity_maps(heights, 8, [20]))


def test_free_blocks_are_the_best_of_all():
    heights = rough_heights(12)
    heights[:8, :8] = 0  # all B fit the ground: the largest is taken
    found = free_block_maps(city_of(heights), blocks=(6, 3, 4), domains=range(7, 10))
    every = [naive.autosimilarity_maps(heights, b, range(7, 10))[1] for b in (3, 4, 6)]
    least = np.min(every, axis=0)
    np.testing.assert_allclose(found.least, least, atol=RESOLUTION)
    # where two sizes are as good but for rounding, either may be the largest
    clear = np.ptp(np.sort(every, axis=0)[:2], axis=0) > 1e-5
    clear |= np.max(every, axis=0) < 1e-12
    sizes = np.array([3, 4, 6])
    largest = sizes[2 - np.argmax((np.array(every) <= least + 1e-12)[::-1], axis=0)]
    assert clear.mean() > 0.5
    np.testing.assert_array_equal(found.largest[clear], largest[clear])
    assert (found.largest[:6, :6] == 6).all()
    assert len(np.unique(found.largest)) == 3
    np.testing.assert_allclose(found.likeness, (1 - found.least) * found.largest)
    assert list(found.maps) == [3, 4, 6]


def test_shrinking_shares_seams_by_area():
    values = np.random.default_rng(13).random((9, 11))
    found = autosimilarity._shrunk(values, 4, 7, axis=0)
    found = autosimilarity._shrunk(found, 4, 7, axis=2).swapaxes(0, 1)
    assert found.shape == (4, 4, 3, 5)
    for y, x in np.ndindex(3, 5):
        truth = naive.area_weighted(values[y : y + 7, x : x + 7], 4)
        np.testing.assert_allclose(found[:, :, y, x], truth, atol=1e-12)


# -- what is refused --------------------------------------------------------------------------


@pytest.mark.parametrize(
    "options",
    [
        {"block": 1},
        {"block": 4.5},
        {"block": "8"},
        {"block": 8, "domains": 8},
        {"block": 8, "domains": (20, 7)},
        {"block": 8, "domains": 25},
        {"block": 8, "domains": ()},
        {"block": 8, "domains": 16.5},
        {"block": 13},
        {"threads": 0},
    ],
    ids=str,
)
def test_what_cannot_be_is_refused(town, options):
    city = city_of(town_heights(1))
    with pytest.raises(GenomeError, match="what to do"):
        autosimilarity_maps(city, **options)
    block = options.pop("block", 8)
    with pytest.raises(GenomeError, match="what to do"):
        free_block_maps(city, blocks=(3, block), **options)


def test_no_block_is_refused():
    with pytest.raises(GenomeError, match="one size of range blocks"):
        free_block_maps(city_of(town_heights(1)), blocks=())
