"""Another recipe for a run that goes on: what changes, what cannot, what is kept of the first."""

import json
import shutil

import pytest
from test_search_recipe import replaced
from test_search_run import rows, run

from evocity.errors import RecipeError
from evocity.search import Search, read_recipe
from evocity.search.record.commands import Pick, Reweight, command_document
from evocity.store import RunLog, append_command, hash_of_text


@pytest.fixture
def begun(toy, tmp_path):
    """A run of three generations, and its recipe."""
    recipe = toy(recipe='[[fitness]]\nname = "gsi"\ntarget = 0.3\n')
    run(recipe, tmp_path / "run", workers=0, generations=2)
    return recipe, tmp_path / "run"


def goes_on(out, **how) -> list[int]:
    with Search.resume(out, workers=0, **how) as search:
        return [one.number for one in search]


def test_targets_weights_and_generations_change_and_the_first_recipe_is_kept(begun):
    recipe, out = begun
    first = recipe.read_text()
    replaced(recipe, "target = 0.3", "target = 0.6")
    replaced(recipe, "mutation = 2", "mutation = 0")
    before = RunLog(out)
    best = before.status()["best"]["gsi"]
    assert goes_on(out, recipe=recipe, generations=4) == [3, 4]
    after = RunLog(out)
    assert (out / "recipe.toml").read_text() == recipe.read_text()
    assert after.recipe_text == recipe.read_text()
    assert after.earlier_recipe(1) == (out / "recipe-1.toml").read_text() == first
    assert after.earlier_recipe(2) is None
    noted = after.provenance["recipe"]
    assert noted["hash"] == hash_of_text(recipe.read_text())
    (earlier,) = noted["before"]
    assert (earlier["file"], earlier["hash"]) == ("recipe-1.toml", hash_of_text(first))
    assert earlier["generations"] == 3
    (event,) = [one for one in after.events() if one["event"] == "recipe"]
    assert event["generation"] == 3
    assert event["before"] == "recipe-1.toml"
    assert set(event["keys"]) == {"operators.mutation", "fitness"}
    assert after.provenance["fitness"][-1]["target"] == 0.6
    later = [one for one in rows(out) if "operator" in one and one["generation"] > 2]
    assert later
    assert "mutation" not in {one["operator"] for one in later}
    # old births are judged by the new target
    assert abs(after.status()["best"]["gsi"] - 0.6) <= abs(best - 0.6)
    assert goes_on(out, generations=5) == [5]  # it stays
    assert RunLog(out).provenance["recipe"]["before"] == [earlier]


def test_a_revised_run_is_resumed_to_the_same_births(begun, tmp_path):
    recipe, out = begun
    shutil.copytree(out, tmp_path / "other")
    replaced(recipe, "target = 0.3", "target = 0.6")
    assert goes_on(out, recipe=recipe, generations=5) == [3, 4, 5]
    with Search.resume(tmp_path / "other", recipe=recipe, workers=0, generations=5) as search:
        next(iter(search))
    assert goes_on(tmp_path / "other") == [4, 5]
    assert rows(out) == rows(tmp_path / "other")


def test_weights_that_commands_set_are_over(begun):
    recipe, out = begun
    append_command(out / "commands.jsonl", command_document(Reweight(weights={"mutation": 9.0})))
    append_command(out / "commands.jsonl", command_document(Pick(ids=(3,))))
    assert goes_on(out, generations=3) == [3]
    with Search.resume(out, workers=0, recipe=recipe, generations=4) as search:
        assert dict(search._steering.orders.weights) == {}
        assert search._steering.orders.picks == (3,)
        assert [one.number for one in search] == [4]


def test_stop_and_notify_may_be_added(begun):
    recipe, out = begun
    recipe.write_text(recipe.read_text() + "[stop]\ntarget = { spread = 0.0 }\n")
    with Search.resume(out, workers=0, recipe=recipe) as search:
        assert search.stopped_by.by == "target"
        assert list(search) == []
    with Search.resume(out, workers=0, recipe=recipe, generations=9) as search:
        assert list(search) != []  # asked for in spite of the target


def test_all_that_cannot_change_is_told_at_once_and_nothing_is_changed(begun, tmp_path):
    recipe, out = begun
    contents = {p: p.read_bytes() for p in out.rglob("*") if p.is_file()}
    for old, new in (
        ("seed = 3", "seed = 4"),
        ("population = 8", "population = 9"),
        ("fit = false", "fit = true"),
        ('map = "left.npy"', 'map = "left.npy"\nname = "west"'),
        ('name = "gsi"\ntarget = 0.3', 'name = "alignment"'),
        ('name = "toy"', 'name = "toy"\nrecord = ["mean_height"]'),
    ):
        replaced(recipe, old, new)
    recipe.write_text(recipe.read_text() + "[search]\nalgorithm = 'nsga2'\n")
    with pytest.raises(RecipeError, match=r"cannot continue with toy\.toml") as caught:
        Search.resume(out, recipe=recipe, generations=1)
    lines = [line.strip() for line in caught.value.found.splitlines()[1:]]
    assert [line.split(":")[0] for line in lines] == [
        "run.seed",
        "run.population",
        "parents",
        "genome",
        "search.algorithm",
        "fitness",
        "run.generations",
    ]
    assert "gsi is missing" in lines[5]
    assert "it cannot change: all births are drawn from it" in lines[0]
    assert {p: p.read_bytes() for p in out.rglob("*") if p.is_file()} == contents


def test_another_source_of_a_measure_is_another_measure(begun, tmp_path):
    recipe, out = begun
    path = tmp_path / "toys.py"
    path.write_text(path.read_text().replace("heights.mean()", "heights.max()"))
    with pytest.raises(RecipeError, match="roof: its source has changed"):
        Search.resume(out, recipe=recipe)


def test_a_change_that_was_cut_short_is_undone(begun):
    _, out = begun
    first = (out / "recipe.toml").read_text()
    (out / "recipe-1.toml").write_text(first)  # provenance was not written any more
    (out / "recipe.toml").write_text(first + "# new\n")
    assert goes_on(out, generations=3) == [3]
    assert (out / "recipe.toml").read_text() == first


def test_a_recipe_of_python_serves_too(begun):
    recipe, out = begun
    revised = read_recipe(replaced(recipe, "target = 0.3", "target = 0.5"), generations=3)
    assert goes_on(out, recipe=revised) == [3]
    assert json.loads((out / "provenance.json").read_text())["recipe"]["overrides"] == {
        "run.generations": 3
    }
