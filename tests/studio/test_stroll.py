"""Who walks through a city, and where its sun stands: studio's modules without a picture."""

import itertools
import time
from datetime import date, timedelta

import numpy as np
import pytest
from towns import draw_town

from evocity import CityMap

pytest.importorskip("playwright.sync_api")

from served_scene import BROWSER

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")


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


@pytest.mark.slow
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


def strolled(page) -> None:
    """Begin a stroll, by a clock that goes when it is told to, however busy the machine is."""
    page.clock.install(time=0)
    page.clock.pause_at(3_600_000)  # it cannot have come so far by itself
    page.evaluate(
        """() => {
          const canvas = document.createElement("canvas");
          document.body.append(canvas);
          window.stroll = new camera.Stroll(city, () => {}, { position: [0, 0, 1.7], azimuth: 90 });
          window.end = stroll.attach(canvas);
          canvas.focus();
        }"""
    )


def held(page, keys: str, milliseconds: int) -> np.ndarray:
    """How far one comes while keys are held: east, north and up."""
    before = page.evaluate("stroll.camera.position")
    for key in keys.split("+"):
        page.keyboard.down(key)
    page.clock.run_for(milliseconds)
    for key in keys.split("+")[::-1]:
        page.keyboard.up(key)
    page.clock.run_for(50)
    return np.subtract(page.evaluate("stroll.camera.position"), before)


def test_keys_walk_turn_and_rise(opened):
    page = opened(CityMap(np.zeros((64, 64)), 4.0))
    strolled(page)
    for keys, way in (("w", (1, 0)), ("s", (-1, 0)), ("a", (0, 1)), ("d", (0, -1))):
        moved = held(page, keys, 150)
        assert moved @ np.array([*way, 0]) > 0.1, keys
        assert np.abs(moved[:2] @ np.array([-way[1], way[0]])) < 1e-9
    slow, fast = held(page, "ArrowUp", 400), held(page, "Shift+ArrowUp", 400)
    assert fast[0] > 1.5 * slow[0]
    assert held(page, "PageUp", 200)[2] > 0.2
    assert held(page, "PageDown", 900)[2] < 0
    assert page.evaluate("stroll.camera.position[2]") == pytest.approx(1.7)
    assert (held(page, "ArrowRight", 200) == 0).all()
    assert 91 < page.evaluate("stroll.camera.azimuth") < 150
    # what is held when the canvas is left is let go
    page.keyboard.down("w")
    page.evaluate("document.activeElement.blur()")
    page.clock.run_for(50)
    still = page.evaluate("stroll.camera.position")
    page.clock.run_for(200)
    assert page.evaluate("stroll.camera.position") == still
    page.keyboard.up("w")
    page.evaluate("end(); document.querySelector('canvas').focus()")
    assert (held(page, "w", 100) == 0).all()


def test_the_city_goes_with_the_pointer(opened):
    page = opened(CityMap(np.zeros((64, 64)), 4.0))
    strolled(page)
    page.mouse.move(200, 100)
    page.mouse.down()
    page.mouse.move(240, 120)
    page.mouse.up()
    # drawn to the right and down: one looks further to the left and up
    assert page.evaluate("[stroll.camera.azimuth, stroll.camera.tilt]") == [80, -5]
    page.mouse.wheel(0, -200)
    end = time.monotonic() + 120
    while page.evaluate("stroll.camera.position[0]") <= 1:
        assert time.monotonic() < end


def test_a_wall_is_walked_along(opened):
    heights = np.zeros((20, 20))
    heights[:8] = 9  # a wall to the north, at 4 m
    page = opened(CityMap(heights, 2.0))
    east, north, _ = page.evaluate(
        """() => {
          const stroll = new camera.Stroll(city, () => {}, { position: [0, 0, 1.7], azimuth: 45 });
          stroll.go(12, 0, 0);
          return stroll.camera.position;
        }"""
    )
    assert east == pytest.approx(12 / np.sqrt(2))
    assert 3 < north < 4
    east, north, up = page.evaluate(
        """() => {
          const stroll = new camera.Stroll(city, () => {}, { position: [0, 0, 1.7], azimuth: 0 });
          stroll.go(0, 0, 30);
          stroll.go(12, 0, 0);
          stroll.go(0, 0, -100);
          return stroll.camera.position;
        }"""
    )
    assert (north, up) == (pytest.approx(12), pytest.approx(9 + 1.7))  # it stands on the roof


def test_two_fingers_zoom_and_move_what_is_between_them(opened):
    page = opened(CityMap(np.zeros((64, 64)), 4.0), has_touch=True)
    page.evaluate(
        """() => {
          const canvas = document.createElement("canvas");
          document.body.append(canvas);
          window.orbit = new camera.Orbit(city, () => {}, { azimuth: 0, tilt: 90, centre: [0, 0] });
          orbit.attach(canvas);
        }"""
    )
    scale = page.evaluate("axonometry.placement(city, orbit.camera, 480, 360).scale")
    talk = page.context.new_cdp_session(page)

    def touched(kind: str, *points: tuple[int, int]) -> None:
        points = [{"x": x, "y": y, "id": k} for k, (x, y) in enumerate(points)]
        talk.send("Input.dispatchTouchEvent", {"type": f"touch{kind}", "touchPoints": points})

    touched("Start", (220, 180))
    touched("Start", (220, 180), (260, 180))
    touched("Move", (200, 180), (280, 180))
    assert page.evaluate("orbit.camera.zoom") == pytest.approx(2)
    assert page.evaluate("orbit.camera.centre") == pytest.approx([0, 0], abs=1)
    touched("Move", (210, 204), (290, 204))
    touched("End")
    assert page.evaluate("orbit.camera.zoom") == pytest.approx(2, rel=0.05)
    assert page.evaluate("orbit.camera.centre") == pytest.approx(
        [-10 / (2 * scale), 24 / (2 * scale)], abs=1.5
    )
    touched("Start", (100, 100))
    touched("Move", (120, 100))
    touched("End")
    assert page.evaluate("orbit.camera.azimuth") == 10


def test_a_walk_begins_on_open_ground_with_a_view(opened):
    heights = np.full((60, 60), 12.0)
    heights[:, 33:35] = 0  # a street from north to south
    page = opened(CityMap(heights, 3.0))
    found = page.evaluate("camera.start(city)")
    assert 9 < found["position"][0] < 15
    assert found["azimuth"] in (0, 180)
    page.evaluate("city.heights.fill(12)")
    assert page.evaluate("camera.start(city)") == {"position": [0, 0, 1.7], "azimuth": 0, "tilt": 0}
