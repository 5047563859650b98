"""Measures that compare cities: what a recipe names, what workers get, what resuming watches."""

import json
import shutil

import numpy as np
import pytest
from toy_runs import unsealed

from evocity.citymap import CityMap
from evocity.coding import decode
from evocity.errors import FitnessError, RecipeError, RunError
from evocity.fitness import Reference, fabric_distance, get
from evocity.io import read_map, write_map
from evocity.search import Search, read_recipe
from evocity.search.preparation.preparation import prepare
from evocity.store import RunLog

FABRIC = '[[fitness]]\nname = "fabric_distance"\n'


def bred(recipe, out):
    with Search(read_recipe(recipe), out) as search:
        for _ in search:
            pass
    return RunLog(out)


@pytest.mark.slow_cases("2")
@pytest.mark.parametrize("workers", [0, 2])
def test_children_are_compared_with_the_sources_they_are_laid_of(toy, tmp_path, workers):
    recipe = toy(recipe=FABRIC, population=6, generations=1, workers=workers)
    run = bred(recipe, tmp_path / "run")
    reference = Reference.sources([source.city for source in run.sources()])
    values = {row["id"]: row["fitness.fabric_distance"] for row in run.births().to_pylist()}
    assert len(values) == 12
    for number, value in values.items():
        genome = run.genome(number)
        expected = fabric_distance(decode(genome).city, reference, genome)
        assert value == pytest.approx(float(expected), abs=1e-9, nan_ok=True)
    assert len({value for value in values.values() if np.isfinite(value)}) > 6
    noted = run.provenance["fitness"][-1]
    assert (noted["name"], noted["goal"], noted["reference"]) == (
        "fabric_distance",
        "min",
        "parents",
    )


def test_cities_that_are_named_weigh_alike(toy, tmp_path):
    entry = '[[fitness]]\nname = "fabric_distance.roughness"\nreference = ["west", "model.npy"]\n'
    path = toy(recipe=entry, population=4, generations=0, workers=0)
    path.write_text(path.read_text().replace('"left.npy"', '"left.npy"\nname = "west"'))
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy").T)
    run = bred(path, tmp_path / "run")
    west = run.sources()[0].city
    model = read_map(tmp_path / "model.npy", pixels=64, metres_per_pixel=2.0)
    measure = get("fabric_distance.roughness")
    for row in run.births().to_pylist():
        city = decode(run.genome(row["id"])).city
        value = row["fitness.fabric_distance.roughness"]
        assert value == pytest.approx(measure(city, [west, model]), abs=1e-9)
    noted = run.provenance["fitness"][-1]["reference"]
    assert list(noted) == ["left.npy", "model.npy"]

    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy"))
    changed = r"the map model\.npy, which cities are compared with \(the run keeps its own copy\)"
    with pytest.raises(RunError, match=changed):
        Search.resume(run.path, generations=1)
    with Search.resume(run.path, generations=1, accept_changes=True) as search:
        (city,) = search._prepared.others
    assert np.array_equal(city.heights, model.heights)


def test_a_city_may_stand_alone(toy):
    path = toy(recipe=FABRIC + 'reference = "right.npy"\n')
    prepared = prepare(read_recipe(path))
    (city,) = prepared.references["fabric_distance"].cities
    assert city.name == "right"


def test_a_resumed_run_compares_as_before(toy, tmp_path):
    recipe = toy(recipe=FABRIC, population=6, generations=2, workers=0)
    whole = bred(recipe, tmp_path / "whole")
    with Search(read_recipe(recipe), tmp_path / "parted") as search:
        next(iter(search))
    with Search.resume(tmp_path / "parted") as search:
        for _ in search:
            pass
    parted = RunLog(tmp_path / "parted").births()
    for column in ("id", "fitness.fabric_distance", "status"):
        assert whole.births().column(column).equals(parted.column(column))


def test_the_cities_compared_with_go_with_the_run(toy, tmp_path):
    entry = FABRIC + 'reference = ["left", "model.npy", "other.npy"]\n'
    recipe = toy(recipe=entry, population=6, generations=2, workers=0)
    for name, turned in (("model", 1), ("other", 2)):
        np.save(tmp_path / f"{name}.npy", np.rot90(np.load(tmp_path / "right.npy"), turned))
    whole = bred(recipe, tmp_path / "whole")
    assert [city.name for city in whole.references()] == ["model", "other"]
    with Search(read_recipe(recipe), tmp_path / "parted") as search:
        next(iter(search))
    (tmp_path / "away").mkdir()
    (tmp_path / "parted").rename(tmp_path / "away" / "parted")
    for path in tmp_path.glob("*.npy"):
        path.unlink()
    with Search.resume(tmp_path / "away" / "parted") as search:
        assert search.notes == []
        for _ in search:
            pass
    parted = RunLog(tmp_path / "away" / "parted")
    for column in ("id", "fitness.fabric_distance", "genome"):
        assert whole.births().column(column).equals(parted.births().column(column))


def test_names_mean_the_same_cities_where_the_files_are_gone(toy, tmp_path):
    """The map of a parent may be called otherwise than its file, which is not there any more."""
    recipe = toy(recipe=FABRIC + 'reference = ["right"]\n', population=4, generations=1, workers=0)
    left = CityMap(np.load(tmp_path / "left.npy"), 2.0, name="right", origin=(0.0, 0.0))
    write_map(left, tmp_path / "left.tif")
    recipe.write_text(recipe.read_text().replace("left.npy", "left.tif"))
    named = prepare(read_recipe(recipe)).named["right"]
    whole = bred(recipe, tmp_path / "whole")
    assert whole.provenance["references"][0]["name"] == "right"
    number = whole.provenance["references"][0]["source"]
    assert np.array_equal(whole.sources()[number].city.heights, named.heights)
    with Search(read_recipe(recipe), tmp_path / "parted") as search:
        next(iter(search))
    (tmp_path / "away").mkdir()
    (tmp_path / "parted").rename(tmp_path / "away" / "parted")
    for path in (*tmp_path.glob("*.npy"), *tmp_path.glob("*.tif")):
        path.unlink()
    with Search.resume(tmp_path / "away" / "parted") as search:
        for _ in search:
            pass
    parted = RunLog(tmp_path / "away" / "parted").births()
    assert (
        whole.births()
        .column("fitness.fabric_distance")
        .equals(parted.column("fitness.fabric_distance"))
    )


def test_another_reference_is_another_run(toy, tmp_path):
    entry = FABRIC + 'reference = ["model.npy"]\n'
    recipe = toy(recipe=entry, population=4, generations=0, workers=0)
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy").T)
    run = bred(recipe, tmp_path / "run")
    text = (run.path / "recipe.toml").read_text()
    (run.path / "recipe.toml").write_text(text.replace('["model.npy"]', '["model.npy", "left"]'))
    with pytest.raises(RunError, match=r"the reference of measures was .* and is now"):
        Search.resume(run.path, generations=1, accept_changes=True)


@pytest.mark.parametrize(
    ("place", "value"),
    [(("references",), 5), (("references",), [{}]), (("fitness", -1, "reference"), ["model.npy"])],
)
def test_a_provenance_at_fault_is_told(toy, tmp_path, place, value):
    entry = FABRIC + 'reference = ["model.npy"]\n'
    recipe = toy(recipe=entry, population=4, generations=0, workers=0)
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy").T)
    run = bred(recipe, tmp_path / "run")
    told = unsealed(run.path / "provenance.json")
    *way, last = place
    inner = told
    for key in way:
        inner = inner[key]
    inner[last] = value
    (run.path / "provenance.json").write_text(json.dumps(told))
    with pytest.raises(RunError, match=r"provenance\.json (lacks|is damaged)|holds other maps"):
        Search.resume(run.path, generations=1)


@pytest.mark.parametrize("harm", ["gone", "another", "less"])
def test_harmed_copies_are_told(toy, tmp_path, harm):
    entry = FABRIC + 'reference = ["model.npy"]\n'
    recipe = toy(recipe=entry, population=4, generations=0, workers=0)
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy").T)
    run = bred(recipe, tmp_path / "run")
    (heights,) = (run.path / "references").glob("*.npy")
    if harm == "gone":
        heights.unlink()
    elif harm == "another":
        np.save(heights, np.load(heights) + np.float32(1))
    else:
        shutil.rmtree(run.path / "references")
    with pytest.raises(RunError, match="references"):
        Search.resume(run.path, generations=1)


def test_a_run_that_kept_no_copies_reads_the_files_again(toy, tmp_path):
    entry = FABRIC + 'reference = ["model.npy"]\n'
    recipe = toy(recipe=entry, population=4, generations=1, workers=0)
    np.save(tmp_path / "model.npy", np.load(tmp_path / "right.npy").T)
    whole = bred(recipe, tmp_path / "whole")
    with Search(read_recipe(recipe), tmp_path / "run") as search:
        next(iter(search))
    told = tmp_path / "run" / "provenance.json"
    provenance = unsealed(told)
    del provenance["references"]
    told.write_text(json.dumps(provenance))
    shutil.rmtree(tmp_path / "run" / "references")
    with Search.resume(tmp_path / "run") as search:
        for _ in search:
            pass
    births = RunLog(tmp_path / "run").births()
    assert whole.births().column("genome").equals(births.column("genome"))
    (tmp_path / "model.npy").unlink()
    with pytest.raises(RunError, match=r"the map model\.npy, which cities are compared with"):
        Search.resume(tmp_path / "run", generations=2)


def test_what_is_left_out_is_told_before_the_first_birth(toy, tmp_path):
    heights = np.zeros((64, 64), np.float32)
    rng = np.random.default_rng(5)
    for row in range(5):
        for column in range(6):
            tall, wide = rng.integers(3, 8, 2)
            heights[12 * row : 12 * row + tall, 10 * column : 10 * column + wide] = 9
    path = toy(recipe=FABRIC + 'reference = ["flat.npy"]\n')
    np.save(tmp_path / "flat.npy", heights)
    told = []
    prepare(read_recipe(path), told.append)
    (line,) = [text for text in told if "leaves out" in text]
    assert "share of party walls, roughness, height" in line
    assert "flat" in line


def test_a_reference_of_too_few_buildings_is_refused_at_the_start(toy, tmp_path):
    path = toy(recipe=FABRIC + 'reference = ["bare.npy"]\n')
    np.save(tmp_path / "bare.npy", np.zeros((64, 64), np.float32))
    with pytest.raises(FitnessError, match="no meaning beside bare: 0 buildings"):
        Search(read_recipe(path), tmp_path / "run").ask()
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ('name = "gsi"\ntarget = 0.3\nreference = "parents"', "which compares with no city"),
        ('name = "fabric_distance"\nreference = []', '"parents", or a list of cities'),
        ('name = "fabric_distance"\nreference = 3', '"parents", or a list of cities'),
        ('name = "fabric_distance"\nreference = ["lyon-1er", 3]', '"parents", or a list'),
        ('name = "fabric_distance"\nreference = ["lion-1er"]', "did you mean lyon-1er"),
        ('name = "fabric_distance"\nlike = "lyon-1er"', "which needs reference"),
    ],
)
def test_references_that_are_none_are_told(toy, entry, says):
    with pytest.raises(RecipeError) as caught:
        read_recipe(toy(recipe=f"[[fitness]]\n{entry}\n"))
    assert says in caught.value.found
