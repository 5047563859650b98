"""Buildings told apart, measured and outlined: laws, naive twins, and momepy on Bubeneč."""

import time
from dataclasses import replace
from functools import cache

import geopandas
import momepy
import naive
import numpy as np
import pytest
import shapely
from districts import HEIGHTS, bubenec, burnt
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from towns import draw_town

from evocity import isometries
from evocity.citymap import BUILT_ABOVE, CityMap
from evocity.errors import MapError
from evocity.views.buildings import CRUMB, STEP, outlines, separate_buildings
from evocity.views.buildings._kernels import count_corners

# Small maps of few heights: many ties, many buildings of few pixels, some with yards.
roofs = arrays(
    np.float32,
    st.tuples(st.integers(1, 9), st.integers(1, 9)),
    elements=st.sampled_from([0, 0, 3, 3, 4, 5, 8]),
)


def row_of_houses():
    """Three houses of 8 × 8 px wall to wall, 9, 10 and 15 m, and a free one of 15 m."""
    heights = np.zeros((20, 40), np.float32)
    heights[4:12, 2:10], heights[4:12, 10:18], heights[4:12, 18:26] = 9, 10, 15
    heights[4:12, 30:38] = 15
    return CityMap(heights, 1.0)


# -- telling apart -------------------------------------------------------------------------


def test_gaps_and_steps_of_height_tell_buildings_apart():
    city = row_of_houses()
    assert (len(city.buildings), city.buildings.components) == (3, 2)  # 9 and 10 m: within STEP
    assert len(city.told_apart(0.5)) == 4
    assert city.told_apart(0.5).component.tolist() == [0, 0, 0, 1]
    assert city.told_apart(1.0).area.tolist() == [128, 64, 64]  # a step of 1 m is within 1 m


@pytest.mark.parametrize("city", [row_of_houses(), draw_town(7, side=128, buildings=150)])
def test_an_endless_step_tells_by_gaps_alone(city):
    buildings = city.told_apart(np.inf)
    assert np.array_equal(buildings.labels, city.labels)
    assert len(buildings) == buildings.components == city.labels.max()
    assert np.array_equal(buildings.area, city.areas)
    assert np.array_equal(buildings.component, np.arange(city.labels.max()))


@settings(max_examples=60, deadline=None)
@given(roofs)
def test_no_step_and_no_crumb_tells_every_plateau_apart(heights):
    city = CityMap(heights, 2.0)
    buildings = separate_buildings(city.heights, city.labels, 2.0, step=0, crumb=0)
    right = (city.heights[:, 1:] == city.heights[:, :-1]) & city.built[:, 1:]
    down = (city.heights[1:] == city.heights[:-1]) & city.built[1:]
    labels = buildings.labels
    assert np.array_equal(right, (labels[:, 1:] == labels[:, :-1]) & city.built[:, 1:])
    assert np.array_equal(down, (labels[1:] == labels[:-1]) & city.built[1:])


def test_a_slope_is_one_building_and_its_steps_are_not():
    ramp = np.tile(np.arange(3, 40, dtype=np.float32), (6, 1))
    city = CityMap(np.pad(ramp, 2), 2.0)
    assert len(city.told_apart(1.0)) == 1
    assert len(city.told_apart(0.9)) > 1


def test_a_crumb_goes_to_the_longest_wall_then_to_the_closest_height():
    heights = np.zeros((12, 24), np.float32)
    heights[2:10, 2:10], heights[2:10, 12:20] = 9, 20
    heights[4:6, 10:12] = 14  # 4 px of 1 m², two sides to each: 9 m is closer
    city = CityMap(heights, 1.0)
    assert city.buildings.area.tolist() == [68, 64]
    heights[4:6, 10:12] = 15
    assert CityMap(heights, 1.0).buildings.area.tolist() == [64, 68]
    heights[6, 11] = 15  # a third side to the lower house
    heights[6, 10] = 0
    heights[3:7, 9] = 0
    heights[4, 9] = 9
    assert CityMap(heights, 1.0).buildings.area.tolist()[1] == 69


def test_a_crumb_between_equals_goes_to_the_first_row_by_row():
    heights = np.zeros((12, 24), np.float32)
    heights[2:10, 2:10] = heights[2:10, 12:20] = 9
    heights[4:6, 10:12] = 14
    for turned in (heights, heights[:, ::-1], heights.T, heights[::-1].T):
        assert CityMap(turned, 1.0).buildings.area.tolist() == [68, 64]


def test_a_crumb_without_neighbour_stays():
    heights = np.zeros((8, 8), np.float32)
    heights[2, 3] = 9
    assert CityMap(heights, 2.0).buildings.area.tolist() == [4]


@settings(max_examples=60, deadline=None)
@given(roofs, st.sampled_from([0, 1, 1.5, 3]), st.sampled_from([2, 3, 6]))
def test_only_crumbs_are_joined_and_none_with_a_neighbour_is_left(heights, step, least):
    city = CityMap(heights, 1.0)
    zones = separate_buildings(city.heights, city.labels, 1.0, step, crumb=0)
    joined = separate_buildings(city.heights, city.labels, 1.0, step, crumb=least)
    parts = [np.unique(zones.labels[joined.labels == a]) - 1 for a in range(1, len(joined) + 1)]
    assert sum(part.size for part in parts) == len(zones)  # no zone is cut
    for part, area, component in zip(parts, joined.area, joined.component, strict=True):
        assert np.count_nonzero(zones.area[part] >= least) <= 1
        alone = np.count_nonzero(joined.component == component) == 1
        assert area >= least or alone


@settings(max_examples=80, deadline=None)
@given(roofs, st.sampled_from([0, 1, 1.5, np.inf]), st.sampled_from([1, 2, 4, 7]))
def test_zones_as_their_naive_twins(heights, step, least):
    built = heights > BUILT_ABOVE
    zones = naive.flat_zones(heights, built, step)
    city = CityMap(heights, 1.0)
    without = separate_buildings(city.heights, city.labels, 1.0, step, crumb=0)
    assert np.array_equal(without.labels, zones)
    joined = separate_buildings(city.heights, city.labels, 1.0, step, crumb=least)
    assert np.array_equal(joined.labels, naive.join_crumbs(heights, zones, least))


def test_larger_zones_as_their_naive_twins():
    heights = np.random.default_rng(4).gamma(2, 3, (40, 50)).astype(np.float32)
    city = CityMap(heights, 2.0)
    zones = naive.join_crumbs(heights, naive.flat_zones(heights, city.built, STEP), CRUMB / 4)
    assert np.array_equal(city.buildings.labels, zones)


@pytest.mark.parametrize("step", [-1, np.nan, "1", None])
def test_a_step_that_is_none_is_refused(step):
    with pytest.raises(MapError, match="step ="):
        row_of_houses().told_apart(step)


# -- the table -----------------------------------------------------------------------------


def test_the_table_of_a_house():
    buildings = row_of_houses().buildings
    assert buildings.area.tolist() == [128, 64, 64]
    assert buildings.height.tolist() == [9.5, 15, 15]
    assert buildings.volume.tolist() == [128 * 9.5, 64 * 15, 64 * 15]
    assert (buildings.y.tolist(), buildings.x.tolist()) == ([8, 8, 8], [10, 22, 34])
    assert buildings.bounds.tolist() == [[4, 2, 12, 18], [4, 18, 12, 26], [4, 30, 12, 38]]
    assert buildings.sides.tolist() == [48, 32, 32]
    assert buildings.shared.tolist() == [8, 8, 0]
    assert buildings.direction.tolist() == [0, 0, 0]
    assert buildings.courtyards.tolist() == [0, 0, 0]
    assert buildings.hull_area.tolist() == [128, 64, 64]
    assert buildings.box.tolist() == [[16, 8], [8, 8], [8, 8]]
    np.testing.assert_allclose(buildings.circle, np.hypot([16, 8, 8], 8))


@settings(max_examples=60, deadline=None)
@given(roofs, st.sampled_from([0, 1, np.inf]))
def test_the_table_as_its_naive_twins(heights, step):
    city = CityMap(heights, 2.0)
    buildings = separate_buildings(city.heights, city.labels, 2.0, step, crumb=0)
    labels = buildings.labels
    turns = np.zeros(len(buildings), np.int64)
    count_corners(np.pad(labels, 1), turns)
    for i, a in enumerate(range(1, len(buildings) + 1)):
        mask = labels == a
        y, x = np.nonzero(mask)
        sides, shared, corners = naive.outline_steps(labels, a)
        assert (buildings.sides[i], buildings.shared[i]) == (sides, shared)
        crofton = np.pi / 8 * (sides + corners / np.sqrt(2)) * 2
        assert buildings.perimeter[i] == pytest.approx(crofton)
        assert buildings.area[i] == 4 * mask.sum()
        assert buildings.height[i] == pytest.approx(city.heights[mask].mean(dtype=float))
        assert buildings.volume[i] == pytest.approx(4 * city.heights[mask].sum(dtype=float))
        assert buildings.y[i] == pytest.approx(2 * (y.mean() + 0.5))
        assert buildings.x[i] == pytest.approx(2 * (x.mean() + 0.5))
        assert buildings.bounds[i].tolist() == [y.min(), x.min(), y.max() + 1, x.max() + 1]
        assert buildings.component[i] == city.labels[mask][0] - 1
        holes, ground = naive.courtyards(labels, a)
        assert (turns[i], buildings.courtyards[i]) == (4 - 4 * holes, 4 * ground)
        inside, box, diameter = naive.least_shapes(mask)
        assert buildings.hull_area[i] == 4 * inside
        assert buildings.box[i] == pytest.approx(2 * np.array(box))
        assert buildings.circle[i] == pytest.approx(2 * diameter)
        resultant = naive.fourfold(labels, a)
        if abs(resultant) > 1e-6:  # else any direction is as good
            turn = np.deg2rad(4 * buildings.direction[i])
            expected = np.conj(resultant) / abs(resultant)
            assert np.exp(1j * turn) == pytest.approx(expected, abs=1e-9)


@pytest.mark.slow
def test_larger_shapes_as_their_naive_twins():
    y, x = np.mgrid[:140, :140]
    rng = np.random.default_rng(8)
    heights = np.zeros((140, 140), np.float32)
    for middle in ((35, 35), (35, 105), (105, 35), (105, 105)):
        turn = rng.uniform(0, np.pi)
        along = (y - middle[0]) * np.cos(turn) + (x - middle[1]) * np.sin(turn)
        across = (x - middle[1]) * np.cos(turn) - (y - middle[0]) * np.sin(turn)
        heights[np.hypot(along / 30, across / rng.uniform(5, 28)) < 1] = 9
    buildings = CityMap(heights, 1.0).buildings
    assert len(buildings) == 4
    for i in range(4):
        inside, box, diameter = naive.least_shapes(buildings.labels == i + 1)
        assert buildings.hull_area[i] == inside
        assert buildings.box[i] == pytest.approx(box)
        assert buildings.circle[i] == pytest.approx(diameter)


@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_the_map_turns_the_table(iso):
    city = draw_town(7, side=96, buildings=80)
    turned = city.replace(isometries.apply(iso, city.heights))
    before, after = city.buildings, turned.buildings
    place = isometries.apply(iso, before.labels)
    assert len(before) == len(after)
    order = np.array([place[after.labels == a][0] for a in range(1, len(after) + 1)]) - 1
    assert np.array_equal(place, np.append(0, order + 1)[after.labels])  # the same buildings
    for name in ("area", "sides", "shared", "courtyards", "hull_area", "box"):
        assert np.array_equal(getattr(after, name), getattr(before, name)[order])
    for name in ("perimeter", "height", "volume", "circle"):
        np.testing.assert_allclose(getattr(after, name), getattr(before, name)[order])
    mirrored = -before.direction if iso >= 4 else before.direction
    gap = (after.direction - mirrored[order] + 45) % 90 - 45
    assert np.abs(gap).max() < 1e-6


def test_larger_pixels_scale_the_table():
    city = draw_town(7, side=96, buildings=80)
    once = separate_buildings(city.heights, city.labels, 1.0, crumb=6)
    twice = separate_buildings(city.heights, city.labels, 2.0, crumb=24)
    for name, power in [
        *[(name, 1) for name in ("perimeter", "y", "x", "long_side", "short_side", "circle")],
        *[(name, 2) for name in ("area", "volume", "courtyards", "hull_area")],
        *[(name, 0) for name in ("height", "direction", "top", "right", "sides", "shared")],
    ]:
        assert np.array_equal(twice.as_dict()[name], once.as_dict()[name] * 2**power), name


def test_columns_are_arrays_of_one_length_and_read_only():
    buildings = draw_town(3).buildings
    columns = buildings.as_dict()
    assert {column.shape for column in columns.values()} == {(len(buildings),)}
    for array in (buildings.labels, buildings.bounds, buildings.box, *columns.values()):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    frame = geopandas.pd.DataFrame(columns)
    assert frame["area"].sum() == buildings.area.sum()


@pytest.mark.parametrize("shape", [(1, 1), (5, 7)])
def test_a_map_without_buildings_has_an_empty_table(shape):
    city = CityMap(np.zeros(shape), 2.0)
    assert (len(city.buildings), city.buildings.components) == (0, 0)
    assert all(column.size == 0 for column in city.buildings.as_dict().values())
    assert city.outline == ()


def test_the_border_is_a_wall_to_the_perimeter_but_has_no_direction():
    full = CityMap(np.full((6, 9), 9.0), 2.0).buildings
    assert full.sides.tolist() == [30]
    assert np.isnan(full.direction).all()
    y, x = np.mgrid[:60, :60]
    slanting = CityMap(9.0 * (y > 10 + x / 2), 1.0).buildings  # its one wall falls by 26.57°
    assert slanting.direction[0] == pytest.approx(90 - np.degrees(np.arctan(0.5)), abs=0.8)


def test_a_neighbour_does_not_turn_a_building():
    y, x = np.mgrid[:80, :80] - 40
    alone = 9.0 * (np.abs(0.8 * y + 0.6 * x) < 12) * (np.abs(0.8 * x - 0.6 * y) < 20)
    beside = np.where((alone == 0) & (y > 0), 20, alone)
    directions = [CityMap(heights, 1.0).buildings.direction for heights in (alone, beside)]
    assert directions[0][0] == directions[1][0]
    assert directions[0][0] == pytest.approx(36.87, abs=0.7)


def test_a_yard_is_the_building_s_own_only_if_it_alone_encloses_it():
    heights = np.zeros((40, 40), np.float32)
    heights[4:20, 4:20], heights[8:16, 8:16] = 9, 0
    assert CityMap(heights, 2.0).buildings.courtyards.tolist() == [256]
    heights[10:13, 10:13] = 9  # a house in the yard takes ground from it
    assert CityMap(heights, 2.0).buildings.courtyards.tolist() == [220, 0]
    heights[4:20, 12:20] += 9 * (heights[4:20, 12:20] > 0)  # two houses share it
    city = CityMap(heights, 2.0)
    assert city.buildings.courtyards.sum() == 0
    assert city.told_apart(np.inf).courtyards.sum() == 220


def test_yards_of_houses_that_slant_cost_no_more_than_their_table():
    y, x = np.mgrid[:512, :512]
    city = CityMap(9.0 + 6 * ((y + x) // 4 % 2), 2.0)  # stripes wall to wall, 4 px wide
    buildings = city.told_apart()
    assert len(buildings) == 256
    assert not buildings.courtyards.any()
    table = least_seconds(city.told_apart)
    assert least_seconds(lambda: replace(buildings).courtyards) < table


def least_seconds(work):
    def taken():
        start = time.thread_time()
        work()
        return time.thread_time() - start

    return min(taken() for _ in range(5))


# -- outlines ------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(roofs)
def test_outlines_are_the_pixels(heights):
    city = CityMap(heights, 2.0, origin=(1000.0, 5000.0))
    assert len(city.outline) == len(city.buildings)
    for i, polygon in enumerate(city.outline):
        mask = city.buildings.labels == i + 1
        y, x = np.nonzero(mask)
        pixels = shapely.box(1000 + 2 * x, 4998 - 2 * y, 1002 + 2 * x, 5000 - 2 * y)
        assert polygon.geom_type == "Polygon"
        assert polygon.is_valid
        assert polygon.equals(shapely.union_all(pixels))


def test_outlines_of_a_map_without_a_place_lie_from_its_south_west_corner():
    heights = np.zeros((10, 20), np.float32)
    heights[1:9, 4:12] = 9
    assert CityMap(heights, 2.0).outline[0].bounds == (8.0, 2.0, 24.0, 18.0)


# -- Bubeneč, momepy computing the truth ---------------------------------------------------


@cache
def measured_both_ways():
    """The table of a map at 1 m/px and the polygons it was burnt from, in the same order."""
    polygons = bubenec()
    west, south, east, north = shapely.total_bounds(polygons)
    city = burnt(polygons, HEIGHTS, 1.0, (west, south, east, north))
    buildings = city.told_apart(0.1)  # heights are .14 m apart
    assert len(buildings) == 144
    order = np.rint((buildings.height - 10) * 143 / 20).astype(int)
    assert sorted(order) == list(range(144))
    return city, buildings, geopandas.GeoSeries(polygons[order], crs=3857)


def test_areas_and_volumes_of_bubenec():
    city, buildings, truth = measured_both_ways()
    assert buildings.area.sum() == pytest.approx(truth.area.sum(), rel=0.002)
    assert buildings.area.mean() == pytest.approx(truth.area.mean(), rel=0.002)
    assert np.median(buildings.area) == pytest.approx(truth.area.median(), rel=0.005)
    ground = np.prod(np.diff(truth.total_bounds.reshape(2, 2), axis=0))
    assert city.built.mean() == pytest.approx(truth.area.sum() / ground, rel=0.002)
    volume = momepy.volume(truth.area, buildings.height)
    assert buildings.volume.sum() == pytest.approx(volume.sum(), rel=0.002)


def test_perimeter_of_bubenec():
    _, buildings, truth = measured_both_ways()
    assert buildings.perimeter.sum() == pytest.approx(truth.length.sum(), rel=0.025)
    raw = buildings.sides.sum() / truth.length.sum()
    assert raw > 1.2  # what the raster's own edges would say


def test_directions_of_bubenec():
    _, buildings, truth = measured_both_ways()
    corners = [shapely.get_coordinates(box)[:2] for box in truth.minimum_rotated_rectangle()]
    edge = np.array([b - a for a, b in corners])
    angle = np.degrees(np.arctan2(edge[:, 1], edge[:, 0]))
    # momepy folds that angle, and the sign of a turn is lost: both are held against it
    folded = np.abs((angle + 45) % 90 - 45)
    np.testing.assert_allclose(folded, momepy.orientation(truth), atol=1e-6)
    gap = np.abs((buildings.direction - angle + 45) % 90 - 45)
    assert np.median(gap) < 0.8
    assert np.quantile(gap, 0.9) < 3.5
    orientation = np.abs((buildings.direction + 45) % 90 - 45)
    assert orientation.mean() == pytest.approx(momepy.orientation(truth).mean(), abs=0.5)


def test_centroids_of_bubenec():
    _, buildings, truth = measured_both_ways()
    west, _, _, north = truth.total_bounds
    centroid = truth.centroid
    gap = np.hypot(buildings.x - (centroid.x - west), buildings.y - (north - centroid.y))
    assert np.median(gap) < 0.1
    assert gap.max() < 0.5


def test_components_and_courtyards_of_bubenec():
    city, buildings, truth = measured_both_ways()
    dissolved = truth.union_all()
    assert len(dissolved.geoms) == 28
    assert buildings.components == len(city.told_apart(np.inf)) == 28
    parts = geopandas.GeoSeries(list(dissolved.geoms), crs=3857)
    pieces = outlines(city.labels, 1.0, (0.0, 0.0))
    filled = geopandas.GeoSeries([shapely.Polygon(piece.exterior) for piece in pieces])
    yards = momepy.courtyard_area(parts).sum()  # houses that stand in them included
    assert filled.area.sum() - city.areas.sum() == pytest.approx(yards, rel=0.002)
    ground = geopandas.GeoSeries(shapely.polygons(parts.exterior)).difference(dissolved)
    assert city.told_apart(np.inf).courtyards.sum() == pytest.approx(ground.area.sum(), rel=0.002)
    alone = momepy.courtyard_area(truth)
    assert buildings.courtyards.sum() == pytest.approx(alone.sum(), rel=0.06)
    assert np.array_equal(buildings.courtyards > 0, alone > 1)


def test_shapes_of_bubenec():
    _, buildings, truth = measured_both_ways()
    long, short = buildings.box.T
    assert (short / long).mean() == pytest.approx(momepy.elongation(truth).mean(), rel=0.015)
    circle = momepy.longest_axis_length(truth)
    assert buildings.circle.mean() == pytest.approx(circle.mean(), rel=0.01)
    assert buildings.hull_area.sum() == pytest.approx(truth.convex_hull.area.sum(), rel=0.015)


def test_party_walls_of_bubenec():
    _, buildings, truth = measured_both_ways()
    walls = buildings.perimeter * buildings.shared / buildings.sides
    assert walls.mean() == pytest.approx(momepy.shared_walls(truth).mean(), rel=0.015)
