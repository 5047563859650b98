"""The report in chromium: opened from disk, filtered by hand, read without script and by axe."""

import contextlib
import time
from pathlib import Path

import pytest

pytest.importorskip("playwright.sync_api")

from chromium import BROWSER
from drawn_runs import told_run

import evocity
from evocity.report import write_report

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="chromium is not there"),
    pytest.mark.slow,
]

AXE = Path(__file__).parents[2] / ".venv" / "node" / "node_modules" / "axe-core" / "axe.min.js"
# Drag a brush up and down the first axis for a second: frames in it, and births that pass.
DRAG = """async () => {
  const canvas = document.querySelector(".evocity-lines"), box = canvas.getBoundingClientRect();
  canvas.setPointerCapture = () => {};
  const axis = box.left + document.querySelector(".evocity-head").getBoundingClientRect().width / 2;
  const at = (type, y) => canvas.dispatchEvent(new PointerEvent(type, {
    bubbles: true, clientX: axis, clientY: box.top + y, button: 0, pointerId: 1 }));
  const began = performance.now();
  let frames = 0;
  at("pointerdown", 30);
  while (performance.now() - began < 1000) {
    await new Promise(requestAnimationFrame);
    at("pointermove", 60 + 100 * Math.abs(Math.sin(frames++ / 9)));
  }
  await new Promise(requestAnimationFrame);
  return [frames, document.querySelector("output").textContent];
}"""


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    folder = told_run(
        tmp_path_factory.mktemp("report") / "run", generations=50, population=24, names="ABCD"
    )
    return write_report(folder)


@pytest.fixture
def opened(browser, report):
    """Opens the report; afterwards its console must have been silent, and nothing asked."""
    with contextlib.ExitStack() as stack:
        said, asked = [], []

        def open_page(**how):
            context = stack.enter_context(contextlib.closing(browser.new_context(**how)))
            page = context.new_page()
            page.on("console", lambda message: said.append(message.text))
            page.on("pageerror", lambda error: said.append(str(error)))
            page.on("request", lambda request: asked.append(request.url))
            page.goto(report.as_uri())
            return page

        yield open_page
    assert said == []
    assert [url for url in asked if not url.startswith(("data:", "blob:", report.as_uri()))] == []


def test_1200_births_are_filtered_in_a_page_from_disk(opened, report):
    began = time.monotonic()
    page = opened(viewport={"width": 1400, "height": 900})
    page.wait_for_selector(".evocity-option")
    assert time.monotonic() - began < 25  # half a second on an idle machine
    assert report.stat().st_size < 3_000_000
    run = evocity.open_run(report.parent)
    page.get_by_role("listbox").scroll_into_view_if_needed()
    labels = page.locator("[role=option]").first.get_attribute("aria-label")
    assert labels.startswith(f"{run.compromise().id}, compromise 1")
    page.locator(".evocity-lines").scroll_into_view_if_needed()
    frames, count = page.evaluate(DRAG)
    assert frames > 5  # 40 on an idle machine
    assert not count.startswith("1\u202f200 of")
    assert count.split(" births")[0].endswith("of 1\u202f200")
    page.mouse.up()
    page.get_by_role("tab", name="which to keep").click()
    page.wait_for_selector(".evocity-kept li")
    assert page.locator(".evocity-kept li").count() == len(run.keep())


@pytest.mark.parametrize("width", [820, 1400])
def test_without_script_the_births_to_keep_are_whole(opened, report, width):
    page = opened(viewport={"width": width, "height": 1000}, java_script_enabled=False)
    kept = evocity.open_run(report.parent).keep()
    cards = page.locator("figure.kept")
    assert cards.count() == len(kept)
    for place, one in enumerate(kept):
        text = cards.nth(place).inner_text()
        for part in (*one.reasons[:2], f"evocity decode RUN --id {one.individual.id}"):
            assert part in text
        assert cards.nth(place).locator("img").count() == 2
    for title in ("Parents", "Births", "Settings", "Words", "Measures", "Attribution"):
        assert page.get_by_role("heading", name=title, exact=True).is_visible()
    assert page.get_by_role("heading", name="All births").count() == 0


@pytest.mark.long
@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not there")
def test_who_cannot_see_it_can_use_it(opened):
    page = opened(viewport={"width": 1400, "height": 900})
    tabs = page.locator(".evocity-view [role=tab]:visible")
    for place in range(tabs.count()):
        tabs.nth(place).click()
        page.locator("[role=option]").first.click()
        page.wait_for_timeout(300)
        page.evaluate(AXE.read_text(encoding="utf-8"))
        found = page.evaluate(
            """async () => (await axe.run()).violations
              .map((one) => [one.id, one.nodes.map((node) => node.html)])"""
        )
        assert found == [], tabs.nth(place).inner_text()
