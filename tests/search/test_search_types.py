"""A table of building types as a file of measures: what workers get, what a run keeps of it."""

import numpy as np
import pytest

from evocity.coding import decode
from evocity.errors import RecipeError, RunError
from evocity.fitness import building_types, load_file, type_distance
from evocity.search import Search, read_recipe
from evocity.store import RunLog

TABLE = """
[[type]]
name = "low"
height = { below = 9 }
[[type]]
name = "high"
height = { from = 9 }
"""
ENTRY = '[[fitness]]\nfile = "storeys_of.toml"\nname = "storeys_of_distance"\n'


def bred(recipe, out):
    with Search(read_recipe(recipe), out) as search:
        for _ in search:
            pass
    return RunLog(out)


def values_of(run, name):
    return {row["id"]: row[f"fitness.{name}"] for row in run.births().to_pylist()}


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_a_known_distribution_is_bred_for(toy, tmp_path, workers):
    recipe = toy(recipe=ENTRY, population=6, generations=1, workers=workers)
    (tmp_path / "storeys_of.toml").write_text(TABLE + "[shares]\nlow = 0.5\nhigh = 0.5\n")
    run = bred(recipe, tmp_path / "run")
    *_, distance = load_file(tmp_path / "storeys_of.toml")
    for number, value in values_of(run, "storeys_of_distance").items():
        expected = distance(decode(run.genome(number)).city)
        assert value == pytest.approx(expected, abs=1e-9, nan_ok=True)
    noted = run.provenance["fitness"][-1]
    assert (noted["file"], noted["kept"]) == ("storeys_of.toml", "fitness/storeys_of.toml")
    assert noted["hash"] == distance.source_hash
    assert "reference" not in noted


def test_a_table_without_shares_compares_with_cities(toy, tmp_path):
    recipe = toy(
        recipe=ENTRY + 'reference = "model.npy"\n[[fitness]]\nname = "type_distance"\n',
        population=4,
        generations=0,
        workers=0,
    )
    (tmp_path / "storeys_of.toml").write_text(TABLE)
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy").T)
    run = bred(recipe, tmp_path / "run")
    noted = run.provenance["fitness"]
    assert list(noted[-2]["reference"]) == ["model.npy"]
    assert noted[-1]["reference"] == "parents"
    assert all(0 <= value <= 1 for value in values_of(run, "type_distance").values())
    source = run.sources()[0]
    whole = decode(source.genome).city
    assert type_distance(whole, source.city) == pytest.approx(
        values_of(run, "type_distance")[0], abs=1e-9
    )


def test_a_type_by_name_may_be_like_a_city_s(toy, tmp_path):
    entry = '[[fitness]]\nname = "building_types.row"\nlike = "right"\n'
    run = bred(toy(recipe=entry, population=4, generations=0, workers=0), tmp_path / "run")
    told = {one["name"]: one["target"] for one in run.provenance["fitness"]}
    city = run.sources()[1].city
    assert told["building_types.row"] == pytest.approx(building_types(city)["row"])


def test_a_run_goes_on_by_the_table_it_kept(toy, tmp_path):
    recipe = toy(recipe=ENTRY, population=4, generations=1, workers=0)
    (tmp_path / "storeys_of.toml").write_text(TABLE)
    run = bred(recipe, tmp_path / "run")
    kept = run.path / "fitness" / "storeys_of.toml"
    assert kept.read_text() == TABLE
    (tmp_path / "storeys_of.toml").write_text(TABLE.replace("9", "12"))
    with pytest.raises(RunError, match="the measure storeys_of_distance"):
        Search.resume(run.path, generations=2)
    (tmp_path / "storeys_of.toml").unlink()
    with Search.resume(run.path, generations=2) as search:
        list(search)
    assert len(values_of(RunLog(run.path), "storeys_of_distance")) == 12


@pytest.mark.parametrize(
    ("table", "says"),
    [
        (TABLE.replace("from = 9", "from = 12"), "no type includes a building of"),
        (
            TABLE.replace("below = 9", "below = 12"),
            "the limits of low and of high both include a building of",
        ),
        (None, "no table at"),
    ],
)
def test_tables_at_fault_are_refused_before_a_run_begins(toy, tmp_path, table, says):
    recipe = toy(recipe=ENTRY)
    if table:
        (tmp_path / "storeys_of.toml").write_text(table)
    with pytest.raises(RecipeError, match=says):
        read_recipe(recipe)
