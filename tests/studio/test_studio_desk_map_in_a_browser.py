"""The maps of the desk in chromium: windows, areas and bounds by pointer and by keys."""

import contextlib
import tomllib
from unittest.mock import patch

import pytest

pytest.importorskip("playwright.sync_api")

from brought import end_runs, ending, footprints
from chromium import BROWSER
from test_studio_desk_in_a_browser import axe, press, until, write

import evocity
from evocity.coding import decode
from evocity.studio import desk_maps
from evocity.studio.server import running_server

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

READ = "!JSON.parse(studio.desk.stateText).maps.some((one) => one.reading)"
WIDE = {"width": 1400, "height": 900}
#: The canvases of maps.
SHOWN = "document.querySelectorAll('.evocity-cards canvas').length"
MARKED = "JSON.parse(studio.desk.stateText).maps[0].about.areas"
#: Metres of a map as CSS px of its canvas.
PLACE = """([map, place]) => {
  const one = studio.desk.cards.cards.get(map).map, [x, y] = one.toScreen(place);
  const { left, top } = one.canvas.getBoundingClientRect();
  return [left + x, top + y];
}"""


@contextlib.contextmanager
def two_maps(browser, tmp_path, **size):
    """A desk with two files; the page, the server and the numbers of the maps."""
    files = [footprints(tmp_path / f"{n}.geojson", n) for n in (1, 2)]
    said = []
    with (
        patch.object(desk_maps, "DISTRICTS", {}),
        running_server(folder=tmp_path / "runs", fresh=True) as server,
        ending(server),
        contextlib.closing(browser.new_page(viewport=size or WIDE)) as page,
    ):
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.goto(server.url)
        until(page, "typeof studio !== 'undefined' && studio.desk.stateText")
        write(page, "width of the square map in pixels", "16")
        write(page, "metres per pixel", "4")
        page.set_input_files("#desk input[type=file]", [str(file) for file in files])
        until(page, f"{SHOWN} === 2")
        until(page, READ)
        until(page, "[...studio.desk.cards.cards.values()].every((one) => one.map.base)")
        yield page, server, page.evaluate("() => studio.desk.cards.chosen")
    refused = "status of 409"  # of a file that is not a map
    assert [text for text in said if refused not in text] == []


def state(page) -> dict:
    return page.evaluate("() => JSON.parse(studio.desk.stateText)")


def drag(page, number, start, end) -> None:
    page.evaluate("(n) => studio.desk.cards.cards.get(n).map.canvas.scrollIntoView()", number)
    for act, place in (("down", start), ("up", end)):
        x, y = page.evaluate(PLACE, [number, place])
        page.mouse.move(x, y, steps=4)
        getattr(page.mouse, act)()


def places(page) -> list:
    """The windows' places in the draft, in the order of the parents."""
    return [one["at"] for one in state(page)["draft"]["maps"]]


@pytest.mark.long
def test_two_files_are_placed_locked_and_bounded_by_pointer_and_keys(browser, tmp_path):
    with two_maps(browser, tmp_path) as (page, server, (first, second)):
        x, y = next(one["about"]["at"] for one in state(page)["maps"] if one["map"] == first)
        drag(page, first, [x, y], [x + 10, y + 6])  # the window, by the pointer
        until(page, "JSON.parse(studio.desk.stateText).draft.maps[0].at")
        assert places(page)[0] == pytest.approx([x + 10, y + 6], abs=1)
        words = page.locator(".evocity-file-map [role=status]").all_inner_texts()
        assert "whole buildings and cuts" in words[0]

        page.evaluate("(n) => studio.desk.cards.cards.get(n).map.canvas.focus()", second)  # by keys
        for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp"):
            page.keyboard.press(key)
        until(page, "JSON.parse(studio.desk.stateText).draft.maps[1].at")
        until(page, READ)
        x2, y2 = places(page)[1]
        seen = next(one["about"]["at"] for one in state(page)["maps"] if one["map"] == second)
        assert seen == pytest.approx([x2, y2], abs=0.1)
        words = page.locator(".evocity-file-map [role=status]").all_inner_texts()
        assert "leaves the file by" in words[1]

        at = places(page)[0]
        page.get_by_role("button", name="draw the lock").first.click()
        drag(page, first, [at[0] - 32, at[1] - 32], [at[0], at[1]])  # a quarter, by the pointer
        page.get_by_role("button", name="draw the boundary").first.focus()
        page.keyboard.press("Enter")
        page.evaluate("(n) => studio.desk.cards.cards.get(n).map.canvas.focus()", first)
        for key in ("Shift+ArrowDown", "Enter", "Shift+ArrowUp", "ArrowRight", "Enter"):
            page.keyboard.press(key)
        until(page, "JSON.parse(studio.desk.stateText).draft.within")
        until(page, READ)
        until(page, f"{MARKED}.within && {MARKED}.lock && {MARKED}.lock.share === 0.25")
        axe(page)

        for name in ("autosimilarity", "salingaros law", "crumbs"):
            press(page, f"drop {name}")
        for name in ("fsi", "gsi"):
            page.get_by_label("another measure").select_option(name)
            press(page, "add")
        page.get_by_label("goal of fsi").select_option("band")
        write(page, "target of fsi", "1.4")
        write(page, "tolerance of fsi", "0.6")
        page.get_by_label("goal of gsi").select_option("bounds")
        write(page, "upper bound of gsi", "2")
        invalid = "[...studio.desk.form.querySelectorAll('input:invalid')].map((one) => one.value)"
        assert page.evaluate(invalid) == ["2"]  # beyond the measure's range
        write(page, "upper bound of gsi", "0.6")
        write(page, "individuals alive", "4")
        write(page, "length", "1")
        page.reload()  # nothing is lost
        until(page, f"studio.desk.stateText && {SHOWN} === 2")
        assert places(page)[0] == at
        assert page.get_by_label("tolerance of fsi").input_value() == "0.6"

        until(page, READ)
        until(page, "!studio.desk.calibrate.disabled")
        press(page, "make the recipe")
        until(page, "studio.desk.stateText && !studio.desk.result.hidden")
        text = page.get_by_label("full text of the recipe").inner_text()
        raw = tomllib.loads(text)
        assert raw["locked"] == {"footprints": "locked.geojson"}
        by_name = {}
        for entry in raw["fitness"]:
            by_name.setdefault(entry.pop("name"), entry)
        assert by_name["gsi"] == {"max": 0.6}
        assert (by_name["fsi"]["min"], by_name["fsi"]["max"]) == (0.8, 2.0)
        assert all("center" in parent for parent in raw["parents"])

        press(page, "begin the run")
        until(page, "studio.run?.viewer && document.querySelectorAll('[role=option]').length")
        end_runs(server)
    (folder,) = [one for one in (tmp_path / "runs").iterdir() if (one / "provenance.json").exists()]
    run = evocity.open_run(folder)
    lock = run.sources()[0].genome.condensation
    assert lock.mask.sum() == 64
    assert lock.mask[8:, :8].all()
    for number in range(len(run)):
        heights = decode(run.genome(number)).city.heights
        assert (heights[lock.mask] == lock.heights[lock.mask]).all()


@pytest.mark.slow
def test_what_was_typed_wrong_is_said_there_and_nothing_is_lost(browser, tmp_path):
    with two_maps(browser, tmp_path, width=820, height=1100) as (page, _, (first, _second)):
        drag(page, first, places_at(page, first), [900, 900])  # beyond the file
        fault = f"JSON.parse(studio.desk.stateText).maps.find((one) => one.map === {first}).fault"
        until(page, fault)
        card = page.locator(".evocity-cards li").first
        assert "lies outside the file" in card.inner_text()
        assert card.locator("canvas").is_visible()
        card.get_by_role("button", name="middle of the file").click()
        until(page, f"!{fault}")

        card.locator("summary").click()
        credit = page.get_by_label("attribution that the licence asks for").first
        credit.fill("x" * 100_000)
        credit.blur()
        assert credit.evaluate("(one) => one.validationMessage").startswith("The attribution has")
        assert len(credit.input_value()) == 100_000  # it stays to be shortened
        credit.fill("© the town")
        credit.blur()
        maps = "JSON.parse(studio.desk.stateText).maps"
        until(page, f"{maps}.some((one) => one.about && one.about.attribution === '© the town')")
        line = tmp_path / "line.geojson"
        line.write_text('{"type": "LineString", "coordinates": [[0, 0], [0.0003, 0.0001]]}')
        wrong = tmp_path / "notes.txt"
        wrong.write_text("x")
        card.get_by_label("lock from a file").set_input_files(str(wrong))
        until(page, "document.querySelector('.evocity-cards li').innerText.includes('notes.txt')")
        card.get_by_label("boundary from a file").set_input_files(str(line))
        until(page, "document.querySelector('.evocity-cards li').innerText.includes('LineString')")
        card.get_by_role("button", name="remove the boundary").click()
        until(page, "!JSON.parse(studio.desk.stateText).draft.within")

        x, y = places_at(page, first)  # a lock larger than the window
        card.get_by_role("button", name="draw the lock").click()
        drag(page, first, [x - 40, y - 40], [x + 40, y + 40])
        until(page, "document.querySelector('.evocity-cards li').innerText.includes('covers')")
        assert "the lock covers the whole window" in card.inner_text()
        card.get_by_role("button", name="remove the lock").click()
        until(page, "!JSON.parse(studio.desk.stateText).draft.lock")
        card.get_by_role("button", name="draw the boundary").click()  # a boundary that is a line
        drag(page, first, [x - 20, y], [x + 20, y])
        until(page, "document.querySelector('.evocity-cards li').innerText.includes('corners')")
        assert state(page)["draft"]["within"] is None
        page.get_by_label("goal of alignment").wait_for()
        page.evaluate(
            "() => studio.desk.goals.showNotes(['alignment: 2 is more than any parent has'])"
        )
        assert "2 is more than any parent has" in page.locator(".evocity-goals").inner_text()
        assert page.get_by_role("checkbox", checked=True).count() == 2


def places_at(page, number) -> list:
    return next(one["about"]["at"] for one in state(page)["maps"] if one["map"] == number)
