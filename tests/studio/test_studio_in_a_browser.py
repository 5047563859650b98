"""Studio's page in chromium without a window: one run, live, by pointer and by keys alone."""

import contextlib
import io
import json
import shutil
import time
from collections import deque
from pathlib import Path
from urllib.parse import quote, unquote

import numpy as np
import pytest

pytest.importorskip("playwright.sync_api")

from asking import HOSTILE, OLD, contents
from chromium import BROWSER
from PIL import Image
from toy_runs import write_toy
from written_runs import written

import evocity
from evocity.search import Search
from evocity.search.record.grid import binned
from evocity.store import Birth, Member, RunWriter
from evocity.studio import run_watcher
from evocity.studio.server import running_server

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

COUNT = 120
PICTURES = "studio.run.birth.pictures"
#: Of windows, px.
SIZES = [(1400, 900), (768, 1024), (512, 700)]
GENERATIONS = 50
NODE = Path(__file__).parents[2] / ".venv" / "node" / "node_modules"
AXE = NODE / "axe-core" / "axe.min.js"
WANTED = ({"name": "gsi", "goal": "min"}, {"name": "crumbs", "goal": "max"})


def births(first: int, count: int) -> list[dict]:
    """Some of which failed, and one of which has a strange operator."""
    rng = np.random.default_rng(first)
    found = []
    for k in range(first, first + count):
        one = {"id": k, "parents": (0, k // 2) if k > 1 else (), "operator": "source"}
        if k > 1:
            one["operator"] = HOSTILE if k == 7 else ("mutation", "relocation")[k % 2]
        one["values"] = {"gsi": float(rng.random()), "crumbs": float(rng.integers(0, 9))}
        if k % 10 == 9:
            one |= {"status": "timeout", "error": f"late: {HOSTILE}", "genome": None, "values": {}}
        found.append(one)
    return found


def grown(folder: Path, count: int = 20) -> None:
    """One more generation, the best births of all in it."""
    run = evocity.open_run(folder)
    number, first, code = len(run.generations), len(run), run[0].genome
    born = [
        Birth(
            number,
            first + k,
            (0,),
            "mutation",
            "ok",
            None,
            0.5,
            {"gsi": -1.0 - k, "crumbs": 1.0},
            code,
        )
        for k in range(count)
    ]
    alive = [Member(k, one.id, 0, {"crowding": 0.0}) for k, one in enumerate(born)]
    with contextlib.closing(RunWriter.reopen(folder)) as writer:
        writer.write_generation(number, born, alive, {"births": 0, "failures": 0})


@pytest.fixture
def folder(tmp_path) -> Path:
    return written(tmp_path / "night", [births(0, COUNT)], wanted=WANTED).path


@pytest.fixture
def opened(browser):
    """Opens pages of a server; afterwards their consoles must have been silent, but for what a
    browser says of itself of answers that are ``lost``, and nothing asked of another host."""
    said, asked, contexts = [], [], []

    def open_page(server, width=1024, height=700, context=None, at: str = "", axes: bool = True):
        if context is None:
            context = browser.new_context(viewport={"width": width, "height": height})
            contexts.append(context)
        page = context.new_page()
        page.on("console", lambda told: said.append(f"{told.text} {told.location['url']}"))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(server.url + at)
        until(page, "studio.run?.viewer && document.querySelectorAll('[role=option]').length")
        if axes:  # a finished run shows the births to keep first, by compromise
            page.get_by_role("tab", name="axes").first.click()
            by_first_axis(page)
        return page

    # a server may end before its pages, in the middle of an answer too
    open_page.lost = ("ERR_CONNECTION_", "ERR_EMPTY_RESPONSE", "ERR_INCOMPLETE_CHUNKED_ENCODING")
    yield open_page
    for context in contexts:
        context.close()
    assert [one for one in said if not any(lost in one for lost in open_page.lost)] == []
    local = ("http://127.0.0.1:", "blob:http://127.0.0.1:")
    assert [url for url in asked if not url.startswith(local)] == []


def until(page, condition: str) -> None:
    """Wait for a condition: under this policy the page evaluates no text by itself."""
    end = time.monotonic() + 120
    while not page.evaluate(f"() => Boolean({condition})"):
        assert time.monotonic() < end, condition
        time.sleep(0.02)


def by_first_axis(page) -> None:
    page.evaluate(
        """() => { const { viewer, about } = studio.run;
          viewer.change({ order: { name: about.axes[0]?.name || "id", reversed: false } }); }"""
    )


def look(page) -> None:
    """Look for what is new now."""
    page.evaluate("() => studio.look()")


def shown_ids(page) -> list[int]:
    labels = page.locator("[role=option]").evaluate_all("all => all.map((one) => one.ariaLabel)")
    return [int(one.split(",")[0]) for one in labels]


def state_of(page) -> dict:
    return json.loads(unquote(page.evaluate("location.hash")[1:]))


@pytest.mark.slow
def test_the_whole_job_by_keys_alone(opened, folder):
    before = contents(folder)
    with running_server(folder) as server:
        page = opened(server, axes=False)
        by_first_axis(page)
        keys = page.keyboard

        def tab_to(selector: str) -> None:
            for _ in range(60):
                if page.evaluate(f"() => document.activeElement.matches({json.dumps(selector)})"):
                    return
                keys.press("Tab")
            raise AssertionError(selector)

        tab_to("[role=tab][aria-selected=true]")
        assert page.evaluate("document.activeElement.textContent") == "which to keep"
        keys.press("ArrowRight")
        tab_to(".evocity-head")  # the axis of gsi
        keys.press("Enter")
        keys.type("0.25")
        keys.press("Tab")
        keys.type("0.75")
        keys.press("Tab")
        keys.press("Escape")
        assert state_of(page)["brushes"] == {"gsi": [[0.25, 0.75]]}
        run = evocity.open_run(folder)
        right = run.where("0.25 <= gsi <= 0.75").sort_values("gsi", kind="stable").index.tolist()
        assert shown_ids(page)[:5] == right[:5]
        tab_to("[role=listbox]")
        for key in ("ArrowRight", "ArrowRight", " ", "ArrowRight", " "):
            keys.press(key)
        assert state_of(page)["chosen"] == right[1:3]
        until(page, f"document.querySelector('#side h2').textContent === 'birth {right[2]}'")
        tab_to("#tab-0-birth")
        keys.press("ArrowRight")
        assert page.evaluate("document.activeElement.textContent") == "picks"
        keys.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "pick 2 chosen"
        keys.press("Enter")
        until(page, "document.querySelectorAll('.evocity-picks li').length === 2")
        tab_to(".evocity-picks textarea")
        keys.type("courtyards <b>")
        keys.press("Tab")
        until(page, "studio.run.picks.list.querySelector('textarea').value === 'courtyards <b>'")
        assert page.locator("[role=option][aria-label*=picked]").count() == 2
        end = time.monotonic() + 120
        while "courtyards" not in (folder / "picks.json").read_text():
            assert time.monotonic() < end
        tab_to("#pane-0-picks button:nth-of-type(2)")
        page.close()  # else it may be told that its server is ending
    after = contents(folder)
    kept = json.loads(after.pop("picks.json"))
    assert [one["id"] for one in kept["picks"]] == right[1:3]
    assert kept["picks"][0]["note"] == "courtyards <b>"
    assert after == before


@pytest.mark.slow
def test_one_birth_is_told_whole_and_strangers_texts_are_texts(opened, folder):
    with running_server(folder) as server:
        page = opened(server)
        page.get_by_label("order").select_option("id")
        page.locator("[role=option]").nth(7).click()
        until(page, "studio.run.birth.facts.textContent.includes('less is better')")
        until(page, "studio.run.birth.pictures.figures[0].image.naturalWidth > 0")
        assert HOSTILE.replace("_", " ") in page.locator("#pane-0-birth").inner_text()
        table = page.locator(".evocity-values").first.inner_text()
        value = evocity.open_run(folder)[7].scores["gsi"]
        assert f"{value:.4g}" in table
        assert "left" in page.locator(".evocity-values").nth(1).inner_text()
        page.get_by_role("tab", name="pedigree").click()
        until(page, "document.querySelectorAll('.evocity-pedigree .evocity-node').length >= 4")
        nodes = page.locator(".evocity-pedigree .evocity-node")
        labels = nodes.evaluate_all("all => all.map((one) => one.ariaLabel)")
        assert labels[0] == "birth 7, 0 child-to-parent steps before the selected birth"
        assert "birth 0, left, 2 child-to-parent steps before the selected birth" in labels
        page.get_by_role("button", name="ancestry").click()
        until(
            page,
            "studio.run.birth.pictures.figures[0].image.alt.includes('coloured by source city')",
        )
        for name in ("calls of blocks", "calls of pixels"):
            page.get_by_role("button", name=name, exact=True).click()
            until(
                page,
                "studio.run.birth.pictures.figures[0].image.alt.includes('how many lifs copy')",
            )
        until(
            page,
            f"{PICTURES}.legend.textContent.startsWith('how many lifs copy each pixel')",
        )
        nodes.nth(1).click()
        until(page, "document.querySelector('#side h2').textContent === 'birth 3'")
        assert state_of(page)["one"] == 3
        page.locator("[role=option]").nth(9).click()
        until(
            page,
            "document.querySelector('#pane-0-birth .evocity-lack').textContent.includes('picture')",
        )
        until(page, "studio.run.birth.facts.textContent.includes('late: ')")
        assert HOSTILE in page.locator("#pane-0-birth").inner_text()
        assert page.evaluate("window.hacked") is None
        assert page.locator("main script, img[src=x]").count() == 0


@pytest.mark.long
@pytest.mark.skipif(not AXE.is_file(), reason="axe-core is not there")
def test_who_cannot_see_it_can_use_it(opened, tmp_path):
    """axe-core finds nothing, in every pane."""
    night = shutil.copytree(OLD / "run-6", tmp_path / "night")
    (night / "picks.json").write_text('{"picks": [{"id": 3, "note": "a note"}, {"id": 20}]}')
    with running_server(night) as server:
        page = opened(server)

        def check() -> None:
            page.evaluate(AXE.read_text(encoding="utf-8"))
            found = page.evaluate(
                """async () => (await axe.run()).violations
                  .map((one) => [one.id, one.nodes.map((node) => node.html)])"""
            )
            assert found == []

        check()
        page.locator("[role=option]").nth(1).click()
        until(page, "studio.run.birth.pictures.figures[0].image.naturalWidth > 0")
        page.locator(".evocity-head").first.click()
        page.get_by_role("button", name="pin this birth").click()
        page.get_by_text("distribution of its buildings").click()
        page.locator("[role=option]").nth(2).click()
        until(page, "studio.run.birth.pictures.figures[1].image.naturalWidth > 0")
        until(page, "studio.run.birth.buildings.state")
        check()
        for name in ("which to keep", "curves", "pedigree", "tables"):
            page.get_by_role("tab", name=name).click()
            page.wait_for_timeout(500)
            check()
        page.get_by_role("tab", name="scatter").click()
        page.get_by_role("button", name="filter the y axis").click()
        check()
        page.get_by_role("tab", name="grid").click()
        check()
        page.get_by_role("tab", name="picks").click()
        check()
        page.get_by_role("tab", name="breed").click()
        until(page, "studio.run.breed.following === false && !studio.run.breed.go.disabled")
        page.get_by_role("button", name="breed", exact=True).click()
        until(page, "studio.run.breed.children.length && !studio.run.breed.isBusy")
        page.locator(".evocity-children button").first.click()
        until(page, "studio.run.breed.childDetail.children.length")
        check()
        page.get_by_role("tab", name="draw").click()
        until(page, "studio.run.board?.about && studio.run.board?.image.naturalWidth > 0")
        page.get_by_role("button", name="mask", exact=True).click()
        check()
        page.evaluate("() => studio.report(new Error('something is at fault'))")
        check()


@pytest.mark.slow
@pytest.mark.parametrize(("button", "kind", "key"), [
    ("3D", "columns", "ArrowRight"),
    pytest.param("walk", "walk", "q", marks=pytest.mark.long),
])  # fmt: skip
def test_a_birth_is_seen_in_space_from_where_the_last_one_was(opened, folder, button, kind, key):
    opened.lost += ("GL Driver Message",)  # of a machine without a graphics card
    with running_server(folder) as server:
        page = opened(server)
        kinds = "[...studio.run.birth.pictures.kinds.values()]"
        assert page.evaluate(f"() => {kinds}.every((one) => one.disabled)")  # no birth is told yet
        page.locator("[role=option]").nth(1).click()
        page.get_by_role("button", name=button, exact=True).click()
        until(
            page, "studio.run.birth.pictures.spaceView && studio.run.birth.pictures.spaceView.kind"
        )
        if page.evaluate("() => studio.run.birth.pictures.spaceView.kind") != kind:
            pytest.skip("no WebGL2 in this browser")
        canvas = page.locator(f"canvas[data-kind={kind}]")
        assert canvas.is_visible()
        assert "birth" in canvas.get_attribute("aria-label")
        about, heights = page.evaluate(
            "() => { const { kind, drawers } = studio.run.birth.pictures.spaceView;"
            " const { heights, ...rest } = drawers[kind].city; return [rest, [...heights]]; }"
        )
        city = evocity.open_run(folder)[int(shown_ids(page)[1])].city
        assert heights == city.heights.ravel().tolist()
        assert (about["rows"], about["columns"]) == city.shape
        space = f"{PICTURES}.spaceView"
        camera = f"{space}.hands[{space}.kind].hand.camera.azimuth"
        before = page.evaluate(f"() => {camera}")
        canvas.focus()
        page.keyboard.down(key)
        until(page, f"{camera} !== {before}")
        page.keyboard.up(key)
        page.locator("[role=option]").nth(2).click()
        until(page, f"studio.run.birth.pictures.space.querySelector('[data-kind={kind}]').ariaLabel"
                    f".includes('birth {shown_ids(page)[2]} ')")  # fmt: skip
        assert page.evaluate(f"() => {camera}") != before
        page.locator("[role=option]").nth(9).click()
        page.get_by_role("button", name="map", exact=True).click(trial=True)
        page.get_by_role("button", name="map", exact=True).click()
        until(
            page,
            f"{PICTURES}.space.hidden && !{PICTURES}.figures[0].image.hidden",
        )


@pytest.mark.long
def test_another_birth_is_pinned_beside_by_a_key(opened, folder):
    """Both from one place, in numbers, as a difference; and the address tells it."""
    with running_server(folder) as server:
        page = opened(server)
        first, second = shown_ids(page)[1:3]
        page.locator("[role=option]").nth(1).click()
        page.keyboard.press("p")
        until(page, f"studio.run.birth.pinned === {first}")
        until(page, "studio.run.birth.pictures.figures[0].image.naturalWidth > 0")
        assert page.get_by_role("button", name="difference").is_disabled()  # beside itself
        page.get_by_role("button", name="3D").click()
        page.locator("[role=listbox]").focus()
        page.keyboard.press("ArrowRight")
        until(page, "studio.run.birth.pictures.spaceView?.shown.length === 2")
        assert state_of(page)["pinned"] == first
        views = page.locator("canvas[data-kind=columns]")
        assert [views.nth(k).get_attribute("aria-label").split(" in ")[0] for k in range(2)] == [
            f"birth {second}",
            f"birth {first}, pinned",
        ]
        seen = f"{PICTURES}.spaceView.views.map((one) => one.canvases.columns.toDataURL())"
        until(page, f"studio.before = {seen}")
        views.nth(1).focus()  # the hand on either turns both
        page.keyboard.press("ArrowRight")
        until(page, f"{seen}.every((one, place) => one !== studio.before[place])")
        run = evocity.open_run(folder)
        rows = page.locator("#pane-0-birth .evocity-values").first.locator("tr")
        cells = rows.nth(1).locator("td").all_inner_texts()
        ours, theirs = run[second].scores["gsi"], run[first].scores["gsi"]
        assert [float(one) for one in cells[:2]] == pytest.approx([ours, theirs], rel=1e-3)
        more = float(cells[2].replace("−", "-"))
        assert more == pytest.approx(ours - theirs, rel=1e-3)
        page.get_by_text("distribution of its buildings").click()
        until(page, "studio.run.birth.buildings.state?.listed.length")
        assert f"birth {first}, pinned" in page.locator("details table").inner_text()
        page.get_by_role("button", name="difference").click()
        until(page, f"studio.run.birth.pictures.legend.textContent.includes('minus birth {first}')")
        page.get_by_role("button", name="map", exact=True).click()
        until(page, "studio.run.birth.pictures.figures[1].image.naturalWidth > 0")
        again = opened(server, context=page.context, at=f"#{page.url.partition('#')[2]}")
        until(again, "!studio.run.birth.pictures.figures[1].root.hidden")
        assert state_of(again) == state_of(page)
        page.get_by_role("button", name=f"unpin birth {first}").click()
        until(page, "studio.run.birth.pictures.figures[1].root.hidden")
        assert state_of(page)["pinned"] is None


@pytest.mark.long
def test_an_address_opens_what_it_holds_and_nothing_else(opened, folder):
    with running_server(folder) as server:
        page = opened(server)
        page.get_by_label("order").select_option("crumbs")
        page.locator(".evocity-head").nth(1).click()
        page.get_by_label("crumbs from, filter range 1").fill("3")
        page.keyboard.press("Tab")
        page.locator("[role=option]").nth(2).click()
        ids, held = shown_ids(page), page.url.partition("#")[2]
        again = opened(server, context=page.context, at=f"#{held}", axes=False)
        assert shown_ids(again) == ids
        assert state_of(again) == state_of(page)
        until(again, f"document.querySelector('#side h2').textContent === 'birth {ids[2]}'")
        line = again.evaluate("() => studio.run.picks.python.value")
        assert 'view(order="crumbs")' in line
        assert f"[{ids[2]}]" in line
        strange = {
            "order": {"name": HOSTILE},
            "axes": [{"name": "__proto__"}, 3],
            "brushes": {"gsi": [["a", 1], [2, 1], 4], "operator": ["none of them"], "x": [1]},
            "chosen": [3, 99_999, "4", None, 3],
            "one": "x",
            "pinned": 99_999,
        }
        for at in (f"#{quote(json.dumps(strange))}", "#%", "#null", "#[1]", "#%7B"):
            page = opened(server, context=page.context, at=at)
            assert state_of(page)["brushes"] == {}
            assert state_of(page)["pinned"] is None
        assert page.evaluate("window.hacked") is None


@pytest.mark.slow
def test_new_generations_arrive_and_nothing_jumps(opened, folder, monkeypatch):
    monkeypatch.setattr(run_watcher, "FRESH", 0.0)
    going = [True]
    monkeypatch.setattr(run_watcher, "is_held", lambda path: going[0])
    with running_server(folder) as server:
        page = opened(server, axes=False)
        assert page.evaluate("() => studio.run.viewer.state.view") == "axes"  # it is running
        by_first_axis(page)
        page.locator("[role=option]").nth(3).click()
        page.evaluate("() => { studio.run.viewer.gallery.root.scrollTop = 150; }")
        until(page, "document.querySelector('[role=option]').dataset.place !== '0'")
        before, top = (
            shown_ids(page),
            page.evaluate("() => studio.run.viewer.gallery.root.scrollTop"),
        )
        state = state_of(page)
        for _ in range(3):
            grown(folder)
        look(page)
        until(page, "studio.run.about.generation === 3")
        ids = page.evaluate("() => Array.from(studio.run.viewer.births.ids)")
        assert ids == evocity.open_run(folder).columns.ids.tolist()
        assert shown_ids(page) == before
        assert page.evaluate("() => studio.run.viewer.gallery.root.scrollTop") == top
        assert state_of(page) == state
        assert f"{COUNT + 60} births" in page.locator("#news").inner_text()
        page.get_by_role("button", name="sort the 60 new births into the list").click()
        assert shown_ids(page)[0] == COUNT + 19  # the best of the first new generation, born first
        grown(folder)
        look(page)
        until(page, "studio.run.viewer.newCount === 20")
        going[0] = False  # the run ends: nothing is left to press
        look(page)
        until(page, "studio.run.viewer.newCount === 0 && studio.run.state.view === 'keep'")
        until(page, "document.querySelectorAll('.evocity-kept li').length > 1")
        first = evocity.open_run(folder).compromise().id
        assert f"birth {first}" in page.locator(".evocity-kept h2").first.inner_text()


@pytest.mark.slow
def test_sorting_leaves_no_hole(opened, folder):
    with running_server(folder) as server:
        page = opened(server)
        ok = evocity.open_run(folder).columns.ok
        for order, top in (("gsi", 0), ("crumbs", 300), ("operator", 600), ("id", 150)):
            page.get_by_label("order").select_option(order)
            page.evaluate("(top) => { studio.run.viewer.gallery.root.scrollTop = top; }", top)
            page.evaluate("new Promise((done) => requestAnimationFrame(() => setTimeout(done)))")
            until(
                page, "!studio.run.viewer.tiles.isLoading && !studio.run.viewer.tiles.queue.length"
            )
            ids = shown_ids(page)
            found = page.evaluate(
                "(ids) => ids.map((id) => [96, 192].some((side) => "
                "studio.run.viewer.tiles.get(id, side)))",
                ids,
            )
            assert found == ok[ids].tolist()


@pytest.mark.slow
def test_on_fine_screens_small_pictures_come_first_where_the_log_has_them(
    opened, browser, tmp_path
):
    folder = shutil.copytree(OLD / "run-10", tmp_path / "night")
    size = {"width": 1024, "height": 700}
    with (
        running_server(folder) as server,
        contextlib.closing(browser.new_context(viewport=size, device_scale_factor=2)) as context,
    ):
        asked = []
        context.on("request", lambda request: asked.append(request.url))
        page = opened(server, context=context)
        first = "studio.run.viewer.births.ids[studio.run.viewer.rows[0]]"
        until(page, f"studio.run.viewer.gallery.tiles.get({first}, 192)")
    sides = [url.partition("side=")[2] for url in asked if "/tiles?" in url]
    assert sides[0] == "96"
    assert "192" in sides  # other views show small pictures


@pytest.mark.long
def test_eight_tabs_follow_a_run_that_is_bred_as_without_them(opened, tmp_path, monkeypatch):
    # a page settles the births of a run that has ended, five seconds after its last look
    monkeypatch.setattr(run_watcher, "is_held", lambda path: True)
    recipe = evocity.read_recipe(write_toy(tmp_path, population=2, generations=GENERATIONS))
    alone = Search(recipe, tmp_path / "alone", workers=0)
    with alone, Search(recipe, tmp_path / "night", workers=0) as search:
        steps = iter(search)
        next(steps), search.flush()
        with running_server(tmp_path / "night") as server:
            page = opened(server)
            pages = [page, *(opened(server, context=page.context) for _ in range(7))]
            page.get_by_label("order").select_option("spread")
            page.locator("[role=option]").nth(1).click()
            before, state = shown_ids(page), state_of(page)
            for step, _ in enumerate(steps, 1):
                if step % 10 == 0:
                    search.flush()
                    for one in pages:
                        look(one)
            time.sleep(run_watcher.FRESH)
            for one in pages:
                look(one)
                until(one, f"studio.run.about.generation === {GENERATIONS}")
                ids = one.evaluate("() => Array.from(studio.run.viewer.births.ids)")
                assert ids == evocity.open_run(tmp_path / "night").columns.ids.tolist()
                assert len(set(ids)) == len(ids) == 2 * (GENERATIONS + 1)
            assert shown_ids(page)[: len(before)] == before
            assert state_of(page) == state
        deque(alone, 0)
    logs = [
        evocity.open_run(tmp_path / one).births().drop(["seconds"]) for one in ("alone", "night")
    ]
    assert logs[0].equals(logs[1])


@pytest.mark.long
def test_new_births_wait_while_the_hand_is_at_a_filter(opened, folder):
    with running_server(folder) as server:
        page = opened(server)
        page.locator(".evocity-head").first.click()
        field = page.get_by_label("gsi from, filter range 1")
        field.fill("0.1")
        grown(folder)
        time.sleep(0.55)
        look(page)
        time.sleep(0.2)
        assert field.input_value() == "0.1"
        assert page.evaluate("() => studio.run.about.generation") == 0
        page.locator("[role=listbox]").focus()
        look(page)
        until(page, "studio.run.about.generation === 1")
        assert (
            page.locator(".evocity-count")
            .inner_text()
            .endswith(f"of {COUNT + 20} births pass the filter, 0 chosen")
        )


@pytest.mark.slow
def test_children_are_bred_and_kept_by_keys_alone(opened, tmp_path):
    opened.lost += ("409 (Conflict)",)
    night = shutil.copytree(OLD / "run-6", tmp_path / "night")
    (night / "picks.json").write_text('{"picks": [{"id": 3}, {"id": 20}]}')
    with running_server(night) as server:
        page = opened(server, axes=False)
        by_first_axis(page)
        keys = page.keyboard
        page.get_by_role("tab", name="birth").focus()
        for _ in range(2):
            keys.press("ArrowRight")
        until(page, "studio.run.breed.following === false && !studio.run.breed.go.disabled")
        page.locator("#pane-0-breed select").first.focus()
        page.locator("#pane-0-breed select").first.select_option("pavement_fusion")
        page.locator("#pane-0-breed summary").first.focus()
        keys.press("Enter")
        field = page.get_by_label("fill", exact=True)
        field.focus()
        keys.type("nonsense")
        page.get_by_role("spinbutton", name="children").focus()
        keys.press("Control+a")
        keys.type("3")
        keys.press("Enter")
        until(page, "studio.trouble.textContent.includes('fill')")
        field.focus()
        keys.press("Control+a")
        keys.type("0.4")
        keys.press("Enter")
        until(page, "studio.trouble.hidden")
        until(
            page, "studio.run.breed.children.filter((one) => one.stage === 'measured').length === 3"
        )
        until(page, "!studio.run.breed.isBusy")
        page.locator("[aria-label^='child 1, bred by pavement fusion, measured']").focus()
        keys.press("Enter")
        until(page, "studio.run.breed.image.naturalWidth > 0")
        assert "crumbs" in page.locator("#pane-0-breed .evocity-values").inner_text()
        page.get_by_text("tick “keep this child”").wait_for()
        page.get_by_label("keep this child").focus()
        keys.press(" ")
        page.locator("[aria-label^='child 2, ']").dblclick()  # marks it, and once more takes it off
        page.get_by_role("button", name="save 2 children and a recipe").wait_for()
        assert page.get_by_label("keep this child").is_checked()
        page.locator("[aria-label^='child 2, ']").dblclick()
        assert not page.get_by_label("keep this child").is_checked()
        assert page.get_by_text("tick “keep this child”").is_hidden()
        page.get_by_role("button", name="save 1 child and a recipe").focus()
        keys.press("Enter")
        until(page, "studio.run.breed.message.textContent.includes('evocity run')")
        recipe = page.locator(".evocity-command").inner_text().removeprefix("evocity run ")
        told = [(one.genome, one.id) for one in evocity.read_recipe(recipe).parents]
        assert told == [("child-1.parquet", None), (None, 3), (None, 20)]
        page.reload()
        until(page, "studio.run?.viewer")
        page.get_by_role("tab", name="breed").click()
        until(page, "studio.run.breed.children.length === 3")  # they are there until the next brood


BRED = "!studio.run.board?.isNew && !studio.run.board?.isBusy && studio.run.board?.bred"


def as_python_breeds(name: str, parents, **parameters):
    """The child of the drawing board's seed."""
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence(0, spawn_key=(0, 0))))
    wanted = evocity.operators.make(name, **parameters)(parents, rng)
    assert wanted.digest != parents[0].digest
    return wanted.digest


@pytest.mark.long
def test_what_is_drawn_is_bred_bit_for_bit(opened, tmp_path):
    """Macro-blocks by pointer, a λ and a lock by keys: each child is what Python has."""
    night = shutil.copytree(OLD / "run-1", tmp_path / "night")
    (night / "picks.json").write_text('{"picks": [{"id": 3}, {"id": 20}]}')
    run = evocity.open_run(night)
    parents = [run.genome(3), run.genome(20)]
    with running_server(night) as server:
        page = opened(server)
        keys, drawn = page.keyboard, server.studio.runs[0].board

        def child():
            until(page, BRED)
            return drawn.children[0]

        def same(found, name, parents=parents, **parameters) -> bool:
            return as_python_breeds(name, parents, **parameters) == found.genome.digest

        page.get_by_role("tab", name="draw").click()
        until(page, "studio.run.board?.about")
        child()
        board = page.get_by_role("application")
        box = board.bounding_box()
        for x, y in ((0.3, 0.25), (0.7, 0.6)):
            board.click(position={"x": x * box["width"], "y": y * box["height"]})
        found, told = child(), page.evaluate("() => studio.run.board?.parameters")
        grid, metres, block = parents[0].pavement.block, parents[0].metres_per_pixel, 1
        block = round(told["side_min"] / grid / metres)
        placed = [(round(y / grid / metres), round(x / grid / metres)) for y, x in told["places"]]
        assert len(placed) == 2
        by_blocks = {"positions": placed, "size_min": block, "size_max": block}
        by_blocks |= {"fill": 0.5, "margin": 0, "tolerance": 1000}
        assert same(found, "pavement_fusion", **by_blocks)
        assert found.genome.made["fill_reached"][1] == pytest.approx(
            len({(y + i, x + j) for y, x in placed for i in range(block) for j in range(block)})
            / len(parents[0]),
            abs=1e-4,
        )

        page.get_by_label("method").select_option("interpolation")
        page.get_by_label("λ, share of the second").fill("0.7")
        board.focus()
        keys.press("ArrowUp")
        keys.press("Enter")
        assert page.locator("[aria-live=polite]").inner_text().startswith("drawn, ")
        found = child()
        painted = np.full(len(parents[0]), 1.0)
        spot = page.evaluate("() => [studio.run.board?.spot, studio.run.board?.about.cell]")
        (row, column, side), cell = (spot[0][key] for key in ("row", "column", "side")), spot[1]
        tops, lefts = (np.asarray(one) + grid // 2 for one in parents[0].pavement.corners)
        inside = (tops // cell >= row) & (tops // cell < row + side)
        inside &= (lefts // cell >= column) & (lefts // cell < column + side)
        painted[inside] = 0.3
        assert 0 < inside.sum() < inside.size
        assert same(found, "interpolation", share=painted.tolist())
        page.get_by_label("method").select_option("stepwise")
        assert same(child(), "interpolation", share=painted.tolist(), stepwise=True)
        page.get_by_label("method").select_option("interpolation")

        page.get_by_role("button", name="lock", exact=True).click()
        board.focus()
        keys.press("ArrowDown")
        keys.press("Enter")
        found = child()
        row = page.evaluate("() => studio.run.board?.spot.row")
        city = evocity.decode(parents[0]).city
        mask = np.zeros(city.shape, bool)
        high, low = max(0, row) * cell, (row + side) * cell
        mask[high:low, max(0, column) * cell : (column + side) * cell] = True
        layer = evocity.Condensation.cut(city, mask)
        held = [one.replace(condensation=layer) for one in parents]
        assert same(found, "interpolation", held, share=painted.tolist())
        assert (found.city.heights[mask] == city.heights[mask]).all()
        page.get_by_role("button", name="save the child and a recipe").click()
        until(page, "studio.run.board?.message.textContent.includes('evocity run')")
        command = page.locator("#pane-0-draw .evocity-command").inner_text()
        recipe = Path(command.removeprefix("evocity run "))
        kept = evocity.read_genome(recipe.parent / "child-0.parquet")
        noted = kept.made["studio"]
        assert (noted["parents"], noted["seed"]) == ([3, 20], 0)
        assert same(found, "interpolation", held, **noted["parameters"])
        assert kept.condensation == layer
        assert evocity.read_recipe(recipe).locked.mask == "locked.npy"
        assert np.array_equal(np.load(recipe.parent / "locked.npy").astype(bool), mask)


@pytest.mark.long
def test_regions_fields_and_a_mask_are_what_python_makes_of_them(opened, tmp_path):
    """Of leaves of many sides; the mask comes from a picture."""
    night = shutil.copytree(OLD / "run-6", tmp_path / "night")
    (night / "picks.json").write_text('{"picks": [{"id": 3}, {"id": 20}]}')
    run = evocity.open_run(night)
    parents = [run.genome(3), run.genome(20)]
    with running_server(night) as server:
        page = opened(server)
        drawn = server.studio.runs[0].board
        page.get_by_role("tab", name="draw").click()
        until(page, BRED)
        page.get_by_label("method").select_option("region_fusion")
        board = page.get_by_role("application")
        box = board.bounding_box()
        board.click(position={"x": 0.4 * box["width"], "y": 0.5 * box["height"]})
        until(page, BRED)
        told = page.evaluate("() => studio.run.board?.parameters")
        assert len(told["places"]) == 1
        found = drawn.children[0].genome.digest
        assert found == as_python_breeds("region_fusion", parents, **told)

        page.get_by_label("method").select_option("lambda_field")
        page.get_by_label("brush").select_option("15")
        board.focus()
        page.keyboard.press("Enter")
        until(page, BRED)
        layers = "studio.run.board?.layers"
        rows, columns, cell = page.evaluate(
            f"() => [{layers}.rows, {layers}.columns, {layers}.cell]"
        )
        painted = np.array(page.evaluate(f"() => [...{layers}.painted]")).reshape(rows, columns)
        assert (rows, columns) == (16, 16)
        values = painted.reshape(8, 2, 8, 2).mean(axis=(1, 3)).ravel()  # equal parts
        assert set(np.unique(painted)) == {0, 1}
        found = drawn.children[0].genome.digest
        assert found == as_python_breeds("lambda_field", parents, side=8, values=values.tolist())

        page.get_by_role("button", name="mask", exact=True).click()
        city = run[3].city
        picture = np.zeros((*city.shape, 4), np.uint8)
        picture[..., 3] = 255  # neither black is marked, nor what is transparent
        picture[:30, 9:40] = (200, 30, 30, 255)
        picture[:8, 9:40, 3] = 0
        file = io.BytesIO()
        Image.fromarray(picture).save(file, "PNG")
        for name, content in (("text.png", b"no picture"), ("mask.png", file.getvalue())):
            files = {"name": name, "mimeType": "image/png", "buffer": content}
            page.locator("input[type=file]").set_input_files(files)
            if name == "text.png":
                until(page, "studio.trouble.textContent.includes('text.png is not a picture')")
        until(page, f"{layers}.within.includes(1)")
        until(page, f"{BRED} && studio.run.board?.marked")
        cells = np.array(page.evaluate(f"() => [...{layers}.within]")).reshape(rows, columns)
        lit = (picture[..., 0] > 0) & (picture[..., 3] > 0)
        shares = lit.reshape(rows, cell, columns, cell).mean(axis=(1, 3))
        assert (cells == (shares >= 0.5)).all()
        marked = np.kron(cells, np.ones((cell, cell))).astype(bool)
        gsi, child = evocity.fitness.get("gsi"), drawn.children[0]
        assert child.values["gsi"] == gsi(child.city.within(marked)) != gsi(child.city)
        table = page.locator("#pane-0-draw .evocity-values")
        assert "in the marked part only" in table.inner_text()
        row = table.locator("tr", has_text="gsi").locator(".evocity-number").all_inner_texts()
        right = [gsi(one.within(marked)) for one in (child.city, run[3].city, run[20].city)]
        assert [float(one) for one in row] == pytest.approx(right, rel=1e-3)


#: Ask for a run that is new to a look for runs that is under way.
LATE = """async () => {
  await studio.searching;
  const runs = studio.listed.slice(0, 1), real = window.fetch;
  window.fetch = async (...asked) => {
    if (!String(asked[0]).includes("/runs")) return real(...asked);
    window.fetch = real;
    await real(...asked);
    return new Response(JSON.stringify({ runs, more: 0 }));
  };
  studio.listed = runs;
  studio.search();
  studio.showRun(1);
}"""


@pytest.mark.slow
def test_a_new_run_is_shown_although_a_look_for_runs_is_under_way(opened, folder, tmp_path):
    other = written(tmp_path / "other", [births(0, 30)], wanted=WANTED[:1]).path
    with running_server(folder, other) as server:
        page = opened(server, axes=False)
        page.evaluate(LATE)
        until(page, "studio.run.number === 1 && studio.run.viewer")


@pytest.mark.long
def test_runs_are_gone_through_by_keys_and_lie_beside_each_other(opened, folder, tmp_path):
    other = written(tmp_path / "other", [births(0, 30)], wanted=WANTED[:1]).path
    with running_server(folder, other) as server:
        page = opened(server, axes=False)
        by_first_axis(page)
        keys = page.keyboard
        page.get_by_label("order").select_option("crumbs")
        page.locator("[role=option]").nth(2).click()
        first = shown_ids(page)
        page.locator("#runs select").first.focus()
        keys.press("ArrowDown")
        until(page, "studio.run.number === 1 && studio.run.viewer")
        assert page.locator(".evocity-births").count() == 1
        assert page.evaluate("document.title") == "run other – evocity studio"
        assert state_of(page)["run"] == 1
        assert set(shown_ids(page)) <= set(range(30))
        keys.press("ArrowUp")
        until(page, "studio.run.number === 0 && studio.run.viewer")
        assert shown_ids(page) == first  # as it was left
        keys.press("Tab")
        keys.press("ArrowDown")
        until(page, "studio.runs.length === 2 && studio.runs[1].viewer")
        sections = page.locator(".evocity-births")
        boxes = [sections.nth(k).bounding_box() for k in range(2)]
        assert boxes[0]["x"] + boxes[0]["width"] <= boxes[1]["x"] + 1
        sections.nth(1).locator("[role=option]").nth(3).click()
        until(
            page, "studio.run.number === 1 && studio.run.birth.facts.textContent.includes('goals')"
        )
        assert page.locator("#pane-1-birth").is_visible()
        assert not page.locator("#pane-0-birth").is_visible()
        page.get_by_role("button", name="pick this birth").click()
        until(page, "studio.runs[1].picks.ids.length === 1")
        assert (other / "picks.json").exists()
        assert not (folder / "picks.json").exists()
        sections.nth(0).locator("[role=listbox]").focus()
        until(page, "studio.run.number === 0")
        held = state_of(page)
        assert (held["run"], held["beside"]["run"]) == (0, 1)
        assert (held["order"]["name"], held["beside"]["order"]["name"]) == ("crumbs", "compromise")
        again = opened(
            server, context=page.context, at=f"#{page.url.partition('#')[2]}", axes=False
        )
        until(again, "studio.runs.length === 2 && studio.runs.every((one) => one.viewer)")
        assert state_of(again) == held
        until(
            again, "document.getElementById('news').textContent.includes('run other: generation')"
        )
        again.get_by_label("second run").select_option("none")
        until(again, "studio.runs.length === 1")
        assert "beside" not in state_of(again)


@pytest.mark.slow
def test_one_filter_in_all_views(opened, tmp_path):
    """A box in the scatter is two brushes on the axes; the grid has the best that pass."""
    night = shutil.copytree(OLD / "run-6", tmp_path / "night")
    run = evocity.open_run(night)
    with running_server(night) as server:
        page = opened(server)
        passing = "Array.from(studio.run.viewer.rows, (row) => studio.run.viewer.births.ids[row])"
        page.get_by_role("tab", name="scatter").click()
        first, second = page.evaluate("() => studio.run.viewer.views.get('scatter').pair")
        selects = page.locator(".evocity-scatter select")
        selects.nth(0).select_option("alignment")
        selects.nth(1).select_option("gsi")
        assert state_of(page)["pair"] == ["alignment", "gsi"] != [first, second]
        table = run.scores
        spans = {}
        for name in ("alignment", "gsi"):
            low, high = table[name].min(), table[name].max()
            spans[name] = (low + 0.2 * (high - low), low + 0.9 * (high - low))
        box = page.locator(".evocity-dots").bounding_box()
        ends = page.evaluate(
            "() => { const scatter = studio.run.viewer.views.get('scatter');"
            " return [0.2, 0.9].map((one) => [scatter.x(one), scatter.y(one)]); }"
        )
        page.mouse.move(box["x"] + ends[0][0], box["y"] + ends[0][1])
        page.mouse.down()
        page.mouse.move(box["x"] + ends[1][0], box["y"] + ends[1][1], steps=3)
        page.mouse.up()
        until(page, "Object.keys(studio.run.state.brushes).length === 2")
        held = state_of(page)["brushes"]
        for name, span in spans.items():
            assert held[name] == [pytest.approx(span, abs=0.02 * (span[1] - span[0]))]
        kept = table
        for name, ((low, high),) in held.items():
            kept = kept[kept[name].between(low, high)]
        assert 0 < len(kept) < len(table)
        assert sorted(page.evaluate(f"() => {passing}")) == sorted(kept.index.tolist())
        one = kept.index[0]
        at = page.evaluate(
            f"() => studio.run.viewer.views.get('scatter').at(studio.run.viewer.births.row({one}))"
        )
        page.mouse.click(box["x"] + at[0], box["y"] + at[1])
        (chosen,) = state_of(page)["chosen"]
        assert table.loc[chosen, ["alignment", "gsi"]].tolist() == pytest.approx(
            table.loc[one, ["alignment", "gsi"]].tolist(), rel=0.1
        )
        page.get_by_label("or by").select_option("likeness")
        until(page, f"studio.run.viewer.by.name === 'distance to {chosen}'")
        near = run.nearest(chosen, n=len(kept) - 1, of=kept.index.tolist())
        seen = page.evaluate(f"() => {passing}")
        assert seen[0] == chosen or near["distance"].iloc[0] == 0
        apart = {chosen: 0.0} | near["distance"].to_dict()
        assert [apart[n] for n in seen] == sorted(apart.values())
        page.get_by_role("button", name="clear filter").click()
        assert page.evaluate(f"() => {passing}")[: len(seen)] == seen  # the others after
        page.get_by_role("tab", name="grid").click()
        page.get_by_label("order").select_option("crumbs")
        bins = binned(run).births
        cells = "[...studio.run.viewer.views.get('grid').filled.entries()]"
        found = page.evaluate(f"() => {cells}.map(([cell, one]) => [cell, one.row])")
        assert sorted(cell for cell, _ in found) == sorted(bins["cell"].to_pylist())
        best = dict(zip(bins["cell"].to_pylist(), bins["id"].to_pylist(), strict=True))
        assert {cell: int(run.columns.ids[row]) for cell, row in found} == best
        page.locator(".evocity-cell[tabindex='0']").focus()
        for key in ("ArrowUp", "ArrowRight", "ArrowDown", "ArrowLeft"):
            page.keyboard.press(key)
        page.keyboard.press("Enter")
        (chosen,) = state_of(page)["chosen"]
        assert chosen in best.values()
        pressed = page.locator(".evocity-cell[aria-pressed=true]")
        assert f"birth {chosen}," in pressed.get_attribute("aria-label")
        until(page, f"document.querySelector('#side h2').textContent === 'birth {chosen}'")
        again = opened(server, context=page.context, at=f"#{page.url.partition('#')[2]}")
        assert again.locator(".evocity-cell").count() == len(best)


@pytest.mark.slow
def test_the_token_leaves_the_address_and_the_cookie_stays_until_the_server_ends(opened, folder):
    """A page tells that its server has ended, and finds it again with another token."""
    opened.lost += ("403 (Forbidden)",)
    with running_server(folder) as server:
        page, port = opened(server), server.port
        assert "token" not in page.url
        assert server._guard.token not in page.content()
        (cookie,) = page.context.cookies()
        assert (cookie["httpOnly"], cookie["sameSite"]) == (True, "Strict")
        assert cookie["name"] == f"evocity-{port}"
        assert page.evaluate("document.cookie") == ""
        page.reload()
        until(page, "studio.run?.viewer")
    look(page)
    until(page, "document.getElementById('trouble').textContent.includes('no longer runs')")
    with running_server(folder, port=port) as server:
        context = page.context
        until(
            page,
            "studio.trouble.textContent.includes('that has ended') || (studio.look(), false)",
        )
        opened(server, context=context)
        look(page)
        until(page, "studio.trouble.hidden || (studio.look(), false)")
        page.locator("[role=option]").nth(2).click()
        until(page, "studio.run.birth.facts.textContent.includes('goals')")


@pytest.mark.long
def test_a_run_that_is_gone_is_told(opened, folder):
    with running_server(folder) as server:
        page = opened(server)
        opened.lost = (*opened.lost, "409 (Conflict)")  # pictures that were asked for just before
        shutil.rmtree(folder)
        time.sleep(0.55)
        look(page)
        until(page, "studio.trouble.textContent.includes('; what to do: ')")
        assert len(shown_ids(page)) > 5


@pytest.mark.slow_cases("1024-700")
@pytest.mark.parametrize(
    ("width", "height"),
    [(1024, 700), *(pytest.param(*one, marks=pytest.mark.long) for one in SIZES)],
)
def test_nothing_is_cut_or_lies_over_another(opened, folder, width, height):
    with running_server(folder) as server:
        page = opened(server, width, height)
        page.locator("[role=option]").nth(1).click()
        until(page, "studio.run.birth.pictures.figures[0].image.naturalWidth > 0")
        page.get_by_role("button", name="pick this birth").click()
        until(page, "studio.run.picks.ids.length")
        page.get_by_role("button", name="pin this birth").click()
        page.locator("[role=option]").nth(2).click()
        # what is told of it moves what lies beneath
        until(page, "studio.run.birth.pictures.figures[1].image.naturalWidth > 0")
        page.get_by_text("distribution of its buildings").click()
        until(page, "studio.run.birth.buildings.state")
        for tab in ("birth", "picks", "breed", "draw"):
            page.get_by_role("tab", name=tab).click()
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            cut = page.evaluate(
                """() => [...document.querySelectorAll("button, select, h1, h2, h3, p, td, th")]
                  .filter((one) => one.offsetParent && !one.closest(".evocity-axes, .evocity-node"))
                  .filter((one) => one.scrollWidth > one.clientWidth + 1)
                  .map((one) => one.textContent)"""
            )
            assert cut == []
            boxes = page.evaluate(
                """() => [...document.querySelectorAll(
                    "main button, main select, main input, main textarea")]
                  .filter((one) => one.checkVisibility()).map((one) => one.getBoundingClientRect())
                  .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
            )
            for k, (left, top, right, bottom) in enumerate(boxes):
                for other in boxes[k + 1 :]:
                    apart = (
                        right <= other[0] + 0.5 or other[2] <= left + 0.5
                        or bottom <= other[1] + 0.5 or other[3] <= top + 0.5
                    )  # fmt: skip
                    assert apart, (boxes[k], other)
