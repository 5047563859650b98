"""Straight walls: laws of the coverage, what drawn buildings come back as, real towns."""

import itertools
import sys
from pathlib import Path

import naive
import numpy as np
import pytest
import shapely
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import ndimage

from evocity import CityMap, read_map
from evocity.errors import MapError
from evocity.io import cities
from evocity.views.walls import coverage, walls_of
from evocity.views.walls.arcs import trace_arcs
from evocity.views.walls.coverage import SPIKE, find_spikes
from evocity.views.walls.fitting import _kernels as _fitting

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import _walls

HOW = [{}, {"squared": True}, {"detail": 6.0, "relative": 0.05, "least_area": 30.0, "storeys": 3.0}]


def ragged(seed: int, side: int) -> np.ndarray:
    """Heights: noise, blobs, tilted grids, checkers, half-built ground."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side]
    kind = seed % 5
    if kind == 0:
        return rng.integers(0, 4, (side, side)) * 6.0
    if kind == 1:
        noise = ndimage.gaussian_filter(rng.normal(size=(side, side)), 2)
        return np.clip(np.digitize(noise, [-0.05, 0, 0.1, 0.2]) * 5.0 - 5, 0, None)
    if kind == 2:
        angle = rng.uniform(0, 3)
        u = (x * np.cos(angle) + y * np.sin(angle)) // 5
        v = (-x * np.sin(angle) + y * np.cos(angle)) // 7
        return ((u * 7 + v * 3) % 4) * 4.0
    if kind == 3:
        return ((x + y) % 2) * 6.0
    return (rng.random((side, side)) < 0.5) * rng.choice([5.0, 9.0, 20.0], (side, side))


def check_coverage(city: CityMap, **how):
    walls = city.walled(**how)
    polygons = np.array(walls.polygons, dtype=object)
    assert shapely.is_valid(polygons).all()
    assert shapely.coverage_is_valid(polygons) or not len(polygons)
    assert set(shapely.get_type_id(polygons)) <= {3}
    total = shapely.union_all(polygons).area if len(polygons) else 0.0
    assert shapely.area(polygons).sum() == pytest.approx(total, rel=1e-9)
    assert len(walls) == len(walls.buildings) == len(walls.heights)
    for ring in shapely.get_rings(polygons):
        points = shapely.get_coordinates(ring)
        assert (points[1:] != points[:-1]).any(axis=1).all()
    if len(polygons):  # nothing is beyond the map
        left, top = city.north_west
        tall, wide = (side * city.metres_per_pixel for side in city.shape)
        west, south, east, north = shapely.total_bounds(polygons) - (left, top, left, top)
        assert min(west, south + tall, wide - east, -north) >= -1e-9
    return walls


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), side=st.integers(1, 40), how=st.sampled_from(HOW))
def test_any_map_gives_a_valid_coverage(seed, side, how):
    city = CityMap(ragged(seed, side), float(1 + seed % 3))
    walls = check_coverage(city, **how)
    if "least_area" not in how:
        labels = trace_arcs(city.building_labels).labels
        assert walls.dropped == 0
        assert set(walls.buildings.tolist()) == set(labels[labels > 0].tolist())
        assert len(set(walls.buildings)) >= len(city.buildings) - walls.changed
        polygons = {}
        for label, polygon in zip(walls.buildings.tolist(), walls.polygons, strict=True):
            polygons[label] = polygon.union(polygons.get(label, shapely.Polygon()))
        for label, polygon in polygons.items():
            size = np.count_nonzero(labels == label) * city.metres_per_pixel**2
            assert 0.5 <= polygon.area / size <= 2
        for one, other in naive.party_walls(labels, least=1):
            assert polygons[one].intersection(polygons[other]).length > 0


@pytest.mark.parametrize("how", HOW, ids=["plain", "squared", "coarse"])
@pytest.mark.parametrize("heights", [ragged(1, 40), ragged(4, 24), read_map("lyon-1er").heights])
def test_walls_are_the_same_wherever_the_buildings_lie(heights, how):
    """Windows of a fabric share buildings, bit for bit on the grid of millimetres."""

    def found(north, west, south, east):
        city = CityMap(np.pad(heights, ((north, south), (west, east))), 2.0)
        corner = np.array([west * 2.0, south * 2.0])
        walls = np.array(city.walled(**how).polygons, dtype=object)
        walls = shapely.transform(walls, lambda points: np.round((points - corner) * 1000))
        return shapely.to_wkb(walls).tolist()

    first = found(4, 4, 4, 4)  # as far as the gradient of a building reaches
    assert found(37, 5, 6, 131) == first
    assert found(5, 1013, 77, 4) == first


@pytest.mark.parametrize("how", HOW, ids=["plain", "squared", "coarse"])
@pytest.mark.parametrize("name", cities())
def test_walls_of_real_towns_are_a_valid_coverage(name, how):
    check_coverage(read_map(name), **how)


@pytest.mark.parametrize("name", ["lyon-1er", "montpellier-pas-du-loup"])
def test_party_walls_stay_shared_and_courtyards_stay(name):
    city = read_map(name)
    walls = city.walls
    labels = trace_arcs(city.building_labels).labels
    pairs = naive.party_walls(labels, least=4)
    polygons = dict(zip(walls.buildings.tolist(), walls.polygons, strict=True))
    assert len(set(walls.buildings.tolist())) == len(walls)
    assert pairs or name != "lyon-1er"
    for one, other in pairs:
        shared = polygons[one].intersection(polygons[other])
        assert shared.length > 0.5 * city.metres_per_pixel
    for label, polygon in polygons.items():
        holes = ndimage.label(np.pad(labels != label, 1, constant_values=True), np.ones((3, 3)))[1]
        assert len(polygon.interiors) == holes - 1


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), height=st.integers(1, 14), width=st.integers(1, 14))
def test_each_wall_is_traced_once(seed, height, width):
    rng = np.random.default_rng(seed)
    labels = naive.pieces(rng.integers(0, 4, (height, width)))
    arcs = trace_arcs(labels)
    assert not naive.touches_itself(arcs.labels)
    seen = set()
    for arc in range(len(arcs)):
        vertices = arcs.vertices[arcs.starts[arc] : arcs.starts[arc + 1]].tolist()
        for one, other in itertools.pairwise(vertices):
            edge = naive.edge_between(arcs.labels, one, other)
            assert edge == (arcs.left[arc], arcs.right[arc])
            seen.add(frozenset([tuple(one), tuple(other)]))
        inner = vertices[1:-1] if arcs.ends[arc, 0] >= 0 else vertices
        assert not {tuple(one) for one in inner} & {tuple(one) for one in arcs.nodes.tolist()}
    edges = naive.wall_edges(arcs.labels)
    assert seen == edges
    assert len(arcs.vertices) - len(arcs) == len(edges)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), count=st.integers(3, 30))
def test_lines_and_what_douglas_and_peucker_leave_are_those_of_others(seed, count):
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(count, 2)), axis=0)
    sums = np.empty(6)
    _fitting._sums(points, 0, count, sums)
    *_, dx, dy, error = _fitting.line_of(sums)
    values, vectors = np.linalg.eigh(np.cov(points.T, bias=True))
    assert error == pytest.approx(values[0] * count, abs=1e-9)
    assert abs(vectors[:, 1] @ [dx, dy]) == pytest.approx(1, abs=1e-6)
    keep = np.zeros(count, bool)
    _fitting._douglas_peucker(points, 0.9, keep, np.empty((count + 2, 2), np.int64))
    left = shapely.get_coordinates(
        shapely.LineString(points).simplify(0.9, preserve_topology=False)
    )
    assert points[keep].tolist() == left.tolist()


def drawn(*polygons, side=128, pixel=1.0):
    """A map of ``polygons`` in metres from its south-west corner, 9 m high and 4 m more each."""
    y, x = np.mgrid[:side, :side]
    centres = shapely.points((x + 0.5) * pixel, (side - 0.5 - y) * pixel)
    heights = np.zeros((side, side))
    for number, polygon in enumerate(polygons):
        heights[shapely.contains(polygon, centres)] = 9 + 4 * number
    return CityMap(heights, pixel)


def rectangle(x, y, wide, deep, angle):
    return shapely.affinity.rotate(shapely.box(x, y, x + wide, y + deep), angle, origin=(64, 64))


def iou(one, other):
    return one.intersection(other).area / one.union(other).area


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@example(angle=32.0, wide=17.0, deep=31.5)
@given(angle=st.floats(0, 90), wide=st.floats(12, 50), deep=st.floats(12, 50))
def test_a_drawn_rectangle_comes_back(angle, wide, deep):
    true = rectangle(64 - wide / 2, 64 - deep / 2, wide, deep, angle)
    (found,) = drawn(true).walls.polygons
    assert len(found.exterior.coords) <= 7  # two corners may be cut by a pixel
    (squared,) = drawn(true).walled(squared=True).polygons
    for polygon in (found, squared):  # along the pixels each wall is off by half of one at most
        assert polygon.symmetric_difference(true).area <= 0.55 * true.length


def test_common_angles_are_right_angles():
    true = rectangle(44, 50, 40, 28, 17)
    (found,) = drawn(true).walled(squared=True).polygons
    assert _walls.right_angles(np.array([found]), tolerance=0.01) == 1


def test_a_row_of_houses_has_one_facade():
    houses = [rectangle(34 + 15 * k, 50, 15, 20, 23) for k in range(4)]
    walls = drawn(*houses).walls
    assert len(walls) == 4
    union = shapely.union_all(walls.polygons)
    assert len(union.simplify(2e-3).exterior.coords) == 5
    facade = [p for p in shapely.get_coordinates(union) if p[1] < 64]
    assert len(facade) >= 4  # the nodes lie on it
    for house in houses:
        assert max(iou(house, polygon) for polygon in walls.polygons) > 0.9
    assert walls.simplified == walls.stairs == 0


def test_the_map_s_border_is_kept():
    full = CityMap(np.full((20, 30), 9.0), 2.0)
    (polygon,) = full.walls.polygons
    assert polygon.equals(shapely.box(0, 0, 60, 40))
    cut = drawn(rectangle(-40, 40, 120, 30, 30), side=100)
    (polygon,) = cut.walls.polygons
    border = polygon.exterior.intersection(shapely.box(0, 0, 100, 100).exterior)
    assert border.length == pytest.approx(30 / np.cos(np.radians(30)), rel=0.05)


def test_small_and_nested_buildings():
    assert len(CityMap(np.zeros((8, 8)), 1.0).walls) == 0
    heights = np.zeros((9, 9))
    heights[4, 4] = 9
    (pixel,) = CityMap(heights, 2.0).walls.polygons
    assert pixel.equals(shapely.box(8, 8, 10, 10))
    rings = np.zeros((40, 40))
    for k, height in enumerate((9, 0, 14, 0, 20, 0, 26)):
        rings[2 + 2 * k : 38 - 2 * k, 2 + 2 * k : 38 - 2 * k] = height
    walls = check_coverage(CityMap(rings, 1.0))
    assert [len(polygon.interiors) for polygon in walls.polygons] == [1, 1, 1, 0]
    assert walls.heights.tolist() == [9, 14, 20, 26]


@pytest.mark.parametrize("squared", [False, True])
def test_a_building_of_a_pixel_is_a_square_wherever_it_is(squared):
    heights = np.zeros((7, 9))
    places = [*itertools.product((0, 3, 6), (0, 4, 8))]
    for number, place in enumerate(places):
        heights[place] = 9 + 4 * number
    walls = CityMap(heights, 2.0).walled(squared=squared)
    for (row, column), polygon in zip(places, walls.polygons, strict=True):
        assert polygon.equals(shapely.box(2 * column, 12 - 2 * row, 2 * column + 2, 14 - 2 * row))


def test_wings_of_a_pixel_stay():
    heights = np.zeros((14, 24))
    heights[:2] = heights[:11, ::2] = 9
    (comb,) = CityMap(heights, 1.0).walls.polygons
    assert comb.area == pytest.approx(156, rel=0.05)
    strips = np.zeros((40, 9), np.int32)  # side by side they are no façade that goes on
    strips[5:34, 3], strips[4:34, 4], strips[4:34, 5] = 1, 2, 3
    given = np.array([9.0, 20.0, 14.0]), np.full(3, np.nan), 1.0, (0, 0)
    for polygon, size in zip(walls_of(strips, *given).polygons, (29, 30, 30), strict=True):
        assert polygon.area == pytest.approx(size, abs=1)


def test_a_courtyard_s_corner_on_its_building_s_wall_is_told():
    around = shapely.box(0, 0, 9, 9)
    inside = [shapely.Polygon([(2, y), (8, 4), (4, 8)]) for y in (0, 1)]
    polygons = np.array([shapely.difference(around, one) for one in inside])
    assert shapely.is_valid(polygons).all()
    assert coverage.find_pinched(polygons).tolist() == [True, False]


@settings(max_examples=60, deadline=None)
@given(slope=st.floats(-0.95, 0.95), offset=st.floats(20, 21), count=st.integers(6, 40))
def test_a_settled_line_parts_the_pixels_as_the_true_one_does(slope, offset, count):
    rows = np.ceil(offset + slope * (np.arange(count) + 0.5) - 0.5).astype(int)  # first below it
    y, vertices = rows[0], [(0, rows[0])]
    for x, row in enumerate(rows):
        while y != row:
            y += np.sign(row - y)
            vertices.append((x, y))
        vertices.append((x + 1, y))
    vertices = np.array(vertices, dtype=np.int32)
    runs = np.array([[0, len(vertices) - 1]])
    sums, lines, ranges = np.empty((1, 8)), np.empty((1, 4)), np.empty((1, 3))
    _fitting.moments(vertices, runs, sums)
    _fitting.lines_of(sums, lines)
    one = np.zeros(1, np.int64), np.array([0, 1])
    _fitting.settle(vertices, runs, *one, lines, ranges)
    true = np.arctan(slope)
    assert ranges[0, 0] - 1e-3 <= true <= ranges[0, 1] + 1e-3

    def parted():
        x, y, dx, dy = lines[0]
        middles = np.arange(count) + 0.5
        line = y + (middles - x) * dy / dx
        return (line > rows - 0.5 - 1e-6).all() and (line < rows + 0.5 + 1e-6).all()

    if ranges[0, 2] == 0:
        assert parted()
    inside = ranges[0, 0] + 1e-6 < true + 1e-9 < ranges[0, 1] - 1e-6
    _fitting.turn_within(vertices, runs, *one, ranges, np.array([[np.nan, true + 1e-9]]), lines)
    if inside:
        assert np.arctan2(lines[0, 3], lines[0, 2]) == pytest.approx(true, abs=1e-6)
    if ranges[0, 2] == 0:
        assert parted()


def test_a_building_that_meets_itself_at_a_corner_is_filled_there():
    heights = np.zeros((12, 12))
    heights[2:10, 2:10] = 9
    heights[5:7, 4:6] = heights[4, 6] = 0  # courtyards that meet at a corner leave a corner of it
    heights[3:5, 6:9] = heights[3, 4:6] = 0
    city = CityMap(heights, 1.0)
    walls = check_coverage(city)
    assert walls.changed > 0
    assert not naive.touches_itself(trace_arcs(city.building_labels).labels)


def test_specks_join_the_longest_wall_or_are_dropped():
    heights = np.zeros((30, 30))
    heights[5:15, 5:15] = 9
    heights[5:15, 15:20] = 20
    heights[20, 20] = 9
    city = CityMap(heights, 1.0)
    walls = city.walled(least_area=60)
    assert walls.buildings.tolist() == [1]
    assert walls.polygons[0].area == pytest.approx(150)
    assert walls.dropped == 1
    assert city.walls.dropped == 0


def test_heights_are_whole_storeys_if_wished():
    heights = np.kron([[4.0, 8.0], [10.0, 2.0]], np.ones((10, 10)))
    city = CityMap(heights, 1.0)
    assert city.walls.heights.tolist() == [4, 8, 10, 2]
    assert city.walled(storeys=3).heights.tolist() == [3, 9, 9, 3]


def test_walls_do_not_depend_on_the_unit():
    city = read_map("montpellier-pas-du-loup")
    given = city.building_labels, city.buildings.height, city.buildings.direction
    fine = walls_of(*given, 2.0, (0, 0), detail=3.0)
    coarse = walls_of(*given, 4.0, (0, 0), detail=6.0)
    for a, b in zip(fine.polygons, coarse.polygons, strict=True):
        apart = 2 * shapely.get_coordinates(a) - shapely.get_coordinates(b)
        assert np.abs(apart).max() < 2e-3  # both are on a grid of millimetres


def test_walls_of_a_part_end_where_it_ends():
    city = read_map("lyon-1er")
    y, x = np.mgrid[:256, :256]
    part = city.within((y - 128) ** 2 + (x - 128) ** 2 < 90**2)
    walls = check_coverage(part)
    inside = shapely.Point(city.origin[0] + 256, city.origin[1] - 256).buffer(184)
    assert inside.covers(shapely.union_all(walls.polygons))


@pytest.mark.parametrize(
    "how", [{"detail": -1}, {"detail": "a"}, {"relative": 2}, {"storeys": 0}, {"least_area": -1}]
)
def test_what_is_no_number_is_named(how):
    with pytest.raises(MapError, match=next(iter(how))):
        CityMap(np.full((4, 4), 9.0), 1.0).walled(**how)


# of organic streets: Montpellier and Lyon; of orthogonal ones: New York and Villeurbanne
# 1 − IoU beside the staircase's, angle of façades, degrees
@pytest.mark.parametrize(
    ("name", "pixel", "rest", "angle"),
    [
        ("lyon-1er", 1.0, 0.85, 1.5),
        ("lyon-1er", 2.0, 0.85, 2.5),
        ("new-york-west-village", 1.0, 0.75, 0.6),
        ("new-york-west-village", 2.0, 0.75, 1.0),
        ("montpellier-pas-du-loup", 1.0, 0.75, 1.5),
        ("montpellier-pas-du-loup", 2.0, 0.75, 2.5),
    ],
)
def test_walls_are_nearer_to_the_originals_than_staircases(name, pixel, rest, angle):
    source = _walls.originals(name, pixel)
    stairs = _walls.told(np.array(source.city.outline), source)
    found = _walls.told(np.array(source.city.walls.polygons), source)
    assert 1 - found["IoU"] <= rest * (1 - stairs["IoU"])
    assert found["bearing"] <= angle
    assert found["area"] == pytest.approx(1, abs=0.003 if pixel == 1 else 0.006)
    assert found["overlap"] == pytest.approx(0, abs=1e-6)


# share of the staircase's vertices at most
@pytest.mark.parametrize(
    ("name", "vertices"),
    [
        ("montpellier-pas-du-loup", 0.15),
        ("new-york-west-village", 0.32),
        ("villeurbanne-gratte-ciel", 0.32),
    ],
)
def test_few_vertices_and_true_areas_and_right_angles(name, vertices):
    source = _walls.originals(name, 1.0)
    stairs = _walls.told(np.array(source.city.outline), source)
    walls = np.array(source.city.walls.polygons)
    found = _walls.told(walls, source)
    assert found["vertices"] <= vertices * stairs["vertices"]
    assert found["area"] == pytest.approx(1, abs=0.003)
    assert _walls.of_one_building(walls, source) <= 0.015
    squared = _walls.told(np.array(source.city.walled(squared=True).polygons), source)
    original = _walls.told(source.footprints, source)
    assert squared["right"] >= original["right"] - 0.1 > 0.5


def test_a_wall_that_turns_back_on_itself_is_at_fault():
    # a spike of 75 cm, .6 mm wide, of a building in a grown fabric; steps of 1 mm
    ring = [(7559, 9194), (8519, 2091), (4567, 0), (0, 711), (385, 7905), (8292, 9325)]
    plain = shapely.Polygon([(0, 0), (900, 0), (900, 900), (450, 450), (0, 900)])
    for k in range(len(ring)):
        polygons = np.array([plain, shapely.Polygon(ring[k:] + ring[:k])], dtype=object)
        assert find_spikes(polygons, SPIKE).tolist() == [False, True]
    sharp = shapely.Polygon([(0, 0), (750, 0), (0, 3)])
    assert not find_spikes(np.array([sharp], dtype=object), SPIKE).any()
