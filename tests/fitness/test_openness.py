import math

import geopandas
import momepy
import naive
import numpy as np
import pyogrio
import pytest
import shapely
from affine import Affine
from rasterio import features
from scipy import ndimage
from towns import draw_town

from evocity import isometries
from evocity.citymap import CityMap
from evocity.fitness import (
    courtyard_index,
    open_space_connectivity,
    sky_view_factor,
    street_width,
)
from evocity.fitness.openness import cast_rays, sky_view

MEASURES = (courtyard_index, open_space_connectivity, sky_view_factor, street_width)


def slabs(width, gap, pixel, side=120, height=9.0):
    """Walls of ``width`` px with streets of ``gap`` px between, along the columns."""
    built = np.arange(side) % (width + gap) < width
    return CityMap(height * built * np.ones((side, 1)), pixel)


# -- streets -----------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [1, 2, 3, 4, 7, 10])
@pytest.mark.parametrize("pixel", [0.5, 2.0])
def test_a_street_is_as_wide_as_it_is(gap, pixel):
    assert street_width(slabs(5, gap, pixel)) == pytest.approx(gap * pixel, rel=1e-6)


def test_a_long_street_counts_for_more_than_a_short_one():
    heights = np.full((100, 100), 9.0)
    heights[20:26] = 0  # 100 px long, 6 wide
    heights[60:70, 45:48] = 0  # a light well
    assert 11 < street_width(CityMap(heights, 2.0)) < 12


def test_ground_wider_than_a_street_is_none():
    assert street_width(slabs(30, 29, 2.0)) == pytest.approx(58)
    assert "no street" in street_width(slabs(30, 31, 2.0)).reason


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.name)
def test_the_pixel_is_only_a_unit(measure):
    city = draw_town(7, side=128, buildings=150)
    scaled = CityMap(city.heights / 2, 1.0)  # the same city, half as large in all directions
    scaled.__dict__["built"] = city.built  # but what is built is a matter of metres
    power = 0.5 if measure is street_width else 1
    assert measure(scaled) == pytest.approx(power * measure(city), rel=1e-5)


# -- connectivity and courtyards ---------------------------------------------------------


def test_connectivity_is_the_share_of_the_largest_piece(town):
    _, count = ndimage.label(~town.built, structure=np.ones((3, 3)))
    labels, _ = ndimage.label(~town.built, structure=np.ones((3, 3)))
    sizes = [(labels == k).sum() for k in range(1, count + 1)]
    assert open_space_connectivity(town) == pytest.approx(max(sizes) / sum(sizes))


def test_ground_hangs_together_at_corners():
    wall = np.eye(6)
    assert open_space_connectivity(CityMap(9 * wall, 2.0)) == 1
    wall += np.eye(6, k=1)  # now its pixels touch by sides
    assert open_space_connectivity(CityMap(9 * wall, 2.0)) == pytest.approx(15 / 25)


def test_a_building_in_a_courtyard_is_no_courtyard():
    heights = np.zeros((30, 30))
    heights[5:25, 5:25] = 9
    heights[8:22, 8:22] = 0
    heights[10:20, 10:20] = 9
    heights[12:18, 12:18] = 0
    city = CityMap(heights, 2.0)
    yards = 14**2 - 10**2 + 6**2
    assert courtyard_index(city) == pytest.approx(yards / (20**2 - 14**2 + 10**2 - 6**2))
    assert city.open_space.enclosed.tolist() == [4 * 14**2, 4 * 6**2]


def test_courtyards_of_bubenec_are_those_of_momepy():
    path = momepy.datasets.get_path("bubenec")
    shapes = shapely.from_wkb(pyogrio.raw.read(path, layer="buildings", columns=[])[2])
    parts = shapely.get_parts(shapely.union_all(shapes))
    truth = momepy.courtyard_area(geopandas.GeoSeries(parts))
    assert (len(parts), sum(len(part.interiors) for part in parts)) == (28, 7)
    assert truth.sum() == pytest.approx(68_690.925, abs=1e-3)
    west, south, east, north = shapely.total_bounds(parts)
    raster = features.rasterize(
        shapes,
        out_shape=(math.ceil(north - south), math.ceil(east - west)),
        transform=Affine(1, 0, west, 0, -1, north),
    )
    city = CityMap(9.0 * raster, 1.0)
    enclosed = city.open_space.enclosed
    assert enclosed.size == 28
    assert enclosed.sum() == pytest.approx(truth.sum(), rel=2e-3)
    large = np.sort(truth[truth > 100])
    assert np.sort(enclosed)[-large.size :] == pytest.approx(large, rel=0.02)
    filled = shapely.union_all(shapely.polygons(shapely.get_exterior_ring(parts)))
    built = shapely.area(parts).sum()  # islands in courtyards are no ground
    assert courtyard_index(city) == pytest.approx((filled.area - built) / built, rel=2e-3)


# -- sky ---------------------------------------------------------------------------------


def canyon(width, height, pixel=1.0, length=401):
    heights = np.full((length, width + 40), float(height))
    heights[:, 20 : 20 + width] = 0
    return CityMap(heights, pixel)


@pytest.mark.parametrize(("width", "height"), [(21, 20), (21, 5), (11, 20), (41, 20)])
def test_the_sky_of_a_canyon(width, height):
    """Its walls are W/2 / sin φ away from the middle; over all φ that is 1/√(1 + (2h/W)²)."""
    seen = sky_view(canyon(width, height), np.array([200]), np.array([20 + width // 2]))
    tangents = 2 * height / width * np.sin(np.arange(16) * np.pi / 8)
    assert seen[0] == pytest.approx(np.mean(1 / (1 + tangents**2)), abs=1e-6)
    assert seen[0] == pytest.approx(1 / math.hypot(1, 2 * height / width), abs=0.01)


def test_the_published_canyon():
    seen = sky_view(canyon(21, 20), np.array([200]), np.array([30]))
    assert seen[0] == pytest.approx(0.4648, abs=5e-4)


def test_rays_pass_the_pixels_they_pass():
    starts, down, along, distance = cast_rays(30.0)
    angles = []
    for d in range(16):
        ray = slice(starts[d], starts[d + 1])
        i, j, far = down[ray], along[ray], distance[ray]
        assert np.all(np.diff(far) > 0)
        angle = math.atan2(i[-1], j[-1])
        angle = round(angle / (math.pi / 8)) * math.pi / 8
        angles.append(angle % (2 * math.pi))
        # a point just after the one of entry lies in the pixel, one just before does not
        for step, inside in ((1e-6, True), (-1e-6, False)):
            y, x = (far + step) * math.sin(angle), (far + step) * math.cos(angle)
            assert np.all(((np.rint(y) == i) & (np.rint(x) == j)) == inside)
    assert np.sort(angles) == pytest.approx(np.arange(16) * math.pi / 8)


@pytest.mark.parametrize("limit", [0.3, 0.5, 1.0, 1.2, 8.0])
def test_there_are_always_sixteen_directions(limit):
    starts, *_, distance = cast_rays(limit)
    assert starts.size == 17
    assert np.all(distance < limit)


@pytest.mark.parametrize("shape", [(1, 1), (7, 30), (24, 24)])
@pytest.mark.parametrize("pixel", [0.5, 20.0, 500.0])
def test_the_sky_by_the_kernel_and_by_its_twin(shape, pixel):
    heights = np.random.default_rng(5).gamma(0.3, 20, shape).astype(np.float32)
    city = CityMap(heights, pixel)
    y, x = np.nonzero(np.ones(shape))
    starts, down, along, distance = cast_rays(min(200 / pixel, math.hypot(*shape)))
    expected = naive.sky_seen(heights, y, x, starts, down, along, 1 / (distance * pixel))
    assert sky_view(city, y, x) == pytest.approx(expected, abs=1e-6)


def test_the_sky_is_that_of_many_fine_rays():
    """120 azimuths in steps of a tenth of a pixel, in place of 16 along pixels: the definition of
    Oke, which UMEP follows too."""
    city = draw_town(5)
    y, x = (axis[::29] for axis in np.nonzero(city.open_ground))
    far = np.arange(0.05, 64, 0.1)
    shares = []
    for azimuth in np.arange(120) * np.pi / 60:
        rows = np.floor(y[:, None] + 0.5 + far * np.sin(azimuth)).astype(int)
        columns = np.floor(x[:, None] + 0.5 + far * np.cos(azimuth)).astype(int)
        inside = (rows >= 0) & (rows < 64) & (columns >= 0) & (columns < 64)
        heights = np.where(inside, city.heights[rows % 64, columns % 64], 0)
        tangent = ((heights - city.heights[y, x][:, None]) / (2 * far)).max(axis=1).clip(0)
        shares.append(1 / (1 + tangent**2))
    truth = np.mean(shares, axis=0)
    seen = sky_view(city, y, x)
    assert seen.mean() == pytest.approx(truth.mean(), abs=0.01)
    assert abs(seen - truth).max() < 0.15


def test_every_fourth_pixel_says_what_all_say():
    city = draw_town(7, side=128, buildings=150)
    every = sky_view(city, *np.nonzero(~city.built)).mean()
    assert sky_view_factor(city) == pytest.approx(every, abs=0.005)


def test_a_map_whose_few_open_pixels_are_missed_looks_at_all_of_them():
    heights = np.full((16, 16), 9.0)
    heights[0, 2] = 0
    city = CityMap(heights, 2.0)
    assert sky_view_factor(city) == sky_view(city, np.array([0]), np.array([2]))[0]


def test_a_wall_raised_takes_sky():
    low, high = slabs(5, 10, 2.0), slabs(5, 10, 2.0, height=20.0)
    assert sky_view_factor(high) < sky_view_factor(low) < 1


# -- laws --------------------------------------------------------------------------------


@pytest.mark.parametrize("measure", MEASURES, ids=lambda m: m.name)
@pytest.mark.parametrize("shape", [(128, 128), (121, 97)])
@pytest.mark.parametrize("iso", range(1, 8))
def test_turning_and_mirroring_changes_nothing(measure, shape, iso):
    heights = draw_town(7, side=128, buildings=150).heights[: shape[0], : shape[1]]
    value = measure(CityMap(heights, 2.0))
    assert not math.isnan(value)
    turned = CityMap(isometries.apply(iso, heights), 2.0)
    assert measure(turned) == pytest.approx(value, abs=0.2 if measure is street_width else 1e-9)


@pytest.mark.parametrize(
    ("measure", "heights", "reason"),
    [
        (street_width, np.zeros((9, 9)), "no street"),
        (street_width, np.full((9, 9), 9.0), "no street"),
        (courtyard_index, np.zeros((9, 9)), "nothing is built"),
        (open_space_connectivity, np.full((9, 9), 9.0), "no open ground"),
        (sky_view_factor, np.full((9, 9), 9.0), "no open ground"),
    ],
)
def test_where_there_is_nothing_to_measure(measure, heights, reason):
    assert reason in measure(CityMap(heights, 2.0)).reason
