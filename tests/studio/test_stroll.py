"""Who walks through a city, and where its sun stands: studio's modules without a picture."""

import itertools
from collections.abc import Iterator
from datetime import date, timedelta

import numpy as np
import pytest
from towns import draw_town

from evocity import CityMap

pytest.importorskip("playwright.sync_api")

from served_scene import BROWSER, Studio, studio

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")


@pytest.fixture(scope="module")
def started() -> Iterator[Studio]:
    with studio() as found:
        yield found


@pytest.fixture
def opened(started):
    with started.opener() as found:
        yield found


def sun(latitude: float, day: date, hour: float) -> tuple[float, float]:
    """Azimuth and height by Spencer, 1971, "Fourier series representation of the position of the
    sun", good to half a degree of any one year; and by turning the sky."""
    g = 2 * np.pi * (day.timetuple().tm_yday - 1 + (hour - 12) / 24) / 365
    declination = 0.006918 - 0.399912 * np.cos(g) + 0.070257 * np.sin(g) - 0.006758 * np.cos(2 * g)
    declination += 0.000907 * np.sin(2 * g) - 0.002697 * np.cos(3 * g) + 0.00148 * np.sin(3 * g)
    turn, tip = np.radians(15 * (hour - 12)), np.radians(90 - latitude)
    # x to the south along the equator, y to the east, z to the pole
    flat = np.cos(declination)
    sky = np.array([flat * np.cos(turn), -flat * np.sin(turn), np.sin(declination)])
    south = sky[0] * np.cos(tip) - sky[2] * np.sin(tip)
    up = sky[0] * np.sin(tip) + sky[2] * np.cos(tip)
    return np.degrees(np.arctan2(sky[1], -south)) % 360, np.degrees(np.arcsin(up))


def test_the_sun_goes_through_a_day_as_another_formula_says(opened):
    page = opened(CityMap(np.zeros((4, 4)), 1.0))
    rng = np.random.default_rng(1)
    cases = [
        (float(rng.uniform(-70, 70)), date(2024, 1, 1) + timedelta(days=int(k)), float(h))
        for k, h in zip(rng.integers(0, 1500, 300), rng.uniform(0, 24, 300), strict=True)
    ]
    found = page.evaluate(
        "(all) => all.map((one) => sun.sunAt(...one))", [[a, str(b), c] for a, b, c in cases]
    )
    for case, one in zip(cases, found, strict=True):
        azimuth, height = sun(*case)
        assert one["height"] == pytest.approx(height, abs=0.6), case
        off = (one["azimuth"] - azimuth + 180) % 360 - 180
        assert abs(off) * np.cos(np.radians(height)) < 0.6, case


@pytest.mark.parametrize(
    ("day", "hour", "degrees"),
    [
        ("2026-03-20", 14.77, 0),
        ("2026-06-21", 8.42, 23.44),
        ("2026-09-23", 0.08, 0),
        ("2026-12-21", 20.83, -23.44),
    ],
)
def test_equinoxes_and_solstices_fall_where_almanacs_have_them(opened, day, hour, degrees):
    page = opened(CityMap(np.zeros((4, 4)), 1.0))
    told = page.evaluate("(one) => sun.declination(...one)", [day, hour])
    assert told == pytest.approx(degrees, abs=0.015)


@pytest.mark.parametrize(
    ("latitude", "day", "hour", "azimuth", "height"),
    [
        (45.0, "2026-12-21", 12, 180, 21.5),
        (45.76, "2026-06-21", 12, 180, 67.7),
        (0.0, "2026-03-20", 6, 90, 0),
        (60.0, "2026-09-23", 18, 270, 0),
        (-33.9, "2026-12-21", 12, 180, 79.5),
        (-33.9, "2026-06-21", 12, 0, 32.7),
        (70.0, "2026-06-21", 0, 0, 3.4),
    ],
)
def test_days_that_everyone_knows(opened, latitude, day, hour, azimuth, height):
    page = opened(CityMap(np.zeros((4, 4)), 1.0))
    found = page.evaluate("(one) => sun.sunAt(...one)", [latitude, day, hour])
    # south of the tropic the summer's noon sun stands in the north
    azimuth = 0 if latitude == -33.9 else azimuth
    assert found["height"] == pytest.approx(height, abs=0.4)
    assert (found["azimuth"] - azimuth + 180) % 360 - 180 == pytest.approx(0, abs=0.6)


def test_no_wall_is_gone_through(opened):
    """However one goes, on foot, one stands on low ground; and one comes about."""
    city = draw_town(4, side=64)
    page = opened(city)
    ways = np.random.default_rng(2).normal(0, 4, (3000, 3))
    path = page.evaluate(
        """(ways) => {
          const stroll = new camera.Stroll(city, () => {}), path = [stroll.camera.position];
          for (const [ahead, right, turn] of ways) {
            stroll.look(20 * turn, 0);
            stroll.go(ahead, right, 0);
            path.push(stroll.camera.position);
          }
          return path;
        }""",
        ways.tolist(),
    )
    path = np.array(path)
    side = city.metres_per_pixel
    rows = np.floor(city.shape[0] / 2 - path[:, 1] / side).astype(int)
    columns = np.floor(city.shape[1] / 2 + path[:, 0] / side).astype(int)
    assert (city.heights[rows, columns] <= 1.5).all()
    assert (path[:, 2] == 1.7).all()
    assert np.ptp(path[:, :2], axis=0).min() > 20
    steps = np.linspace(0, 1, 60)[:, None]  # nor is one leapt over
    for a, b in itertools.pairwise(path):
        way = a[:2] + steps * (b - a)[:2]
        if np.abs(b - a).max() < 1.5:
            row = np.floor(city.shape[0] / 2 - way[:, 1] / side).astype(int)
            column = np.floor(city.shape[1] / 2 + way[:, 0] / side).astype(int)
            assert city.heights[row, column].max() <= 1.7
