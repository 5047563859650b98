"""An architect's whole job in chromium, by pointer and keys: from two files to files of a child."""

import contextlib
import json
import sqlite3
import time
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api")

from brought import end_runs, ending, footprints
from chromium import BROWSER
from test_studio_desk_in_a_browser import until
from test_studio_desk_map_in_a_browser import PLACE

import evocity
from evocity.coding import decode
from evocity.studio import desk_maps
from evocity.studio.server import running_server

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

#: Actions of the whole job, and seconds of waiting for the page, at most.
MOST_ACTIONS, MOST_SECONDS = 59, 360.0
CREDITS = ("© the survey of Left, 2026", "© the office of Right, ODbL")
DESK, BREED, BOARD = "JSON.parse(studio.desk.stateText)", "studio.run.breed", "studio.run.board?"
READ = f"!{DESK}.maps.some((one) => one.reading)"
BRED = f"!{BOARD}.isNew && !{BOARD}.isBusy && {BOARD}.bred"


class Architect:
    """The hands of an architect, who counts ``actions`` and the seconds spent ``waiting``."""

    def __init__(self, page, look=lambda name: None):
        self.page, self.look = page, look
        self.actions, self.waiting, self.running = 0, 0.0, 0.0

    def click(self, locator) -> None:
        self.actions += 1
        locator.click()

    def press(self, name: str) -> None:
        self.click(self.page.get_by_role("button", name=name, exact=True))

    def open_tab(self, name: str) -> None:
        self.click(self.page.get_by_role("tab", name=name))

    def write(self, field, text: str) -> None:
        """Type a text in a field, in the place of the old text."""
        self.actions += 1
        field.focus()
        self.page.keyboard.press("Control+A")
        self.page.keyboard.type(text)
        self.page.keyboard.press("Tab")

    def choose(self, field, value: str) -> None:
        """Choose from a list: one click opens the list, and one click chooses."""
        self.actions += 2
        field.select_option(value)

    def bring(self, field, files) -> None:
        """Bring files: one click opens the dialog, one action chooses, and one click confirms."""
        self.actions += 3
        field.set_input_files([str(file) for file in files])

    def drag(self, start, end) -> None:
        self.actions += 1
        mouse = self.page.mouse
        mouse.move(*start)
        mouse.down()
        mouse.move(*end, steps=4)
        mouse.up()

    def wait(self, condition: str, *, is_run: bool = False) -> None:
        began = time.monotonic()
        until(self.page, condition)
        if is_run:
            self.running += time.monotonic() - began
        else:
            self.waiting += time.monotonic() - began


def towns(folder: Path) -> list[Path]:
    """Two files of footprints without an attribution; the second has one storey more."""
    files = [footprints(folder / f"{name}.geojson", n) for n, name in enumerate(("left", "right"))]
    for file in files:
        content = json.loads(file.read_text())
        del content["attribution"]
        if file is files[1]:
            for feature in content["features"]:
                feature["properties"]["height"] += 3
        file.write_text(json.dumps(content))
    return files


@contextlib.contextmanager
def desk(browser, folder, width=1400, height=900):
    """An empty desk: its page and its server. The console must stay silent."""
    said = []
    with (
        patch.object(desk_maps, "DISTRICTS", {}),
        running_server(folder=folder, fresh=True) as server,
        ending(server),
        contextlib.closing(browser.new_page(viewport={"width": width, "height": height})) as page,
    ):
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(server.url)
        until(page, "typeof studio !== 'undefined' && studio.desk.stateText")
        yield page, server
        end_runs(server)
    assert said == []


def fill_the_desk(architect, files) -> None:
    """Bring two files, move the window, lock a quarter, and choose the goals."""
    page = architect.page
    architect.look("desk-empty")
    architect.bring(page.locator("#desk input[type=file]"), files)
    architect.wait("document.querySelectorAll('.evocity-cards canvas').length === 2")
    architect.write(page.get_by_label("width of the square map in pixels"), "32")
    architect.write(page.get_by_label("metres per pixel"), "2")
    architect.wait(READ)
    shown = "[...studio.desk.cards.cards.values()].every((one) => one.map.base)"
    architect.wait(shown)
    architect.look("desk-files")
    for card, credit in zip(page.locator(".evocity-cards li").all(), CREDITS, strict=True):
        architect.write(card.get_by_label("attribution that the licence asks for"), credit)
    architect.wait(READ)

    first = page.evaluate("() => studio.desk.cards.chosen[0]")

    def screen(x, y):
        return page.evaluate(PLACE, [first, [x, y]])

    canvas = page.locator(".evocity-cards canvas").first
    canvas.scroll_into_view_if_needed()
    x, y = next(one["about"]["at"] for one in desk_state(page)["maps"] if one["map"] == first)
    architect.drag(screen(x, y), screen(x + 8, y + 6))
    architect.wait(f"{DESK}.draft.maps[0].at")
    architect.wait(READ)
    x, y = desk_state(page)["draft"]["maps"][0]["at"]
    architect.click(page.get_by_role("button", name="draw the lock").first)
    canvas.scroll_into_view_if_needed()
    architect.drag(screen(x - 32, y), screen(x, y + 32))
    architect.wait(f"{READ} && {DESK}.maps[0].about.areas.lock?.share === 0.25")
    architect.look("desk-lock")

    architect.press("drop all goals")
    for name in ("fsi", "gsi", "winter_sun"):
        if not page.get_by_label(f"goal of {name.replace('_', ' ')}").count():
            architect.choose(page.get_by_label("another measure"), name)
            architect.press("add")
    architect.choose(page.get_by_label("goal of fsi"), "band")
    architect.write(page.get_by_label("target of fsi"), "2.2")
    architect.write(page.get_by_label("tolerance of fsi"), "0.1")
    architect.choose(page.get_by_label("goal of gsi"), "bounds")
    architect.write(page.get_by_label("upper bound of gsi"), "0.42")
    architect.look("desk-goals")
    architect.write(page.get_by_label("individuals alive"), "6")
    architect.write(page.get_by_label("length"), "4")
    architect.wait(f"{READ} && !studio.desk.calibrate.disabled")


def desk_state(page) -> dict:
    return page.evaluate("() => JSON.parse(studio.desk.stateText)")


def begin_and_follow(architect) -> None:
    """Make the recipe, begin the run, follow it to its end, and see the births to keep."""
    architect.press("make the recipe")
    architect.wait("!studio.desk.result.hidden")
    architect.look("desk-recipe")
    architect.press("begin the run")
    beside = "[...document.querySelectorAll('.evocity-go + span')].some((one) => one.textContent)"
    architect.wait(beside)  # the progress is beside the button
    architect.look("begun")
    architect.wait("studio.run?.viewer && document.querySelectorAll('[role=option]').length")
    architect.look("run-first")
    ended = "!studio.run.control.isBusy"
    architect.wait(f"{ended} && studio.run.viewer.page.births.count > 6", is_run=True)
    kept = "document.querySelectorAll('.evocity-kept > li').length"
    architect.wait(kept)
    architect.look("run-ended")
    assert architect.page.get_by_role("tab", name="which to keep").first.is_visible()


def breed_draw_and_export(architect, folder) -> tuple[Path, Path]:
    """Breed a child by hand, draw a child, and export the drawn child to two files."""
    page = architect.page
    architect.press("choose these births")
    architect.open_tab("picks")
    architect.click(page.get_by_role("button", name="chosen", exact=False).first)
    architect.wait("studio.run.picks.ids.length > 1")
    architect.look("picks")
    architect.open_tab("breed")
    architect.wait(f"{BREED}.operators.length && !{BREED}.go.disabled")
    architect.press("breed")
    architect.wait(f"!{BREED}.isBusy && {BREED}.children.length")
    architect.click(page.locator(".evocity-children button").first)
    architect.wait(f"{BREED}.shown !== null && {BREED}.image.naturalWidth > 0")
    architect.look("breed")
    architect.open_tab("draw")
    architect.wait(f"{BOARD}.about && {BRED}")
    before = page.evaluate(f"() => {BOARD}.image.src")
    canvas = page.get_by_role("application", name="map to draw on")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    spots = [(box["x"] + a * box["width"], box["y"] + a * box["height"]) for a in (0.6, 0.7)]
    architect.drag(*spots)
    architect.wait(f"{BRED} && {BOARD}.image.src !== {json.dumps(before)}")
    architect.look("draw")
    pane = page.locator("#pane-0-draw")
    architect.click(pane.get_by_text("export to other programs"))
    architect.wait(f"{BOARD}.export.formats")
    made = []
    for kind in ("glb", "gpkg"):
        architect.choose(pane.get_by_label("format"), kind)
        began = time.monotonic()
        with page.expect_download(timeout=120_000) as found:
            architect.click(pane.get_by_role("button", name="export the child"))
        made.append(folder / found.value.suggested_filename)
        found.value.save_as(made[-1])
        architect.waiting += time.monotonic() - began
    architect.look("exported")
    return tuple(made)


def credits_of(gpkg: Path) -> str:
    """All texts of the metadata of a GeoPackage."""
    with contextlib.closing(sqlite3.connect(gpkg)) as base:
        return " ".join(str(row) for row in base.execute("SELECT metadata FROM gpkg_metadata"))


@pytest.mark.long
def test_an_architect_does_the_job_in_under_60_actions_without_a_terminal(browser, tmp_path):
    files = towns(tmp_path)
    with desk(browser, tmp_path / "runs") as (page, _):
        architect = Architect(page)
        fill_the_desk(architect, files)
        begin_and_follow(architect)
        glb, gpkg = breed_draw_and_export(architect, tmp_path)
    assert architect.actions <= MOST_ACTIONS
    assert architect.waiting < MOST_SECONDS

    assert glb.read_bytes().startswith(b"glTF")
    for credit in CREDITS:
        assert credit.encode() in glb.read_bytes()
        assert credit in credits_of(gpkg)
    (folder,) = [one.parent for one in (tmp_path / "runs").glob("*/provenance.json")]
    run = evocity.open_run(folder)
    lock = run.sources()[0].genome.condensation
    assert lock.mask.sum() == 256
    assert lock.mask[:16, :16].all()
    assert len(run) > 6
    for birth in range(len(run)):
        heights = decode(run.genome(birth)).city.heights
        np.testing.assert_array_equal(heights[lock.mask], lock.heights[lock.mask])
