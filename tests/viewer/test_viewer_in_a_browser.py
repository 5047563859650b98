"""The page of a view in chromium without a window: one filter, what is chosen, what is drawn."""

import contextlib
import json
import time
from collections.abc import Iterator

import numpy as np
import pytest

pytest.importorskip("anywidget")
pytest.importorskip("playwright.sync_api")

from chromium import BROWSER
from served_page import page_of, served

from evocity.viewer.sheet import Sheet
from evocity.viewer.table import Column, Table
from evocity.viewer.widget import Widget

pytestmark = pytest.mark.skipif(BROWSER is None, reason="chromium is not there")

HOSTILE = "<img src=x onerror='window.hacked=1'><script>window.hacked=1</script>\"'&${1}"
COUNT = 900
#: Parts of a page: births to keep, curves, tables, and parents of the births, which have even ids.
PARTS = {
    "keep": [
        {"id": n, "role": "compromise", "why": f"Why {HOSTILE}", "gave_up": "", "scarce": "",
         "command": f"evocity decode RUN --id {n}", "feasible": True,
         "values": {"density": 0.5, "height": 7, "crumbs": 2, "gone": None},
         "shares": [{"city": "A", "share": 0.25, "built": 0.005, "colour": "#123456"}]}
        for n in (8, 4)
    ],
    "curves": [
        {"name": "density", "title": "best density", "unit": "", "group": "goal", "target": 0.5,
         "generations": [0, 1, 2], "values": [0.1, None, 0.9]},
        {"name": "cover", "title": "births that break cover", "unit": "share", "group": "guard",
         "target": None, "generations": [0, 1, 2], "values": [0.0, 0.0, None]},
    ],
    "tables": [{"title": "errors", "headings": ["error", "births"], "note": "",
                "rows": [[HOSTILE, 3], [None, 0.5]]}],
    "lineage": {
        "ids": list(range(0, 2 * COUNT, 2)),
        "generations": [n // 100 for n in range(COUNT)],
        "counts": [0, 0, *[2] * (COUNT - 2)],
        "parents": [parent for n in range(2, COUNT) for parent in (2 * (n - 1), 2 * (n // 2))],
    },
}  # fmt: skip


def births(count: int = COUNT) -> Table:
    """Four measures, one with ties, one with a target, some without a value; some failed."""
    rng = np.random.default_rng(5)
    first = rng.normal(size=count)
    with_gaps = np.where(rng.random(count) < 0.1, np.nan, rng.normal(size=count))
    columns = (
        Column("density", first.astype(np.float32), sign="↑", goal="max", wanted="more is better"),
        Column("crumbs", np.round(-first + rng.normal(size=count)).astype(np.float32), goal="min"),
        Column("cover", with_gaps.astype(np.float32), sign="→0.5", target=0.5),
        Column("height", rng.random(count).astype(np.float32), unit="m", sign="≤9"),
        Column.of_words("operator", rng.choice(["mutation", "fusion", "relocation"], count)),
        Column.of_words("status", np.where(np.arange(count) % 7, "ok", "timeout")),
        Column.of_flags("feasible", rng.random(count) < 0.8),
        Column("id", 2 * np.arange(count, dtype=np.float32)),
    )
    return Table(2 * np.arange(count), columns)  # no odd ids


def pictures(ids: list[int], side: int) -> Sheet:
    """Of each birth a colour of its own: red tells which one it is."""
    lacking = {one: f"timeout: {HOSTILE}" for one in ids if one // 2 % 7 == 0}
    colours = {n: np.full((4, 4, 3), (n % 256, 200, 30), np.uint8) for n in ids if n not in lacking}
    return Sheet.of(colours, lacking)


def widget(
    table: Table, axes: tuple[str, ...] = ("density", "crumbs", "cover", "height")
) -> Widget:
    told = {"title": "run night", "credit": "© them", "highest": 35, "ratio": 1}
    shown = [{"name": name, "turned": name == "crumbs"} for name in axes]
    order = {"name": axes[0], "reversed": False}
    return Widget(page_of(table, told, pictures, **PARTS), axes=shown, order=order)


@pytest.fixture(scope="module")
def kept(browser) -> Iterator:
    """A page of a browser, for one test after the other."""
    with contextlib.closing(browser.new_page()) as page:
        yield page


@pytest.fixture
def opened(kept):
    """Opens the page of a widget; afterwards the console must have been silent, and nothing asked
    of another host."""
    said, asked, own = [], [], ["blob:", "data:", "about:blank"]
    heard = {
        "console": lambda message: said.append(message.text),
        "pageerror": lambda error: said.append(str(error)),
        "request": lambda request: asked.append(request.url),
    }

    with contextlib.ExitStack() as stack:

        def open_page(shown: Widget, width: int = 900, height: int = 1100):
            address = stack.enter_context(served(shown))
            stack.callback(kept.goto, "about:blank")
            own.append(address)
            kept.set_viewport_size({"width": width, "height": height})
            kept.goto(address)
            until(kept, "window.view !== undefined")
            return kept

        for name, act in heard.items():
            kept.on(name, act)
            stack.callback(kept.remove_listener, name, act)
        stack.callback(kept.mouse.up)  # of a test that failed as it pressed
        yield open_page
    assert said == []
    assert [url for url in asked if not url.startswith(tuple(own))] == []


def until(page, condition: str) -> None:
    """Wait for a condition: under this policy the page evaluates no text by itself."""
    end = time.monotonic() + 120
    while not page.evaluate(f"() => Boolean({condition})"):
        assert time.monotonic() < end, condition
        time.sleep(0.02)


def saved(page) -> dict:
    """What the page has told its model in all."""
    return page.evaluate("Object.assign({}, ...view.model.saved)")


def frames(page) -> None:
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def draw_along(page, place: int, start: float, stop: float, axes: int = 4) -> None:
    """Draw with the pointer along an axis, px from the upper end of the lines."""
    box = page.locator(".evocity-lines").bounding_box()
    x = box["x"] + box["width"] / axes * (place + 0.5)
    page.mouse.move(x, box["y"] + start)
    page.mouse.down()
    page.mouse.move(x, box["y"] + (start + stop) / 2)
    page.mouse.move(x, box["y"] + stop)
    page.mouse.up()
    frames(page)


def shown_ids(page) -> list[int]:
    """The ids that the list has in view."""
    labels = page.locator("[role=option]").evaluate_all("all => all.map((one) => one.ariaLabel)")
    return [int(one.split(",")[0]) for one in labels]


@pytest.mark.slow
def test_only_what_is_in_view_is_asked_for_and_it_is_drawn(opened):
    page = opened(widget(births()))
    until(page, "view.model.sent.length > 0")
    page.wait_for_timeout(300)
    sent = page.evaluate("view.model.sent")
    asked = [one for message in sent for one in message["tiles"]]
    assert asked == shown_ids(page)
    assert len(asked) < 60
    colours = page.evaluate(
        """() => {
          const canvas = document.querySelector(".evocity-spacer canvas"), wide = canvas.width;
          const { data } = canvas.getContext("2d").getImageData(0, 0, wide, canvas.height);
          return [...document.querySelectorAll("[role=option]")].slice(0, 16).map((one) => {
            const at = 4 * ((parseInt(one.style.top) + 40) * wide + parseInt(one.style.left) + 48);
            return [...data.slice(at, at + 3)];
          });
        }"""
    )
    for one, colour in zip(shown_ids(page), colours, strict=False):
        if one // 2 % 7:
            assert colour == [one % 256, 200, 30]
    page.locator(".evocity-tiles").evaluate("one => { one.scrollTop = 5000; }")
    until(page, "view.model.sent.length > 1")
    more = [one for message in page.evaluate("view.model.sent") for one in message["tiles"]]
    assert len(more) == len(set(more)) < 140  # nobody twice, nobody who was passed by


@pytest.mark.slow
def test_one_filter_in_both_views_and_in_python(opened):
    table = births()
    shown = widget(table)
    page = opened(shown)
    draw_along(page, 0, 40, 110)
    draw_along(page, 0, 150, 190)  # another one on the same axis
    draw_along(page, 3, 30, 130)
    brushes = saved(page)["brushes"]
    assert [len(brushes[name]) for name in ("density", "height")] == [2, 1]
    kept = table.matches(brushes)
    assert 0 < kept.sum() < COUNT
    assert (
        page.locator(".evocity-count").inner_text()
        == f"{kept.sum()} of {COUNT} births pass the filter, 0 chosen"
    )
    rows = table.row_order("density")
    assert shown_ids(page) == table.ids[rows[kept[rows]]][: len(shown_ids(page))].tolist()
    draw_along(page, 0, 70, 90)  # carried along the axis
    moved = saved(page)["brushes"]["density"]
    assert np.diff(moved[1]) == pytest.approx(np.diff(brushes["density"][1]), rel=1e-6)
    assert moved[1][1] < brushes["density"][1][1]
    draw_along(page, 0, 90, 90)  # pressed: taken away
    assert len(saved(page)["brushes"]["density"]) == 1
    page.get_by_role("button", name="clear filter").click()
    assert saved(page)["brushes"] == {}


def test_page_and_python_order_and_filter_alike(opened):
    table = births()
    page = opened(widget(table))
    orders = page.evaluate(
        """async () => {
          const { Births } = await import("/module.js");
          const births = new Births(view.model.get("about"), view.model.get("births"));
          const all = {};
          for (const { name } of births.columns) {
            for (const reversed of [false, true]) {
              all[`${name} ${reversed}`] = [...births.rowOrder({ name, reversed })];
            }
          }
          return all;
        }"""
    )
    for told, rows in orders.items():
        name, is_reversed = told.split()
        assert rows == table.row_order(name, is_reversed == "true").tolist(), told
    some = [
        {"cover": [[-0.5, 0.25]], "operator": ["fusion", "mutation"]},
        {"crumbs": [[1, 1], [-2, -1]], "status": ["ok"]},
        {"cover": [[-100, 100]]},
        {"operator": []},
    ]
    kept = page.evaluate(
        """async (some) => {
          const { Births } = await import("/module.js");
          const births = new Births(view.model.get("about"), view.model.get("births"));
          return some.map((brushes) => [...births.matches(brushes)]);
        }""",
        some,
    )
    assert kept == [table.matches(brushes).astype(int).tolist() for brushes in some]


@pytest.mark.slow
def test_births_are_chosen_by_pointer_and_keys(opened):
    page = opened(widget(births()))
    ids = shown_ids(page)
    options = page.locator("[role=option]")
    options.nth(1).click()
    assert saved(page)["chosen"] == [ids[1]]
    options.nth(4).click(modifiers=["Shift"])
    assert saved(page)["chosen"] == ids[1:5]
    options.nth(2).click(modifiers=["Control"])
    options.nth(9).click(modifiers=["Control"])
    assert saved(page)["chosen"] == [ids[1], *ids[3:5], ids[9]]
    gallery = page.get_by_role("listbox")
    gallery.focus()
    page.keyboard.press("Escape")
    assert saved(page)["chosen"] == []
    for key in ("Home", "ArrowRight", "ArrowDown", "Space"):
        page.keyboard.press(key)
    tops = options.evaluate_all("all => all.map((one) => one.style.top)")
    across = tops.count(tops[0])
    assert saved(page)["chosen"] == [ids[1 + across]]
    page.keyboard.press("Shift+ArrowRight")
    assert saved(page)["chosen"] == ids[1 + across : 3 + across]
    page.keyboard.press("End")
    active = page.locator(f"#{gallery.get_attribute('aria-activedescendant')}")
    assert (
        active.get_attribute("aria-posinset") == active.get_attribute("aria-setsize") == str(COUNT)
    )
    assert active.is_visible()
    page.keyboard.press("Control+a")
    assert len(saved(page)["chosen"]) == COUNT
    assert page.locator("[role=option][aria-selected=false]").count() == 0


def test_a_press_is_a_click_though_pictures_arrive_meanwhile(opened):
    page = opened(widget(births()))
    option = page.locator("[role=option]").nth(3)
    ids, box = shown_ids(page), option.bounding_box()
    page.mouse.move(box["x"] + 20, box["y"] + 20)
    page.mouse.down()
    page.evaluate("document.querySelector('.evocity-tiles').dispatchEvent(new Event('scroll'))")
    frames(page)
    page.mouse.up()
    assert saved(page)["chosen"] == [ids[3]]


def test_what_python_sets_is_seen(opened):
    table = births()
    page = opened(widget(table))
    page.evaluate(
        """() => {
          view.model.set("brushes", { operator: ["fusion"] });
          view.model.set("order", { name: "height", reversed: true });
          view.model.set("chosen", [2, 8]);
          view.model.set("axes", [{ name: "operator", turned: false }, { name: "height" }]);
        }"""
    )
    kept = table.matches({"operator": ["fusion"]})
    told = f"{kept.sum()} of {COUNT} births pass the filter, 2 chosen"
    assert page.locator(".evocity-count").inner_text() == told
    rows = table.row_order("height", True)
    assert shown_ids(page)[:20] == table.ids[rows[kept[rows]]][:20].tolist()
    assert page.locator(".evocity-head").all_inner_texts()[0].startswith("operator")
    assert page.get_by_label("order").input_value() == "height"
    assert page.evaluate("view.model.saved") == []  # it does not tell what it was told


@pytest.mark.slow
def test_axes_are_carried_turned_hidden_and_added(opened):
    page = opened(widget(births()))
    heads = page.locator(".evocity-head")
    box = heads.nth(0).bounding_box()
    page.mouse.move(box["x"] + 30, box["y"] + 10)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 10)
    page.mouse.move(box["x"] + 30 + 2 * (box["width"] + 4), box["y"] + 10)
    page.mouse.up()
    names = [one["name"] for one in saved(page)["axes"]]
    assert names == ["crumbs", "cover", "density", "height"]
    assert page.locator(".evocity-panel").is_hidden()  # carried, not pressed
    heads.nth(1).focus()
    page.keyboard.press("Enter")
    panel = page.get_by_role("group", name="axis cover")
    for name in ("reverse", "move left"):
        panel.get_by_role("button", name=name).focus()
        page.keyboard.press("Enter")
    assert saved(page)["axes"][:2] == [
        {"name": "cover", "turned": True},
        {"name": "crumbs", "turned": True},
    ]
    panel.get_by_label("cover from, filter range 1").fill("-0.25")
    panel.get_by_label("cover to, filter range 1").fill("0.5")
    page.keyboard.press("Tab")
    panel.get_by_label("cover from, filter range 2").fill("1")
    # the page keeps the lower first
    panel.get_by_label("cover to, filter range 2").fill("0.75")
    page.keyboard.press("Tab")
    assert saved(page)["brushes"] == {"cover": [[-0.25, 0.5], [0.75, 1]]}
    panel.get_by_role("button", name="hide").click()
    assert [one["name"] for one in saved(page)["axes"]] == ["crumbs", "density", "height"]
    assert page.locator(".evocity-panel").is_hidden()
    page.get_by_label("add axis").select_option("operator")
    assert saved(page)["axes"][-1] == {"name": "operator", "turned": False}
    heads.nth(3).click()
    page.get_by_label("fusion").check()
    assert saved(page)["brushes"]["operator"] == ["fusion"]
    page.keyboard.press("Escape")
    assert page.evaluate("document.activeElement.classList.contains('evocity-head')")


def test_words_of_an_axis_are_taken_by_the_pointer(opened):
    page = opened(widget(births(), ("operator", "density")))
    draw_along(page, 0, 180, 180, axes=2)  # the lowest of three
    assert saved(page)["brushes"] == {"operator": ["fusion"]}
    draw_along(page, 0, 30, 120, axes=2)
    assert saved(page)["brushes"] == {"operator": ["fusion", "mutation", "relocation"]}
    draw_along(page, 0, 180, 180, axes=2)
    assert saved(page)["brushes"] == {"operator": ["mutation", "relocation"]}


def test_failed_births_are_shown_as_failed_with_their_reason(opened):
    page = opened(widget(births()))
    page.evaluate("view.model.set('order', { name: 'status', reversed: true })")
    first = page.locator("[role=option]").first
    assert "failed: timeout" in first.get_attribute("aria-label")
    until(page, "view.model.sent.length > 0")
    first.click()
    until(page, "document.querySelector('.evocity-detail').textContent.includes('timeout: ')")
    assert HOSTILE in page.locator(".evocity-detail").inner_text()


def test_no_text_of_a_stranger_becomes_a_part_of_the_page(opened):
    plain = births(60)
    named = (
        Column(HOSTILE, plain.columns[0].values, unit=HOSTILE, sign=HOSTILE, wanted=HOSTILE),
        Column.of_words("operator", np.array([HOSTILE, "__proto__", "constructor"] * 20)),
        Column("__proto__", plain.columns[3].values),
        *plain.columns[5:],
    )
    shown = widget(Table(plain.ids, named), (HOSTILE, "operator", "__proto__"))
    shown.about = shown.about | {"title": HOSTILE, "credit": HOSTILE}
    page = opened(shown)
    for place in range(3):
        page.locator(".evocity-head").nth(place).click()
    page.get_by_label("order").select_option("operator")
    page.locator("[role=option]").nth(3).click()
    page.wait_for_timeout(200)
    assert page.evaluate("window.hacked") is None
    assert page.locator(".evocity-view script, .evocity-view img").count() == 0
    assert HOSTILE in page.locator(".evocity-row").first.inner_text()
    draw_along(page, 2, 40, 120, axes=3)
    assert not page.locator(".evocity-count").inner_text().startswith("60 ")


def test_new_births_are_shown_when_a_run_goes_on(opened):
    shown = widget(births(500))
    page = opened(shown)
    page.evaluate("view.model.set('chosen', [4, 998])")
    more = births()
    facts = {"title": "run night", "credit": "", "highest": 35, "ratio": 1}
    shown.show(page_of(more, facts, pictures))
    page.evaluate("view.model.renew()")
    assert f"of {COUNT} births pass" in page.locator(".evocity-count").inner_text().replace(
        "\u202f", ""
    )
    assert shown_ids(page)[:10] == more.ids[more.row_order("density")[:10]].tolist()


@pytest.mark.parametrize(("width", "axes"), [(420, 4), (900, 2), (900, 12)])
def test_nothing_is_cut_or_lies_over_another(opened, width, axes):
    plain = births()
    long = "a_measure_with_a_rather_long_name"
    extra = [Column(f"{long}_{k}", plain.columns[k % 4].values, unit="m") for k in range(12)]
    table = Table(plain.ids, (*extra, *plain.columns))
    page = opened(widget(table, tuple(one.name for one in extra[:axes])), width)
    page.locator(".evocity-head").nth(1).click()
    page.locator("[role=option]").nth(1).click()
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    cut = page.evaluate(
        """() => [...document.querySelectorAll("button, select")]
          .filter((one) => one.offsetParent && !one.closest(".evocity-axes"))
          .filter((one) => one.scrollWidth > one.clientWidth + 1)
          .map((one) => one.textContent)"""
    )
    assert cut == []
    boxes = page.evaluate(
        """() => [...document.querySelectorAll("button, select, input")]
          .filter((one) => one.offsetParent).map((one) => one.getBoundingClientRect())
          .map(({ left, top, right, bottom }) => [left, top, right, bottom])"""
    )
    for k, (left, top, right, bottom) in enumerate(boxes):
        for other in boxes[k + 1 :]:
            apart = right <= other[0] or other[2] <= left or bottom <= other[1] or other[3] <= top
            assert apart, (boxes[k], other)


@pytest.mark.parametrize("width", [420, 700, 1400])
def test_the_head_of_an_axis_breaks_no_word_and_cuts_no_sign(opened, width):
    plain = births()
    names = ["autosimilarity", "gsi", "salingaros_buildings", "repetition", "fabric_distance"]
    names += ["alignment", "small_buildings_per_hectare", "a_word_as_long_as_" + "x" * 60]
    signs = ["↑", "≥0.179 ≤0.668", "↓", "→0.7285", "", "≤1", "≤0.694", "≥0"]
    columns = [
        Column(one, plain.columns[k % 4].values, sign=signs[k]) for k, one in enumerate(names)
    ]
    page = opened(widget(Table(plain.ids, tuple(columns)), tuple(names)), width)
    broken = page.evaluate(
        r"""() => [...document.querySelectorAll(".evocity-name")].flatMap((one) =>
          [...one.textContent.matchAll(/\S+/g)].filter(({ 0: word, index }) => {
            const range = document.createRange();
            range.setStart(one.firstChild, index);
            range.setEnd(one.firstChild, index + word.length);
            return new Set([...range.getClientRects()].map(({ top }) => top)).size > 1;
          }).map(([word]) => word))"""
    )
    assert broken == ["x" * 60]
    cut = """() => [...document.querySelectorAll(".evocity-sign")]
      .filter((one) => one.scrollWidth > one.clientWidth).map((one) => one.textContent)"""
    assert page.evaluate(cut) == []
    lines = """() => [...document.querySelectorAll(".evocity-name")]
      .filter((one) => one.scrollHeight > one.clientHeight).map((one) => one.textContent)"""
    assert [one[-3:] for one in page.evaluate(lines)] == ["xxx"]  # names of three lines
    middles = page.evaluate(
        """() => [...document.querySelectorAll(".evocity-head")].map((one) =>
          parseFloat(one.style.left) + parseFloat(one.style.width) / 2)"""
    )
    box = page.locator(".evocity-lines").bounding_box()
    page.mouse.move(box["x"] + middles[2], box["y"] + 60)  # each axis stands below its head
    page.mouse.down()
    page.mouse.move(box["x"] + middles[2], box["y"] + 90, steps=3)
    page.mouse.up()
    assert list(saved(page)["brushes"]) == ["salingaros_buildings"]


def test_density_counts_every_line(opened):
    page = opened(widget(births()))
    sums = page.evaluate(
        """async () => {
          const { crossings, levels } = await import("/density.js");
          const column = (of) => ({
            values: Float32Array.from({ length: 5000 }, (_, k) => of(k) % 97),
            share: (value) => (value === 5 ? NaN : value / 96),
          });
          const left = levels(column((k) => k), false), right = levels(column((k) => 7 * k), true);
          const mask = Uint8Array.from({ length: 5000 }, (_, k) => k % 3 > 0);
          const wide = 300, tall = 190, counts = crossings(left, right, mask, wide, tall);
          const known = left.reduce((sum, level, k) =>
            sum + (mask[k] && level !== 255 && right[k] !== 255), 0);
          const columns = Array.from({ length: wide }, (_, x) =>
            counts.subarray(x * tall, (x + 1) * tall).reduce((a, b) => a + b));
          return { known, columns };
        }"""
    )
    assert set(sums["columns"]) == {sums["known"]}  # none of them is steep: a pixel each


def test_modules_one_by_one_are_the_same_page(opened):
    page = opened(widget(births()))
    told = page.evaluate(
        """async () => {
          const names = ["viewer", "gallery", "births", "tiles", "tabs"];
          const parts = await Promise.all(names.map((one) => import(`/${one}.js`)));
          const { Viewer, Gallery, Births, Tiles, Tabs } = Object.assign({}, ...parts);
          const whole = await import("/module.js"), { VIEWS } = await import("/views.js");
          return [typeof parts[0].default.render, VIEWS.map(({ name }) => name),
            ...[Viewer, Gallery, Births, Tiles, Tabs]
              .map((one) => whole[one.name].toString() === one.toString())];
        }"""
    )
    names = ["keep", "axes", "scatter", "grid", "curves", "pedigree", "tables"]
    assert told == ["function", names, *[True] * 5]


def tab(page, name: str) -> None:
    page.get_by_role("tab", name=name, exact=True).click()


@pytest.mark.slow
def test_births_to_keep_are_shown_with_reasons_and_chosen(opened):
    page = opened(widget(births()))
    tab(page, "which to keep")
    until(page, "document.querySelectorAll('.evocity-kept li').length === 2")
    first = page.locator(".evocity-kept li").first
    assert first.locator("h2").inner_text().endswith("ompromise, birth 8")
    for text in (f"Why {HOSTILE}", "A 25 % of the map, 0.5 % of the buildings", "RUN --id 8"):
        assert text in first.inner_text()
    facts = first.locator(".evocity-fact").all_inner_texts()
    assert [one.split() for one in facts] == [
        ["density", "↑", "0.5"],
        ["crumbs", "2"],
        ["height", "≤9", "7", "m"],  # a measure that has only bounds
    ]
    page.get_by_role("button", name="show birth 4").click()
    assert saved(page)["chosen"] == [4]
    page.get_by_role("button", name="choose these births").click()
    assert saved(page)["chosen"] == [8, 4]
    assert page.evaluate("window.hacked") is None


@pytest.mark.slow
def test_curves_say_their_ends_in_words(opened):
    page = opened(widget(births()))
    tab(page, "curves")
    until(page, "document.querySelectorAll('.evocity-curves svg').length === 1")
    label = page.locator(".evocity-curves svg").get_attribute("aria-label")
    assert label == ("best density: 0.1 in generation 0, 0.9 in generation 2; the target is 0.5")
    line = page.locator(".evocity-curve").get_attribute("d")
    assert (line.count("M"), line.count("L")) == (2, 0)  # a gap where no value is
    assert page.get_by_text("No birth broke the bounds of cover.").is_visible()


@pytest.mark.slow
def test_a_pedigree_shows_each_ancestor_once_above_its_children(opened):
    page = opened(widget(births()))
    tab(page, "pedigree")
    page.evaluate("view.model.set('chosen', [12])")
    nodes = page.locator(".evocity-pedigree .evocity-node")
    until(page, "document.querySelectorAll('.evocity-pedigree .evocity-node').length === 6")
    labels = nodes.evaluate_all("all => all.map((one) => one.ariaLabel)")
    assert labels[0] == "birth 12, 0 child-to-parent steps before the selected birth"
    tops = dict(zip(
        [int(one.split()[1].strip(",")) for one in labels],
        nodes.evaluate_all("all => all.map((one) => parseFloat(one.style.top))"),
        strict=True,
    ))  # fmt: skip
    lineage = PARTS["lineage"]
    ends = np.cumsum(lineage["counts"])
    for row in range(2, 7):  # birth 12 is in row 6
        for parent in lineage["parents"][ends[row] - 2 : ends[row]]:
            assert tops[parent] < tops[2 * row]
    assert "has 5 ancestors" in page.locator(".evocity-view").inner_text()
    nodes.nth(1).click()
    assert saved(page)["chosen"] == [int(labels[1].split()[1].strip(","))]


@pytest.mark.slow
def test_tables_show_the_passing_births_in_their_order(opened):
    table = births()
    page = opened(widget(table))
    tab(page, "tables")
    until(page, "document.querySelectorAll('.evocity-wide').length === 2")
    rows = page.locator(".evocity-wide").first.locator("tbody tr")
    ids = rows.evaluate_all("all => all.map((one) => Number(one.firstChild.textContent))")
    assert ids == table.ids[table.row_order("density")[:100]].tolist()
    assert page.get_by_text("800 more births pass the filter").is_visible()
    page.get_by_role("button", name="height", exact=True).click()
    assert saved(page)["order"] == {"name": "height", "reversed": False}
    ids = rows.evaluate_all("all => all.map((one) => Number(one.firstChild.textContent))")
    assert ids == table.ids[table.row_order("height")[:100]].tolist()
    page.get_by_role("button", name="height", exact=True).click()
    assert saved(page)["order"]["reversed"]
    other = page.locator(".evocity-wide").nth(1).locator("td").all_inner_texts()
    assert other == [HOSTILE, "3", "–", "0.5"]


#: Grounds of all visible drawings, and the line below the open tab.
GROUNDS = """() => {
  const seen = [...document.querySelectorAll(".evocity-view :is(canvas, svg)")];
  const tab = document.querySelector(".evocity-view [role=tab][aria-selected=true]");
  const grounds = seen.filter((one) => one.getBoundingClientRect().width)
    .map((one) => getComputedStyle(one).backgroundColor);
  return [[...new Set(grounds)], getComputedStyle(tab).borderBottomWidth];
}"""


@pytest.mark.slow
def test_colours_that_a_system_forces_leave_drawings_legible(opened):
    page = opened(widget(births()))
    page.emulate_media(forced_colors="active", color_scheme="dark")
    try:
        for name in ("axes", "scatter", "curves", "pedigree"):
            tab(page, name)
            frames(page)
            if name == "curves":
                until(page, "document.querySelectorAll('.evocity-curves svg').length === 1")
            assert page.evaluate(GROUNDS) == [["rgb(250, 248, 244)"], "4px"]
    finally:
        page.emulate_media(forced_colors="none", color_scheme="light")


def test_a_fault_of_a_view_stays_in_its_pane(opened):
    page = opened(widget(births()))
    page.evaluate("() => { view.model.send = () => { throw new Error('no kernel'); }; }")
    tab(page, "which to keep")
    until(page, "document.querySelector('.evocity-view').textContent.includes('no kernel')")
    tab(page, "axes")
    draw_along(page, 0, 40, 110)
    assert not page.locator(".evocity-count").inner_text().startswith("900 ")


def test_a_view_that_ends_leaves_nothing_behind(opened):
    page = opened(widget(births()))
    page.evaluate("view.end()")
    assert page.locator("#main *").count() == 0
    page.evaluate("view.model.set('brushes', { operator: ['fusion'] })")
    assert json.loads(page.evaluate("JSON.stringify(view.model.saved)")) == []
