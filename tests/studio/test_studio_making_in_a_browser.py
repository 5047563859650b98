"""Children and files from the page, in chromium: operators that suit, locks, waits, exports."""

import json
import shutil

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api")

from asking import OLD
from chromium import BROWSER
from test_studio_exports import placed_run
from test_studio_in_a_browser import BRED, opened, until
from toy_runs import forgotten, write_toy

import evocity
from evocity.search import Search
from evocity.studio.server import running_server

pytestmark = [
    pytest.mark.skipif(BROWSER is None, reason="chromium is not there"),
    pytest.mark.slow,
]
__all__ = ["forgotten", "opened"]
PICKS = json.dumps({"picks": [{"id": 0}, {"id": 1}]})
BREED, BOARD = "studio.run.breed", "studio.run.board?"


@pytest.fixture
def night(tmp_path):
    night = shutil.copytree(OLD / "run-6", tmp_path / "night")
    (night / "picks.json").write_text('{"picks": [{"id": 3}, {"id": 20}]}')
    return night


def downloaded(page, button, tmp_path):
    with page.expect_download(timeout=120_000) as found:
        button.click()
    path = tmp_path / found.value.suggested_filename
    found.value.save_as(path)
    return path


def test_picks_children_and_a_drawing_become_files(opened, tmp_path):
    run = placed_run(tmp_path / "night")
    (run.path / "picks.json").write_text('{"picks": [{"id": 2}]}')
    opened.lost += ("409 (Conflict)",)
    with running_server(run.path) as server:
        page = opened(server)
        page.get_by_role("tab", name="picks").click()
        pane = page.locator("#pane-0-picks")
        pane.get_by_text("export to other programs").click()
        until(page, "studio.run.picks.export.formats")
        pane.get_by_label("format").select_option("cityjson")
        pane.get_by_label("level of detail").select_option("2.2")
        pane.get_by_label("place on Earth of").select_option("right")
        go = pane.get_by_role("button", name="export birth 2")
        pane.get_by_label("reference system").fill("EPSG:4326")
        go.click()
        said = pane.locator("details [role=status]")
        until(page, "studio.run.picks.export.state.textContent.includes('has degrees')")
        assert page.locator("#trouble").is_hidden()  # the sentence stands beside the button
        pane.get_by_label("reference system").fill("EPSG:32631")
        path = downloaded(page, go, tmp_path)
        assert "night-2.city.json is in your downloads folder" in said.inner_text()
        about = json.loads(path.read_text())["metadata"]
        assert about["referenceSystem"].endswith("32631")
        pane.get_by_label("format").select_option("stl")
        assert pane.get_by_label("reference system").is_hidden()


def test_a_drawn_child_is_exported(opened, night, tmp_path):
    with running_server(night) as server:
        page = opened(server)
        page.get_by_role("tab", name="draw").click()
        until(page, BRED)
        pane = page.locator("#pane-0-draw")
        pane.get_by_text("export to other programs").click()
        until(page, f"{BOARD}.export.formats")
        pane.get_by_label("format").select_option("glb")
        pane.get_by_label("streets and squares").check()
        path = downloaded(page, pane.get_by_role("button", name="export the child"), tmp_path)
    assert path.name == "night-child-0.glb"
    assert path.read_bytes().startswith(b"glTF")


def test_operators_that_do_not_suit_are_grey_with_the_reason(opened, night):
    with running_server(night) as server:
        page = opened(server)
        page.get_by_role("tab", name="breed").click()
        until(page, f"{BREED}.operators.length && !{BREED}.go.disabled")
        grey = page.locator("#pane-0-breed optgroup option").all_inner_texts()
        assert "map exchange: it breeds shapes, not city fabrics" in grey
        assert len(grey) == 11
        names = page.evaluate(f"() => {BREED}.operatorNames")
        assert len(names) == 8
        page.get_by_role("spinbutton", name="children").fill("8")
        page.get_by_role("button", name="breed", exact=True).click()
        until(page, f"!{BREED}.isBusy && {BREED}.children.length === 8")
        assert page.evaluate(f"() => {BREED}.children.map((one) => one.stage)") == ["measured"] * 8
        page.evaluate("() => studio.run.picks.change({ change: 'drop', ids: [20] })")
        until(
            page,
            f"{BREED}.operatorsKey === '3' && "
            f"!{BREED}.suiting.some((one) => one.name === 'pavement_fusion')",
        )
        assert "quarter fusion: it needs 2 or more parents" in (
            page.locator("#pane-0-breed optgroup option").all_inner_texts()
        )


def test_the_board_waits_for_the_brood_and_says_why_nothing_changes(opened, night):
    with running_server(night) as server:
        page = opened(server)
        page.get_by_role("tab", name="breed").click()
        until(page, f"{BREED}.operators.length")
        page.get_by_role("tab", name="draw").click()  # while the workers start
        until(page, BRED)
        assert page.locator("#trouble").is_hidden()
        page.get_by_label("method").select_option("lambda_field")
        until(page, f"{BRED} && {BOARD}.state.textContent.includes('λ is 0 everywhere')")
        assert "equals its parent 3" in page.evaluate(f"() => {BOARD}.state.textContent")


def test_the_lock_of_a_run_is_hatched_on_both_boards(opened, tmp_path):
    mask = np.zeros((64, 64), np.uint8)
    mask[:16] = 1
    np.save(tmp_path / "kept.npy", mask)
    path = write_toy(
        tmp_path, recipe='\n[locked]\nmask = "kept.npy"\ncity = "left"\n', generations=1
    )
    with Search(evocity.read_recipe(path), out=tmp_path / "night") as search:
        list(search)
    (tmp_path / "night" / "picks.json").write_text(PICKS)
    dark = (
        "(canvas) => { const { width, height } = canvas, pixels = canvas.getContext('2d')"
        ".getImageData(0, 0, width, height).data; const counts = [0, 0];"
        "for (let k = 0; k < pixels.length / 4; k++)"
        " if (pixels[4 * k] === 52 && pixels[4 * k + 1] === 48) "
        " counts[Number(k > pixels.length / 8)] += 1; return counts; }"
    )
    with running_server(tmp_path / "night") as server:
        page = opened(server)
        page.get_by_role("tab", name="draw").click()
        until(page, BRED)
        above, below = page.locator(".evocity-stage canvas").evaluate(dark)
        assert above > 5 * (below + 1)
        page.get_by_role("tab", name="breed").click()
        until(page, f"{BREED}.lock && !{BREED}.go.disabled")
        page.get_by_role("spinbutton", name="children").fill("1")
        page.get_by_role("button", name="breed", exact=True).click()
        until(page, f"{BREED}.small.get(0, 96) && !{BREED}.isBusy")
        assert page.evaluate(f"() => {BREED}.lock.width") == 64


def test_the_sun_stands_at_the_latitude_of_the_city(opened, tmp_path):
    run = placed_run(tmp_path / "night")
    opened.lost += ("GL Driver Message",)
    with running_server(run.path) as server:
        page = opened(server)
        page.locator("[role=option]").first.click()
        page.get_by_role("button", name="walk").click()
        until(page, "studio.run.birth.pictures.spaceView?.latitude.value !== '45'")
        assert page.get_by_label("latitude").input_value() == "45.8"  # Lyon


def test_the_control_states_goals_out_of_reach(opened, tmp_path):
    text = '\n[[fitness]]\nname = "gsi"\ntarget = 0.01\n'
    path = write_toy(tmp_path, recipe=text, generations=2)
    with Search(evocity.read_recipe(path), out=tmp_path / "night") as search:
        list(search)
    with running_server(tmp_path / "night") as server:
        page = opened(server)
        text = page.get_by_label("goals out of reach").inner_text()
        assert text.startswith("gsi 0.01 was never below ")
        assert "another parent with less gsi would help" in text.lower()
        page.get_by_role("button", name="resume the run").click()  # it has all its generations
        field = page.get_by_label("to generation")
        told = field.evaluate("(one) => one.validationMessage")
        assert told == "The run has all of its 2 generations. Type a larger number."
        field.fill("3")
        assert field.evaluate("(one) => one.validationMessage") == ""


def test_the_desk_and_back_keeps_the_filter_and_the_gallery(opened, night):
    with running_server(night) as server:
        page = opened(server)
        page.evaluate("() => studio.run.viewer.change({ brushes: { id: [[3, 9]] }, chosen: [5] })")
        until(page, "document.querySelectorAll('[role=option]').length === 7")
        for _ in range(2):
            before = page.evaluate("() => studio.run.held")
            page.get_by_role("button", name="new run").click()
            until(page, "studio.desk.isShown")
            page.get_by_role("button", name="back to the runs").click()
            until(page, "!studio.desk.isShown")
            assert page.evaluate("() => studio.run.held") == before
            until(page, "document.querySelectorAll('[role=option]').length === 7")
        assert page.locator("[role=option]").first.bounding_box()["width"] > 0
