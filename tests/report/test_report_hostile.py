"""Values that no run should hold: the page stays a page."""

import dataclasses

import numpy as np
import pytest
from test_report import HOSTILE, Page, make_run

import evocity
from evocity.report import summary, write_report
from evocity.report.html import page_of
from evocity.report.plots import Axis, Dots, curve, scatter
from evocity.report.shown_births import Shown, ShownBirths
from evocity.store import RunLog


def test_whatever_stands_in_place_of_a_number_is_text(tmp_path, monkeypatch):
    folder = make_run(tmp_path / "run")
    state = RunLog(folder).status() | {"births": HOSTILE, "failures": HOSTILE}
    monkeypatch.setattr(RunLog, "status", lambda run: state | {"generation": HOSTILE})
    monkeypatch.setattr(summary, "reasons", lambda run: "")
    shown = ShownBirths(evocity.open_run(folder))
    assert shown.living  # read while the header is the files' own
    assert shown.births.history
    assert len(shown.births)
    assert not shown.broken
    shown.run.header = dataclasses.replace(shown.run.header, seed=HOSTILE)
    page = Page(page_of(shown))
    assert page.scripts == 1  # our own
    assert page.words.count(HOSTILE) == 4


@pytest.mark.parametrize(
    "told", [10**400, True, float("nan"), "1", [1], {"a": 1}, None, -(10**400), float("inf")]
)
def test_hostile_bounds_are_none(tmp_path, told):
    folder = make_run(tmp_path / "run")
    shown = ShownBirths(evocity.open_run(folder))
    name = shown.run.header.measures[0]
    stated = {"name": name, "min": told, "max": told, "target": told, "objective": "a\n\x1b[31mb"}
    shown.run.provenance["fitness"] = [stated, {"name": [name]}, 3]
    aim = shown.births.aims[0]
    assert (aim.target, aim.low, aim.high) == (None, None, None)
    assert aim.total == "a[31mb"
    assert not shown.broken
    assert write_report(folder).is_file()


def test_cards_hold_text_alone(tmp_path):
    shown = ShownBirths(evocity.open_run(make_run(tmp_path / "run")))
    one = shown.shown[0]
    shown.__dict__["shown"] = [Shown(one.birth, HOSTILE, one.city)]
    object.__setattr__(one.birth, "generation", HOSTILE)
    object.__setattr__(one.birth, "parents", (HOSTILE,))
    page = Page(page_of(shown))
    assert page.scripts == 1
    assert HOSTILE in "".join(page.cards[f"i{one.birth.id}"])
    assert all(source.startswith("data:image/png") for source in page.fetched)


@pytest.mark.parametrize("huge", [1e308, 1.7e308, float("inf")])
def test_huge_values_are_left_out_of_plots(huge):
    values = np.array([1.0, -huge, huge, 2.0])
    for drawing in (
        scatter([Dots(values, values, "front")], Axis("x", target=huge), Axis("y")),
        curve([*values, None], Axis("y", target=-huge)),
    ):
        assert "inf" not in drawing
        assert "nan" not in drawing
    assert scatter([Dots(values, values, "front")], Axis("x"), Axis("y")).count("<circle") == 2


def test_a_deeply_nested_recipe_is_no_recipe(tmp_path):
    folder = make_run(tmp_path / "run", recipe="a = " + "[" * 3000)
    assert write_report(folder).is_file()
