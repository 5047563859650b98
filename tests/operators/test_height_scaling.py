"""Height scaling: whole storeys, no building joined or lost, and what is meant is decoded."""

from functools import cache

import naive
import numpy as np
import pytest
from codes import uniformly
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from leaves import draw_pavement
from rearranged import ODD, assert_laws, district, odd_maps, town
from towns import draw_town

import evocity
from evocity.citymap import BUILT_ABOVE, STOREY, CityMap
from evocity.coding import decode, encode
from evocity.coding.collage_map import CollageMap
from evocity.condensation import Condensation
from evocity.errors import OperatorError
from evocity.fitness import fsi
from evocity.fitness.heredity import integrity_of, whole_buildings
from evocity.genome import Genome
from evocity.operators import HeightField, HeightScaling
from evocity.operators._kernels import block_moments
from evocity.operators.building_heights import Storeys, refit_lifs
from evocity.operators.grid import common_grid
from evocity.operators.street_blocks import street_blocks

VARIANTS = [
    HeightScaling(),
    HeightScaling(what="buildings", share=0.5),
    HeightScaling(share=1.0, factors=(0.3, 3.0), repair=None),
    HeightScaling(what="buildings", share=1.0, storey=2.5, highest=18.0, repair=None),
    HeightField(),
    HeightField(side=2, values=(0.5, 2.0, 1.0, 1.5), repair=None),
]
KEPT = ("x", "y", "dx", "dy", "iso", "parent", "source", "turn")


@cache
def houses(seed: int = 3, settle: bool = False) -> Genome:
    how = {"block": (2, 16), "lifs": 1500, "fit": False, "settle": settle}
    return encode(draw_town(seed, side=96, buildings=16), **how).genome


@cache
def flat(seed: int = 3) -> Genome:
    """Houses on no two of which a pixel is rough: range blocks of 2 px, decoded as they are."""
    return uniformly(draw_town(seed, side=96, buildings=16), block=2, settle=True).genome


def parents():
    return town(), houses(), houses(settle=True)


def changed(parent: Genome, operator, seed: int):
    """(the map of the parent, that which is meant, storeys by which each building changes)."""
    draft = operator.draft([parent], np.random.default_rng(seed))
    raw, labels = np.maximum(decode(parent).attractor, 0), decode(parent).city.building_labels
    storeys = np.zeros(labels.max() + 1)
    for one in range(1, storeys.size):
        steps = (draft.intended - raw)[labels == one]
        storeys[one] = steps[np.argmax(np.abs(steps))] / operator.storey
    return draft, raw, storeys


@pytest.mark.parametrize("operator", VARIANTS, ids=str)
@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 2**32))
def test_laws(operator, seed):
    for parent in parents():
        child = assert_laws(operator, parent, seed)
        draft, raw, storeys = changed(parent, operator, seed)
        for name in KEPT:
            assert np.array_equal(getattr(draft.genome, name), getattr(parent, name))
        assert storeys == pytest.approx(np.rint(storeys), abs=1e-4)
        labels = decode(parent).city.building_labels
        assert np.array_equal(draft.intended[labels == 0], raw[labels == 0])
        # what was lower than a storey may stay, else all of a building moves alike
        moved = raw + operator.storey * np.rint(storeys)[labels]
        stays = (moved < np.minimum(raw, operator.storey)) & (labels > 0)
        assert draft.intended[~stays] == pytest.approx(moved[~stays], abs=1e-4)
        assert draft.intended[stays] == pytest.approx(np.minimum(raw, operator.storey)[stays])
        up, down = storeys[storeys > 0].sum(), -storeys[storeys < 0].sum()
        assert (child.made["raised"], child.made["lowered"]) == (round(up), round(down))
        assert child.made["buildings"] == np.count_nonzero(storeys)
        least = operator.name == "height_scaling"  # a field may leave all as it is
        assert least <= child.made["scaled"] <= max(1, child.made["buildings"])


@pytest.mark.parametrize("none", [{"share": 0}, {"factors": (1, 1)}], ids=str)
@pytest.mark.parametrize("what", ["buildings", "quarters"])
def test_no_share_and_no_factor_change_nothing(what, none):
    for parent in parents():
        child = HeightScaling(what=what, **none)([parent], np.random.default_rng(0))
        assert child == parent
        assert (child.made["scaled"], child.made["fsi_change"]) == (0, 0)


@pytest.mark.parametrize("what", ["buildings", "quarters"])
@pytest.mark.parametrize("seed", range(4))
def test_the_child_decodes_to_the_heights_that_are_meant(what, seed):
    parent = flat()
    child = HeightScaling(what=what, share=0.5)([parent], np.random.default_rng(seed))
    before, after = decode(parent).city, decode(child).city
    _, _, storeys = changed(parent, HeightScaling(what=what, share=0.5), seed)
    wanted = before.heights + np.float32(STOREY) * np.rint(storeys)[before.building_labels]
    assert (np.abs(after.heights - wanted) < 0.5).mean() > 0.99
    gained = float(fsi(after)) - float(fsi(before))
    assert gained == pytest.approx(child.made["fsi_change"], abs=0.02)


@pytest.mark.parametrize("what", ["buildings", "quarters"])
@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 2**32), rows=st.integers(2, 4))
def test_buildings_stay_the_buildings_they_are(what, seed, rows):
    """Houses of any heights wall to wall: none becomes one with a neighbour, none is lost."""
    rng = np.random.default_rng(seed)
    heights = np.zeros((60, 60), np.float32)
    plots = 2.0 * rng.integers(2, 12, (2 * rows, 5)) + rng.random((2 * rows, 5))
    for k in range(rows):
        lot = plots[2 * k : 2 * k + 2].repeat(5, 0).repeat(10, 1)
        heights[15 * k + 3 : 15 * k + 13, 5:55] = lot
    city = CityMap(heights, 2.0)
    labels = city.building_labels
    roofs = np.bincount(labels.ravel(), heights.ravel()) / np.bincount(labels.ravel())
    storeys = Storeys(city.heights, labels, roofs, 3.0, 40.0)
    names = np.arange(1, roofs.size)
    groups = [names[k : k + 1] for k in range(names.size)]
    if what == "quarters":
        groups = [np.unique(labels[city.labels == one]) for one in range(1, rows + 1)]
    done = [storeys.scale(one, float(rng.choice([0.4, 0.7, 1.4, 2.5]))) for one in groups]
    assert done == [bool(storeys.change[one].any()) for one in groups]
    assume(any(done))  # all may be refused, by heights that would be too low or too high
    after = CityMap(storeys.lay(), 2.0)
    assert np.array_equal(after.building_labels, labels)
    assert np.array_equal(after.built, city.built)
    became = roofs + 3 * storeys.change
    assert (became[storeys.change > 0] <= 40.01).all()
    assert (became[storeys.change < 0] >= 2.99).all()


@pytest.mark.parametrize("name", ["lyon-1er", "new-york-west-village"])
def test_ground_before_a_raised_wall_stays_ground(name):
    """Of real districts: no wall nearby is so high, and what is laid in its place rises before it.
    Without a look at ground, 5 % of what is built is new."""
    parent = district(name, 128)
    for how in (
        {"what": "quarters", "share": 1.0, "factors": (1.4, 1.6)},
        {"what": "buildings", "share": 0.3},
    ):
        scale = HeightScaling(**how)
        draft = scale.draft([parent], np.random.default_rng(0))
        city = decode(scale([parent], np.random.default_rng(0))).city
        meant = draft.intended > BUILT_ABOVE
        built = city.heights > BUILT_ABOVE
        assert np.count_nonzero(built & ~meant) < 0.02 * np.count_nonzero(meant)
        assert np.count_nonzero(meant & ~built) < 0.008 * np.count_nonzero(meant)


def test_a_wall_that_would_vanish_asks_for_another_number_of_storeys():
    heights = np.zeros((8, 12), np.float32)
    heights[2:6, 2:6], heights[2:6, 6:10] = 9, 15.5
    city = CityMap(heights, 2.0)
    roofs = np.array([0, 9, 15.5])
    storeys = Storeys(city.heights, city.building_labels, roofs, 3.0, 50.0)
    assert storeys.scale(np.array([1]), 5 / 3)  # 15 m beside 15.5 m
    assert storeys.change.tolist() == [0, 1, 0]
    together = Storeys(city.heights, city.building_labels, roofs, 3.0, 50.0)
    assert together.scale(np.array([1, 2]), 0.55)  # 6 m and 9.5 m
    assert together.change.tolist() == [0, -1, -2]
    low = Storeys(city.heights, city.building_labels, roofs, 3.0, 10.0)
    assert not low.scale(np.array([1]), 3.0)
    assert np.array_equal(low.lay(), city.heights)


def test_neighbours_that_would_become_one_change_alike():
    heights = np.zeros((8, 12), np.float32)
    heights[2:6, 2:6], heights[2:6, 6:10] = 10, 12.2
    city = CityMap(heights, 2.0)
    storeys = Storeys(city.heights, city.building_labels, np.array([0, 10, 12.2]), 3.0, 50.0)
    assert storeys.scale(np.array([1, 2]), 0.62)  # −1.27 and −1.55 storeys
    assert storeys.change[1] == storeys.change[2] < 0


def test_factors_above_one_only_raise_and_below_only_lower():
    for factors, way in (((1, 2), 1), ((0.4, 1), -1)):
        for what in ("buildings", "quarters"):
            operator = HeightScaling(what=what, share=1, factors=factors)
            _, _, storeys = changed(houses(), operator, 5)
            assert (way * storeys >= 0).all()
            assert storeys.any()


def test_all_buildings_of_a_street_block_go_one_way():
    parent = evocity.encode(
        evocity.read_map("lyon-1er", pixels=128), fit=False, lifs=2500, settle=False
    ).genome
    city = decode(parent).city
    grid = common_grid("test", [parent], 0.0)
    quarter = grid.raster(street_blocks(city, grid).labels.ravel())
    for seed in range(3):
        _, _, storeys = changed(parent, HeightScaling(share=0.5), seed)
        ways = np.sign(np.rint(storeys))[city.building_labels]
        found = [np.unique(ways[quarter == one]) for one in np.unique(quarter)]
        assert any(one.any() for one in found)
        assert all(not (one.min() < 0 < one.max()) for one in found)


@pytest.mark.parametrize("what", ["buildings", "quarters"])
def test_what_is_locked_keeps_its_height(what):
    city = draw_town(3, side=96, buildings=16)
    labels = city.building_labels
    mask = np.zeros(city.shape, bool)
    row, column = np.argwhere(labels == 2)[0]
    mask[row, column] = True
    layer = Condensation.cut(city, mask)
    parent = uniformly(city, condensation=layer).genome
    first = decode(parent).city.building_labels
    held = first == first[row, column]
    operator = HeightScaling(what=what, share=1)
    draft, raw, storeys = changed(parent, operator, 1)
    assert np.array_equal(draft.intended[held], raw[held])
    assert storeys.any()
    child = operator([parent], np.random.default_rng(1))
    assert decode(child).city.heights[row, column] == city.heights[row, column]


def test_scaled_buildings_count_as_whole():
    """Integrity asks for footprints, and not how high they stand."""
    parent = flat()
    maps = [draw_town(3, side=96, buildings=16)]
    child = HeightScaling(share=1)([parent], np.random.default_rng(0))
    assert child.made["buildings"] > 5
    assert integrity_of(child, maps) == integrity_of(parent, maps) == 1
    assert len(whole_buildings(child, maps)) == len(maps[0].buildings)


def test_a_shift_of_all_that_is_read_is_exact_and_leaves_sigma():
    parent = houses()
    before = decode(parent, tolerance=1e-5).attractor
    after = before + np.float32(6)
    code = refit_lifs(parent, before, after)
    assert np.array_equal(code.sigma, parent.sigma)
    assert code.beta == pytest.approx(parent.beta + 6 * (1 - parent.sigma), abs=1e-3)
    assert np.abs(decode(code).attractor - after).max() < 0.1
    assert refit_lifs(parent, before, before) == parent


@pytest.mark.parametrize("sigma_max", [0.9, np.inf])
def test_fits_are_the_best_within_the_cap(sigma_max):
    parent = uniformly(draw_town(3), sigma_max=sigma_max).genome
    before = decode(parent, tolerance=1e-5).attractor
    after = before.copy()
    after[10:31, 5:42] *= 2
    code = refit_lifs(parent, before, after)
    steepest = np.maximum(np.abs(parent.sigma), 0.9) if sigma_max > 1 else sigma_max
    assert (np.abs(code.sigma) <= steepest + 1e-6).all()

    def errors(one: Genome) -> np.ndarray:
        gap = CollageMap(one)(after).astype(float) - after
        return np.sqrt(one.pavement.sums(gap**2) / one.pavement.area)

    least = errors(code)
    assert (least <= errors(parent) + 1e-3).all()
    assert least.sum() < 0.7 * errors(parent).sum()
    for by in (-0.05, 0.05):
        for name in ("sigma", "beta"):
            values = getattr(code, name) + np.where(code.uniform & (name == "sigma"), 0, by)
            if name == "sigma":
                values = np.clip(values, -steepest, steepest)
            other = code.replace(**{name: values.astype(np.float32)})
            # σ stays where β alone fits to within 5 cm
            assert (errors(other) >= np.where(least > 0.05, least, 0) - 2e-3).all()


@pytest.mark.parametrize("name", ODD)
@pytest.mark.parametrize("what", ["buildings", "quarters"])
def test_ends_well_on_any_map(name, what):
    for share in (0.1, 1.0):
        child = assert_laws(HeightScaling(what=what, share=share), odd_maps()[name], 0)
        assert child.made["scaled"] == 0 or name != "empty"


@pytest.mark.parametrize("side", [1, 2, 5])
def test_a_field_of_ones_changes_nothing(side):
    for parent in parents():
        values = [1.0] * side**2
        child = HeightField(side=side, values=values)([parent], np.random.default_rng(0))
        assert child == parent
        assert child.made["values"] == values
        assert child.made["scaled"] == child.made["fsi_change"] == 0


def test_a_field_raises_where_it_is_above_one_and_lowers_where_it_is_below():
    parent, rng = flat(), np.random.default_rng(0)
    values = [2.0, 2.0, 0.4, 0.4]
    child = HeightField(side=2, values=values, repair=None)([parent], rng)
    change = decode(child).city.heights - decode(parent).city.heights
    third = change.shape[0] // 4  # beyond the middles of its squares the field is level
    assert change[:third].min() > -1e-3
    assert change[:third].max() > 2
    assert change[-third:].max() < 1e-3
    assert change[-third:].min() < -2
    assert child.made["raised"] > 0 < child.made["lowered"]
    again = HeightField(side=2, values=values, repair=None)([parent], np.random.default_rng(9))
    assert again == child  # nothing is drawn


def test_values_are_as_many_as_the_field_has():
    with pytest.raises(OperatorError, match=r"values = 3 numbers.*\n.*4, 2 × 2"):
        HeightField(side=2, values=(1, 1, 1))([flat()], np.random.default_rng(0))
    with pytest.raises(OperatorError, match=r"0\.1…10"):
        HeightField(side=1, values=(0,))
    assert len(HeightField(side=3)([flat()], np.random.default_rng(0)).made["values"]) == 9


def test_all_faults_are_told_at_once():
    wrong = {"what": "trees", "share": 2, "factors": (2, 1), "storey": 0.5, "highest": -3}
    with pytest.raises(OperatorError) as caught:
        HeightScaling(**wrong)
    assert set(caught.value.faults) == set(wrong)
    for factors in ((1,), (0, 1), (1, 20), (1, 1, 1)):
        with pytest.raises(OperatorError, match="factors"):
            HeightScaling(factors=factors)


@pytest.mark.parametrize("seed", range(4))
def test_moments_of_blocks_against_their_naive_twin(seed):
    pavement, rng = draw_pavement(seed), np.random.default_rng(seed)
    shape = pavement.height, pavement.width
    maps = [rng.uniform(0, 30, shape).astype(np.float32) for _ in range(4)]
    free = rng.random(shape) < 0.7
    squares = (*pavement.corners, pavement.side)
    moments = np.empty((7, len(pavement)))
    block_moments(*maps, free, *squares, moments)
    assert np.array_equal(moments, naive.block_moments(*maps, free, *squares))
