"""The filter desk, µ, growth and the switches of the 3D view in chromium, by pointer."""

import shutil
import time

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api")

from asking import OLD
from chromium import BROWSER
from test_studio_in_a_browser import AXE, PICTURES, opened, until  # noqa: F401

import evocity
from evocity.coding import high_pass, low_pass, usage
from evocity.growth import grow
from evocity.operators import Interpolation
from evocity.pictures.colours import ramp
from evocity.scene import Library
from evocity.studio.filters import SEED
from evocity.studio.run_watcher import RunWatcher
from evocity.studio.server import running_server

pytestmark = [pytest.mark.skipif(BROWSER is None, reason="chromium is not there"), pytest.mark.slow]

FILTER, GROWTH = "studio.run.birth.filter", "studio.run.birth.growth"
#: The pixels of a map's canvas.
PIXELS = """() => {{
  const {{ canvas }} = {map}, {{ width, height }} = canvas;
  return [height, width, [...canvas.getContext("2d").getImageData(0, 0, width, height).data]];
}}"""


def pixels_of(page, of: str) -> np.ndarray:
    height, width, data = page.evaluate(PIXELS.format(map=of))
    return np.array(data, np.uint8).reshape(height, width, 4)[..., :3]


@pytest.fixture
def night(tmp_path):
    return shutil.copytree(OLD / "run-6", tmp_path / "runs" / "night")


@pytest.fixture
def scale(night):
    return RunWatcher(night).moment.thumbnails.highest


def drag(page, name: str, to: float) -> None:
    """Drag the thumb of a slider to a share of its length, in ten steps."""
    slider = page.get_by_role("slider", name=name)
    slider.scroll_into_view_if_needed()
    box = slider.bounding_box()
    low, high, value = (
        float(slider.evaluate(f"one => one.{key}")) for key in ("min", "max", "value")
    )
    y, inner = box["y"] + box["height"] / 2, box["width"] - 16  # the thumb is 16 px wide
    at = box["x"] + 8 + inner * (value - low) / (high - low)
    page.mouse.move(at, y)
    page.mouse.down()
    page.mouse.move(box["x"] + 8 + inner * to, y, steps=10)
    page.mouse.up()


def choose(page, identifier: int) -> None:
    page.evaluate(f"() => studio.run.showBirth({identifier})")
    until(page, f"studio.run.birth.id === {identifier} && {PICTURES}.id === {identifier}")
    until(page, f"{PICTURES}.figures[0].image.naturalWidth > 0")


def axe(page) -> None:
    if AXE.is_file():
        page.evaluate(AXE.read_text(encoding="utf-8"))
        assert (
            page.evaluate("async () => (await axe.run()).violations.map((one) => [one.id,"
                          " one.nodes.map((node) => node.html)])")
            == []
        )  # fmt: skip


def test_sliders_draw_the_map_that_python_computes(opened, night, scale):  # noqa: F811
    run = evocity.open_run(night)
    opened.lost += ("Canvas2D: Multiple readback",)  # this test reads pixels
    settled = f"{FILTER}.map.city && !{FILTER}.isLoading"
    with running_server(night) as server:
        page = opened(server, 1400, 900)
        choose(page, 3)
        page.get_by_text("filter, zoom and interpolation").click()
        until(page, settled)
        seen = pixels_of(page, f"{FILTER}.map")
        assert np.array_equal(seen, ramp(run[3].city.heights, scale))
        drag(page, "low-pass f_c", 0.3)
        until(page, f"{settled} && {FILTER}.shown.low !== null")
        sent = page.evaluate(f"() => {FILTER}.shown")
        most = int(usage(run[3].genome).pixels.max())
        assert 0 < sent["low"] < most
        filtered = evocity.decode(low_pass(run[3].genome, sent["low"])).city
        now = pixels_of(page, f"{FILTER}.map")
        assert np.array_equal(now, ramp(filtered.heights, scale))
        assert not np.array_equal(now, seen)
        assert f"= {sent['low']} calls" in page.locator(".evocity-slider").first.inner_text()
        page.get_by_role("button", name="pin this birth").click()
        choose(page, 20)
        until(page, f"{FILTER}.beside === 3 && {settled}")
        drag(page, "λ", 0.4)
        drag(page, "high-pass f_c", 0.15)
        drag(page, "zoom", 1)
        until(page, f"{settled} && {FILTER}.shown.zoom === 2 && {FILTER}.shown.high > 0")
        sent = page.evaluate(f"() => {FILTER}.shown")
        assert 0.3 < sent["share"] < 0.5
        genome = Interpolation(share=sent["share"])(
            [run[20].genome, run[3].genome], np.random.default_rng(SEED)
        )
        genome = low_pass(high_pass(genome, sent["high"]), sent["low"])
        city = evocity.decode(genome, zoom=2).city
        assert np.array_equal(pixels_of(page, f"{FILTER}.map"), ramp(city.heights, scale))
        axe(page)
        page.locator("details[open] label").get_by_text("3D").click()
        until(page, f"{FILTER}.map.view?.kind === 'columns' && {FILTER}.map.canvas.hidden")
        page.get_by_role("button", name="save the genome and a recipe").click()
        until(page, f"{FILTER}.message.textContent.includes('evocity run')")
        kept = evocity.read_genome(night.parent / "night-children" / "child-0.parquet")
        assert np.array_equal(evocity.decode(kept, zoom=2).city.heights, city.heights)
        page.get_by_role("button", name="reset").click()
        until(page, f"{settled} && {FILTER}.shown.low === null && {FILTER}.shown.zoom === 1")


def test_a_slow_answer_is_followed_by_the_newest_request(opened, night, monkeypatch):  # noqa: F811
    from evocity.studio import filters

    asked, heights = [], filters.FilterDesk.heights

    def slow(desk, request):
        asked.append(request)
        time.sleep(0.3)
        return heights(desk, request)

    monkeypatch.setattr(filters.FilterDesk, "heights", slow)
    with running_server(night) as server:
        page = opened(server)
        choose(page, 3)
        page.get_by_text("filter, zoom and interpolation").click()
        until(page, f"{FILTER}.map.city && !{FILTER}.isLoading")
        before = len(asked)
        page.evaluate(
            f"""() => {{ const {{ input }} = {FILTER}.sliders.zoom;
            for (const value of [0.25, 0.5, 0.75, 1.25, 1.5, 2]) {{
              input.value = value; input.dispatchEvent(new Event('input')); }} }}"""
        )
        until(page, f"!{FILTER}.isLoading && {FILTER}.shown.zoom === 2")
        assert [one.zoom for one in asked[before:]] == [0.25, 2]


def test_the_errors_of_autosimilarity_are_maps_with_units(opened, night):  # noqa: F811
    opened.lost += ("400 (Bad Request)",)  # a wrong side below
    with running_server(night) as server:
        page = opened(server, 1400, 900)
        choose(page, 3)
        page.get_by_role("button", name="error µ̃").click()
        until(page, f"{PICTURES}.legend.textContent.startsWith('mean error µ̃')")
        page.get_by_label("sides D of domain blocks").fill("10, 16")
        page.keyboard.press("Enter")
        until(page, f"{PICTURES}.fields.curve.querySelectorAll('tr').length === 2")
        assert "D = 10 px" in page.locator("table", has_text="D →").inner_text()
        page.get_by_role("button", name="error µ_min").click()
        until(page, f"{PICTURES}.legend.textContent.startsWith('least error')")
        page.get_by_role("button", name="best D").click()
        until(page, f"{PICTURES}.legend.textContent.includes('16 px')")
        axe(page)
        page.get_by_label("side B of range blocks").fill("99")
        page.keyboard.press("Enter")
        until(page, f"{PICTURES}.lack.textContent.includes('side B')")


def test_a_birth_grows_around_its_window(opened, night, scale):  # noqa: F811
    with running_server(night) as server:
        page = opened(server)
        choose(page, 3)
        page.get_by_text("growth around the window").click()
        page.get_by_role("button", name="grow", exact=True).click()
        until(page, f"{GROWTH}.map.city || {GROWTH}.map.lack.textContent")
        city = grow(evocity.open_run(night)[3].genome, 128, 128, np.random.default_rng(0)).city()
        seen, right = pixels_of(page, f"{GROWTH}.map"), ramp(city.heights, scale)
        far = np.ones(seen.shape[:2], bool)
        far[29:99, 29:99] = False  # the frame of the window
        assert np.array_equal(seen[far], right[far])
        assert np.array_equal(seen[35:93, 35:93], right[35:93, 35:93])
        assert not np.array_equal(seen, right)
        axe(page)
        command = page.locator(".evocity-command", has_text="evocity grow").inner_text()
        assert "--id 3" in command
        page.get_by_role("button", name="save the genome", exact=True).click()
        until(page, f"{GROWTH}.message.textContent.startsWith('Studio saved')")
        genome = evocity.read_genome(night.parent / "night-grown" / "grown-3.parquet")
        assert genome.pavement.height == 128


def test_streets_classes_and_objects_are_switched_in_3d(opened, night, tmp_path):  # noqa: F811
    run = evocity.open_run(night)
    Library.of(run[20].city, licence="CC0-1.0").write(tmp_path / "library")
    opened.lost += ("GL Driver Message",)
    space = f"{PICTURES}.spaceView"
    with running_server(night, library=tmp_path / "library") as server:
        page = opened(server, 1400, 900)
        choose(page, 3)
        page.get_by_role("button", name="3D", exact=True).click()
        until(page, f"{space}?.kind === 'columns'")
        page.get_by_label("streets", exact=True).check()
        if not page.evaluate("() => !!document.createElement('canvas').getContext('webgl2')"):
            pytest.skip("no WebGL2 in this browser")
        until(page, f"{PICTURES}.switches.key.textContent.includes('pavement')")
        assert page.evaluate(f"() => {space}.kind") == "solids"
        solids = f"{space}.views[0].drawers.walk.triangles"
        counts = [page.evaluate(f"() => {solids}")]
        assert counts[0] == len(evocity.scene(run[3].city, streets=True).triangles()[0])
        page.get_by_label("colours by class").check()
        until(page, f"{PICTURES}.switches.key.textContent.includes('building')")
        page.get_by_label("objects of the library").check()
        until(page, f"{solids} !== {counts[0]}")
        axe(page)
        page.get_by_role("button", name="walk", exact=True).click()
        until(page, f"{space}.kind === 'walk'")
