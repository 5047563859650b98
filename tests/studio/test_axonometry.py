"""A city as columns along parallel lines: its page's own picture against lines cast one by one."""

import base64
import itertools
import time

import naive
import numpy as np
import pytest
from towns import draw_town

import evocity
from evocity import CityMap
from evocity.pictures.colours import PAPER, ramp, scale_end
from evocity.scene.picture import _WALLS, _brightness, _directions, _View

pytest.importorskip("playwright.sync_api")

from served_scene import BASE64, BROWSER, frames, picture_of

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

SIDE, WIDE, TALL = 3.0, 60, 47
SUN = (250.0, 40.0)


def town() -> CityMap:
    """Higher than wide and alike in no direction; roofs of one height touch; a part is missing."""
    rng = np.random.default_rng(3)
    heights = rng.choice([0, 0, 0, 3, 6, 6, 9, 14.5], (19, 14))
    heights[2:6, 9:12] = 31
    heights[11:13] = 0
    site = np.ones(heights.shape, bool)
    site[14:, 10:] = site[8, 3] = False
    return CityMap(np.where(site, heights, 0), SIDE, site=site)


def cameras() -> list[dict]:
    """Twenty, the four cardinal ones among them, and some from straight above."""
    rng = np.random.default_rng(4)
    found = [
        {"azimuth": azimuth, "tilt": tilt}
        for azimuth, tilt in zip((0, 90, 180, 270), (35, 20, 60, 45), strict=True)
    ]
    found += [{"azimuth": azimuth, "tilt": 90} for azimuth in (0, 270, 33)]
    found += [{"azimuth": 45, "tilt": 30}, {"azimuth": 90, "tilt": 1}]
    found += [{"azimuth": a, "tilt": t} for a, t in rng.uniform((0, 5), (360, 85), (11, 2))]
    for k, camera in enumerate(found):
        camera |= {"zoom": (1, 2.3, 6)[k % 3], "centre": [(0, 0), (5, -8.25)][k % 2]}
    return found


def seen(page, camera: dict, wide: int = WIDE, tall: int = TALL) -> tuple:
    """How a camera lays the city, what is seen of it, int (H, W), and the picture (H, W, 4)."""
    place, codes, picture = page.evaluate(
        f"""([camera, wide, tall]) => {{
          const text = {BASE64}, {{ placement, raster, surfaces }} = axonometry;
          const how = [city, camera, wide, tall], codes = surfaces(...how);
          return [placement(...how), text(new Uint8Array(codes.buffer)), text(raster(...how))];
        }}""",
        [camera, wide, tall],
    )
    codes = np.frombuffer(base64.b64decode(codes), "<i4").reshape(tall, wide)
    return place, codes, picture_of(picture, tall, wide)


def cast(city: CityMap, camera: dict, place: dict, down, across) -> np.ndarray:
    """What lines through points of the picture, px, meet first."""
    right, up, towards = _directions(camera["azimuth"], camera["tilt"])
    aside = (np.ravel(across) - place["left"]) / place["scale"]
    above = (place["low"] - np.ravel(down)) / place["scale"]
    origins = np.array([*camera["centre"], 0]) + 1e4 * towards
    origins = origins + aside[:, None] * right + above[:, None] * up
    heights = np.where(city.site, city.heights, np.nan) if city.site is not None else city.heights
    return naive.first_cells(
        heights, city.metres_per_pixel, origins, np.tile(-towards, (len(aside), 1))
    )


@pytest.mark.slow
def test_the_picture_is_that_of_lines_cast_one_by_one(opened):
    """Where they differ, a line meets an edge: one a millionth of a pixel beside it meets something
    else, and one of those is what the picture has."""
    city = town()
    page = opened(city)
    down, across = np.indices((TALL, WIDE)) + 0.5
    differing = 0
    for camera in cameras():
        place, codes, _ = seen(page, camera)
        codes = codes.ravel()
        wanted = cast(city, camera, place, down, across)
        assert len(np.unique(wanted)) > 8, camera
        off = np.flatnonzero(codes != wanted)
        beside = np.array(
            [
                cast(city, camera, place, down.ravel()[off] + a, across.ravel()[off] + b)
                for a, b in itertools.product((-1e-6, 1e-6), repeat=2)
            ]
        ).reshape(4, len(off))
        assert (beside == codes[off]).any(axis=0).all(), camera
        differing += len(off)
    assert differing < 0.01 * 20 * TALL * WIDE


@pytest.mark.parametrize("azimuth", [0, 90, 180, 270])
def test_lines_along_the_borders_of_cells_see_one_of_both(opened, azimuth):
    city = town()
    page = opened(city)
    at = {"azimuth": azimuth, "tilt": 50, "zoom": 1, "centre": [0, 0]}
    place, *_ = seen(page, at)
    at |= {"zoom": 4 / SIDE / place["scale"], "centre": [SIDE / 8, SIDE / 8]}  # 4 px a cell
    place, codes, _ = seen(page, at)
    assert place["scale"] * SIDE == pytest.approx(4)
    down, across = np.indices((TALL, WIDE)) + 0.5
    aside = (across[0] - place["left"]) / place["scale"] + [1, -1][azimuth in (90, 180)] * SIDE / 8
    offset = (city.shape[0 if azimuth in (90, 270) else 1] / 2) % 1
    whole = np.abs((aside / SIDE + offset + 0.5) % 1 - 0.5) < 1e-9
    assert whole.sum() >= WIDE // 5  # so many columns of the picture lie in a border
    near = [
        cast(city, at, place, down + a, across + b).reshape(TALL, WIDE)
        for a in (-1e-6, 1e-6)
        for b in (-1e-6, 1e-6)
    ]
    assert np.any([codes == one for one in near], axis=0).all()


@pytest.mark.parametrize("tinted", [False, True])
def test_colours_are_those_of_maps_and_walls_those_of_scenes(opened, tinted):
    city = town()
    colours = ramp(city.heights, scale_end(city))
    if tinted:
        colours = np.random.default_rng(1).integers(0, 256, (*city.shape, 3))
    page = opened(city, colours if tinted else None)
    roofs = colours.reshape(-1, 3).astype(float)
    sunwards = _directions(SUN[0] + 180, SUN[1])
    for camera in cameras()[:9]:
        _, codes, picture = seen(page, camera)
        towards = _directions(camera["azimuth"], camera["tilt"])
        ahead = -towards[2]
        normals = np.array([[0, 0, 1], [-np.sign(ahead[0]), 0, 0], [0, -np.sign(ahead[1]), 0]])
        steep = np.clip(normals @ sunwards[2], 0, 1)
        view = _View(towards, 1.0, (1, 1), np.eye(3), np.zeros(3))
        _, light = _brightness(normals @ towards[2], steep, view, sunwards)
        cell, part = codes // 3, codes % 3
        base = roofs[cell] if tinted else np.where(part[..., None] == 0, roofs[cell], _WALLS)
        wanted = np.minimum(base * light[part][..., None], 255)
        wanted[codes < 0] = PAPER
        assert np.abs(picture[..., :3] - wanted).max() <= 0.5 + 1e-6, camera
        assert (picture[..., 3] == 255).all()


@pytest.mark.long
def test_the_scale_of_heights_is_that_of_maps(opened):
    heights = np.round(np.linspace(0, 70, 64 * 64), 2).astype(np.float32)
    page = opened(town())
    for end in (10, 35, 50.5):
        found = page.evaluate(
            "([heights, end]) => [...ramp.ramp(Float32Array.from(heights), end)]",
            [heights.tolist(), end],
        )
        wanted = ramp(heights.reshape(64, 64), end).reshape(-1)
        differ = np.abs(np.array(found) - wanted)
        assert differ.max() <= 1
        assert (differ > 0).mean() < 1e-3
    maps = [evocity.read_map("lyon-1er"), draw_town(1, side=64), CityMap(np.zeros((8, 8)), 1.0)]
    tower = np.zeros((40, 40))
    tower[::2] = 7.5
    tower[3, 3] = 211
    for city in [*maps, CityMap(tower, 1.0), CityMap(tower + 30, 1.0)]:
        end = page.evaluate(
            "(all) => ramp.scaleEnd(Float32Array.from(all))", city.heights.ravel().tolist()
        )
        assert end == scale_end(city)


def test_from_above_it_is_the_map_with_north_where_one_looks_to(opened):
    city = town()
    page = opened(city)
    for quarter in range(4):
        camera = {"azimuth": 90 * quarter, "tilt": 90, "zoom": 1, "centre": [0, 0]}
        place, codes, _ = seen(page, camera)
        cells = np.where(codes < 0, -1, codes // 3)
        # what lies to the right of who looks to the east lies in the south
        wanted = np.where(city.site, np.arange(city.heights.size).reshape(city.shape), -1)
        wanted = np.rot90(wanted, quarter)
        down, across = np.indices(wanted.shape)
        pixel = city.metres_per_pixel * place["scale"]
        x = place["left"] + (across + 0.5 - wanted.shape[1] / 2) * pixel
        y = place["low"] + (down + 0.5 - wanted.shape[0] / 2) * pixel
        assert (cells[y.astype(int), x.astype(int)] == wanted).all()


def test_the_whole_city_is_seen_at_any_azimuth_and_in_any_shape_of_picture(opened):
    heights = np.zeros((24, 40))
    heights[[0, 0, -1, -1], [0, -1, 0, -1]] = 9
    page = opened(CityMap(heights, 5.0))
    for azimuth, tilt, (wide, tall) in itertools.product(
        (0, 31, 90, 122, 301), (8, 40, 90), ((60, 47), (160, 50), (40, 120))
    ):
        camera = {"azimuth": azimuth, "tilt": tilt, "zoom": 1, "centre": [0, 0]}
        _, codes, _ = seen(page, camera, wide, tall)
        edge = np.concatenate([codes[0], codes[-1], codes[:, 0], codes[:, -1]])
        assert (edge == -1).all(), camera
        assert (codes >= 0).any()


def canvases(page, count: int = 1, camera: str = "{}") -> None:
    page.evaluate(
        f"""(count) => {{
          window.drawn = [];
          window.views = Array.from({{ length: count }}, () => {{
            const canvas = document.createElement("canvas");
            canvas.style.cssText = "float: left";
            document.body.append(canvas);
            return new axonometry.Axonometry(canvas, city);
          }});
          window.orbit = new camera.Orbit(city, (one) => {{
            drawn.push(structuredClone(one));
            for (const view of views) view.draw(one);
          }}, {camera});
          window.ends = views.map((view) => orbit.attach(view.canvas));
          orbit.set({{}});
        }}""",
        count,
    )
    frames(page)


PIXELS = f"""(k) => {{
  const text = {BASE64}, {{ canvas, context }} = views[k];
  return text(context.getImageData(0, 0, canvas.width, canvas.height).data);
}}"""


def shown(page, which: int = 0) -> np.ndarray:
    tall, wide = page.evaluate("(k) => [views[k].canvas.height, views[k].canvas.width]", which)
    return picture_of(page.evaluate(PIXELS, which), tall, wide)[..., :3]


def test_a_canvas_shows_the_city_with_north_and_scale(opened):
    city = draw_town(3, side=48)
    page = opened(city)
    canvases(page)
    camera = page.evaluate("orbit.camera")
    place, codes, picture = seen(page, camera, 480, 360)
    found = shown(page)
    differ = (found != picture[..., :3]).any(axis=2)
    rows, columns = np.nonzero(differ)
    arrow = (columns < 70) & (rows < 80)
    scale = (columns < 200) & (rows > 330)
    assert (arrow | scale).all()
    assert arrow.any()
    # the bar is as long as it says: its upper edge is one dark line
    bar = (found[344] < 120).all(axis=1)
    assert not bar[:12].any()
    metres = page.evaluate("([scale]) => axonometry.roundLength(120 / scale)", [place["scale"]])
    assert bar[12:].argmin() == pytest.approx(metres * place["scale"], abs=1)
    # the arrow's tip lies north of its foot: by the letter, left of it where one looks north-east
    assert camera["azimuth"] == 25
    assert columns[arrow].min() < 32 - 12
    # what is under the pointer
    for y, x in [(100, 240), (200, 200), (5, 5), (240, 300)]:
        told_cell = page.evaluate("([x, y]) => views[0].pick(x, y)", [x + 0.5, y + 0.5])
        code = int(codes[y, x])
        if code < 0:
            assert told_cell is None
        else:
            row, column = divmod(code // 3, 48)
            assert told_cell == {
                "row": row,
                "column": column,
                "height": pytest.approx(float(city.heights[row, column])),
                "part": "wall" if code % 3 else "roof",
            }
    assert page.evaluate("views[0].pick(-1, 5)") is None
    page.evaluate("views[0].canvas.hidden = true; views[0].canvas.style.display = 'none'")
    page.evaluate("views[0].draw(orbit.camera)")
    assert (shown(page) == found).all()  # what is hidden stays as it was


@pytest.mark.long
def test_a_screen_of_finer_pixels_is_drawn_finer(opened):
    page = opened(draw_town(3, side=48), device_scale_factor=2)
    canvases(page)
    assert shown(page).shape == (720, 960, 3)
    camera = page.evaluate("orbit.camera")
    _, codes, _ = seen(page, camera, 960, 720)
    assert page.evaluate("views[0].pick(240.2, 200.2).row") == codes[400, 480] // 3 // 48


def test_canvases_that_share_a_camera_are_turned_together(opened):
    page = opened(draw_town(3, side=48))
    canvases(page, 2)
    before = page.evaluate("orbit.camera")
    page.mouse.move(700, 200)
    page.mouse.down()
    page.mouse.move(720, 200)
    page.mouse.move(740, 230)
    page.mouse.up()
    frames(page)
    after = page.evaluate("orbit.camera")
    assert after["azimuth"] == before["azimuth"] + 20
    assert after["tilt"] == pytest.approx(before["tilt"] + 10)
    assert (shown(page, 0) == shown(page, 1)).all()
    # what is near goes with the pointer: it was dragged to the right
    page.evaluate("orbit.set({ azimuth: 0, tilt: 60 })")
    frames(page)
    near = page.evaluate("views[0].pick(240, 290)")
    page.evaluate("orbit.set({ azimuth: 10 })")
    frames(page)
    assert page.evaluate("views[0].pick(240, 290).column") < near["column"]
    # taken back, it hears nothing more
    page.evaluate("ends[1]()")
    was = page.evaluate("orbit.camera")
    page.mouse.move(700, 200)
    page.mouse.down()
    page.mouse.move(760, 260)
    page.mouse.up()
    assert page.evaluate("orbit.camera") == was


def test_wheel_and_moving_keep_the_ground_under_the_pointer(opened):
    page = opened(CityMap(np.arange(900.0).reshape(30, 30) % 7 * 0.01, 4.0))
    canvases(page)
    x, y = 330, 240
    under = page.evaluate("([x, y]) => views[0].pick(x, y)", [x, y])
    page.mouse.move(x, y)
    for _ in range(4):
        page.mouse.wheel(0, -300)
    end = time.monotonic() + 120
    while page.evaluate("orbit.camera.zoom") <= 2:
        assert time.monotonic() < end
    frames(page)
    assert page.evaluate("([x, y]) => views[0].pick(x, y)", [x, y]) == under
    page.keyboard.down("Shift")
    page.mouse.down()
    page.mouse.move(x - 40, y - 33)
    page.mouse.up()
    page.keyboard.up("Shift")
    frames(page)
    assert page.evaluate("([x, y]) => views[0].pick(x, y)", [x - 40, y - 33]) == under


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_keys_turn_tilt_zoom_and_move(opened, motion):
    page = opened(draw_town(3, side=48), reduced_motion=motion)
    canvases(page)
    page.clock.install(time=0)
    page.clock.pause_at(3_600_000)
    page.locator("canvas").focus()
    start = page.evaluate("orbit.camera")

    def pressed(key: str) -> dict:
        page.evaluate("drawn.length = 0")
        page.keyboard.press(key)
        page.clock.run_for(50 if motion == "reduce" else 400)
        return page.evaluate("drawn.at(-1)")

    turned = pressed("ArrowRight")
    assert turned == start | {"azimuth": 40}
    assert (page.evaluate("drawn.length") == 1) == (motion == "reduce")
    assert pressed("ArrowUp")["tilt"] == 48
    assert pressed("+")["zoom"] == pytest.approx(1.3)
    east, north = pressed("Shift+ArrowUp")["centre"]
    assert east / north == pytest.approx(np.tan(np.radians(40)))
    assert north > 0
    assert pressed("Home") == start
    for _ in range(3):
        last = pressed("ArrowLeft")
    assert last["azimuth"] == pytest.approx(340)  # through north, the shorter way
    for one in page.evaluate("drawn"):
        assert one["azimuth"] >= 340 or one["azimuth"] < 0.01 or one["azimuth"] > 339
