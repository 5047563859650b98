"""Roofs laid flat: laws over small maps and decoded districts, and a naive twin."""

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from towns import draw_town

import evocity
from evocity.citymap import CityMap
from evocity.condensation import Condensation
from evocity.errors import GenomeError, MapError
from evocity.genome.genome import descended
from evocity.views.buildings import CRUMB, STEP, settled, settled_roofs, settled_zones
from evocity.views.buildings.segmentation import ROOF_STEP

# Few heights, some within STEP of each other and some not: many ties, many rounds of uniting.
roofs = arrays(
    np.float32,
    st.tuples(st.integers(1, 9), st.integers(1, 9)),
    elements=st.sampled_from([0, 0.5, 3, 3, 4, 4.5, 5, 8, 9.25]),
)
masks = st.integers(0, 2**32 - 1).map(np.random.default_rng)


def settle(heights, keep=None, pixel=2.0):
    city = CityMap(heights, pixel)
    return settled(city.heights, city.labels, pixel, keep)


def settle_roofs(heights, keep=None, pixel=2.0):
    city = CityMap(heights, pixel)
    return settled_roofs(city.heights, city.labels, pixel, keep)


def rough(city, deviation, seed=3):
    """``city`` with roofs that no longer lie flat, and traces on its ground."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(0, deviation, city.shape)
    return np.maximum(city.heights + noise, 0).astype(np.float32)


def test_every_building_takes_the_lower_of_its_middle_heights_and_ground_is_0():
    heights = np.zeros((12, 24), np.float32)
    heights[2:10, 2:10] = np.linspace(8, 10, 64).reshape(8, 8)
    heights[2:10, 10:18] = 20
    heights[3, 11] = 40  # a chimney
    heights[11] = 1.25  # traces
    result = settle(heights)
    assert np.unique(result[2:10, 2:10]) == np.sort(heights[2:10, 2:10].ravel())[31]
    assert np.unique(result[2:10, 10:18]) == 20
    result[2:10, 2:18] = 0
    assert not result.any()


@settings(max_examples=80, deadline=None)
@given(roofs, st.sampled_from([1.0, 2.0, 3.0, 5.0]))
def test_settled_as_its_naive_twin(heights, pixel):
    city = CityMap(heights, pixel)
    least = int(np.ceil(CRUMB / pixel**2))
    zones = naive.join_crumbs(heights, naive.flat_zones(heights, city.built, STEP), least)
    expected, numbers = naive.level(heights, zones, STEP)
    result, labels = settled_zones(city.heights, city.labels, pixel)
    assert np.array_equal(result, np.where(city.built, expected, 0))
    assert np.array_equal(labels, numbers)


def test_larger_maps_as_their_naive_twin():
    heights = np.random.default_rng(4).gamma(3, 3, (40, 50)).astype(np.float32)
    city = CityMap(heights, 2.0)
    zones = naive.join_crumbs(heights, naive.flat_zones(heights, city.built, STEP), CRUMB / 4)
    expected, numbers = naive.level(heights, zones, STEP)
    result, labels = settled_zones(city.heights, city.labels, 2.0)
    assert numbers.max() < zones.max()  # some were united
    assert np.array_equal(result, np.where(city.built, expected, 0))
    assert np.array_equal(labels, numbers)


@settings(max_examples=160, deadline=None)
@given(st.sampled_from([settle, settle_roofs]), roofs, masks, st.booleans())
def test_settling_twice_is_settling_once(way, heights, rng, some):
    keep = rng.random(heights.shape) < 0.3 if some else None
    once = way(heights, keep)
    assert np.array_equal(way(once, keep), once)


@settings(max_examples=80, deadline=None)
@given(roofs)
def test_the_buildings_of_a_settled_map_are_those_that_were_laid_flat(heights):
    city = CityMap(heights, 2.0)
    result, zones = settled_zones(city.heights, city.labels, 2.0)
    again = CityMap(result, 2.0)
    assert np.array_equal(again.built, city.built)
    assert np.array_equal(again.buildings.labels, zones)
    count = zones.max(initial=0)
    assert len(again.buildings) == count
    assert np.array_equal(
        again.buildings.height, [result[zones == a][0] for a in range(1, count + 1)]
    )


@settings(max_examples=120, deadline=None)
@given(st.sampled_from([settle, settle_roofs]), roofs, masks)
def test_what_is_kept_stays_and_does_not_touch_the_rest(way, heights, rng):
    keep = rng.random(heights.shape) < 0.4
    result = way(heights, keep)
    assert np.array_equal(result[keep], heights[keep])
    other = np.where(keep, rng.gamma(2, 5, heights.shape), heights).astype(np.float32)
    assert np.array_equal(way(other, keep)[~keep], result[~keep])


@settings(max_examples=80, deadline=None)
@given(roofs, st.sampled_from([1.0, 2.0, 3.0, 5.0]))
def test_settled_roofs_as_their_naive_twin(heights, pixel):
    built = heights > 1.5
    least = int(np.ceil(CRUMB / pixel**2))
    expected = naive.settled_roofs(heights, built, least, STEP, ROOF_STEP)
    assert np.array_equal(settle_roofs(heights, pixel=pixel), expected)


def test_larger_roofs_as_their_naive_twin():
    heights = np.random.default_rng(4).gamma(3, 3, (40, 50)).astype(np.float32)
    heights = np.round(heights.repeat(2, 0)[:40].repeat(2, 1)[:, :50] / 2) * 2
    noise = np.random.default_rng(5).normal(0, 0.3, heights.shape).astype(np.float32)
    heights = np.maximum(heights + noise, 0)
    expected = naive.settled_roofs(heights, heights > 1.5, 6, STEP, ROOF_STEP)
    assert np.array_equal(settle_roofs(heights), expected)


def test_a_slope_at_a_wall_joins_no_roofs_and_fills_no_gap():
    heights = np.zeros((12, 21), np.float32)
    heights[2:10, 2:6], heights[2:10, 6:10], heights[2:10, 11:19] = 9, 11, 18
    map_ = heights.copy()
    heights[2:10:2, 5], heights[2:10:2, 6] = 9.8, 10.4  # slopes between two roofs
    heights[2:10:2, 10], heights[3:10:2, 10] = 2, 3  # a gap of one pixel that decoding raises
    heights[4, 13] = 21  # a chimney
    assert np.array_equal(settle_roofs(heights), map_)
    assert np.unique(settle(heights)[2:10, 2:10]).size == 1
    assert (settle(heights)[2:10, 10] > 0).all()


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village"])
def test_codes_with_settled_roofs_are_closer_to_the_map(name):
    city = evocity.read_map(name, metres_per_pixel=2.0)
    code = evocity.encode(city, settle="roofs").genome
    roofs, buildings, raw = (evocity.decode(code, settle=how).city for how in (None, True, False))
    assert np.array_equal(settle_roofs(roofs.heights), roofs.heights)
    errors = [np.sqrt(np.mean((one.heights - city.heights) ** 2)) for one in (roofs, buildings)]
    assert errors[0] < errors[1] / 2
    assert len(roofs.buildings) > 0.95 * len(city.buildings)
    assert np.unique(roofs.heights).size < np.unique(raw.heights).size / 10
    assert np.array_equal(roofs.building_labels, roofs.replace(roofs.heights).building_labels)


@pytest.mark.parametrize("how", [1, "walls", 0.5])
def test_other_ways_to_settle_are_refused(how):
    code = uniformly(draw_town(1, side=64)).genome
    with pytest.raises(GenomeError, match="settle"):
        evocity.decode(code, settle=how)
    with pytest.raises(GenomeError, match="settle"):
        code.replace(settle=how)


def test_genomes_with_settled_roofs_are_written_and_breed_such(tmp_path):
    code = uniformly(draw_town(1, side=64)).genome
    roofs = code.replace(settle="roofs")
    roofs.write(tmp_path / "roofs.parquet")
    again = evocity.read_genome(tmp_path / "roofs.parquet")
    assert again == roofs
    assert again.settle == "roofs"
    assert len({one.digest for one in (code, roofs, code.replace(settle=True))}) == 3
    assert descended([code, code.replace(settle=True)])[1]["settle"] is True
    assert descended([roofs, code.replace(settle=True)])[1]["settle"] == "roofs"


@pytest.mark.parametrize("seed", range(4))
def test_a_map_of_flat_roofs_stays_bit_for_bit(seed):
    flat = draw_town(seed, side=128, buildings=150).heights
    flat = settle(flat)
    heights = flat + np.float32(0.1) * (flat > 0)  # heights that no rounding would give back
    assert settle(heights).tobytes() == heights.tobytes()
    assert settle(heights, np.ones(heights.shape, bool)).tobytes() == heights.tobytes()


def test_flat_roofs_come_back_from_under_noise():
    town = CityMap(settle(draw_town(7, side=128, buildings=150).heights), 2.0)
    heights = rough(town, 0.2)
    result = settle(heights)
    assert np.array_equal(result > 0, town.built)
    assert np.abs(result - town.heights)[town.built].mean() < 0.05
    assert np.abs(heights - town.heights)[town.built].mean() > 0.15


@pytest.mark.parametrize("block", [4, 2])
@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village"])
def test_decoded_districts_are_settled_once_and_for_all(name, block):
    code = uniformly(evocity.read_map(name), block=block, domains=(2,), reach=24).genome
    city = evocity.decode(code).city
    result, zones = settled_zones(city.heights, city.labels, city.metres_per_pixel)
    after = city.replace(result)
    assert np.array_equal(settle(result), result)
    assert np.array_equal(after.buildings.labels, zones)
    assert len(after.buildings) < len(city.buildings)  # of some, the medians are within STEP
    assert evocity.fitness.roof_flatness(after) > evocity.fitness.roof_flatness(city) + 0.1


@pytest.mark.parametrize("locked", [False, True])
@pytest.mark.parametrize("settle_roofs", [False, True])
@pytest.mark.parametrize("name", ["lyon-1er", "cape-town-salt-river"])
def test_the_buildings_of_a_decoded_map_are_those_it_would_find(name, settle_roofs, locked):
    city = evocity.read_map(name, pixels=128)
    code = uniformly(city).genome
    if locked:
        mask = np.zeros(city.shape, bool)
        mask[30:70, 50:90] = True
        code = code.replace(condensation=Condensation(city.heights, mask))
    known = evocity.decode(code, settle=settle_roofs).city
    fresh = CityMap(known.heights, known.metres_per_pixel)
    assert np.array_equal(known.building_labels, fresh.building_labels)
    assert np.array_equal(known.buildings.labels, fresh.told_apart().labels)
    assert not known.building_labels.flags.writeable


@pytest.mark.parametrize("shape", [(1, 1), (5, 7)])
def test_a_map_without_buildings_becomes_bare(shape):
    assert not settle(np.full(shape, 1.5, np.float32)).any()


def test_a_mask_of_another_shape_is_refused():
    with pytest.raises(MapError, match=r"'keep' has the shape \(3, 4\)"):
        settle(np.zeros((4, 4), np.float32), np.zeros((3, 4), bool))
