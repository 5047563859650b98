"""Values that no run should hold: the page stays a page."""

import dataclasses
import math

import pytest
from drawn_runs import HOSTILE, make_run
from test_report import Page

import evocity
from evocity.analysis.page import Page as RunPage
from evocity.report import html, write_report
from evocity.report.html import html_of
from evocity.store import RunLog


@pytest.fixture(autouse=True)
def _no_scenes(monkeypatch):
    """Plans stand in their place: to draw a scene takes longer than all else of a page."""
    monkeypatch.setattr(html, "_scene", html._plan)


def test_whatever_stands_in_place_of_a_number_is_text(tmp_path, monkeypatch):
    folder = make_run(tmp_path / "run")
    facts = RunPage(evocity.open_run(folder))
    state = RunLog(folder).status() | {"births": HOSTILE, "failures": HOSTILE}
    monkeypatch.setattr(RunLog, "status", lambda run: state | {"generation": HOSTILE})
    _ = facts.keep, facts.parents, facts.aims, facts.tables  # read while the header is its own
    facts.run.header = dataclasses.replace(facts.run.header, seed=HOSTILE)
    page = Page(html_of(facts))
    assert page.scripts == 2  # our own, and the data
    assert page.words.count(HOSTILE) == 4
    figures = page.data["document"]["summary"]["figures"]
    assert [one["value"] for one in figures].count(HOSTILE) == 4


@pytest.mark.parametrize(
    "told", [10**400, True, float("nan"), "1", [1], {"a": 1}, None, -(10**400), float("inf")]
)
def test_hostile_bounds_are_none(tmp_path, told):
    folder = make_run(tmp_path / "run")
    facts = RunPage(evocity.open_run(folder))
    name = facts.run.header.measures[0]
    stated = {"name": name, "min": told, "max": told, "target": told, "objective": "a\n\x1b[31mb"}
    facts.run.provenance["fitness"] = [stated, {"name": [name]}, 3]
    facts.run.columns.__dict__.pop("aims", None)
    aim = facts.run.columns.aims[0]
    assert (aim.target, aim.low, aim.high) == (None, None, None)
    assert aim.total == "a[31mb"
    assert facts.run.columns.feasible.all()
    assert Page(html_of(facts)).scripts == 2


def test_cards_hold_text_alone(tmp_path):
    facts = RunPage(evocity.open_run(make_run(tmp_path / "run")))
    card = facts.keep[0]
    hostile = dict.fromkeys(("role", "why", "scarce", "operator", "command"), HOSTILE)
    card |= hostile | {"generation": HOSTILE, "parents": [HOSTILE]}
    page = Page(html_of(facts))
    assert page.scripts == 2
    assert "".join(page.cards[f"keep-{card['id']}"]).count(HOSTILE) == 7
    assert all(source.startswith("data:image/png") for source in page.fetched)


@pytest.mark.parametrize("huge", [1e308, -1.7e308, float("inf"), float("nan")])
def test_huge_values_are_numbers_or_nothing(tmp_path, huge):
    facts = RunPage(evocity.open_run(make_run(tmp_path / "run")))
    for one in facts.run.columns.history:
        one["hypervolume"] = huge
    (curve,) = [one for one in facts.curves if one["group"] == "hypervolume"]
    assert curve["values"] == [huge if math.isfinite(huge) else None] * 3
    (row, *_) = facts.tables[-1]["rows"]
    assert row[3] == (huge if math.isfinite(huge) else None)
    assert Page(html_of(facts)).data["document"]["curves"]


def test_a_deeply_nested_recipe_is_no_recipe(tmp_path):
    folder = make_run(tmp_path / "run", recipe="a = " + "[" * 3000)
    assert write_report(folder).is_file()
