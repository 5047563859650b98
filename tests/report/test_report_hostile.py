"""Values that no run should hold: the page stays a page."""

import dataclasses

import numpy as np
import pytest
from test_report import HOSTILE, Page, make_run

from evocity.report import summary, write_report
from evocity.report.facts import Facts, Shown
from evocity.report.html import page_of
from evocity.report.plots import Axis, Dots, curve, scatter
from evocity.store import Run, open_run


def test_whatever_stands_in_place_of_a_number_is_text(tmp_path, monkeypatch):
    folder = make_run(tmp_path / "run")
    state = open_run(folder).status() | {"births": HOSTILE, "failures": HOSTILE}
    monkeypatch.setattr(Run, "status", lambda run: state | {"generation": HOSTILE})
    monkeypatch.setattr(summary, "reasons", lambda facts: "")
    facts = Facts(open_run(folder))
    assert facts.members  # read while the header is the files' own
    assert facts.told.history
    assert len(facts.told)
    assert not facts.broken
    facts.run.header = dataclasses.replace(facts.run.header, seed=HOSTILE)
    page = Page(page_of(facts))
    assert page.scripts == 1  # our own
    assert page.words.count(HOSTILE) == 4


@pytest.mark.parametrize(
    "told", [10**400, True, float("nan"), "1", [1], {"a": 1}, None, -(10**400), float("inf")]
)
def test_hostile_bounds_are_none(tmp_path, told):
    folder = make_run(tmp_path / "run")
    facts = Facts(open_run(folder))
    name = facts.run.header.measures[0]
    stated = {"name": name, "min": told, "max": told, "target": told, "objective": "a\n\x1b[31mb"}
    facts.run.provenance["fitness"] = [stated, {"name": [name]}, 3]
    aim = facts.told.aims[0]
    assert (aim.target, aim.low, aim.high) == (None, None, None)
    assert aim.total == "a[31mb"
    assert not facts.broken
    assert write_report(folder).is_file()


def test_cards_hold_text_alone(tmp_path):
    facts = Facts(open_run(make_run(tmp_path / "run")))
    one = facts.shown[0]
    facts.__dict__["shown"] = [Shown(one.birth, HOSTILE, one.city)]
    object.__setattr__(one.birth, "generation", HOSTILE)
    object.__setattr__(one.birth, "parents", (HOSTILE,))
    page = Page(page_of(facts))
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
