"""A run replays some of its births by itself, and tells of those that are not the same."""

import pytest
from test_search_commands import events
from test_search_islands import THREE
from test_search_replay import DRAWS
from test_search_run import rows, run

from evocity.search import Search, read_recipe, schedules
from evocity.search.schedules import ReplayCheck
from evocity.store import RunLog

WINDOW = "[search]\nwindow = 5\n"
COUNTS = """
@evocity.fitness(goal="max")
def counted(city):
    with open({path!r}, "a") as file:
        file.write("x")
    return 1.0
"""


@pytest.fixture
def often(monkeypatch):
    """Sets the share of births that are replayed."""
    return lambda rate: monkeypatch.setattr(schedules, "RATE", rate)


def chosen(search):
    """The ids that a search of 4 generations of 8 replays."""
    one = ReplayCheck(search._prepared, lambda name, **details: None)
    return [number for number in range(32) if one.is_chosen(number)]


@pytest.mark.slow_cases(
    "-2", "[search]\\nwindow = 5\\n-2", "[refine]\\nbirths = 1\\nbudget = 4\\n-2"
)
@pytest.mark.parametrize("workers", [0, 2])
@pytest.mark.parametrize("search", ["", WINDOW, "[refine]\nbirths = 1\nbudget = 4\n"])
def test_replayed_births_change_nothing_and_are_the_same(toy, tmp_path, often, search, workers):
    count = tmp_path / "count"
    recipe = toy(recipe=search, measures=COUNTS.format(path=str(count)))
    taken = []
    for rate in (0.0, 0.5):
        often(rate)
        count.write_text("")
        run(recipe, tmp_path / str(rate), workers=workers)
        taken.append(len(count.read_text()))
        assert events(tmp_path / str(rate), "differs") == []
    assert rows(tmp_path / "0.0") == rows(tmp_path / "0.5")
    assert taken[0] < taken[1]


def test_each_chosen_birth_is_measured_twice_and_others_once(toy, tmp_path, often):
    count = tmp_path / "count"
    often(0.3)
    for search in ("", WINDOW):
        count.write_text("")
        recipe = read_recipe(toy(recipe=search, measures=COUNTS.format(path=str(count))))
        with Search(recipe, workers=0) as going:
            going.prepare()
            before, number = len(count.read_text()), len(chosen(going))
            list(going)
        assert 0 < number < 32
        assert len(count.read_text()) - before == 32 + number


@pytest.mark.slow_cases("-2", "[search]\\nwindow = 5\\n-2", "search2-2")
@pytest.mark.parametrize("workers", [0, 2])
@pytest.mark.parametrize("search", ["", WINDOW, THREE])
def test_a_measure_that_draws_at_random_is_told(toy, tmp_path, often, search, workers):
    often(0.3)
    population = 15 if search == THREE else 8
    recipe = read_recipe(toy(recipe=search, measures=DRAWS, population=population))
    out = tmp_path / "run"
    with Search(recipe, out, workers=workers) as going:
        list(going)
        one = ReplayCheck(going._prepared, lambda name, **details: None)
        expected = [number for number in range(4 * population) if one.is_chosen(number)]
    found = events(out, "differs")
    assert sorted(event["id"] for event in found) == expected
    births = {birth.id: birth for birth in RunLog(out).individuals(expected)}
    for event in found:
        assert event["generation"] == births[event["id"]].generation
        assert list(event["differs"]) == ["fitness.luck"]
        pair = event["differs"]["fitness.luck"]
        assert pair["then"] == births[event["id"]].values["luck"] != pair["now"]


def test_one_birth_in_a_thousand_is_chosen(toy):
    recipe = read_recipe(toy(population=1000, generations=99))
    prepared = type("Prepared", (), {"recipe": recipe, "aims": None})
    one = ReplayCheck(prepared, lambda name, **details: None)
    assert 60 < sum(one.is_chosen(number) for number in range(100_000)) < 140
