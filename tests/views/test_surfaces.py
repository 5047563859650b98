"""Ground covers: laws of one coverage on any map, and squares, courts, kerbs and water on drawn
ones."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage

from evocity import CityMap, read_map
from evocity.views.surfaces import KINDS
from evocity.views.surfaces.faces import segments_of, widen_necks


def check(city: CityMap, cover) -> None:
    """One valid coverage of the whole map, on a grid of 1 cm."""
    polygons = np.concatenate([cover.buildings, cover.surfaces])
    assert shapely.is_valid(polygons).all()
    assert set(cover.kinds) <= set(KINDS)
    assert ((cover.squares >= 0) == (cover.kinds == "square")).all()
    assert ((cover.streets != "") == (cover.kinds == "street")).all()
    if not cover.kept.all():
        return
    assert shapely.coverage_is_valid(polygons)
    assert shapely.area(polygons).sum() == pytest.approx(city.area, rel=1e-9)
    points = shapely.get_coordinates(polygons) / cover.grid
    assert points == pytest.approx(np.round(points), abs=1e-6)
    bits, _ = segments_of(polygons)
    assert np.hypot(*(bits[:, 1] - bits[:, 0]).T).min() >= cover.grid * (1 - 1e-6)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    shape=st.tuples(st.integers(1, 40), st.integers(1, 40)),
    pixel=st.sampled_from([0.1, 0.5, 2.0, 10.0]),
    part=st.booleans(),
)
def test_any_map_is_one_coverage(seed, shape, pixel, part):
    rng = np.random.default_rng(seed)
    noise = ndimage.gaussian_filter(rng.normal(size=shape), rng.choice([0.0, 1.0, 3.0]))
    heights = np.where(noise > np.quantile(noise, rng.choice([0.2, 0.5, 0.9])), 9.0, 0.0)
    site = None
    if part:
        site = ndimage.gaussian_filter(rng.normal(size=shape), 2) > -0.05
        site[shape[0] // 2, shape[1] // 2] = True
    city = CityMap(heights, pixel, site=site)
    water = city.open_ground & (noise < np.quantile(noise, 0.1)) if seed % 2 else None
    check(city, city.ground_cover(water=water))


@pytest.mark.parametrize("built", [False, True])
def test_maps_without_streets_have_a_ground(built):
    city = CityMap(np.full((32, 40), 9.0 * built), 2.0)
    cover = city.ground_cover()
    check(city, cover)
    assert len(cover.buildings) == built
    assert built == (len(cover) == 0)


def test_a_neck_below_the_grid_is_widened():
    # the corner (23.997, 55.848) lies 3 mm from the wall x = 24
    neck = [(28, 56), (28, 58), (22, 58), (23.997, 55.848), (19.003, 54.873), (21.623, 48.634)]
    neck = shapely.Polygon([*neck, (24, 50), (24, 56)])
    beside = shapely.box(24, 40, 40, 56)
    buildings = np.array([neck, beside], dtype=object)
    wider = widen_necks(buildings, 0.01)
    assert (shapely.get_type_id(shapely.set_precision(wider, 0.01)) == 3).all()
    assert shapely.area(shapely.intersection(*wider)) == 0
    assert shapely.area(shapely.symmetric_difference(wider, buildings)).max() < 0.01
    plain = np.array([shapely.box(0, 0, 9, 9), beside], dtype=object)
    assert widen_necks(plain, 0.01) is plain


def test_a_spike_below_the_grid_goes():
    # a spike of 3.4 m, at most 3 cm wide, of a building in Lyon
    spike = [(12.41, 10.12), (0.101, 10.284), (0.497, 4.248), (0.792, 0.138), (0.808, 0.163)]
    spike = shapely.Polygon([*spike, (0.55, 3.528), (11.915, 4.179)])
    (whole,) = widen_necks(np.array([spike], dtype=object), 0.01)
    assert shapely.get_type_id(shapely.set_precision(whole, 0.01)) == 3
    assert shapely.bounds(whole)[1] > 3
    assert shapely.area(shapely.symmetric_difference(whole, spike)) < 0.12
    # two halves on a neck are no spike
    halves = shapely.Polygon([(0, 0), (0, 9), (4.001, 4.5), (8, 9), (8, 0), (3.999, 4.5)])
    (whole,) = widen_necks(np.array([halves], dtype=object), 0.01)
    assert whole.area >= halves.area


@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
def test_real_towns_are_one_coverage(name):
    city = read_map(name)
    cover = city.ground_cover()
    assert cover.kept.all()
    check(city, cover)
    assert {"street", "pavement", "square", "court"} <= set(cover.kinds)
    squares = cover.surfaces[cover.kinds == "square"]
    bits, _ = segments_of(squares)
    way = bits[:, 1] - bits[:, 0]
    along = np.minimum(*np.abs(way).T) < 0.02
    assert np.hypot(*way[along].T).sum() < 0.12 * np.hypot(*way.T).sum()


def test_squares_end_at_straight_lines_across_the_mouths_of_streets():
    # a square of 60 m between four blocks, turned by 20 degrees, and streets of 12 m
    y, x = (np.mgrid[:120, :120] - 59.5) * 2.0
    turn = np.radians(20)
    u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
    built = (np.abs(u) > 6) & (np.abs(v) > 6) & (np.maximum(np.abs(u), np.abs(v)) > 30)
    city = CityMap(np.where(built, 12.0, 0.0), 2.0)
    cover = city.ground_cover()
    check(city, cover)
    (square,) = cover.surfaces[cover.kinds == "square"]
    assert square.area == pytest.approx(60**2, rel=0.03)
    assert shapely.area(shapely.simplify(square, 1.0)) == pytest.approx(square.area, rel=0.01)
    box = shapely.minimum_rotated_rectangle(square)
    assert square.area / box.area > 0.95
    # a footprint moves by the grid only
    south_west = np.array(city.north_west) - (0, city.shape[0] * city.metres_per_pixel)
    walls = shapely.transform(np.array(city.walls.polygons), lambda p: p - south_west)
    away = shapely.hausdorff_distance(cover.buildings, walls)
    assert away.max() < 0.02


def crossing(side: int = 80, wide: int = 8) -> CityMap:
    """Four blocks of houses about two streets of 16 m, with a court in each."""
    heights = np.full((side, side), 12.0)
    middle = slice((side - wide) // 2, (side + wide) // 2)
    heights[middle] = heights[:, middle] = 0
    for y in (10, side - 20):
        for x in (10, side - 20):
            heights[y : y + 10, x : x + 10] = 0
    return CityMap(heights, 2.0)


def test_streets_have_a_carriageway_and_pavements_with_kerbs():
    city = crossing()
    cover = city.ground_cover()
    check(city, cover)
    assert np.count_nonzero(cover.kinds == "court") == 4
    street = shapely.union_all(cover.surfaces[cover.kinds == "street"])
    pavement = shapely.union_all(cover.surfaces[cover.kinds == "pavement"])
    built = shapely.union_all(cover.buildings)
    assert street.area + pavement.area == pytest.approx(city.open_ground.sum() * 4 - 4 * 400)
    assert street.distance(built) > 0.5  # pavements are beside all houses
    assert 0.5 < street.area / (street.area + pavement.area) < 0.8
    frame = shapely.box(0, 0, 160, 160).boundary
    around = shapely.difference(street.boundary, shapely.buffer(frame, 1e-6))
    assert shapely.length(cover.kerbs) == pytest.approx(shapely.length(around), abs=0.01)
    assert shapely.difference(around, shapely.buffer(cover.kerbs, 1e-6)).length < 1e-3


def test_water_has_the_walls_beside_it():
    city = crossing()
    water = np.zeros(city.shape, bool)
    water[36:44] = True
    cover = city.ground_cover(water=water)
    check(city, cover)
    wet = shapely.union_all(cover.surfaces[cover.kinds == "water"])
    assert wet.area == pytest.approx(water.sum() * 4, rel=0.02)
    assert set(cover.streets[cover.kinds == "street"]) <= {"street"}
