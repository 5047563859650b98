"""Sun on open ground and light on façades: twins, published numbers, laws, and pvlib's sun."""

import math

import naive
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from towns import draw_town

import evocity
from evocity import isometries
from evocity.citymap import CityMap
from evocity.fitness import _kernels, daylight, light, winter_sun

seeds = st.integers(0, 2**32)


def town(seed, side=64, pixel=2.0, **place):
    return draw_town(seed % 60, side=side, pixel=pixel).replace(
        draw_town(seed % 60).heights, **place
    )


def at(latitude):
    """Where a map of 64 px of 2 m has its middle at a latitude."""
    zone = 32600 if latitude >= 0 else 32700
    from pyproj import Transformer

    x, y = Transformer.from_crs(4326, zone + 31, always_xy=True).transform(3.0, latitude)
    return {"origin": (x - 64, y + 64), "crs": f"EPSG:{zone + 31}"}


# -- the sun ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("latitude", "hours", "noon"),
    [(45.0, 8.57, 21.56), (0.0, 12.0, 66.56), (60.0, 5.52, 6.56), (-33.9, 9.74, 32.66)],
)
def test_the_shortest_day(latitude, hours, noon):
    """Hours by the sunrise equation; heights at noon are 90° − |latitude| − 23.44°."""
    length, suns = light.shortest_day(latitude)
    assert length == pytest.approx(hours, abs=0.01)
    assert max(height for _, height in suns) == pytest.approx(noon, abs=1.8)  # near noon
    assert min(height for _, height in suns) > 0
    south = 180 if latitude >= 0 else 0
    sides = [(azimuth - south + 180) % 360 - 180 for azimuth, _ in suns]
    assert sides == pytest.approx([-side for side in sides[::-1]])


def test_no_sun_beyond_the_polar_circles():
    assert light.shortest_day(66.5)[0] > 0
    assert light.shortest_day(66.6) == (0.0, ())
    reason = winter_sun(town(1, **at(70.0))).reason
    assert reason == "the sun does not rise on the shortest day at 70.0°"


@pytest.mark.parametrize("latitude", [59.9, 45.77, 30.0, 1.3, -1.3, -33.9])
def test_the_sun_stands_where_pvlib_has_it(latitude):
    """The true positions of NREL's algorithm, at the times of our hour angles."""
    pd = pytest.importorskip("pandas")
    spa = pytest.importorskip("pvlib.solarposition")
    day = pd.Timestamp("2026-12-21" if latitude >= 0 else "2026-06-21", tz="UTC")
    hours, suns = light.shortest_day(latitude)
    minutes = pd.date_range(day, periods=1440, freq="min")
    sun = spa.get_solarposition(minutes, latitude, 0.0, method="nrel_numpy")
    noon = minutes[int(sun["elevation"].to_numpy().argmax())]
    noon += pd.Timedelta(minutes=float(_above_noon(sun, noon)))
    turns = hours * ((2 * np.arange(len(suns)) + 1) / (2 * len(suns)) - 0.5)
    times = pd.DatetimeIndex([noon + pd.Timedelta(hours=float(turn)) for turn in turns])
    truth = spa.get_solarposition(times, latitude, 0.0, method="nrel_numpy")
    azimuths, heights = np.array(suns).T
    assert heights == pytest.approx(truth["elevation"].to_numpy(), abs=0.1)
    off = (azimuths - truth["azimuth"].to_numpy() + 180) % 360 - 180
    assert off == pytest.approx(np.zeros(len(suns)), abs=0.2)
    up = (sun["elevation"] > 0).mean() * 24
    assert hours == pytest.approx(up, abs=0.05)


def _above_noon(sun, noon):
    """Minutes from the highest whole minute to the vertex of a parabola through three."""
    k = sun.index.get_loc(noon)
    before, top, after = sun["elevation"].to_numpy()[k - 1 : k + 2]
    return (before - after) / (2 * (before - 2 * top + after))


# -- shade -----------------------------------------------------------------------------------


@given(seeds, st.floats(-1, 1), st.floats(0.02, 9))
@settings(max_examples=25, deadline=None)
def test_sunny_pixels_as_by_a_ray_from_each(seed, across, rise):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(1, 20, 2))
    heights = (rng.gamma(0.3, 12, shape) * (rng.random(shape) < 0.3)).astype(np.float32)
    ground, rise = heights <= 1.5, np.float32(rise)
    shadow = np.empty(sum(shape), np.float32)
    count = _kernels.count_sunny(heights, ground, across, rise, shadow)
    expected = naive.count_sunny(heights.astype(float), ground, across, float(rise))
    assert abs(count - expected) <= 1  # float32 decides ties


@pytest.mark.parametrize("azimuth", [127.0, 150.0, 180.0, 233.0, 270.0, 0.0, 41.0, 90.0])
def test_shade_is_that_of_a_fine_ray(azimuth):
    """A ray of steps of a tenth of a pixel, not along rows, from the middle of each pixel."""
    city = draw_town(5)
    sun, ground = 19.0, np.argwhere(city.open_ground)
    down, along = -math.cos(math.radians(azimuth)), math.sin(math.radians(azimuth))
    lit = 0
    for y, x in ground:
        far = np.arange(0.05, 90, 0.1)
        rows = np.floor(y + 0.5 + far * down).astype(int)
        columns = np.floor(x + 0.5 + far * along).astype(int)
        inside = (rows >= 0) & (rows < 64) & (columns >= 0) & (columns < 64)
        rise = far[inside] * 2 * math.tan(math.radians(sun))
        lit += (city.heights[rows[inside], columns[inside]] <= rise).all()
    assert light.count_sunny(city, azimuth, sun) / len(ground) == pytest.approx(
        lit / len(ground), abs=0.03
    )


def test_a_shadow_is_as_long_as_the_sun_is_low():
    heights = np.zeros((80, 80))
    heights[60:] = 10
    city = CityMap(heights, 1.0)
    for sun in (12.0, 21.5, 40.0):
        shaded = 60 - light.count_sunny(city, 180.0, sun) / 80
        assert shaded == pytest.approx(10 / math.tan(math.radians(sun)), abs=1)


# -- winter sun ------------------------------------------------------------------------------


def test_the_latitude_is_that_of_the_place_then_of_the_first_source_then_45():
    plain, cape, oslo = town(1), town(2, **at(-33.9)), town(3, **at(59.9))
    assert light.find_latitude(plain) == 45.0
    assert light.find_latitude(cape) == pytest.approx(-33.9, abs=1e-4)
    assert light.find_latitude(plain, [town(4), oslo, cape]) == pytest.approx(59.9, abs=1e-4)
    assert light.find_latitude(cape, [oslo]) == pytest.approx(-33.9, abs=1e-4)
    assert light.find_latitude(plain.replace(plain.heights, origin=(0, 0))) == 45.0
    from evocity.io.projection import code_of, plane

    nowhere = plain.replace(plain.heights, origin=(0, 0), crs=code_of(plane()))
    assert light.find_latitude(nowhere) == 45.0
    assert winter_sun(plain, sources=[cape]) == winter_sun(cape.replace(plain.heights))
    assert light.find_latitude(evocity.read_map("lyon-1er")) == pytest.approx(45.77, abs=0.01)


def test_empty_and_full_maps_of_sun():
    assert winter_sun(CityMap(np.zeros((9, 7)), 2.0)) == light.shortest_day(45.0)[0]
    assert winter_sun(CityMap(np.full((9, 7), 9.0), 2.0)).reason == "there is no open ground"
    assert winter_sun(CityMap(np.zeros((1, 1)), 2.0)) == light.shortest_day(45.0)[0]


@given(seeds, st.sampled_from([45.0, -45.0, 20.0]))
@settings(max_examples=20, deadline=None)
def test_higher_roofs_on_the_same_plan_take_sun(seed, latitude):
    city = town(seed, **at(latitude))
    assert winter_sun(city.replace(1.5 * city.heights)) <= winter_sun(city)


@given(st.integers(3, 60))
@settings(max_examples=20, deadline=None)
def test_a_block_in_the_south_takes_more_sun_than_one_in_the_north(height):
    south, north = np.zeros((64, 64)), np.zeros((64, 64))
    south[48:], north[:16] = height, height
    for latitude, first, other in ((45.0, south, north), (-45.0, north, south)):
        shaded = CityMap(first, 2.0, **at(latitude))
        assert winter_sun(shaded) < winter_sun(shaded.replace(other))


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_morning_and_evening_are_alike(seed):
    city = town(seed)
    mirrored = city.replace(city.heights[:, ::-1])
    assert winter_sun(mirrored) == pytest.approx(winter_sun(city), abs=0.1)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_the_pixel_is_only_a_unit_of_sun_and_sky(seed):
    city = town(seed)
    half = CityMap(city.heights, 1.0)
    city = city.replace(2 * city.heights)
    assert winter_sun(half) == pytest.approx(winter_sun(city), abs=0.01)
    assert daylight(half) == pytest.approx(daylight(city), abs=0.02)  # other storeys


# -- sky -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("seed", "pixel"), [(0, 0.7), (1, 2.0), (2, 2.0), (3, 90.0)])
def test_light_on_facades_as_by_every_pixel_of_every_ray(seed, pixel):
    rng = np.random.default_rng(seed)
    shape = tuple(rng.integers(5, 12, 2))
    heights = (rng.gamma(1, 8, shape) * (rng.random(shape) < 0.4)).astype(np.float32)
    city = CityMap(heights, pixel)
    walls, normals, facing = light.find_facades(city, 1)
    rays = light._directed_rays(min(light.HORIZON / pixel, math.hypot(*shape)))
    expected = naive.light_facades(heights, walls, normals, facing / 2, 3.0, *rays, pixel)
    sky = light.light_walls(city, walls, normals, facing)
    assert sky == pytest.approx(expected, abs=1e-5)


def test_directions_are_those_of_the_rays():
    starts, ways, down, along, _ = light._directed_rays(60.0)
    for d in range(16):
        last = starts[d + 1] - 1
        far = np.array([down[last], along[last]]) / math.hypot(down[last], along[last])
        assert far == pytest.approx(ways[:, d], abs=0.02)
    assert np.hypot(*ways) == pytest.approx(np.ones(16))


def test_a_free_wall_has_39_6_percent():
    """The published value of a wall without anything before it; 27 % under 25°, Littlefair's."""
    assert round(light.FULL_SKY, 3) == 0.396
    azimuths = np.linspace(-math.pi, math.pi, 721)[:-1]
    free = naive.sky_component(np.zeros(720), azimuths, 0.0)
    assert free == pytest.approx(light.FULL_SKY, abs=1e-4)


def facing_walls(width, near, high, pixel=1.0, side=441):
    """A long wall, and a street before it with a long wall of another height on its other side."""
    heights = np.zeros((side, width + 40))
    heights[:, :20], heights[:, -20:] = near, high
    city = CityMap(heights, pixel)
    walls = np.array([[side // 2], [20], [side // 2], [19]])
    return light.light_walls(city, walls, np.array([[0.0], [1.0]]), np.array([1.0]))[0]


@pytest.mark.parametrize("degrees", [10, 25, 45, 60])
def test_a_street_of_the_published_angle(degrees):
    """A window 1.5 m above ground; the roofs across, 40 m away, are so many degrees above it."""
    tangent = math.tan(math.radians(degrees))
    sky = facing_walls(40, 3.0, 1.5 + 40 * tangent)
    # the horizon of an endless roof sinks to both sides
    azimuths = np.radians(np.arange(-90, 90, 0.5) + 0.25)
    truth = naive.sky_component(np.arctan(tangent * np.cos(azimuths)), azimuths, 0.0)
    assert sky == pytest.approx(truth, abs=0.012)
    if degrees == 25:
        assert truth == pytest.approx(0.27, abs=0.01)


@pytest.mark.parametrize("width", [4, 6, 10])
def test_coarse_pixels_leave_the_width_of_a_street(width):
    coarse = facing_walls(width, 12.0, 12.0, 2.0)
    fine = facing_walls(width * 4, 12.0, 12.0, 0.5, 1761)
    assert coarse == pytest.approx(fine, abs=0.012)


@pytest.mark.parametrize("degrees", [0, 10, 22, 30, 45, 70])
def test_an_oblique_wall_is_no_staircase(degrees):
    y, x = np.mgrid[:96, :96] - 47.5
    turn = math.radians(degrees)
    across = x * math.cos(turn) + y * math.sin(turn)
    along = y * math.cos(turn) - x * math.sin(turn)
    slab = (abs(across) < 8) & (abs(along) < 34)
    city = CityMap(np.where(slab, 12.0, 0), 2.0)
    assert daylight(city) == pytest.approx(light.FULL_SKY, abs=0.008)
    _, _, facing = light.find_facades(city, 1)
    assert facing.sum() == pytest.approx(2 * (16 + 68), rel=0.08)  # its outline


def test_every_sixth_line_says_what_all_say():
    for name in ("lyon-1er", "cape-town-salt-river"):
        city = evocity.read_map(name)
        walls, normals, facing = light.find_facades(city, 1)
        area = facing * (city.heights[*walls[2:]] - city.heights[*walls[:2]])
        every = (area * light.light_walls(city, walls, normals, facing)).sum() / area.sum()
        assert daylight(city) == pytest.approx(every, abs=0.004)


@given(seeds, st.integers(1, 7))
@settings(max_examples=20, deadline=None)
def test_light_on_facades_turns_with_the_map(seed, iso):
    city = town(seed)
    turned = city.replace(isometries.apply(iso, city.heights))
    assert daylight(turned) == pytest.approx(daylight(city), abs=1e-6)


@given(st.integers(3, 60))
@settings(max_examples=20, deadline=None)
def test_a_higher_block_across_takes_light(height):
    assert facing_walls(12, 15.0, height + 3.0, 2.0, 101) <= facing_walls(
        12, 15.0, float(height), 2.0, 101
    )


def test_maps_without_facades():
    for heights in (np.zeros((9, 9)), np.full((9, 9), 9.0), np.full((1, 1), 9.0)):
        assert daylight(CityMap(heights, 2.0)).reason == "there are no façades"
