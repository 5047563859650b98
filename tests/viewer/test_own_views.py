"""Three views of a user's own, a file each, in report, notebook and studio."""

import contextlib
import json
import re
import textwrap
import time
from pathlib import Path

import pytest

pytest.importorskip("anywidget")
pytest.importorskip("playwright.sync_api")

from chromium import BROWSER
from drawn_runs import told_run
from served_page import served

import evocity
from evocity.report import write_report
from evocity.studio import answers
from evocity.studio.server import running_server
from evocity.viewer import module_bundle

GUIDE = (Path(__file__).parents[2] / "docs" / "extending.md").read_text("utf-8")
#: The histogram of the guide, the counts of operators, the credit; two of them use the name BINS.
VIEWS = {
    "histogram": textwrap.dedent(re.findall(r"    ```js\n(.*?)    ```", GUIDE, re.S)[0]),
    "operators": """
import { countText, element } from "../elements.js";

const BINS = new Map();

export const view = {
  name: "operators", title: "operators", place: 81,
  suits: ({ births }) => births.byName.has("operator"),
  open(root, page, hands) {
    const list = element(root, "ul");
    return {
      update() {
        BINS.clear();
        const { words, values } = page.births.byName.get("operator");
        for (const row of page.rows) {
          BINS.set(words[values[row]], (BINS.get(words[values[row]]) || 0) + 1);
        }
        list.replaceChildren(...[...BINS].map(([word, count]) => {
          const text = `${word} ${countText(count)}`;
          const button = element(element(null, "li"), "button", "", text, { type: "button" });
          button.addEventListener("click", () => hands.brush({ operator: [word] }));
          return button.parentNode;
        }));
      },
    };
  },
};
""",
    "worth": """
import { element } from "../elements.js";

export const view = {
  name: "worth", title: "worth keeping", place: 5, suits: () => true,
  open(root, page, hands) {
    hands.part("keep").then((cards) => {
      root.textContent = cards.map(({ id, role }) => `${id} ${role}`).join("; ");
    });
    return {};
  },
};
""",
}  # fmt: skip
CACHED = (
    module_bundle._loaded,
    module_bundle.module,
    module_bundle.views_module,
    module_bundle.files,
    answers.page_files,
)


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """A package whose entry points name the views, as after its installation."""
    package, facts = tmp_path / "city_views", tmp_path / "city_views-1.0.dist-info"
    package.mkdir()
    facts.mkdir()
    (package / "__init__.py").write_text("raise SystemExit('nobody imports a package of views')\n")
    for name, text in VIEWS.items():
        (package / f"{name}.js").write_text(text)
    (package / "helped.js").write_text('import "./helper.js";\nexport const view = {};\n')
    (package / "empty.js").write_text("export default {};\n")
    lines = [f"{name} = city_views" for name in (*VIEWS, "lost", "axes", "helped", "empty")]
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: city-views\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text("[evocity.views]\n" + "\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    for one in CACHED:
        one.cache_clear()
    yield
    for one in CACHED:
        one.cache_clear()


def test_a_view_that_cannot_be_loaded_is_said_and_left_out(installed):
    assert {*VIEWS, "axes", "keep"} <= set(module_bundle.views())
    assert "lost" not in module_bundle.views()
    faults = module_bundle.view_faults()
    assert [fault.split()[1] for fault in faults] == ["lost", "axes", "helped", "empty"]
    assert "lost.js" in faults[0]
    assert "city_views" not in module_bundle.views()["axes"]


@pytest.mark.slow
@pytest.mark.skipif(BROWSER is None, reason="chromium is not there")
def test_three_views_of_a_file_each_are_in_all_faces(installed, browser, tmp_path):
    folder = told_run(tmp_path / "run", generations=4)
    run = evocity.open_run(folder)
    kept = "; ".join(f"{one.individual.id} {one.role}" for one in run.keep())
    order = run.view().page.table.row_order("compromise")
    with contextlib.ExitStack() as stack:
        report = write_report(folder, tmp_path / "report.html").as_uri()
        notebook = stack.enter_context(served(run.view().widget))
        studio = stack.enter_context(running_server(folder)).url
        for address in (report, notebook, studio):
            page, said = stack.enter_context(contextlib.closing(browser.new_page())), []
            page.on("console", lambda message, said=said: said.append(message.text))
            page.on("pageerror", lambda error, said=said: said.append(str(error)))
            page.goto(address)
            until(lambda page=page: page.get_by_text("plugin lost (city_views)").count() == 1)
            first = page.get_by_role("tab", name="worth keeping", exact=True)
            first.click()
            shown = page.locator(".evocity-view [role=tabpanel]:visible")
            until(lambda shown=shown: shown.inner_text() == kept)
            assert page.locator(".evocity-view [role=tab]").first.inner_text() == "worth keeping"
            page.get_by_role("tab", name="histogram").click()
            assert sum(map(int, shown.inner_text().split(":")[1].split())) == len(order)
            page.get_by_role("tab", name="operators", exact=True).click()
            page.get_by_role("button", name="source 2").click()
            until(lambda page=page: "2 of 24 births" in page.locator("output").first.inner_text())
            assert shown.inner_text().strip() == "source 2"
            assert said == []


def until(is_true) -> None:
    end = time.monotonic() + 120
    while not is_true():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_text_of_a_view_cannot_end_the_script_of_a_report(installed, tmp_path, monkeypatch):
    text = VIEWS["worth"].replace("; ", "</script><!--<script>; ")
    monkeypatch.setitem(module_bundle.views(), "worth", text)
    page = write_report(told_run(tmp_path / "run")).read_text("utf-8")
    assert page.count("</script>") == 2
    data = page.split('id="page">')[1].split("</script>")[0]
    assert json.loads(data)["document"]["schema"] == 1
