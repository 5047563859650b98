"""A city in perspective, in WebGL2 without a graphics card, against lines cast one by one."""

import base64

import naive
import numpy as np
import pytest
from test_axonometry import town
from towns import draw_town

import evocity
from evocity import CityMap
from evocity.scene.picture import _directions

pytest.importorskip("playwright.sync_api")

from served_scene import BASE64, BROWSER, frames, picture_of

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

#: Told apart in any light.
HUES = np.array([(c >> 2 & 1, c >> 1 & 1, c & 1) for c in range(1, 7)]) * 150 + 50
WIDE, TALL = 480, 360


def walked(page, solids: str = "null") -> None:
    page.evaluate(
        f"""() => {{
          const canvas = document.createElement("canvas");
          document.body.append(canvas);
          window.view = new walk.Walk(canvas, city, {solids});
        }}"""
    )


DRAWN = f"""([camera, sun]) => {{
  const {{ gl, canvas }} = view;
  view.draw(camera, sun ?? undefined);
  const bytes = new Uint8Array(4 * canvas.width * canvas.height);
  gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
  if (gl.getError()) throw new Error("WebGL was told what it does not know");
  return ({BASE64})(bytes);
}}"""


def drawn(page, camera: dict, sun: dict | None = None) -> np.ndarray:
    text = page.evaluate(DRAWN, [camera, sun])
    return picture_of(text, TALL, WIDE)[::-1, :, :3].astype(int)


def lines(page, camera: dict, down, across) -> tuple[np.ndarray, np.ndarray]:
    """From where, and which way, one sees the points of the picture, px."""
    ways = _directions(camera["azimuth"], camera["tilt"])
    if "position" in camera:
        eye, half, shift = np.array(camera["position"], float), np.tan(np.radians(31)), 0.0
    else:
        place = page.evaluate("(one) => axonometry.placement(city, one, 480, 360)", camera)
        half = np.tan(np.radians(14))
        far = TALL / (2 * place["scale"] * 0.85 * half)
        eye, shift = np.array([*camera["centre"], 0.0]) + far * ways[2], 1 - 2 * place["low"] / TALL
    right = (2 * np.ravel(across) / WIDE - 1) * half * WIDE / TALL
    up = (1 - 2 * np.ravel(down) / TALL - shift) * half
    towards = right[:, None] * ways[0] + up[:, None] * ways[1] - ways[2]
    return np.tile(eye, (len(towards), 1)), towards


ABOUT = [
    {"azimuth": 20, "tilt": 40, "zoom": 1, "centre": [0, 0]},
    {"azimuth": 90, "tilt": 25, "zoom": 2, "centre": [4, -7]},
    {"azimuth": 231, "tilt": 12, "zoom": 1.4, "centre": [0, 0]},
    {"azimuth": 180, "tilt": 90, "zoom": 1, "centre": [0, 0]},
]
WITHIN = [
    {"position": [-7.5, -7.5, 1.7], "azimuth": 40, "tilt": 0},
    {"position": [-7.5, -7.5, 1.7], "azimuth": 270, "tilt": -15},
    {"position": [3, -24, 20], "azimuth": 350, "tilt": 25},
]


@pytest.mark.parametrize(
    "camera",
    [
        ABOUT[0],
        *(pytest.param(one, marks=pytest.mark.long) for one in ABOUT[1:-1]),
        ABOUT[-1],
        *WITHIN,
    ],
)
def test_what_is_seen_is_what_lines_meet(opened, camera):
    """But within half a pixel of an edge."""
    city = town()
    heights = np.where(city.site, city.heights, np.nan)
    hues = np.random.default_rng(7).integers(0, len(HUES), city.shape)
    page = opened(city, HUES[hues])
    walked(page)
    found = drawn(page, camera)
    down, across = (one.ravel() for one in np.mgrid[3:TALL:9, 3:WIDE:9])
    wanted = []
    for a, b in ((0.5, 0.5), (-0.3, -0.3), (-0.3, 1.3), (1.3, -0.3), (1.3, 1.3)):
        from_where, ways = lines(page, camera, down + a, across + b)
        codes = naive.first_cells(heights, city.metres_per_pixel, from_where, ways)
        wanted.append(np.where(codes < 0, -1, hues.ravel()[codes // 3]))
    clear = (np.array(wanted) == wanted[0]).all(axis=0)
    assert clear.mean() > 0.4
    assert len(np.unique(wanted[0][clear])) > 4
    seen = found[down, across]
    shares = seen / np.linalg.norm(seen, axis=1, keepdims=True)
    own = HUES / np.linalg.norm(HUES, axis=1, keepdims=True)
    nearest = (shares @ own.T).argmax(axis=1)
    nearest[seen.min(axis=1) > 0.8 * seen.max(axis=1)] = -1  # the sky, and what lies around
    assert (nearest == wanted[0])[clear].mean() > 0.998


SUNS = [(178, 60), (330, 15)]


@pytest.mark.parametrize(
    "sun", [(250, 40), (90, 25), *(pytest.param(one, marks=pytest.mark.long) for one in SUNS)]
)
def test_shadows_lie_where_lines_to_the_sun_are_barred(opened, sun):
    city = town()
    heights = np.where(city.site, city.heights, np.nan)
    page = opened(city, np.full((*city.shape, 3), 200))
    walked(page)
    camera = {"azimuth": 0, "tilt": 90, "zoom": 1, "centre": [0, 0]}
    found = drawn(page, camera, {"azimuth": sun[0], "height": sun[1]})
    down, across = (one.ravel() for one in np.mgrid[50:300:7, 2:WIDE:6])
    corners = ((0.5, 0.5), (-0.2, -0.2), (-0.2, 1.2), (1.2, -0.2), (1.2, 1.2))
    seen = [lines(page, camera, down + a, across + b) for a, b in corners]
    around = [naive.first_cells(heights, city.metres_per_pixel, *one) for one in seen]
    (from_where, ways), codes = seen[0], around[0]
    whole = (np.array(around) == codes).all(axis=0)  # pixels of one surface
    roofs = np.flatnonzero(whole & (codes >= 0) & (codes % 3 == 0))
    top = heights.ravel()[codes[roofs] // 3]
    share = (top - from_where[roofs, 2]) / ways[roofs, 2]
    points = from_where[roofs] + share[:, None] * ways[roofs]
    sunwards = -_directions(sun[0], -sun[1])[2]
    beside = [np.array([a, b, 0.02]) for a in (-0.3, 0.3) for b in (-0.3, 0.3)]
    towards = np.tile(sunwards, (len(points), 1))
    barred = np.array(
        [
            naive.first_cells(heights, city.metres_per_pixel, points + one, towards) >= 0
            for one in beside
        ]
    )
    clear = (barred == barred[0]).all(axis=0)
    shaded, light = barred[0][clear], found[down, across][roofs][clear].mean(axis=1)
    assert 0.05 < shaded.mean() < 0.9
    assert (light[shaded] < 160).mean() > 0.998
    assert (light[~shaded] > 190).mean() > 0.998  # and nothing shades itself


@pytest.mark.slow
def test_walls_towards_the_sun_are_the_lighter_ones(opened):
    heights = np.zeros((12, 12))
    heights[4:8, 4:8] = 20
    page = opened(CityMap(heights, 4.0), np.full((12, 12, 3), 180))
    walked(page)
    for azimuth, side in ((270, "west"), (90, "east"), (180, "south"), (0, "north")):
        sun = {"azimuth": azimuth, "height": 35}
        at = {
            "position": [
                *{"west": [-20, 0], "east": [20, 0], "south": [0, -20], "north": [0, 20]}[side],
                4,
            ]
        }
        facing = drawn(page, at | {"azimuth": azimuth - 180, "tilt": 0}, sun)[150, 240]
        away = [-one for one in at["position"][:2]] + [4]
        behind = drawn(page, {"position": away, "azimuth": azimuth, "tilt": 0}, sun)[150, 240]
        assert facing.mean() > 1.4 * behind.mean()


def test_night_is_dark_and_casts_no_shadow(opened):
    page = opened(town(), np.full((*town().shape, 3), 200))
    walked(page)
    camera = ABOUT[0] | {"tilt": 90}
    noon, dusk, night = (
        drawn(page, camera, {"azimuth": 250, "height": height}) for height in (50, -2, -30)
    )
    roof = (noon < 250).all(axis=2)
    assert noon[roof].mean() > dusk[roof].mean() > night[roof].mean() > 20
    assert np.ptp(np.percentile(night[roof], (5, 90))) < 12


def test_surfaces_are_few_and_cover_all(opened):
    """Areas of what faces each way, by the heights themselves."""
    city = draw_town(5, side=64)
    page = opened(city)
    told = page.evaluate(
        """async () => {
          const { prismsOf, STRIDE } = await import("/prisms.js");
          const { surfaces, indices } = prismsOf(city), areas = {};
          const vector = (k) => [0, 1, 2].map((c) => surfaces.places[k * STRIDE / 4 + c]);
          const to = (a, b) => b.map((one, i) => one - a[i]);
          let turnedWrong = 0;
          for (let k = 0; k < surfaces.count; k += 4) {
            const normal = [0, 1, 2].map((c) => surfaces.signed[k * STRIDE + 12 + c] / 127);
            const [a, b, c, d] = [0, 1, 2, 3].map((one) => vector(k + one));
            for (const [p, q] of [[to(a, b), to(a, c)], [to(a, c), to(a, d)]]) {
              const cross = [1, 2, 0].map((i, at) => p[i] * q[3 - i - at] - p[3 - i - at] * q[i]);
              if (!(cross.reduce((sum, one, i) => sum + one * normal[i], 0) > 0)) turnedWrong++;
            }
            const [wide, deep] = [0, 1].map((i) => Math.abs(c[i] - a[i]));
            areas[normal] = (areas[normal] || 0)
              + (normal[2] ? wide * deep : Math.max(wide, deep) * (c[2] - a[2]));
          }
          return { areas, turnedWrong, count: indices.length / 6 };
        }"""
    )
    assert told["turnedWrong"] == 0
    side, padded = city.metres_per_pixel, np.pad(city.heights, 1)
    across, along = np.diff(padded, axis=1), np.diff(padded, axis=0)
    wanted = {
        "0,0,1": city.heights.size * side**2,
        "-1,0,0": across.clip(0).sum() * side,  # it rises to the east: seen from the west
        "1,0,0": (-across).clip(0).sum() * side,
        "0,1,0": along.clip(0).sum() * side,
        "0,-1,0": (-along).clip(0).sum() * side,
    }
    assert told["areas"] == pytest.approx(wanted, rel=1e-4)
    assert told["count"] < city.heights.size / 2


@pytest.mark.slow
def test_no_light_shines_through_where_surfaces_meet(opened):
    """From above, within the city, nothing of the paper behind is seen."""
    heights = np.random.default_rng(2).choice([3.0, 6, 9], (60, 60))
    page = opened(CityMap(heights, 2.0), np.tile([200, 30, 30], (60, 60, 1)))
    walked(page)
    for azimuth, tilt, zoom in ((0, 90, 3), (33, 76, 4), (300, 80, 4), (90, 82, 9)):
        camera = {"azimuth": azimuth, "tilt": tilt, "zoom": zoom, "centre": [0, 0]}
        found = drawn(page, camera)
        assert (found[..., 1] < 0.3 * found[..., 0]).all(), camera


def test_triangles_of_a_scene_stand_in_place_of_the_map(opened):
    """From above both are the same city, but for straight walls."""
    city = draw_town(6, side=48)
    page = opened(city)
    walked(page)
    camera = {"azimuth": 0, "tilt": 90, "zoom": 1.4, "centre": [10, -15]}
    own = drawn(page, camera)
    corners, colours = evocity.scene(city).triangles()
    bytes_ = base64.b64encode(corners.astype("<f4").tobytes() + colours.tobytes()).decode()
    page.evaluate(
        "(text) => view.show(city, Uint8Array.from(atob(text), (one) => one.charCodeAt(0)).buffer)",
        bytes_,
    )
    found = drawn(page, camera)
    assert page.evaluate("view.triangles") == len(corners)
    assert own.std() > 20
    assert (np.abs(found - own).max(axis=2) < 40).mean() > 0.9
    for turned in (found[::-1], found[:, ::-1], found[::-1, ::-1]):
        assert (np.abs(turned - own).max(axis=2) < 40).mean() < 0.8


def test_without_webgl2_it_says_so(opened):
    script = """const own = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (name, ...more) {
      return name === "webgl2" ? null : own.call(this, name, ...more);
    };"""
    page = opened(town(), script=script)
    assert page.evaluate("walk.supported()") is False
    said = page.evaluate(
        """() => {
          try { new walk.Walk(document.createElement("canvas"), city); }
          catch (error) { return error.message; }
        }"""
    )
    assert "no WebGL2" in said
    page = opened(town())
    assert page.evaluate("walk.supported()") is True
    walked(page)
    assert page.evaluate("view.gl.getContextAttributes().antialias") is False  # no card here


@pytest.mark.slow
def test_a_lost_context_comes_back_and_a_city_gives_way_to_another(opened):
    page = opened(town())
    walked(page)
    before = drawn(page, ABOUT[0])
    page.evaluate("window.loss = view.gl.getExtension('WEBGL_lose_context'); loss.loseContext()")
    page.evaluate("view.draw(view.last[0])")  # nothing happens
    page.wait_for_timeout(50)
    page.evaluate("loss.restoreContext()")
    while page.evaluate("view.gl.isContextLost()"):
        page.wait_for_timeout(20)
    frames(page)
    assert (drawn(page, ABOUT[0]) == before).all()
    page.evaluate("view.show({ ...city, heights: city.heights.map((one) => one / 3) })")
    assert (drawn(page, ABOUT[0]) != before).any()
    page.evaluate("view.show(city)")
    assert (drawn(page, ABOUT[0]) == before).all()
    page.evaluate("view.dispose()")
    assert page.evaluate("view.gl.isContextLost()")


@pytest.mark.long
def test_many_walks_one_after_another_leave_nothing(opened):
    page = opened(town())
    for _ in range(17):  # browsers hold sixteen
        walked(page)
        page.evaluate(f"view.draw({ABOUT[0]}); view.dispose(); view.canvas.remove()")
    walked(page)
    assert (drawn(page, ABOUT[0]) < 240).any()
