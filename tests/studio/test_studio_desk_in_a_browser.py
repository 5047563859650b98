"""The whole way in chromium: from two files of footprints to a night that goes on, by keys."""

import contextlib
import time
from unittest.mock import patch

import pytest

pytest.importorskip("playwright.sync_api")

from asking import HOSTILE
from brought import end_runs, ending, footprints
from chromium import BROWSER
from test_studio_in_a_browser import AXE

import evocity
from evocity.studio import desk_maps
from evocity.studio.desk_draft import Draft
from evocity.studio.server import running_server

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

#: Drops files on the desk, one after the other, as a hand does.
DROPPED = """(files) => {
  for (const [name, text] of files) {
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([text], name));
    for (const kind of ["dragover", "drop"]) {
      const told = { dataTransfer, bubbles: true, cancelable: true };
      document.querySelector("#desk h2").dispatchEvent(new DragEvent(kind, told));
    }
  }
}"""


def until(page, condition: str, seconds: float = 120.0) -> None:
    """Wait for a condition: under this policy the page evaluates no text by itself."""
    end = time.monotonic() + seconds
    while not page.evaluate(f"() => Boolean({condition})"):
        assert time.monotonic() < end, (condition, page.locator("body").inner_text()[:3000])
        time.sleep(0.05)


def axe(page) -> None:
    if not AXE.is_file():
        return
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = page.evaluate(
        """async () => (await axe.run()).violations
          .map((one) => [one.id, one.nodes.map((node) => node.html)])"""
    )
    assert found == []


def press(page, name: str, exact: bool = True) -> None:
    page.get_by_role("button", name=name, exact=exact).focus()
    page.keyboard.press("Enter")


def write(page, label: str, text: str) -> None:
    page.get_by_label(label).focus()
    page.keyboard.press("Control+A")
    page.keyboard.type(text)
    page.keyboard.press("Tab")


#: Tells the desk, which listens to its server no more, of runs that were begun: folder, number,
#: whether it has a generation, exit code. A recipe is offered too.
TOLD = """(runs) => {
  const { desk } = studio, given = { path: "/night.toml", text: "[run]" };
  window.tell ||= desk.showState.bind(desk);
  desk.showState = () => {};
  const started = runs.map(([folder, run, has, code]) => ({
    name: folder, folder, recipe: "/night.toml", run, has, at: code === null, code,
    said: `first\\n${folder} says`,
  }));
  tell({ ...JSON.parse(desk.stateText), given, started });
}"""


@contextlib.contextmanager
def desk(browser, tmp_path):
    """A page on which two files were brought and a measure was chosen, by keys, and its server."""
    first, second = (footprints(tmp_path / f"{n}.geojson", n).read_text() for n in (1, 2))
    runs, said, asked = tmp_path / "runs", [], []
    with (
        patch.object(desk_maps, "DISTRICTS", {"lyon-1er": None}),
        running_server(folder=runs, fresh=True) as server,
        ending(server),
        contextlib.closing(browser.new_context(viewport={"width": 1024, "height": 700})) as context,
    ):
        page = context.new_page()
        page.on("console", lambda message: said.append(message.text))
        page.on("pageerror", lambda error: said.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        page.goto(server.url)
        until(page, "document.querySelectorAll('.evocity-cards li').length === 1")
        brought = {"name": f"{HOSTILE}.geojson", "mimeType": "text/plain", "buffer": first.encode()}
        page.set_input_files("#desk input[type=file]", brought)
        kept = "&& studio.desk.cards.status.textContent.endsWith('on the desk')"
        until(page, f"document.querySelectorAll('.evocity-cards li').length === 2 {kept}")
        page.evaluate(DROPPED, [["second.geojson", second]])
        until(page, f"document.querySelectorAll('.evocity-cards li').length === 3 {kept}")
        page.evaluate(DROPPED, [["third.shp", "x"], ["third.dbf", "x"]])  # all are told of
        told = "studio.desk.cards.status.textContent.includes"
        until(page, f"{told}('third.shp') && {told}('third.dbf') && {told}('Shapefile')")
        page.evaluate("() => { studio.desk.longest = 2000; }")
        page.evaluate(DROPPED, [["long.geojson", " " * 2001]])  # which is not even sent
        until(page, f"{told}('2 kB at most')")
        for label, text in [
            ("width of the square map in pixels", "32"),
            ("metres per pixel", "4"),
            ("individuals alive", "1"),
            ("length", "90000"),
        ]:
            write(page, label, text)
        invalid = "[...studio.desk.form.querySelectorAll('input:invalid')].map((one) => one.value)"
        assert page.evaluate(invalid) == ["1"]  # one lives: too few, which no server is told
        write(page, "individuals alive", "4")
        write(page, "name of the run", "a/night")
        assert page.evaluate(invalid) == ["a/night"]
        assert page.evaluate("document.activeElement === studio.desk.name")
        write(page, "name of the run", "a night")
        write(page, "length", "1.5")
        assert page.evaluate(invalid) == ["1.5"]
        page.get_by_label("generations or minutes").select_option("minutes")
        assert page.evaluate(invalid) == []
        page.get_by_label("generations or minutes").select_option("generations")
        write(page, "length", "90000")
        for name in ("autosimilarity", "alignment", "salingaros law"):
            press(page, f"drop {name}")
        page.get_by_label("another measure").select_option("gsi")
        press(page, "add")
        page.get_by_label("goal of gsi").select_option("max")
        until(page, "document.getElementById('trouble').hidden")
        until(page, "!JSON.parse(studio.desk.stateText).maps.some((one) => one.reading)")
        until(page, "[...document.images].every((one) => one.hidden || one.naturalWidth)")
        axe(page)
        yield page, server
        assert page.evaluate("window.hacked") is None
        page.close()
    # of the Shapefile, and of the run that could not begin
    assert {one.split("status of ")[1][:3] for one in said} == {"409"}
    assert all(one.startswith(("http://127.0.0.1:", "blob:http://127.0.0.1:")) for one in asked)


@pytest.mark.slow
def test_files_are_brought_and_measures_chosen_by_keys(browser, tmp_path):
    with desk(browser, tmp_path) as (page, _):
        wanted = page.evaluate("() => studio.desk.goals.choices")
        assert [(one["measure"], one["want"]) for one in wanted][-1] == ("gsi", "max")
        page.reload()  # nothing is lost
        until(page, "document.querySelectorAll('.evocity-cards li').length === 3")
        assert page.get_by_label("name of the run").input_value() == "a night"
        assert page.get_by_role("checkbox", checked=True).count() == 2

        # all goals are dropped at once, and the default goals come back
        press(page, "drop all goals")
        until(page, "!JSON.parse(studio.desk.stateText).draft.goals.length")
        assert page.evaluate("document.activeElement") is not None
        assert "To make a recipe, add a goal." in page.locator("#desk").inner_text()
        assert page.get_by_role("button", name="make the recipe").is_disabled()
        press(page, "take the default goals")
        until(page, "JSON.parse(studio.desk.stateText).draft.goals.length === 4")
        usual = page.evaluate("() => studio.desk.goals.choices")
        assert {one["measure"]: one["want"] for one in usual} == {
            one.measure: one.want for one in Draft().goals
        }
        assert page.get_by_role("button", name="take the default goals").is_hidden()

        # a run that cannot begin shows no other, and why it cannot is told
        page.evaluate(
            "() => { window.shown = []; studio.desk.on.show = (run) => shown.push(run); }"
        )
        page.evaluate(TOLD, [["old", 3, True, None]])
        press(page, "begin the run")
        until(page, "document.getElementById('trouble').textContent.includes('not made a recipe')")
        page.evaluate(TOLD, [["old", 3, True, None], ["new", None, False, None]])
        assert page.evaluate("shown") == []

        # the pressed button has the progress beside it, until the run has a generation
        page.evaluate(TOLD, [["old", 3, True, None]])
        beside = page.locator(".evocity-go + span").first
        page.evaluate(
            """() => studio.desk.starts.follow(
              { folder: "new", name: "new" }, document.querySelector(".evocity-go + span"))"""
        )
        page.evaluate(TOLD, [["old", 3, True, None], ["new", None, False, None]])
        assert beside.inner_text() == "new: new says"
        page.evaluate(TOLD, [["old", 3, True, None], ["new", None, False, 1]])
        assert "failed" in beside.inner_text()

        # who left the desk is not taken away from what is looked at
        page.evaluate("() => { studio.desk.starts.waits = 'new'; studio.desk.show(false); }")
        page.evaluate(TOLD, [["old", 3, True, None], ["new", 4, True, None]])
        assert page.evaluate("[shown, studio.desk.starts.waits]") == [[], None]
        page.evaluate("() => studio.desk.show(true)")

        # what ended a run is told: a kill is no stop
        codes = {"a": -9, "b": -11, "c": 137, "d": 1, "e": -2, "f": 143, "g": 130, "h": 0}
        page.evaluate(TOLD, [[name, None, False, code] for name, code in codes.items()])
        rows = page.locator(".evocity-starts li").all_inner_texts()
        told = {row[0]: row for row in rows if row[0] in codes and row[1] in " \n"}
        assert all("failed" in told[one] and "first" in told[one] for one in "abcd")
        assert all("stopped" in told[one] and "first" not in told[one] for one in "efg")
        assert "finished" in told["h"]

        # how a map is read is opened for a new fault, and stays as it is left
        faulty = """(found) => {
          const { desk } = studio, state = JSON.parse(desk.stateText), at = state.maps[0];
          at.fault = found && { found, expected: "a map", remedy: "another" };
          tell({ ...state, usual: `${state.usual}x` }); // something else is new too
          const { more } = desk.cards.cards.get(at.map), isOpen = more.open;
          more.open = false;
          return isOpen;
        }"""
        told = [page.evaluate(faulty, found) for found in ("a", "a", None, "a", "b")]
        assert told == [True, False, False, True, True]

        process = {"at": False, "said": "Error: x"}
        told = page.evaluate(
            """async ([codes, process]) => {
              const { RunControl } = await import("/page/control.js");
              return codes.map((code) => {
                const one = new RunControl(document.createElement("div"), {}, {});
                one.inform({ going: false, process: { ...process, code } });
                return one.state.textContent;
              });
            }""",
            [list(codes.values()), process],
        )
        assert told == ["Error: x"] * 4 + [""] * 4

        # a run that has ended is not stopped while its process writes the report
        told = page.evaluate(
            """async () => {
              const { RunControl } = await import("/page/control.js");
              const one = new RunControl(document.createElement("div"), {}, {}), found = [];
              const steps = [[0, 1], [1, 1], [0, 1], [0, 0], [0, 1]].map((one) => one.map(Boolean));
              for (const [going, at] of steps) {
                one.inform({ going, process: { at, code: at ? null : 0, said: "" } });
                const { stop, resume, state } = one;
                found.push([stop.hidden, resume.hidden, state.textContent]);
              }
              return found;
            }"""
        )
        text = "The run has ended. Evocity writes its report …"
        stop, end, ready = [False, True, ""], [True, True, text], [True, False, ""]
        assert told == [stop, stop, end, ready, stop]


@pytest.mark.long
def test_two_files_become_a_night_by_keys(browser, tmp_path):
    runs = tmp_path / "runs"
    with desk(browser, tmp_path) as (page, server):
        press(page, "make the recipe")
        until(page, "studio.desk.fields.disabled")
        axe(page)
        page.reload()  # nothing is lost
        until(page, "studio.desk.stateText && !studio.desk.result.hidden")
        assert page.get_by_label("name of the run").input_value() == "a night"
        assert page.get_by_label("length").input_value() == "90000"
        assert page.get_by_role("checkbox", checked=True).count() == 2
        text = page.get_by_label("full text of the recipe").inner_text()
        assert "a target" not in text
        assert 'name = "second"' in text
        axe(page)

        press(page, "begin the run")
        until(page, "studio.run?.viewer && document.querySelectorAll('[role=option]').length")
        assert page.title().startswith("run a night")
        press(page, "stop the run")
        until(page, "studio.run.control.state.textContent.includes('after the current generation')")
        press(page, "new run")
        until(page, "studio.desk.isShown && document.querySelector('.evocity-starts li')")
        axe(page)
        page.go_back()
        until(page, "!studio.desk.isShown && !document.getElementById('shown').hidden")
        end_runs(server)  # it would write its report
    run = evocity.open_run(runs / "a night")
    assert len(run.sources()) == 2
    assert (runs / "a night-recipe" / "recipe.toml").read_text(encoding="utf-8") == run.recipe_text
