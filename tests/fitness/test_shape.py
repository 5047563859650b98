"""Shapes, counts and party walls: laws of each, and momepy on Bubeneč."""

import itertools
import math
from functools import cache

import esda.shape
import geopandas
import momepy
import numpy as np
import pytest
import shapely
from districts import bubenec, burnt
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy import ndimage
from shapely import affinity

from evocity.citymap import CityMap
from evocity.fitness import (
    building_density,
    compactness,
    component_density,
    convexity,
    elongation,
    eri,
    party_wall_ratio,
    rectangularity,
    shape_index,
)

SHAPES = (elongation, rectangularity, convexity, compactness, eri, shape_index)
by_measure = pytest.mark.parametrize("measure", SHAPES, ids=lambda m: m.name)


def one(polygon, pixel=1.0):
    """A map of one building, with 5 m of ground about it."""
    return burnt([polygon], [9.0], pixel, shapely.bounds(polygon.buffer(5)))


def disc(radius):
    return shapely.Point(0.3, 0.2).buffer(radius, quad_segs=64)


# -- what each shape must have ---------------------------------------------------------------


@pytest.mark.parametrize("degrees", [0, 10, 22.5, 30, 45, 77])
def test_a_long_house_measures_the_same_whichever_way_it_lies(degrees):
    city = one(affinity.rotate(shapely.box(0, 0, 60, 24), degrees))
    assert elongation(city) == pytest.approx(0.4, rel=0.03)
    assert rectangularity(city) == pytest.approx(1, abs=0.03)
    assert convexity(city) == 1
    assert compactness(city) == pytest.approx(60 * 24 / (math.pi / 4 * (60**2 + 24**2)), rel=0.04)
    assert eri(city) == pytest.approx(1, abs=0.07)


def test_a_disc_is_round_and_a_ring_is_not():
    city, ring = one(disc(40), 0.5), one(disc(40) - disc(30), 0.5)
    assert compactness(city) == pytest.approx(1, abs=0.03)
    assert shape_index(city) == pytest.approx(1, abs=0.015)
    assert elongation(city) == pytest.approx(1, abs=0.02)
    assert rectangularity(city) == pytest.approx(math.pi / 4, abs=0.015)
    assert convexity(city) == 1
    share = 1 - 9 / 16
    assert convexity(ring) == pytest.approx(share, abs=0.01)
    assert compactness(ring) == pytest.approx(share, abs=0.02)
    assert shape_index(ring) == pytest.approx(math.sqrt(share), abs=0.02)


def test_wings_and_yards_take_from_every_shape_but_the_elongation():
    plain = shapely.box(0, 0, 40, 40)
    u = plain - shapely.box(10, 10, 30, 40)
    for measure in (rectangularity, convexity, compactness, eri, shape_index):
        assert measure(one(u)) < measure(one(plain))
    assert rectangularity(one(u)) == convexity(one(u)) == 1 - 600 / 1600
    assert elongation(one(u)) == 1


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(st.floats(0, 40), st.floats(0, 40)), min_size=3, max_size=8))
def test_a_convex_footprint_fills_its_hull_however_the_pixels_lie(points):
    hull = shapely.convex_hull(shapely.multipoints(points))
    assume(not hull.buffer(-1.5).is_empty)  # else so thin that the raster may tear it
    city = one(hull)
    assume(city.buildings.components == 1 and city.buildings.area[0] >= 24)
    assert convexity(city) == 1


def test_every_footprint_of_few_pixels_stays_in_range():
    for bits in itertools.product((0, 9), repeat=9):
        heights = np.zeros((5, 5))
        heights[1:4, 1:4] = np.reshape(bits, (3, 3))
        if ndimage.label(heights)[1] == 1:
            city = CityMap(heights, 6.0)
            for measure in SHAPES:
                assert measure.range[0] < measure(city) <= measure.range[1]


@by_measure
def test_crumbs_do_not_count(measure):
    heights = np.zeros((40, 40))
    heights[4:20, 4:14], heights[8:12, 4:9] = 9, 0
    alone = measure(CityMap(heights, 2.0))
    heights[30, 30:35] = 9  # 20 m²
    assert measure(CityMap(heights, 2.0)) == alone
    heights[30, 30:36] = 9
    assert measure(CityMap(heights, 2.0)) != alone
    heights[4:20, 4:14] = heights[30, 30:33] = 0
    assert math.isnan(measure(CityMap(heights, 2.0)))
    assert "24 m²" in measure(CityMap(heights, 2.0)).reason


@by_measure
def test_shapes_have_no_size(measure):
    heights = np.zeros((40, 40))
    heights[4:20, 4:14] = heights[10:30, 14:18] = 9
    heights[22:38, 24:38] = 9
    assert measure(CityMap(heights, 7.0)) == pytest.approx(measure(CityMap(heights, 1.0)))


# -- counts and party walls ------------------------------------------------------------------


@pytest.mark.parametrize("houses", [1, 2, 5, 9])
def test_a_row_of_houses(houses):
    heights = np.zeros((50, 100))
    for i in range(houses):
        heights[10:20, 10 * i : 10 * i + 10] = 9 + 3 * (i % 2)
    city = CityMap(heights, 2.0)  # 2 ha
    assert building_density(city) == houses / 2
    assert component_density(city) == 0.5
    assert party_wall_ratio(city) == pytest.approx((houses - 1) / (2 * houses))
    level = city.replace(np.where(heights > 0, 9, 0))
    assert (building_density(level), party_wall_ratio(level)) == (0.5, 0)


def test_the_border_is_no_party_wall():
    assert party_wall_ratio(CityMap(np.full((10, 10), 9.0), 2.0)) == 0


def test_crumbs_have_no_density():
    heights = np.zeros((50, 50))
    heights[4, 4:9] = 9
    assert building_density(CityMap(heights, 2.0)) == component_density(CityMap(heights, 2.0)) == 0
    assert math.isnan(party_wall_ratio(CityMap(heights, 2.0)))


# -- Bubeneč, momepy computing the truth -----------------------------------------------------


@cache
def measured_both_ways():
    """A map at 1 m/px and the polygons it was burnt from. No two are within STEP in height."""
    polygons = bubenec()
    heights = 10 + 2 * np.random.default_rng(5).permutation(144)
    city = burnt(polygons, heights, 1.0, shapely.total_bounds(polygons))
    return city, geopandas.GeoSeries(polygons, crs=3857)


@pytest.mark.parametrize(
    ("measure", "truth", "tolerance"),
    [
        (elongation, momepy.elongation, 0.015),
        (eri, momepy.equivalent_rectangular_index, 0.025),
        (rectangularity, momepy.rectangularity, 0.015),
        (convexity, momepy.convexity, 0.015),
        (compactness, momepy.circular_compactness, 0.01),
        (shape_index, momepy.shape_index, 0.01),
        (eri, esda.shape.equivalent_rectangular_index, 0.025),
        (convexity, esda.shape.convex_hull_ratio, 0.015),
        (compactness, esda.shape.minimum_bounding_circle_ratio, 0.01),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_shapes_of_bubenec(measure, truth, tolerance):
    city, polygons = measured_both_ways()
    assert measure(city) == pytest.approx(truth(polygons).mean(), rel=tolerance)


def test_counts_of_bubenec():
    city, polygons = measured_both_ways()
    hectares = city.area / 1e4
    assert building_density(city) * hectares == pytest.approx(len(polygons))
    assert component_density(city) * hectares == pytest.approx(len(polygons.union_all().geoms))


def test_party_walls_of_bubenec():
    city, polygons = measured_both_ways()
    truth = momepy.shared_walls(polygons).sum() / polygons.length.sum()
    assert party_wall_ratio(city) == pytest.approx(truth, rel=0.01)
