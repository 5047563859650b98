"""Births of a generation other than the population: `[search] births`."""

import pytest
from test_search_run import rows, run

from evocity.errors import RecipeError, RunError
from evocity.search import Search, read_recipe
from evocity.search.resume.logged_plans import plan_of
from evocity.search.resume.prepared_run import read_preparation
from evocity.store import RunLog

FEW = "[search]\nbirths = 3\n"


def bred(toy, out, recipe=FEW, **overrides):
    run(toy(recipe=recipe, generations=5), out, workers=0, **overrides)
    return RunLog(out)


def test_so_many_are_born_and_so_many_live(toy, tmp_path):
    found = bred(toy, tmp_path / "run")
    births = found.births().to_pylist()
    assert [one["id"] for one in births] == list(range(18))
    assert [one["generation"] for one in births] == [k // 3 for k in range(18)]
    lives = [found.members(generation).num_rows for generation in range(6)]
    assert lives[:2] == [3, 6]
    assert max(lives) == 8
    assert found.header.population == 3
    assert found.provenance["recipe"]["population"] == 8
    assert all(max(one["parents"], default=-1) < 3 * one["generation"] for one in births[8:])


def test_as_many_founders_as_can_live(toy, tmp_path):
    """They have the parents of founders: the sources, which no drawing chose."""
    found = bred(toy, tmp_path / "run")
    births = found.births().to_pylist()
    assert [one["operator"] for one in births[:2]] == ["source", "source"]
    assert all(set(one["parents"]) <= {0, 1} for one in births[:8])
    run(toy(generations=0), tmp_path / "whole", workers=0)
    whole = RunLog(tmp_path / "whole")
    same = [(one["operator"], one["parents"]) for one in whole.births().to_pylist()]
    assert [(one["operator"], one["parents"]) for one in births[:8]] == same


def test_more_may_be_born_than_live(toy, tmp_path):
    found = bred(toy, tmp_path / "run", "[search]\nbirths = 12\n", generations=2)
    assert found.births().num_rows == 36
    assert all(found.members(generation).num_rows <= 8 for generation in range(3))
    assert found.births(0)["parents"].to_pylist()[8] in ([0], [1], [0, 1], [1, 0])


def test_a_generation_of_the_population_is_the_default(toy, tmp_path):
    run(toy(), tmp_path / "plain", workers=0)
    run(toy(recipe="[search]\nbirths = 8\n"), tmp_path / "same", workers=0)
    assert rows(tmp_path / "plain") == rows(tmp_path / "same")


@pytest.mark.slow
def test_stops_and_workers_change_nothing(toy, tmp_path):
    recipe = toy(recipe=FEW + "adapt = true\n", generations=6)
    run(recipe, tmp_path / "whole", workers=0)
    run(recipe, tmp_path / "two", workers=2)
    assert rows(tmp_path / "two") == rows(tmp_path / "whole")
    for last in (0, 1, 4):
        out = tmp_path / f"stopped-{last}"
        run(recipe, out, workers=0, generations=last)
        with Search.resume(out, generations=6, workers=0) as search:
            for _ in search:
                pass
        assert rows(out) == rows(tmp_path / "whole")


def test_births_are_drawn_again_from_the_log(toy, tmp_path):
    found = bred(toy, tmp_path / "run")
    prepared, _ = read_preparation(found)
    for identifier in (0, 4, 7, 9, 17):
        assert plan_of(found, prepared, identifier).id == identifier


def test_they_stay_what_they_are(toy, tmp_path):
    out = tmp_path / "run"
    bred(toy, out)
    for lines, key in (
        ("[search]\nbirths = 4\n", "search.births: was 3, is 4"),
        ("", "search.births: was 3, is None"),
        (FEW, "run.population: was 8, is 9"),
    ):
        other = toy(recipe=lines)
        if key.startswith("run"):
            other.write_text(other.read_text().replace("population = 8", "population = 9"))
        with pytest.raises(RecipeError, match=key):
            Search.resume(out, generations=9, workers=0, recipe=other)
    toy(recipe=FEW)
    assert read_recipe(toy(recipe=FEW)).generation_size == 3
    recipe = out / "recipe.toml"
    recipe.write_text(recipe.read_text().replace("population = 8", "population = 9"))
    with pytest.raises(RunError, match="population"):
        Search.resume(out, generations=9, workers=0, accept_changes=True)
