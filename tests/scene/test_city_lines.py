"""The lines of a city: edges, skylines, façades, streets; and what curves make of them."""

import warnings

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

from evocity import CityMap
from evocity.errors import MapError
from evocity.scene import fabric_edges, facades, picture_outline, skyline, street_axes
from evocity.shapes import Detailed, crossing_of, fit_curve, line_dimension, resampled, rms_of

TOWN = draw_town(3, side=96)


def blocks(*places, side=60, pixel=2.0):
    """A map with blocks (row, column, rows, columns) on it, 10 m high."""
    heights = np.zeros((side, side))
    for row, column, rows, columns in places:
        heights[row : row + rows, column : column + columns] = 10
    return CityMap(heights, pixel)


def test_the_edge_of_a_block_is_the_block():
    (ring,) = fabric_edges(blocks((10, 20, 15, 12)), reach=6)
    assert (ring[0] == ring[-1]).all()
    # 30 × 24 m, its corners cut by triangles of half a pixel
    assert shapely.Polygon(ring).area == pytest.approx(30 * 24 - 4 * 0.5)
    assert shapely.Polygon(ring).bounds == (40, 70, 64, 100)


def test_narrow_gaps_are_within_the_fabric_and_wide_ones_are_not():
    near, far = (
        blocks((10, 10, 20, 15), (10, 29, 20, 15)),
        blocks((10, 5, 20, 15), (10, 40, 20, 15)),
    )
    assert len(fabric_edges(near, reach=6)) == 1
    assert len(fabric_edges(near, reach=2)) == 2
    assert len(fabric_edges(far, reach=6)) == 2
    court = blocks((10, 10, 40, 10), (10, 40, 40, 10), (10, 10, 10, 40), (40, 10, 10, 40))
    outer, inner = fabric_edges(court, reach=6)
    assert shapely.Polygon(outer).contains(shapely.Polygon(inner))
    assert fabric_edges(court, reach=6, shortest=200)[0].shape == outer.shape
    assert len(fabric_edges(court, reach=6, shortest=200)) == 1


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_the_edge_turns_with_the_map(turns):
    areas = []
    for k in (0, turns):
        city = CityMap(np.rot90(TOWN.heights, k), TOWN.metres_per_pixel)
        areas.append(sorted(shapely.Polygon(one).area for one in fabric_edges(city)))
    np.testing.assert_allclose(*areas)


def naive_skyline(city, bearing):
    """Pixel by pixel: of each width all that its square, seen from there, takes up."""
    rows, columns = city.shape
    turn = np.radians(bearing)
    right = np.array([np.cos(turn), -np.sin(turn)])
    half = np.abs(right).sum() / 2
    middles = [
        ((column + 0.5 - columns / 2) * right[0] - (row + 0.5 - rows / 2) * right[1], row, column)
        for row in range(rows)
        for column in range(columns)
    ]
    first = int(np.floor(min(middles)[0] - half + 1e-9))
    count = int(np.ceil(max(middles)[0] + half - 1e-9)) - first
    found = np.zeros(count)
    for middle, row, column in middles:
        for at in range(count):
            low = at + first
            if low + 1 > middle - half + 1e-6 and low < middle + half - 1e-6:
                found[at] = max(found[at], city.heights[row, column])
    return found


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 100), st.floats(-360, 360))
def test_a_skyline_is_the_highest_of_what_stands_behind_each_place(seed, bearing):
    rng = np.random.default_rng(seed)
    city = CityMap(rng.uniform(0, 30, (7, 9)) * (rng.random((7, 9)) < 0.5), 2.0)
    np.testing.assert_allclose(skyline(city, bearing)[:, 1], naive_skyline(city, bearing))


def test_skylines_along_the_axes_are_maxima_of_columns_and_rows():
    heights = TOWN.heights
    np.testing.assert_array_equal(skyline(TOWN, 0)[:, 1], heights.max(axis=0))
    np.testing.assert_array_equal(skyline(TOWN, 90)[:, 1], heights.max(axis=1))
    np.testing.assert_array_equal(skyline(TOWN, 180)[:, 1], heights.max(axis=0)[::-1])
    np.testing.assert_allclose(np.diff(skyline(TOWN, 37)[:, 0]), TOWN.metres_per_pixel)


def test_streets_and_walls_are_all_there():
    axes = street_axes(TOWN, shortest=0)
    total = sum(shapely.LineString(one).length for one in axes)
    assert total == pytest.approx(TOWN.street_graph.length.sum())
    assert len(axes) < len(TOWN.street_graph)  # edges that go on are one line
    walls = sum(shapely.LineString(one).length for one in facades(TOWN, shortest=0))
    polygons = np.array(TOWN.walls.polygons, dtype=object)
    assert walls == pytest.approx(shapely.length(polygons).sum())


def test_a_smooth_street_takes_the_detail_of_another_towns_edge():
    axis, edge = street_axes(TOWN)[0], fabric_edges(draw_town(5, side=96))[0]
    rough = fit_curve(edge, depth=6, starts=2)
    smooth = Detailed.of(axis, rough.curve.maps, 6)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it may cross itself
        found = smooth.transferred(rough, levels=3, gain=0.5)
    line = found.line()
    np.testing.assert_allclose(line[[0, -1]], axis[[0, -1]], atol=1e-9)
    # as a line it is coded again, to the same details
    again = Detailed.of(line, rough.curve.maps)
    for level in range(3, 6):
        np.testing.assert_allclose(again.details[level], 0.5 * rough.details[level], atol=1e-6)
    assert rms_of(again, 3) > rms_of(smooth, 3)


def test_a_skyline_is_measured_by_its_dimension_and_its_detail():
    flat = np.column_stack([np.linspace(0, 200, 97), np.full(97, 10.0)])
    rugged = skyline(TOWN, 20)
    assert line_dimension(flat).dimension == pytest.approx(1, abs=0.03)
    assert line_dimension(rugged).dimension > 1.05
    amounts = [Detailed.of(one, fit_curve(flat).curve.maps, 5).amounts for one in (flat, rugged)]
    assert (amounts[0] < 1e-9).all()
    assert amounts[1].min() > 1e-3
    assert crossing_of(resampled(rugged, 97)) is None


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        (lambda: fabric_edges(CityMap(np.zeros((8, 8)), 2.0)), "has no building"),
        (lambda: facades(CityMap(np.zeros((8, 8)), 2.0)), "has no building"),
        (lambda: fabric_edges(TOWN, reach=-1), "reach"),
        (lambda: street_axes(TOWN, shortest=np.nan), "shortest"),
        (lambda: skyline(TOWN, np.inf), "bearing"),
    ],
)
def test_what_has_no_lines_is_told(fault, says):
    with pytest.raises(MapError, match=says):
        fault()


def test_the_outline_of_a_picture_begins_at_its_lowest_point_and_holds_its_largest_area():
    dark = np.zeros((40, 60), bool)
    dark[5:30, 10:50] = True
    dark[10:15, 20:30] = False  # a hole is left out
    dark[30:38, 28:30] = True  # a stem
    dark[36:39, 3:6] = True  # a smaller area
    line = picture_outline(dark)
    assert (line[0] == line[-1]).all()
    assert line[0, 1] == line[:, 1].min() == 2
    shape = shapely.Polygon(line)
    assert shape.is_valid
    assert shape.bounds == (10, 2, 50, 35)
    assert shape.area == pytest.approx(25 * 40 + 8 * 2, abs=2)
    np.testing.assert_allclose(
        shapely.Polygon(picture_outline(np.ones((7, 9), bool))).bounds, (0, 0, 9, 7)
    )
    apart = dark.copy()
    apart[:, 40:42] = False
    assert shapely.Polygon(picture_outline(apart, 2)).bounds == shape.bounds


@pytest.mark.parametrize(
    ("dark", "reach"),
    [(np.zeros((4, 4), bool), 0), (np.ones(4, bool), 0), (np.ones((4, 4)), 0),
     (np.ones((4, 4), bool), -1), (np.ones((4, 4), bool), float("nan"))],
)  # fmt: skip
def test_a_picture_without_an_outline_is_refused(dark, reach):
    with pytest.raises(MapError):
        picture_outline(dark, reach)
