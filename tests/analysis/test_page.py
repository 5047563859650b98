"""The page of a run: plain values, the same numbers as the run has."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from drawn_runs import make_run, told_run

import evocity
from evocity.analysis.goals import planned_generations
from evocity.analysis.page import Page
from evocity.analysis.page.page import PARTS
from evocity.analysis.page.shortlist import best_of_last, shortlist_of
from evocity.analysis.page.summary import gain, summary_of
from evocity.analysis.page.tables import settings_of
from evocity.analysis.shortlist import choose_shortlist
from evocity.errors import EvocityError
from evocity.genome import VOID


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    return told_run(tmp_path_factory.mktemp("page") / "run", generations=6, names="ABCDEF")


def test_the_document_is_plain_json(told):
    document = Page(evocity.open_run(told)).document
    assert json.loads(json.dumps(document, allow_nan=False)) == document
    assert document["schema"] == 1
    assert set(document) == {"schema", "about", *PARTS}


def test_parts_have_names(told):
    page = Page(evocity.open_run(told))
    assert page.part("keep") is page.keep
    for name in ("kept", "__dict__", 3, ["keep"]):
        with pytest.raises(EvocityError, match="no part"):
            page.part(name)


def test_the_order_begins_with_the_compromise_and_ends_with_those_that_break_bounds(tmp_path):
    goals = [{"name": "gsi", "goal": "max"}, {"name": "fsi", "goal": "min", "max": 0.7}]
    folder = make_run(
        tmp_path / "run",
        generations=6,
        provenance={"fitness": goals},
        fails=lambda generation, slot: slot == 4,
    )
    run = evocity.open_run(folder)
    page = Page(run)
    assert (page.order, page.about["order"]["name"]) == ("compromise", "compromise")
    rows = page.table.row_order("compromise")
    assert page.table.ids[rows[0]] == run.compromise().id
    feasible = run.columns.feasible[rows]
    assert 0 < feasible.sum() < len(feasible)
    assert not (~feasible[:-1] & feasible[1:]).any()  # no birth that keeps all comes later
    ranks = page.table.column("compromise").values[rows]
    assert ranks[: feasible.sum()].tolist() == list(range(1, feasible.sum() + 1))
    assert np.isnan(ranks[feasible.sum() :]).all()


def test_without_goals_the_first_axis_orders(tmp_path):
    page = Page(evocity.open_run(make_run(tmp_path / "run")))
    assert (page.order, page.axes()[0]["name"]) == ("gsi", "gsi")
    assert page.shortlist == []
    assert [card["id"] for card in page.keep] == best_of_last(page.run, 3)


def test_births_to_keep_are_those_of_the_run(told):
    run = evocity.open_run(told)
    kept = run.keep()
    cards = Page(run).keep
    assert len(cards) > 1
    for card, one in zip(cards, kept, strict=True):
        birth = one.individual
        assert card["id"] == birth.id
        for name in ("role", "why", "gave_up", "scarce"):
            assert card[name] == getattr(one, name)
        assert card["values"] == birth.scores
        assert card["alive"] == birth.alive
        assert card["command"].startswith(f"evocity decode RUN --id {birth.id} ")
        assert {part["city"]: part["built"] for part in card["shares"] if part["built"]} == (
            pytest.approx(birth.ancestry(built=True), rel=1e-6)
        )
        assert sum(part["share"] for part in card["shares"]) == pytest.approx(1)


def test_no_near_duplicate_fills_up_the_births_to_keep(tmp_path):
    """There are two cities and their copies: beside the best by number, one of each at most."""
    run = evocity.open_run(told_run(tmp_path / "run", generations=20))
    kept = shortlist_of(run)
    assert len(run.archive) > 5
    kinds = [one.individual.id % 2 for one in kept if one.role == "of another kind"]
    best = [one.individual.id % 2 for one in kept if one.role != "of another kind"]
    assert len(kinds) == len({0, 1} - set(best))


def test_the_best_by_a_goal_that_looks_like_another_gives_its_place_to_another_look(tmp_path):
    names = ("gsi", "fsi", "mean_height")
    goals = [{"name": name, "goal": "max"} for name in names]
    how = {"measures": names, "names": "ABCD", "generations": 20, "population": 8}
    run = evocity.open_run(make_run(tmp_path / "run", provenance={"fitness": goals}, **how))
    kept, every = run.keep(4), run.keep(50)  # births of equal slots, modulo 4, look alike
    assert {one.individual.id % 4 for one in kept} == {0, 1, 2, 3}
    roles = {role for one in every for role in one.role.split(", ") if role.startswith("best")}
    left = roles - {role for one in kept for role in one.role.split(", ")}
    assert left
    for role in left:
        (best,) = [one.individual for one in every if role in one.role]
        (like,) = [one for one in kept if one.individual.id % 4 == best.id % 4]
        assert f"Birth {best.id} looks like it, and is the best by " in like.why
        assert f"{role.split()[1]} ({best.scores[role.split()[1]]:.4g}" in like.why


def test_aims_have_the_range_of_the_archive_and_the_values_of_the_parents(told):
    run = evocity.open_run(told)
    gsi = [row["fitness.gsi"] for row in run.archive.births.to_pylist()]
    (aim,) = [one for one in Page(run).aims if one["name"] == "gsi"]
    assert aim["archive"] == [min(gsi), max(gsi)]
    assert aim["parents"] == [run[n].scores["gsi"] for n in range(6)]
    assert (aim["sign"], aim["wanted"]) == ("↑", "more is better")


def test_curves_are_the_series_of_the_run_and_the_cost_of_its_guards(tmp_path):
    goals = [{"name": "gsi", "goal": "max"}, {"name": "fsi", "goal": "bounds", "max": 0.5}]
    run = evocity.open_run(make_run(tmp_path / "run", provenance={"fitness": goals}))
    curves = {(one["group"], one["name"]): one for one in Page(run).curves}
    assert curves["hypervolume", "hypervolume"]["values"] == [1.0, 2.0, 3.0]
    assert curves["goal", "gsi"]["values"] == run.series["best.gsi"].tolist()
    scores = run.scores
    broken = (scores["fsi"] > 0.5).groupby(scores["generation"]).mean()
    assert curves["guard", "fsi"]["values"] == broken.tolist()
    assert ("guard", "gsi") not in curves


def test_parents_are_the_source_cities_with_the_values_of_their_codes(told):
    run = evocity.open_run(told)
    parents = Page(run).parents
    assert [one["name"] for one in parents] == list("ABCDEF")
    for number, one in enumerate(parents):
        assert one["values"] == run[number].scores
        assert one["credit"] == f"© the people of {one['name']}"


def test_lineage_has_the_parents_of_every_birth(told):
    run = evocity.open_run(told)
    lineage = Page(run, of="gsi > 0.5").lineage
    ends = np.cumsum(lineage["counts"])
    for row, birth in enumerate(run):
        parents = lineage["parents"][ends[row] - lineage["counts"][row] : ends[row]]
        assert (lineage["ids"][row], lineage["generations"][row]) == (birth.id, birth.generation)
        assert parents == [one.id for one in birth.parents]


def test_the_best_of_the_last_generation_differ(tmp_path):
    """Of twins the better is shown; where too few differ, the best of the others are."""
    run = evocity.open_run(make_run(tmp_path / "run", measures=("gsi",), population=8))
    living = run.individuals(run.members(2)["id"].to_pylist())
    alive = sorted(living, key=lambda birth: -birth.values["gsi"])
    of = [birth.id % 2 for birth in alive]  # there are two cities, and their copies
    first = [0, of.index(1 - of[0])]
    assert set(best_of_last(run, 2)) == {alive[place].id for place in first}
    three = [*first, next(n for n in range(8) if n not in first)]
    assert set(best_of_last(run, 3)) == {alive[place].id for place in three}


@pytest.mark.parametrize(
    ("stated", "count"),
    [({"apart": 0}, 3), ({"apart": 1}, 3), ({}, 3), ({"apart": -1}, 3), ({"apart": "x"}, 3)],
)
def test_any_recipe_says_how_far_they_are_apart(tmp_path, monkeypatch, stated, count):
    run = evocity.open_run(make_run(tmp_path / "run", generations=1))
    monkeypatch.setattr("evocity.analysis.page.shortlist.recipe_of", lambda run: {"search": stated})
    assert len(best_of_last(run, 3)) == count


@pytest.mark.parametrize(
    ("volumes", "failed", "said"),
    [
        ([1.0, 3.0], 0, "+200 % over the first population"),
        ([0.02, 3.0], 0, "0.02 in the first population"),
        ([0.0, 3.0], 0, "0 in the first population"),
        ([1.0, 3.0], 4, "1 in the first population"),
        ([1.0, None], 0, ""),
        ([1.0], 0, ""),
    ],
)
def test_the_gain_is_a_share_where_a_share_tells(tmp_path, volumes, failed, said):
    fails = {"fails": lambda generation, slot: generation == 0 and slot < failed}
    births = evocity.open_run(make_run(tmp_path / "run", **fails)).columns
    births.__dict__["history"] = [{"hypervolume": volume} for volume in volumes]
    assert gain(births) == said


def test_what_replaced_the_recipe_stands_among_the_settings(tmp_path):
    noted = {"recipe": {"overrides": {"run.seed": 8, "run.generations": 40}}}
    run = evocity.open_run(make_run(tmp_path / "run", provenance=noted))
    assert planned_generations(run) == 40
    (replaced,) = [one for one in settings_of(run) if "replaced" in one["title"]]
    assert replaced["rows"] == [["run.seed", "8"], ["run.generations", "40"]]
    plain = settings_of(evocity.open_run(make_run(tmp_path / "plain")))
    assert not [one for one in plain if "replaced" in one["title"]]


def test_targets_of_the_recipe_or_of_a_city_to_be_like_are_told(tmp_path):
    recipe = '[[fitness]]\nname = "gsi"\ntarget = 0.35\n[[fitness]]\nname = "fsi"\ngoal = "min"\n'
    run = evocity.open_run(make_run(tmp_path / "run", recipe=recipe))
    gsi, fsi = run.columns.aims
    assert (gsi.target, gsi.wanted) == (0.35, "0.35 is wanted")
    assert gsi.loss(0.25) == pytest.approx(0.1)
    assert (fsi.wanted, fsi.loss(3.0)) == ("less is better", 3.0)
    recipe = '[[fitness]]\nname = "gsi"\nlike = "lyon-1er"\n'
    found = {"fitness": [{"name": "gsi", "goal": "like", "target": 0.6}]}
    like = evocity.open_run(make_run(tmp_path / "like", recipe=recipe, provenance=found))
    assert Page(like).aims[0]["wanted"] == "0.6 is wanted"


def test_the_void_is_no_parent(tmp_path):
    run = evocity.open_run(make_run(tmp_path / "run-2", generations=1, also=(VOID,)))
    assert summary_of(run)["cities"] == "A × B"
    page = Page(run)
    assert page.about["title"] == "run run-2"
    assert [one["name"] for one in page.parents] == ["A", "B"]


def test_a_page_of_a_run_that_goes_on_tells_of_one_generation(tmp_path, monkeypatch):
    from evocity.store import RunLog

    run = evocity.open_run(told_run(tmp_path / "run", generations=6))
    whole, ends = run.generations, iter(range(1, 100))
    monkeypatch.setattr(  # one generation more each time the folder is looked at
        RunLog, "generations", property(lambda _: whole[: min(1 + next(ends), len(whole))])
    )
    page = Page(run.refresh())
    last = page.run.columns.last
    assert last < whole[-1]
    assert max(page.lineage["generations"]) == last
    assert {card["generation"] for card in page.keep} <= set(range(last + 1))
    assert all(one["generations"][-1] == last for one in page.curves)


def test_choices_of_others_do_not_change_the_page(told):
    """A card is made of the shortlist alone."""
    run = evocity.open_run(told)
    page = Page(run)
    page.__dict__["shortlist"] = choose_shortlist(run.columns, np.array([0]), run.likeness, 1)
    assert [card["id"] for card in page.keep] == [0]
    assert SimpleNamespace(**page.keep[0]).role == "compromise"
